"""The study of fringe orders: every method on one scene, as one thing after another gets worse.

`docs/orders.md` has what it printed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np

from fringeworks.experiments.order_figure import Results, draw_orders
from fringeworks.experiments.order_trials import (
    CONDITIONS,
    CONTENDERS,
    Condition,
    Contender,
    Told,
    run_trials,
)
from fringeworks.experiments.study import Study
from fringeworks.model import Camera, Progress, Rig, no_progress
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import paper_rig, two_scene

NONE = "-"


def study_orders(
    folder: Path, *, seeds: int | None = None, quick: bool = False, progress: Progress = no_progress
) -> Study:
    """Capture, tell orders, count.

    Parameters
    ----------
    folder
        Not used: it takes a minute or two.
    seeds
        Captures at each level, one by default: tens of thousands of pixels each.
    quick
        The first level of each condition and the one that the table tells.
    """
    rig, count = half_camera(paper_rig()), seeds or 1
    conditions = tuple(_shortened(item) for item in CONDITIONS) if quick else CONDITIONS
    jobs = [
        (condition, level, seed)
        for condition in conditions
        for level in condition.levels
        for seed in range(count)
    ]
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # the kernels hold no lock
        waiting = [pool.submit(_run, *job, rig) for job in jobs]
        tables = iter([one.result() for one in progress(waiting, "telling orders")])
    results = {
        condition.name: [_pooled([next(tables) for _ in range(count)]) for _ in condition.levels]
        for condition in conditions
    }
    return Study(
        title=f"{len(CONTENDERS)} ways to tell fringe orders, on two objects of the twin",
        head=("method", "frames", *(f"{c.name} {c.told:g}" for c in conditions)),
        rows=tuple(_row(item, rig, results, conditions) for item in CONTENDERS),
        notes=tuple(_notes(conditions)),
        numbers={
            "levels": {condition.name: condition.levels for condition in conditions},
            "results": {
                name: [{who: asdict(told) for who, told in table.items()} for table in tables]
                for name, tables in results.items()
            },
        },
        draw=partial(draw_orders, results, conditions, [item.name for item in CONTENDERS]),
    )


def half_camera(rig: Rig) -> Rig:
    """The same rig with half the camera's pixels each way; its image's edge, -1/2, stays."""
    camera = rig.camera
    lens = replace(
        camera.lens,
        fx=camera.lens.fx / 2,
        fy=camera.lens.fy / 2,
        cx=(camera.lens.cx + 0.5) / 2 - 0.5,
        cy=(camera.lens.cy + 0.5) / 2 - 0.5,
    )
    return replace(rig, camera=Camera(camera.width // 2, camera.height // 2, lens))


def _shortened(condition: Condition) -> Condition:
    return replace(condition, levels=(condition.levels[0], condition.told))


def _run(condition: Condition, level: float, seed: int, rig: Rig) -> dict[str, Told]:
    contenders = tuple(item for item in CONTENDERS if condition.admits(item))
    effects = condition.change(Effects(), level)
    return run_trials(contenders, two_scene(), rig, effects, rng=np.random.default_rng(seed))


def _pooled(tables: list[dict[str, Told]]) -> dict[str, Told]:
    """Pixels of all seeds together."""
    return {
        name: Told(
            sum(table[name].pixels for table in tables),
            sum(table[name].certain for table in tables),
            sum(table[name].wrong for table in tables),
            next((table[name].refusal for table in tables if table[name].refusal), ""),
        )
        for name in tables[0]
    }


def _row(
    contender: Contender, rig: Rig, results: Results, conditions: tuple[Condition, ...]
) -> tuple[str, ...]:
    cells = (_cell(results[c.name][c.levels.index(c.told)].get(contender.name)) for c in conditions)
    return (contender.name, str(contender.frames(rig)), *cells)


def _cell(told: Told | None) -> str:
    """Wrong orders, and coverage."""
    if told is None:
        return NONE
    if told.refusal:
        return "refused"
    if not told.certain:
        return "none certain"
    return f"{told.wrong_share:.2%} of {told.coverage:.1%}"


def _notes(conditions: tuple[Condition, ...]) -> Iterator[str]:
    yield (
        "Wrong orders of the certain pixels, and the share of pixels that are certain, at one "
        "level of: " + "; ".join(f"{item.name}, {item.unit}" for item in conditions) + "."
    )
