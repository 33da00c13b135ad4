"""A rig is held against one new view, with parts of it moved by known amounts.

A turn of 0.05 degrees moves the projector's pixels by fx times 8.7e-4, 0.9 px and more in rows; a
shift of 0.3 mm by 0.3 / 650 of fx, 0.5 px; a zoom of 0.3 % by 1 px at 300 px from the principal
point, of which the pose of the board takes up some. The limits are 0.05 px for means.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import ImageSize, View, calibrate_rig
from fringeworks.calibrate.adjust.state import SHARED, RigState
from fringeworks.calibrate.held.moved import (
    CAMERA_ZOOM,
    PROJECTOR_ZOOM,
    SHIFTED,
    TURNED,
    directions,
)
from fringeworks.calibrate.held.verify import FIXED_LIMIT_PX, Verification, verify_view
from fringeworks.errors import CalibrationError
from fringeworks.geometry.pose import rotation_matrix, rotation_vector
from fringeworks.model import CheckerboardTarget, Rig
from tests.calibrate.synthetic import (
    BOARD,
    board_poses,
    rig_state,
    square_sides,
    triangulate_corners,
    views_of,
)

Array = NDArray[np.float64]

CORNER_SD, MAP_SD = 0.03, 0.01
TURN_RAD, SHIFT_MM, ZOOM = np.radians(0.05), 0.3, 1.003
ALONG = np.array([0.6, 0.8, 0.0])


@pytest.fixture(scope="module")
def rig() -> Rig:
    rng = np.random.default_rng(3)
    views = views_of(rig_state(board_poses(8, rng=rng)), sigma=CORNER_SD, site_sigma=MAP_SD)
    return calibrate_rig(
        views, BOARD, camera_size=ImageSize(752, 480), projector_size=ImageSize(608, 684)
    )


def moved(part: str, seed: int) -> RigState:
    state = rig_state(board_poses(1, rng=np.random.default_rng(seed)))
    relation = state.projector_from_camera
    if part == TURNED:
        turn = rotation_matrix(TURN_RAD * ALONG)
        rotation = rotation_vector(turn @ rotation_matrix(relation[:3]))
        return replace(state, projector_from_camera=np.concatenate([rotation, turn @ relation[3:]]))
    if part == SHIFTED:
        shift = np.concatenate([np.zeros(3), SHIFT_MM * ALONG])
        return replace(state, projector_from_camera=relation + shift)
    lens = {CAMERA_ZOOM: "camera", PROJECTOR_ZOOM: "projector"}.get(part)
    if lens is None:
        return state
    scale = np.array([ZOOM, ZOOM, *np.ones(7)])
    return replace(state, **{lens: getattr(state, lens) * scale})


def view_of(part: str, *, seed: int = 40) -> View:
    rng = np.random.default_rng(seed)
    return views_of(moved(part, seed), sigma=CORNER_SD, site_sigma=MAP_SD, rng=rng)[0]


def check(rig: Rig, part: str, seed: int = 40) -> Verification:
    return verify_view(view_of(part, seed=seed), rig, BOARD)


@pytest.mark.parametrize("seed", range(40, 45))
def test_the_same_rig_holds(rig: Rig, seed: int) -> None:
    found = check(rig, "nothing", seed)
    assert found.holds
    assert found.verdict == "holds"
    assert found.moved is None
    # two coordinates; 88 corners know their rms to 1 / sqrt(4 * 88), five of which are 0.27
    assert found.misfit.camera_rms_px == pytest.approx(np.sqrt(2) * CORNER_SD, rel=0.27)
    # a depth error of 0.1 mm is 0.04 px along the lines; the camera alone knows 0.03 mm
    assert abs(found.depth_error_mm) < 0.15
    assert abs(found.scale) < 3e-4


@pytest.mark.parametrize("seed", range(40, 43))
@pytest.mark.parametrize(
    ("part", "size", "alike"),
    [
        (TURNED, TURN_RAD, {SHIFTED}),
        (SHIFTED, SHIFT_MM, {TURNED}),
        (CAMERA_ZOOM, ZOOM - 1, {SHIFTED}),
        (PROJECTOR_ZOOM, ZOOM - 1, {SHIFTED}),
    ],
)
def test_what_moved_is_named(rig: Rig, part: str, size: float, alike: set[str], seed: int) -> None:
    """A projector moved to the board looks like one that is zoomed: then both are named."""
    found = check(rig, part, seed)
    assert not found.holds
    assert found.verdict == "has moved"
    assert found.moved is not None
    named = {cause.name for cause in found.moved.named}
    assert part in named
    assert named <= {part} | alike
    cause = next(cause for cause in found.moved.named if cause.name == part)
    # seen against the pose: a tenth of a turn of 0.9 px is 9 times what a corner is known to
    assert cause.size == pytest.approx(size, rel=0.1)
    for name in named:
        assert name in found.moved.sentence


def test_what_no_part_explains_cannot_be_told(rig: Rig) -> None:
    """A ripple along the projector's columns, of 1 px every 40."""
    view = view_of("nothing")
    view.projector_px[:, 0] += np.sin(2 * np.pi * view.projector_px[:, 0] / 40)
    found = verify_view(view, rig, BOARD)
    assert found.moved is not None
    assert found.moved.named == ()
    assert "cannot be told" in found.moved.sentence
    assert len(found.moved.causes) == 4


def test_squares_against_the_midpoints_of_both_rays(rig: Rig) -> None:
    found = check(rig, "nothing")
    view = found.seen.view
    sides = square_sides(triangulate_corners(rig, view.camera_px, view.projector_px), BOARD)
    # apart only by how a miss across the lines, 0.01 px of 0.6 mm, is shared out
    assert found.squares_mean_mm == pytest.approx(sides.mean(), abs=2e-4)
    assert found.scale == pytest.approx(sides.mean() / 13 - 1, abs=2e-5)
    assert found.squares_sd_mm == pytest.approx(sides.std(ddof=1), rel=0.05)


def test_depth_error_of_a_camera_that_zoomed(rig: Rig) -> None:
    """The camera alone has the board nearer by the zoom; the projector has it where it is."""
    found = check(rig, CAMERA_ZOOM)
    depth = found.seen.board[:, 2].mean()
    # the rays themselves lean by the zoom, 0.3 % of 60 mm, which the projector reads as depth
    assert found.depth_error_mm == pytest.approx((ZOOM - 1) * depth, abs=0.6)


def test_a_turn_is_about_the_projectors_own_centre() -> None:
    """The derivative of what `moved` composes exactly; apart by half the turn squared, 180 mm."""
    before, after = moved("nothing", 40), moved(TURNED, 40)
    direction, _ = directions(before)[TURNED]
    change = (after.vector - before.vector)[:SHARED]
    np.testing.assert_allclose(direction @ (TURN_RAD * ALONG), change, atol=TURN_RAD**2 * 180)
    assert np.abs(change).max() > 0.05


def test_a_curled_corner_does_not_speak(rig: Rig) -> None:
    view = view_of("nothing")
    view.camera_px[5] += 3.0
    view.projector_px[70] += 2.0
    found = verify_view(view, rig, BOARD)
    assert found.holds
    assert not found.seen.view.kept[[5, 70]].any()
    assert found.seen.view.kept.sum() >= 84


def test_a_rig_without_record_has_fixed_limits(rig: Rig) -> None:
    bare = replace(rig, further={})
    found = check(bare, "nothing")
    assert found.holds
    assert found.limits.camera_rms_px == pytest.approx(FIXED_LIMIT_PX)
    assert "no record" in found.limits_from
    assert not check(bare, TURNED).holds


def test_limits_come_from_the_record(rig: Rig) -> None:
    found = check(rig, "nothing")
    assert found.limits.camera_rms_px == pytest.approx(4 * np.sqrt(2) * CORNER_SD, rel=0.15)
    assert "8 views" in found.limits_from


def test_another_board_is_refused(rig: Rig) -> None:
    """With a pitch ten times too large it is seen ten times too far away."""
    view = view_of("nothing")
    far = replace(view, board_mm=10 * view.board_mm)
    board = CheckerboardTarget(columns=11, rows=8, pitch_x_mm=130.0, pitch_y_mm=130.0)
    with pytest.raises(CalibrationError, match="another rig, or the pitch in"):
        verify_view(far, rig, board)


def test_too_few_corners(rig: Rig) -> None:
    view = view_of("nothing")
    few = replace(view, reasons=("",) * 7 + ("gone",) * 81)
    with pytest.raises(CalibrationError, match="7 corners can be used, 8 are needed"):
        verify_view(few, rig, BOARD)
