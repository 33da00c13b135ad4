"""The nouns: what they refuse, and what they derive."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.errors import ShapeError, UsageError
from fringeworks.model import (
    AbsolutePhase,
    Camera,
    Capture,
    Checkerboard,
    CheckerboardTarget,
    Cloud,
    CodedAxis,
    Codeword,
    Colour,
    Finding,
    Fringe,
    GrayCode,
    Lens,
    Noise,
    Pattern,
    PatternSet,
    Picture,
    Pose,
    Projector,
    ProjectorMap,
    Rig,
    Sensor,
    Sequence,
    Speckle,
    Staircase,
    Uniform,
    Void,
    WrappedPhase,
    describe_voids,
    gray_bits,
    pixel_on_edge,
)

SHIFTS = (0.0, 2.0, 4.0)


class TestPatterns:
    @pytest.mark.parametrize(
        ("pattern", "frames"),
        [
            (Fringe("x", 32.0, SHIFTS), 3),
            (GrayCode("x", 5, 32.0), 5),
            (GrayCode("x", 5, 32.0, complementary=True), 6),
            (GrayCode("x", 5, 32.0, inverted=True), 10),
            (GrayCode("x", 5, 32.0, inverted=True, complementary=True), 11),
            (Uniform(1.0), 1),
            (Codeword("x", 32.0, (2.0, 3.0)), 1),
            (Checkerboard(20.0), 1),
            (Staircase("x", 32.0, 19, SHIFTS), 3),
            (Colour("x", 32.0, ("red", "green")), 1),
            (Speckle(1, 3.0), 1),
            (Picture(), 1),
            (Picture(7), 7),
        ],
    )
    def test_frame_count(self, pattern: Pattern, frames: int) -> None:
        assert pattern.frame_count == frames
        assert PatternSet(pattern, repeats=4).image_count == 4 * frames

    def test_codewords_repeat_or_follow_their_sequence(self) -> None:
        code = Codeword("x", 32.0, (2.0, 3.0, 5.0))
        assert [code.codeword_of(k) for k in range(5)] == [2, 3, 5, 2, 3]
        ordered = dataclasses.replace(code, sequence=(2, 0, 1, 1))
        assert [ordered.codeword_of(k) for k in range(4)] == [5, 2, 3, 3]

    def test_half_cells(self) -> None:
        assert GrayCode("x", 5, 30.0).code_px == 30.0
        assert GrayCode("x", 5, 30.0, complementary=True).code_px == 15.0

    def test_patterns_are_frozen_values(self) -> None:
        fringe = Fringe("x", 32.0, SHIFTS)
        assert fringe == Fringe("x", 32.0, SHIFTS)
        assert len({fringe, Fringe("x", 32.0, SHIFTS), Fringe("y", 32.0, SHIFTS)}) == 2
        with pytest.raises(dataclasses.FrozenInstanceError):
            fringe.period_px = 3.0  # type: ignore[misc]


class TestCells:
    @pytest.mark.parametrize(
        ("extent", "cell", "bits"),
        [(1024, 1.0, 10), (1025, 1.0, 11), (608, 32.0, 5), (1920, 100.0, 5), (1080, 100.0, 4),
         (1000, 1000 / 16, 4), (10, 10.0, 1), (10, 20.0, 1)],
    )  # fmt: skip
    def test_bits_by_hand(self, extent: int, cell: float, bits: int) -> None:
        assert gray_bits(extent, cell) == bits

    @given(extent=st.integers(2, 3000), cell=st.integers(1, 500))
    def test_fewest_bits_that_cover(self, extent: int, cell: int) -> None:
        bits = gray_bits(extent, cell)
        assert 2**bits * cell >= extent
        assert bits == 1 or 2 ** (bits - 1) * cell < extent

    @pytest.mark.parametrize(
        ("extent", "cell", "meet"),
        [
            (100, 32.0, False),  # edges at 31.5, 63.5, ...
            (100, 2.5, True),  # the first at 2
            (100, 31.25, True),  # the second at 62
            (62, 31.25, False),  # which a projector of 62 px (0 to 61) does not have
            (63, 31.25, True),
            (1920, 200 / 3, False),  # thirds of a pixel, never half a one
            (100, 0.5, True),
        ],
    )
    def test_edges_on_centres(self, extent: int, cell: float, meet: bool) -> None:
        assert (pixel_on_edge(extent, cell) is not None) is meet


class TestSequence:
    SETS = (
        PatternSet(Fringe("x", 32.0, SHIFTS), group="long"),
        PatternSet(Fringe("x", 32.0, SHIFTS), group="short"),
        PatternSet(Uniform(1.0)),
        PatternSet(Uniform(0.0), group="long"),
    )

    def test_groups(self) -> None:
        sequence = Sequence(608, 684, self.SETS)
        assert sequence.groups == ("long", "short")
        assert sequence.choose_group(None) == (0, 2, 3)
        assert sequence.choose_group("long") == (0, 2, 3)
        assert sequence.choose_group("short") == (1, 2)

    def test_without_groups(self) -> None:
        sequence = Sequence(608, 684, (PatternSet(Uniform(1.0)),))
        assert sequence.choose_group(None) == (0,)
        with pytest.raises(UsageError, match=r"one of the capture's \(none\), got 'a'"):
            sequence.choose_group("a")

    def test_unknown_group(self) -> None:
        with pytest.raises(UsageError, match=r"\(long, short\), got 'shrt'"):
            Sequence(608, 684, self.SETS).choose_group("shrt")


class TestCapture:
    SEQUENCE = Sequence(
        608,
        684,
        (
            PatternSet(Fringe("x", 32.0, SHIFTS), group="a"),
            PatternSet(Uniform(1.0), repeats=2, group="b"),
        ),
    )
    FRINGES = np.zeros((3, 4, 5), np.uint8)
    WHITE = np.ones((2, 4, 5), np.uint8)

    def test_stack_per_set(self) -> None:
        with pytest.raises(ShapeError, match="one stack per set, 2, got 1"):
            Capture(self.SEQUENCE, (self.FRINGES,), Sensor(255.0))

    @pytest.mark.parametrize("shape", [(1, 4, 5), (3, 4, 5), (2, 5, 4), (2, 4)])
    def test_stack_of_the_wrong_shape(self, shape: tuple[int, ...]) -> None:
        with pytest.raises(ShapeError, match=r"must be \(2, 4, 5\), got"):
            Capture(self.SEQUENCE, (self.FRINGES, np.zeros(shape, np.uint8)), Sensor(255.0))

    def test_iterate_find_select(self) -> None:
        capture = Capture(self.SEQUENCE, (self.FRINGES, self.WHITE), Sensor(255.0), name="mug")
        assert [item.group for item, _ in capture] == ["a", "b"]
        ((pattern, frames, repeats),) = capture.find(Uniform)
        assert (pattern.level, repeats) == (1.0, 2)
        assert frames is self.WHITE
        assert capture.find(GrayCode) == []
        part = capture.select("b")
        assert [stack is self.WHITE for stack in part.frames] == [True]
        assert (part.name, part.sequence.width) == ("mug", 608)
        assert capture.select().frames[0] is self.FRINGES

    def test_sensor(self) -> None:
        assert Sensor(255.0).saturation == pytest.approx(249.9)
        assert Sensor(4095.0).saturation == pytest.approx(4013.1)

    @pytest.mark.parametrize(
        ("gain", "read", "known"),
        [(None, None, False), (0.02, None, False), (None, 0.8, False), (0.02, 0.8, True),
         (0.0, 0.8, True)],
    )  # fmt: skip
    def test_noise_is_known_by_both_figures(
        self, gain: float | None, read: float | None, known: bool
    ) -> None:
        assert Sensor(255.0, gain=gain, read_noise=read).noise_is_known is known


class TestPhases:
    def test_noise(self) -> None:
        noise = Noise(3.0, 0.04, 10.0, "camera")
        # black: 3; at 410: 9 + 0.04 * 400 = 25; below black counts as black
        np.testing.assert_allclose(noise.sigma(np.array([10.0, 410.0, 0.0])), [3.0, 5.0, 3.0])

    def test_voids_in_words(self) -> None:
        void = np.zeros((10, 10), np.uint8)
        assert describe_voids(void) == "none void"
        void[0] = Void.MODULATION
        void[1, :5] = Void.SATURATED
        void[2, :2] = Void.ORDER
        void[3, 0] = Void.RESIDUAL
        assert describe_voids(void) == (
            "5.0% saturated, 10.0% too little modulation, 1.0% too large a residual, "
            "2.0% no certain order inside the projector's image"
        )

    def test_absolute_phase_left_of_zero(self) -> None:
        # With zero_px inside the image orders left of it are negative, and -1 is one of them:
        # what is void is told by the margin.
        flat = np.ones((1, 3), np.float32)
        phase = np.array([[1.0, 1.0, np.nan]], np.float32)
        void = np.array([[0, Void.ORDER, Void.MODULATION]], np.uint8)
        fringe, noise = Fringe("x", 32.0, SHIFTS, zero_px=15.5), Noise(1.0, 0.0, 0.0, "camera")
        wrapped = WrappedPhase(fringe, phase, flat, flat, flat, flat, noise, void)
        margin = np.array([[0.5, np.nan, np.nan]], np.float32)
        absolute = AbsolutePhase(wrapped, np.full((1, 3), -1, np.int32), margin)
        assert absolute.fringe is fringe
        np.testing.assert_allclose(absolute.phase, [[1 - 2 * math.pi, np.nan, np.nan]], rtol=1e-6)

    def test_map_of_one_axis(self) -> None:
        flat = np.ones((2, 3), np.float32)
        half = flat.copy()
        half[0] = np.nan
        row = CodedAxis("y", half, flat, flat, flat, None, np.zeros((2, 3), np.uint8), ())
        only_row = ProjectorMap(None, row)
        assert only_row.axes == (row,)
        assert only_row.shape == (2, 3)
        assert row.valid_share == 0.5


class TestRig:
    RIG = Rig(
        Camera(752, 480, Lens(1, 1, 0, 0)),
        Projector(608, 684, Lens(1, 1, 0, 0)),
        Pose(np.eye(3), np.array([-12.0, 3.0, 4.0])),
    )

    def test_baseline(self) -> None:
        assert self.RIG.baseline_mm == 13.0  # 3, 4, 12, 13

    def test_depth_window(self) -> None:
        assert self.RIG.z_window() is None
        known = dataclasses.replace(self.RIG, volume_mm=(600.0, 800.0))
        assert known.z_window() == (580.0, 820.0)
        assert known.z_window(widen=0.0) == (600.0, 800.0)

    def test_identity_and_inverse(self) -> None:
        point = np.array([1.0, 2.0, 3.0])
        assert Pose.identity().apply(point).tolist() == [1, 2, 3]
        pose = self.RIG.projector_from_camera
        np.testing.assert_allclose(pose.inverse().apply(pose.apply(point)), point, atol=1e-14)


def test_board_corners_row_by_row() -> None:
    board = CheckerboardTarget(11, 8, 13.0, 12.5)
    corners = board.corners_mm()
    assert corners.shape == (board.corner_count, 3) == (88, 3)
    assert corners[11 * 3 + 4].tolist() == [52.0, 37.5, 0.0]  # row 3, column 4


def test_cloud_points_row_by_row() -> None:
    xyz = np.arange(18, dtype=np.float32).reshape(2, 3, 3)
    xyz[0, 1] = np.nan
    flat = np.ones((2, 3), np.float32)
    cloud = Cloud(xyz, flat, flat, flat)
    assert cloud.valid.tolist() == [[True, False, True], [True, True, True]]
    assert cloud.points()[:, 0].tolist() == [0, 6, 9, 12, 15]
    assert cloud.points().dtype == np.float64


def test_finding_in_words() -> None:
    assert str(Finding("note", "Two frames are alike.")) == "note: Two frames are alike."
    warning = Finding("warning", "It is dark.", "Open the iris.")
    assert str(warning) == "warning: It is dark. Open the iris."
