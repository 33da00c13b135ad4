"""Deviations of clouds from a ball's mesh and from each other, and registration to a surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import MeasurementError, UsageError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.deviation import compare_cloud
from fringeworks.measure.reference import Reference, cloud_reference, mesh_reference
from fringeworks.measure.registration import align_coarsely, register_cloud
from fringeworks.model import Cloud, Pose
from fringeworks.twin.scenes import hand_scene, wall_scene
from tests.measure.seen import SD, balls_scene, cut, renoise, see, wall_with_step
from tests.measure.test_reference import plane_cloud


def ball_mesh(radius: float) -> Reference:
    """Latitudes and longitudes of a degree: flat faces lie within r (pi / 360)^2 / 2 inside."""
    lat, lon = np.meshgrid(np.deg2rad(np.arange(0, 181)), np.deg2rad(np.arange(0, 361)))
    grid = np.stack([np.sin(lat) * np.cos(lon), np.sin(lat) * np.sin(lon), np.cos(lat)], axis=-1)
    index = np.arange(361 * 181).reshape(361, 181)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, d, c), (a, c, b))])
    vertices = radius * np.round(grid, 12).reshape(-1, 3)
    return mesh_reference(vertices, faces)


def cap(radius: float, rng: np.random.Generator) -> Cloud:
    """A ball at (0, 0, 500) seen by pixels 0.5 mm apart, noise along z."""
    y, x = np.mgrid[-20:20.1:0.5, -20:20.1:0.5]
    z = 500 - np.sqrt(radius**2 - x**2 - y**2)
    scale = 1 + rng.normal(0, SD, x.shape) / z
    xyz = (np.stack([x, y, z], axis=-1) * scale[..., None]).astype(np.float32)
    sigma = np.full(x.shape, SD, np.float32)
    return Cloud(xyz, sigma, sigma, sigma)


def test_a_ball_against_its_mesh() -> None:
    """A ball 0.1 mm larger lies outside by that, with the scatter that sigma says."""
    cloud = cap(40.1, np.random.default_rng(1))
    pose = Pose(np.eye(3), np.array([0.0, 0, -500]))
    found = compare_cloud(cloud, ball_mesh(40.0), pose=pose)
    values = found.values_mm
    assert len(values) == 81 * 81
    spread = SD / np.sqrt(len(values))
    assert values.mean() == pytest.approx(0.1, abs=5 * spread + 40 * (np.pi / 360) ** 2 / 2)
    scores = (found.deviation_mm - 0.1) / found.sigma_mm
    assert np.std(scores) == pytest.approx(1, abs=5 / np.sqrt(2 * len(values)))
    assert (found.beyond, found.border) == (0, 0)


def test_towards_the_sensor_is_positive() -> None:
    """A block on the wall stands out from the wall's own cloud by its height."""
    wall, block = (cut(see(scene)) for scene in (wall_scene(), wall_with_step()))
    found = compare_cloud(block, cloud_reference(wall))
    np.testing.assert_allclose(found.deviation_mm[55:80, 70:95], 2.0, atol=2e-3)  # on the block
    beside = found.deviation_mm[5:20, 5:20]
    assert np.nanmax(np.abs(beside)) < 1e-3  # float32 at 700 mm, interpolated


def test_points_beyond_reach_and_beside_the_border_are_counted() -> None:
    cloud = plane_cloud()
    small = replace(cloud, xyz=np.where(np.abs(cloud.xyz[..., :1]) > 5, np.nan, cloud.xyz))
    reference = cloud_reference(small)
    before = compare_cloud(cloud, reference, within_mm=5)
    far = cloud.xyz.copy()
    far[0, :3] += 100
    found = compare_cloud(replace(cloud, xyz=far), reference, within_mm=5)
    # x beyond 9 mm lies further than 5 mm beside the border at 5: four of 21 columns at most
    assert 0 < before.beyond <= 4 * 21
    assert found.beyond >= before.beyond + 1
    assert found.border > 0
    assert len(found.values_mm) + found.beyond + found.border == 21 * 21
    with pytest.raises(MeasurementError, match="none of the cloud's 441 points lies within"):
        compare_cloud(replace(cloud, xyz=cloud.xyz + 50), reference, within_mm=0.5)
    with pytest.raises(UsageError, match="within_mm must be positive"):
        compare_cloud(cloud, reference, within_mm=0)


def motion(turn: tuple[float, float, float], shift: tuple[float, float, float]) -> Pose:
    """A turn, rad, about (0, 0, 690), and a shift, mm."""
    rotation, middle = rotation_matrix(np.array(turn)), np.array([0.0, 0, 690])
    return Pose(rotation, middle - rotation @ middle + np.array(shift))


@pytest.mark.parametrize("scene", ["hand", "balls"])
def test_a_motion_is_found_again(scene: str) -> None:
    """From ten degrees and 15 mm off; 8 000 points of 0.05 mm know a pose to micrometres."""
    truth = see(hand_scene() if scene == "hand" else balls_scene(0)[0])
    rng = np.random.default_rng(5)
    reference = cloud_reference(renoise(truth, rng))
    points = renoise(truth, rng).points()
    moved = motion((0.1, 0.12, -0.1), (6.0, -8.0, 10.0)).apply(points)
    start = align_coarsely(moved, reference.corners.mean(axis=1))
    found = register_cloud(moved, reference, start=start)
    assert found.loose == 0
    off = found.poses[1].apply(moved) - points
    assert np.linalg.norm(off, axis=1).max() < 0.02
    # both clouds are noisy, across the surface less than along z; a face is of three points
    assert 0.5 * SD < found.rms_mm < np.sqrt(2) * SD


def test_what_the_surface_does_not_hold_is_told_and_left() -> None:
    """A plane may slide in itself and turn about its normal: three motions."""
    cloud = plane_cloud()
    shifted = cloud.points() + np.array([0.3, 0.2, 0.4])
    found = register_cloud(shifted, cloud_reference(cloud))
    assert found.loose == 3
    off = (found.poses[1].apply(shifted) - cloud.points()) @ (np.array([0.5, 0, 1]) / 1.25**0.5)
    assert np.abs(off).max() < 1e-3


def test_far_from_each_other() -> None:
    cloud = plane_cloud()
    with pytest.raises(MeasurementError, match="only 0 points have a counterpart within 5 mm"):
        register_cloud(cloud.points() + 100, cloud_reference(cloud))
    with pytest.raises(MeasurementError, match="does not come near the reference"):
        align_coarsely(cloud.points() + 1000, cloud.points())
