"""Patterns to pixels: grey levels over the full range of the projector's input.

A sinusoid takes the levels ``round(A + B cos(Phi - shift))`` with A = B = (2^bits - 1) / 2.
Rounding leaves an error without bias; truncation would darken every frame by half a level.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fringeworks.model import Frames, GreyCurve, Pattern, PatternSet, Sequence
from fringeworks.patterns.checks import check_pattern, check_sequence, require
from fringeworks.patterns.draw import draw

BITS_RANGE = (8, 16)

LIGHT_DECIMALS = 12
"""Digits of the light that count: a cosine's zero lies midway between two levels, and the last
bits of a library's cosine would choose between them. Halves go up on every machine."""


def render(
    pattern: Pattern, *, width: int, height: int, bits: int = 8, curve: GreyCurve | None = None
) -> Frames:
    """Grey levels of a pattern's frames.

    Parameters
    ----------
    pattern
        Any kind but a `Picture`.
    width, height
        Size of the projector, px.
    bits
        Depth, 8 to 16: levels span 0 .. 2^bits - 1.
    curve
        The projector's: levels are those that make the pattern's light. None: levels are light.

    Returns
    -------
    Frames
        ``(n, height, width)``, n the pattern's `frame_count`; for `Colour`
        ``(1, height, width, 3)``, red, green, blue. uint8 for 8 bits, else uint16.

    Raises
    ------
    UsageError
        For a pattern that `check_pattern` refuses, or a depth out of range.
    """
    check_pattern(pattern, width=width, height=height)
    _check_bits(bits)
    light = draw(pattern, width=width, height=height)
    if curve is not None:
        light = curve.level_of(light)
    frames: Frames = np.empty(
        (light.shape[0], height, width, *light.shape[3:]), np.uint8 if bits == 8 else np.uint16
    )
    frames[:] = np.floor(np.round(light, LIGHT_DECIMALS) * (2**bits - 1) + 0.5)
    return frames


def render_sequence(
    sequence: Sequence, *, bits: int = 8, curve: GreyCurve | None = None
) -> Iterator[tuple[PatternSet, Frames]]:
    """Each set of the sequence with its images, one set in memory at a time.

    The stack holds the set's `image_count` images, its repeats frame by frame. The whole sequence
    is checked before the first set is drawn: a bad one raises UsageError from the call itself.
    """
    check_sequence(sequence)
    _check_bits(bits)
    return ((item, _render_item(item, sequence, bits, curve)) for item in sequence.sets)


def _render_item(
    item: PatternSet, sequence: Sequence, bits: int, curve: GreyCurve | None
) -> Frames:
    size = {"width": sequence.width, "height": sequence.height}
    frames = render(item.pattern, **size, bits=bits, curve=curve)
    each = np.arange(len(frames)).repeat(item.repeats)
    return frames[each] if item.repeats > 1 else frames


def _check_bits(bits: int) -> None:
    least, most = BITS_RANGE
    require(least <= bits <= most, "bits", expected=f"{least} to {most}", actual=bits)
