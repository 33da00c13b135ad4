"""Uniform frames of many levels: for the response one of each, for the noise some of few."""

from __future__ import annotations

from fringeworks.model import PatternSet, Sequence, Uniform
from fringeworks.patterns.checks import check_projector

STEP = 5
"""Of 255: fifty-two levels, each a whole grey level of eight bits. A level that is rounded would
be off by up to 0.2 % of white, and the curve with it."""

NOISE_STEP = 17
"""Sixteen levels: the noise is a straight line of the level."""

NOISE_REPEATS = 4


def grey_levels(*, width: int, height: int) -> Sequence:
    """Levels from black to white in steps of 5 of 255, one frame each.

    Raises
    ------
    UsageError
        The projector's size is out of range.
    """
    return _levels(width, height, step=STEP)


def noise_levels(*, width: int, height: int) -> Sequence:
    """Levels from black to white in steps of 17 of 255, four images of each.

    Raises
    ------
    UsageError
        The projector's size is out of range.
    """
    return _levels(width, height, step=NOISE_STEP, repeats=NOISE_REPEATS)


def _levels(width: int, height: int, *, step: int, repeats: int = 1) -> Sequence:
    check_projector(width=width, height=height)
    levels = range(0, 256, step)
    sets = tuple(PatternSet(Uniform(level / 255), repeats=repeats) for level in levels)
    return Sequence(width, height, sets)
