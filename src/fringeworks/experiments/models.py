"""The study of models: ``fringeworks bench models``.

The paper's rig with distorted lenses, and the same with lenses far beyond the five terms, are
calibrated on the twin; the geometric, the extended and the full model, each with a residual field
and without, and their rivals, scan what no calibration has seen. `docs/models.md` has what it
printed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import cache, partial
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter, ValidationError

from fringeworks.errors import FormatError
from fringeworks.experiments.calibrations import far_warped_rig, half_rig
from fringeworks.experiments.extended import HEAD as SCORE_HEAD
from fringeworks.experiments.extended import HeldOut, ModelScore, tabulate_scores
from fringeworks.experiments.model_trials import WITH_FIELD, ModelTrial, run_models
from fringeworks.experiments.models_figure import draw_models
from fringeworks.experiments.rivals import FRACTION, GOVERNING, PIXELS
from fringeworks.experiments.study import Study
from fringeworks.files.atomic import write_text
from fringeworks.model import Progress, Rig, no_progress
from fringeworks.patterns import make_sequence
from fringeworks.twin.scenes import paper_rig

SEEDS = 3
RIGS: Mapping[str, tuple[str, Callable[[], Rig]]] = {
    "paper": ("the paper's rig", paper_rig),
    "far_warped": ("warped strong", far_warped_rig),
}
"""By name in files: in words, and what makes them."""

MODELS = (
    "geometric",
    "geometric" + WITH_FIELD,
    "extended, paper",
    "extended, MAP",
    "extended, MAP" + WITH_FIELD,
    "full",
    "full" + WITH_FIELD,
    GOVERNING,
    FRACTION,
    PIXELS,
)
HEAD = ("rig, model", *SCORE_HEAD[1:])

_TRIAL = TypeAdapter(ModelTrial)


def study_models(
    folder: Path, *, seeds: int | None = None, quick: bool = False, progress: Progress = no_progress
) -> Study:
    """Run the calibrations that `folder` does not have yet, and tell what all of them say.

    Parameters
    ----------
    folder
        Each is kept in ``seeds/RIG-NN.json`` there (quick ones in ``seeds-quick``), its captures
        beside it. Remove them where the code has changed.
    seeds
        Calibrations of each rig, 3 by default, that differ by the captures' noise.
    quick
        One of each, from five poses and half the pixels each way: its numbers mean nothing.

    Raises
    ------
    FormatError
        A kept calibration cannot be read.
    """
    kept = folder / ("seeds-quick" if quick else "seeds")
    count = 1 if quick else seeds or SEEDS
    trials = {
        name: list(_run(name, kept, count=count, quick=quick, progress=progress)) for name in RIGS
    }
    medians = {name: median_scores(of_rig) for name, of_rig in trials.items()}
    return Study(
        title=f"Models on held-out forms, medians over {count} calibrations of each rig",
        head=HEAD,
        rows=tuple(row for name in RIGS for row in _rows(name, medians[name])),
        notes=tuple(_notes(trials)),
        numbers={"trials": [asdict(trial) for of_rig in trials.values() for trial in of_rig]},
        draw=partial(draw_models, {RIGS[name][0]: medians[name] for name in RIGS}),
    )


def median_scores(trials: Sequence[ModelTrial]) -> dict[str, ModelScore]:
    """Of each model by quantity, in the table's order; a radius error has its sign."""
    out = {}
    for model in MODELS:
        scores = [asdict(trial.scores[model]) for trial in trials]
        out[model] = ModelScore(
            **{key: float(np.median([score[key] for score in scores])) for key in scores[0]}
        )
    return out


def _rows(name: str, medians: Mapping[str, ModelScore]) -> list[tuple[str, ...]]:
    words = RIGS[name][0]
    return [(f"{words}, {model}", *values) for model, *values in tabulate_scores(medians)]


def _notes(trials: Mapping[str, Sequence[ModelTrial]]) -> Iterable[str]:
    yield (
        "Planes: error of z on two walls over the whole view, with noise and (systematic) without, "
        "as they stand; form: along the normal, each wall aligned. Cylinder: along the normal, "
        "aligned. Root mean squares."
    )
    yield "Full uses both axes, all others x alone; warped strong has lenses beyond every model."
    for name, of_rig in trials.items():
        yield from _field_notes(RIGS[name][0], of_rig)
        covered = float(np.median([trial.covered for trial in of_rig]))
        yield f"{RIGS[name][0]}: the {PIXELS} has a point at {covered:.0%} of a wall's pixels."


def _field_notes(words: str, trials: Sequence[ModelTrial]) -> Iterable[str]:
    for place, first in enumerate(trials[0].fields):
        fields = [trial.fields[place] for trial in trials]
        orders = ", ".join(str(field.order or "none") for field in fields)
        before = float(np.median([field.rms_px for field in fields]))
        after = float(np.median([field.rms_with_px for field in fields]))
        yield (
            f"{words}, field of the {first.model} model along {first.axis}: order {orders}; unseen "
            f"regions are off by {before:.4f} px, with the best order by {after:.4f} px."
        )


def _run(
    name: str, kept: Path, *, count: int, quick: bool, progress: Progress
) -> Iterable[ModelTrial]:
    """Calibrations as they are kept; those that are missing are run, each kept at once."""
    true = half_rig(RIGS[name][1]()) if quick else RIGS[name][1]()
    patterns = make_sequence("paper", width=true.projector.width, height=true.projector.height)
    held_out = cache(partial(HeldOut.of, true, patterns))
    for seed in progress(range(count), f"calibrating, {RIGS[name][0]}"):
        path = kept / f"{name}-{seed:02d}.json"
        if not path.exists():
            trial = run_models(
                (name, true),
                patterns,
                kept / f"{name}-{seed:02d}",
                held_out=held_out(),
                seed=seed,
                quick=quick,
                progress=no_progress,
            )
            write_text(path, _TRIAL.dump_json(trial, indent=1).decode() + "\n")
        yield _read(path)


def _read(path: Path) -> ModelTrial:
    try:
        return _TRIAL.validate_json(path.read_bytes())
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror})") from error
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        raise FormatError(
            f"{path}: not a calibration of this study ({first['msg']}); remove it, and it is run "
            "again"
        ) from error
