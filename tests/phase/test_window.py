"""Windows of projector coordinates, against points projected one by one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import ShapeError, UsageError
from fringeworks.geometry.lens import project, unproject
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Axis, Pose, Rig
from fringeworks.phase.window import Volume, coordinate_window, volume_of
from tests.scenes import CAMERA, PROJECTOR, RIG

SHAPE = (CAMERA.height, CAMERA.width)
OTHER_SIDE = Rig(
    CAMERA, PROJECTOR, Pose(rotation_matrix(np.array([0.0, 0.28, 0.0])), np.array([180.0, 0, 20]))
)


def projected(rig: Rig, pixel: tuple[int, int], depth_mm: float, axis: Axis) -> float:
    row, column = pixel
    ray = unproject(np.array([column, row], dtype=float), rig.camera.lens.vector)
    point = rig.projector_from_camera.apply(np.array([*ray, 1.0]) * depth_mm)
    return float(project(point, rig.projector.lens.vector)[0 if axis == "x" else 1])


@pytest.mark.parametrize("rig", [RIG, OTHER_SIDE], ids=["left", "right"])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_both_depths_whichever_is_lower(rig: Rig, axis: Axis) -> None:
    window = coordinate_window(Volume(rig, (500.0, 900.0)), axis, SHAPE)
    rng = np.random.default_rng(0)
    pixels = [
        (0, 0),
        (479, 751),
        (479, 0),
        *zip(*(rng.integers(0, s, 40) for s in SHAPE), strict=True),
    ]
    for pixel in pixels:
        ends = sorted(projected(rig, pixel, depth, axis) for depth in (500.0, 900.0))
        # Between lattice points lenses bend by thousandths of a px.
        assert window.low_px[pixel] == pytest.approx(ends[0], abs=0.005)
        assert window.high_px[pixel] == pytest.approx(ends[1], abs=0.005)


def test_infinity_is_the_vanishing_point() -> None:
    far = coordinate_window(Volume(RIG, (500.0, math.inf)), "x", SHAPE)
    ends = sorted([projected(RIG, (240, 376), 500, "x"), projected(RIG, (240, 376), 1e9, "x")])
    assert far.low_px[240, 376] == pytest.approx(ends[0], abs=0.005)
    assert far.high_px[240, 376] == pytest.approx(ends[1], abs=0.005)


def test_a_limit_behind_the_projector_is_unknown() -> None:
    ahead = replace(RIG, projector_from_camera=Pose(np.eye(3), np.array([-100.0, 0.0, -600.0])))
    window = coordinate_window(Volume(ahead, (500.0, 900.0)), "x", SHAPE)
    assert np.isnan(window.low_px).all()
    assert np.isnan(window.high_px).all()


def test_refusals() -> None:
    with pytest.raises(ShapeError, match="must be 752x480 like the rig's camera, got 10x20"):
        coordinate_window(Volume(RIG, (500.0, 900.0)), "x", (20, 10))
    with pytest.raises(UsageError, match="z-range must rise above 0"):
        coordinate_window(Volume(RIG, (900.0, 500.0)), "x", SHAPE)


def test_volume_of_a_rig() -> None:
    rig = replace(RIG, volume_mm=(600.0, 700.0))
    assert volume_of(RIG) is None
    assert volume_of(RIG, (-math.inf, math.inf)) is None
    for asked, range_mm in [
        (None, (590.0, 710.0)),
        ((500.0, 650.0), (500.0, 650.0)),
        ((500.0, math.inf), (500.0, 710.0)),
        ((-math.inf, 650.0), (590.0, 650.0)),
    ]:
        volume = volume_of(rig, asked)
        assert volume is not None
        assert volume.z_range_mm == pytest.approx(range_mm)
    volume = volume_of(RIG, (-math.inf, 650.0))
    assert volume is not None
    assert volume.z_range_mm == (0.0, 650.0)
