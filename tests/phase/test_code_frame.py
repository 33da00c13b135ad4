"""The code frame read densely: right where it says so, void elsewhere; wrong frames refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.files.capture import read_capture
from fringeworks.model import Capture, Codeword, Fringe, PatternSet, Sensor, Sequence
from fringeworks.patterns import make_sequence
from fringeworks.patterns.codewords import make_code_frame
from fringeworks.phase.chained import order_by_gray
from fringeworks.phase.codeframe import neighbours_needed, order_by_code_frame, orders_of
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.demodulate import MaskRules, demodulate
from fringeworks.phase.orders import AxisFrames
from fringeworks.phase.window import CoordinateWindow, Volume, coordinate_window
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import named_scene, paper_rig
from fringeworks.twin.simulate import simulate
from fringeworks.twin.truth import Truth
from tests.phase.codes import PAPER, Shown

Array = NDArray[np.float64]

V, X = np.mgrid[:120, :300].astype(float)
PLANE = 100 + 0.8 * X + 0.1 * V
CODE = Codeword("x", 32.0, PAPER)


def about(u: Array, below: float = 110.0, above: float = 70.0) -> CoordinateWindow:
    """A window of nearly six fringes: one repeat of the paper's code."""
    middle = np.nan_to_num(u, nan=300.0)
    return CoordinateWindow(
        (middle - below).astype(np.float32), (middle + above).astype(np.float32)
    )


def frames_of(capture: Capture, window: CoordinateWindow | None = None) -> AxisFrames:
    axis = next(p.axis for p, *_ in capture.find(Codeword))
    phases = [demodulate(f, p, capture.sensor) for p, f, _ in capture.find(Fringe)]
    return AxisFrames(capture, axis, tuple(phases), window)


def read(shown: Shown, *, windowed: bool = True, seed: int = 0) -> tuple[float, float]:
    """Share of decided pixels that are right, and share of pixels with a phase that are decided."""
    frames = frames_of(shown.capture(seed=seed), about(shown.u) if windowed else None)
    phase = order_by_code_frame(frames).phase
    wrapped = phase.wrapped.phase
    true = np.rint((shown.fringe.phase_at(0) + 2 * np.pi * shown.u / 32 - wrapped) / (2 * np.pi))
    decided = np.isfinite(phase.margin)
    assert (phase.order[~decided] == -1).all()
    right = phase.order[decided] == true[decided]
    return float(right.mean()), float(decided[np.isfinite(wrapped)].mean())


class TestPlanes:
    @pytest.mark.parametrize("blur", [0.5, 0.8, 1.2])
    @pytest.mark.parametrize("sigma", [0.5, 10.0])  # B / 100 and B / 5
    @pytest.mark.parametrize("name", ["paper", "robust", "de-bruijn"])
    def test_every_pixel(self, name: str, sigma: float, blur: float) -> None:
        code = make_code_frame(name, "x", 32.0, 608)  # type: ignore[arg-type]
        # At B = 5 sigma half the pixels fall below the mask; those that are left are one region.
        shown = Shown(
            PLANE, code, blur_px=blur, sigma=sigma, modulation=50.0 if sigma < 5 else 65.0
        )
        right, coverage = read(shown, windowed=name != "de-bruijn")
        assert right == 1
        assert coverage >= 0.97

    @pytest.mark.parametrize("u", [400 - 0.9 * X, 80 + 1.6 * X, 200 + 0.35 * X + 0.3 * V])
    def test_slopes(self, u: Array) -> None:
        assert read(Shown(u, CODE)) == (1, 1)

    def test_order_zero_and_the_last(self) -> None:
        # Half fringes at both edges; light from outside the image is none, so pixels are masked.
        u = np.broadcast_to(np.linspace(0, 607, 700), (60, 700))
        right, coverage = read(Shown(u, CODE))
        assert right == 1
        assert coverage == 1

    def test_rows(self) -> None:
        shown = Shown(PLANE.T, replace(CODE, axis="y"))
        frames = frames_of(shown.capture(), about(shown.u))
        phase = order_by_code_frame(frames).phase
        assert np.isfinite(phase.margin).all()

    def test_texture_and_ambient_light_cancel(self) -> None:
        rng = np.random.default_rng(0)
        albedo = 0.35 + 0.65 * rng.random((12, 30)).repeat(10, 0).repeat(10, 1)
        shown = Shown(PLANE, CODE, offset=20 + 75 * albedo, modulation=65 * albedo)
        right, coverage = read(shown)
        assert right == 1
        assert coverage >= 0.99

    def test_margin_is_one_minus_the_odds(self) -> None:
        frames = frames_of(Shown(PLANE, CODE).capture(), about(PLANE))
        margin = order_by_code_frame(frames).phase.margin
        assert (margin[np.isfinite(margin)] >= 0.99).all()  # ln 100
        assert (margin[np.isfinite(margin)] <= 1).all()


class TestParts:
    def test_isolated_objects_in_any_order(self) -> None:
        u = np.where(X < 140, 100 + 0.8 * X, 40 + 0.8 * X)
        u[:, 130:150] = np.nan
        assert read(Shown(u, CODE)) == (1, 1)

    @pytest.mark.parametrize("sigma", [1.0, 8.0])
    def test_a_jump_of_whole_fringes(self, sigma: float) -> None:
        # Nothing but the code shows it: the wrapped phase is the same as without. Pixels within
        # half a quarter of the squares that are asked, 2 px, are void, others nearby may be.
        disc = np.hypot(V - 60, X - 150) < 45
        right, coverage = read(Shown(PLANE + 64 * disc, CODE, sigma=sigma))
        assert right >= 0.999
        assert coverage >= 0.9

    def test_too_small_to_decide(self) -> None:
        speck = np.where((abs(V - 60) < 4) & (abs(X - 40) < 4), PLANE, np.nan)
        frames = frames_of(Shown(speck, CODE).capture(), about(PLANE))
        phase = order_by_code_frame(frames).phase
        assert np.isfinite(phase.wrapped.phase).any()
        assert np.isnan(phase.margin).all()

    @pytest.mark.parametrize("name", ["robust", "de-bruijn"])
    def test_an_object_that_is_not_where_it_is_said_to_be(self, name: str) -> None:
        # Two fringes further than the window says: no start inside it fits, the nearest is wrong.
        code = make_code_frame(name, "x", 32.0, 608)  # type: ignore[arg-type]
        u = np.where((X > 195) & (X < 205), np.nan, PLANE)
        window = about(PLANE - 64 * (X > 200), 40, 30)
        phase = order_by_code_frame(frames_of(Shown(u, code).capture(), window)).phase
        assert np.isfinite(phase.margin[:, :190]).all()
        assert np.isnan(phase.margin[:, 210:]).all()

    def test_a_window_that_admits_two_repeats_decides_nothing(self) -> None:
        frames = frames_of(Shown(PLANE, CODE).capture(), about(PLANE, 200.0, 200.0))
        assert np.isnan(order_by_code_frame(frames).phase.margin).all()


def with_code(capture: Capture, image: NDArray[np.generic]) -> Capture:
    """The capture with another image in the code frame's place."""
    return replace(capture, frames=(*capture.frames[:-1], image[None].astype(np.uint8)))


class TestRefusals:
    SHOWN = Shown(PLANE, CODE)
    CAPTURE = SHOWN.capture()

    @pytest.mark.parametrize("level", [5, 120])
    def test_a_flat_frame(self, level: int) -> None:
        noise = np.random.default_rng(1).standard_normal(PLANE.shape)
        frames = frames_of(with_code(self.CAPTURE, level + noise), about(PLANE))
        with pytest.raises(DecodeError, match=r"the code frame along x shows .* in the order of"):
            order_by_code_frame(frames)

    @pytest.mark.parametrize("place", [0, 1, 2])
    def test_a_fringe_in_its_place(self, place: int) -> None:
        frames = frames_of(with_code(self.CAPTURE, self.CAPTURE.frames[0][place]), about(PLANE))
        with pytest.raises(DecodeError, match="shows something else where the fringes are"):
            order_by_code_frame(frames)

    def test_swapped_with_a_fringe(self) -> None:
        first, second, third = self.CAPTURE.frames[0]
        code = self.CAPTURE.frames[1]
        swapped = (np.stack([first, second, code[0]]), third[None])
        frames = frames_of(replace(self.CAPTURE, frames=swapped), about(PLANE))
        with pytest.raises(DecodeError, match="in the order of capture"):
            order_by_code_frame(frames)

    def test_saturated(self) -> None:
        frames = frames_of(with_code(self.CAPTURE, np.full(PLANE.shape, 255)), about(PLANE))
        with pytest.raises(DecodeError, match="saturated on 100% of the pixels that have fringes"):
            order_by_code_frame(frames)

    def test_without_its_fringes(self) -> None:
        coarse = replace(self.SHOWN.fringe, period_px=64.0)
        sets = (PatternSet(coarse), self.CAPTURE.sequence.sets[1])
        old = self.CAPTURE.sequence
        capture = replace(self.CAPTURE, sequence=Sequence(old.width, old.height, sets))
        with pytest.raises(DecodeError, match=r"read against fringes of 32 px, and the capture"):
            order_by_code_frame(frames_of(capture, about(PLANE)))

    def test_repeats_and_no_window(self) -> None:
        with pytest.raises(DecodeError, match=r"repeats .* by --rig rig.json.* --z-range MIN:MAX"):
            order_by_code_frame(frames_of(self.CAPTURE))

    def test_none_at_all(self) -> None:
        frames = replace(frames_of(self.CAPTURE), axis="y")
        with pytest.raises(DecodeError, match="no code frame along y"):
            order_by_code_frame(frames)


@pytest.mark.parametrize(
    ("name", "extent", "needed"),
    # 20 orders: all runs of 14 of a cycle of 6 appear twice (0..13 and 6..19), of 15 none does.
    [("paper", 608, 15), ("robust", 608, 15), ("de-bruijn", 608, 2), ("de-bruijn", 1920, 3)],
)
def test_neighbours_needed(name: str, extent: int, needed: int) -> None:
    code = make_code_frame(name, "x", 32.0, extent)  # type: ignore[arg-type]
    assert neighbours_needed(orders_of(code, extent)) == needed


def noisy(capture: Capture, ratio: float | None) -> Capture:
    """Eight bits, and noise of the median modulation over `ratio`; None: shot noise alone."""
    rng = np.random.default_rng(0)
    scale = 255 / capture.sensor.full_scale
    fringes = capture.frames[0] * scale
    shifts = np.array([[[2 * np.pi / 3]], [[0.0]], [[-2 * np.pi / 3]]])
    modulation = np.abs((2 / 3) * (fringes * np.exp(1j * shifts)).sum(axis=0))
    flat = np.median(modulation[modulation > 8])
    stacks = []
    for stack in capture.frames:
        grey = stack * scale
        sigma = np.sqrt(0.2 + grey * 255 / 12_000) if ratio is None else flat / ratio
        grey = grey + sigma * rng.standard_normal(grey.shape)
        stacks.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    return replace(capture, frames=tuple(stacks), sensor=Sensor(255.0))


class TestTwin:
    """The bars of the issue, on the twin's optics: lenses, both blurs, shadows, quantisation."""

    RIG = paper_rig()

    @pytest.fixture(scope="class", params=[("two", 0.5), ("step", 0.8), ("balls", 1.2)], ids=str)
    @classmethod
    def seen(cls, request: pytest.FixtureRequest) -> tuple[Capture, Truth]:
        scene, blur = request.param
        effects = Effects().without_noise()
        shown = replace(effects.projector, blur_px=blur, defocus_px_m=0.0, bits=8)
        size = cls.RIG.projector
        sequence = make_sequence("paper", width=size.width, height=size.height, axes=("x",))
        effects, rng = replace(effects, projector=shown), np.random.default_rng(0)
        made = simulate(named_scene(scene), cls.RIG, sequence, effects=effects, rng=rng)
        return made.capture, made.truth

    @pytest.mark.parametrize("ratio", [None, 5.0])
    def test_orders(self, seen: tuple[Capture, Truth], ratio: float | None) -> None:
        capture, truth = noisy(seen[0], ratio), seen[1]
        window = coordinate_window(Volume(self.RIG, (516.0, 804.0)), "x", capture.shape)
        frames = frames_of(capture, window)
        found = order_by_code_frame(frames).phase
        wrapped = frames.finest
        true = np.rint((wrapped.fringe.phase_at(0) + 2 * np.pi * truth.column / 32) / (2 * np.pi)
                       - wrapped.phase / (2 * np.pi))  # fmt: skip
        known, decided = np.isfinite(true), np.isfinite(found.margin)
        assert np.mean(found.order[known & decided] == true[known & decided]) >= 0.999
        sized = known & regions_of_three(wrapped.phase, np.where(known, true, -1))
        assert np.mean(decided[sized]) >= 0.97
        gray = order_by_gray(frames).phase
        both = decided & np.isfinite(gray.margin)
        differ = np.count_nonzero(gray.order[both] != found.order[both])
        # At B = 5 sigma a Gray bit flips at a few pixels of a hundred thousand.
        assert differ <= (0 if ratio is None else 5)
        same = both & (gray.order == found.order)
        assert np.abs(gray.phase - found.phase)[same].max() <= 1e-9


def regions_of_three(phase: NDArray[np.float32], order: Array) -> NDArray[np.bool_]:
    """Pixels of connected regions (scipy's, four neighbours) that show three orders or more."""
    from scipy.ndimage import label

    labels, count = label(np.isfinite(phase))
    shown = np.unique(np.stack([labels[order >= 0], order[order >= 0]]), axis=1)[0]
    wide = np.bincount(shown.astype(int), minlength=count + 1) >= 3
    wide[0] = False
    return np.asarray(wide[labels])


@pytest.mark.parametrize("name", ["paper", "de-bruijn"])
def test_on_real_surfaces(real: Callable[[str], Path], name: str) -> None:
    """Glossy mugs before a wall: their offset, modulation, noise and columns, blur of 0.8 px."""
    rules = MaskRules(modulation_share=5 / 255)
    coded = decode_phases(read_capture(real("psp3-gray-mugs")), rules=rules).coded[0]
    assert coded.phase is not None
    part = np.s_[300:900, 300:1600]
    u = coded.coordinate.astype(float)[part]
    code = make_code_frame(name, "x", 32.0, 1920)  # type: ignore[arg-type]
    shown = Shown(
        u,
        code,
        extent=1920,
        offset=coded.offset[part].astype(float),
        modulation=np.where(np.isfinite(u), coded.modulation[part], 0).astype(float),
        sigma=coded.phase.wrapped.noise.read,
    )
    right, coverage = read(shown, windowed=name == "paper")
    assert right >= 0.995
    assert coverage >= 0.9
