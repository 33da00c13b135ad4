"""Sequences in which a few neighbours are found nowhere else: de Bruijn's."""

from __future__ import annotations


def window_of(letters: int, length: int) -> int:
    """How many neighbours it takes to tell `length` places apart: letters^window >= length."""
    window = 1
    while letters**window < length:
        window += 1
    return window


def unique_sequence(letters: int, length: int) -> tuple[int, ...]:
    """The first `length` letters, 0 to `letters` - 1, of the shortest de Bruijn sequence.

    Any `window_of` neighbours occur once. The greatest letter that makes no window twice comes
    next (Martin 1934), from a window of zeros on, which is left out.
    """
    if letters < 2:
        return (0,) * length
    window = window_of(letters, length)
    sequence = [0] * window
    seen = {tuple(sequence)}
    while len(sequence) < length + window:
        tail = tuple(sequence[-window + 1 :]) if window > 1 else ()
        fresh = (letter for letter in reversed(range(letters)) if (*tail, letter) not in seen)
        letter = next(fresh, 0)
        seen.add((*tail, letter))
        sequence.append(letter)
    return tuple(sequence[window:])
