"""What a scan says of a zone: volume, share unseen, nearest point, and when it is an alarm."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import ShapeError, UsageError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.zones import Zone, ZoneRules, look_at_zone, measure_zone
from fringeworks.model import Camera, Cloud, Lens, Pose

CAMERA = Camera(200, 160, Lens(400.0, 400.0, 99.5, 79.5))
ZONE = Zone("bench", ((-100.0, 100.0), (-80.0, 80.0), (900.0, 1000.0)))
VIEW = look_at_zone(ZONE, CAMERA)
PIXEL_MM = 1000 / 400
"""At the zone's far side."""


def depth_cloud(z: np.ndarray, sigma_mm: float = 0.1) -> Cloud:
    """Points on the rays of all pixels, at depths ``(H, W)``; NaN where void."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    x, y = (u - 99.5) / 400 * z, (v - 79.5) / 400 * z
    xyz = np.stack([x, y, z], axis=-1).astype(np.float32)
    shape = z.shape
    nothing = np.full(shape, np.nan, np.float32)
    return Cloud(xyz, np.full(shape, sigma_mm, np.float32), nothing, nothing)


def at(z: float) -> np.ndarray:
    return np.full((CAMERA.height, CAMERA.width), z)


def test_the_rays_fill_the_zone() -> None:
    """Together the pixels' parts of the zone are its volume, but for half a pixel all around."""
    volume = float(np.nansum(VIEW.area * (VIEW.far_mm**3 - VIEW.near_mm**3) / 3))
    assert volume == pytest.approx(ZONE.volume_mm3, rel=4 * PIXEL_MM / 2 / 160)
    assert ZONE.volume_mm3 == 200 * 160 * 100


def test_a_plane_within_occupies_what_is_behind_it() -> None:
    """All rays of the box behind z = 950 went through its section there."""
    found = measure_zone(depth_cloud(at(950.0)), VIEW)
    half = ZONE.volume_mm3 / 2
    assert found.occupied_mm3 == pytest.approx(half, rel=4 * PIXEL_MM / 2 / 160)
    assert found.alarm
    assert found.nearest_mm == pytest.approx(950, abs=1e-2)  # the middle lies between four pixels
    assert found.nearest_xyz_mm[2] == pytest.approx(950, abs=1e-3)


def test_what_is_behind_the_zone_leaves_it_free_and_seen() -> None:
    found = measure_zone(depth_cloud(at(1100.0)), VIEW)
    assert (found.points, found.occupied_mm3, found.alarm) == (0, 0.0, False)
    assert found.unseen_share == pytest.approx(0, abs=4 * PIXEL_MM / 2 / 160)
    assert math.isnan(found.nearest_mm)


@pytest.mark.parametrize("depth", [np.nan, 600.0])
def test_void_pixels_and_what_is_in_front_hide_the_zone(depth: float) -> None:
    z = at(1100.0)
    z[:, :100] = depth
    found = measure_zone(depth_cloud(z), VIEW)
    assert found.unseen_share == pytest.approx(0.5, abs=2 * PIXEL_MM / 160)
    assert not found.alarm


def test_a_small_thing_is_an_alarm_and_single_pixels_are_none() -> None:
    z = at(1100.0)
    z[40:120:8, 60:140:8] = 950.0
    assert measure_zone(depth_cloud(z), VIEW).points == 0
    z[80:84, 100:104] = 940.0
    found = measure_zone(depth_cloud(z), VIEW)
    assert found.points >= 12
    assert found.alarm
    off = np.hypot(1.5, 0.5) / 400  # the corner has too few neighbours
    assert found.nearest_mm == pytest.approx(940 * np.hypot(1, off), rel=1e-6)
    more = ZoneRules(least_points=100)
    assert not measure_zone(depth_cloud(z), VIEW, more).alarm
    assert not measure_zone(depth_cloud(z), VIEW, ZoneRules(least_mm3=1e5)).alarm


def test_how_many_points_noise_allows() -> None:
    """2e4 Q(5) = 5.7e-3 points: P(2 or more) 1.6e-5, P(3 or more) 3e-8."""
    assert ZoneRules().needed_points(10_000) == 3
    assert ZoneRules(false_alarm=1e-4).needed_points(10_000) == 2
    assert ZoneRules(least_points=7).needed_points(10_000) == 7
    assert ZoneRules(margin_sigmas=0.0).needed_points(100) > 100


@pytest.mark.parametrize("wall_mm", [900.0, 1000.0])
def test_a_wall_at_its_side_is_no_alarm_by_noise(wall_mm: float) -> None:
    """1e-6 per scan: none in 200, whatever the sigma."""
    rng = np.random.default_rng(4)
    clouds = [
        depth_cloud(wall_mm + rng.normal(0, sigma, VIEW.shape), sigma)
        for sigma in (0.05, 1.0)
        for _ in range(100)
    ]
    assert not any(measure_zone(cloud, VIEW).alarm for cloud in clouds)
    careless = replace(clouds[0], sigma_mm=clouds[0].sigma_mm / np.float32(100))
    assert measure_zone(careless, VIEW).alarm


def test_a_zone_of_another_frame() -> None:
    """The same box, told from a station, gives the same; the nearest point is the station's."""
    pose = Pose(rotation_matrix(np.array([0.0, 0.0, np.pi / 2])), np.array([5.0, -7.0, -900.0]))
    turned = Zone("bench", ((-75.0, 85.0), (-107.0, 93.0), (0.0, 100.0)))
    cloud = depth_cloud(at(950.0))
    one, other = measure_zone(cloud, VIEW), measure_zone(cloud, look_at_zone(turned, CAMERA, pose))
    assert other.points == one.points
    assert other.occupied_mm3 == pytest.approx(one.occupied_mm3, rel=1e-9)
    assert other.nearest_mm == one.nearest_mm
    expected = pose.apply(np.array(one.nearest_xyz_mm))
    assert other.nearest_xyz_mm == pytest.approx(tuple(expected), abs=1e-9)


def test_refusals() -> None:
    with pytest.raises(UsageError, match="zone a: y must be a finite range that rises, got 2:1"):
        Zone("a", ((0.0, 1.0), (2.0, 1.0), (3.0, 4.0)))
    with pytest.raises(UsageError, match="x must be a finite range"):
        Zone("a", ((-math.inf, 1.0), (1.0, 2.0), (3.0, 4.0)))
    with pytest.raises(UsageError, match="must have a name"):
        Zone("", ((0.0, 1.0), (1.0, 2.0), (3.0, 4.0)))
    behind = Zone("back", ((-10.0, 10.0), (-10.0, 10.0), (-200.0, -100.0)))
    with pytest.raises(UsageError, match="zone back: the camera does not see it"):
        look_at_zone(behind, CAMERA)
    small = depth_cloud(at(950.0))
    small = replace(small, xyz=small.xyz[:5])
    with pytest.raises(ShapeError, match="on its camera's grid"):
        measure_zone(small, VIEW)
    with pytest.raises(UsageError, match="least_points"):
        ZoneRules(least_points=0)
    with pytest.raises(UsageError, match="false_alarm"):
        ZoneRules(false_alarm=0.0)
