"""An acceptance test in plain values and in two pictures: values beside limits, and places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from fringeworks.measure.acceptance import BallFound, BarFound, Certificate, FlatFound, Lot
from fringeworks.measure.acceptance.certificate import Outcome, Quantity
from fringeworks.report.canvas import CAMERA_COLOUR, PROJECTOR_COLOUR, new_figure

MEANINGS: Mapping[Quantity, str] = {
    "PF": "probing error, form: range about a ball",
    "PS": "probing error, size: diameter less the calibrated one",
    "SD": "sphere spacing error: distance less the calibrated one",
    "F": "flatness: range about a plane",
}
OUTCOME_WORDS: Mapping[Outcome, str] = {
    "conforms": "conforms",
    "fails": "fails",
    "undecided": "nothing proven: a value is within U of the limit",
    "incomplete": "too few positions count",
    "no limit": "no limit stated",
}

GOOD, DOUBTFUL, BAD, PLAIN = "#009e73", "#e69f00", "#c0392b", "0.45"
NOISE_COLOUR = "0.1"
HEADROOM = 1.12

Array = NDArray[np.float64]


def summarise_certificate(certificate: Certificate) -> dict[str, Any]:
    """Plain values, mm unless their names say otherwise."""
    return {
        "name": certificate.name,
        "outcome": certificate.outcome,
        "volume_mm": list(certificate.volume_mm),
        "diagonal_mm": certificate.diagonal_mm,
        "trim_per_mille": certificate.trim_per_mille,
        "artefacts": asdict(certificate.artefacts),
        "quantities": [_summarise_lot(lot) for lot in certificate.lots],
        "everyday": asdict(certificate.words),
        "balls": [_summarise_ball(ball) for ball in certificate.balls],
        "bars": [_summarise_bar(bar) for bar in certificate.bars],
        "flats": [_summarise_flat(flat) for flat in certificate.flats],
        "findings": [str(found) for found in certificate.findings],
    }


def _summarise_lot(lot: Lot) -> dict[str, Any]:
    worst = lot.worst
    return {
        "quantity": lot.quantity,
        "needed": lot.needed,
        "counted": len(lot.counted),
        "limit_mm": lot.limit_mm,
        "outcome": lot.outcome,
        "worst_mm": None if worst is None else worst.value_mm,
        "worst_at": None if worst is None else worst.name,
        "readings": [
            {**asdict(one), "faults": list(one.faults), "decision": decision}
            for one, decision in zip(lot.readings, lot.decisions, strict=True)
        ],
    }


def _summarise_ball(ball: BallFound) -> dict[str, Any]:
    return {
        "name": ball.name,
        "centre_mm": ball.centre_mm.tolist(),
        "diameter_mm": ball.diameter_mm,
        "PF_mm": ball.pf_mm,
        "PS_mm": ball.ps_mm,
        "cap_deg": ball.cap_deg,
        **asdict(ball.surface),
    }


def _summarise_bar(bar: BarFound) -> dict[str, Any]:
    return {
        "name": bar.name,
        "centres_mm": bar.centres_mm.tolist(),
        "distance_mm": bar.distance_mm,
        "SD_mm": bar.sd_mm,
        "points": list(bar.points),
    }


def _summarise_flat(flat: FlatFound) -> dict[str, Any]:
    return {
        "name": flat.name,
        "corners_mm": flat.corners_mm.tolist(),
        "size_mm": list(flat.size_mm),
        "F_mm": flat.f_mm,
        **asdict(flat.surface),
        **asdict(flat.planarity),
    }


def draw_values(certificate: Certificate) -> Figure:
    """Every value beside its limit; of PF and F also what noise alone would make, and the band."""
    lots = certificate.lots
    rows = (len(lots) + 1) // 2
    figure = new_figure(3.4 * rows, width_in=11.0)
    panels = figure.subplots(rows, 2 if len(lots) > 1 else 1, squeeze=False).ravel()
    for axes, lot in zip(panels, lots, strict=False):
        _draw_lot(axes, lot)
        _draw_surfaces(axes, lot.quantity, certificate)
    for axes in panels[len(lots) :]:
        axes.set_axis_off()
    figure.suptitle(f"{certificate.name}: {OUTCOME_WORDS[certificate.outcome]}", x=0.01, ha="left")
    return figure


def _draw_lot(axes: Axes, lot: Lot) -> None:
    places = np.arange(len(lot.readings))
    values = [one.value_mm for one in lot.readings]
    u95 = [one.u95_mm for one in lot.readings]
    colours = {"conforms": GOOD, "undecided": DOUBTFUL, "fails": BAD, None: PLAIN}
    bars = [colours[decision] for decision in lot.decisions]
    axes.bar(places, values, 0.62, color=bars, yerr=u95, capsize=2, error_kw={"linewidth": 0.8})
    reach = max([abs(value) + u for value, u in zip(values, u95, strict=True)], default=1.0)
    signed = lot.quantity in ("PS", "SD")
    if lot.limit_mm is not None:
        for sign in (1, -1)[: 2 if signed else 1]:
            axes.axhline(sign * lot.limit_mm, color="0.25", linewidth=1)
            shrunk = sign * (lot.limit_mm - max(u95, default=0.0))
            axes.axhline(shrunk, color="0.25", linewidth=0.8, linestyle=":")
        reach = max(reach, lot.limit_mm)
    axes.axhline(0, color="0.6", linewidth=0.6)
    axes.set_ylim(-HEADROOM * reach if signed else 0, HEADROOM * reach)
    names = [one.name for one in lot.readings]
    axes.set_xticks(places, labels=names, rotation=40 if len("".join(names)) > 40 else 0)
    axes.set_ylabel(f"{lot.quantity}, mm")
    axes.set_title(f"{lot.quantity}: {MEANINGS[lot.quantity]}", loc="left", fontsize="medium")


def _draw_surfaces(axes: Axes, quantity: Quantity, certificate: Certificate) -> None:
    """Of a range, what noise of the same rms would have, and the width of 95 %."""
    surfaces = {
        "PF": [ball.surface for ball in certificate.balls],
        "F": [flat.surface for flat in certificate.flats],
    }
    found = surfaces.get(quantity, [])
    if not found:
        return
    places = np.arange(len(found))
    noise = [one.noise_range_mm for one in found]
    bands = [one.band95_mm for one in found]
    low, high = axes.get_ylim()
    axes.set_ylim(low, max(high, 1.2 * max(noise), 1.2 * max(one.range_mm for one in found)))
    style: dict[str, Any] = {"linestyle": "none", "color": NOISE_COLOUR, "markersize": 13}
    axes.plot(places, noise, marker="_", label="range of noise of this rms", **style)
    axes.plot(places, bands, marker=".", label="95 % of the points", **{**style, "markersize": 5})
    axes.legend(frameon=False, fontsize="small", loc="upper center", ncols=2)


def draw_places(certificate: Certificate) -> Figure:
    """Where the artefacts stood, from above and from the front, with the volume's size."""
    figure = new_figure(4.6, width_in=11.0)
    above, front = figure.subplots(1, 2)
    middle = _middle(certificate)
    for axes, (across, down), (title, *labels) in (
        (above, (0, 2), ("from above", "x, mm", "depth z, mm")),
        (front, (0, 1), ("as the camera sees it", "x, mm", "y, mm")),
    ):
        _draw_volume(axes, certificate, middle, (across, down))
        for ball in certificate.balls:
            _draw_ball(axes, ball, (across, down))
        for bar in certificate.bars:
            axes.plot(
                *bar.centres_mm[:, (across, down)].T, "o-", color=PROJECTOR_COLOUR, linewidth=1.2,
                markersize=4,
            )  # fmt: skip
        for flat in certificate.flats:
            loop = np.vstack([flat.corners_mm, flat.corners_mm[:1]])[:, (across, down)]
            axes.plot(*loop.T, color="0.45", linewidth=1)
        axes.set_aspect("equal")
        axes.set_title(title, loc="left", fontsize="medium")
        axes.set_xlabel(labels[0])
        axes.set_ylabel(labels[1])
    front.invert_yaxis()
    _name_artefacts(figure, certificate)
    return figure


def _draw_volume(
    axes: Axes, certificate: Certificate, middle: Array, planes: tuple[int, int]
) -> None:
    sides = np.array(certificate.volume_mm)[list(planes)]
    corner = middle[list(planes)] - sides / 2
    axes.add_patch(
        Rectangle(
            (corner[0], corner[1]), sides[0], sides[1], fill=False, color="0.7", linestyle="--"
        )
    )


def _draw_ball(axes: Axes, ball: BallFound, planes: tuple[int, int]) -> None:
    x, y = (float(ball.centre_mm[plane]) for plane in planes)
    turn = np.linspace(0, 2 * np.pi, 90)
    radius = ball.diameter_mm / 2
    axes.plot(
        x + radius * np.cos(turn), y + radius * np.sin(turn), color=CAMERA_COLOUR, linewidth=1
    )


def _middle(certificate: Certificate) -> Array:
    """Of all that was measured: where the volume is, the plan does not say."""
    points = [ball.centre_mm[None] for ball in certificate.balls]
    points += [bar.centres_mm for bar in certificate.bars]
    points += [flat.corners_mm for flat in certificate.flats]
    every = np.concatenate(points)
    return np.asarray((every.min(axis=0) + every.max(axis=0)) / 2)


def _name_artefacts(figure: Figure, certificate: Certificate) -> None:
    shown = (
        ("ball", CAMERA_COLOUR, certificate.balls),
        ("ball bar", PROJECTOR_COLOUR, certificate.bars),
        ("flat", "0.45", certificate.flats),
    )
    handles = [
        Line2D([], [], color=colour, label=f"{name}, {len(found)} positions")
        for name, colour, found in shown
        if found
    ]
    dashed = Line2D(
        [], [], color="0.7", linestyle="--", label="measuring volume, about their middle"
    )
    figure.legend(handles=[*handles, dashed], loc="outside lower center", ncols=4, frameon=False)
