"""Which captures go from frames to cloud in one pass, and how their frames go into the kernel.

They have fringes along one axis, their orders told by a Gray code, by other fringes or by both,
step by step without beats; bits without inverses; one white and one black frame if any; all at one
exposure. All else goes the way of `phase.decode` and `full`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.kernels import fused_nouns as kernels
from fringeworks.model import (
    Axis,
    Capture,
    Frames,
    Fringe,
    GrayCode,
    Reason,
    Rig,
    Sensor,
    Void,
    gray_cells,
)
from fringeworks.phase.chained import SAFE_MARGIN, SAFE_SIGMAS
from fringeworks.phase.decode import OUTSIDE_SIGMAS
from fringeworks.phase.demodulate import MaskRules, estimate_noise, solve_shifts
from fringeworks.phase.gray import DOUBT_SIGMAS
from fringeworks.phase.methods import OrdersName
from fringeworks.phase.temporal import plan_chain
from fringeworks.reconstruct.full import CloudRules, depth_window
from fringeworks.reconstruct.table import table_for

MOST_BITS = 16
"""The kernel's index is of two bytes."""

MISFIT = np.uint8(255)
"""Mark of pixels that were not decoded as their frames fit no sinusoid, until they are counted."""


@dataclass(frozen=True, slots=True, eq=False)
class FusedScan:
    """A capture's frames and a rig's table as the kernel takes them.

    Attributes
    ----------
    axis
        The one along which the fringes stand.
    carriers, chain
        Fringe sets in the capture's order, and the places of those that lead to the finest.
    code, rules
        The Gray code before them, and what makes a pixel void.
    table
        From coordinates to points.
    """

    axis: Axis
    carriers: tuple[kernels.Carrier, ...]
    chain: NDArray[np.int64]
    code: kernels.Code
    rules: kernels.Rules
    table: kernels.Table


@dataclass(frozen=True, slots=True, eq=False)
class _Coded:
    """What a capture holds along its one axis; `bits` has no frame where there is no code."""

    axis: Axis
    fringes: list[tuple[Fringe, Frames, int]]
    gray: GrayCode | None
    bits: Frames
    chain: list[int]


def prepare_scan(
    capture: Capture,
    rig: Rig,
    *,
    orders: OrdersName = "auto",
    mask_rules: MaskRules | None = None,
    cloud_rules: CloudRules | None = None,
) -> FusedScan | None:
    """The capture as the kernel takes it; None where capture, rig or rules need the other way.

    Parameters
    ----------
    capture
        One group of it.

    Raises
    ------
    UsageError
        As `demodulate` for shifts that determine no sinusoid, as `triangulate` for a depth range.
    """
    rules, masks = cloud_rules or CloudRules(), mask_rules or MaskRules()
    coded = _find_coded(capture, orders)
    if coded is None or rules.exact or rules.axis not in (None, coded.axis):
        return None
    if not _is_of(rig, capture) or not _are_alike(capture):
        return None
    table = table_for(rig, coded.axis, depth_window(rig, rules))
    if table is None:
        return None
    extent = capture.sequence.extent(coded.axis)
    return FusedScan(
        coded.axis,
        tuple(_carrier_of(entry, capture.sensor, masks) for entry in coded.fringes),
        np.array(coded.chain, np.int64),
        _code_of(capture, coded, extent),
        _rules_of(capture.sensor, masks, extent),
        kernels.Table(table.nodes, table.step_px, table.depths),
    )


def _is_of(rig: Rig, capture: Capture) -> bool:
    """Whether camera and projector have the rig's sizes."""
    shown, projector, camera = capture.sequence, rig.projector, rig.camera
    sizes = (projector.width, projector.height), (camera.height, camera.width)
    return sizes == ((shown.width, shown.height), capture.shape)


def _are_alike(capture: Capture) -> bool:
    """Whether all frames are of one type, and white and black have one each at most."""
    uniform = (capture.sequence.white_set, capture.sequence.black_set)
    single = all(len(capture.frames[index]) == 1 for index in uniform if index is not None)
    return single and len({stack.dtype for stack in capture.frames}) == 1


def _find_coded(capture: Capture, orders: OrdersName) -> _Coded | None:
    """The axis, where one alone is coded, and in a way that the kernel knows."""
    fringes, codes = capture.find(Fringe), capture.find(GrayCode)
    patterns = [pattern for pattern, *_ in fringes]
    axes = {pattern.axis for pattern in patterns} | {code.axis for code, *_ in codes}
    if len(axes) != 1 or not patterns or len(set(patterns)) < len(patterns):
        return None
    if capture.sequence.reference_ms is not None:
        return None
    if orders not in ("auto", "gray", "frequencies") or (orders == "gray" and not codes):
        return None
    (axis,) = axes
    bits = np.empty((0, *capture.shape), fringes[0][1].dtype)
    if not codes or orders == "frequencies":
        chain = _plan(patterns, capture.sequence.extent(axis) / 2)
        return None if chain is None else _Coded(axis, fringes, None, bits, chain)
    code, bits, repeats = min(codes, key=lambda entry: entry[0].code_px)
    chain = _plan(patterns, code.code_px / 2)
    if chain is None or code.inverted or repeats != 1 or len(bits) > MOST_BITS:
        return None
    return _Coded(axis, fringes, code, bits, chain)


def _plan(fringes: list[Fringe], reach_px: float) -> list[int] | None:
    """Places of the chain's sets; None where there is no chain, or one with beats."""
    try:
        chain = plan_chain(fringes, reach_px)
    except DecodeError:  # said on the other way
        return None
    beats = any(carrier.is_beat for carrier in chain)
    return None if beats else [carrier.weights.index(1) for carrier in chain]


def _carrier_of(
    entry: tuple[Fringe, Frames, int], sensor: Sensor, masks: MaskRules
) -> kernels.Carrier:
    fringe, frames, repeats = entry
    solution = solve_shifts(np.repeat(fringe.shifts_rad, repeats))
    noise = estimate_noise(frames, solution, sensor, masks)
    return kernels.Carrier(
        np.ascontiguousarray(frames),
        solution.basis,
        solution.solve,
        solution.covariance,
        _three(noise.read**2, noise.gain, noise.black_level),
        (float(fringe.period_px), float(fringe.zero_px)),
    )


def _code_of(capture: Capture, coded: _Coded, extent: int) -> kernels.Code:
    gray, shown = coded.gray, capture.sequence
    nothing = np.empty((0, 0), coded.bits.dtype)
    white, black = (
        nothing if index is None else np.ascontiguousarray(capture.frames[index][0])
        for index in (shown.white_set, shown.black_set)
    )
    code_px = 0.0 if gray is None else float(gray.code_px)
    return kernels.Code(
        np.ascontiguousarray(coded.bits),
        white,
        black,
        code_px,
        0 if gray is None else gray_cells(extent, code_px),
        DOUBT_SIGMAS,
        SAFE_MARGIN,
        SAFE_SIGMAS,
        (extent - 1) / 2,
    )


def _rules_of(sensor: Sensor, masks: MaskRules, extent: int) -> kernels.Rules:
    least = masks.least_modulation(sensor)
    return kernels.Rules(
        float(sensor.saturation),
        _three(least, masks.modulation_sigmas, masks.residual_sigmas),
        (np.uint8(Void.SATURATED), np.uint8(Void.MODULATION), np.uint8(Void.RESIDUAL)),
        (extent - 1) / 2,
        extent / 2,
        OUTSIDE_SIGMAS,
        (np.uint8(Reason.NOT_DECODED), np.uint8(Reason.OUTSIDE), MISFIT),
    )


def _three(*values: float) -> tuple[np.float32, np.float32, np.float32]:
    first, second, third = map(np.float32, values)
    return first, second, third
