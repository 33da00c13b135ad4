"""One hand-computed test per testable line of docs/conventions.md, named after its number.

The numbers in these tests were worked out on paper, and the comments show how. None of them
comes from the formula that it checks.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fringeworks
from fringeworks import model
from fringeworks.errors import DecodeError, FormatError, ShapeError, UsageError
from fringeworks.files.capture import describe_sequence, parse_capture
from fringeworks.geometry.lens import project, unproject
from fringeworks.geometry.pose import compose_poses
from fringeworks.kernels.orders import unwrap
from fringeworks.model import (
    AbsolutePhase,
    Camera,
    Capture,
    CheckerboardTarget,
    CodedAxis,
    Codeword,
    Frames,
    Fringe,
    GrayCode,
    Lens,
    Noise,
    Pattern,
    PatternSet,
    Pose,
    Projector,
    ProjectorMap,
    Rig,
    Sensor,
    Sequence,
    Uniform,
    Void,
    WrappedPhase,
)
from fringeworks.patterns import fringe_orders, render
from fringeworks.phase.decode import decode_capture, decode_phases
from fringeworks.phase.demodulate import demodulate, wrap_three_steps
from fringeworks.reconstruct.full import CloudRules, triangulate

QUARTERS = (0.0, 1.5707963267948966, 3.141592653589793, 4.71238898038469)
THIRDS = (2.0943951023931953, 0.0, -2.0943951023931953)

TURN_Z = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""A quarter turn about z: x goes to y, y to -x."""

TURN_X = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""A quarter turn about x: y goes to z, z to -y."""


def capture_of(
    *sets: tuple[Pattern, NDArray[np.generic]], width: int = 8, height: int = 8, dtype: str = "u1"
) -> Capture:
    patterns = tuple(PatternSet(pattern) for pattern, _ in sets)
    frames: tuple[Frames, ...] = tuple(stack.astype(dtype) for _, stack in sets)
    scale = 255.0 if dtype == "u1" else 65535.0
    return Capture(Sequence(width, height, patterns), frames, Sensor(scale))


def white_and_black(height: int, width: int) -> list[tuple[Pattern, NDArray[np.generic]]]:
    return [
        (Uniform(1.0), np.full((1, height, width), 200)),
        (Uniform(0.0), np.full((1, height, width), 20)),
    ]


def one_gray_bit(bright: NDArray[np.bool_], axis: model.Axis = "x") -> Capture:
    """Two cells of 4 px on a projector of 8 px: dark is the first, bright the second."""
    image = np.where(bright, 190, 30)[np.newaxis]
    return capture_of((GrayCode(axis, 1, 4.0), image), *white_and_black(*bright.shape))


def quarter_frames(offset: float, cosine: float, sine: float, *, scale: float) -> Frames:
    """Four frames of one pixel at shifts of 0, 90, 180, 270 degrees: A + C, A + S, A - C, A - S."""
    values = [offset + cosine, offset + sine, offset - cosine, offset - sine]
    return np.array([round(scale * value) for value in values], np.uint16).reshape(4, 1, 1)


class TestUnitsFramesArrays:
    def test_c01_degrees_only_in_files(self) -> None:
        text = {
            "format": "fringeworks-capture/1",
            "projector": {"width": 608, "height": 684},
            "set": [
                {
                    "kind": "fringe",
                    "axis": "x",
                    "period_px": 32.0,
                    "shifts_deg": [90.0, 180.0, -45.0],
                    "images": ["0.png", "1.png", "2.png"],
                }
            ],
        }
        pattern = describe_sequence(parse_capture(text, Path("capture.toml"))).sets[0].pattern
        assert isinstance(pattern, Fringe)
        # pi / 2, pi, -pi / 4
        assert pattern.shifts_rad == pytest.approx((1.5707963, 3.1415927, -0.7853982), abs=5e-8)

    def test_c01_no_degrees_in_the_nouns(self) -> None:
        nouns = [getattr(model, name) for name in model.__all__]
        fields = [f for noun in nouns if dataclasses.is_dataclass(noun) for f in _fields(noun)]
        assert "shifts_rad" in fields
        assert not [name for name in fields if name.endswith("_deg")]

    def test_c02_rows_before_columns(self) -> None:
        stack = np.zeros((3, 2, 5), np.uint8)  # three frames of 2 rows and 5 columns
        capture = capture_of((Fringe("x", 8.0, THIRDS), stack))
        assert capture.shape == (2, 5)

    def test_c03_x_comes_first_in_coordinates(self) -> None:
        bright = np.zeros((2, 5), np.bool_)
        bright[1, 3] = True  # the pixel at x = 3, y = 1
        column = decode_capture(one_gray_bit(bright)).column
        assert column is not None
        # Cells of 4 px begin at -0.5: their centres are 1.5 and 5.5.
        assert column.coordinate.tolist() == [[1.5] * 5, [1.5, 1.5, 1.5, 5.5, 1.5]]
        # Its ray by hand: ((3 - 1) / 2, (1 - 0) / 4).
        lens = Lens(2.0, 4.0, 1.0, 0.0).vector
        assert unproject(np.array([3.0, 1.0]), lens).tolist() == [1.0, 0.25]

    def test_c03_the_cloud_keeps_the_image_grid(self) -> None:
        rig = Rig(
            Camera(width=5, height=2, lens=Lens(2.0, 4.0, 1.0, 0.0)),
            Projector(width=8, height=8, lens=Lens(10.0, 10.0, 0.0, 0.0)),
            Pose(np.eye(3), np.array([-30.0, 0.0, 0.0])),
        )
        # z = 10 at x = 3, y = 1: X = 1.0 * 10 = 10, so the projector, 30 mm to the right, sees it
        # at 10 * (10 - 30) / 10 = -20.
        column = coded(np.full((2, 5), -20.0))
        cloud = triangulate(
            ProjectorMap(column, None), rig, rules=CloudRules(z_range_mm=(1.0, 100.0))
        )
        np.testing.assert_allclose(cloud.xyz[1, 3], [10.0, 2.5, 10.0], rtol=1e-6)

    def test_c04_sizes_are_named(self) -> None:
        sequence = Sequence(width=608, height=684, sets=())
        assert (sequence.extent("x"), sequence.extent("y")) == (608, 684)
        for noun in (Camera, Projector, Sequence):
            assert {"width", "height"} <= set(_fields(noun))

    def test_c05_pixel_centres_are_integers(self) -> None:
        # A projector of 4 px spans [-0.5, 3.5]: two cells of 2 px have centres 0.5 and 2.5.
        code = GrayCode("x", 1, 2.0)
        image = np.array([[[30, 190]]])
        capture = capture_of((code, image), *white_and_black(1, 2), width=4)
        column = decode_capture(capture).column
        assert column is not None
        assert column.coordinate.tolist() == [[0.5, 2.5]]
        # A rendered cell changes between pixel centres 1 and 2, at 1.5.
        assert render(code, width=4, height=2)[0, 0].tolist() == [0, 0, 255, 255]

    def test_c06_x_right_y_down_z_forward(self) -> None:
        lens = Lens(100.0, 100.0, 320.0, 240.0).vector
        # 1 mm to the right, 2 mm down, 10 mm ahead: 100 * 0.1 and 100 * 0.2 px from the middle.
        assert project(np.array([1.0, 2.0, 10.0]), lens).tolist() == [330.0, 260.0]
        assert np.isnan(project(np.array([1.0, 2.0, -10.0]), lens)).all()
        assert np.cross([1, 0, 0], [0, 1, 0]).tolist() == [0, 0, 1]

    def test_c06_the_rigs_frame_is_the_cameras(self) -> None:
        pose = Pose(np.eye(3), np.array([-3.0, 0.0, 4.0]))
        rig = Rig(
            Camera(4, 4, Lens(1, 1, 0, 0)), Projector(4, 4, Lens(1, 1, 0, 0)), pose, (100.0, 200.0)
        )
        assert rig.baseline_mm == 5.0  # the camera is at the origin: 3, 4, 5
        assert rig.z_window() == (90.0, 210.0)  # depths of the camera's frame, widened by 10 mm

    def test_c07_board_frame(self) -> None:
        corners = CheckerboardTarget(3, 2, 10.0, 20.0).corners_mm()
        assert corners.tolist() == [
            [0, 0, 0], [10, 0, 0], [20, 0, 0],
            [0, 20, 0], [10, 20, 0], [20, 20, 0],
        ]  # fmt: skip

    def test_c08_a_from_b(self) -> None:
        a_from_b = Pose(TURN_Z, np.array([10.0, 20.0, 30.0]))
        # (1, 2, 3) turns to (-2, 1, 3), then moves.
        assert a_from_b.apply(np.array([1.0, 2.0, 3.0])).tolist() == [8.0, 21.0, 33.0]

    def test_c08_names_cancel(self) -> None:
        a_from_b = (TURN_Z, np.array([10.0, 0.0, 0.0]))
        b_from_c = (TURN_X, np.array([0.0, 5.0, 0.0]))
        rotation, translation = compose_poses(a_from_b, b_from_c)
        # X_c = (1, 2, 3): about x (1, -3, 2), moved (1, 2, 2), about z (-2, 1, 2), moved (8, 1, 2).
        assert (rotation @ [1.0, 2.0, 3.0] + translation).tolist() == [8.0, 1.0, 2.0]

    def test_c09_inverse_of_the_papers_pose(self) -> None:
        papers = Pose(TURN_Z, np.array([1.0, 2.0, 3.0]))  # projector to camera
        ours = papers.inverse()
        assert ours.rotation.tolist() == [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
        # R^-1 T = (2, -1, 3)
        assert ours.translation_mm.tolist() == [-2.0, 1.0, -3.0]
        assert "projector_from_camera" in _fields(Rig)

    def test_c10_axis_x_is_vertical_fringes(self) -> None:
        # Period 4, Phi = 45 degrees at pixel 0: cosines 0.7071, -0.7071, -0.7071, 0.7071 of 127.5.
        across = render(Fringe("x", 4.0, QUARTERS), width=4, height=2)[0]
        assert across.tolist() == [[218, 37, 37, 218]] * 2
        down = render(Fringe("y", 4.0, QUARTERS), width=2, height=4)[0]
        assert down.tolist() == [[218, 218], [37, 37], [37, 37], [218, 218]]

    def test_c10_axis_x_codes_the_column(self) -> None:
        bright = np.array([[False, True]])
        by_x, by_y = (decode_capture(one_gray_bit(bright, axis)) for axis in model.AXES)
        assert by_x.row is None
        assert by_y.column is None
        assert by_x.column is not None
        assert by_y.row is not None
        assert by_x.column.coordinate.tolist() == by_y.row.coordinate.tolist() == [[1.5, 5.5]]

    def test_c10_row_1_of_the_rotation_belongs_to_x(self) -> None:
        # The projector is turned by 90 degrees: its x is our -y, its y our x.
        pose = Pose(TURN_Z, np.zeros(3))
        point = pose.apply(np.array([3.0, 5.0, 10.0]))
        column, row = project(point, Lens(10.0, 10.0, 0.0, 0.0).vector)
        assert (column, row) == (-5.0, 3.0)

    def test_c11_invalid_is_nan(self) -> None:
        fringe = Fringe("x", 16.0, QUARTERS)
        # The second pixel has no modulation at all.
        frames = np.array([180, 100, 20, 100, 100, 100, 100, 100]).reshape(2, 4).T.reshape(4, 1, 2)
        axis = decode_phases(capture_of((fringe, frames))).coded[0]
        assert np.isnan(axis.coordinate).tolist() == [[False, True]]
        assert np.isnan(axis.sigma).tolist() == [[False, True]]
        assert axis.phase is not None
        assert np.isnan(axis.phase.phase).tolist() == [[False, True]]
        assert axis.phase.order.tolist() == [[0, -1]]
        assert axis.void.tolist() == [[Void.VALID, Void.MODULATION]]

    def test_c12_bad_pixel(self) -> None:
        column = decode_capture(one_gray_bit(np.array([[True, False]]))).column
        assert column is not None
        dark = capture_of(
            (GrayCode("x", 1, 4.0), np.array([[[190, 20]]])),
            (Uniform(1.0), np.array([[[200, 21]]])),
            (Uniform(0.0), np.array([[[20, 20]]])),
        )
        column = decode_capture(dark).column
        assert column is not None
        assert np.isnan(column.coordinate).tolist() == [[False, True]]

    def test_c12_bad_set(self) -> None:
        dark = np.full((4, 1, 2), 7)
        with pytest.raises(DecodeError, match=r"along any axis \(x: 100\.0% too little"):
            decode_capture(capture_of((Fringe("x", 16.0, QUARTERS), dark)))

    def test_c12_bad_call(self) -> None:
        frames = np.zeros((2, 1, 1), np.uint8)
        with pytest.raises(ShapeError, match="must be"):
            wrap_three_steps(frames)
        with pytest.raises(UsageError, match="three distinct"):
            demodulate(np.zeros((3, 1, 1), np.uint8), Fringe("x", 8.0, (0, 0, 1)), Sensor(255.0))

    def test_c12_bad_file(self) -> None:
        with pytest.raises(FormatError, match="fringeworks-capture/1"):
            parse_capture({"format": "another/1"}, Path("capture.toml"))

    def test_c13_randomness_is_handed_in(self) -> None:
        package = Path(inspect.getfile(fringeworks)).parent
        sources = sorted(package.rglob("*.py"))
        assert len(sources) > 20
        makers = {"default_rng", "RandomState", "seed"}
        for source in sources:
            for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
                name = node.func if isinstance(node, ast.Call) else None
                if isinstance(name, ast.Attribute) and name.attr in makers:
                    # One seed, one result: a generator made here has its seed in plain sight.
                    assert isinstance(node, ast.Call)
                    assert node.args, f"{source}:{node.lineno}"


class TestPhase:
    def test_c14_sign_of_the_shift(self) -> None:
        # A = 100, B = 50, Phi = 60 degrees, shifts 0, 90, 180, 270: cosines of 60, -30, -120, -210
        # are 0.5, 0.866025, -0.5, -0.866025, so grey levels 125, 143.3013, 75, 56.6987.
        frames = np.array([12500, 14330, 7500, 5670], np.uint16).reshape(4, 1, 1)
        wrapped = demodulate(frames, Fringe("x", 16.0, QUARTERS), Sensor(65535.0))
        assert wrapped.offset[0, 0] == pytest.approx(10000.0, abs=0.5)
        assert wrapped.modulation[0, 0] == pytest.approx(5000.0, abs=0.5)
        phase = np.degrees(wrapped.phase[0, 0])
        # Rounded by at most 0.5 of 5000: 1e-4 rad, 0.006 degrees.
        assert phase == pytest.approx(60.0, abs=0.006)

    def test_c14_a_later_shift_moves_the_fringes_right(self) -> None:
        # Phi = delta is a maximum: 90 degrees of a period of 8 px are 2 px.
        frames = render(Fringe("x", 8.0, (0.0, QUARTERS[1], QUARTERS[2])), width=8, height=2)
        assert frames[1, 0, 2:].tolist() == frames[0, 0, :-2].tolist()

    def test_c15_phase_of_a_coordinate(self) -> None:
        # (7.5 + 0.5) / 32 is a quarter of a turn.
        assert Fringe("x", 32.0, THIRDS).phase_at(7.5) == pytest.approx(1.5707963, abs=5e-8)
        # (20 - 12) / 32 as well.
        fringe = Fringe("x", 32.0, THIRDS, zero_px=12.0)
        assert fringe.phase_at(20.0) == pytest.approx(1.5707963, abs=5e-8)

    def test_c16_phase_is_zero_at_the_edge(self) -> None:
        assert Fringe("x", 32.0, THIRDS).zero_px == -0.5
        assert Codeword("x", 32.0, (2.0, 4.0)).zero_px == -0.5

    def test_c16_a_foreign_zero(self) -> None:
        # A quarter of a turn of 16 px is 4 px: from -0.5 at 3.5, from 3 at 7.
        frames = quarter_frames(100, 0, 80, scale=1).astype(np.uint8)
        for zero, expected in ((-0.5, 3.5), (3.0, 7.0)):
            capture = capture_of((Fringe("x", 16.0, QUARTERS, zero_px=zero), frames))
            column = decode_capture(capture).column
            assert column is not None
            assert column.coordinate[0, 0] == pytest.approx(expected, abs=1e-5)

    def test_c17_half_a_turn_is_plus_pi(self) -> None:
        frames = quarter_frames(100, -80, 0, scale=1)
        wrapped = demodulate(frames, Fringe("x", 16.0, QUARTERS), Sensor(255.0))
        assert wrapped.phase[0, 0] == np.float32(3.14159265)
        just_below = quarter_frames(30000, -20000, -1, scale=1)  # -pi + 1 / 20000
        wrapped = demodulate(just_below, Fringe("x", 16.0, QUARTERS), Sensor(65535.0))
        assert wrapped.phase[0, 0] == pytest.approx(-3.1415427, abs=5e-7)

    def test_c18_orders_change_at_odd_multiples_of_pi(self) -> None:
        # Period 10 from -0.5: Phi = pi at u = 4.5, 3 pi at 14.5. Cosine and sine 36 degrees before
        # and after those are (-0.809, +0.588) and (-0.809, -0.588).
        before, after = (quarter_frames(100, -80.9, s, scale=100) for s in (58.8, -58.8))
        fringe = Fringe("x", 10.0, QUARTERS)
        code = GrayCode("x", 2, 5.0)  # centres at 2, 7, 12, 17
        for cell, frames, coordinate, order in (
            ([0, 0], before, 3.5, 0),
            ([0, 1], after, 5.5, 1),
            ([1, 1], before, 13.5, 1),
            ([1, 0], after, 15.5, 2),
        ):
            bits = np.where(np.array(cell), 19000, 2000).reshape(2, 1, 1)
            levels = [(p, 100 * f) for p, f in white_and_black(1, 1)]
            capture = capture_of((fringe, frames), (code, bits), *levels, width=20, dtype="u2")
            axis = decode_phases(capture).coded[0]
            assert axis.phase is not None
            assert axis.phase.order[0, 0] == order
            assert axis.coordinate[0, 0] == pytest.approx(coordinate, abs=1e-3)

    @pytest.mark.parametrize(
        ("extent", "period", "last"),
        [
            (608, 32.0, 19),  # 19 periods: the last order is a half fringe
            (100, 32.0, 3),  # 3.125 periods: order 3 begins at 2.5 periods and holds the rest
            (120, 32.0, 4),  # 3.75 periods: order 4 begins at 3.5
        ],
    )
    def test_c19_orders_of_an_image(self, extent: int, period: float, last: int) -> None:
        orders = fringe_orders(extent, period)
        assert (orders[0], orders[-1]) == (0, last)

    def test_c20_right_within_half_a_turn(self) -> None:
        # With a period of 2 pi px and zero at 0 a coordinate is its own phase.
        # Phi = 20: phi = 20 - 6 pi = 1.150444, k = 3. A reference may be wrong by 3.14, not 3.15.
        phi = np.array([[1.150444]], np.float32)
        for error, order, found in (
            (0.0, 3, 20.0),
            (3.14, 3, 20.0),
            (-3.14, 3, 20.0),
            (3.15, 4, 26.283185),
            (-3.15, 2, 13.716815),
        ):
            reference = np.array([[20.0 + error]], np.float32)
            coordinate, margin = np.empty((1, 1), np.float32), np.empty((1, 1), np.float32)
            orders = np.empty((1, 1), np.int32)
            unwrap(phi, reference, 6.283185307179586, 0.0, coordinate, orders, margin)
            assert orders[0, 0] == order
            assert coordinate[0, 0] == pytest.approx(found, abs=5e-6)

    def test_c21_the_papers_three_frames(self) -> None:
        # A = 100, B = 50, Phi = 60 degrees, shifts 120, 0, -120: cosines of -60, 60, 180 are
        # 0.5, 0.5, -1. Equation (10): sqrt(3) * 75 over 50 + 25 is sqrt(3), 60 degrees.
        frames = np.array([125, 125, 50], np.uint8).reshape(3, 1, 1)
        assert wrap_three_steps(frames)[0, 0] == pytest.approx(1.0471976, abs=5e-7)
        wrapped = demodulate(frames, Fringe("x", 8.0, THIRDS), Sensor(255.0))
        assert wrapped.phase[0, 0] == pytest.approx(1.0471976, abs=5e-7)
        assert wrapped.offset[0, 0] == pytest.approx(100.0, abs=1e-4)
        assert wrapped.modulation[0, 0] == pytest.approx(50.0, abs=1e-4)

    def test_c22_a_codeword_changes_at_plus_pi(self) -> None:
        # Period 8 from -0.5: Phi = pi at 3.5. Pixels 0 to 3 are the second half of fringe 0 (xi =
        # 4.5 to 7.5), pixels 4 to 11 are fringe 1 with xi = 0.5 to 7.5.
        frame = render(Codeword("x", 8.0, (2.0, 8.0)), width=12, height=2)[0, 0]
        assert frame[:4].tolist() == [255, 0, 255, 0]  # p = 2: xi - 1/2 = 4, 5, 6, 7
        assert frame[4:].argmax() == 0  # p = 8: one wave, the maximum on the first pixel
        assert frame[4:].argmin() == 4

    def test_c23_first_pixel_is_a_maximum(self) -> None:
        frame = render(Codeword("x", 8.0, (4.0, 2.0)), width=12, height=2)[0, 0].astype(int)
        # Fringe 0 from its middle with p = 4: cosines of 4, 5, 6, 7 quarter turns; 127.5 rounds.
        assert np.abs(frame[:4] - [255, 127.5, 0, 127.5]).max() <= 0.5
        assert frame[4:].tolist() == [255, 0, 255, 0, 255, 0, 255, 0]

    def test_c24_absolute_is_a_type_of_its_own(self) -> None:
        wrapped = wrapped_phase(0.5)
        absolute = AbsolutePhase(wrapped, np.array([[2]], np.int32), np.ones((1, 1), np.float32))
        # 0.5 + 4 pi
        assert absolute.phase[0, 0] == pytest.approx(13.0663706, abs=1e-6)
        assert not isinstance(absolute, WrappedPhase)
        assert not isinstance(wrapped, AbsolutePhase | CodedAxis)

    def test_c25_a_map_holds_pixels(self) -> None:
        # Period 16 from -0.5, a quarter turn: 4 px after -0.5.
        frames = quarter_frames(100, 0, 80, scale=1)
        by_x = decode_capture(capture_of((Fringe("x", 16.0, QUARTERS), frames)))
        by_y = decode_capture(capture_of((Fringe("y", 16.0, QUARTERS), frames)))
        assert by_x.column is not None
        assert by_y.row is not None
        assert by_x.column.coordinate[0, 0] == pytest.approx(3.5, abs=1e-5)
        assert by_y.row.coordinate[0, 0] == pytest.approx(3.5, abs=1e-5)


def _fields(noun: Any) -> list[str]:
    return [field.name for field in dataclasses.fields(noun)]


def coded(coordinate: NDArray[np.float64]) -> CodedAxis:
    flat = np.ones(coordinate.shape, np.float32)
    void = np.zeros(coordinate.shape, np.uint8)
    return CodedAxis("x", coordinate.astype(np.float32), 0.1 * flat, flat, flat, None, void, ())


def wrapped_phase(phase: float) -> WrappedPhase:
    flat = np.ones((1, 1), np.float32)
    noise = Noise(1.0, 0.0, 0.0, "camera")
    void = np.zeros((1, 1), np.uint8)
    fringe = Fringe("x", 32.0, THIRDS)
    phases = np.full((1, 1), phase, np.float32)
    return WrappedPhase(fringe, phases, flat, flat, flat, flat, noise, void)
