"""The reproduction as a page, as Markdown, and in plain values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fringeworks.experiments.paper.chapter import Chapter, Grid, Row
from fringeworks.report.blocks import (
    Block,
    CloudView,
    Details,
    Gallery,
    Page,
    Picture,
    Section,
    Table,
    Text,
)
from fringeworks.report.canvas import save_figure

TITLE = "The paper on the digital twin"
LEAD = (
    'Sensors 2016, "A Flexible Fringe Projection Vision System with Extended Mathematical Model '
    'for Accurate Three-Dimensional Measurement": its figures 1 to 14, its Table 1 and every '
    "number it reports, beside ours. Its instrument is simulated; the true scene is known, and "
    "the readers of its captures are those of every other command."
)
HEAD = ("quantity", "paper", "ours", "note")


def make_page(chapters: Mapping[str, Chapter], *, figures: Path) -> Page:
    """The report; its figures are written into `figures` as PNG files too."""
    sections = [Section("All numbers beside the paper's", [Text(LEAD), _overview(chapters)])]
    sections += [Section(one.heading, _blocks(one, figures)) for one in chapters.values()]
    values = {name: one.numbers for name, one in chapters.items()}
    sections.append(Section("All values", [Details("numbers", values)]))
    return Page(title=TITLE, lead="", sections=sections)


def _overview(chapters: Mapping[str, Chapter]) -> Table:
    """Rows for which the paper has a number."""
    rows = [_cells(row) for one in chapters.values() for row in one.rows if row.paper]
    return Table(HEAD, rows, numbers=(1, 2))


def _blocks(chapter: Chapter, figures: Path) -> list[Block]:
    blocks: list[Block] = [Text(chapter.words)]
    if chapter.rows:
        blocks.append(Table(HEAD, [_cells(row) for row in chapter.rows], numbers=(1, 2)))
    blocks += [CloudView(cloud, caption) for cloud, caption in chapter.clouds]
    pictures = [
        Picture(save_figure(one.figure, figures / f"{one.name}.png"), one.caption, one.caption)
        for one in chapter.pictures
    ]
    blocks += [Gallery(pictures)] if len(pictures) > 1 else pictures
    return blocks + [_table(grid) for grid in chapter.grids]


def _table(grid: Grid) -> Table:
    return Table(grid.head, grid.rows, numbers=range(1, len(grid.head)), caption=grid.caption)


def _cells(row: Row) -> tuple[str, str, str, str]:
    return row.quantity, row.paper, row.ours, row.note


def write_markdown(chapters: Mapping[str, Chapter]) -> str:
    """The chapters' words and tables, without figures, as Markdown."""
    parts = [f"# {TITLE}", LEAD]
    for one in chapters.values():
        parts += [f"## {one.heading}", one.words]
        if one.rows:
            parts.append(_markdown_table(HEAD, map(_cells, one.rows)))
        for grid in one.grids:
            parts += [f"{grid.caption}:", _markdown_table(grid.head, grid.rows)]
    return "\n\n".join(parts) + "\n"


def compare_to_paper(chapters: Mapping[str, Chapter]) -> str:
    """The rows for which the paper has a number, as a Markdown table."""
    rows = (_cells(row) for one in chapters.values() for row in one.rows if row.paper)
    return _markdown_table(HEAD, rows)


def _markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    if head == HEAD:
        lines[1] = ["---", "---:", "---:", "---"]
    return "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines)


def plain_values(chapters: Mapping[str, Chapter]) -> dict[str, Any]:
    """Everything by chapter: rows as text, numbers as they are."""
    return {
        name: {
            "heading": one.heading,
            "rows": [dict(zip(HEAD, _cells(row), strict=True)) for row in one.rows],
            "figures": [picture.name for picture in one.pictures],
            "numbers": one.numbers,
        }
        for name, one in chapters.items()
    }
