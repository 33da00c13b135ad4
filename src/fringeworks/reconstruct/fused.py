"""Frames to cloud in one pass over the pixels, where a capture allows it (see `fused_plan`).

The points are those of `phase.decode` and `full` with its table, to rounding: the functions of a
pixel are the same, and so are the rules.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

from fringeworks.kernels.fused import fuse
from fringeworks.kernels.fused_nouns import Points
from fringeworks.model import Capture, Cloud, Reason, Rig
from fringeworks.reconstruct.full import misfit_finding
from fringeworks.reconstruct.fused_plan import MISFIT, FusedScan

THREADS_FROM_PIXELS = 2_000_000
"""Below this a second thread costs more than it gains."""

MOST_THREADS = 4


def scan_fused(
    plan: FusedScan, capture: Capture, rig: Rig, *, threads: int | None = None
) -> Cloud | None:
    """Cloud in the camera's frame; None where no pixel has a point: the other way says why.

    Parameters
    ----------
    plan
        `fused_plan.prepare_scan` of this capture and this rig.
    threads
        How many share the rows; None: as many as there are processors, at most four, from 2 Mpx.
    """
    points = empty_points(capture.shape)
    run_scan(plan, points, threads=threads or _default_threads(capture.shape))
    misfits = points.reason == MISFIT
    points.reason[misfits] = Reason.NOT_DECODED
    if not (points.reason == Reason.VALID).any():
        return None
    decoded = np.count_nonzero(points.reason != Reason.NOT_DECODED)
    return Cloud(
        np.moveaxis(points.xyz, 0, -1),
        points.sigma_mm,
        points.intensity,
        np.full(capture.shape, np.nan, np.float32),
        capture.colour,
        scale_sigma=rig.scale_sigma,
        findings=misfit_finding(plan.axis, int(np.count_nonzero(misfits)), int(decoded)),
        reason=points.reason,
    )


def empty_points(shape: tuple[int, int]) -> Points:
    """Room for all that the kernel writes of an image ``(H, W)``."""
    sigma_mm, intensity = np.empty(shape, np.float32), np.empty(shape, np.float32)
    return Points(np.empty((3, *shape), np.float32), sigma_mm, intensity, np.empty(shape, np.uint8))


def run_scan(plan: FusedScan, points: Points, *, threads: int = 1) -> None:
    """Fill `points`; a stream gives its last ones back, as fresh memory takes time."""

    def fill(rows: tuple[int, int]) -> None:
        fuse(rows, plan.carriers, plan.chain, plan.code, plan.rules, plan.table, points)

    height = points.reason.shape[0]
    shares = list(pairwise(height * n // threads for n in range(threads + 1)))
    if threads == 1:
        fill(shares[0])
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(fill, shares))


def _default_threads(shape: tuple[int, int]) -> int:
    enough = shape[0] * shape[1] >= THREADS_FROM_PIXELS
    return min(os.cpu_count() or 1, MOST_THREADS) if enough else 1
