"""Regions of a cloud, and the plane measured in one."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.errors import MeasurementError
from fringeworks.measure.region import Region, select_points
from fringeworks.model import Cloud
from fringeworks.pipeline import measure_plane


def grid_cloud() -> Cloud:
    """Points (u, v, 100 + u) mm on a 4 x 5 grid, the one of row 0, column 0 void."""
    v, u = np.mgrid[:4, :5].astype(np.float32)
    xyz = np.stack([u, v, 100 + u], axis=-1)
    xyz[0, 0] = np.nan
    flat = np.ones((4, 5), np.float32)
    return Cloud(xyz, flat, flat, flat)


def test_an_open_region_holds_all_valid_points() -> None:
    assert select_points(grid_cloud(), Region()).shape == (19, 3)


def test_a_rectangle_of_pixels_includes_both_ends() -> None:
    points = select_points(grid_cloud(), Region(pixels=((0, 1), (0, 2))))
    assert sorted(map(tuple, points)) == [
        (0, 1, 100),
        (0, 2, 100),
        *[(1, v, 101) for v in range(3)],
    ]


def test_a_box_is_in_millimetres_of_the_cloud() -> None:
    points = select_points(grid_cloud(), Region(box_mm=((1, 9), (0, 0.5), (0, 103))))
    assert sorted(map(tuple, points)) == [(1, 0, 101), (2, 0, 102), (3, 0, 103)]


def test_box_and_pixels_both_hold() -> None:
    region = Region(box_mm=((1, 2), (0, 9), (0, 999)), pixels=((2, 4), (3, 3)))
    assert select_points(grid_cloud(), region).tolist() == [[2, 3, 102]]


def test_an_empty_region_says_where_the_points_are() -> None:
    with pytest.raises(MeasurementError, match=r"span x 0 to 4, y 0 to 3, z 100 to 104 mm"):
        select_points(grid_cloud(), Region(box_mm=((50, 60), (0, 1), (0, 1))))


def test_a_plane_is_measured_in_its_region() -> None:
    cloud = grid_cloud()
    cloud.xyz[3, 4, 2] += 50  # outside the region
    plane = measure_plane(cloud, Region(pixels=((0, 4), (0, 2))))
    # z = 100 + x: normal (1, 0, -1) / sqrt 2 turned to the origin, at -100 / sqrt 2
    np.testing.assert_allclose(plane.normal, [2**-0.5, 0, -(2**-0.5)], atol=1e-6)
    assert plane.offset_mm == pytest.approx(-100 / 2**0.5)
    assert plane.form_rms_mm < 1e-5
    assert len(plane.deviations_mm) == 14
