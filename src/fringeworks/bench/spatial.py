"""Spatial unwrapping on one thread, beside scikit-image's sorting by reliability.

Two phases of each size: a clean one, with a hole, on which both must give the same; and one so
noisy that it has residues, on which ours may not have more wrong orders than theirs.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.bench.metric import Metric
from fringeworks.bench.speed import QUICK_SECONDS, SECONDS, ratio_metric, time_metric
from fringeworks.bench.timing import one_thread, race, settle_allocator
from fringeworks.errors import DecodeError, MissingExtraError
from fringeworks.model import Fringe, Noise, WrappedPhase
from fringeworks.patterns.presets import equal_shifts
from fringeworks.phase.regions import find_regions
from fringeworks.phase.spatial import unwrap_spatial

SIZES = ((752, 480), (2448, 2048))
TURN = 2 * np.pi
SEED = 3
CLEAN_RAD, NOISY_RAD = 0.05, 0.8
LEAST_TURNS = (2, 200)
"""The peer takes seconds on the larger size."""

Unwrap = Callable[[], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class Surface:
    """A phase whose orders are known.

    Attributes
    ----------
    wrapped
        What is unwrapped.
    orders
        True ones, ``(H, W)``.
    bar
        By how much ours must be faster.
    """

    name: str
    wrapped: WrappedPhase
    orders: NDArray[np.int64]
    bar: float

    def count_wrong(self, phase: NDArray[np.floating]) -> int:
        """Pixels of an unwrapped phase off the commonest difference from the true orders."""
        valid = np.isfinite(self.wrapped.phase)
        turns = np.rint((phase - self.wrapped.phase)[valid] / TURN).astype(np.int64)
        return int(valid.sum() - np.unique(turns - self.orders[valid], return_counts=True)[1].max())


def measure_spatial(*, quick: bool = False) -> list[Metric]:
    """Metrics of both sizes; of the smaller, in short turns, where `quick`."""
    seconds = QUICK_SECONDS if quick else SECONDS
    settle_allocator()
    with one_thread():
        return [
            metric
            for size in (SIZES[:1] if quick else SIZES)
            for metric in measure_size(size, seconds=seconds)
        ]


def measure_size(size: tuple[int, int], *, seconds: float) -> list[Metric]:
    """Our times and the ratios to the peer, for images of (W, H)."""
    name = f"speed.spatial.{size[0]}x{size[1]}"
    clean, noisy = surface(size, CLEAN_RAD), surface(size, NOISY_RAD)
    times = race(
        lambda: unwrap_spatial(clean.wrapped), lambda: find_regions(clean.wrapped), seconds=seconds
    )
    return [
        time_metric(f"{name}.clean_ms", times.ours, "no residue"),
        time_metric(
            f"{name}.regions_ms", times.theirs, "find_regions, on the same; aim <= 3 of 752x480"
        ),
        *(_beside(f"{name}.{one.name}", one, seconds) for one in (clean, noisy)),
    ]


def surface(size: tuple[int, int], noise_rad: float) -> Surface:
    """Slanted fringes over waves with a round hole, always the same."""
    width, height = size
    row, column = np.mgrid[:height, :width].astype(np.float64)
    phase = 0.2 * column + 0.02 * row + 6 * np.sin(column / 90) * np.cos(row / 70)
    phase += np.random.default_rng(SEED).normal(0, noise_rad, phase.shape)
    orders = np.rint(phase / TURN)
    shown = (phase - TURN * orders).astype(np.float32)
    shown[np.hypot(column - width / 2, row - height / 2) < height / 5] = np.nan
    noisy = noise_rad > CLEAN_RAD
    return Surface(
        "residues" if noisy else "clean",
        _as_wrapped(shown, noise_rad),
        orders.astype(np.int64),
        5.0 if noisy else 40.0,
    )


def _as_wrapped(phase: NDArray[np.float32], sigma_rad: float) -> WrappedPhase:
    valid = np.isfinite(phase)
    level = np.full(phase.shape, 50, np.float32)
    nan = np.full(phase.shape, np.nan, np.float32)
    sigma = np.where(valid, np.float32(sigma_rad), nan)
    noise = Noise(1.0, 0.0, 0.0, "camera")
    fringe = Fringe("x", 32.0, equal_shifts(3))
    return WrappedPhase(
        fringe, phase, 2 * level, level, nan, sigma, noise, np.where(valid, 0, 2).astype(np.uint8)
    )


def scikit_image(wrapped: WrappedPhase) -> Unwrap:
    """Its `unwrap_phase` (Herráez et al. 2002), with void pixels masked."""
    try:
        restoration = importlib.import_module("skimage.restoration")
    except ImportError as error:
        raise MissingExtraError(f"{error}: run make bench") from None
    void = np.isnan(wrapped.phase)
    masked = np.ma.masked_array(np.where(void, 0, wrapped.phase), void)  # its sort hangs on NaN
    return lambda: np.asarray(np.ma.getdata(restoration.unwrap_phase(masked)))


def _beside(key: str, one: Surface, seconds: float) -> Metric:
    """How many times as long the peer takes, and how many orders of each are wrong."""
    key = f"{key}_vs_scikit_image"
    try:
        peer = scikit_image(one.wrapped)
    except MissingExtraError as error:
        return Metric(key, None, "x", "higher", f"skipped: {error}")
    ours = one.count_wrong(unwrap_spatial(one.wrapped).phase)
    theirs = one.count_wrong(peer())
    if ours > theirs:
        raise DecodeError(f"{key}: {ours} orders of ours are wrong, {theirs} of scikit-image's")
    result = race(lambda: unwrap_spatial(one.wrapped), peer, seconds=seconds, turns=LEAST_TURNS)
    wrong = f"wrong orders {ours} against {theirs} of {one.orders.size}"
    return ratio_metric(key, result, "higher", f"bar >= {one.bar:g}", wrong)
