"""File names: what they say, one for each image and none twice."""

from __future__ import annotations

from itertools import chain
from typing import get_args

from hypothesis import given
from hypothesis import strategies as st

from fringeworks.model import (
    Checkerboard,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Sequence,
    Speckle,
    Staircase,
    Uniform,
)
from fringeworks.patterns import Preset, equal_shifts, frame_names, make_sequence

STEPS = equal_shifts(3)


def test_say_what_they_are() -> None:
    names = frame_names(make_sequence("paper", width=608, height=684, axes=("x",)))
    assert names == (
        ("fringe_x_p32_0.png", "fringe_x_p32_1.png", "fringe_x_p32_2.png"),
        ("gray_x_0.png", "gray_x_1.png", "gray_x_2.png", "gray_x_3.png", "gray_x_4.png",
         "gray_x_complementary.png"),
        ("codeword_x_p32.png",),
        ("white.png",),
        ("black.png",),
    )  # fmt: skip


def test_one_for_each_image_and_none_twice() -> None:
    fringe = PatternSet(Fringe("x", 32.0, STEPS), repeats=3)
    longer = PatternSet(Fringe("x", 32.0, STEPS), group="long", exposure_ms=40.0)
    others: tuple[Pattern, ...] = (
        GrayCode("y", 2, 512.0, True, True),
        Colour("x", 32.0, ("red",)),
        Staircase("x", 32.0, 20, STEPS),
        Checkerboard(16.0),
        Speckle(7, 3.0),
        Uniform(0.5),
        Uniform(1.0),
        Uniform(1.0),
    )
    sequence = Sequence(608, 684, (fringe, longer, *map(PatternSet, others)))
    names = frame_names(sequence)
    assert [len(stack) for stack in names] == [item.image_count for item in sequence.sets]
    every = list(chain(*names))
    assert len({name.lower() for name in every}) == len(every)
    assert names[0][:4] == (
        "fringe_x_p32_0_r0.png", "fringe_x_p32_0_r1.png", "fringe_x_p32_0_r2.png",
        "fringe_x_p32_1_r0.png",
    )  # fmt: skip
    assert names[1][0] == "fringe_x_p32_set1_0.png"
    assert names[2][3] == "gray_y_inverted_0.png"
    assert names[-2:] == (("white.png",), ("white_set9.png",))


@given(
    preset=st.sampled_from(get_args(Preset)),
    width=st.integers(2, 8192),
    height=st.integers(2, 8192),
)
def test_unique_in_every_preset(preset: Preset, width: int, height: int) -> None:
    names = list(chain(*frame_names(make_sequence(preset, width=width, height=height))))
    assert len(set(names)) == len(names)
