"""Sequences for a purpose: a preset's recipe, changed by a few named options.

`paper` is the sequence of the paper: three steps of 32 px (its equation 10), a Gray code to
compare with, and its single code frame. `calibrate`, `measure` and `multi-frequency` follow the
noise-optimal choices: N >= 4 steps to reject the harmonics of the response, and orders that are
safe at the edges of every fringe. `paper-calibrate` is what the paper shows to a board: its fringes
and a projected checkerboard. `double-three-step` is Huang, Hu and Chiang's (2002): three steps, and
the same three 60 degrees on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Literal, TypeAlias, get_args

from fringeworks.model import (
    AXES,
    Axis,
    Checkerboard,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Sequence,
    Staircase,
    Uniform,
    gray_bits,
)
from fringeworks.model.sequence import fringe_orders
from fringeworks.patterns.checks import (
    SHORTEST_PERIOD_PX,
    check_projector,
    check_sequence,
    require,
)
from fringeworks.patterns.codewords import Codewords, make_code_frame
from fringeworks.patterns.unique import unique_sequence

Preset: TypeAlias = Literal[
    "paper", "calibrate", "measure", "multi-frequency", "paper-calibrate", "double-three-step"
]
Code: TypeAlias = Literal["none", "gray", "complementary", "staircase", "colour"]

STEPS_RANGE = (3, 64)

COARSEST_SHARE = 1.05
"""Coarsest period of `multi-frequency` over the axis' extent: the guard of 5 % keeps the phases
of both edges apart, so that it unwraps without a code."""

FINER_FRINGES = (8, 64)
"""How many fringes the finer two frequencies of `multi-frequency` put on an axis."""

SHORTEST_SENSIBLE_PERIOD_PX = 6.0
"""Below about 2 pi times the blur's sigma (5 to 8 px) a shorter period loses more modulation
than it gains in phase."""

SQUARES_ACROSS = 30
"""Projected squares along the image's shorter side: 40 by 20 camera px each on the paper's rig."""

STAIR_STEPS = 3
"""Frames of a staircase (Wang and Zhang 2012)."""

PALETTE = ("red", "green", "blue", "cyan", "magenta", "yellow")
"""Colours of `Colour` codes: all with a hue that a projector mixes from full primaries."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """What a preset projects along each axis.

    Attributes
    ----------
    steps
        Frames of each fringe set, 3 to 64.
    periods_px
        Periods, projector px, one fringe set each; empty: `frequency_ladder` of the axis.
    code
        What tells the orders of the coarsest fringes: a Gray code, plain or complementary, whose
        cells are their period; a staircase; or one frame of colours, in which as few neighbours as
        can be tell where they are (`unique_sequence`).
    inverted
        Whether the inverse of each bit is shown too: the safest threshold on dark surfaces.
    codewords_px
        Codewords of a code frame along the first axis, or the name of a set (`codewords`); empty:
        no code frame.
    squares_across
        Squares of a projected checkerboard along the shorter side of the image; 0: none.
    paired
        Whether the steps are `paired_shifts`, six of them, and not `equal_shifts`.
    """

    steps: int
    periods_px: tuple[float, ...] = ()
    code: Code = "complementary"
    inverted: bool = False
    codewords_px: Codewords = ()
    squares_across: int = 0
    paired: bool = False


PRESETS: MappingProxyType[Preset, Recipe] = MappingProxyType(
    {
        "paper": Recipe(steps=3, periods_px=(32.0,), codewords_px="paper"),
        "calibrate": Recipe(steps=8, periods_px=(32.0,), inverted=True),
        "measure": Recipe(steps=8, periods_px=(16.0,)),
        "multi-frequency": Recipe(steps=4, code="none"),
        "paper-calibrate": Recipe(steps=3, periods_px=(32.0,), squares_across=SQUARES_ACROSS),
        "double-three-step": Recipe(steps=6, periods_px=(16.0,), paired=True),
    }
)


def make_sequence(
    preset: Preset,
    *,
    width: int,
    height: int,
    axes: tuple[Axis, ...] = AXES,
    steps: int | None = None,
    periods_px: tuple[float, ...] | None = None,
    code: Code | None = None,
    inverted: bool | None = None,
    codewords_px: Codewords | None = None,
) -> Sequence:
    """Describe what a projector shows: fringes and code per axis, other frames, white, black.

    Parameters
    ----------
    preset
        A key of `PRESETS`.
    width, height
        Size of the projector, px, 2 to 8192 each.
    axes
        Axes to code; a code frame belongs to the first.
    steps, periods_px, code, inverted, codewords_px
        In place of the recipe's own (see `Recipe`); None keeps it. ``code="none"`` leaves the
        code out, ``codewords_px=()`` the code frame.

    Returns
    -------
    Sequence
        Along each axis the fringes from coarse to fine, then their code. An axis on one fringe
        alone (its coarsest period at least 1.05 times its extent) gets no code.

    Raises
    ------
    UsageError
        For a value out of range, or patterns that could not be decoded (`check_sequence`).
    """
    require(preset in PRESETS, "preset", expected=f"one of {', '.join(PRESETS)}", actual=preset)
    check_projector(width=width, height=height)
    _check_axes(axes)
    given: dict[str, Any] = {
        "steps": steps,
        "periods_px": periods_px,
        "code": code,
        "inverted": inverted,
        "codewords_px": codewords_px,
    }
    chosen = {name: value for name, value in given.items() if value is not None}
    recipe = replace(PRESETS[preset], **chosen)
    _check_recipe(recipe, periods_given=periods_px is not None)
    blank = Sequence(width, height, ())
    extents = {axis: blank.extent(axis) for axis in axes}
    if preset == "multi-frequency" and recipe.code == "none" and recipe.periods_px:
        _check_guard(recipe.periods_px, max(extents.values()))
    patterns = [p for axis in axes for p in _axis_patterns(recipe, axis, extents[axis])]
    patterns += _code_frame(recipe, axes[0], extents[axes[0]])
    patterns += _projected_board(recipe, min(width, height))
    patterns += [Uniform(1.0), Uniform(0.0)]
    sequence = replace(blank, sets=tuple(map(PatternSet, patterns)))
    check_sequence(sequence)
    return sequence


def equal_shifts(steps: int) -> tuple[float, ...]:
    """Shifts, rad, of equal steps over one turn: ``2 pi n / N``.

    Three steps stand in the paper's order, (2 pi/3, 0, -2 pi/3), for which its equation (10) is
    written.
    """
    if steps == 3:
        return (2 * math.pi / 3, 0.0, -2 * math.pi / 3)
    return tuple(2 * math.pi * n / steps for n in range(steps))


def paired_shifts() -> tuple[float, ...]:
    """Shifts, rad, of the double three-step way: three steps, then three 60 degrees on.

    120, 0, -120, 180, 60, -60 degrees (Huang, Hu and Chiang 2002): either half alone is a set of
    three steps. The mean of their two phases cancels the ripple of three steps to first order; the
    least squares of all six, which decoding takes, is that of six equal steps and cancels it.
    """
    third, sixth = 2 * math.pi / 3, math.pi / 3
    return (third, 0.0, -third, math.pi, sixth, -sixth)


def frequency_ladder(extent: int) -> tuple[float, ...]:
    """Periods, projector px, coarse to fine, that unwrap each other along `extent` pixels.

    The coarsest is 1.05 times the extent, so that it shows less than one turn. The finer ones put
    8 and 64 fringes on the axis, or as many as fit at 6 px each: below 384 px that is fewer than
    64. A period that would repeat the one before it is left out.
    """
    coarsest = round(COARSEST_SHARE * extent, 2)
    finer = (max(extent / count, SHORTEST_SENSIBLE_PERIOD_PX) for count in FINER_FRINGES)
    return (coarsest, *dict.fromkeys(period for period in finer if period < coarsest))


def _axis_patterns(recipe: Recipe, axis: Axis, extent: int) -> list[Pattern]:
    """Fringes of one axis, coarse to fine, and the code of the coarsest's orders."""
    periods = _periods(recipe, extent)
    shifts = paired_shifts() if recipe.paired else equal_shifts(recipe.steps)
    patterns: list[Pattern] = [Fringe(axis, period, shifts) for period in periods]
    if recipe.code != "none" and periods[0] < COARSEST_SHARE * extent:
        patterns.append(_code(recipe, axis, extent, periods[0]))
    return patterns


def _code(recipe: Recipe, axis: Axis, extent: int, period_px: float) -> Pattern:
    """What tells the orders of fringes of this period."""
    count = len(fringe_orders(extent, period_px))
    match recipe.code:
        case "staircase":
            return Staircase(axis, period_px, count, equal_shifts(STAIR_STEPS))
        case "colour":
            letters = unique_sequence(len(PALETTE), count)
            return Colour(axis, period_px, tuple(PALETTE[letter] for letter in letters))
        case _:
            return GrayCode(
                axis,
                bits=gray_bits(extent, period_px),
                cell_px=period_px,
                inverted=recipe.inverted,
                complementary=recipe.code == "complementary",
            )


def _periods(recipe: Recipe, extent: int) -> tuple[float, ...]:
    """Periods along an axis, projector px, coarse to fine."""
    return tuple(sorted(recipe.periods_px, reverse=True)) or frequency_ladder(extent)


def _code_frame(recipe: Recipe, axis: Axis, extent: int) -> list[Pattern]:
    """The code frame of the coarsest fringes' orders, if the recipe has codewords."""
    if not recipe.codewords_px:
        return []
    return [make_code_frame(recipe.codewords_px, axis, _periods(recipe, extent)[0], extent)]


def _projected_board(recipe: Recipe, shorter_side: int) -> list[Pattern]:
    """The checkerboard, if the recipe has one; whole pixels, so that no edge meets a centre."""
    if not recipe.squares_across:
        return []
    return [Checkerboard(float(max(1, round(shorter_side / recipe.squares_across))))]


def _check_axes(axes: tuple[Axis, ...]) -> None:
    usable = len(axes) > 0 and len(set(axes)) == len(axes) and set(axes) <= set(AXES)
    require(usable, "axes", expected="x, y or both, each once", actual=axes)


def _check_recipe(recipe: Recipe, *, periods_given: bool) -> None:
    least, most = STEPS_RANGE
    steps, periods = recipe.steps, recipe.periods_px
    require(least <= steps <= most, "steps", expected=f"{least} to {most}", actual=steps)
    fitting = not recipe.paired or steps == len(paired_shifts())
    require(fitting, "steps", expected="6 of preset double-three-step", actual=steps)
    codes = get_args(Code)
    require(recipe.code in codes, "code", expected=f"one of {', '.join(codes)}", actual=recipe.code)
    sampled = all(SHORTEST_PERIOD_PX <= period < math.inf for period in periods)
    distinct = len(set(periods)) == len(periods) and len(periods) >= periods_given
    require(
        sampled and distinct,
        "periods_px",
        expected="different periods of at least 2 px, one or more",
        actual=periods,
    )


def _check_guard(periods_px: tuple[float, ...], extent: int) -> None:
    """Without a code the coarsest period itself must not wrap inside the image."""
    least = round(COARSEST_SHARE * extent, 2)
    coarsest = max(periods_px)
    require(
        coarsest >= least,
        "the coarsest of periods_px",
        expected=f"at least {least:g} px, {COARSEST_SHARE} times the axis' {extent} px",
        actual=f"{coarsest:g}",
    )
