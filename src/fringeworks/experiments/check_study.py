"""The study of `check`: every fault in three strengths, and captures with nothing wrong.

`docs/check.md` has what it printed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from fringeworks.diagnose import check_capture
from fringeworks.experiments.faults import FAULTS, Strength, clean, half_rig
from fringeworks.experiments.study import Study
from fringeworks.model import Progress, no_progress

STRENGTHS = ("weak", "middle", "strong")
SEEDS = 2
CLEAN = 50
NONE = "nothing"


@dataclass(frozen=True, slots=True)
class Told:
    """What `check` said of a capture with a fault.

    Attributes
    ----------
    fault, strength, seed
        What was made.
    expected
        The name that should stand first.
    names
        Those that it gave, costliest first.
    cost, unit
        Of the first.
    """

    fault: str
    strength: Strength
    seed: int
    expected: str
    names: tuple[str, ...]
    cost: float | None
    unit: str | None

    @property
    def right(self) -> bool:
        return self.names[:1] == (self.expected,)


def study_check(
    folder: Path, *, seeds: int | None = None, quick: bool = False, progress: Progress = no_progress
) -> Study:
    """Make faults, check, count.

    Parameters
    ----------
    folder
        Not used: it takes some minutes.
    seeds
        Captures of each fault in each strength, two by default.
    quick
        The strongest of each fault, and four clean captures.
    """
    strengths = (2,) if quick else (0, 1, 2)
    count, spotless = (1, 4) if quick else (seeds or SEEDS, CLEAN)
    jobs = [(f, s, 1 + n) for f in FAULTS for n in range(count) for s in strengths]
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # the kernels hold no lock
        faulty = [pool.submit(tell, *job) for job in jobs]
        good = [pool.submit(tell_clean, number) for number in range(spotless)]
        told = [one.result() for one in progress(faulty, "making faults")]
        dirty = [one.result() for one in progress(good, "checking clean captures")]
    return Study(
        title=f"{len(FAULTS)} faults of the twin, {len(jobs)} captures, and {spotless} clean ones",
        head=("fault", "should be called", *(STRENGTHS[n] for n in strengths), "else called"),
        rows=tuple(_row(fault, told, strengths) for fault in FAULTS),
        notes=tuple(_notes(told, dirty)),
        numbers={"told": [asdict(one) for one in told], "clean": dirty},
        draw=partial(draw_told, told),
    )


def tell(fault: str, strength: Strength, seed: int) -> Told:
    """Make a fault and check the capture."""
    case = FAULTS[fault](strength, seed)
    found = check_capture(case.capture, case.rig).findings
    names = tuple(finding.name for finding in found)
    cost, unit = (found[0].cost, found[0].unit) if found else (None, None)
    return Told(fault, strength, seed, case.expected, names, cost, unit)


def tell_clean(number: int) -> tuple[str, ...]:
    """Names that are given to a capture with nothing wrong."""
    return tuple(one.name for one in check_capture(clean(number), half_rig()).findings)


def _row(fault: str, told: Sequence[Told], strengths: Sequence[Strength]) -> tuple[str, ...]:
    own = [one for one in told if one.fault == fault]
    cells = []
    for strength in strengths:
        right = [one.right for one in own if one.strength == strength]
        cells.append(f"{sum(right)} of {len(right)}")
    others = sorted({(one.names or (NONE,))[0] for one in own if not one.right})
    return (fault, own[0].expected, *cells, ", ".join(others) or "-")


def _notes(told: Sequence[Told], dirty: Sequence[tuple[str, ...]]) -> Iterator[str]:
    right = sum(one.right for one in told)
    yield f"{right} of {len(told)} faults stand first under their name, {right / len(told):.1%}."
    beside = sum(len(one.names) > 1 for one in told)
    yield f"{beside} of {len(told)} captures with one fault have a second finding beside it."
    named = [f"number {n}: {', '.join(names)}" for n, names in enumerate(dirty) if names]
    yield f"{len(named)} of {len(dirty)} clean captures have a finding. {'; '.join(named)}".strip()


def draw_told(told: Sequence[Told]) -> Figure:
    """Cost of the first finding of every capture; a cross where its name is not the fault's."""
    from fringeworks.report.canvas import new_figure

    faults = list(dict.fromkeys(one.fault for one in told))
    figure = new_figure(0.27 * len(faults) + 1.2)
    axes = figure.add_subplot()
    for one in told:
        if one.cost is not None:
            height = faults.index(one.fault) + 0.22 * (one.strength - 1)
            axes.plot(one.cost, height, **_mark(one))
    axes.set_yticks(np.arange(len(faults)), labels=faults)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlabel("cost of the first finding, mm (px, open, where nothing can be decoded)")
    axes.set_title("weak above, strong below; cross: another name stands first", loc="left")
    axes.grid(axis="x", color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    return figure


def _mark(one: Told) -> dict[str, Any]:
    shape = "o" if one.right else "x"
    colour = "#0072b2" if one.right else "#d55e00"
    inside = "white" if one.unit == "px" else colour
    return {"marker": shape, "color": colour, "markerfacecolor": inside, "markersize": 5}
