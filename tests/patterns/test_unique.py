"""Sequences whose neighbours say where they are."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fringeworks.patterns.unique import unique_sequence, window_of


def test_windows_by_hand() -> None:
    assert [window_of(6, length) for length in (1, 6, 7, 36, 37)] == [1, 1, 2, 2, 3]


def test_a_short_one_by_hand() -> None:
    """Prefer the greater: 1 1 0 0 follows 0 0 and has the windows 11, 10, 00, and 01 before."""
    assert unique_sequence(2, 4) == (1, 1, 0, 0)


@given(letters=st.integers(2, 7), length=st.integers(1, 300))
def test_no_window_occurs_twice(letters: int, length: int) -> None:
    sequence, window = unique_sequence(letters, length), window_of(letters, length)
    windows = [sequence[i : i + window] for i in range(length - window + 1)]
    assert len(sequence) == length
    assert set(sequence) <= set(range(letters))
    assert len(set(windows)) == len(windows)


def test_one_letter_has_nothing_to_tell() -> None:
    assert unique_sequence(1, 3) == (0, 0, 0)
