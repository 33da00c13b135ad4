"""False and missed alarms of a zone over many simulated scans, and where it starts to miss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fringeworks.experiments.study import Study
from fringeworks.experiments.zone_trials import (
    ALBEDOS,
    GAP_MM,
    ZONE,
    Place,
    ZoneTrial,
    make_workplace,
    run_trial,
)
from fringeworks.model import Progress

SIZE_MM = 20.0
SMALLER_MM = (14.0, 10.0, 7.0, 5.0)
SCANS, SMALLER_SHARE = 500, 0.12
"""Scans with the thing of `SIZE_MM`, and how many of each smaller size beside them."""

QUICK_SCANS, QUICK_STEP = 4, 2
EDGES_MM = (1000.0, 1250.0, 1500.0, 1750.0, 2000.0)
PLACES: tuple[Place, ...] = ("inside", "empty", "inside", "outside")
SEED = 9


def study_zones(folder: Path, *, seeds: int | None, quick: bool, progress: Progress) -> Study:
    """Half of `seeds` scans have a thing of 20 mm in the zone, a quarter beside it.

    Nothing is kept in `folder`: a second run starts anew.
    """
    count = QUICK_SCANS if quick else seeds or SCANS
    smaller = max(1, round(SMALLER_SHARE * count))
    plan = [(PLACES[n % len(PLACES)], SIZE_MM) for n in range(count)]
    plan += [("inside", size) for size in SMALLER_MM for _ in range(smaller)]
    workplace = make_workplace(QUICK_STEP if quick else 1)
    trials = [
        run_trial(workplace, *plan[n], rng=np.random.default_rng([SEED, n]))
        for n in progress(range(len(plan)), "scanning zones")
    ]
    main = trials[:count]
    inside, outside, empty = (
        [one for one in main if one.place == place] for place in ("inside", "outside", "empty")
    )
    return Study(
        f"A zone from 1 to 2 m: {count} scans, half of them with a thing of {SIZE_MM:g} mm in it",
        (
            "size",
            "scans",
            "missed",
            *(f"{a / 1000:g}-{b / 1000:g} m" for a, b in pairwise(EDGES_MM)),
        ),
        tuple(_row(size, trials) for size in (SIZE_MM, *SMALLER_MM)),
        (
            _say_false("without a thing", empty),
            _say_false(f"with a thing {GAP_MM:g} mm or more beside or before the zone", outside),
            f"missed of {SIZE_MM:g} mm: {_missed(inside)} of {len(inside)}{_say_missed(inside)}; "
            "columns: missed of scans by distance of the thing's middle",
            f"things: balls and cubes of any turn, albedo {ALBEDOS[0]:g} to {ALBEDOS[1]:g}; a wall "
            f"{GAP_MM:g} mm behind the zone; {trials[0].needed_points} points are an alarm",
        ),
        {"zone_mm": ZONE.box_mm, "trials": [asdict(one) for one in trials]},
        lambda: _draw(trials),
    )


def _missed(trials: Sequence[ZoneTrial]) -> int:
    return sum(not one.alarm for one in trials)


def _say_missed(trials: Sequence[ZoneTrial]) -> str:
    missed = [one for one in trials if not one.alarm]
    if not missed:
        return ""
    nearest, brightest = min(one.depth_mm for one in missed), max(one.albedo for one in missed)
    return f", from {nearest:.0f} mm on and up to albedo {brightest:.2f}"


def _say_false(what: str, trials: Sequence[ZoneTrial]) -> str:
    return f"false alarms {what}: {sum(one.alarm for one in trials)} of {len(trials)}"


def _row(size_mm: float, trials: Sequence[ZoneTrial]) -> tuple[str, ...]:
    own = [one for one in trials if one.place == "inside" and one.size_mm == size_mm]
    bands = [[one for one in own if a <= one.depth_mm < b] for a, b in pairwise(EDGES_MM)]
    shares = (f"{_missed(band)} of {len(band)}" for band in bands)
    return (f"{size_mm:g} mm", f"{len(own)}", f"{_missed(own)}", *shares)


def _draw(trials: Sequence[ZoneTrial]) -> Figure:
    """Points that count over distance, and how many are an alarm."""
    from fringeworks.report.canvas import new_figure

    figure = new_figure(3.6)
    axes = figure.subplots()
    for size_mm in (SIZE_MM, *SMALLER_MM):
        own = [one for one in trials if one.place == "inside" and one.size_mm == size_mm]
        depths = [one.depth_mm / 1000 for one in own]
        axes.plot(depths, [max(one.points, 0.5) for one in own], "o", ms=3, label=f"{size_mm:g} mm")
    axes.axhline(trials[0].needed_points, color="0.4", linewidth=1.0)
    axes.set_yscale("log")
    axes.set_xlabel("distance, m")
    axes.set_ylabel("points in the zone (0 at the bottom)")
    axes.set_title("An alarm needs the points of the line", loc="left")
    axes.legend(frameon=False, ncols=5, loc="upper right")
    return figure
