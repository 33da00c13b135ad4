"""The paper's way to the orders of isolated objects, on captures made from its formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import AbsolutePhase, Axis, Codeword, Frames, Fringe, Pattern
from fringeworks.model.phase import VOID_REGION
from fringeworks.phase.codeword_names import (
    FringeCut,
    name_by_correlation,
    name_by_spectrum,
    peak_frequency,
    table_hz,
)
from fringeworks.phase.demodulate import demodulate
from fringeworks.phase.feature_points import Period, find_feature_periods, find_periods
from fringeworks.phase.orders import AxisFrames, OrderMethod
from fringeworks.phase.paper_code import code_correlation, paper_code, read_code_frame
from fringeworks.phase.template import continue_plane, template_window
from fringeworks.phase.window import CoordinateWindow
from tests.phase.encoding import Scene, capture_of, equal_shifts

Array = NDArray[np.float64]

PERIOD = 32.0
WORDS = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
CODE = Codeword("x", PERIOD, WORDS)
FRINGE = Fringe("x", PERIOD, equal_shifts(3))
WIDTH = 608
METHODS = [paper_code, code_correlation]


def order_at(u: Array) -> NDArray[np.int64]:
    """Order k spans (2 pi k - pi, 2 pi k + pi], phase zero at the image's edge (C19)."""
    return np.ceil((np.nan_to_num(u) + 0.5) / PERIOD - 0.5).astype(int)


def right(found: AbsolutePhase, u: Array) -> NDArray[np.bool_]:
    """Whether phase and order agree with the truth: noise takes pixels at an edge across it."""
    coordinate = PERIOD * found.phase / (2 * np.pi) - 0.5
    return np.abs(coordinate - u) < PERIOD / 2


def code_wave(u: Array, code: Codeword = CODE) -> Array:
    """cos(2 pi (xi - 1/2) / p), xi counted from where the phase jumps (C22); 0 where void."""
    xi = (u + 0.5 + PERIOD / 2) % PERIOD
    words = np.array([code.codeword_of(int(k)) for k in order_at(u).ravel()]).reshape(u.shape)
    wave: Array = np.cos(2 * np.pi * (xi - 0.5) / words)
    return wave


def islands(*columns: tuple[float, float], rows: int = 6, px: float = 0.5) -> Array:
    """``(rows, n)`` coordinates: a surface from each first to last column, with voids between.

    Rows are shifted against each other, so that every sub-pixel offset occurs.
    """
    gap = np.full((rows, 5), np.nan)
    parts: list[Array] = [gap]
    for first, last in columns:
        u = np.arange(first, last, px if last > first else -px)
        parts += [u + 0.13 * np.arange(rows)[:, None], gap]
    return np.concatenate(parts, axis=1)


def frames_of(
    u: Array,
    *,
    code: Codeword = CODE,
    window: CoordinateWindow | None = None,
    shading: Array | float = 1.0,
    contrast: float = 1.0,
    noise: float = 0.0,
) -> AxisFrames:
    """Fringes and code frame of `u`, dark where it is NaN; `shading` scales the light.

    `contrast` is that of the code frame, as a blurred projector leaves it.
    """
    rng = np.random.default_rng(3)
    lit = np.isfinite(u) * shading
    scene = Scene(np.nan_to_num(u), WIDTH, offset=120.0 * lit, modulation=100.0 * lit, read=noise)

    def expose(light: Array) -> Frames:
        return scene.expose(light, rng if noise else None)

    fringe = replace(FRINGE, axis=code.axis)
    turns = (scene.u + 0.5) / PERIOD
    waves = np.stack([np.cos(2 * np.pi * turns - shift) for shift in fringe.shifts_rad])
    sets: list[tuple[Pattern, Frames]] = [
        (fringe, expose(waves)),
        (code, expose(contrast * code_wave(scene.u, code)[None])),
    ]
    capture = capture_of(*sets, extent=WIDTH)
    wrapped = demodulate(sets[0][1], fringe, capture.sensor)
    return AxisFrames(capture, code.axis, (wrapped,), window)


def around(u: Array, reach_px: float, shift_px: float = 0.0) -> CoordinateWindow:
    low, high = (np.asarray(u + shift_px + s * reach_px, np.float32) for s in (-1, 1))
    return CoordinateWindow(low, high)


@pytest.fixture(params=METHODS, ids=lambda method: method.__name__)
def method(request: pytest.FixtureRequest) -> OrderMethod:
    chosen: OrderMethod = request.param
    return chosen


class TestNames:
    @pytest.mark.parametrize("name", [name_by_spectrum, name_by_correlation])
    @pytest.mark.parametrize("index", range(6))
    @pytest.mark.parametrize("per_px", [1.1, 1.7, 2.06])
    def test_every_codeword_at_any_magnification(
        self, name: object, index: int, per_px: float
    ) -> None:
        """Without noise; at 1.1 camera pixels per column p = 2 is all but under-sampled."""
        xi = np.arange(1.3, PERIOD - 1.3, 1 / per_px)
        grey = 100 + 50 * np.cos(2 * np.pi * (xi - 0.5) / WORDS[index])
        cut = FringeCut(grey, 2 * np.pi * xi / PERIOD - np.pi, PERIOD * per_px)
        assert callable(name)
        found, margin = name(cut, CODE)
        assert found == index
        assert 0 < margin <= 1

    def test_frequencies_by_hand(self) -> None:
        # Half a cycle per sample is the end of the axis; 16 cycles in 0.2 s are 80 Hz, plus one.
        assert peak_frequency(np.array([1.0, -1.0] * 16)) == 0.5
        assert table_hz(16.0) == 81.0

    def test_margin_is_zero_halfway(self) -> None:
        """Between 8 and 10 2/3 cycles, peak moved there by the length alone."""
        xi = np.arange(0.5, PERIOD, 0.5)
        cut = FringeCut(np.cos(2 * np.pi * (xi - 0.5) / 4), xi, 2 * PERIOD * (8 + 4 / 3) / 8)
        # The peak of 8 cycles in a box of 64 samples is displaced by its mirror image, < 0.03.
        assert name_by_spectrum(cut, CODE)[1] == pytest.approx(0.0, abs=0.03)

    def test_shading_outdoes_the_code_in_a_spectrum(self) -> None:
        """A limit of the paper's method: the peak of a strong slope belongs to no codeword."""
        xi = np.arange(0.5, PERIOD, 0.5)
        grey = 100 + 5 * xi + 10 * np.cos(2 * np.pi * (xi - 0.5) / 4)
        cut = FringeCut(grey, 2 * np.pi * xi / PERIOD - np.pi, 64.0)
        assert name_by_spectrum(cut, CODE)[1] < 0
        assert name_by_correlation(cut, CODE)[0] == 2

    def test_one_codeword_alone(self) -> None:
        code = replace(CODE, codewords_px=(4.0,))
        xi = np.arange(0.5, PERIOD, 0.5)
        cut = FringeCut(np.cos(2 * np.pi * (xi - 0.5) / 4), 2 * np.pi * xi / PERIOD - np.pi, 64.0)
        assert name_by_spectrum(cut, code) == (0, 1.0)
        assert name_by_correlation(cut, code) == (0, 1.0)

    def test_a_flat_fringe_has_no_correlation(self) -> None:
        flat = FringeCut(np.full(60, 80.0), np.linspace(-3, 3, 60), 64.0)
        assert name_by_correlation(flat, CODE)[1] == 0.0


def linear_phase(slope: float, *, pixels: int = 200, rows: int = 1) -> NDArray[np.float32]:
    """Phase with a crossing at 20.25 px in every row, rad."""
    turns = slope * (np.arange(pixels) - 20.25) / (2 * np.pi) + 0.5
    phase = 2 * np.pi * (turns - np.ceil(turns - 0.5))
    return np.tile(phase.astype(np.float32), (rows, 1))


class TestFeaturePoints:
    @pytest.mark.parametrize("sign", [1, -1])
    def test_crossings_and_cut_by_hand(self, sign: int) -> None:
        """64 px a turn: crossings at 20.25 and 84.25, between 20|21 and 84|85; middle at 52."""
        phase = linear_phase(sign * 2 * np.pi / 64, pixels=100)
        (period,) = find_feature_periods(phase, np.zeros_like(phase, np.int32), "x")
        # Single precision of pi, 2.4e-7, over 0.098 rad a pixel
        assert period.start_px == pytest.approx(20.25, abs=1e-5)
        assert period.length_px == pytest.approx(64.0, abs=1e-5)
        assert period.pixel == (0, 52)
        assert period.cut == (0, slice(22, 84))  # without 21 and 84, which see both fringes

    def test_columns_for_phase_along_y(self) -> None:
        phase = linear_phase(2 * np.pi / 64, pixels=100, rows=3)
        none = np.zeros_like(phase, np.int32)
        (along_x,) = find_feature_periods(phase, none, "x")
        (along_y,) = find_feature_periods(np.ascontiguousarray(phase.T), none.T, "y")
        assert along_y.pixel == along_x.pixel[::-1]
        assert along_y.cut == along_x.cut[::-1]
        assert along_y.length_px == along_x.length_px

    def test_nearest_to_the_middle_of_its_region(self) -> None:
        phase = linear_phase(2 * np.pi / 20, pixels=120, rows=9)
        region = np.zeros(phase.shape, np.int32)
        region[:, 60:] = 1
        first, second = find_feature_periods(phase, region, "x")
        # Middles of periods lie at 30.25 + 20 n, those of the regions at 29.5 and 89.5, row 4.
        assert (first.region, first.pixel) == (0, (4, 30))
        assert (second.region, second.pixel) == (1, (4, 90))

    def test_whole_periods_only(self) -> None:
        """Voids, other regions and wraps to and fro part a period; five pixels are none."""
        phase = linear_phase(2 * np.pi / 50, pixels=130, rows=5)
        region = np.zeros(phase.shape, np.int32)
        region[1, 45] = VOID_REGION
        phase[1, 45] = np.nan
        region[2, 40:] = 1
        phase[3, 21], phase[3, 22] = 3.1, -3.1  # noise at the first crossing
        phase[4, 20] = -phase[4, 20]
        found = [(period.line, round(period.start_px)) for period in _periods(phase, region)]
        assert found[:2] == [(0, 20), (0, 70)]
        assert (1, 20) not in found
        assert (2, 20) not in found
        short = linear_phase(2 * np.pi / 5)
        assert not find_feature_periods(short, np.zeros_like(short, np.int32), "x")

    def test_a_fold_is_no_period(self) -> None:
        """Rising through pi and back: two wraps in opposite senses, no whole turn between."""
        rising = np.pi + 1 - 0.1 * np.abs(np.arange(61) - 30.0)
        folded = (rising - 2 * np.pi * np.ceil(rising / (2 * np.pi) - 0.5)).astype(np.float32)
        assert np.count_nonzero(np.abs(np.diff(folded)) > np.pi) == 2
        assert not _periods(folded[None], np.zeros((1, 61), np.int32))

    def test_nothing_valid(self) -> None:
        phase = np.full((4, 50), np.nan, np.float32)
        assert not find_feature_periods(phase, np.full(phase.shape, VOID_REGION, np.int32), "x")


def _periods(phase: NDArray[np.float32], region: NDArray[np.int32]) -> list[Period]:
    return find_periods(phase, region, "x")


class TestOrders:
    @pytest.mark.parametrize("first", range(2, 14))
    def test_islands_of_every_codeword(self, method: OrderMethod, first: int) -> None:
        """Two isolated objects, one whole fringe each: rising and falling phase."""
        edge = (first - 0.5) * PERIOD - 0.5
        other = edge + 3 * PERIOD
        u = islands((edge - 6, edge + 38), (other + 38, other - 6))
        found = method(frames_of(u, window=around(u, 90.0))).phase
        valid = np.isfinite(u)
        assert np.array_equal(np.isfinite(found.margin), valid)
        assert right(found, u)[valid].all()
        assert (found.order[~valid] == -1).all()
        assert np.isnan(found.phase[~valid]).all()

    def test_noise_of_a_tenth(self, method: OrderMethod) -> None:
        """B = 100, sigma = 10: spectrum and correlation of a sharp code hold."""
        u = islands((100.0, 260.0), (330.0, 480.0), rows=20)
        found = method(frames_of(u, window=around(u, 90.0), noise=10.0)).phase
        known = np.isfinite(found.margin) & np.isfinite(u)
        assert known.sum() > 0.97 * np.isfinite(u).sum()
        assert right(found, u)[known].all()

    def test_a_code_along_y(self, method: OrderMethod) -> None:
        u = islands((100.0, 200.0), (300.0, 400.0)).T.copy()
        code = replace(CODE, axis="y")
        found = method(frames_of(u, code=code, window=around(u, 90.0))).phase
        valid = np.isfinite(u)
        assert right(found, u)[valid].all()

    def test_a_peak_that_is_no_codeword_s_orders_nothing(self) -> None:
        """Shading from a third to full light over a faint code: its slope is the highest peak."""
        u = islands((100.0, 200.0))
        shading = np.linspace(0.3, 1.0, u.shape[1])
        frames = frames_of(u, window=around(u, 90.0), shading=shading, contrast=0.05)
        assert np.isnan(paper_code(frames).phase.margin).all()

    def test_a_region_without_a_whole_fringe_stays_relative(self, method: OrderMethod) -> None:
        u = islands((100.0, 260.0), (340.0, 365.0))
        found = method(frames_of(u, window=around(u, 90.0))).phase
        wide = np.isfinite(u) & (u < 300)
        assert np.array_equal(np.isfinite(found.margin), wide)

    def test_the_window_tells_the_repeats_apart(self, method: OrderMethod) -> None:
        """Right within half a repeat of 192 px, the wrong repeat beyond, none in a wider window."""
        u = islands((150.0, 260.0))
        valid = np.isfinite(u)
        for shift, off in ((90.0, 0), (-90.0, 0), (150.0, 6), (-150.0, -6)):
            found = method(frames_of(u, window=around(u, 96.0, shift))).phase
            assert right(found, u + off * PERIOD)[valid].all()
        wide = method(frames_of(u, window=around(u, 200.0))).phase
        assert np.isnan(wide.margin).all()
        nothing = around(np.full_like(u, np.nan), 96.0)
        assert np.isnan(method(frames_of(u, window=nothing)).phase.margin).all()

    def test_a_code_without_repeats_needs_no_window(self, method: OrderMethod) -> None:
        words = tuple(np.geomspace(2.0, 16.0, 20))
        code = replace(CODE, codewords_px=words)
        u = islands((420.0, 500.0), (100.0, 180.0))
        found = method(frames_of(u, code=code)).phase
        known = np.isfinite(found.margin)
        # Codewords so near each other are the correlation's to tell: 0.5 cycles of one fringe.
        assert right(found, u)[known].all() or method is paper_code
        assert known.any()

    def test_repeats_without_a_window_are_refused(self, method: OrderMethod) -> None:
        with pytest.raises(DecodeError, match=r"codewords repeat over the 20 fringes .* --rig"):
            method(frames_of(islands((100.0, 200.0))))

    def test_a_code_frame_of_other_fringes_is_refused(self, method: OrderMethod) -> None:
        frames = frames_of(islands((100.0, 200.0)), window=around(np.zeros((1, 1)), 96.0))
        ((_, fringes), (_, code)) = frames.capture
        for other, words in (
            (replace(CODE, period_px=16.0), "read against fringes of 16 px"),
            (replace(CODE, axis="y"), "no code frame along x"),
        ):
            capture = capture_of((FRINGE, fringes), (other, code), extent=WIDTH)
            with pytest.raises(DecodeError, match=words):
                method(replace(frames, capture=capture))

    def test_a_saturated_code_frame_is_refused(self, method: OrderMethod) -> None:
        u = islands((100.0, 200.0))
        frames = frames_of(u, window=around(u, 90.0))
        ((_, fringes), (_, code)) = frames.capture
        white = np.full_like(code, 255)
        capture = capture_of((FRINGE, fringes), (CODE, white), extent=WIDTH)
        with pytest.raises(DecodeError, match="is saturated on 100% of the pixels"):
            method(replace(frames, capture=capture))

    def test_finer_fringes_beside_the_code_s_own(self, method: OrderMethod) -> None:
        """The code tells the orders of its own fringes, and those lead on to the finest."""
        u = islands((100.0, 200.0), (300.0, 400.0))
        frames = frames_of(u, window=around(u, 90.0))
        fine = replace(FRINGE, period_px=16.0)
        lit = 1.0 * np.isfinite(u)
        turns = (np.nan_to_num(u) + 0.5) / fine.period_px
        waves = np.stack([np.cos(2 * np.pi * turns - shift) for shift in fine.shifts_rad])
        scene = Scene(np.nan_to_num(u), WIDTH, offset=120.0 * lit, modulation=100.0 * lit)
        wrapped = demodulate(scene.expose(waves), fine, frames.capture.sensor)
        found = method(replace(frames, phases=(*frames.phases, wrapped)))
        assert found.phase.fringe == fine
        assert found.route[-1] == "fringes of 16 px"
        coordinate = 16.0 * found.phase.phase / (2 * np.pi) - 0.5
        assert (np.abs(coordinate - u) < 8.0)[np.isfinite(u)].all()

    def test_what_is_read_is_kept_for_pictures(self) -> None:
        u = islands((100.0, 200.0), (300.0, 400.0))
        reading = read_code_frame(frames_of(u, window=around(u, 90.0)))
        assert [found.order for found in reading.regions] == [
            int(order_at(u[found.period.pixel])) for found in reading.regions
        ]
        assert len(reading.regions) == reading.unwrapped.region_count == 2


def plane_coordinate(axis: Axis = "x") -> Array:
    """A row of a homography over a view of 90 x 60 px."""
    y, x = np.mgrid[:60, :90]
    return np.asarray((200 + 2.0 * x - 0.3 * y) / (1 + 4e-4 * x - 2e-4 * y))


class TestTemplate:
    def test_a_board_seen_in_part_is_continued(self) -> None:
        """Exact but for single precision of 400 px, 3e-5, grown over four times the board."""
        true = plane_coordinate()
        board = np.full(true.shape, np.nan, np.float32)
        board[20:40, 30:60] = true[20:40, 30:60]
        assert np.abs(continue_plane(board) - true).max() < 5e-3

    def test_half_a_repeat_on_either_side(self) -> None:
        board = plane_coordinate().astype(np.float32)
        window = template_window(board, CODE)
        assert window.high_px - window.low_px == pytest.approx(6 * PERIOD, abs=1e-3)
        assert (window.low_px + window.high_px) / 2 == pytest.approx(board, abs=1e-3)

    def test_too_little_of_a_board(self) -> None:
        board = np.full((60, 90), np.nan, np.float32)
        board[:9, :11] = plane_coordinate()[:9, :11]
        with pytest.raises(DecodeError, match="shows 99 valid pixels"):
            template_window(board, CODE)

    def test_no_plane(self) -> None:
        bent = plane_coordinate()
        bent[:, 45:] += 30
        with pytest.raises(DecodeError, match="template is no plane"):
            template_window(bent.astype(np.float32), CODE)
