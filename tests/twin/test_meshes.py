"""Meshes against the analytic shapes that they triangulate, and meshes that cannot be used."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import MissingExtraError, UsageError
from fringeworks.model import Pose
from fringeworks.twin.cast import Caster
from fringeworks.twin.meshes import check_mesh
from fringeworks.twin.scene import Box, Mesh, Object, Plane, Scene, Shape
from tests.twin.views import CAMERA, PROJECTOR_MM, every_pixel, pose

Array = NDArray[np.float64]

PLACE = pose((0.4, -0.7, 0.3), (10.0, -15.0, 650.0))
WALL = Object("wall", Plane(), pose((0.1, 0.2, 0.0), (0.0, 0.0, 900.0)))


def box_mesh(size: tuple[float, float, float]) -> Mesh:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    return Mesh(corners * np.array(size), np.array(faces), source="box.ply")


def grid_mesh(cells: int, side: float) -> Mesh:
    """A flat square of triangles in z = 0."""
    y, x = np.mgrid[: cells + 1, : cells + 1]
    vertices = np.stack([x / cells - 0.5, y / cells - 0.5, np.zeros_like(x)], axis=-1) * side
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = np.concatenate(
        [
            np.stack([first, first + 1, first + cells + 2], axis=-1),
            np.stack([first, first + cells + 2, first + cells + 1], axis=-1),
        ]
    )
    return Mesh(vertices.reshape(-1, 3), faces, source="grid.stl")


def caster_of(shape: Shape, place: Pose = PLACE) -> Caster:
    return Caster(Scene("test", (Object("thing", shape, place), WALL)))


def test_a_mesh_of_a_box_is_the_box() -> None:
    pytest.importorskip("embreex")
    size = (60.0, 40.0, 50.0)
    rays = CAMERA.rays(every_pixel(CAMERA, 3.0))
    mesh, box = caster_of(box_mesh(size)).look(*rays), caster_of(Box(size)).look(*rays)
    same = mesh.surface == box.surface
    # Embree's float32 moves the outline by 1e-7 of the size: no ray in tens of thousands.
    assert (~same).sum() <= 1
    assert (mesh.surface == 0).sum() > 1000
    hit = same & (mesh.surface == 0)
    np.testing.assert_allclose(mesh.distance[hit], box.distance[hit], rtol=0, atol=1e-9)
    np.testing.assert_allclose(mesh.points[hit], box.points[hit], rtol=0, atol=1e-9)
    # A ray within 1e-5 mm of an edge may be told its other face.
    turned = np.abs(mesh.normals[hit] - box.normals[hit]).max(axis=1) > 1e-9
    assert turned.sum() <= 1

    origins = np.tile(PROJECTOR_MM, (len(box.points), 1))
    hidden = caster_of(Box(size)).hidden(box.points, origins)
    hidden_by_mesh = caster_of(box_mesh(size)).hidden(box.points, origins)
    assert hidden.sum() > 500
    assert (hidden != hidden_by_mesh).sum() <= 1


def test_no_ray_slips_through_the_seams() -> None:
    pytest.importorskip("embreex")
    mesh = grid_mesh(12, 100.0)
    place = pose((0.3, 0.2, 0.1), (0.0, 0.0, 600.0))
    inner = mesh.vertices[np.abs(mesh.vertices[:, :2]).max(axis=1) < 49]
    edges = mesh.vertices[mesh.faces]
    middles = (edges + np.roll(edges, 1, axis=1)).reshape(-1, 3) / 2
    middles = middles[np.abs(middles[:, :2]).max(axis=1) < 49]
    targets = place.apply(np.concatenate([inner, middles]))
    directions = targets / np.linalg.norm(targets, axis=1, keepdims=True)
    sight = caster_of(mesh, place).look(np.zeros_like(targets), directions)
    assert (sight.surface == 0).all()
    np.testing.assert_allclose(sight.points, targets, rtol=0, atol=1e-9)
    # Lit from the camera's own place nothing of it is hidden; behind it all is.
    assert not caster_of(mesh, place).hidden(sight.points, np.zeros_like(targets)).any()
    assert caster_of(mesh, place).hidden(1.2 * targets, np.zeros_like(targets)).all()


def test_triangles_without_area_are_left_out() -> None:
    pytest.importorskip("embreex")
    mesh = grid_mesh(2, 100.0)
    more = replace(mesh, faces=np.concatenate([[[0, 0, 1]], mesh.faces]))
    rays = CAMERA.rays(every_pixel(CAMERA, 20.0))
    one, other = caster_of(mesh).look(*rays), caster_of(more).look(*rays)
    np.testing.assert_array_equal(one.surface, other.surface)
    np.testing.assert_array_equal(one.normals, other.normals)


def test_rays_that_miss_the_mesh_by_far() -> None:
    pytest.importorskip("embreex")
    caster = Caster(Scene("mesh", (Object("box", box_mesh((1.0, 1.0, 1.0)), PLACE),)))
    sight = caster.look(np.zeros((2, 3)), np.array([[0, 0, -1.0], [np.nan, 0, 1]]))
    assert sight.surface.tolist() == [-1, -1]
    assert caster.hidden(np.ones((1, 3)), np.zeros((1, 3))).tolist() == [False]


def test_without_embree_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.raises(MissingExtraError, match=r"pip install fringeworks\[mesh\]"):
        caster_of(box_mesh((1.0, 1.0, 1.0)))


BOX = box_mesh((1.0, 1.0, 1.0))
BROKEN = np.where(np.arange(8)[:, None] < 3, np.nan, BOX.vertices)


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (replace(BOX, faces=BOX.faces[:0]), "box.ply must have faces, got none"),
        (replace(BOX, vertices=BROKEN), "finite vertices, got 3 of 8 with NaN"),
        (replace(BOX, faces=BOX.faces + 2), "its 8 vertices, got .* indices outside"),
        (replace(BOX, faces=BOX.faces - 1), "its 8 vertices, got .* indices outside"),
        (replace(BOX, vertices=BOX.vertices * 0), "triangles with an area, got 12 without"),
        (replace(BOX, vertices=BOX.vertices[:, :2]), "vertices must be .n, 3., got .8, 2."),
        (replace(BOX, faces=BOX.faces.astype(float)), "faces must be integers, got float64"),
    ],
)
def test_meshes_that_cannot_be_used(mesh: Mesh, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        check_mesh(mesh)
