from __future__ import annotations

import math

import pytest

from fringeworks.cli.arguments import parse_numbers, parse_ranges, parse_size
from fringeworks.errors import UsageError

BOX = "X0:X1,Y0:Y1,Z0:Z1"


@pytest.mark.parametrize("text", ["608x684", " 608X684 ", "608 × 684"])
def test_a_size_is_width_then_height(text: str) -> None:
    assert parse_size(text) == (608, 684)


@pytest.mark.parametrize("text", ["", "608", "608x", "608x684x1", "6.5x7", "-6x7", "ax b"])
def test_what_is_no_size(text: str) -> None:
    with pytest.raises(UsageError, match="WIDTHxHEIGHT"):
        parse_size(text)


def test_ranges() -> None:
    ranges = parse_ranges("-100:100,-5e1:.5,700:900", option="--box", form=BOX)
    assert ranges == ((-100, 100), (-50, 0.5), (700, 900))


def test_an_empty_end_is_open() -> None:
    ranges = parse_ranges(":,:-3,700:", option="--box", form=BOX)
    assert ranges == ((-math.inf, math.inf), (-math.inf, -3), (700, math.inf))


@pytest.mark.parametrize(
    "text", ["", "1:2", "1:2,3:4", "1:2,3:4,5", "1:2,3:4,a:b", "1:2:3,4:5,6:7"]
)
def test_what_is_no_box(text: str) -> None:
    with pytest.raises(UsageError, match="--box must be X0:X1,Y0:Y1,Z0:Z1, got"):
        parse_ranges(text, option="--box", form=BOX)


@pytest.mark.parametrize("text", ["2:1", "1:1", "nan:2", "inf:"])
def test_a_range_rises(text: str) -> None:
    with pytest.raises(UsageError, match="must rise"):
        parse_ranges(text, option="--z-range", form="MIN:MAX")


def test_numbers() -> None:
    assert parse_numbers("32", option="--periods") == (32.0,)
    assert parse_numbers("2, 3,4.5", option="--periods") == (2.0, 3.0, 4.5)
    assert parse_numbers("none", option="--codewords") == ()
    with pytest.raises(UsageError, match="--periods must be numbers"):
        parse_numbers("2,,3", option="--periods")
