"""Edges and grazing incidence: surfaces whose every pixel is known, and the twin's cylinder."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import DecodeError, UsageError
from fringeworks.geometry.grid import grid_normals
from fringeworks.kernels.masks import facing
from fringeworks.model import Camera, Cloud, Lens, Pose, Projector, Reason, Rig
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import measure_cylinder, scan
from fringeworks.reconstruct.full import CloudRules, triangulate
from fringeworks.reconstruct.masks import EdgeRules, mask_edges
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import cylinder_scene, paper_rig
from fringeworks.twin.simulate import simulate
from tests.scenes import RIG, map_of, plane_points

Array = NDArray[np.float64]

WIDTH, HEIGHT, FOCAL = 60, 40, 1000.0
CAMERA = Camera(WIDTH, HEIGHT, Lens(FOCAL, FOCAL, 29.5, 19.5))
SMALL = Rig(
    CAMERA,
    Projector(600, 600, Lens(FOCAL, FOCAL, 300.0, 300.0)),
    Pose(np.eye(3), np.array([-100.0, 0.0, 0.0])),
)
"""Pinholes side by side: the projector's centre is 100 mm to the right."""

V, U = np.mgrid[:HEIGHT, :WIDTH].astype(float)
SIGMA = 0.01


def cloud_of(depth: Array, *, light: Array | float = 100.0, reason: Array | None = None) -> Cloud:
    """A cloud of these depths on the small camera's rays."""
    x, y = (U - 29.5) / FOCAL, (V - 19.5) / FOCAL
    xyz = np.stack([x * depth, y * depth, depth], axis=-1).astype(np.float32)
    sigma = np.where(np.isfinite(depth), SIGMA, np.nan).astype(np.float32)
    bright = np.broadcast_to(np.float32(light), depth.shape).astype(np.float32)
    kept = None if reason is None else reason.astype(np.uint8)
    return Cloud(xyz, sigma, bright, np.zeros_like(sigma), reason=kept)


def reasons(cloud: Cloud, rules: EdgeRules | None = None) -> NDArray[np.uint8]:
    masked = mask_edges(cloud, SMALL, rules)
    assert masked.reason is not None
    assert np.array_equal(masked.valid, masked.reason == Reason.VALID)
    assert np.array_equal(np.isfinite(masked.sigma_mm), masked.valid)
    return masked.reason


def slanted(tangent: float, *, down: float = 0.0) -> Array:
    """Depths of a plane at 500 mm whose slope against the image is so steep, right and down."""
    x, y = (U - 29.5) / FOCAL, (V - 19.5) / FOCAL
    return np.asarray(500.0 / (1 - tangent * x - down * y))


@pytest.mark.parametrize(("tangent", "down"), [(0.0, 0.0), (2.0, -1.0), (-1.0, 4.0), (7.0, 0.0)])
def test_slanted_planes_are_kept(tangent: float, down: float) -> None:
    assert (reasons(cloud_of(slanted(tangent, down=down))) == Reason.VALID).all()


def test_noise_makes_no_edges() -> None:
    """Links differ by up to 6 sigma of their difference; the rule is 5 sigma of both added."""
    noise = np.random.default_rng(0).normal(0, 1.0, V.shape)
    cloud = cloud_of(slanted(1.0) + noise)
    cloud = replace(cloud, sigma_mm=np.full_like(cloud.sigma_mm, 1.0))
    assert np.count_nonzero(reasons(cloud) == Reason.MIXED) == 0


def test_a_step_loses_one_pixel_on_each_side() -> None:
    """20 mm between columns 29 and 30; 0.5 mm a pixel and ten times that is no surface."""
    found = reasons(cloud_of(np.where(U < 30, 500.0, 520.0)))
    assert (found[:, [29, 30]] == Reason.MIXED).all()
    assert np.count_nonzero(found) == 2 * HEIGHT


def test_a_pixel_that_hangs_between_goes_with_both_neighbours() -> None:
    depth = np.where(U < 30, 500.0, 520.0)
    depth[:, 30] = 509.0
    found = reasons(cloud_of(depth))
    assert np.flatnonzero(found.any(axis=0)).tolist() == [29, 30, 31]
    assert (found[:, 30] == Reason.MIXED).all()


def test_a_slanted_step_across_the_corners() -> None:
    """Of a diagonal edge every pixel that touches the other side, at a corner too."""
    far = U > V + 10
    found = reasons(cloud_of(np.where(far, 530.0, 500.0)))
    touched = np.zeros_like(far)
    for dv in (-1, 0, 1):
        for du in (-1, 0, 1):
            inside = slice(1, -1)
            moved = np.roll(far, (dv, du), axis=(0, 1))
            touched[inside, inside] |= (moved != far)[inside, inside]
    assert np.array_equal(found[1:-1, 1:-1] == Reason.MIXED, touched[1:-1, 1:-1])


def test_a_surface_seen_too_flat_is_no_edge() -> None:
    """tan = 20 is an incidence of 87 degrees, beyond the rule's 84; the other half is level."""
    found = reasons(cloud_of(np.where(U < 30, 500.0, slanted(20.0) - slanted(20.0)[0, 30] + 500.0)))
    assert (found[:, 32:-2] == Reason.GRAZING).all()
    assert (found[:, :28] == Reason.VALID).all()


def test_a_surface_lit_too_flat() -> None:
    """A plane that passes the projector's centre (100, 0, 0) at 3 mm; the camera sees it well.

    Of points at 440 to 590 mm the light's incidence has a cosine of 0.005 to 0.007.
    """
    normal = np.array([1.0, 0.0, 0.195]) / math.hypot(1, 0.195)
    offset = normal[0] * 100.0 + 3.0
    depth = offset / ((U - 29.5) / FOCAL * normal[0] + normal[2])
    cloud = cloud_of(depth)
    towards = cloud.xyz.astype(float) - [100.0, 0.0, 0.0]
    cosine = towards @ normal / np.linalg.norm(towards, axis=-1)
    assert 0.004 < cosine.min() < cosine.max() < 0.01
    assert not reasons(cloud, EdgeRules(grazing_cos=0.003)).any()
    found = reasons(cloud_of(depth))
    assert (found[1:-1, 1:-1] == Reason.GRAZING).all()
    behind = cloud_of((offset - 6.0) / ((U - 29.5) / FOCAL * normal[0] + normal[2]))
    assert (reasons(behind, EdgeRules(grazing_cos=0.003))[1:-1, 1:-1] == Reason.GRAZING).all()


@pytest.mark.parametrize("seed", range(3))
def test_facing_is_what_normals_of_the_points_say(seed: int) -> None:
    """Against the cross product of neighbouring points, at limits 1e-3 to both sides."""
    rng = np.random.default_rng(seed)
    tangent, down = rng.uniform(-4, 4, 2)
    points = cloud_of(slanted(tangent, down=down)).xyz.astype(float)
    i, j = 20, 30
    normal = grid_normals(points)[i, j].astype(float)
    point, centre = points[i, j], np.array([100.0, 60.0, 20.0])
    cosines = [
        -normal @ point / np.linalg.norm(point),
        -normal @ (point - centre) / np.linalg.norm(point - centre),
    ]
    z = points[..., 2]
    p, q = (z[i, j + 1] - z[i, j - 1]) / 2 / z[i, j], (z[i + 1, j] - z[i - 1, j]) / 2 / z[i, j]
    x, y, depth = (np.float32(value) for value in (*(point[:2] / point[2]), point[2]))
    for limit, expected in ((min(cosines) - 1e-3, True), (min(cosines) + 1e-3, False)):
        if limit > 0:
            focal, square, zero = np.float32(FOCAL), np.float32(limit**2), np.float32(0)
            place = (np.float32(centre[0]), np.float32(centre[1]), np.float32(centre[2]))
            view = ((focal, focal, square, zero), place)
            assert facing(np.float32(p), np.float32(q), (x, y, depth), view) == expected


def disc(radius: float) -> NDArray[np.bool_]:
    return np.asarray(np.hypot(U - 29.5, V - 19.5) < radius)


def test_a_silhouette_against_nothing_loses_what_fades() -> None:
    """The rim has half the light: it sees half of the disc. The bright one does not fade."""
    inside, core = disc(12.0), disc(11.0)
    depth = np.where(inside, 500.0, np.nan)
    fading = np.where(core, 100.0, np.where(inside, 50.0, 2.0))
    found = reasons(cloud_of(depth, light=fading))
    assert (found[inside & ~core] == Reason.MIXED).all()
    assert (found[core] == Reason.VALID).all()
    assert (found[~inside] == Reason.NOT_DECODED).all()
    assert (reasons(cloud_of(depth, light=np.where(inside, 100.0, 2.0)))[inside] == 0).all()


def test_a_hole_of_too_much_light_keeps_its_rim() -> None:
    """Saturated pixels are void and brighter than their neighbours."""
    hole = disc(5.0)
    light = np.where(hole, 255.0, np.where(disc(8.0), 180.0, 100.0))
    found = reasons(cloud_of(np.where(hole, np.nan, 500.0), light=light))
    assert np.count_nonzero(found == Reason.MIXED) == 0


def test_beside_what_is_outside_the_volume_one_pixel_goes() -> None:
    """A wall beyond the volume is lit: what sees it and the object alike does not fade."""
    wall = U >= 40
    reason = np.where(wall, Reason.OUTSIDE, Reason.VALID)
    found = reasons(cloud_of(np.where(wall, np.nan, 500.0), reason=reason))
    assert (found[:, 39] == Reason.MIXED).all()
    assert (found[:, :39] == Reason.VALID).all()
    assert (found[:, 40:] == Reason.OUTSIDE).all()


def test_reasons_of_a_scan() -> None:
    """One of each: not decoded, off its line, outside the volume."""
    points = plane_points(RIG, (0.2, -0.1, -1.0), -650.0)
    coded = map_of(RIG, points)
    assert coded.column is not None
    assert coded.row is not None
    coded.column.coordinate[5, 6] = coded.column.sigma[5, 6] = np.nan
    coded.row.coordinate[100, 200] += 12.0
    depth = points[..., 2]
    window = (float(depth.min()) + 5, float(depth.max()))
    cloud = triangulate(coded, RIG, rules=CloudRules(z_range_mm=window))
    assert cloud.reason is not None
    assert cloud.reason[5, 6] == Reason.NOT_DECODED
    assert cloud.reason[100, 200] == Reason.OFF_LINE
    outside = depth <= window[0]
    assert (cloud.reason[outside] == Reason.OUTSIDE).mean() > 0.999
    assert np.array_equal(cloud.reason == Reason.VALID, cloud.valid)


def test_nothing_left_is_an_error() -> None:
    with pytest.raises(DecodeError, match=r"no point is left: 100\.0% at an edge"):
        mask_edges(cloud_of(np.where((U + V) % 2, 500.0, 530.0)), SMALL)


@pytest.mark.parametrize(
    ("rules", "message"),
    [
        ({"grazing_cos": 0.0}, r"grazing_cos must be in \(0, 1\), got 0"),
        ({"grazing_cos": math.nan}, "got nan"),
        ({"jump_sigmas": -1.0}, "jump_sigmas must be 0 or more, got -1"),
        ({"fade_share": 1.5}, r"fade_share must be in \[0, 1\], got 1.5"),
    ],
)
def test_limits_that_make_no_sense(rules: dict[str, float], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        EdgeRules(**rules)


def test_the_twins_cylinder_is_no_longer_too_large() -> None:
    """With the true rig and no noise. Mixed pixels alone made its radius 0.012 mm too large."""
    rig, rng = paper_rig(), np.random.default_rng(0)
    sequence = make_sequence("measure", width=608, height=684, axes=("x",))
    quiet = Effects().without_noise()
    capture = simulate(cylinder_scene(), rig, sequence, effects=quiet, rng=rng).capture
    masked = scan(capture, rig)
    assert abs(measure_cylinder(masked).radius_mm - 52.5) < 0.002
    every = scan(capture, rig, cloud_rules=CloudRules(edges=None))
    assert measure_cylinder(every).radius_mm - 52.5 > 0.008
    assert 0.98 < np.count_nonzero(masked.valid) / np.count_nonzero(every.valid) < 1
