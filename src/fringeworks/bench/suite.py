"""All benchmarks in one call: what ``fringeworks bench`` prints."""

from __future__ import annotations

from collections.abc import Callable, Collection

from fringeworks.bench.accuracy import measure_accuracy
from fringeworks.bench.folder import measure_folder
from fringeworks.bench.metric import Metric
from fringeworks.bench.models import measure_models
from fringeworks.bench.process import measure_process
from fringeworks.bench.scan import measure_scan
from fringeworks.bench.spatial import measure_spatial
from fringeworks.bench.speed import measure_speed
from fringeworks.bench.stream import measure_stream
from fringeworks.bench.uncertainty import measure_uncertainty
from fringeworks.errors import UsageError
from fringeworks.model import Progress, no_progress


def measure_all_accuracy(*, quick: bool = False) -> list[Metric]:
    """Phases and orders, then whether clouds tell their own uncertainty."""
    return [*measure_accuracy(quick=quick), *measure_uncertainty(quick=quick)]


def measure_all_speed(*, quick: bool = False) -> list[Metric]:
    """Demodulation, frames to cloud, streams, spatial unwrapping, the paper's models and fit."""
    return [
        *measure_speed(quick=quick),
        *measure_scan(quick=quick),
        *measure_stream(quick=quick),
        *measure_spatial(quick=quick),
        *measure_models(quick=quick),
    ]


def measure_all_processes(*, quick: bool = False) -> list[Metric]:
    """Whole commands, then a folder of large images to a cloud file."""
    return [*measure_process(quick=quick), *measure_folder(quick=quick)]


GROUPS: dict[str, Callable[..., list[Metric]]] = {
    "accuracy": measure_all_accuracy,
    "speed": measure_all_speed,
    "process": measure_all_processes,
}
"""The first part of a metric's key, and what measures it."""


def run_suite(
    *,
    quick: bool = False,
    only: Collection[str] | None = None,
    progress: Progress | None = None,
) -> list[Metric]:
    """Metrics of all groups, or of those named in `only`.

    Parameters
    ----------
    quick
        The smallest image and few draws: a check that it runs, not a result.
    only
        Names of `GROUPS`.
    progress
        Wraps the iteration over the groups.

    Raises
    ------
    UsageError
        There is no group of that name.
    DecodeError
        A peer's phase is not ours, so that a ratio of times would mean nothing.
    """
    chosen = list(GROUPS) if only is None else list(dict.fromkeys(only))
    for name in chosen:
        if name not in GROUPS:
            raise UsageError(f"only must name groups of {', '.join(GROUPS)}, got '{name}'")
    wrap = progress or no_progress
    return [metric for name in wrap(chosen, "measuring") for metric in GROUPS[name](quick=quick)]
