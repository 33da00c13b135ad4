"""The few frames from which `fringeworks advise` tells how to take all others.

White and black give the light that there is. Eight steps of 64 px are blurred by nothing and show
the harmonics of the response; four steps of 16 and 4 px lose modulation to blur, those of 4 px also
where the projector resamples its image. Grey stripes, half as bright as black and white, leave a
projector that sharpens the room to overshoot at their edges.
"""

from __future__ import annotations

from fringeworks.model import AXES, Colour, Fringe, Pattern, PatternSet, Sequence, Uniform
from fringeworks.patterns.checks import check_sequence
from fringeworks.patterns.presets import equal_shifts

LONG_PERIOD_PX = 64.0
LONG_STEPS = 8
FINE_PERIODS_PX = (16.0, 4.0)
FINE_STEPS = 4

GREY_STRIPES = ("#404040", "#bfbfbf")
"""A quarter and three quarters of full scale."""


def probe_sequence(*, width: int, height: int) -> Sequence:
    """White, fringes of 64, 16 and 4 px along x, 16 and 4 px along y, grey stripes, black.

    Raises
    ------
    UsageError
        The projector's size is out of range.
    """
    fine = [
        Fringe(axis, period, equal_shifts(FINE_STEPS))
        for axis in AXES
        for period in FINE_PERIODS_PX
    ]
    patterns: tuple[Pattern, ...] = (
        Uniform(1.0),
        Fringe("x", LONG_PERIOD_PX, equal_shifts(LONG_STEPS)),
        *fine,
        Colour("x", LONG_PERIOD_PX, GREY_STRIPES),
        Uniform(0.0),
    )
    sequence = Sequence(width, height, tuple(map(PatternSet, patterns)))
    check_sequence(sequence)
    return sequence
