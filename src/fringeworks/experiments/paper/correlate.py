"""How a random-dot sensor reads its image: windows correlated with the reference, row by row.

Disparity d is how far dots stand to the right of where the reference plane has them: for a point at
depth z, and the plane at z0, ``d = f b (1/z - 1/z0)``, f the focal length and b the baseline. It is
searched in whole px, refined by the parabola through the best three coefficients, and told in
eighths, as the paper's Kinect does.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from fringeworks.model import Cloud, Frames
from fringeworks.twin.speckle import SpeckleSensor

Floats = NDArray[np.float32]

WINDOW_PX = 9
STEP_PX = 1 / 8
LEAST_CORRELATION = 0.7
"""Pearson's coefficient below which a window shows other dots than the reference."""

LEAST_PIXELS = 2 * WINDOW_PX**2
LEAST_CONTRAST = 3.0
"""Standard deviation, grey levels, below which a window counts as having this much: no dots."""


def read_speckle(
    seen: Frames, reference: Frames, sensor: SpeckleSensor, *, step_px: float = STEP_PX
) -> Cloud:
    """Cloud ``(H, W)`` of a frame and the reference, mm, in the sensor's camera frame.

    NaN where no window of the reference is like the pixel's, or the depth is out of range.
    `sigma_mm` is what rounding the disparity to `step_px` leaves: the step over the root of 12.
    """
    lens = sensor.rig.camera.lens
    scale, base = lens.fx * sensor.baseline_mm, 1 / sensor.reference_mm
    near, far = sensor.range_mm
    shifts = range(int(scale * (1 / far - base)) - 2, int(scale * (1 / near - base)) + 3)
    disparity = np.round(find_disparity(seen, reference, shifts) / step_px) * step_px
    z = 1 / (disparity / scale + base)
    z = np.where((z >= near) & (z <= far), z, np.nan)
    rows, columns = np.indices(z.shape)
    x, y = (columns - lens.cx) / lens.fx * z, (rows - lens.cy) / lens.fy * z
    return Cloud(
        np.stack([x, y, z], axis=-1).astype(np.float32),
        (z**2 / scale * step_px / np.sqrt(12)).astype(np.float32),
        seen.astype(np.float32),
        np.full(z.shape, np.nan, np.float32),
        frame="speckle camera",
    )


def find_disparity(seen: Frames, reference: Frames, shifts: range) -> NDArray[np.float64]:
    """``(H, W)`` px by which each pixel's window stands to the right of the reference's.

    `shifts` are the whole ones to try. NaN where the best coefficient is below
    `LEAST_CORRELATION`, at either end of them, or alone: fewer than `LEAST_PIXELS` that agree are
    a chance likeness.
    """
    found = np.stack(list(_correlations(seen, reference, shifts)))
    best = np.argmax(found, axis=0)
    inside = np.clip(best, 1, len(shifts) - 2)
    left, middle, right = (
        np.take_along_axis(found, (inside + step)[None], axis=0)[0] for step in (-1, 0, 1)
    )
    whole = np.where((inside == best) & (middle >= LEAST_CORRELATION), best, -1).astype(np.int16)
    certain = cv2.filterSpeckles(whole, -1, LEAST_PIXELS, 1)[0] >= 0
    bend = np.where(certain, left - 2 * middle + right, np.nan)
    return np.asarray(shifts.start + best + (left - right) / (2 * bend), dtype=np.float64)


def _correlations(seen: Frames, reference: Frames, shifts: range) -> list[Floats]:
    """Pearson's coefficient ``(H, W)`` of each shift; -1 where either image ends."""
    ours, mean, spread = _windows(seen)
    plane, plane_mean, plane_spread = _windows(reference)
    width, rim, found = ours.shape[1], WINDOW_PX // 2, []
    for shift in shifts:
        coefficient = np.full(ours.shape, -1, np.float32)
        here = slice(max(shift, 0), width + min(shift, 0))
        there = slice(max(-shift, 0), width - max(shift, 0))
        product = _mean(ours[:, here] * plane[:, there])
        product -= mean[:, here] * plane_mean[:, there]
        product /= spread[:, here] * plane_spread[:, there]
        coefficient[:, here][:, rim:-rim] = product[:, rim:-rim]  # beyond, windows are cut
        found.append(coefficient)
    return found


def _windows(image: Frames) -> tuple[Floats, Floats, Floats]:
    """Grey levels, their mean over each window, and their standard deviation."""
    grey = image.astype(np.float32)
    mean = _mean(grey)
    return grey, mean, np.sqrt(np.maximum(_mean(grey**2) - mean**2, LEAST_CONTRAST**2))


def _mean(image: Floats) -> Floats:
    return np.asarray(uniform_filter(image, WINDOW_PX), dtype=np.float32)
