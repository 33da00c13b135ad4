"""A diagnosis in plain values, its pictures, and its page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from fringeworks.diagnose import Diagnosis, Found
from fringeworks.report.blocks import Number, Numbers, Page, Picture, Section, Table, Text, Verdict
from fringeworks.report.canvas import Shade, map_figure, save_figures
from fringeworks.report.findings import cost_words, summarise_finding
from fringeworks.report.page import write_page


def summarise_diagnosis(found: Diagnosis) -> dict[str, Any]:
    """Findings, the costliest first."""
    return {
        "capture": found.name,
        "clean": not found.found,
        "mm_per_px": found.mm_per_px,
        "findings": [summarise_finding(finding) for finding in found.findings],
        "not_looked_for": list(found.unseen),
    }


def draw_diagnosis(found: Diagnosis) -> Iterator[tuple[str, Figure]]:
    """File name and figure of each finding: ``1_gamma``, ``2_motion``."""
    for number, item in enumerate(found.found, start=1):
        yield f"{number}_{item.finding.name.replace(' ', '_')}", _draw(item)


def _draw(item: Found) -> Figure:
    title = f"{item.finding.name}: {item.finding.where}"
    return map_figure(item.picture, Shade(item.label, "cividis"), title)


def save_diagnosis(found: Diagnosis, folder: Path) -> list[Path]:
    """Draw a picture per finding into `folder`; returns their paths."""
    return save_figures(draw_diagnosis(found), folder)


def write_diagnosis_page(path: Path, found: Diagnosis) -> Path:
    """Write the diagnosis as one HTML page."""
    sections = [
        Section(
            f"{number}. {item.finding.name}",
            (
                Text(f"{item.finding.message}\n\n{item.finding.remedy}"),
                Numbers((Number("cost", cost_words(item.finding), item.finding.where),)),
                Picture(_draw(item), f"{item.label}.", f"Map of {item.label}"),
            ),
        )
        for number, item in enumerate(found.found, start=1)
    ]
    blocks = [_list(found), *sections, *_unseen(found)]
    return write_page(path, Page(f"Check of {found.name}", _lead(found), blocks))


def _lead(found: Diagnosis) -> str:
    if not found.found:
        return "Nothing is wrong with this capture as far as its frames can tell."
    unit = (
        f"Costs are errors of depth; a projector px is worth {found.mm_per_px:.2g} mm."
        if found.mm_per_px is not None
        else "Costs are errors of the projector coordinate; with a rig they would be mm."
    )
    return f"{len(found.found)} found, the costliest first. {unit}"


def _list(found: Diagnosis) -> Section:
    rows = [(item.name, cost_words(item), item.where) for item in found.findings]
    verdicts = [Verdict("bad" if not n else "doubtful", "look here") for n in range(len(rows))]
    if not rows:
        return Section("Findings", (Text("None."),))
    return Section("Findings", (Table(("fault", "cost", "where"), rows, (1,), verdicts),))


def _unseen(found: Diagnosis) -> Iterator[Section]:
    if found.unseen:
        rows = [(reason,) for reason in found.unseen]
        yield Section("What could not be looked for", (Table(("checks, and why",), rows),))
