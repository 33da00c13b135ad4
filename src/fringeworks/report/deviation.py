"""A comparison in plain values, and its pictures: coloured map, histogram, page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fringeworks.measure.deviation import Deviations
from fringeworks.model import Cloud
from fringeworks.report.blocks import (
    Details,
    Number,
    Numbers,
    Page,
    Picture,
    Section,
    Table,
    Verdict,
)
from fringeworks.report.canvas import Shade, map_figure, new_figure, save_figures, signed_shade

SMALLEST_REACH = 1e-3
BINS = 80
QUANTILES = (2.5, 25.0, 50.0, 75.0, 97.5)
GREY_RGB = (150, 150, 150)


@dataclass(frozen=True, slots=True)
class Comparison:
    """A cloud held against a reference, with what both are called.

    Attributes
    ----------
    tolerance_mm
        Deviations up to this are within; None where nobody said.
    align_rms_mm
        What the registration left, None where the cloud was compared as it lies.
    """

    cloud: str
    reference: str
    found: Deviations
    tolerance_mm: float | None = None
    align_rms_mm: float | None = None


def summarise_comparison(compared: Comparison) -> dict[str, Any]:
    """Statistics of the signed deviations, mm, positive outside; units stand in the names."""
    found, values = compared.found, compared.found.values_mm
    quantiles = np.percentile(values, QUANTILES)
    tolerance = compared.tolerance_mm
    pose = found.reference_from_cloud
    return {
        "points": len(values),
        "mean_mm": float(values.mean()),
        "median_mm": float(quantiles[2]),
        "sd_mm": float(values.std()),
        "rms_mm": float(np.sqrt(np.mean(values**2))),
        "min_mm": float(values.min()),
        "max_mm": float(values.max()),
        "quantiles_mm": {f"p{q:g}": float(v) for q, v in zip(QUANTILES, quantiles, strict=True)},
        "band95_mm": float(quantiles[-1] - quantiles[0]),
        "noise_rms_mm": _noise(found),
        "tolerance_mm": tolerance,
        "within_share": None if tolerance is None else float(np.mean(np.abs(values) <= tolerance)),
        "beyond": found.beyond,
        "border": found.border,
        "align_rms_mm": compared.align_rms_mm,
        "reference_from_cloud": {
            "rotation": pose.rotation.tolist(),
            "translation_mm": pose.translation_mm.tolist(),
        },
    }


def _noise(found: Deviations) -> float | None:
    """Root mean square that the random parts alone would give; None where nobody knows them."""
    sigma = found.sigma_mm[np.isfinite(found.sigma_mm)].astype(np.float64)
    return float(np.sqrt(np.mean(sigma**2))) if sigma.any() else None


def save_comparison(compared: Comparison, folder: Path) -> list[Path]:
    """Draw ``deviation.png`` and ``histogram.png`` into `folder`; returns the paths."""
    return save_figures(draw_comparison(compared), folder)


def draw_comparison(compared: Comparison) -> Iterator[tuple[str, Figure]]:
    """Name and figure of the coloured map, where there is a grid, and of the histogram."""
    found = compared.found
    if min(found.deviation_mm.shape) > 1:
        title = f"{compared.cloud} against {compared.reference}: red is outside"
        yield "deviation", map_figure(found.deviation_mm, deviation_shade(compared), title)
    yield "histogram", _draw_histogram(compared)


def deviation_shade(compared: Comparison) -> Shade:
    """Colours of the deviations, the same to both sides."""
    values = np.abs(compared.found.values_mm)
    reach = compared.tolerance_mm or max(float(np.percentile(values, 99)), SMALLEST_REACH)
    return signed_shade("deviation, mm", reach)


def _draw_histogram(compared: Comparison) -> Figure:
    values = compared.found.values_mm
    low, high = np.percentile(values, (0.1, 99.9))
    margin = max(0.05 * (high - low), SMALLEST_REACH)
    edges = np.linspace(low - margin, high + margin, BINS + 1)
    figure = new_figure(3.4)
    axes = figure.add_subplot()
    axes.hist(values, list(edges), weights=np.full(len(values), 100 / len(values)), color="0.45")
    middle = values.mean()
    axes.axvline(0, color="black", linewidth=0.8)
    axes.axvline(middle, color="#0072b2", label=f"mean {middle:+.4f} mm")
    if compared.tolerance_mm is not None:
        for sign in (-1, 1):
            label = f"tolerance {compared.tolerance_mm:g} mm" if sign > 0 else None
            at = sign * compared.tolerance_mm
            axes.axvline(at, color="#d55e00", linestyle="--", label=label)
    noise = _noise(compared.found)
    if noise is not None:
        step = edges[1] - edges[0]
        shape = np.exp(-(((edges - middle) / noise) ** 2) / 2) / (noise * np.sqrt(2 * np.pi))
        axes.plot(edges, 100 * step * shape, color="#009e73", label=f"noise, sd {noise:.3g} mm")
    axes.set_xlabel("deviation, mm: positive outside")
    axes.set_ylabel("share of points, %")
    axes.set_title(f"{compared.cloud} against {compared.reference}", loc="left")
    axes.legend(fontsize=8)
    return figure


def paint_deviations(cloud: Cloud, compared: Comparison) -> Cloud:
    """The cloud with 8 bit colours of its deviations, grey where they are not known."""
    shade = deviation_shade(compared)
    low, high = shade.limits_of(compared.found.deviation_mm)
    values = compared.found.deviation_mm
    share = np.clip((np.nan_to_num(values) - low) / (high - low), 0, 1)
    colours: NDArray[np.uint8] = np.rint(255 * shade.colormap(share)[..., :3]).astype(np.uint8)
    colours[~np.isfinite(values)] = GREY_RGB
    return replace(cloud, colour=colours)


def make_comparison_page(compared: Comparison) -> Page:
    """The page; its figures are drawn at once."""
    summary = summarise_comparison(compared)
    captions = {
        "deviation": "Signed deviation, mm: red outside, blue inside, grey without a counterpart.",
        "histogram": "The same as a histogram; the curve is what the noise of the points alone "
        "would be.",
    }
    pictures = [
        Picture(figure, captions[name], captions[name])
        for name, figure in draw_comparison(compared)
    ]
    lead = (
        f"{summary['points']:,} points of `{compared.cloud}` have a counterpart on "
        f"`{compared.reference}`. Positive is outside: along the normal of a mesh, towards the "
        "sensor of a cloud."
    )
    return Page(
        f"{compared.cloud} against {compared.reference}",
        lead,
        [
            Section("Deviations", [Numbers(list(_numbers(summary))), *pictures]),
            Section("Table", [Table(("", "mm"), _rows(summary), numbers=(1,))]),
            Section("All numbers", [Details("comparison.json", summary)]),
        ],
    )


def _numbers(summary: dict[str, Any]) -> Iterator[Number]:
    noise = summary["noise_rms_mm"]
    beside = "" if noise is None else f"noise alone: {noise:.3g} mm"
    yield Number("mean", f"{summary['mean_mm']:+.4f} mm")
    yield Number("rms", f"{summary['rms_mm']:.4f} mm", beside)
    yield Number("band95", f"{summary['band95_mm']:.4f} mm", "width that holds 95 %")
    if summary["within_share"] is not None:
        share = summary["within_share"]
        words = f"within {summary['tolerance_mm']:g} mm"
        verdict = Verdict("good", words) if share == 1 else Verdict("bad", f"not all {words}")
        yield Number("within tolerance", f"{share:.2%}", "", verdict)


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    names = ("mean_mm", "median_mm", "sd_mm", "rms_mm", "min_mm", "max_mm", "band95_mm")
    rows = [(name.removesuffix("_mm"), f"{summary[name]:+.4f}") for name in names]
    return rows + [(f"{name} %", f"{v:+.4f}") for name, v in summary["quantiles_mm"].items()]
