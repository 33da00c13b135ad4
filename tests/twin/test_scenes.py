"""The named scenes stand where the named rigs look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import UsageError
from fringeworks.geometry.lens import project
from fringeworks.twin.cast import Caster
from fringeworks.twin.optics import optics_of
from fringeworks.twin.scene import Board, Scene, Sphere
from fringeworks.twin.scenes import (
    BOARD,
    RIGS,
    SCENES,
    WORKING_DEPTH_MM,
    named_rig,
    named_scene,
    target_of,
)
from fringeworks.twin.truth import find_truth

CASES = [(name, place) for name in SCENES for place in range(14 if name == "board" else 1)]


def view_of(name: str, place: int) -> Scene:
    return named_scene(name).views()[place]


@pytest.mark.parametrize(("name", "place"), CASES)
def test_every_scene_is_seen_and_lit(name: str, place: int) -> None:
    scene = view_of(name, place)
    truth = find_truth(Caster(scene), *optics_of(named_rig("paper")))
    seen, lit = np.isfinite(truth.xyz[..., 2]), np.isfinite(truth.column)
    assert seen.mean() > 0.05  # the balls cover least of the image
    assert lit[seen].mean() > 0.85  # the cylinder shades its far side
    depth = truth.xyz[..., 2][seen]
    low, high = WORKING_DEPTH_MM
    assert low - 40 < depth.min() < depth.max() < high + 40  # a board is larger than its corners
    assert set(np.unique(truth.surface)) >= set(range(len(scene.objects)))


@pytest.mark.parametrize("place", range(14))
def test_every_pose_shows_all_corners_to_both_devices(place: int) -> None:
    rig, scene = named_rig("paper"), view_of("board", place)
    points = scene.objects[0].camera_from_object.apply(target_of(BOARD).corners_mm())
    seen = project(points, rig.camera.lens.vector)
    lit = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)
    for pixels, device in ((seen, rig.camera), (lit, rig.projector)):
        assert (pixels > 15).all()
        assert (pixels < np.array([device.width, device.height]) - 15).all()


def test_balls_are_120_mm_apart() -> None:
    left, right = named_scene("balls").objects
    assert isinstance(left.shape, Sphere)
    gap = right.camera_from_object.translation_mm - left.camera_from_object.translation_mm
    assert np.linalg.norm(gap) == pytest.approx(120.0, abs=1e-9)


def test_a_scene_with_poses_is_one_view_per_pose() -> None:
    scene = named_scene("board")
    views = scene.views()
    assert [view.name for view in views[:2]] == ["pose_00", "pose_01"]
    assert len(views) == len(scene.poses) == 14
    for view, pose in zip(views, scene.poses, strict=True):
        assert view.objects[0].camera_from_object is pose
        assert not view.poses
    assert replace(scene, poses=()).views()[0].name == "board"


def test_a_calibration_is_told_the_nominal_pitch() -> None:
    board = Board(columns=5, rows=4, square_mm=12.0, print_scale=(1e-3, 0.0), bow_mm=(0.1, 0.0))
    target = target_of(board)
    assert (target.columns, target.rows) == (5, 4)
    assert (target.pitch_x_mm, target.pitch_y_mm) == (12.0, 12.0)


def test_the_rigs_look_at_one_place() -> None:
    for name in RIGS:
        rig = named_rig(name)
        aim = rig.projector_from_camera.apply(np.array([[0.0, 0.0, 660.0]]))
        pixel = project(aim, rig.projector.lens.vector)[0]
        middle = [(rig.projector.width - 1) / 2, (rig.projector.height - 1) / 2]
        assert np.abs(pixel - middle).max() < 5  # the lens' distortion moves it a little
        assert rig.baseline_mm == pytest.approx(189.3, abs=0.1)


@pytest.mark.parametrize("ask", [named_scene, named_rig])
def test_unknown_names_are_told_with_the_known_ones(ask: object) -> None:
    assert callable(ask)
    with pytest.raises(UsageError, match=r"must be a file or one of .*, got 'nonsense'"):
        ask("nonsense")
