"""What the calibration's covariance makes of measured points and of pixels.

A point is measured from a camera pixel and the projector's coordinates there, which are taken as
exact: what they scatter by is the random part of its uncertainty, which the cloud tells. Here is
the systematic part, common to all scans with a rig: its parameters are known only so well.

Both come out in two ways. As they stand they hold in the camera's frame, which is itself known
only as well as the lens: a shift of the principal point turns the whole cloud. Such a rigid motion
of everything at once is no error of what is measured in the cloud; aligned, the one that fits best
over the whole field is taken out.

First order, as Hartley and Zisserman have it (Multiple View Geometry, 2nd edition, section 5.2):
the covariance of f(theta) is ``J C J^T``. It says what the observations' scatter leaves open, not
what is wrong with the model: `halves` looks for that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.covariance import Covariance
from fringeworks.calibrate.adjust.state import (
    CAMERA,
    POSE,
    PROJECTOR,
    RELATION,
    SHARED,
    RigState,
    parameter_names,
)
from fringeworks.errors import UsageError
from fringeworks.geometry.lens import (
    pixel_rays,
    project,
    project_jacobian,
    unproject,
    unproject_jacobian,
)
from fringeworks.geometry.pose import move_jacobian, rotation_matrix, rotation_vector, skew
from fringeworks.kernels.triangulate import solve_depth
from fringeworks.model import Rig

Array = NDArray[np.float64]

DEPTHS, ROWS, COLUMNS = 3, 16, 24
MIDDLE = 1
"""Index of the middle one of the depths."""


class SeenPoints(Protocol):
    """Points ``(n, 3)``, mm, in the camera's frame, and the camera's pixels ``(n, 2)`` of them."""

    @property
    def points(self) -> Array: ...

    @property
    def camera_px(self) -> Array: ...


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """The points at which a rig is judged: a coarse grid over the camera's image at three depths.

    Attributes
    ----------
    depths_mm
        ``(3,)`` near end, middle and far end of the calibrated volume.
    valid
        ``(3, rows, columns)`` whether the projector lights the point; the maps are NaN elsewhere.
    points
        ``(n, 3)`` mm, the valid points in the camera's frame, in the order of `valid`.
    camera_px, projector_px
        ``(n, 2)`` where both devices see them.
    """

    depths_mm: Array
    valid: NDArray[np.bool_]
    points: Array
    camera_px: Array
    projector_px: Array

    def maps(self, values: Array) -> Array:
        """``(3, rows, columns)`` of ``(n,)`` values, NaN where no point is."""
        out = np.full(self.valid.shape, np.nan)
        out[self.valid] = values
        return out


@dataclass(frozen=True, slots=True, eq=False)
class PointSigma:
    """Standard deviations of measured points, mm, ``(3, rows, columns)``; NaN outside the field.

    `lateral_mm` is that of x and y together, the root of the sum of both variances.
    """

    depth_mm: Array
    lateral_mm: Array


@dataclass(frozen=True, slots=True, eq=False)
class PixelSigma:
    """Standard deviations of the pixels of known points, px, ``(3, rows, columns)``.

    Of x and y together, the root of the sum of both variances; NaN outside the field.
    """

    camera_px: Array
    projector_px: Array


def state_of(rig: Rig) -> RigState:
    """The rig's parameters, without any pose of a board."""
    pose = rig.projector_from_camera
    relation = np.concatenate([rotation_vector(pose.rotation), pose.translation_mm])
    lenses = rig.camera.lens.vector, rig.projector.lens.vector
    return RigState(*lenses, relation, np.zeros((0, POSE)))


def lay_field(rig: Rig) -> Field:
    """The field of a rig.

    Raises
    ------
    UsageError
        The rig has no depth range, or the projector lights nothing that the camera sees in it.
    """
    if rig.volume_mm is None:
        raise UsageError("the rig must have a depth range (volume_mm), got none")
    near, far = rig.volume_mm
    depths = np.array([near, (near + far) / 2, far])
    x = (np.arange(COLUMNS) + 0.5) * rig.camera.width / COLUMNS - 0.5
    y = (np.arange(ROWS) + 0.5) * rig.camera.height / ROWS - 0.5
    pixels = np.stack(np.meshgrid(x, y), axis=-1)
    ideal = unproject(pixels, rig.camera.lens.vector)
    rays = np.concatenate([ideal, np.ones((ROWS, COLUMNS, 1))], axis=-1)
    points = depths[:, None, None, None] * rays
    lit = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)
    size = np.array([rig.projector.width, rig.projector.height])
    valid = np.asarray(((lit >= -0.5) & (lit <= size - 0.5)).all(axis=-1))
    if not valid.any():
        raise UsageError("the rig's projector must light what its camera sees, got no such point")
    return Field(
        depths_mm=depths,
        valid=valid,
        points=points[valid],
        camera_px=np.broadcast_to(pixels, (*valid.shape, 2))[valid],
        projector_px=lit[valid],
    )


def triangulate_points(
    state: RigState,
    camera_px: Array,
    projector_px: Array,
    *,
    weights: tuple[float, float] = (1.0, 1.0),
) -> Array:
    """``(n, 3)`` mm, camera frame, of pixels ``(n, 2)`` that both devices see.

    As `reconstruct` does with these weights of column and row; NaN where that finds no depth.
    """
    rays = pixel_rays(camera_px, state.camera)
    turned = rays @ rotation_matrix(state.projector_from_camera[:3]).T
    shift = np.ascontiguousarray(state.projector_from_camera[3:])
    lens = np.ascontiguousarray(state.projector)
    depths = [
        solve_depth(tuple(ray), shift, tuple(seen), weights, lens)[0]
        for ray, seen in zip(turned.tolist(), projector_px.tolist(), strict=True)
    ]
    return np.asarray(rays * np.array(depths)[:, None])


def points_by_parameters(
    state: RigState, field: SeenPoints, *, weights: tuple[float, float] = (1.0, 1.0)
) -> Array:
    """``(n, 3, SHARED)`` derivative of the field's points by what all views share, pixels fixed.

    With p(theta, z) the projector's pixel along the ray and p' its derivative by the depth z, each
    axis times the root of its weight, ``dz = -(p' . dp) / (p' . p')``, exact where p meets the
    measured pixel. The point is z d(theta), d the ray. `weights` are of column and row: 1 / sigma^2
    up to a factor, zero for an axis that was not used.
    """
    ideal, ideal_by_lens = unproject_jacobian(field.camera_px, state.camera)
    rays, depth = np.column_stack([ideal, np.ones(len(ideal))]), field.points[:, 2]
    by_place, pixels = _projector_by_parameters(state, field.points)
    root = np.sqrt(np.array(weights))[:, None]
    by_place, pixels = by_place * root, pixels * root
    slide = depth[:, None, None] * ideal_by_lens
    pixels[..., CAMERA] = by_place[..., :2] @ slide
    along = np.einsum("nij,nj->ni", by_place, rays)
    depth_by = -np.einsum("ni,nik->nk", along, pixels) / np.sum(along**2, axis=1)[:, None]
    out = rays[:, :, None] * depth_by[:, None, :]
    out[:, :2, CAMERA] += slide
    return np.asarray(out)


def _projector_by_parameters(state: RigState, points: Array) -> tuple[Array, Array]:
    """Derivatives of the projector's pixel by a point, ``(n, 2, 3)``, and ``(n, 2, SHARED)``."""
    in_projector, by_relation = move_jacobian(state.projector_from_camera, points)
    _, by_point, by_lens = project_jacobian(in_projector, state.projector)
    by_shared = np.zeros((len(points), 2, SHARED))
    by_shared[..., PROJECTOR] = by_lens
    by_shared[..., RELATION] = by_point @ by_relation
    return by_point @ rotation_matrix(state.projector_from_camera[:3]), by_shared


def shared_covariance(covariance: Covariance) -> Array:
    """``(SHARED, SHARED)``, the poses' part left out; zero where a parameter was held."""
    place = {name: index for index, name in enumerate(parameter_names(()))}
    chosen = [index for index, name in enumerate(covariance.names) if name in place]
    columns = [place[covariance.names[index]] for index in chosen]
    out = np.zeros((SHARED, SHARED))
    out[np.ix_(columns, columns)] = covariance.matrix[np.ix_(chosen, chosen)]
    return out


def rigid_motions(points: Array) -> Array:
    """``(n, 3, 6)`` derivative of points by a small turn, rad, and shift, mm, of all of them."""
    shifts = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return np.concatenate([-skew(points), shifts], axis=2)


def without_motion(by: Array, motion: Array) -> Array:
    """What the six-fold `motion` ``(n, m, 6)`` that fits best leaves of ``(n, m, k)``."""
    flat = motion.reshape(-1, motion.shape[-1])
    fitted, *_ = np.linalg.lstsq(flat, by.reshape(-1, by.shape[-1]), rcond=None)
    return np.asarray(by - motion @ fitted)


def variances(by: Array, shared: Array) -> Array:
    """``(n, m)`` variances of what has derivatives ``(n, m, k)``."""
    return np.asarray(np.maximum(np.einsum("nmk,nmk->nm", by @ shared, by), 0.0))


def point_sigma(
    rig: Rig, covariance: Covariance, field: Field, *, aligned: bool = True
) -> PointSigma:
    """How well the rig's parameters let points be known; see the module for `aligned`."""
    by = points_by_parameters(state_of(rig), field)
    if aligned:
        by = without_motion(by, rigid_motions(field.points))
    variance = variances(by, shared_covariance(covariance))
    return PointSigma(
        depth_mm=field.maps(np.sqrt(variance[:, 2])),
        lateral_mm=field.maps(np.sqrt(variance[:, 0] + variance[:, 1])),
    )


def pixel_sigma(
    rig: Rig, covariance: Covariance, field: Field, *, aligned: bool = True
) -> PixelSigma:
    """How well it is known at which pixels each device sees points known in the camera's frame.

    Aligned, each device may first be moved as fits its own pixels best, so that its lens alone is
    judged.
    """
    state, shared = state_of(rig), shared_covariance(covariance)
    motion = rigid_motions(field.points)
    _, camera_by_point, by_lens = project_jacobian(field.points, state.camera)
    camera_by = np.zeros((len(by_lens), 2, SHARED))
    camera_by[..., CAMERA] = by_lens
    projector_by_point, projector_by = _projector_by_parameters(state, field.points)
    maps = []
    for by, by_point in ((camera_by, camera_by_point), (projector_by, projector_by_point)):
        moved = without_motion(by, by_point @ motion) if aligned else by
        maps.append(field.maps(np.sqrt(variances(moved, shared).sum(axis=1))))
    return PixelSigma(*maps)
