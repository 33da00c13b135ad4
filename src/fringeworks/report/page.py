"""A report as one HTML file that needs nothing else: figures, style and scripts are inside it.

A page is described by the nouns of `fringeworks.report.blocks` and written in one go. It asks for
no file and no network (its content security policy forbids it), and adapts to light and dark, to
print and to a telephone.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from fringeworks import __version__
from fringeworks.errors import FormatError
from fringeworks.files.atomic import write_text
from fringeworks.report.blocks import (
    Block,
    CloudView,
    Details,
    Gallery,
    Number,
    Numbers,
    Page,
    Picture,
    Section,
    Table,
    Text,
    Verdict,
)
from fringeworks.report.canvas import save_png
from fringeworks.report.cloud import DEPTH
from fringeworks.report.solid import draw_solid
from fringeworks.report.viewer import write_viewer

SIGNS = {"good": "✓", "doubtful": "!", "bad": "✗"}
"""A verdict is told by sign and word; its colour only repeats it."""

FEWEST_LISTED = 3
"""Sections from which on a page begins with a list of them."""

HEAVY_BYTES = 300_000
"""A PNG above this, which is noise that PNG cannot pack, is inlined as WebP, a fifth of it."""

WEBP_QUALITY = 90

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def write_page(path: Path, page: Page) -> Path:
    """Write a page as one HTML file, whole or not at all; returns its path.

    Raises
    ------
    FormatError
        The file cannot be written, or a picture not be read.
    UsageError
        A cloud has no points.
    ValueError
        A value of `Details` is unknown to JSON, as NaN is.
    """
    write_text(path, render_page(page))
    return path


def render_page(page: Page) -> str:
    """The page as text."""
    sections = list(enumerate(page.sections, start=1))
    parts = (
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,">',
        f"<title>{escape(page.title)}</title><style>{_packaged('page.css')}</style></head><body>",
        f"<header><h1>{_inline(page.title)}</h1>{_paragraphs(page.lead)}</header>",
        _contents(page.sections),
        "<main>",
        *(_section(number, section) for number, section in sections),
        f"</main><footer>Made by fringeworks {__version__}.</footer>",
        _script() if any(map(_has_cloud, page.sections)) else "",
        "</body></html>",
    )
    return "\n".join(filter(None, parts)) + "\n"


def _packaged(name: str) -> str:
    return files("fringeworks.report").joinpath(name).read_text(encoding="utf-8")


def _script() -> str:
    """Both files in one block, which keeps their names to themselves."""
    return (
        f'<script>"use strict";\n{{\n{_packaged("surface.js")}\n{_packaged("viewer.js")}}}</script>'
    )


def _has_cloud(section: Section) -> bool:
    return any(isinstance(block, CloudView) for block in section.blocks)


def _contents(sections: Sequence[Section]) -> str:
    if len(sections) < FEWEST_LISTED:
        return ""
    links = (
        f'<li><a href="#s{number}">{_inline(section.heading)}</a></li>'
        for number, section in enumerate(sections, start=1)
    )
    return f'<nav aria-label="Contents"><ol>{"".join(links)}</ol></nav>'


def _section(number: int, section: Section) -> str:
    blocks = "\n".join(_block(block) for block in section.blocks)
    heading = f'<h2 id="h{number}">{_inline(section.heading)}</h2>'
    return f'<section id="s{number}" aria-labelledby="h{number}">{heading}\n{blocks}</section>'


def _block(block: Block) -> str:
    match block:
        case Text():
            return _paragraphs(block.words)
        case Numbers():
            return f'<dl class="numbers">{"".join(map(_number, block.items))}</dl>'
        case Table():
            return _table(block)
        case Picture():
            return _picture(block)
        case Gallery():
            return _gallery(block)
        case CloudView():
            still = _image(_png(draw_solid(block.cloud, DEPTH)), block.caption)
            return write_viewer(block, still)
        case Details():
            values = json.dumps(block.values, indent=2, ensure_ascii=False, allow_nan=False)
            return (
                f"<details><summary>{_inline(block.title)}</summary>"
                f'<pre tabindex="0">{escape(values)}</pre></details>'
            )


def _inline(words: str) -> str:
    return re.sub("`([^`]+)`", r"<code>\1</code>", escape(words))


def _paragraphs(words: str) -> str:
    return "".join(
        f"<p>{_inline(part.strip())}</p>" for part in words.split("\n\n") if part.strip()
    )


def _verdict(verdict: Verdict | None) -> str:
    if verdict is None:
        return ""
    sign = f'<span aria-hidden="true">{SIGNS[verdict.grade]}</span>'
    return f'<span class="verdict {verdict.grade}">{sign} {_inline(verdict.words)}</span>'


def _number(number: Number) -> str:
    beside = f'<dd class="beside">{_inline(number.beside)}</dd>' if number.beside else ""
    verdict = f"<dd>{_verdict(number.verdict)}</dd>" if number.verdict else ""
    value = f'<dd class="value">{_inline(number.value)}</dd>'
    return f"<div><dt>{_inline(number.name)}</dt>{value}{beside}{verdict}</div>"


def _table(table: Table) -> str:
    judged = bool(table.verdicts)
    aligned = [' class="number"' if i in table.numbers else "" for i in range(len(table.head))]
    head = "".join(
        f'<th scope="col"{align}>{_inline(cell)}</th>'
        for cell, align in zip(table.head, aligned, strict=True)
    ) + ('<th scope="col">verdict</th>' if judged else "")
    rows = []
    for row, verdict in zip(table.rows, table.verdicts or [None] * len(table.rows), strict=True):
        first = f'<th scope="row"{aligned[0]}>{_inline(row[0])}</th>'
        cells = (
            f"<td{a}>{_inline(cell)}</td>" for cell, a in zip(row[1:], aligned[1:], strict=True)
        )
        last = f"<td>{_verdict(verdict)}</td>" if judged else ""
        rows.append(f"<tr>{first}{''.join(cells)}{last}</tr>")
    caption = f"<caption>{_inline(table.caption)}</caption>" if table.caption else ""
    name = escape(table.caption or table.head[0])
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{name}"><table>{caption}'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _picture(picture: Picture, attributes: str = "") -> str:
    image = _image(_png(picture.source), picture.alt)
    caption = f"<figcaption>{_inline(picture.caption)}</figcaption>"
    return f"<figure{attributes}>{image}{caption}</figure>"


def _gallery(gallery: Gallery) -> str:
    """Pictures that take the whole width while they have the focus: a click enlarges."""
    attributes = ' tabindex="0" title="click to enlarge"'
    pictures = "".join(_picture(picture, attributes) for picture in gallery.pictures)
    return f'<div class="gallery">{pictures}</div>'


def _image(png: bytes, alt: str) -> str:
    """With width and height, which every PNG says first: nothing jumps while a page builds up."""
    width, height = (int.from_bytes(png[place : place + 4], "big") for place in (16, 20))
    kind, packed = ("png", png) if len(png) <= HEAVY_BYTES else ("webp", _webp(png))
    data = b64encode(packed).decode("ascii")
    size = f'width="{width}" height="{height}"'
    return f'<img {size} alt="{escape(alt)}" src="data:image/{kind};base64,{data}">'


def _webp(png: bytes) -> bytes:
    memory = BytesIO()
    Image.open(BytesIO(png)).convert("RGBA").save(memory, "WEBP", quality=WEBP_QUALITY)
    return memory.getvalue()


def _png(source: Figure | Path) -> bytes:
    if isinstance(source, Figure):
        memory = BytesIO()
        save_png(source, memory)
        return memory.getvalue()
    try:
        png = source.read_bytes()
    except OSError as error:
        raise FormatError(f"{source}: cannot be read ({error.strerror or error})") from error
    if not png.startswith(b"\x89PNG\r\n\x1a\n") or len(png) < 24:
        raise FormatError(f"{source}: must be a PNG picture, got something else")
    return png
