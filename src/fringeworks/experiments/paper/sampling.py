"""Section 3.1: the error budget of figure 2, and filtering and multiple sampling of random errors.

A wall is captured many times with three fringes. The mean of repeated frames, and a filter over
neighbouring pixels, lessen noise by the root of their number; the filter costs detail, which the
cylinder's form without noise tells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter, uniform_filter

from fringeworks.experiments.held_rig import Still
from fringeworks.experiments.paper.chapter import Chapter, Grid, Row, Shown
from fringeworks.experiments.paper.lab import Lab
from fringeworks.model import Capture, Cloud, Fringe, PatternSet, Sequence, Uniform
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.window import Volume
from fringeworks.pipeline import cloud_of
from fringeworks.report.budget import draw_budget, summarise_budget
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import CYLINDER_RADIUS_MM, cylinder_scene
from fringeworks.twin.simulate import simulate
from fringeworks.uncertainty.budget import KINDS, make_budget
from fringeworks.uncertainty.contributions import Setting

REPEATS, QUICK_REPEATS = (1, 4, 16), (1, 4)
FILTERS_PX, QUICK_FILTERS_PX = (1, 3, 5), (1, 3)
STANDS_MM = (620.0, 715.0)
CAPTURES, QUICK_CAPTURES = 12, 2
SEED = 7
DEPTHS_MM = (560.0, 600.0, 640.0, 680.0, 720.0, 760.0)


@dataclass(frozen=True, slots=True)
class Sampled:
    """The cylinder of a capture with repeats or a filter: fitted radius and form rms, mm."""

    radius_mm: float
    form_rms_mm: float


def sample_errors(lab: Lab) -> Chapter:
    """The budget over depth, and what repeats and filters make of the cylinder."""
    setting = Setting(lab.good_rig, (_fringe(lab),), Effects())
    budget = make_budget(setting, DEPTHS_MM)
    middle = len(DEPTHS_MM) // 2
    repeats = QUICK_REPEATS if lab.quick else REPEATS
    filters = QUICK_FILTERS_PX if lab.quick else FILTERS_PX
    many = QUICK_CAPTURES if lab.quick else CAPTURES
    looks = [(count, SEED) for count in repeats] + [(1, SEED + 1 + k) for k in range(many)]
    found = lab.spread(partial(_sample, lab), looks, "repeated captures")
    repeated = dict(zip(repeats, found, strict=False))
    alone = [one.radius_mm for one in found[len(repeats) :]]
    filtered = {size: _measure_filtered(lab, size) for size in filters}
    classes = ", ".join(f"{kind} {budget.of_kind(kind)[middle]:.4f}" for kind in KINDS)
    return Chapter(
        heading="Error sources, filtering and multiple sampling: section 3.1, figure 2",
        words=WORDS,
        rows=(
            Row(f"sigma of z at {DEPTHS_MM[middle]:.0f} mm by class, mm", "", classes),
            *(Row(f"cylinder, {count} frames per shift: form rms, mm", "", f"{one.form_rms_mm:.3f}",
                  f"radius {one.radius_mm:.3f}")
              for count, one in repeated.items()),
            Row(f"radius over {many} captures, mean and sd, mm", "",
                f"{np.mean(alone):.3f}, {np.std(alone, ddof=1):.3f}",
                f"true {CYLINDER_RADIUS_MM:g}"),
        ),
        grids=(_grid(filtered),),
        pictures=(
            Shown("figure_02_sources", draw_budget(budget, sampled={}),
                  "Figure 2: error sources by the paper's classes, over depth."),
        ),
        numbers={
            "budget": summarise_budget(budget),
            "repeats": {str(count): _plain(one) for count, one in repeated.items()},
            "filters": {str(size): [*map(_plain, pair)] for size, pair in filtered.items()},
            "radii_of_captures_mm": alone,
        },
    )  # fmt: skip


WORDS = (
    "The paper names three classes of systematic error, model, parameters and phase, and "
    "random ones, against which it filters and samples repeatedly. Figure 2 has its "
    "classes with their sizes on the jointly calibrated rig. Repeats lessen the form rms "
    "by the root of their number; a filter does so too, over pixels, until it rounds the "
    "object. The lamp's flicker between the three frames of one capture is shared by all "
    "pixels: repeats lessen it, a filter does not."
)


def _grid(filtered: Mapping[int, tuple[Sampled, Sampled]]) -> Grid:
    head = ("filter", "form rms", "radius", "form rms without noise", "radius without noise")
    rows = [
        (
            f"{size}x{size} px",
            f"{noisy.form_rms_mm:.3f}",
            f"{noisy.radius_mm:.3f}",
            f"{quiet.form_rms_mm:.4f}",
            f"{quiet.radius_mm:.4f}",
        )
        for size, (noisy, quiet) in filtered.items()
    ]
    return Grid("Mean over squares of the phase's pixels, mm", head, rows)


def _plain(one: Sampled) -> list[float]:
    return [one.radius_mm, one.form_rms_mm]


def _fringe(lab: Lab) -> Fringe:
    return next(item.pattern for item in lab.patterns.sets if isinstance(item.pattern, Fringe))


def _sample(lab: Lab, look: tuple[int, int]) -> Sampled:
    """The cylinder by three fringes, each taken so many times, with a seed."""
    capture = _look(lab, *look)
    volume = Volume(lab.good_rig, STANDS_MM)
    found = decode_capture(capture, orders="objects", volume=volume)
    return _fit(lab, cloud_of(capture, found, lab.good_rig))


def _look(lab: Lab, repeats: int, seed: int) -> Capture:
    projector = lab.true_rig.projector
    sets = (PatternSet(_fringe(lab), repeats=repeats), PatternSet(Uniform(1.0)))
    shown = Sequence(projector.width, projector.height, sets)
    rng = np.random.default_rng(seed)
    return simulate(cylinder_scene(), lab.true_rig, shown, rng=rng).capture


def _fit(lab: Lab, cloud: Cloud) -> Sampled:
    found = lab.fit_cylinder(cloud)
    return Sampled(found.radius_mm, found.form_rms_mm)


def _measure_filtered(lab: Lab, size: int) -> tuple[Sampled, Sampled]:
    """With noise, and without, the coordinate being the mean over squares of so many px."""
    noisy, quiet = (lab.still(cylinder_scene(), noisy=noise) for noise in (True, False))
    return _fit(lab, _filtered(noisy, lab, size)), _fit(lab, _filtered(quiet, lab, size))


def _filtered(still: Still, lab: Lab, size: int) -> Cloud:
    """The coordinate is averaged, as a continuous phase is."""
    column = still.projector_map.column
    assert column is not None, "the fringes run along x"
    coded = replace(column, coordinate=mean_over_squares(column.coordinate, size))
    return cloud_of(still.capture, replace(still.projector_map, column=coded), lab.good_rig)


def mean_over_squares(values: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Means ``(H, W)`` over squares of so many pixels each way; NaN where any of them is void."""
    known = np.isfinite(values)
    mean = uniform_filter(np.where(known, values, 0).astype(np.float64), size)
    return np.where(minimum_filter(known, size), mean, np.nan).astype(np.float32)
