"""An advice in sentences, command lines, plain values, pictures, and as a page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from fringeworks.diagnose.advice import Advice
from fringeworks.diagnose.advice_complaints import Complaint
from fringeworks.diagnose.advice_steps import USUAL_GAMMA
from fringeworks.patterns import explain_steps
from fringeworks.report.blocks import Number, Numbers, Page, Picture, Section, Text
from fringeworks.report.canvas import Shade, map_figure, save_figures
from fringeworks.report.findings import summarise_finding
from fringeworks.report.page import write_page

SOME_GAMMA = 0.1
"""Off one by less, an exponent is no gamma that anybody set."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """What is proposed, and why."""

    name: str
    value: str
    reason: str


def proposals_of(found: Advice) -> list[Proposal]:
    """Exposures, period and steps in words."""
    return [_exposures(found), _period(found), _steps(found)]


def commands_of(found: Advice) -> list[str]:
    """The next command lines."""
    exposures = ",".join(f"{ms:g}" for ms in found.ladder.exposures_ms)
    options = f"--periods {found.period_px:g} --steps {found.steps.steps}"
    if exposures:
        options += f" --exposures {exposures}"
    size = f"{found.width}x{found.height}"
    lines = [f"fringeworks patterns measure --projector {size} {options} --out patterns/"]
    if any(item.name in {"gloss", "range", "saturation", "too dark"} for item in found.complaints):
        lines.append(f"fringeworks patterns test --projector {size} --out test/")
    return lines


def summarise_advice(found: Advice) -> dict[str, Any]:
    """All of it in plain values."""
    return {
        "capture": found.name,
        "exposures_ms": list(found.ladder.exposures_ms) or None,
        "exposure_factors": list(found.ladder.factors),
        "coverage": found.ladder.coverage,
        "coverage_of_test": found.ladder.covered_before,
        "in_step_with_mains": found.ladder.in_step,
        "blur_px": {axis: blur.sigma_px for axis, blur in found.blurs.items()},
        "best_period_px": {axis: blur.best_period_px for axis, blur in found.blurs.items()},
        "period_px": found.period_px,
        "noise_loss": found.noise_loss,
        "steps": found.steps.steps,
        "steps_by_noise": found.steps.by_noise,
        "steps_by_harmonics": found.steps.by_harmonics,
        "gamma": found.steps.gamma,
        "sigma_px": found.steps.reached_px,
        "wanted_sigma_px": found.steps.wanted_px,
        "change": [summarise_finding(item.finding) for item in found.complaints],
        "commands": commands_of(found),
    }


def draw_advice(found: Advice) -> Iterator[tuple[str, Figure]]:
    """File name and figure: exposures, the blur of each axis, each complaint."""
    yield "exposures", _draw_sight(found)
    for axis, blur in found.blurs.items():
        shade = Shade("blur, projector px, 1 sd", "cividis")
        yield f"blur_{axis}", map_figure(blur.picture, shade, f"blur along {axis}")
    for number, item in enumerate(found.complaints, start=1):
        yield f"change_{number}_{item.name.replace(' ', '_')}", _draw_complaint(item)


def save_advice(found: Advice, folder: Path) -> list[Path]:
    """Draw the pictures into `folder`; returns their paths."""
    return save_figures(draw_advice(found), folder)


def write_advice_page(path: Path, found: Advice) -> Path:
    """Write the advice as one HTML page."""
    proposals = proposals_of(found)
    numbers = Numbers([Number(item.name, item.value, item.reason) for item in proposals])
    changes = [
        Section(
            f"Change: {item.name}",
            (
                Text(f"{item.message}\n\n{item.remedy}"),
                Picture(_draw_complaint(item), f"{item.label}.", f"Map of {item.label}"),
            ),
        )
        for item in found.complaints
    ]
    pictures = [
        Picture(figure, f"{name.replace('_', ' ')}.", f"Map of {name.replace('_', ' ')}")
        for name, figure in draw_advice(found)
        if not name.startswith("change")
    ]
    sections = [
        Section("Take", (numbers, Text("\n\n".join(commands_of(found))))),
        *changes,
        Section("What the test frames show", pictures),
    ]
    return write_page(path, Page(f"Advice from {found.name}", _lead(found), sections))


def _lead(found: Advice) -> str:
    count = len(found.complaints)
    change = f"{count} to change before." if count else "Nothing has to be changed."
    return f"{found.ladder.coverage:.1%} of the lit pixels would be seen. {change}"


def _exposures(found: Advice) -> Proposal:
    ladder = found.ladder
    if ladder.exposures_ms:
        value = ", ".join(f"{ms:g}" for ms in ladder.exposures_ms) + " ms"
    else:
        value = ", ".join(f"{factor:.3g}" for factor in ladder.factors) + " times the test's"
    if not ladder.factors:
        value = "none"
    reason = (
        f"{ladder.coverage:.1%} of the lit pixels seen, {ladder.covered_before:.1%} in the test"
    )
    if ladder.factors and not ladder.exposures_ms:
        reason += "; --exposure-ms, that of the test, tells ms"
    if ladder.in_step:
        reason += ", whole half periods of the mains"
    elif any(item.name == "flicker" for item in found.complaints):
        reason += ", no whole half periods of the mains: those "
        reason += "are too bright" if ladder.exposures_ms else "need the test's exposure in ms"
    return Proposal("exposure", value, reason)


def _period(found: Advice) -> Proposal:
    value = f"{found.period_px:g} px"
    if not found.blurs or found.noise_loss is None:
        return Proposal("period", value, "preset measure's: no fringes fine enough tell the blur")
    widest = max(found.blurs.values(), key=lambda blur: blur.sigma_px)
    reason = (
        f"blur {widest.sigma_px:.2f} px along {widest.axis}, least noise at "
        f"{widest.best_period_px:.1f} px, {found.noise_loss:.0%} more at this even number"
    )
    return Proposal("period", value, reason)


def _steps(found: Advice) -> Proposal:
    steps = found.steps
    reason = (
        f"sigma {steps.reached_px:.3f} px of {steps.wanted_px:g} wanted (noise asks for "
        f"{steps.by_noise}, harmonics for {steps.by_harmonics}); {explain_steps(steps.steps)}"
    )
    if steps.gamma is None:
        reason += f"; gamma not seen, taken as {USUAL_GAMMA}"
    elif abs(steps.gamma - 1) > SOME_GAMMA:
        reason += f"; gamma {steps.gamma:.2f}"
    return Proposal("steps", str(steps.steps), reason)


def _draw_sight(found: Advice) -> Figure:
    times = found.ladder.exposures_ms or found.ladder.factors
    unit = "ms" if found.ladder.exposures_ms else "times"
    ticks = {0.0: "none"} | {
        float(number): f"{time:.3g} {unit}" for number, time in enumerate(times, start=1)
    }
    shade = Shade("exposure", "cividis", (0.0, float(max(len(times), 1))), ticks=ticks)
    return map_figure(found.sight, shade, "the exposure that sees each pixel best")


def _draw_complaint(item: Complaint) -> Figure:
    picture = np.asarray(item.picture)
    return map_figure(picture, Shade(item.label, "cividis"), f"{item.name}: {item.where}")
