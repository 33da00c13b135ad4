"""The corner code: every number is read again, and nothing else passes for one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.errors import UsageError
from fringeworks.patterns.corner_code import (
    CELLS,
    CORNERS,
    NUMBERS,
    CornerCode,
    cells_of,
    number_of,
)


def pairs_of(number: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return cells_of(number)[::2]


@given(st.integers(0, 10_000))
def test_numbers_come_back(number: int) -> None:
    assert number_of(pairs_of(number)) == number % NUMBERS


def test_the_number_five_by_hand() -> None:
    """Gray code of 5: 111, weights 1, 2, 3 together 0; the first pair stands before them."""
    pairs = [True, True, True, True, *[False] * 5, False, False, False]
    assert pairs_of(5).tolist() == pairs
    assert cells_of(5)[:4].tolist() == [True, False, True, False]
    assert cells_of(5)[8:10].tolist() == [False, True]


def test_every_number_sends_out_the_same_light() -> None:
    assert {int(cells_of(number).sum()) for number in range(NUMBERS)} == {CELLS // 2}


def test_one_wrong_pair_is_no_number() -> None:
    for number in range(NUMBERS):
        for place in range(CELLS // 2):
            pairs = pairs_of(number).copy()
            pairs[place] = ~pairs[place]
            assert number_of(pairs) is None


@pytest.mark.parametrize("shape", [(48, 80), (48, 80, 3)])
def test_the_corners_alone_change(shape: tuple[int, ...]) -> None:
    """Cells of 4 px: 8 x 6 of them in each corner, the outer ones a black border."""
    code = CornerCode(80, 48)
    image = np.full(shape, 9, np.uint8)
    stamped = code.stamp(image, 3, white=200)
    outside = stamped == 9
    assert code.cell_px == 4
    assert (image == 9).all()
    assert (~outside).reshape(48, 80, -1)[:, :, 0].sum() == CORNERS * 32 * 24
    assert set(np.unique(stamped)) == {0, 9, 200}
    assert (stamped == 200).reshape(48, 80, -1)[:, :, 0].sum() == CORNERS * CELLS // 2 * 16
    for border in (stamped[20:24, :32], stamped[:24, 28:32], stamped[:4, :32], stamped[:24, 48:52]):
        assert not border.any()
    for first in (stamped[4:8, 4:8], stamped[4:8, 52:56], stamped[28:32, 4:8]):
        assert (first == 200).all()


def test_whole_corners() -> None:
    """With their borders: 32 x 24 px each."""
    filled = CornerCode(80, 48).fill(np.full((48, 80), 9, np.uint8), 255)
    assert (filled == 255).sum() == CORNERS * 32 * 24
    assert (filled[:24, :32] == 255).all()


@pytest.mark.parametrize(("inset", "left", "top"), [(1 / 8, 20, 12), (1 / 4, 40, 24), (1, 48, 24)])
def test_inside_the_image(inset: float, left: int, top: int) -> None:
    """Of 160 x 96 px; in the end the four touch in the middle."""
    filled = CornerCode(160, 96, inset).fill(np.zeros((96, 160), np.uint8), 255)
    rows, columns = np.flatnonzero(filled.any(axis=1)), np.flatnonzero(filled.any(axis=0))
    assert (columns[0], columns[-1]) == (left, 159 - left)
    assert (rows[0], rows[-1]) == (top, 95 - top)
    assert (filled == 255).sum() == CORNERS * 32 * 24


def test_cells_grow_with_the_projector() -> None:
    assert CornerCode(1920, 1080).cell_px == 17


def test_a_small_projector_is_refused() -> None:
    with pytest.raises(UsageError, match=r"projector must be 64x48 px or more for .*, got 64x47"):
        CornerCode(64, 47)
