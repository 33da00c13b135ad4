"""A study: whole loops repeated many times, told as a table, sentences, numbers and a picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from matplotlib.figure import Figure

from fringeworks.model import Progress


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """What a study has found.

    Attributes
    ----------
    title
        What was done, in one line.
    head, rows
        The table, as text.
    notes
        Sentences that belong to the table: what its words mean, what it does not say.
    numbers
        Everything in plain values: what the table was made from.
    draw
        Makes the picture.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]
    numbers: Mapping[str, Any]
    draw: Callable[[], Figure]


class StudyMaker(Protocol):
    """Makes a study."""

    def __call__(
        self, folder: Path, *, seeds: int | None, quick: bool, progress: Progress
    ) -> Study:
        """Repeat it `seeds` times, or as often as it stands for.

        What each repetition has found is kept in `folder` and used again: a long study may be cut
        off. With `quick` it is as small as can be, and only shows that it runs.
        """
