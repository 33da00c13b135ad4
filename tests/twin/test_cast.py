"""Rays against closed forms and against brute force in plain numpy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.model import Pose
from fringeworks.twin.cast import Caster, Sight
from fringeworks.twin.scene import (
    Blend,
    Board,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Material,
    Object,
    Plane,
    Scene,
    Shape,
    Sphere,
)
from tests.twin.views import CAMERA, PROJECTOR_MM, every_pixel, pose, rays_by_opencv

Array = NDArray[np.float64]
Field = Callable[[Array], Array]

PLACE = pose((0.4, -0.7, 0.3), (10.0, -15.0, 650.0))
BACK = Plane()
BEHIND = pose((0.1, 0.2, 0.0), (0.0, 0.0, 900.0))

FINGERS = Blend(
    (
        Capsule((0.0, 0.0, 0.0), 20.0, (0.0, 30.0, 5.0), 14.0),
        Capsule((5.0, 0.0, 0.0), 9.0, (15.0, -60.0, -10.0), 6.0),
        Capsule((-8.0, 0.0, 0.0), 8.0, (-25.0, -50.0, 0.0), 8.0),
        Capsule((0.0, 40.0, 0.0), 3.0, (0.0, 42.0, 0.0), 12.0),
    ),
    smooth_mm=6.0,
)


def scene(*things: tuple[Shape, Pose]) -> Scene:
    return Scene("test", tuple(Object(f"o{i}", *thing) for i, thing in enumerate(things)))


def aimed_rays(target: Pose, *, spread: float, count: int = 400) -> tuple[Array, Array]:
    """Rays from around the camera to about a place, unit directions."""
    rng = np.random.default_rng(1)
    origins = rng.normal(0, 30, (count, 3))
    ends = target.translation_mm + rng.normal(0, spread, (count, 3))
    directions = ends - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


# Fields: negative inside, positive outside, in the shape's frame. Written without the kernels.


def ball_field(p: Array) -> Array:
    return np.asarray(np.linalg.norm(p, axis=-1) - 40)


def cylinder_field(p: Array) -> Array:
    across = np.hypot(p[..., 0], p[..., 1]) - 30
    return np.asarray(np.maximum(across, np.abs(p[..., 2]) - 45), np.float64)


def cone_field(p: Array) -> Array:
    mantle = np.hypot(p[..., 0], p[..., 1]) - 35 * (1 - p[..., 2] / 80)
    return np.asarray(np.maximum(mantle, np.maximum(-p[..., 2], p[..., 2] - 80)), np.float64)


def box_field(p: Array) -> Array:
    return np.asarray(np.max(np.abs(p) - np.array([30, 20, 25]), axis=-1))


def capsule_field(p: Array, capsule: Capsule) -> Array:
    """The nearest of the spheres between the ends, by halving thirds: the distance is convex."""
    start, end = np.array(capsule.start_mm), np.array(capsule.end_mm)
    radii = capsule.start_radius_mm, capsule.end_radius_mm

    def distance(share: Array) -> Array:
        centre = start + share[..., None] * (end - start)
        radius = radii[0] + share * (radii[1] - radii[0])
        return np.asarray(np.linalg.norm(p - centre, axis=-1) - radius)

    low, high = np.zeros(p.shape[:-1]), np.ones(p.shape[:-1])
    for _ in range(80):  # 100 mm (2 / 3)^80 = 1e-12
        one, other = low + (high - low) / 3, high - (high - low) / 3
        nearer = distance(one) < distance(other)
        low, high = np.where(nearer, low, one), np.where(nearer, other, high)
    return distance((low + high) / 2)


def blend_field(p: Array) -> Array:
    """The smooth minimum, one after the other, as the noun's docstring and the kernel's say."""
    value = capsule_field(p, FINGERS.capsules[0])
    for capsule in FINGERS.capsules[1:]:
        other = capsule_field(p, capsule)
        share = np.maximum(FINGERS.smooth_mm - np.abs(value - other), 0) / FINGERS.smooth_mm
        value = np.minimum(value, other) - share**2 * FINGERS.smooth_mm / 4
    return value


SOLIDS = [
    (Sphere(40.0), ball_field),
    (Cylinder(30.0, 90.0), cylinder_field),
    (Cone(35.0, 80.0), cone_field),
    (Box((60.0, 40.0, 50.0)), box_field),
]


def first_crossing(field: Field, origins: Array, directions: Array, *, step: float) -> Array:
    """Where the field along each ray first turns negative, to `step` mm; inf if it never does."""
    out = np.full(len(origins), np.inf)
    distances = np.arange(450.0, 850.0, step)
    inverse = PLACE.inverse()
    for i, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        inside = field(inverse.apply(origin + distances[:, None] * direction)) < 0
        if inside.any():
            out[i] = distances[np.argmax(inside)]
    return out


@pytest.mark.parametrize(("shape", "field"), SOLIDS)
def test_solids_against_marching(shape: Shape, field: Field) -> None:
    step = 0.05
    origins, directions = aimed_rays(PLACE, spread=25.0)
    sight = Caster(scene((shape, PLACE))).look(origins, directions)
    marched = first_crossing(field, origins, directions, step=step)
    met = np.isfinite(sight.distance)
    # Marching misses only chords shorter than its step.
    missed = met & ~np.isfinite(marched)
    assert not (~met & np.isfinite(marched)).any()
    assert missed.sum() <= 2
    both = met & ~missed
    assert both.sum() > 200
    # Rounding of coordinates below 1000 is 1e-13; the distance follows it over the cosine.
    on_surface = field(PLACE.inverse().apply(sight.points[met]))
    assert np.abs(on_surface).max() < 1e-10
    late = marched[both] - sight.distance[both]
    assert late.min() > -1e-9
    assert late.max() < step + 1e-9


def test_blend_against_marching() -> None:
    step = 0.4
    origins, directions = aimed_rays(PLACE, spread=22.0, count=100)
    sight = Caster(scene((FINGERS, PLACE))).look(origins, directions)
    marched = first_crossing(blend_field, origins, directions, step=step)
    met = np.isfinite(sight.distance)
    assert 40 < met.sum() < 95
    assert not (~met & np.isfinite(marched)).any()
    late = marched[met] - sight.distance[met]
    assert late.min() > -1e-6
    assert np.mean(late < step + 1e-6) > 0.97  # others cut a chord shorter than the step
    on_surface = blend_field(PLACE.inverse().apply(sight.points[met]))
    assert np.abs(on_surface).max() < 1e-7  # a ray that grazes; nearly all others:
    assert np.mean(np.abs(on_surface) < 1e-9) > 0.97


def test_a_blend_of_one_round_capsule_is_a_sphere() -> None:
    ball = Blend((Capsule((0, 0, 0), 40.0, (0, 0, 0), 40.0),))
    rays = aimed_rays(PLACE, spread=25.0)
    one = Caster(scene((ball, PLACE))).look(*rays)
    other = Caster(scene((Sphere(40.0), PLACE))).look(*rays)
    np.testing.assert_allclose(one.distance, other.distance, rtol=0, atol=1e-9)
    # The last step, below 1e-6 mm, turns the normal by that over the radius.
    np.testing.assert_allclose(one.normals, other.normals, rtol=0, atol=5e-8)


@pytest.mark.parametrize(("shape", "field"), [*SOLIDS, (FINGERS, blend_field)])
def test_normals_are_gradients_towards_the_origin(shape: Shape, field: Field) -> None:
    origins, directions = aimed_rays(PLACE, spread=20.0, count=40)
    sight = Caster(scene((shape, PLACE))).look(origins, directions)
    met = np.isfinite(sight.distance)
    normals = sight.normals[met]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=0, atol=1e-12)
    assert (np.einsum("ij,ij->i", normals, directions[met]) < 0).all()
    assert np.isnan(sight.normals[~met]).all()
    step = 1e-2
    moves = np.concatenate([np.eye(3), -np.eye(3)])[:, None] * step
    values = field(PLACE.inverse().apply(sight.points[met] + moves))
    gradient = (values[:3] - values[3:]).T / (2 * step)
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    # Central differences: step^2 / 6 of third derivatives, and edges of solids within a step.
    agree = np.einsum("ij,ij->i", gradient, normals) > 1 - 1e-5
    assert agree.mean() > 0.95


def test_planes_and_their_edges() -> None:
    # Rays along z at x = -3 .. 3 against a plane 4 wide, 2 high, tilted about x by 45 degrees.
    x = np.arange(-3.0, 4.0)
    origins = np.stack([x, np.full(7, 0.5), np.zeros(7)], axis=-1)
    directions = np.tile([0.0, 0.0, 1.0], (7, 1))
    tilted = pose((np.pi / 4, 0, 0), (0, 0, 100))
    sight = Caster(scene((Plane(4.0, 2.0), tilted))).look(origins, directions)
    assert np.isfinite(sight.distance).tolist() == [False, *[True] * 5, False]
    # The plane is y = s cos45, z = 100 + s sin45: at y = 1/2 it is half a millimetre behind 100.
    np.testing.assert_allclose(sight.distance[1:6], 100.5, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        sight.normals[3], [0, np.sqrt(0.5), -np.sqrt(0.5)], rtol=0, atol=1e-12
    )
    outside = Caster(scene((Plane(4.0, 1.4), tilted))).look(origins, directions)
    assert np.isfinite(outside.distance[1:6]).all() == (0.5 * np.sqrt(2) <= 0.7)


def test_a_bowed_sheet_is_its_quadric() -> None:
    board = Board(9, 7, 15.0, bow_mm=(0.4, -0.3))
    origins, directions = aimed_rays(pose((0, 0, 0), (40, 30, 600)), spread=30.0)
    place = pose((0.2, -0.3, 0.1), (0.0, 0.0, 600.0))
    sight = Caster(scene((board, place))).look(origins, directions)
    met = np.isfinite(sight.distance)
    x, y, z = place.inverse().apply(sight.points[met]).T
    # Sheet: squares from -15 to 135 and -15 to 105, and a margin of 10.
    u, v = (x - 60) / 85, (y - 45) / 70
    assert met.sum() > 200
    np.testing.assert_allclose(z, -0.4 * (1 - u**2) + 0.3 * (1 - v**2), rtol=0, atol=1e-10)
    assert np.abs(u).max() <= 1 + 1e-12
    assert np.abs(v).max() <= 1 + 1e-12


def test_the_nearest_object_is_seen() -> None:
    origins, directions = np.zeros((3, 3)), np.array([[0, 0, 1.0], [0.6, 0, 0.8], [np.nan, 0, 1]])
    ball, disc = (
        (Sphere(10.0), pose((0, 0, 0), (0, 0, 100))),
        (Plane(), pose((0, 0, 0), (0, 0, 200))),
    )
    for things, index in (((disc, ball), 1), ((ball, disc), 0)):
        sight = Caster(scene(*things)).look(origins, directions)
        assert sight.surface.tolist() == [index, 1 - index, -1]
        np.testing.assert_allclose(sight.distance, [90, 250, np.inf], rtol=0, atol=1e-10)
        assert np.isnan(sight.points[2]).all()
        assert np.isnan(sight.albedo[2])


def test_a_ray_that_starts_on_a_surface_leaves_it() -> None:
    things = ((Sphere(40.0), PLACE), (BACK, BEHIND))
    sight = Caster(scene(*things)).look(*aimed_rays(PLACE, spread=10.0))
    onward = sight.normals[sight.surface == 0]
    again = Caster(scene(*things)).look(sight.points[sight.surface == 0], onward)
    assert not (again.surface == 0).any()  # a sphere's outward normals never come back to it


def test_albedo_is_the_materials() -> None:
    white = Object("ball", Sphere(40.0), PLACE, Material(albedo=0.31))
    sight = Caster(Scene("one", (white,))).look(*aimed_rays(PLACE, spread=20.0))
    met = np.isfinite(sight.distance)
    assert (sight.albedo[met] == 0.31).all()
    assert np.isnan(sight.albedo[~met]).all()


def transitions(mask: NDArray[np.bool_], step: float) -> list[Array]:
    """Per row, where the mask changes, px."""
    return [np.asarray(np.flatnonzero(row[1:] != row[:-1]) * step, np.float64) for row in mask]


def silhouette(shape: Shape, place: Pose, step: float) -> tuple[NDArray[np.bool_], Array]:
    """Mask ``(rows, n)`` of a shape on every twentieth row, `step` px apart, and OpenCV's rays."""
    rows, columns = np.mgrid[0:480:20, 0:752:step]
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=-1).astype(np.float64)
    sight = Caster(scene((shape, place))).look(*CAMERA.rays(pixels))
    return np.isfinite(sight.distance).reshape(rows.shape), rays_by_opencv(CAMERA, pixels)


def assert_same_outline(mask: NDArray[np.bool_], asked: NDArray[np.bool_], step: float) -> None:
    for one, other in zip(transitions(mask, step), transitions(asked, step), strict=True):
        assert len(one) == len(other)
        np.testing.assert_allclose(one, other, rtol=0, atol=1.01 * step)  # 0.05 px
    assert sum(len(row) for row in transitions(asked, step)) >= 20


def test_silhouette_of_a_sphere() -> None:
    step, centre, radius = 0.05, np.array([12.0, -7.0, 650.0]), 60.0
    mask, rays = silhouette(Sphere(radius), pose((0.3, 0.2, 0.1), (12, -7, 650)), step)
    # The tangent cone: rays within asin(R / distance) of the centre's direction.
    cosine = rays @ centre / np.linalg.norm(centre)
    limit = np.sqrt(1 - (radius / np.linalg.norm(centre)) ** 2)
    assert_same_outline(mask, (cosine >= limit).reshape(mask.shape), step)


def test_silhouette_of_a_cylinder() -> None:
    step, place, radius = 0.05, pose((1.4, 0.2, 0.1), (20, 5, 650)), 52.5
    mask, rays = silhouette(Cylinder(radius, 2000.0), place, step)
    # Rays that pass the axis, a line, no further than the radius.
    across = np.cross(rays, place.rotation[:, 2])
    gap = np.abs(across @ place.translation_mm) / np.linalg.norm(across, axis=1)
    assert_same_outline(mask, (gap <= radius).reshape(mask.shape), step)


def lit_by_hand(points: Array, field: Field, *, samples: int = 3000) -> NDArray[np.bool_]:
    """Whether the way from each point to the projector, looked at in steps, stays outside."""
    shares = (np.arange(samples) + 0.5) / samples * 0.5  # the shape is in the nearer half
    ways = points[:, None] + shares[:, None] * (PROJECTOR_MM - points)[:, None]
    return np.array([(field(PLACE.inverse().apply(way)) > 0).all() for way in ways])


def look_from_camera(caster: Caster, step: float) -> Sight:
    return caster.look(*CAMERA.rays(every_pixel(CAMERA, step)))


@pytest.mark.parametrize(("shape", "field"), SOLIDS)
def test_shadows_on_a_wall_against_sampling(shape: Shape, field: Field) -> None:
    caster = Caster(scene((shape, PLACE), (BACK, BEHIND)))
    sight = look_from_camera(caster, 16.0)
    wall = sight.points[sight.surface == 1]
    hidden = caster.hidden(wall, np.tile(PROJECTOR_MM, (len(wall), 1)))
    asked = ~lit_by_hand(wall, field)
    assert 30 < asked.sum() < len(wall) - 30
    assert not (asked & ~hidden).any()
    assert (hidden & ~asked).sum() <= 1  # chords shorter than a step of 0.15 mm


def test_shadow_of_a_sphere_by_its_closed_form() -> None:
    caster = Caster(scene((Sphere(40.0), PLACE), (BACK, BEHIND)))
    sight = look_from_camera(caster, 2.0)
    hidden = caster.hidden(sight.points, np.tile(PROJECTOR_MM, (len(sight.points), 1)))
    # On the wall: the way passes the centre nearer than the radius. On the ball: it faces away.
    way = sight.points - PROJECTOR_MM
    to_centre = PLACE.translation_mm - PROJECTOR_MM
    gap = np.linalg.norm(np.cross(way, to_centre), axis=1) / np.linalg.norm(way, axis=1)
    wall = sight.surface == 1
    clear = np.abs(gap - 40) > 1e-6
    np.testing.assert_array_equal(hidden[wall & clear], gap[wall & clear] < 40)
    outward = (sight.points - PLACE.translation_mm) / 40
    cosine = -np.einsum("ij,ij->i", outward, way) / np.linalg.norm(way, axis=1)
    # A chord of 2 R cos is seen from the clearance of 1e-3 mm on.
    ball = (sight.surface == 0) & (np.abs(cosine) > 2e-5)
    assert wall.sum() > 10_000
    assert ball.sum() > 5_000
    np.testing.assert_array_equal(hidden[ball], cosine[ball] < 0)


def test_shadows_of_a_blend_against_sampling() -> None:
    caster = Caster(scene((FINGERS, PLACE), (BACK, BEHIND)))
    sight = look_from_camera(caster, 2.0)
    to_light = PROJECTOR_MM - sight.points
    facing = np.einsum("ij,ij->i", sight.normals, to_light) / np.linalg.norm(to_light, axis=1)
    hidden = caster.hidden(sight.points, np.tile(PROJECTOR_MM, (len(to_light), 1)))
    rng = np.random.default_rng(2)
    kinds = [
        np.flatnonzero((sight.surface == index) & (np.abs(facing) > 0.2) & (hidden == side))
        for index in (0, 1)
        for side in (False, True)
    ]
    assert all(len(kind) > 5 for kind in kinds)
    chosen = np.concatenate([rng.permutation(kind)[:100] for kind in kinds])
    starts = sight.points[chosen] + 0.02 * sight.normals[chosen]
    asked = ~lit_by_hand(starts, blend_field, samples=500)
    # One way in a hundred may dip below zero between two steps of 0.6 to 1.1 mm.
    assert (hidden[chosen] != asked).sum() <= 4


def test_hidden_is_false_for_nan_and_for_nothing() -> None:
    caster = Caster(scene((Sphere(40.0), PLACE)))
    points = np.array([[np.nan, 0, 0], [0, 300.0, 650.0]])
    assert caster.hidden(points, np.zeros((2, 3))).tolist() == [False, False]
    behind = PLACE.translation_mm[None] * 1.5
    assert caster.hidden(behind, np.zeros((1, 3))).tolist() == [True]


def test_many_rays_are_the_same_as_few() -> None:
    caster = Caster(scene((Sphere(40.0), PLACE), (BACK, BEHIND)))
    rays = CAMERA.rays(every_pixel(replace(CAMERA, width=400, height=200)))  # more than a chunk
    every = caster.look(*rays)
    some = slice(70_000, 70_100)
    few = caster.look(rays[0][some], rays[1][some])
    np.testing.assert_array_equal(every.distance[some], few.distance)
    np.testing.assert_array_equal(every.normals[some], few.normals)
