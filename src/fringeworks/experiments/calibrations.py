"""The study of calibrations: many on the twin, beside the plain chain of OpenCV.

Boards in poses drawn anew are captured by the paper's rig with noise and 8 bits; every rig that
comes out is held against the truth on scans without noise (`held_rig`), so that only bias counts.
Some more trials have a bowed board, and lenses beyond the model. `docs/calibration-study.md` has
what it printed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from fringeworks.errors import FormatError
from fringeworks.experiments.calibration_figure import draw_trials
from fringeworks.experiments.calibration_table import HEAD, Results, make_notes, make_rows
from fringeworks.experiments.held_rig import Yardstick, hold_rig
from fringeworks.experiments.study import Study
from fringeworks.experiments.trials import Kind, Trial, run_trial
from fringeworks.files.atomic import write_text
from fringeworks.model import Camera, Lens, Progress, Projector, Rig, no_progress
from fringeworks.patterns import make_sequence
from fringeworks.twin.scenes import paper_rig, warped_rig

SEEDS, FURTHER_SEEDS = 20, 5
POSES, QUICK_POSES = 14, 7

FAR_BEYOND = 10.0
"""The terms of the twin's warped rig, multiplied so: its own are lost in the noise."""

FLAT = Kind("flat")
BOWED = Kind("bowed", bow_mm=(0.12, 0.06), shapes=("flat", "paraboloid"))
WARPED, FAR_WARPED = Kind("warped"), Kind("far_warped")

_TRIAL = TypeAdapter(Trial)


@dataclass(frozen=True, slots=True)
class _Job:
    """Trials of one kind; `yardstick` makes what they are held against, where one is missing."""

    kind: Kind
    yardstick: Callable[[], Yardstick]
    seeds: int


def study_calibrations(
    folder: Path, *, seeds: int | None = None, quick: bool = False, progress: Progress = no_progress
) -> Study:
    """Run the trials that `folder` does not have yet, and tell what all of them say.

    Parameters
    ----------
    folder
        Each trial is kept in ``seeds/KIND-NN.json`` there (quick ones in ``seeds-quick``). Remove
        them where the code has changed.
    seeds
        Trials with a flat board, 20 by default; of the other kinds there are 5 at most.
    quick
        One of each, with half the poses and pixels: its numbers mean nothing.

    Raises
    ------
    FormatError
        A kept trial cannot be read.
    CalibrationError
        A trial gives no rig.
    """
    count = 1 if quick else seeds or SEEDS
    size = half_rig if quick else lambda rig: rig
    few = min(count, FURTHER_SEEDS)
    true, warped, far_warped = (
        cache(partial(_yardstick, size(rig)))
        for rig in (paper_rig(), warped_rig(), far_warped_rig())
    )
    jobs = (
        _Job(FLAT, true, count),
        _Job(BOWED, true, few),
        _Job(WARPED, warped, few),
        _Job(FAR_WARPED, far_warped, few),
    )
    kept = folder / ("seeds-quick" if quick else "seeds")
    poses = QUICK_POSES if quick else POSES
    trials = [trial for job in jobs for trial in _run(job, kept, poses=poses, progress=progress)]
    results = Results(trials, hold_rig(true().rig, true()))
    return Study(
        title=f"{count} calibrations from {poses} poses each, beside the plain OpenCV chain",
        head=HEAD,
        rows=tuple(make_rows(results)),
        notes=tuple(make_notes(results)),
        numbers={
            "true_rig": asdict(results.true),
            "trials": [asdict(trial) for trial in trials],
        },
        draw=partial(draw_trials, results),
    )


def far_warped_rig() -> Rig:
    """The twin's warped rig with all that its lenses do beyond the five terms ten times as large.

    In the image's corner the camera's pupil then stands 0.27 mm off its place, the projector's 2.2.
    """
    rig = warped_rig()
    beyond = {
        device: {name: FAR_BEYOND * value for name, value in terms.items()}
        for device, terms in rig.further["twin"].items()
    }
    return replace(rig, further={"twin": beyond})


def half_rig(rig: Rig) -> Rig:
    """The same rig with half as many pixels each way, of both devices."""
    camera, projector = rig.camera, rig.projector
    return replace(
        rig,
        camera=Camera(camera.width // 2, camera.height // 2, _half_lens(camera.lens)),
        projector=Projector(
            projector.width // 2, projector.height // 2, _half_lens(projector.lens)
        ),
    )


def _half_lens(lens: Lens) -> Lens:
    """Pixel centres are whole numbers: the image's edge, -1/2, stays where it is."""
    return replace(
        lens,
        fx=lens.fx / 2,
        fy=lens.fy / 2,
        cx=(lens.cx + 0.5) / 2 - 0.5,
        cy=(lens.cy + 0.5) / 2 - 0.5,
    )


def _run(job: _Job, kept: Path, *, poses: int, progress: Progress) -> Iterable[Trial]:
    """Trials as they are kept; those that are missing are run, each kept at once."""
    for seed in progress(range(job.seeds), f"calibrating, {job.kind.name.replace('_', ' ')}"):
        path = kept / f"{job.kind.name}-{seed:02d}.json"
        if not path.exists():
            trial = run_trial(job.kind, job.yardstick(), seed=seed, poses=poses)
            write_text(path, _TRIAL.dump_json(trial, indent=1).decode() + "\n")
        yield _read(path, job.kind, seed)


def _yardstick(rig: Rig) -> Yardstick:
    width, height = rig.projector.width, rig.projector.height
    return Yardstick.of(rig, make_sequence("paper", width=width, height=height))


def _read(path: Path, kind: Kind, seed: int) -> Trial:
    try:
        trial = _TRIAL.validate_json(path.read_bytes())
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror})") from error
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        key = "".join(f"{part}." for part in first["loc"])[:-1]
        raise _no_trial(path, f"{key}: {first['msg']}" if key else first["msg"]) from error
    if (trial.kind, trial.seed) != (kind.name, seed):
        raise _no_trial(path, f"it holds seed {trial.seed} of kind '{trial.kind}'")
    return trial


def _no_trial(path: Path, why: str) -> FormatError:
    return FormatError(f"{path}: not this trial ({why}); remove it, and it is run again")
