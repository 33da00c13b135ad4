"""The abstract's promise: no computational burden, no iteration. Time per point of every model."""

from __future__ import annotations

from time import perf_counter

from fringeworks.experiments.paper.chapter import Chapter, Row
from fringeworks.experiments.paper.lab import Lab
from fringeworks.model import ModelName, Rig
from fringeworks.pipeline import cloud_of
from fringeworks.reconstruct.full import CloudRules
from fringeworks.twin.scenes import wall_scene

TURNS = 5
EXACT = "full, iterated at every pixel"


def time_models(lab: Lab) -> Chapter:
    """The wall, decoded, to a cloud: the fastest of some turns, over its points."""
    found = {
        name: _nanoseconds(lab, known, model)
        for name, (known, model) in lab.models("joint").items()
        if name != "extended, MAP"
    }
    found[EXACT] = _nanoseconds(lab, lab.good_rig, "full", exact=True)
    first = found["equations 1 to 3"]
    return Chapter(
        heading="No burden, no iteration: the abstract",
        words=(
            "From a decoded map to a cloud, masks with it, in one run on one machine: only the "
            "ratios mean something. The full model is solved once per rig into a table of depth "
            "over pixel and phase; with it, nothing is iterated either. `fringeworks bench` times "
            "the kernels alone."
        ),
        rows=[
            Row(f"time per point, {name}, ns", "", f"{value:.0f}", f"{value / first:.2f} times")
            for name, value in found.items()
        ],
        numbers={"nanoseconds_per_point": found},
    )


def _nanoseconds(lab: Lab, rig: Rig, model: ModelName, *, exact: bool = False) -> float:
    still, rules, times = lab.still(wall_scene()), CloudRules(edges=None, exact=exact), []
    for _ in range(TURNS):
        start = perf_counter()
        cloud = cloud_of(still.capture, still.projector_map, rig, model=model, rules=rules)
        times.append(perf_counter() - start)
    return 1e9 * min(times) / int(cloud.valid.sum())
