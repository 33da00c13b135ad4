"""Pictures of a response: the curve of a projector, or the error that phases have of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fringeworks.model import GreyCurve, ImageExponent, PhaseTerms, Response
from fringeworks.report.canvas import new_figure, save_figures, view_colours

HEIGHT_IN = 4.2
SAMPLES = 361
STYLES = ("-", "--", ":", "-.")


def save_response(response: Response, folder: Path) -> list[Path]:
    """Draw ``response.png`` into `folder`, of a curve ``response_regions.png`` too; the paths."""
    return save_figures(_draw(response), folder)


def _draw(response: Response) -> Iterator[tuple[str, Figure]]:
    match response.correction:
        case GreyCurve() as curve:
            yield "response", _draw_curve(curve)
            if curve.regions:
                yield "response_regions", _draw_regions(curve)
        case ImageExponent() as exponent:
            yield "response", _draw_exponent(exponent)
        case terms:
            yield "response", _draw_terms(terms)


def _draw_curve(curve: GreyCurve) -> Figure:
    figure = new_figure(HEIGHT_IN)
    axes = figure.add_subplot()
    levels = np.linspace(0, 1, SAMPLES)
    axes.plot(levels, levels, color="0.7", label="straight")
    axes.plot(levels, curve.light_of(levels), label="projector")
    axes.plot(levels, curve.level_of(levels), "--", label="level that makes this light")
    axes.plot(curve.levels, curve.light, ".", color="black", label="measured")
    axes.set_xlabel("level told to the projector, share of full scale")
    axes.set_ylabel("light, share of white")
    second, third = curve.harmonics
    axes.set_title(f"response: a2/a1 {second:.3f}, a3/a1 {third:.3f}", loc="left")
    axes.legend(frameon=False)
    return figure


def _draw_regions(curve: GreyCurve) -> Figure:
    figure = new_figure(HEIGHT_IN)
    axes = figure.add_subplot()
    whole = np.array(curve.light)
    for part, colour in zip(curve.regions, view_colours(len(curve.regions)), strict=True):
        name = f"rows {part.rows[0]}-{part.rows[1] - 1}, columns {part.columns[0]}-"
        off = 100 * (np.array(part.light) - whole)
        axes.plot(curve.levels, off, color=colour, label=f"{name}{part.columns[1] - 1}")
    axes.set_xlabel("level told to the projector, share of full scale")
    axes.set_ylabel("light less that of the whole field, % of white")
    axes.set_title("the response by parts of the camera's image", loc="left")
    figure.legend(loc="outside right upper", frameon=False, fontsize="small")
    return figure


def _draw_exponent(exponent: ImageExponent) -> Figure:
    figure = new_figure(HEIGHT_IN)
    axes = figure.add_subplot()
    levels = np.linspace(0, 1, SAMPLES)
    axes.plot(levels, levels, color="0.7", label="as seen")
    axes.plot(levels, levels**exponent.exponent, label=f"power {exponent.exponent:.3g}")
    axes.set_xlabel("grey level above black, share of full scale")
    axes.set_ylabel("straightened")
    before, after = exponent.before_rad, exponent.after_rad
    axes.set_title(f"error of the phase {before:.3f} rad rms, {after:.3f} with it", loc="left")
    axes.legend(frameon=False)
    return figure


def _draw_terms(terms: tuple[PhaseTerms, ...]) -> Figure:
    figure = new_figure(HEIGHT_IN)
    axes = figure.add_subplot()
    phase = np.linspace(-np.pi, np.pi, SAMPLES)
    for place, (item, colour) in enumerate(zip(terms, view_colours(len(terms)), strict=True)):
        name = f"{item.period_px:.4g} px along {item.axis}, {item.steps} steps"
        style = STYLES[place % len(STYLES)]  # two axes often have one error
        axes.plot(phase, item.error_at(phase)[0], style, color=colour, label=name)
    axes.set_xticks([-np.pi, 0, np.pi], ["-π", "0", "π"])
    axes.set_xlabel("wrapped phase as seen, rad")
    axes.set_ylabel("error of the phase, rad")
    axes.set_title("what the response makes of the phase", loc="left")
    figure.legend(loc="outside right upper", frameon=False)
    return figure
