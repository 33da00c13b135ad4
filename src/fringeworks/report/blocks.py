"""What a page is made of: frozen nouns, which `fringeworks.report.page` writes as HTML.

Between back-quotes, words of the caller are set as code; everything else in them is plain text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from matplotlib.figure import Figure

from fringeworks.errors import ShapeError
from fringeworks.model import Cloud


@dataclass(frozen=True, slots=True)
class Verdict:
    """How a number is judged, and by what, as "within 2 sigma"."""

    grade: Literal["good", "doubtful", "bad"]
    words: str


@dataclass(frozen=True, slots=True)
class Text:
    """Paragraphs, an empty line between them."""

    words: str


@dataclass(frozen=True, slots=True)
class Number:
    """A result worth a large print.

    Attributes
    ----------
    name, value
        What it is, and the number with its unit.
    beside
        What to hold it against, as "truth 52.500 mm".
    """

    name: str
    value: str
    beside: str = ""
    verdict: Verdict | None = None


@dataclass(frozen=True, slots=True)
class Numbers:
    """A row of results."""

    items: Sequence[Number]


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under a head; the first column names its row.

    Attributes
    ----------
    head
        Name of every column, with the unit.
    numbers
        Columns, from 0, that are set flush right.
    verdicts
        One per row, or none at all.

    Raises
    ------
    ShapeError
        A row has not as many cells as the head, or there are not as many verdicts as rows.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()
    verdicts: Sequence[Verdict | None] = ()
    caption: str = ""

    def __post_init__(self) -> None:
        for place, row in enumerate(self.rows):
            if len(row) != len(self.head):
                raise ShapeError(f"row {place} must be {len(self.head)} cells, got {len(row)}")
        if self.verdicts and len(self.verdicts) != len(self.rows):
            raise ShapeError(
                f"verdicts must be one per row, {len(self.rows)}, got {len(self.verdicts)}"
            )


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure or a PNG file.

    Attributes
    ----------
    alt
        What it shows, for those who cannot see it.
    """

    source: Figure | Path
    caption: str
    alt: str


@dataclass(frozen=True, slots=True)
class Gallery:
    """Pictures side by side where there is room."""

    pictures: Sequence[Picture]


@dataclass(frozen=True, slots=True)
class CloudView:
    """A cloud that can be turned.

    Attributes
    ----------
    cloud
        Organised, in its camera's frame. Points far outside the span of nearly all are left out.
    caption
        What is shown, for those too who cannot see it.
    """

    cloud: Cloud
    caption: str


@dataclass(frozen=True, slots=True)
class Details:
    """Plain values that unfold as JSON; NaN must be None already."""

    title: str
    values: Mapping[str, Any]


Block = Text | Numbers | Table | Picture | Gallery | CloudView | Details


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and what stands under it."""

    heading: str
    blocks: Sequence[Block]


@dataclass(frozen=True, slots=True)
class Page:
    """A report: title, what it says in a few sentences, sections."""

    title: str
    lead: str
    sections: Sequence[Section]
