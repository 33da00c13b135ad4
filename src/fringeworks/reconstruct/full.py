"""The full model: both lenses' distortion, one coded axis or both.

With both axes each pixel has one coordinate more than its depth needs: what remains across the
epipolar line is a free check of rig and decoding, and a pixel that misses it by far is void.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError, ShapeError, UsageError
from fringeworks.kernels.triangulate import triangulate as triangulate_kernel
from fringeworks.model import (
    Axis,
    Cloud,
    CodedAxis,
    Finding,
    FloatMap,
    Frames,
    ProjectorMap,
    Rig,
    Void,
)

EPIPOLAR_SIGMAS = 8.0
EPIPOLAR_FLOOR_PX = 2.0

HOPELESS_SHARE = 0.5
SUSPICIOUS_SHARE = 0.1
"""More decoded pixels than this off their epipolar lines are no matter of wild codes."""

NOTABLE_MISFITS = 0.1
"""Share of void pixels among those with fringes from which the scan says so."""


@dataclass(frozen=True, slots=True)
class CloudRules:
    """What makes a point void beyond what made its coordinate void.

    Attributes
    ----------
    axis
        Use this axis alone; None uses all that are coded.
    z_range_mm
        Depths kept; None takes the rig's calibrated volume widened by a tenth at both ends.
    epipolar_px
        Largest distance from the epipolar line, projector px, where both axes are used; None
        takes the larger of 2 px and 8 sigma.
    """

    axis: Axis | None = None
    z_range_mm: tuple[float, float] | None = None
    epipolar_px: float | None = None


def triangulate(
    projector_map: ProjectorMap,
    rig: Rig,
    *,
    intensity: FloatMap | None = None,
    colour: Frames | None = None,
    rules: CloudRules | None = None,
) -> Cloud:
    """Cloud in the camera's frame from projector coordinates.

    Parameters
    ----------
    projector_map
        Column and / or row of each camera pixel.
    rig
        Calibration; its camera's size must be the map's.
    intensity, colour
        What the points look like; `intensity` defaults to the offset of the first coded axis.

    Raises
    ------
    ShapeError
        The map's size is not the rig's camera's.
    UsageError
        The rules ask for an axis that is not coded, or for an empty depth range.
    DecodeError
        No point is left, or most of them miss their epipolar line.
    """
    rules = rules or CloudRules()
    expected = (rig.camera.height, rig.camera.width)
    if projector_map.shape != expected:
        raise ShapeError(
            f"the capture must be {expected[1]}x{expected[0]} like the rig's camera, "
            f"got {projector_map.shape[1]}x{projector_map.shape[0]}"
        )
    window = _depth_window(rig, rules)
    column, row = _chosen_axes(projector_map, rules.axis)
    axes = [_measured(axis, expected) for axis in (column, row)]
    xyz = np.empty((*expected, 3), np.float32)
    sigma, epipolar = np.empty(expected, np.float32), np.empty(expected, np.float32)
    pose = rig.projector_from_camera
    triangulate_kernel(
        np.stack([coordinate for coordinate, _ in axes]),
        np.stack([spread for _, spread in axes]),
        rig.camera.lens.vector,
        rig.projector.lens.vector,
        np.ascontiguousarray(pose.rotation),
        np.ascontiguousarray(pose.translation_mm),
        window,
        xyz,
        sigma,
        epipolar,
    )
    found = _notice_misfits(projector_map)
    if column is not None and row is not None:
        off = np.abs(epipolar) > _epipolar_limit(column, row, rules)
        found += _notice_epipolar(off, np.isfinite(sigma))
        xyz[off], sigma[off], epipolar[off] = np.nan, np.nan, np.nan
    if not np.isfinite(sigma).any():
        raise DecodeError(_no_point_message(projector_map, window))
    shade = projector_map.axes[0].offset if intensity is None else intensity
    return Cloud(xyz, sigma, shade, epipolar, colour, scale_sigma=rig.scale_sigma, findings=found)


def _notice_misfits(projector_map: ProjectorMap) -> tuple[Finding, ...]:
    """Frames that fit no sinusoid void pixels one by one; where they are many, that is told."""
    for axis in projector_map.axes:
        misfits = int(np.count_nonzero(axis.void == Void.RESIDUAL))
        share = misfits / max(misfits + int(np.count_nonzero(np.isfinite(axis.coordinate))), 1)
        if share > NOTABLE_MISFITS:
            message = (
                f"{share:.0%} of the pixels with fringes along {axis.axis} are void because their "
                "frames do not fit a sinusoid:"
            )
            remedy = (
                "the projector's gamma, frames out of order or out of step, or motion. Use the "
                "projector's linear mode; three steps show no misfit, and bend the surface instead."
            )
            return (Finding("warning", message, remedy),)
    return ()


def _depth_window(rig: Rig, rules: CloudRules) -> tuple[float, float]:
    window = rules.z_range_mm or rig.z_window() or (0.0, math.inf)
    if not window[0] < window[1]:
        raise UsageError(f"z-range must rise, MIN:MAX in mm, got {window[0]:g}:{window[1]:g}")
    return max(window[0], 0.0), window[1]


def _chosen_axes(
    projector_map: ProjectorMap, axis: Axis | None
) -> tuple[CodedAxis | None, CodedAxis | None]:
    column = projector_map.column if axis in (None, "x") else None
    row = projector_map.row if axis in (None, "y") else None
    if column is None and row is None:
        coded = ", ".join(item.axis for item in projector_map.axes)
        raise UsageError(f"axis must be one that the capture codes ({coded}), got {axis}")
    return column, row


def _measured(axis: CodedAxis | None, shape: tuple[int, int]) -> tuple[FloatMap, FloatMap]:
    """Coordinate and sigma; infinite sigma says that the axis was not measured at all."""
    if axis is None:
        return np.zeros(shape, np.float32), np.full(shape, np.inf, np.float32)
    return axis.coordinate, axis.sigma


def _epipolar_limit(column: CodedAxis, row: CodedAxis, rules: CloudRules) -> float | FloatMap:
    """Largest distance from the epipolar line, projector px, that is not void."""
    if rules.epipolar_px is not None:
        return rules.epipolar_px
    noise = EPIPOLAR_SIGMAS * np.hypot(column.sigma, row.sigma)
    return np.asarray(np.maximum(noise, np.float32(EPIPOLAR_FLOOR_PX)))


def _notice_epipolar(off: NDArray[np.bool_], in_window: NDArray[np.bool_]) -> tuple[Finding, ...]:
    """A warning where many decoded pixels miss their line, an error where most of them do."""
    share = float(off.sum()) / max(float(in_window.sum()), 1.0)
    if share > HOPELESS_SHARE:
        raise DecodeError(
            f"{share:.0%} of the points in the depth range miss their epipolar line: this rig did "
            "not take the capture, or its camera or projector has moved, or the images or axes in "
            "capture.toml are swapped or mirrored (--axis x or y scans without this check)"
        )
    if share < SUSPICIOUS_SHARE:
        return ()
    return (
        Finding(
            "warning",
            f"{share:.0%} of the points in the depth range miss their epipolar line and are void.",
            "Is this the rig that took the capture, and has nothing moved since?",
        ),
    )


def _no_point_message(projector_map: ProjectorMap, window: tuple[float, float]) -> str:
    shares = ", ".join(f"{axis.axis}: {axis.valid_share:.1%}" for axis in projector_map.axes)
    return (
        f"no pixel gives a point between z = {window[0]:g} and {window[1]:g} mm "
        f"(valid coordinates {shares}). Is this the rig that took the capture? "
        "A wider --z-range MIN:MAX shows where the points lie"
    )
