"""The full model: both lenses' distortion, one coded axis or both.

With both axes each pixel has one coordinate more than its depth needs: what remains across the
epipolar line is a free check of rig and decoding, and a pixel that misses it by far is void.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError, ShapeError, UsageError
from fringeworks.model import (
    Axis,
    Cloud,
    CodedAxis,
    Finding,
    FloatMap,
    Frames,
    ProjectorMap,
    Reason,
    Rig,
    Void,
)
from fringeworks.reconstruct.masks import EdgeRules, reasons_of
from fringeworks.reconstruct.table import solve_points

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
    edges
        What `masks.mask_edges` takes out afterwards; None leaves mixed pixels in.
    exact
        Solve the full model at every pixel, and do not take its table, which is the same to 1 um.
    """

    axis: Axis | None = None
    z_range_mm: tuple[float, float] | None = None
    epipolar_px: float | None = None
    edges: EdgeRules | None = field(default_factory=EdgeRules)
    exact: bool = False


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
    check_size(projector_map, rig)
    expected = projector_map.shape
    window = depth_window(rig, rules)
    column, row = _chosen_axes(projector_map, rules.axis)
    axes = [_measured(axis, expected) for axis in (column, row)]
    xyz, sigma, epipolar = solve_points(
        np.stack([coordinate for coordinate, _ in axes]),
        np.stack([spread for _, spread in axes]),
        rig,
        window,
        exact=rules.exact,
    )
    found = notice_misfits(projector_map)
    reason = reasons_of([coordinate for coordinate, _ in axes], sigma)
    if column is not None and row is not None:
        off = np.abs(epipolar) > _epipolar_limit(column, row, rules)
        found += _notice_epipolar(off, np.isfinite(sigma))
        xyz[off], sigma[off], epipolar[off] = np.nan, np.nan, np.nan
        reason[off] = Reason.OFF_LINE
    if not np.isfinite(sigma).any():
        raise DecodeError(no_point_message(projector_map, window))
    shade = projector_map.axes[0].offset if intensity is None else intensity
    return Cloud(
        xyz,
        sigma,
        shade,
        epipolar,
        colour,
        scale_sigma=rig.scale_sigma,
        findings=found,
        reason=reason,
    )


def check_size(projector_map: ProjectorMap, rig: Rig) -> None:
    """Raise `ShapeError` where the map is not of the size of the rig's camera."""
    expected = (rig.camera.height, rig.camera.width)
    if projector_map.shape != expected:
        raise ShapeError(
            f"the capture must be {expected[1]}x{expected[0]} like the rig's camera, "
            f"got {projector_map.shape[1]}x{projector_map.shape[0]}"
        )


def notice_misfits(projector_map: ProjectorMap) -> tuple[Finding, ...]:
    """Frames that fit no sinusoid void pixels one by one; where they are many, that is told."""
    for axis in projector_map.axes:
        misfits = int(np.count_nonzero(axis.void == Void.RESIDUAL))
        found = misfit_finding(
            axis.axis, misfits, int(np.count_nonzero(np.isfinite(axis.coordinate)))
        )
        if found:
            return found
    return ()


def misfit_finding(axis: Axis, misfits: int, decoded: int) -> tuple[Finding, ...]:
    """What to say of as many misfits beside as many pixels that were decoded along an axis."""
    share = misfits / max(misfits + decoded, 1)
    if share <= NOTABLE_MISFITS:
        return ()
    message = (
        f"{share:.0%} of the pixels with fringes along {axis} are void because their frames do "
        "not fit a sinusoid:"
    )
    remedy = (
        "the projector's gamma, frames out of order or out of step, or motion. Use the "
        "projector's linear mode; three steps show no misfit, and bend the surface instead."
    )
    return (Finding("warning", message, remedy),)


def depth_window(rig: Rig, rules: CloudRules) -> tuple[float, float]:
    """Depths, mm, that the rules keep, or the rig's volume, or all; UsageError where empty."""
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


def no_point_message(projector_map: ProjectorMap, window: tuple[float, float]) -> str:
    """What to say of a map that gives no point in the window."""
    shares = ", ".join(f"{axis.axis}: {axis.valid_share:.1%}" for axis in projector_map.axes)
    return (
        f"no pixel gives a point between z = {window[0]:g} and {window[1]:g} mm "
        f"(valid coordinates {shares}). Is this the rig that took the capture? "
        "A wider --z-range MIN:MAX shows where the points lie"
    )
