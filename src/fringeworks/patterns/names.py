"""Names of image files that say what is in them: ``fringe_x_p32_0.png``, ``gray_y_3.png``."""

from __future__ import annotations

from fringeworks.model import (
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Picture,
    Sequence,
    Speckle,
    Staircase,
    Uniform,
)


def frame_names(sequence: Sequence) -> tuple[tuple[str, ...], ...]:
    """File names of every image of a sequence, set by set, unique in the whole of it.

    The frames of a set stand in the order in which `render_sequence` yields them. Sets of one
    pattern at several exposures say theirs, as ``white_8ms.png``. A set that would be called like
    one before it says its place, as ``white_set5.png``; repeats of a frame end in ``_r0``,
    ``_r1``...
    """
    stems = [_exposed_stem(item, sequence) for item in sequence.sets]
    return tuple(
        _set_names(item, stem if stem not in stems[:place] else f"{stem}_set{place}")
        for place, (item, stem) in enumerate(zip(sequence.sets, stems, strict=True))
    )


def _set_names(item: PatternSet, stem: str) -> tuple[str, ...]:
    """One name per image: frame by frame, repeat by repeat."""
    repeats = [f"_r{i}" for i in range(item.repeats)] if item.repeats > 1 else [""]
    return tuple(
        f"{stem}{ending}{repeat}.png" for ending in _endings(item.pattern) for repeat in repeats
    )


def _exposed_stem(item: PatternSet, sequence: Sequence) -> str:
    """With the exposure, where all sets of the pattern say theirs and there are several."""
    stem = _stem(item.pattern)
    same = {other.exposure_ms for other in sequence.sets if other.pattern == item.pattern}
    return f"{stem}_{item.exposure_ms:g}ms" if len(same) > 1 and None not in same else stem


def _stem(pattern: Pattern) -> str:
    """What all frames of a pattern are called."""
    match pattern:
        case Fringe(axis=axis, period_px=period):
            return f"fringe_{axis}_p{period:g}"
        case GrayCode(axis=axis):
            return f"gray_{axis}"
        case Uniform(level=level):
            return {0.0: "black", 1.0: "white"}.get(level, f"grey_{level:g}")
        case Codeword(axis=axis, period_px=period):
            return f"codeword_{axis}_p{period:g}"
        case Checkerboard(square_px=square):
            return f"checkerboard_s{square:g}"
        case Staircase(axis=axis, period_px=period, levels=levels):
            return f"staircase_{axis}_p{period:g}_l{levels}"
        case Colour(axis=axis, period_px=period):
            return f"colour_{axis}_p{period:g}"
        case Speckle(seed=seed):
            return f"speckle_{seed}"
        case Picture():
            return "picture"


def _endings(pattern: Pattern) -> list[str]:
    """What tells the frames of a pattern apart."""
    if isinstance(pattern, GrayCode):
        bits = range(pattern.bits)
        complement = ["_complementary"] if pattern.complementary else []
        inverted = [f"_inverted_{bit}" for bit in bits] if pattern.inverted else []
        return [f"_{bit}" for bit in bits] + complement + inverted
    if isinstance(pattern, Fringe | Staircase) or pattern.frame_count > 1:
        return [f"_{frame}" for frame in range(pattern.frame_count)]
    return [""]
