"""Clouds in named frames, and frames from datum features (3-2-1) or from a board's corners.

Three points or more give a plane, two or more a line in it, one the origin on the line: ISO 5459's
primary, secondary and tertiary datum, for features that are points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.geometry.align import align_points
from fringeworks.geometry.forms import fit_plane
from fringeworks.geometry.pose import compose_poses
from fringeworks.measure.board import point_at
from fringeworks.measure.region import Region, select_points
from fringeworks.model import Cloud, Pose
from fringeworks.model.frame import CAMERA_FRAME, Frame

Array = NDArray[np.float64]
Pixel: TypeAlias = tuple[float, float]

PICK_RADIUS_PX = 5.0
"""Half the window about a pixel that somebody chose."""

SHORTEST_LINE = 1e-3
"""Of the distance from the line's points to the plane's middle."""


def move_cloud(cloud: Cloud, frame: Frame) -> Cloud:
    """The cloud in another frame of the same camera; its sigmas stay along the camera's z.

    Raises
    ------
    UsageError
        The cloud is in a frame whose place before the camera nobody knows.
    """
    if cloud.frame != CAMERA_FRAME and cloud.frame_from_camera is None:
        raise UsageError(
            f"the cloud is in frame '{cloud.frame}', and where the camera stood in it is not in "
            "the file: start from the .npz of the scan"
        )
    pose = frame.frame_from_camera
    points = pose.apply(cloud.seen_from_camera()).astype(np.float32)
    return replace(cloud, xyz=points, frame=frame.name, frame_from_camera=pose)


def shift_cloud(cloud: Cloud, pose: Pose, frame: str) -> Cloud:
    """The cloud moved by ``frame_from_cloud``, whatever frame it is in."""
    before = cloud.frame_from_camera or Pose.identity()
    outer, inner = ((one.rotation, one.translation_mm) for one in (pose, before))
    known = cloud.frame == CAMERA_FRAME or cloud.frame_from_camera is not None
    return replace(
        cloud,
        xyz=pose.apply(cloud.xyz.astype(np.float64)).astype(np.float32),
        frame=frame,
        frame_from_camera=Pose(*compose_poses(outer, inner)) if known else None,
    )


def to_camera(cloud: Cloud) -> Cloud:
    """The cloud in its camera's frame; fails as `move_cloud`."""
    moved = move_cloud(cloud, Frame(CAMERA_FRAME, Pose.identity()))
    return replace(moved, frame_from_camera=None)


def find_station(
    cloud: Cloud,
    region: Region,
    *,
    line_px: Sequence[Pixel],
    origin_px: Pixel,
    name: str = "station",
) -> Frame:
    """A frame by 3-2-1 from a region of a cloud and from camera pixels; see `find_datum`.

    The points at the pixels are those of the surface about them, `PICK_RADIUS_PX` each way.

    Raises
    ------
    MeasurementError
        The cloud has no surface at a pixel; or as `find_datum` and `select_points`.
    UsageError
        As `move_cloud`.
    """
    seen = to_camera(cloud)
    plane = select_points(cloud, region)
    if cloud.frame_from_camera is not None:
        plane = cloud.frame_from_camera.inverse().apply(plane)
    picked = [_pick(seen, pixel) for pixel in (*line_px, origin_px)]
    return find_datum(plane, np.array(picked[:-1]), picked[-1], name=name)


def _pick(cloud: Cloud, pixel: Pixel) -> Array:
    point = point_at(cloud, np.array(pixel), radius=PICK_RADIUS_PX)
    if not np.isfinite(point).all():
        raise MeasurementError(f"the cloud has no surface about pixel {pixel[0]:g},{pixel[1]:g}")
    return point


def find_datum(plane: Array, line: Array, origin: Array, *, name: str = "station") -> Frame:
    """A frame by 3-2-1, from points in the camera's frame.

    z is the normal of the plane through `plane`, towards the camera. x runs along the line
    through `line`, seen square to the plane, from its first to its last point. The origin is on
    that line in the plane, beside `origin`. y = z cross x.

    Parameters
    ----------
    plane, line
        ``(n, 3)`` mm, n >= 3, and ``(m, 3)``, m >= 2.
    origin
        ``(3,)`` mm.

    Raises
    ------
    ShapeError, MeasurementError
        Too few points, some not finite, the plane's on one line, or the line's on one spot of the
        plane.
    """
    if line.ndim != 2 or line.shape[1] != 3 or len(line) < 2 or origin.shape != (3,):
        raise ShapeError(
            f"line must be (m, 3) with m >= 2 and origin (3,), got {line.shape} and {origin.shape}"
        )
    if not (np.isfinite(line).all() and np.isfinite(origin).all()):
        raise MeasurementError("the datum's line and origin have no finite point: choose others")
    fit = fit_plane(plane)
    z, middle = fit.normal, plane.mean(axis=0)
    flat = line - np.outer((line - middle) @ z, z)
    x = _direction(flat, reach=float(np.abs(flat - middle).max()))
    start = flat.mean(axis=0)
    corner = start + x * ((origin - start) @ x)
    rotation = np.stack([x, np.cross(z, x), z])
    return Frame(name, Pose(rotation, -rotation @ corner))


def _direction(points: Array, *, reach: float) -> Array:
    """Unit direction of the least-squares line, from the first point to the last."""
    centred = points - points.mean(axis=0)
    _, size, right = np.linalg.svd(centred, full_matrices=False)
    if not size[0] > SHORTEST_LINE * reach:
        raise MeasurementError("the datum's line has no length in the plane: choose points apart")
    along = right[0]
    return np.asarray(along if along @ (points[-1] - points[0]) >= 0 else -along)


def fit_frame(measured: Array, nominal: Array, *, name: str) -> tuple[Frame, Array]:
    """The frame in which measured points (camera's frame) come closest to their nominal places.

    Returns
    -------
    frame, left_mm
        And the vectors ``(n, 3)`` from nominal to measured in it, mm.

    Raises
    ------
    MeasurementError, ShapeError
        As `align_points`.
    """
    pose = Pose(*align_points(measured, nominal))
    return Frame(name, pose), np.asarray(pose.apply(measured) - nominal)
