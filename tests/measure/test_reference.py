"""Signed distances from surfaces whose distance is a closed form."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.measure.reference import cloud_reference, find_counterparts, mesh_reference
from fringeworks.model import Cloud

CUBE = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
FACES = np.array([[q[i] for i in part] for q in QUADS for part in ((0, 1, 2), (0, 2, 3))])
SIZE = np.array([10.0, 4.0, 1.0])


def test_inside_and_outside_of_a_block() -> None:
    """Outside corners and edges too, where only a pseudonormal tells the side."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-2, 2, (5000, 3)) * SIZE
    beyond = np.abs(points) - SIZE
    expected = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    reference = mesh_reference(CUBE * SIZE, FACES)
    found = find_counterparts(reference, points, within_mm=np.inf)
    np.testing.assert_allclose(found.distance_mm, expected, atol=1e-12)
    assert not found.border.any()
    assert reference.area_mm2() == pytest.approx(8 * (10 * 4 + 10 * 1 + 4 * 1))


def test_an_stl_repeats_its_corners() -> None:
    vertices = (CUBE * SIZE)[FACES].reshape(-1, 3)
    reference = mesh_reference(vertices, np.arange(36).reshape(12, 3))
    found = find_counterparts(reference, 1.5 * CUBE * SIZE, within_mm=np.inf)
    assert not found.border.any()
    np.testing.assert_allclose(found.distance_mm, 0.5 * np.linalg.norm(SIZE))


def test_an_open_border_is_told() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    reference = mesh_reference(square, np.array([[0, 1, 2], [0, 2, 3]]))
    points = np.array([[0.5, 0.5, 0.2], [0.3, 0.3, -0.2], [1.2, 0.5, 0.1], [-1, -1, 0]])
    found = find_counterparts(reference, points, within_mm=np.inf)
    assert found.border.tolist() == [False, False, True, True]
    np.testing.assert_allclose(found.distance_mm[:2], [0.2, -0.2])


def plane_cloud(sigma: float = 0.02) -> Cloud:
    """z = 500 - x / 2 on a grid of 1 mm, as a camera at the origin sees it."""
    y, x = np.mgrid[-10.0:11, -10.0:11]
    xyz = np.stack([x, y, 500 - x / 2], axis=-1).astype(np.float32)
    flat = np.full(x.shape, sigma, np.float32)
    return Cloud(xyz, flat, flat, flat)


def test_outside_a_cloud_is_towards_its_camera() -> None:
    reference = cloud_reference(plane_cloud())
    normal = np.array([0.5, 0, 1]) / np.sqrt(1.25)
    points = np.array([1.0, 2.0, 499.5]) + np.outer([0.3, -0.3], normal)
    found = find_counterparts(reference, points, within_mm=5)
    np.testing.assert_allclose(found.distance_mm, [-0.3, 0.3], atol=1e-4)  # float32 at 500 mm
    np.testing.assert_allclose(reference.smooth, -np.broadcast_to(normal, (800, 3)), atol=1e-4)
    # sigma along z is sigma cos(slope) across, but for rays that lean by up to 0.02 rad
    np.testing.assert_allclose(reference.sigma_mm, 0.02 / np.sqrt(1.25), rtol=0.02)


@pytest.mark.parametrize(
    ("vertices", "faces", "error", "message"),
    [
        (CUBE[:, :2], FACES, ShapeError, r"vertices must be \(n, 3\)"),
        (CUBE, FACES + 1, ShapeError, "faces must name vertices below 8, got 8"),
        (CUBE, FACES[:0], MeasurementError, "no face with an area"),
        (0 * CUBE, FACES, MeasurementError, "no face with an area"),
        (np.nan * CUBE, FACES, MeasurementError, "not finite"),
    ],
)
def test_what_is_no_surface(
    vertices: np.ndarray, faces: np.ndarray, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        mesh_reference(vertices, faces)


def test_a_cloud_without_a_grid_is_no_surface() -> None:
    cloud = plane_cloud()
    flat = cloud.sigma_mm.reshape(1, -1)
    with pytest.raises(MeasurementError, match=r"needs a cloud on the camera's grid \(.npz\)"):
        cloud_reference(Cloud(cloud.xyz.reshape(1, -1, 3), flat, flat, flat))
