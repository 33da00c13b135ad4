"""The studies of zones and of `watch`, as short as they can be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fringeworks.experiments.watching import study_watching
from fringeworks.experiments.zone_trials import Place, make_workplace, run_trial
from fringeworks.experiments.zones import SMALLER_MM, study_zones
from fringeworks.model import no_progress

WORKPLACE = make_workplace()


@pytest.mark.parametrize("place", ["inside", "outside", "empty"])
def test_an_alarm_means_a_thing_inside(place: Place) -> None:
    """20 mm, anywhere up to 2 m; of the 500 scans of the whole study these are the first."""
    for seed in range(2):
        made = run_trial(WORKPLACE, place, 20.0, rng=np.random.default_rng([3, seed]))
        assert made.alarm == (place == "inside")
        assert (made.points > 0) == made.alarm
        assert np.isnan(made.depth_mm) == (place == "empty")


def test_the_study_of_zones(tmp_path: Path) -> None:
    made = study_zones(tmp_path, seeds=None, quick=True, progress=no_progress)
    assert [row[0] for row in made.rows] == ["20 mm", *(f"{size:g} mm" for size in SMALLER_MM)]
    assert [row[1] for row in made.rows] == ["2", "1", "1", "1", "1"]
    assert made.notes[0] == "false alarms without a thing: 0 of 1"
    assert len(made.numbers["trials"]) == 8
    assert made.draw().axes


def test_the_study_of_watch(tmp_path: Path) -> None:
    made = study_watching(tmp_path, seeds=None, quick=True, progress=no_progress)
    assert made.numbers["scans"] == 3
    assert made.numbers["alarms"] == {"cone": 3}
    assert "all that was told 1 times, every cloud whole 1 times" in made.notes[2]
    assert made.draw().axes
