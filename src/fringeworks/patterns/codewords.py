"""Code frames by name: the paper's, and two of our own.

`robust` is chosen for decoding along the known phase: of all six whole periods from 2 to 11 px, a
third of a fringe (longer ones look like the harmonics of a projector's gamma), the six whose two
most alike cosines differ most after a blur of 1.2 px: by 0.28 B^2, mean square, where the paper's
come to 0.0007. A spectrum cannot tell them apart: their frequencies are nearer
than one fringe resolves. `de-bruijn` has them in an order in which two neighbours (three, beyond 36
fringes) occur once, so that nothing need be known of where objects are.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

from fringeworks.model import Axis, Codeword
from fringeworks.model.sequence import fringe_orders
from fringeworks.patterns.unique import unique_sequence

CodewordsName: TypeAlias = Literal["paper", "robust", "de-bruijn"]
Codewords: TypeAlias = tuple[float, ...] | CodewordsName

PAPER_CODEWORDS_PX = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
ROBUST_CODEWORDS_PX = (6.0, 7.0, 8.0, 9.0, 10.0, 11.0)
DESIGN_PERIOD_PX = 32.0
"""Fringes for which the robust ones are chosen; for others they are as much longer or shorter."""


def make_code_frame(words: Codewords, axis: Axis, period_px: float, extent: int) -> Codeword:
    """The code frame of fringes along an axis of `extent` projector px."""
    if words == "paper":
        return Codeword(axis, period_px, PAPER_CODEWORDS_PX)
    if not isinstance(words, str):
        return Codeword(axis, period_px, words)
    scaled = tuple(word * period_px / DESIGN_PERIOD_PX for word in ROBUST_CODEWORDS_PX)
    if words == "robust":
        return Codeword(axis, period_px, scaled)
    count = len(fringe_orders(extent, period_px))
    return Codeword(axis, period_px, scaled, unique_sequence(len(scaled), count))
