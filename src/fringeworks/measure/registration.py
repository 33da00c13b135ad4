"""Bring a cloud to a surface, or the views of one thing together.

A first, coarse pose by point-to-plane ICP of small_gicp (the extra `register`), over reaches that
shrink. Then least squares of the exact distances to the triangles, along evened-out normals, with
Tukey's weights (Chen and Medioni 1992; weights from the median distance): for several views of all
overlapping pairs at once, so that no chain of views adds up its errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, MissingExtraError, UsageError
from fringeworks.geometry.pose import compose_poses, rotation_matrix
from fringeworks.measure.reference import Reference, find_counterparts
from fringeworks.model import Pose

Array = NDArray[np.float64]

MOST_POINTS = 4_000
"""Of a view: far more than a pose needs, few enough for a moment."""

ROUNDS = 60
STILL_MM = 1e-5
"""A step that moves no point by more than this ends the rounds."""

TUKEY = 4.685
MAD_TO_SIGMA = 1.4826
LEAST_MATCHES = 100
LOOSE = 1e-4
"""Of the largest eigenvalue of the normal equations (turns times the size of the thing): motions
below it are not held by the surface and are left as they are."""

FURTHEST = 1000.0
"""Of the target's size: a cloud beyond that is nowhere near it."""

COARSE_SHARES = (0.2, 0.07, 0.02)
"""Reaches of the coarse search, of the target's size."""


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """Poses of views in a common frame.

    Attributes
    ----------
    poses
        ``common_from_view``, one per view, the first fixed.
    rms_mm
        Weighted root mean square of the distances that are left.
    matches
        Points with a counterpart within reach.
    loose
        Motions, of 6 per free view, that the surfaces do not hold.
    """

    poses: tuple[Pose, ...]
    rms_mm: float
    matches: int
    loose: int


@dataclass(frozen=True, slots=True, eq=False)
class ScanView:
    """A view to register: its surface, and points of it that are held against the others'."""

    surface: Reference
    points: Array


def thin_points(points: Array, *, most: int = MOST_POINTS) -> Array:
    """At most so many of points ``(n, 3)``, evenly along their order."""
    if len(points) <= most:
        return points
    return points[np.linspace(0, len(points) - 1, most).astype(np.int64)]


def align_coarsely(points: Array, target: Array) -> Pose:
    """``target_from_points`` of two sets of points ``(n, 3)``, mm, by ICP; starts as they lie.

    Raises
    ------
    MissingExtraError
        small_gicp is not installed.
    MeasurementError
        Fewer than `LEAST_MATCHES` points, or no reach finds those of the one beside the other.
    """
    library = _library()
    if min(len(points), len(target)) < LEAST_MATCHES:
        raise MeasurementError(
            f"aligning takes {LEAST_MATCHES} points or more of both, got {len(points)} and "
            f"{len(target)}"
        )
    middle = target.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(target, axis=0)))
    matrix = np.eye(4)
    matched = 0
    # About the middle, and not from afar: the library counts its voxels from the origin.
    near = float(np.abs(points - middle).max()) < FURTHEST * size
    for share in COARSE_SHARES if near else ():
        result = library.align(
            target - middle,
            points - middle,
            init_T_target_source=matrix,
            registration_type="PLANE_ICP",
            downsampling_resolution=size / 200,
            max_correspondence_distance=share * size,
            max_iterations=60,
        )
        matched = int(result.num_inliers)
        matrix = np.asarray(result.T_target_source)
    if matched < LEAST_MATCHES or not np.isfinite(matrix).all():
        raise MeasurementError(
            "the cloud does not come near the reference: bring them together roughly first, by "
            "convert --frame"
        )
    turn = matrix[:3, :3]
    return Pose(turn, matrix[:3, 3] + middle - turn @ middle)


def register_cloud(
    points: Array, reference: Reference, *, start: Pose | None = None, within_mm: float = 5.0
) -> Registration:
    """Pose that brings points ``(n, 3)`` to a surface; the surface stays.

    Raises
    ------
    UsageError
        `within_mm` is not positive.
    MeasurementError
        Fewer than `LEAST_MATCHES` points have a counterpart.
    """
    views = (ScanView(reference, np.empty((0, 3))), ScanView(reference, thin_points(points)))
    starts = (Pose.identity(), start or Pose.identity())
    return _register(views, starts, [(1, 0)], within_mm)


def register_views(
    views: Sequence[ScanView], starts: Sequence[Pose], *, within_mm: float = 5.0
) -> Registration:
    """Poses of several views of one thing, the first as it starts.

    Parameters
    ----------
    views
        Each in its own frame.
    starts
        ``common_from_view``, near enough that `within_mm` bridges what is wrong.

    Raises
    ------
    UsageError
        `within_mm` is not positive.
    MeasurementError
        Fewer than `LEAST_MATCHES` points have a counterpart.
    """
    count = len(views)
    pairs = [(i, j) for i in range(count) for j in range(count) if i != j]
    return _register(views, starts, pairs, within_mm)


def _register(
    views: Sequence[ScanView],
    starts: Sequence[Pose],
    pairs: list[tuple[int, int]],
    within_mm: float,
) -> Registration:
    if not within_mm > 0:
        raise UsageError(f"within_mm must be positive, got {within_mm:g}")
    poses = list(starts)
    reach = within_mm
    for _ in range(ROUNDS):
        rows = [_match(views, poses, pair, reach) for pair in pairs]
        system = _System(len(views), _middle(views, poses))
        left = np.concatenate([part[0] for part in rows])
        if len(left) < LEAST_MATCHES:
            raise MeasurementError(
                f"only {len(left)} points have a counterpart within {reach:g} mm: the views do "
                "not overlap, or start too far from each other"
            )
        spread = MAD_TO_SIGMA * float(np.median(np.abs(left))) + STILL_MM
        for pair, part in zip(pairs, rows, strict=True):
            system.add(pair, part, spread)
        steps, loose = system.solve()
        poses = [_moved(pose, step, system.middle) for pose, step in zip(poses, steps, strict=True)]
        reach = max(min(reach, 3 * TUKEY * spread), 10 * STILL_MM)
        if float(np.abs(steps[:, 3:]).max() + system.size * np.abs(steps[:, :3]).max()) < STILL_MM:
            break
    return Registration(tuple(poses), system.rms(), len(left), loose)


def _match(
    views: Sequence[ScanView], poses: Sequence[Pose], pair: tuple[int, int], reach: float
) -> tuple[Array, Array, Array]:
    """Distances of the first view's points from the second's surface, in the common frame.

    Distances ``(n,)``, the points and the surface's normals ``(n, 3)``.
    """
    source, target = poses[pair[0]], poses[pair[1]]
    common = source.apply(views[pair[0]].points)
    own = target.inverse().apply(common)
    surface = views[pair[1]].surface
    found = find_counterparts(surface, own, within_mm=reach)
    use = (found.triangles >= 0) & ~found.border
    normals = surface.smooth[found.triangles[use]]
    facing = np.einsum("ni,ni->n", own[use] - found.places[use], normals)
    return facing, common[use], normals @ target.rotation.T


class _System:
    """Normal equations of small motions (turn, shift) of all views but the first."""

    def __init__(self, views: int, middle: tuple[Array, float]) -> None:
        self.middle, self.size = middle
        self._matrix = np.zeros((6 * views, 6 * views))
        self._right = np.zeros(6 * views)
        self._squares = self._weights = 0.0

    def add(self, pair: tuple[int, int], part: tuple[Array, Array, Array], spread: float) -> None:
        left, points, normals = part
        share = left / (TUKEY * spread)
        weights = np.where(np.abs(share) < 1, (1 - share**2) ** 2, 0.0)
        turn = np.cross(points - self.middle, normals) / self.size
        design = np.hstack([turn, normals])
        block = design.T @ (design * weights[:, None])
        right = design.T @ (weights * left)
        here, there = (slice(6 * view, 6 * view + 6) for view in pair)
        self._matrix[here, here] += block
        self._matrix[there, there] += block
        self._matrix[here, there] -= block
        self._matrix[there, here] -= block
        self._right[here] -= right
        self._right[there] += right
        self._squares += float(weights @ left**2)
        self._weights += float(weights.sum())

    def solve(self) -> tuple[Array, int]:
        """Turn, rad, and shift, mm, ``(views, 6)``, and how many motions nothing holds."""
        sizes, axes = np.linalg.eigh(self._matrix[6:, 6:])
        held = sizes > LOOSE * sizes[-1]
        along = axes[:, held]
        free = along @ ((along.T @ self._right[6:]) / sizes[held])
        steps = np.concatenate([np.zeros(6), free]).reshape(-1, 6)
        steps[:, :3] /= self.size
        return steps, int(np.count_nonzero(~held))

    def rms(self) -> float:
        return float(np.sqrt(self._squares / max(self._weights, 1e-300)))


def _middle(views: Sequence[ScanView], poses: Sequence[Pose]) -> tuple[Array, float]:
    """Middle of all points and their root mean square distance from it."""
    every = np.concatenate([p.apply(v.points) for v, p in zip(views, poses, strict=True)])
    middle = every.mean(axis=0)
    return middle, float(np.sqrt(np.mean(np.sum((every - middle) ** 2, axis=1))))


def _moved(pose: Pose, step: Array, middle: Array) -> Pose:
    turn = rotation_matrix(step[:3])
    shift = step[3:] + middle - turn @ middle
    return Pose(*compose_poses((turn, shift), (pose.rotation, pose.translation_mm)))


def _library() -> Any:
    try:
        return import_module("small_gicp")
    except ImportError:
        raise MissingExtraError(
            "registering clouds takes small_gicp: pip install fringeworks[register]"
        ) from None
