"""The study of `check`: what is counted, and how it is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from fringeworks.experiments import check_study
from fringeworks.experiments.check_study import Told, draw_told, study_check
from fringeworks.experiments.faults import FAULTS, Case, Strength, good, half_rig


def harmless(strength: Strength, seed: int) -> Case:
    return Case(good(strength, seed), half_rig(), "gamma")


def test_faults_that_are_named_and_missed_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    some = {"bits swapped": FAULTS["bits swapped"], "harmless": harmless}
    monkeypatch.setattr(check_study, "FAULTS", some)
    monkeypatch.setattr(check_study, "tell_clean", lambda number: ("blur",) if number else ())
    study = study_check(tmp_path, quick=True)

    assert study.rows == (
        ("bits swapped", "bit order", "1 of 1", "-"),
        ("harmless", "gamma", "0 of 1", "nothing"),
    )
    assert "1 of 2 faults stand first under their name, 50.0%." in study.notes
    assert study.notes[-1].startswith("3 of 4 clean captures have a finding. number 1: blur")
    assert study.numbers["clean"] == [(), ("blur",), ("blur",), ("blur",)]


def test_costs_are_drawn_with_a_cross_for_another_name() -> None:
    told = [
        Told("one", 0, 1, "gamma", ("gamma",), 0.1, "mm"),
        Told("one", 2, 1, "gamma", ("motion", "gamma"), 0.4, "mm"),
        Told("two", 2, 1, "blur", (), None, None),
    ]
    (axes,) = draw_told(told).axes

    assert [line.get_marker() for line in axes.lines] == ["o", "x"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["one", "two"]
