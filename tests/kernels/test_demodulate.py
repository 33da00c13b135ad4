"""The contract of a demodulation kernel: frames and matrices in, five maps out.

The tests know nothing of how the kernel is made. An implementation is a function with the
signature `Demodulate`; another one (of another compiler, or on another device) is added to
`IMPLEMENTATIONS` and must pass all of this.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.kernels import demodulate as compiled
from fringeworks.model import Frames

Array = NDArray[np.floating]
Floats = NDArray[np.float32]


class Demodulate(Protocol):
    def __call__(
        self,
        frames: Frames,
        basis: Floats,
        solve: Floats,
        covariance: Floats,
        saturation: float,
        phase: Floats,
        offset: Floats,
        modulation: Floats,
        residual: Floats,
        spread: Floats,
    ) -> None: ...


IMPLEMENTATIONS: list[Demodulate] = [compiled.demodulate]

every_implementation = pytest.mark.parametrize("kernel", IMPLEMENTATIONS, ids=["compiled"])


@dataclass(frozen=True)
class Result:
    phase: Floats
    offset: Floats
    modulation: Floats
    residual: Floats
    spread: Floats


def basis_of(shifts: Array) -> Array:
    return np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)


def run(kernel: Demodulate, frames: Frames, shifts: Array, saturation: float = np.inf) -> Result:
    basis = basis_of(shifts)
    inverse = np.linalg.inv(basis.T @ basis)
    outputs = [np.full(frames.shape[1:], 99, np.float32) for _ in range(5)]
    kernel(
        frames,
        basis.astype(np.float32),
        (inverse @ basis.T).astype(np.float32),
        np.array([inverse[1, 1], inverse[1, 2], inverse[2, 2]], np.float32),
        saturation,
        *outputs,
    )
    return Result(*outputs)


def fringe_frames(phase: Array, shifts: Array, offset: float, modulation: float) -> Frames:
    """Sixteen bits, rounded: half a grey level is the error of every frame."""
    waves = np.cos(phase[np.newaxis] - shifts[:, np.newaxis, np.newaxis])
    return np.rint(offset + modulation * waves).astype(np.uint16)


def wrap(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


@dataclass(frozen=True)
class LeastSquares:
    """What numpy finds in the frames of one pixel, and how far rounding may move it."""

    phase: float
    offset: float
    modulation: float
    residual: float
    spread: float


def least_squares(values: Array, shifts: Array) -> LeastSquares:
    basis = basis_of(shifts)
    (a, c, s), *_ = np.linalg.lstsq(basis, values, rcond=None)
    left = values - basis @ [a, c, s]
    freedom = len(values) - 3
    covariance = np.linalg.inv(basis.T @ basis)
    slope = np.array([0, -s, c]) / (c * c + s * s)  # of atan2(s, c) by (a, c, s)
    return LeastSquares(
        phase=float(np.arctan2(s, c)),
        offset=float(a),
        modulation=float(np.hypot(c, s)),
        residual=float(np.sqrt(left @ left / freedom)) if freedom else np.nan,
        spread=float(np.sqrt(slope @ covariance @ slope)),
    )


def assert_pixel(result: Result, at: tuple[int, int], truth: LeastSquares, slack: float) -> None:
    """`slack` bounds single precision's error of A, C, S, grey levels."""
    assert result.offset[at] == pytest.approx(truth.offset, abs=slack)
    assert result.modulation[at] == pytest.approx(truth.modulation, abs=2 * slack)
    turned = abs(wrap(np.array(result.phase[at] - truth.phase)))
    assert turned <= 2 * slack / truth.modulation + 5e-7
    assert result.residual[at] == pytest.approx(truth.residual, abs=4 * slack, nan_ok=True)
    assert result.spread[at] == pytest.approx(truth.spread, rel=4 * slack / truth.modulation + 1e-4)


def precision(frames: Frames, shifts: Array) -> float:
    """Sums of N products in single precision: N ulps of the largest term, through the inverse."""
    basis = basis_of(shifts)
    solve = np.linalg.pinv(basis)
    return float(4 * 6e-8 * frames.max() * np.abs(solve).sum(axis=1).max() * len(shifts))


@st.composite
def any_shifts(draw: st.DrawFn) -> Array:
    """Three to twelve angles, unequal, that determine a sinusoid well enough to test."""
    count = draw(st.integers(3, 12))
    shifts = draw(st.lists(st.floats(-7, 7), min_size=count, max_size=count))
    basis = basis_of(np.array(shifts))
    assume(np.linalg.cond(basis) < 30)
    return np.array(shifts)


PHASES = np.linspace(-np.pi, np.pi, 60).reshape(4, 15)


@every_implementation
class TestExact:
    @given(shifts=any_shifts(), offset=st.floats(9000, 40000), visibility=st.floats(0.05, 1))
    def test_recovers_offset_modulation_phase(
        self, kernel: Demodulate, shifts: Array, offset: float, visibility: float
    ) -> None:
        modulation = visibility * min(offset, 65535 - offset)
        frames = fringe_frames(PHASES, shifts, offset, modulation)
        result = run(kernel, frames, shifts)
        # Rounding by at most half a level in each frame, through the pseudo-inverse.
        rounding = 0.5 * np.abs(np.linalg.pinv(basis_of(shifts))).sum(axis=1)
        slack = precision(frames, shifts)
        assert np.abs(result.offset - offset).max() <= rounding[0] + slack
        across = np.hypot(rounding[1], rounding[2]) + 2 * slack
        assert np.abs(result.modulation - modulation).max() <= across
        turned = np.abs(wrap(result.phase.astype(float) - PHASES))
        assert turned.max() <= np.arcsin(min(1, across / modulation)) + 5e-7

    @given(shifts=any_shifts(), seed=st.integers(0, 2**32 - 1))
    def test_equals_least_squares(self, kernel: Demodulate, shifts: Array, seed: int) -> None:
        # Frames that are no sinusoid at all: what counts is the least-squares solution.
        rng = np.random.default_rng(seed)
        frames: Frames = rng.integers(0, 256, (len(shifts), 2, 3), dtype=np.uint8)
        result = run(kernel, frames, shifts)
        slack = precision(frames, shifts)
        for at in np.ndindex(2, 3):
            truth = least_squares(frames[:, *at].astype(float), shifts)
            if truth.modulation > 1:
                assert_pixel(result, at, truth, slack)

    @pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
    @pytest.mark.parametrize("count", [3, 4, 5, 8, 12])
    def test_equal_steps(
        self, kernel: Demodulate, dtype: type[np.unsignedinteger], count: int
    ) -> None:
        shifts = 2 * np.pi * np.arange(count) / count
        frames = fringe_frames(PHASES, shifts, 120, 100).astype(dtype)
        result = run(kernel, frames, shifts)
        total = np.einsum("n,nij->ij", np.exp(1j * shifts), frames)  # the textbook's formula
        np.testing.assert_allclose(wrap(result.phase - np.angle(total)), 0, atol=1e-6)
        np.testing.assert_allclose(result.modulation, 2 / count * np.abs(total), rtol=1e-6)
        np.testing.assert_allclose(result.spread, np.sqrt(2 / count) / result.modulation, rtol=1e-5)

    def test_three_frames_have_no_residual(self, kernel: Demodulate) -> None:
        shifts = 2 * np.pi * np.arange(3) / 3
        result = run(kernel, fringe_frames(PHASES, shifts, 100, 50), shifts)
        assert np.isnan(result.residual).all()

    def test_residual_by_hand(self, kernel: Demodulate) -> None:
        # A, B, C, D at 0, 90, 180, 270 degrees: all that a sinusoid cannot be is A - B + C - D,
        # along (1, -1, 1, -1) / 2. Here 8 - 4 = 4, over 2, for one degree of freedom.
        shifts = np.pi / 2 * np.arange(4)
        frames = np.array([104, 102, 104, 102], np.uint8).reshape(4, 1, 1)
        frames[0] += 50
        frames[2] -= 50
        assert run(kernel, frames, shifts).residual[0, 0] == pytest.approx(2.0, abs=1e-4)

    def test_no_modulation_has_no_spread(self, kernel: Demodulate) -> None:
        shifts = np.pi / 2 * np.arange(4)
        result = run(kernel, np.full((4, 1, 1), 100, np.uint8), shifts)
        assert result.modulation[0, 0] == pytest.approx(0, abs=1e-4)
        assert not result.spread[0, 0] < 1e3  # NaN, or as large as rounding makes it

    def test_frames_need_not_be_contiguous(self, kernel: Demodulate) -> None:
        shifts = np.pi / 2 * np.arange(4)
        frames = fringe_frames(PHASES, shifts, 120, 100)
        wide: Frames = np.repeat(frames, 2, axis=2)[:, :, ::2].astype(np.uint16, copy=False)
        assert not wide.flags.c_contiguous
        for name in ("phase", "offset", "modulation", "residual", "spread"):
            np.testing.assert_array_equal(
                getattr(run(kernel, wide, shifts), name), getattr(run(kernel, frames, shifts), name)
            )


@every_implementation
class TestSaturation:
    @pytest.mark.parametrize("count", [4, 5, 8])
    def test_every_pattern_of_saturated_frames(self, kernel: Demodulate, count: int) -> None:
        """One pixel for each subset of frames that are blown out, compared with the rest's fit."""
        shifts = 2 * np.pi * np.arange(count) / count + 0.3
        subsets = list(itertools.product([False, True], repeat=count))
        blown = np.array(subsets).T.reshape(count, 1, -1)
        rng = np.random.default_rng(count)
        clean = rng.integers(20, 240, blown.shape)
        frames = np.where(blown, 255, clean).astype(np.uint8)
        result = run(kernel, frames, shifts, saturation=249.9)
        solved = 0
        for j, lost in enumerate(subsets):
            rest = ~np.array(lost)
            basis = basis_of(shifts[rest])
            # The determinant per frame cubed: how well the frames that are left stand apart.
            apart = np.linalg.det(basis.T @ basis) / max(rest.sum(), 1) ** 3
            if rest.sum() < 3 or apart < 1e-3:
                assert np.isnan(result.phase[0, j])
                continue
            truth = least_squares(frames[rest, 0, j].astype(float), shifts[rest])
            assert_pixel(result, (0, j), truth, 1e-3)
            solved += 1
        assert solved > 2 ** (count - 1) - count  # most of those with few lost frames

    def test_too_close_together_is_void(self, kernel: Demodulate) -> None:
        # Without the frame at 180 degrees those at 0, 3 and 6 are left: no sinusoid to speak of.
        shifts = np.deg2rad([0.0, 3.0, 6.0, 180.0])
        frames = np.array([[100, 101, 103, 255], [100, 101, 103, 90]], np.uint8).T
        result = run(kernel, frames.reshape(4, 1, 2), shifts, saturation=249.9)
        assert np.isnan(result.phase).tolist() == [[True, False]]

    @pytest.mark.parametrize(("step", "void"), [(30, True), (36, False)])
    def test_how_close_is_too_close(self, kernel: Demodulate, step: int, void: bool) -> None:
        # Three left at steps of d: the determinant is (4 sin^2(d/2) sin d)^2, over 27: 6.6e-4 for
        # 30 degrees, 1.9e-3 for 36; the limit is 1e-3.
        shifts = np.deg2rad(step) * np.arange(360 // step)
        frames = np.full((len(shifts), 1, 1), 255, np.uint8)
        frames[:3, 0, 0] = 200, 180, 150
        result = run(kernel, frames, shifts, saturation=249.9)
        assert bool(np.isnan(result.phase[0, 0])) is void

    def test_three_left_have_no_residual(self, kernel: Demodulate) -> None:
        shifts = np.pi / 2 * np.arange(4)
        frames = np.array([255, 120, 40, 130], np.uint8).reshape(4, 1, 1)
        assert np.isnan(run(kernel, frames, shifts, saturation=249.9).residual[0, 0])

    @pytest.mark.parametrize(("level", "lost"), [(249, False), (250, True)])
    def test_at_the_limit(self, kernel: Demodulate, level: int, lost: bool) -> None:
        # 98 % of 255 is 249.9. A fourth frame that contradicts the others shows whether it counts.
        shifts = np.pi / 2 * np.arange(4)
        frames = np.array([level, 120, 40, 130], np.uint8).reshape(4, 1, 1)
        used = slice(1, None) if lost else slice(None)
        truth = least_squares(frames[used, 0, 0].astype(float), shifts[used])
        result = run(kernel, frames, shifts, saturation=249.9)
        assert_pixel(result, (0, 0), truth, 1e-3)

    def test_neighbours_are_untouched(self, kernel: Demodulate) -> None:
        shifts = np.pi / 2 * np.arange(4)
        frames = fringe_frames(PHASES, shifts, 120, 100)
        clean = run(kernel, frames, shifts, saturation=249.9)
        frames[0, 1, 3] = 255
        spoilt = run(kernel, frames, shifts, saturation=249.9)
        elsewhere = np.ones(PHASES.shape, np.bool_)
        elsewhere[1, 3] = False
        for name in ("phase", "offset", "modulation", "residual", "spread"):
            np.testing.assert_array_equal(
                getattr(spoilt, name)[elsewhere], getattr(clean, name)[elsewhere]
            )


@every_implementation
@given(shifts=any_shifts(), phase=st.floats(-3.1, 3.1))
def test_spread_is_the_analytic_covariance(kernel: Demodulate, shifts: Array, phase: float) -> None:
    # d phi / d I_n by finite differences of numpy's own solution, added in squares.
    values = 20000 + 10000 * np.cos(phase - shifts)
    frames = np.rint(values).astype(np.uint16).reshape(-1, 1, 1)
    exact = frames[:, 0, 0].astype(float)
    step = 0.5
    slopes = []
    for n in range(len(shifts)):
        up, down = exact.copy(), exact.copy()
        up[n] += step
        down[n] -= step
        turn = least_squares(up, shifts).phase - least_squares(down, shifts).phase
        slopes.append(wrap(np.array(turn)) / (2 * step))
    spread = run(kernel, frames, shifts).spread[0, 0]
    # Second order of the differences: (step / B)^2; single precision through the inverse: 1e-4.
    assert spread == pytest.approx(np.sqrt(np.sum(np.square(slopes))), rel=1e-3)


def test_rules_by_hand() -> None:
    # Noise: read 3, gain 0.04, black 10: sigma is 5 at 410, 3 at and below 10. Limits: 8 grey
    # levels, 4 sigma of modulation, 2 sigma of residual.
    nan = np.nan
    pixels = [
        # phase, spread, offset, modulation, residual; sigma of the phase, mark
        (0.5, 0.1, 410, 20.0, 10.0, 0.5, 0),  # 4 and 2 sigma exactly are allowed
        (0.5, 0.1, 410, 19.9, 0.0, nan, 2),
        (0.5, 0.1, 410, 50.0, 10.1, nan, 3),
        (0.5, 0.1, 410, 19.9, 10.1, nan, 2),
        (nan, 0.1, 410, 19.9, 10.1, nan, 1),
        (0.5, 0.1, 410, 50.0, nan, 0.5, 0),  # three frames have no residual
        (0.5, 0.1, 10, 12.1, 5.9, 0.3, 0),
        (0.5, 0.1, -90, 11.9, 0.0, nan, 2),  # below black is black: 4 * 3 = 12
    ]
    phase, spread, offset, modulation, residual, sigma, mark = np.array(pixels, np.float32).T
    phi, scale, void = phase[np.newaxis], spread[np.newaxis], np.zeros((1, len(pixels)), np.uint8)
    others = (offset[np.newaxis], modulation[np.newaxis], residual[np.newaxis])
    noise, limits = (3.0, 0.04, 10.0), (8.0, 4.0, 2.0)
    compiled.apply_rules(phi, scale, *others, noise, limits, (1, 2, 3), void)
    assert void[0].tolist() == mark.tolist()
    np.testing.assert_allclose(scale[0], sigma, rtol=1e-6)
    np.testing.assert_allclose(phi[0], np.where(mark == 0, np.float32(0.5), nan))


def test_least_modulation_in_grey_levels() -> None:
    # 9 sigma of a quiet camera are still only 7.2 grey levels of 8.
    ones = np.ones((1, 1), np.float32)
    void = np.zeros((1, 1), np.uint8)
    compiled.apply_rules(
        ones, ones.copy(), ones, 7.2 * ones, 0 * ones, (0.8, 0.0, 0.0), (8.0, 4.0, 2.0), (1, 2, 3),
        void,
    )  # fmt: skip
    assert void.tolist() == [[2]]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_three_steps_alone(dtype: type[np.unsignedinteger]) -> None:
    frames = np.random.default_rng(0).integers(0, 256, (3, 20, 30)).astype(dtype)
    phase = np.empty((20, 30), np.float32)
    compiled.wrap_three_steps(frames, phase)
    first, second, third = frames.astype(float)
    truth = np.arctan2(np.sqrt(3) * (first - third), 2 * second - first - third)
    np.testing.assert_allclose(wrap(phase - truth), 0, atol=5e-7)
