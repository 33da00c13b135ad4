"""Scene objects as the ray kernels take them: sizes, place, and a ball around each."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels import shapes
from fringeworks.kernels.rays import Body
from fringeworks.model import Pose
from fringeworks.twin.scene import Blend, Board, Box, Capsule, Cone, Cylinder, Plane, Shape, Sphere
from fringeworks.twin.texture import sheet_sizes

Array = NDArray[np.float64]

BALL_SPARE = 1e-3
"""Share by which a bounding ball is larger than it must be, so that no rounding cuts a shape."""


def body_of(shape: Shape, camera_from_object: Pose) -> Body:
    """An analytic shape at its place; for meshes see `meshes`."""
    code, sizes = _sizes(shape)
    offset, radius = _ball(shape)
    return placed_body(code, sizes, (offset, radius), camera_from_object)


def placed_body(
    code: int, sizes: Array, ball: tuple[Array, float], camera_from_object: Pose
) -> Body:
    """A body from its sizes and its bounding ball (middle in the object's frame, radius)."""
    offset, radius = ball
    rotation = np.ascontiguousarray(camera_from_object.rotation.T, dtype=np.float64)
    middle = camera_from_object.apply(offset)
    return Body(code, sizes, rotation, middle, offset, float(radius * (1 + BALL_SPARE)))


def _sizes(shape: Shape) -> tuple[int, Array]:
    match shape:
        case Plane():
            return shapes.PLANE, np.array([shape.width_mm / 2, shape.height_mm / 2])
        case Sphere():
            return shapes.SPHERE, np.array([shape.radius_mm])
        case Cylinder():
            return shapes.CYLINDER, np.array([shape.radius_mm, shape.length_mm / 2])
        case Cone():
            return shapes.CONE, np.array([shape.radius_mm, shape.height_mm])
        case Box():
            return shapes.BOX, np.array(shape.size_mm, dtype=np.float64) / 2
        case Board():
            return shapes.SHEET, np.array([*sheet_sizes(shape), *shape.bow_mm])
        case Blend():
            return shapes.BLEND, _blend_sizes(shape)
    raise TypeError(f"shape must be an analytic one, got {type(shape).__name__}")


def _ball(shape: Shape) -> tuple[Array, float]:
    """Middle, in the object's frame, and radius of a ball about the shape."""
    match shape:
        case Cone():
            half = shape.height_mm / 2
            return np.array([0.0, 0.0, half]), math.hypot(shape.radius_mm, half)
        case Cylinder():
            return np.zeros(3), math.hypot(shape.radius_mm, shape.length_mm / 2)
        case Board():
            x, y, half_x, half_y = sheet_sizes(shape)
            depth = abs(shape.bow_mm[0]) + abs(shape.bow_mm[1])
            return np.array([x, y, 0.0]), math.hypot(half_x, half_y, depth)
        case Blend():
            return _blend_ball(shape)
        case Plane():
            return np.zeros(3), math.hypot(shape.width_mm, shape.height_mm) / 2
        case Sphere():
            return np.zeros(3), shape.radius_mm
        case Box():
            return np.zeros(3), math.hypot(*shape.size_mm) / 2
    raise TypeError(f"shape must be an analytic one, got {type(shape).__name__}")


def _blend_sizes(blend: Blend) -> Array:
    capsules = [_capsule_sizes(capsule) for capsule in blend.capsules]
    return np.concatenate([[blend.smooth_mm, len(capsules)], *capsules])


def _capsule_sizes(capsule: Capsule) -> Array:
    start, end = np.array(capsule.start_mm, float), np.array(capsule.end_mm, float)
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length if length > 0 else np.array([0.0, 0.0, 1.0])
    radii = (capsule.start_radius_mm, capsule.end_radius_mm)
    sizes = [*start, *axis, length, *radii, *(start + end) / 2, length / 2 + max(radii)]
    return np.array(sizes)


def _blend_ball(blend: Blend) -> tuple[Array, float]:
    """About all ends, and `smooth_mm` more: melting moves the surface outwards by no more."""
    ends = [(c.start_mm, c.start_radius_mm) for c in blend.capsules]
    ends += [(c.end_mm, c.end_radius_mm) for c in blend.capsules]
    places, radii = np.array([p for p, _ in ends], float), np.array([r for _, r in ends])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    reach = float(np.max(np.linalg.norm(places - middle, axis=1) + radii))
    return middle, reach + blend.smooth_mm
