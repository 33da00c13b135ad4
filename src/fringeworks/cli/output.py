"""Where words go: results to standard output, everything else to standard error.

With ``--json`` standard output holds one JSON object and nothing else.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

    from fringeworks.model import Finding

Item = TypeVar("Item")

JsonFlag = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output, nothing else.")
]


def print_error(message: str, *, label: str = "error: ") -> None:
    """One red line on standard error."""
    typer.secho(label + message, fg=typer.colors.RED, err=True)


def print_note(message: str) -> None:
    """A line on standard error that is no result."""
    typer.secho(message, fg=typer.colors.YELLOW, err=True)


class Output:
    """What one run of a verb prints."""

    def __init__(self, *, as_json: bool = False) -> None:
        self.as_json = as_json

    def line(self, text: str = "") -> None:
        """A line for a reader; silent with ``--json``."""
        if not self.as_json:
            typer.echo(text)

    def facts(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Names and values in two columns."""
        listed = list(pairs)
        width = max((len(name) for name, _ in listed), default=0)
        for name, value in listed:
            self.line(f"  {name:<{width}}  {value}")

    def table(
        self, head: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: Sequence[int] = ()
    ) -> None:
        """Rows under a head; columns of `numbers` to the right, the others to the left."""
        cells = [list(head), *(list(row) for row in rows)]
        widths = [max(len(row[column]) for row in cells) for column in range(len(head))]
        for row in cells:
            aligned = [
                f"{cell:>{width}}" if column in numbers else f"{cell:<{width}}"
                for column, (cell, width) in enumerate(zip(row, widths, strict=True))
            ]
            self.line("  " + "  ".join(aligned).rstrip())

    def findings(self, name: str, found: Iterable[Finding]) -> None:
        """What was noticed about the capture called `name`."""
        for finding in found:
            print_note(f"{name}: {finding}")

    def written(self, paths: Sequence[Path]) -> None:
        """Say which files there are now."""
        if len(paths) == 1:
            self.line(f"wrote {paths[0]}")
        elif paths:
            self.line(f"wrote {len(paths)} files in {paths[0].parent}")

    def result(self, values: Mapping[str, Any]) -> None:
        """The JSON object, if it was asked for."""
        if self.as_json:
            typer.echo(json.dumps(to_json(values), indent=2, allow_nan=False))

    @contextmanager
    def working(self) -> Iterator[Progress]:
        """Progress bars, and a word about kernels that are being compiled, while a verb works."""
        from fringeworks.cli.compiling import announced_compiling

        with announced_compiling(print_note), progress_bars() as progress:
            yield progress


class Progress:
    """Wraps a sequence and shows how far it is, one bar below the other."""

    def __init__(self, bars: Bars | None) -> None:
        self._bars = bars

    def __call__(self, items: Sequence[Item], description: str) -> Iterable[Item]:
        if self._bars is None:
            return items
        return self._bars.track(items, description=description)


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Bars on standard error where that is a terminal; they vanish at the end."""
    from rich.console import Console
    from rich.progress import Progress as Bars

    console = Console(stderr=True)
    if not console.is_terminal:
        yield Progress(None)
        return
    with Bars(console=console, transient=True) as bars:
        yield Progress(bars)


def to_json(value: Any) -> Any:
    """The same in values that JSON knows: NaN and infinity are null, paths are text."""
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(item) for item in value]
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def percent(share: float) -> str:
    """A share for a reader; what is not zero does not read so."""
    return f"{share:.1%}" if share == 0 or share >= 0.0005 else f"{100 * share:.1g}%"
