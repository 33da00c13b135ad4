"""A preset at several exposures: all sets at each, under names that say which."""

from __future__ import annotations

from itertools import chain

import pytest

from fringeworks.errors import UsageError
from fringeworks.model import PatternSet, Sequence, Uniform
from fringeworks.patterns import expose_repeatedly, frame_names, make_sequence

ONCE = make_sequence("measure", width=64, height=48)


def test_all_sets_at_each_exposure_in_turn() -> None:
    ladder = expose_repeatedly(ONCE, (2.0, 0.5))
    count = len(ONCE.sets)
    assert [item.exposure_ms for item in ladder.sets] == [2.0] * count + [0.5] * count
    assert [item.pattern for item in ladder.sets] == [item.pattern for item in ONCE.sets] * 2
    assert ladder.reference_ms == 2.0
    assert ONCE.reference_ms is None


def test_names_say_the_exposure() -> None:
    names = frame_names(expose_repeatedly(ONCE, (2.0, 0.5)))
    every = list(chain(*names))
    assert len(set(every)) == len(every)
    assert names[0][0] == "fringe_x_p16_2ms_0.png"
    assert names[-1] == ("black_0.5ms.png",)


def test_one_exposure_keeps_its_names() -> None:
    assert frame_names(expose_repeatedly(ONCE, (2.0,))) == frame_names(ONCE)
    assert expose_repeatedly(ONCE, (2.0,)).reference_ms is None


def test_sets_of_other_groups_are_no_exposures() -> None:
    """Of alternatives the first counts: two exposures in two groups are not fused."""
    sets = tuple(
        PatternSet(Uniform(1.0), group=group, exposure_ms=exposure_ms)
        for group, exposure_ms in (("short", 1.0), ("long", 8.0))
    )
    assert Sequence(64, 48, sets).reference_ms is None


@pytest.mark.parametrize("exposures_ms", [(), (0.0,), (-1.0, 2.0), (float("inf"),), (2.0, 2.0)])
def test_refused(exposures_ms: tuple[float, ...]) -> None:
    with pytest.raises(UsageError, match="one or more different times above 0 ms, got"):
        expose_repeatedly(ONCE, exposures_ms)
