"""Three steps to wrapped phase as others do it.

Each peer is a function of the frames ``(3, H, W)``, shifted by 120, 0 and -120 degrees, that gives
the work to be timed: a call without arguments that returns the phase, rad, ``(H, W)``.
"""

from __future__ import annotations

import importlib
import logging
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MissingExtraError
from fringeworks.model import Frames

Phase = NDArray[np.floating]
PhaseWork = Callable[[], Phase]


@dataclass(frozen=True, slots=True)
class Peer:
    """Someone else's way to the wrapped phase.

    Attributes
    ----------
    name
        Part of the metric's key.
    prepare
        Makes the timed call; raises MissingExtraError where the peer is not installed.
    tolerance_rad
        Root mean squared difference from our phase that its method explains.
    remark
        What it does besides, or differently.
    bar
        By how much ours must be faster; 0 where nothing is asked.
    """

    name: str
    prepare: Callable[[Frames], PhaseWork]
    tolerance_rad: float
    remark: str = ""
    bar: float = 0.0


def numpy_float64(frames: Frames) -> PhaseWork:
    """As it stands in most scripts."""

    def work() -> Phase:
        first, second, third = frames.astype(float)
        return np.asarray(np.arctan2(np.sqrt(3) * (first - third), 2 * second - first - third))

    return work


def numpy_float32(frames: Frames) -> PhaseWork:
    """The same by someone who thought of single precision."""
    root = np.float32(math.sqrt(3))

    def work() -> Phase:
        first, second, third = frames.astype(np.float32)
        return np.asarray(np.arctan2(root * (first - third), 2 * second - first - third))

    return work


def opencv_psp(frames: Frames) -> PhaseWork:
    """OpenCV's phase shifting profilometry, of its contrib module `structured_light`."""
    import cv2

    module = getattr(cv2, "structured_light", None)
    if module is None or not hasattr(module, "SinusoidalPattern"):
        raise MissingExtraError("OpenCV without its contrib modules: run make bench")
    settings = module.SinusoidalPattern.Params()
    settings.methodId = module.PSP
    height, width = frames.shape[1:]
    settings.height, settings.width, settings.shiftValue = height, width, 2 * math.pi / 3
    pattern = module.SinusoidalPattern.create(settings)
    images = [frames[1], frames[2], frames[0]]

    def work() -> Phase:
        return np.asarray(pattern.computePhaseMap(images)[0])[:height, :width]

    return work


def fringes_package(frames: Frames) -> PhaseWork:
    """The `fringes` package on one thread, with a period for which it has nothing to unwrap."""
    logging.getLogger("fringes").setLevel(logging.ERROR)
    try:
        package = importlib.import_module("fringes")
    except ImportError as error:
        raise MissingExtraError(f"{error}: run make bench") from None
    coder = package.Fringes()
    height, width = frames.shape[1:]
    coder.X, coder.Y, coder.D, coder.K, coder.N, coder.v, coder.p0 = width, height, 1, 1, 3, 1, 0
    images = np.ascontiguousarray(frames[[1, 0, 2]])

    def work() -> Phase:
        decoded = coder.decode(images, unwrap=False, verbose=True, threads=1)
        return np.asarray(decoded.p).reshape(height, width)

    return work


PEERS = (
    Peer("numpy_float64", numpy_float64, 1e-6, bar=25),
    Peer("numpy_float32", numpy_float32, 1e-6),
    Peer("opencv_psp", opencv_psp, 0.1, "also filters by Fourier transform", bar=50),
    Peer("fringes", fringes_package, 1e-6, "also gives offset, modulation, coordinate, sigma"),
)
