"""What one part of the reproduction has found: rows beside the paper's numbers, figures, words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from matplotlib.figure import Figure

from fringeworks.model import Cloud


@dataclass(frozen=True, slots=True)
class Row:
    """A number beside the paper's.

    Attributes
    ----------
    quantity
        What it is, with the unit.
    paper, ours
        As text; empty where the paper gives none.
    note
        What to know before the two are compared.
    """

    quantity: str
    paper: str
    ours: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class Grid:
    """A table of a chapter's own: its first column names the row, all others are numbers."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A figure under a file's name without suffix, and what it shows."""

    name: str
    figure: Figure
    caption: str


@dataclass(frozen=True, slots=True, eq=False)
class Chapter:
    """A part of the paper, done.

    Attributes
    ----------
    heading
        With the paper's section or figures in it.
    words
        Paragraphs, an empty line between them.
    rows
        What the paper reports, beside ours.
    numbers
        Everything in plain values.
    """

    heading: str
    words: str
    rows: Sequence[Row] = ()
    grids: Sequence[Grid] = ()
    pictures: Sequence[Shown] = ()
    clouds: Sequence[tuple[Cloud, str]] = ()
    numbers: Mapping[str, Any] = field(default_factory=dict)
