"""Camera noise: from the capture's own figures, else from the images, and it says which."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.noise import count_second_differences, sum_drawn_in
from fringeworks.model import FloatMap, Frames, Noise, Sensor

QUANTISATION_VARIANCE = 1 / 12
"""Variance of rounding to whole grey levels."""

NORMAL_MEDIAN = 0.674490
"""Median of |x| for x standard normal."""

HIGH_PASS_GAIN = 6.0
"""Standard deviation that the mask of second differences gives white noise of one."""

LARGEST_DIFFERENCE = 8
"""Largest value of that mask, in ranges of grey levels."""

DRAWN_IN_FROM = 0.9
HUBER_ROUNDS = 10
SAMPLE = 10_000

LEAST_PIXELS = 100
"""Fewer pixels than this are no sample of the noise."""

ENOUGH_PIXELS = 1 << 19
BAND_ROWS = 32
"""Of larger images bands of rows are looked at: more pixels would tell one figure no better."""


def camera_noise(sensor: Sensor) -> Noise:
    """Noise as measured by photon transfer, with the rounding of grey levels."""
    read = np.hypot(sensor.read_noise or 0.0, np.sqrt(QUANTISATION_VARIANCE))
    return Noise(float(read), sensor.gain or 0.0, sensor.black_level, "camera")


def noise_rows(shape: tuple[int, ...]) -> slice | NDArray[np.intp]:
    """Rows of an image ``(H, W)`` in which its noise is looked for: all, or evenly spread bands.

    Rows that are not neighbours in the image become so: of 32 rows two have a difference too many.
    """
    height, width = shape
    bands = max(ENOUGH_PIXELS // (BAND_ROWS * width), 1)
    if bands * BAND_ROWS >= height or height * width <= ENOUGH_PIXELS:
        return slice(None)
    first = np.linspace(0, height - BAND_ROWS, bands).astype(np.intp)
    return np.asarray((first[:, np.newaxis] + np.arange(BAND_ROWS)).ravel())


def image_noise(frames: Frames, use: NDArray[np.bool_], *, sensor: Sensor) -> Noise:
    """Noise without any fit: the camera's own figures, else high-pass differences.

    All pixels are used where `use` has too few to be a sample.
    """
    if sensor.noise_is_known:
        return camera_noise(sensor)
    if np.count_nonzero(use[1:-1, 1:-1]) < LEAST_PIXELS:
        use = np.ones_like(use)
    return high_pass_noise(frames, use, black_level=sensor.black_level)


def residual_noise(residual: FloatMap, *, freedom: int, black_level: float) -> Noise:
    """One standard deviation for the image from the fit residuals of N = freedom + 3 frames.

    Huber's second proposal: the mean square, with squares beyond the nine-tenths point of
    chi-squared noise drawn in to it, so that moved or glossy parts of the scene hardly count.
    `residual` is per degree of freedom, NaN at the pixels to leave out.
    """
    from scipy.special import gammainc, gammaincinv

    residual = np.atleast_2d(residual).astype(np.float32, copy=False)
    cut = 2 * float(gammaincinv(freedom / 2, DRAWN_IN_FROM))
    within = float(gammainc(freedom / 2 + 1, cut / 2))
    expected = freedom * within + cut * (1 - DRAWN_IN_FROM)
    variance = _median_square(residual)
    sums = np.empty((2, residual.shape[1]), np.float32)
    for _ in range(HUBER_ROUNDS):
        sum_drawn_in(residual, cut / freedom * variance, sums)
        total, count = sums.sum(axis=1, dtype=np.float64)
        variance = float(total / count) * freedom / expected
    return Noise(_at_least_rounding(np.sqrt(variance)), 0.0, black_level, "residual")


def _median_square(residual: FloatMap) -> float:
    """Median of the squares of at most `SAMPLE` values: the rounds' start, not their result."""
    known = residual[np.isfinite(residual)]
    return float(np.median(np.square(known[:: 1 + known.size // SAMPLE])))


def high_pass_noise(frames: Frames, use: NDArray[np.bool_], *, black_level: float) -> Noise:
    """One standard deviation for the image from second differences across rows and columns.

    The mask (1 -2 1) x (1 -2 1) takes out whatever is linear along either direction, fringes
    among it (Immerkaer 1996); the median over the pixels of `use` leaves out edges. It is
    applied to the differences of neighbouring frames, in which the scene's texture cancels and
    shot noise is evener over the fringes than in one frame (a single frame has none and stands
    for itself). Grey levels are whole numbers: the median is read between them.
    """
    medians = [_continuous_median(_second_differences(image, use)) for image in _changes(frames)]
    variances = min(len(frames), 2)
    read = float(np.mean(medians)) / (NORMAL_MEDIAN * HIGH_PASS_GAIN * np.sqrt(variances))
    return Noise(_at_least_rounding(read), 0.0, black_level, "high-pass")


def _changes(frames: Frames) -> Iterator[NDArray[np.int32]]:
    """Differences of neighbouring frames, one in memory at a time; a single frame as it is."""
    if len(frames) == 1:
        yield frames[0].astype(np.int32)
    for before, after in pairwise(frames):
        yield np.subtract(after, before, dtype=np.int32)


def _second_differences(image: NDArray[np.int32], use: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Histogram of the absolute second differences about the pixels of `use`."""
    counts = np.zeros(LARGEST_DIFFERENCE * int(np.ptp(image)) + 1, np.int64)
    count_second_differences(image, use, counts)
    return np.trim_zeros(counts, "b")


def _at_least_rounding(read: float) -> float:
    return float(max(read, np.sqrt(QUANTISATION_VARIANCE)))


def _continuous_median(counts: NDArray[np.int64]) -> float:
    """Median of non-negative whole numbers, each spread evenly over the unit that rounds to it."""
    edges = np.concatenate([[0.0], np.arange(len(counts)) + 0.5])
    return float(np.interp(0.5, np.concatenate([[0.0], np.cumsum(counts) / counts.sum()]), edges))
