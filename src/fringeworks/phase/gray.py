"""Reflected binary (Gray) codes: the cell of the projector that lit a pixel.

With a complementary bit the index counts half cells, so that the centre of a half cell is never
further than a quarter of a cell from the truth, and fringes of the cell's width are unwrapped with
half their margin left at every edge, where a plain code of such cells has none.

Neighbouring cells differ in one bit, so at an edge that bit is anyone's guess and costs one cell
at most. Where two bits cannot be told from the noise the code may mean any place, and the pixel
is void: on the real board of `procam-graycode` that is 1 to 7 % of the pixels and nearly all of
the wild points. With one such bit the pixel sees an edge and its cell's centre is half a cell off;
with none it lies anywhere in its cell.
"""

from __future__ import annotations

import math
from collections.abc import Sequence as Items
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.kernels.orders import gray_index
from fringeworks.model import (
    Axis,
    Capture,
    FloatMap,
    Frames,
    GrayCode,
    Noise,
    PatternSet,
    WrappedPhase,
    gray_cells,
)
from fringeworks.model.exposures import extrapolate
from fringeworks.phase.noise import image_noise

DOUBT_SIGMAS = 2.0


@dataclass(frozen=True, slots=True)
class Contrast:
    """Grey levels of light and dark as the capture shows them, ``(H, W)`` each."""

    offset: FloatMap
    modulation: FloatMap


def uniform_contrast(capture: Capture) -> Contrast | None:
    """Half sum and half difference of white and black; None if one is missing."""
    white, black = capture.white(), capture.black()
    if white is None or black is None:
        return None
    half = np.float32(0.5)
    return Contrast(half * (white + black), half * (white - black))


def inverted_contrast(code: GrayCode, frames: Frames) -> Contrast | None:
    """Mean offset and modulation of the bits and their inverses; None if there are none."""
    if not code.inverted:
        return None
    bits, inverse = frames[: code.bits], frames[-code.bits :]
    total = bits.astype(np.float32) + inverse
    difference = np.abs(bits.astype(np.float32) - inverse)
    return Contrast(total.mean(axis=0) / 2, difference.mean(axis=0) / 2)


def mean_repeats(frames: Frames, repeats: int) -> Frames:
    """One frame ``(n, H, W)`` for each run of `repeats` frames ``(n * repeats, H, W)``."""
    if repeats == 1:
        return frames
    runs = frames.reshape(-1, repeats, *frames.shape[1:])
    means: Frames = np.rint(runs.mean(axis=1, dtype=np.float32)).astype(frames.dtype)
    return means


def decode_gray(
    code: GrayCode, frames: Frames, *, extent: int, contrast: Contrast, noise: Noise
) -> tuple[FloatMap, NDArray[np.bool_]]:
    """Projector coordinate of the centre of each pixel's (half) cell, and who sees a cell's edge.

    Parameters
    ----------
    code, frames
        The code and its frames ``(n, H, W)`` in the order that `GrayCode` states.
    extent
        Projector pixels along the code's axis.
    contrast
        Its offset lies halfway between light and dark; where every bit has its inverse those
        decide instead.
    noise
        Of one frame: a bit within `DOUBT_SIGMAS` of its threshold is doubtful.

    Returns
    -------
    coordinate
        ``(H, W)`` float32, projector px; NaN where the code lies outside the projector's image,
        and where two of its bits or more are doubtful.
    at_edge
        ``(H, W)``: one bit is doubtful.
    """
    level = contrast.offset[np.newaxis]
    doubt = np.asarray(DOUBT_SIGMAS * noise.sigma(contrast.offset), dtype=np.float32)
    index = np.zeros(frames.shape[1:], np.int32)
    doubtful = np.zeros(frames.shape[1:], np.uint8)
    if code.inverted:
        two_frames = np.float32(math.sqrt(2)) * doubt
        gray_index(frames[: code.bits], frames[-code.bits :], two_frames, index, doubtful)
    else:
        gray_index(frames[: code.bits], level, doubt, index, doubtful)
    if code.complementary:
        gray_index(frames[code.bits : code.bits + 1], level, doubt, index, doubtful)
    centre: FloatMap = (index.astype(np.float32) + 0.5) * code.code_px - 0.5
    outside = index >= gray_cells(extent, code.code_px)
    centre[outside | (doubtful >= 2)] = np.nan
    return centre, doubtful == 1


@dataclass(frozen=True, slots=True)
class GrayReading:
    """What one axis's Gray code says of each pixel.

    Attributes
    ----------
    coordinate
        ``(H, W)`` projector px of the (half) cell's centre; NaN where the code is void.
    at_edge
        ``(H, W)``: one bit is doubtful, so that the pixel sees the edge between two cells.
    contrast, noise
        By which light was told from dark.
    """

    code: GrayCode
    coordinate: FloatMap
    at_edge: NDArray[np.bool_]
    contrast: Contrast
    noise: Noise

    @property
    def sigma(self) -> FloatMap:
        """Of `coordinate`, px: ``cell / sqrt(12)``, or half a cell at an edge; NaN where void."""
        cells = np.where(self.at_edge, np.float32(0.5), np.float32(1 / math.sqrt(12)))
        cells[np.isnan(self.coordinate)] = np.nan
        return np.asarray(cells * np.float32(self.code.code_px))


def read_gray(
    capture: Capture, axis: Axis, *, fringes: WrappedPhase | None, least_modulation: float
) -> GrayReading | None:
    """Decode the axis's finest Gray code; None if the capture has none along this axis.

    Light is told from dark by the inverse frames, else by the mean of white and black, else by the
    offset of `fringes` on the same scene. The noise is that of the fringes too; without any, the
    camera's own, or that of the first bit where the modulation reaches `least_modulation` grey
    levels. A code shown at several exposures is read at each, by light and dark as they would be
    there, and a pixel is from the longest at which none of its frames is saturated (else from the
    shortest).

    Raises
    ------
    FormatError
        There is nothing to tell light from dark by.
    """
    codes = [entry for entry in capture.find(GrayCode) if entry[0].axis == axis]
    if not codes:
        return None
    code = min((entry[0] for entry in codes), key=lambda entry: entry.code_px)
    shown = [(item, stack) for item, stack in capture if item.pattern == code]
    shown.sort(key=lambda entry: entry[0].exposure_ms or 0.0)
    readings = [
        _read_set(capture, code, entry, fringes=fringes, least_modulation=least_modulation)
        for entry in shown
    ]
    if len(readings) == 1:
        return readings[0]
    contrast = uniform_contrast(capture) or _contrast_of(fringes)
    return _longest_unsaturated(readings, [stack for _, stack in shown], capture, contrast)


def _read_set(
    capture: Capture,
    code: GrayCode,
    entry: tuple[PatternSet, Frames],
    *,
    fringes: WrappedPhase | None,
    least_modulation: float,
) -> GrayReading:
    """One set of a code's frames, in its own grey levels."""
    item, stack = entry
    frames = mean_repeats(stack, item.repeats)
    scaled = uniform_contrast(capture) or _contrast_of(fringes)
    contrast = (
        inverted_contrast(code, frames) if scaled is None else contrast_at(scaled, item, capture)
    )
    if contrast is None:
        raise FormatError(
            f"the Gray code along {code.axis} has nothing to tell light from dark by: add the "
            "inverted frames, or white and black frames, or fringes"
        )
    if fringes is not None:
        noise = fringes.noise
    else:
        lit = contrast.modulation >= least_modulation
        noise = image_noise(frames[:1], lit, sensor=capture.sensor)
    extent = capture.sequence.extent(code.axis)
    coordinate, at_edge = decode_gray(code, frames, extent=extent, contrast=contrast, noise=noise)
    return GrayReading(code, coordinate, at_edge, contrast, noise)


def contrast_at(contrast: Contrast, item: PatternSet, capture: Capture) -> Contrast:
    """Light and dark, known at the longest exposure, as the set of a capture shows them.

    Both end at saturation: where dark is saturated too the modulation is zero.
    """
    reference_ms, sensor = capture.sequence.reference_ms, capture.sensor
    if reference_ms is None or item.exposure_ms is None:
        return contrast
    ratio, top = item.exposure_ms / reference_ms, np.float32(sensor.saturation)
    light, dark = (
        np.asarray(np.minimum(extrapolate(level, ratio, sensor.black_level), top), np.float32)
        for level in (
            contrast.offset + contrast.modulation,
            contrast.offset - contrast.modulation,
        )
    )
    half = np.float32(0.5)
    return Contrast(half * (light + dark), half * (light - dark))


def _longest_unsaturated(
    readings: Items[GrayReading],
    stacks: Items[Frames],
    capture: Capture,
    contrast: Contrast | None,
) -> GrayReading:
    """Of readings of one code, shortest exposure first, each pixel's as `read_gray` says.

    `contrast` is that of the longest exposure; None: that of its own frames.
    """
    first, last = readings[0], readings[-1]
    coordinate, at_edge = first.coordinate.copy(), first.at_edge.copy()
    for reading, stack in zip(readings[1:], stacks[1:], strict=True):
        clear = stack.max(axis=0) < capture.sensor.saturation
        np.copyto(coordinate, reading.coordinate, where=clear)
        np.copyto(at_edge, reading.at_edge, where=clear)
    return GrayReading(first.code, coordinate, at_edge, contrast or last.contrast, last.noise)


def _contrast_of(fringes: WrappedPhase | None) -> Contrast | None:
    return None if fringes is None else Contrast(fringes.offset, fringes.modulation)
