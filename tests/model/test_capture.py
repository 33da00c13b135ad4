"""The white and the black of a capture, whatever else it holds."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.model import Capture, PatternSet, Sensor, Sequence, Uniform


def capture_of(*sets: tuple[float, int, str | None]) -> Capture:
    """Uniform sets of level, grey level and group."""
    return Capture(
        sequence=Sequence(8, 8, tuple(PatternSet(Uniform(s[0]), group=s[2]) for s in sets)),
        frames=tuple(np.full((1, 2, 3), s[1], np.uint8) for s in sets),
        sensor=Sensor(255.0),
    )


@pytest.mark.parametrize(
    ("levels", "white", "black"),
    [
        ((1.0, 0.0), 10, 11),
        ((0.0, 1.0), 11, 10),
        ((0.9, 1.0, 0.1, 0.0), 11, 13),
        ((0.5,), None, None),
        ((0.6, 0.7), 11, None),
        ((), None, None),
    ],
)
def test_white_is_the_brightest_above_half_black_the_darkest_below(
    levels: tuple[float, ...], white: int | None, black: int | None
) -> None:
    capture = capture_of(*((level, 10 + place, None) for place, level in enumerate(levels)))
    for found, expected in ((capture.white(), white), (capture.black(), black)):
        assert (found is None) == (expected is None)
        if found is not None:
            np.testing.assert_array_equal(found, np.full((2, 3), expected, np.float32))
            assert found.dtype == np.float32


def test_repeats_of_white_are_averaged() -> None:
    capture = Capture(
        sequence=Sequence(8, 8, (PatternSet(Uniform(1.0), repeats=2),)),
        frames=(np.stack([np.full((2, 3), grey, np.uint8) for grey in (100, 103)]),),
        sensor=Sensor(255.0),
    )
    np.testing.assert_array_equal(capture.white(), np.full((2, 3), 101.5))


def test_a_group_has_its_own_white_and_colour_stays_with_the_set_it_belongs_to() -> None:
    colour = np.zeros((2, 3, 3), np.uint8)
    capture = capture_of((0.9, 200, "a"), (1.0, 50, "b"), (0.0, 7, None))
    object.__setattr__(capture, "colour", colour)
    first, second = capture.select("a"), capture.select("b")
    for chosen, grey in ((first, 200), (second, 50)):
        white = chosen.white()
        assert white is not None
        assert white[0, 0] == grey
    assert first.colour is None  # the colour is that of the brightest, which is b's
    assert second.colour is colour
