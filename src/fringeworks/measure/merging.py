"""Several clouds of one thing as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.geometry.align import align_points
from fringeworks.geometry.pose import compose_poses
from fringeworks.measure.reference import cloud_reference
from fringeworks.measure.registration import ScanView, align_coarsely, thin_points
from fringeworks.model import Cloud, Pose

Array = NDArray[np.float64]

TARGET_ROUNDS = 100
STILL_MM = 1e-9


def merge_clouds(clouds: Sequence[Cloud], poses: Sequence[Pose], *, frame: str) -> Cloud:
    """All points of several clouds ``(1, n)`` in one frame; ``poses`` are ``common_from_cloud``.

    Sigma stays that along the z of the camera that saw the point. Colour stays where all clouds
    have it at one depth; the scale's sigma is the largest, for they share the rig.
    """
    points = [pose.apply(cloud.points()) for cloud, pose in zip(clouds, poses, strict=True)]
    coloured = [cloud.colour for cloud in clouds if cloud.colour is not None]
    same = len(coloured) == len(clouds) and len({colour.dtype for colour in coloured}) == 1
    scales = [cloud.scale_sigma for cloud in clouds if cloud.scale_sigma is not None]
    valid = [cloud.valid for cloud in clouds]

    def joined(name: str) -> NDArray[Any]:
        parts = [getattr(cloud, name)[use] for cloud, use in zip(clouds, valid, strict=True)]
        return np.asarray(np.concatenate(parts)[None])

    return Cloud(
        xyz=np.concatenate(points).astype(np.float32)[None],
        sigma_mm=joined("sigma_mm"),
        intensity=joined("intensity"),
        epipolar_px=joined("epipolar_px"),
        colour=joined("colour") if same else None,
        frame=frame,
        scale_sigma=max(scales, default=None),
    )


def scan_views(clouds: Sequence[Cloud]) -> list[ScanView]:
    """The views of clouds on their cameras' grids, for `register_views`; fails without a grid."""
    return [_scan_view(number, cloud) for number, cloud in enumerate(clouds, start=1)]


def _scan_view(number: int, cloud: Cloud) -> ScanView:
    try:
        return ScanView(cloud_reference(cloud), thin_points(cloud.points()))
    except MeasurementError as error:
        raise MeasurementError(f"view {number}: {error}") from None


def chain_coarsely(clouds: Sequence[Cloud]) -> list[Pose]:
    """First poses ``common_from_cloud`` where each cloud overlaps the one before it.

    Raises
    ------
    MissingExtraError, MeasurementError
        As `align_coarsely`.
    """
    poses = [Pose.identity()]
    for before, cloud in pairwise(clouds):
        placed = poses[-1].apply(before.points())
        start = poses[-1]
        step = align_coarsely(start.apply(cloud.points()), placed)
        outer, inner = ((pose.rotation, pose.translation_mm) for pose in (step, start))
        poses.append(Pose(*compose_poses(outer, inner)))
    return poses


def register_targets(views: Sequence[Mapping[str, Array]]) -> tuple[list[Pose], Array]:
    """Poses of views by points that several of them see under one name, the first view fixed.

    Generalised Procrustes: views are aligned to the mean places of the targets, and these are
    found again, until nothing moves.

    Parameters
    ----------
    views
        Of each view the targets, ``(3,)`` mm in its frame, by name.

    Returns
    -------
    poses, left_mm
        ``common_from_view``, and ``(n,)`` the distance of each target of each view from its mean
        place, for those that two views have.

    Raises
    ------
    MeasurementError
        A view shares fewer than three targets with those before it; or as `align_points`.
    ShapeError
        A target is not ``(3,)``.
    """
    _check_targets(views)
    poses, places = [Pose.identity()], dict(views[0])
    for number, view in enumerate(views[1:], start=1):
        shared = [name for name in view if name in places]
        if len(shared) < 3:
            raise MeasurementError(
                f"view {number + 1} shares {len(shared)} targets with those before it; it takes "
                "three: give the views in an order in which each sees some of the last"
            )
        poses.append(_aligned(view, places, shared))
        places |= {name: poses[-1].apply(view[name]) for name in view if name not in places}
    for _ in range(TARGET_ROUNDS):
        places, before = _mean_places(views, poses), places
        poses[1:] = [_aligned(view, places, list(view)) for view in views[1:]]
        if max(float(np.abs(places[name] - before[name]).max()) for name in places) < STILL_MM:
            break
    return poses, _distances(views, poses)


def _check_targets(views: Sequence[Mapping[str, Array]]) -> None:
    for view in views:
        for name, place in view.items():
            if place.shape != (3,):
                raise ShapeError(f"target {name} must be (3,), got {place.shape}")


def _aligned(view: Mapping[str, Array], places: Mapping[str, Array], names: list[str]) -> Pose:
    source = np.array([view[name] for name in names])
    return Pose(*align_points(source, np.array([places[name] for name in names])))


def _mean_places(views: Sequence[Mapping[str, Array]], poses: Sequence[Pose]) -> dict[str, Array]:
    seen: dict[str, list[Array]] = {}
    for view, pose in zip(views, poses, strict=True):
        for name, place in view.items():
            seen.setdefault(name, []).append(pose.apply(place))
    return {name: np.mean(placed, axis=0) for name, placed in seen.items()}


def _distances(views: Sequence[Mapping[str, Array]], poses: Sequence[Pose]) -> Array:
    places = _mean_places(views, poses)
    counts = {name: sum(name in view for view in views) for name in places}
    return np.array(
        [
            float(np.linalg.norm(pose.apply(place) - places[name]))
            for view, pose in zip(views, poses, strict=True)
            for name, place in view.items()
            if counts[name] > 1
        ]
    )
