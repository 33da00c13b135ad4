"""The study of calibrations as a table, with the sentences that belong to it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.settings import BoardModel
from fringeworks.experiments.held_rig import HeldRig
from fringeworks.experiments.trials import Outcome, Trial

HEAD = ("over all seeds", "ours", "plain OpenCV", "true rig", "bar")
NONE = "-"
Row = tuple[str, ...]
Array = NDArray[np.float64]
Quantity = Callable[[HeldRig], float]


@dataclass(frozen=True, slots=True)
class Results:
    """All trials, and what the true rig makes of the same scans."""

    trials: Sequence[Trial]
    true: HeldRig

    def of(self, kind: str) -> list[Trial]:
        return [trial for trial in self.trials if trial.kind == kind]

    def ours(self, kind: str, shape: BoardModel = "flat") -> list[Outcome]:
        return [trial.ours[shape] for trial in self.of(kind)]

    def plain(self, kind: str) -> list[Outcome]:
        return [trial.plain for trial in self.of(kind)]


def wall(held: HeldRig) -> float:
    """95 % of the wall's errors are below, mm."""
    return held.wall_p95_mm


def cylinder(held: HeldRig) -> float:
    """95 % of the cylinder's errors are below, mm."""
    return held.cylinder_p95_mm


def radius(held: HeldRig) -> float:
    """Size of the radius' error, from pixels that see the cylinder alone, mm."""
    return abs(held.radius_error_mm)


def radius_of_all(held: HeldRig) -> float:
    """The same from all pixels, mm."""
    return abs(held.radius_all_error_mm)


def values(outcomes: Sequence[Outcome], quantity: Quantity) -> Array:
    """``(n,)`` a quantity of each rig."""
    return np.array([quantity(outcome.held) for outcome in outcomes])


def make_rows(results: Results) -> Iterator[Row]:
    """The table's rows, section by section."""
    yield from _bias_rows(results)
    yield from _fit_rows(results)
    yield from _parameter_rows(results)
    yield from _prediction_rows(results)
    yield from _bowed_rows(results)
    yield from _sign_rows(results)


def _bias_rows(results: Results) -> Iterator[Row]:
    ours, plain = results.ours("flat"), results.plain("flat")
    table: tuple[tuple[str, Quantity, Callable[[Array], float], str], ...] = (
        ("wall, p95, median, mm", wall, _median, "<= 0.012"),
        ("wall, p95, largest, mm", wall, _largest, ""),
        ("cylinder, p95, median, mm", cylinder, _median, "<= 0.003"),
        ("cylinder, p95, largest, mm", cylinder, _largest, ""),
        ("radius error, median, mm", radius, _median, "<= 0.004"),
        ("radius error, 90 % below, mm", radius, _ninety, "<= 0.01"),
        ("radius error, all pixels, median, mm", radius_of_all, _median, ""),
    )
    for name, quantity, summary, bar in table:
        numbers = (summary(values(ours, quantity)), summary(values(plain, quantity)))
        yield (name, *(f"{x:.4f}" for x in (*numbers, quantity(results.true))), bar)
    more = _median(values(ours, cylinder)) - cylinder(results.true)
    more_plain = _median(values(plain, cylinder)) - cylinder(results.true)
    yield ("cylinder, more than the true rig, mm", f"{more:.4f}", f"{more_plain:.4f}", NONE, "")
    for name, quantity in (("wall", wall), ("cylinder", cylinder), ("radius", radius)):
        better = np.mean(values(ours, quantity) < values(plain, quantity))
        bar = ">= 95 %" if quantity is wall else ""
        yield (f"better than plain, {name}", f"{better:.0%}", NONE, NONE, bar)


def _fit_rows(results: Results) -> Iterator[Row]:
    ours, plain = results.ours("flat"), results.plain("flat")
    for device in ("camera", "projector"):
        rms = [[getattr(o, f"{device}_rms_px") for o in part] for part in (ours, plain)]
        yield (f"{device} rms, median, px", *(f"{np.median(part):.4f}" for part in rms), NONE, "")
    kept = [sum(o.kept for o in part) / sum(o.offered for o in part) for part in (ours, plain)]
    yield ("corners kept", *(f"{share:.2%}" for share in kept), NONE, "")


def _parameter_rows(results: Results) -> Iterator[Row]:
    """Root mean squares over the seeds."""
    table = (
        ("camera focal lengths, px", ("camera.fx", "camera.fy"), 1.0),
        ("camera principal point, px", ("camera.cx", "camera.cy"), 1.0),
        ("projector focal lengths, px", ("projector.fx", "projector.fy"), 1.0),
        ("projector principal point, px", ("projector.cx", "projector.cy"), 1.0),
        ("baseline, mm", ("baseline_mm",), 1.0),
        ("angle between the devices, mdeg", ("angle_rad",), float(np.rad2deg(1e3))),
    )
    for name, keys, scale in table:
        cells = [
            f"{scale * _rms([o.held.parameter_errors[key] for o in part for key in keys]):.3f}"
            for part in (results.ours("flat"), results.plain("flat"))
        ]
        yield (f"error of {name}, rms", *cells, NONE, "")


def _prediction_rows(results: Results) -> Iterator[Row]:
    predicted = [o.predicted for o in results.ours("flat") if o.predicted is not None]
    observed = _rms([p.wall_rms_mm for p in predicted])
    ratio = observed / _rms([p.wall_predicted_mm for p in predicted])
    yield ("wall error over predicted, rms", f"{ratio:.2f}", NONE, NONE, "<= 1.3")
    scores = parameter_scores(results)
    span = f"{min(scores.values()):.2f} to {max(scores.values()):.2f}"
    yield ("parameter error over sigma, rms", span, NONE, NONE, "0.8 to 1.25")


def parameter_scores(results: Results) -> dict[str, float]:
    """By parameter, the root mean square over the seeds of its error over its sigma."""
    predicted = [o.predicted for o in results.ours("flat") if o.predicted is not None]
    return {name: _rms([p.scores[name] for p in predicted]) for name in predicted[0].scores}


def _bowed_rows(results: Results) -> Iterator[Row]:
    """Beside the flat board's on the same seeds."""
    plain = f"{_median(values(results.plain('bowed'), wall)):.4f}"
    names: tuple[tuple[str, BoardModel], ...] = (
        ("taken as flat", "flat"),
        ("its shape solved for", "paraboloid"),
    )
    flat = values(results.ours("flat")[: len(results.of("bowed"))], wall)
    for name, shape in names:
        found = _median(values(results.ours("bowed", shape), wall))
        yield (f"bowed board, {name}: wall, p95, median, mm", f"{found:.4f}", plain, NONE, "")
    yield (
        "  the latter over the flat board's",
        f"{found / _median(flat):.2f}",
        NONE,
        NONE,
        "<= 1.5",
    )
    for kind, name in (("warped", "lens beyond the model"), ("far_warped", "ten times so far")):
        both = [_median(values(part, wall)) for part in (results.ours(kind), results.plain(kind))]
        yield (f"{name}: wall, p95, median, mm", *(f"{x:.4f}" for x in both), NONE, "")


GROUPS: tuple[tuple[str, str, BoardModel], ...] = (
    ("flat board", "flat", "flat"),
    ("bowed, taken as flat", "bowed", "flat"),
    ("bowed, shape solved for", "bowed", "paraboloid"),
    ("lens beyond the model", "warped", "flat"),
    ("ten times so far", "far_warped", "flat"),
)
"""What is told side by side: name, kind of trial, shape that was solved for."""


def _sign_rows(results: Results) -> Iterator[Row]:
    """What ours notices of each fault: median and range over the seeds."""
    for name, kind, shape in GROUPS:
        found = results.ours(kind, shape)
        halves = [o.halves_ratio for o in found if o.halves_ratio is not None]
        yield (f"halves apart over predicted: {name}", _span(halves), NONE, NONE, "")
    for name, kind, shape in GROUPS:
        in_views = [o.structure.in_views for o in results.ours(kind, shape) if o.structure]
        yield (f"sites err together: {name}", _span(in_views), NONE, NONE, "")


def make_notes(results: Results) -> Iterator[str]:
    """What the table's words mean, and which parameter is furthest from its sigma."""
    count = len(results.of("flat"))
    scores = parameter_scores(results)
    low, high = min(scores, key=lambda n: scores[n]), max(scores, key=lambda n: scores[n])
    chance = 1 / np.sqrt(2 * count)
    yield (
        "wall, cylinder: error along the true normal on scans without noise, after rigid "
        "alignment; 95 % of the points are below."
    )
    yield (
        "radius error: of the pixels that see nothing but the cylinder; pixels at its outline see "
        "both sides of it, and move the radius with any rig."
    )
    yield (
        f"error over sigma: {low} has {scores[low]:.2f}, {high} {scores[high]:.2f}; over {count} "
        f"seeds chance alone scatters each of {len(scores)} by {chance:.2f}."
    )
    yield (
        "sites err together: variance of the means over sixteenths of the board over what their "
        "sites' scatter gives them; one without structure (calibrate/judge/structure.py)."
    )
    warned = []
    for name, kind, shape in GROUPS:
        found = results.ours(kind, shape)
        warned.append(f"{name} {sum(warns(outcome) for outcome in found)} of {len(found)}")
    yield f"calibrations with a finding, their own or of the sites: {', '.join(warned)}."


def warns(outcome: Outcome) -> bool:
    """Whether a calibration has a finding, or its sites' structure would give one."""
    sites = outcome.structure
    return bool(outcome.findings) or (sites is not None and sites.finding is not None)


def _span(numbers: Sequence[float]) -> str:
    if not numbers:
        return NONE
    return f"{np.median(numbers):.2f} ({min(numbers):.2f} to {max(numbers):.2f})"


def _median(numbers: Array) -> float:
    return float(np.median(numbers))


def _largest(numbers: Array) -> float:
    return float(np.max(numbers))


def _ninety(numbers: Array) -> float:
    return float(np.percentile(numbers, 90))


def _rms(numbers: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(numbers))))
