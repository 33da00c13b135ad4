"""``fringeworks bench STUDY``; its trials are canned."""

from __future__ import annotations

import json
from functools import cache, partial
from pathlib import Path

import pytest

from fringeworks.experiments import calibrations
from fringeworks.experiments.held_rig import Yardstick
from fringeworks.experiments.trials import Kind, Trial
from fringeworks.twin.scenes import paper_rig
from tests.cli.scenes import run
from tests.experiments import canned


@pytest.fixture
def _canned(monkeypatch: pytest.MonkeyPatch) -> None:
    def fake(kind: Kind, _: Yardstick, *, seed: int, poses: int) -> Trial:
        assert poses == 7
        return canned.trial(kind, seed)

    monkeypatch.setattr(calibrations, "run_trial", fake)
    once = cache(partial(calibrations._yardstick, calibrations.half_rig(paper_rig())))
    monkeypatch.setattr(calibrations, "_yardstick", lambda _: once())


@pytest.mark.usefixtures("_canned")
def test_a_study_is_printed_and_written(tmp_path: Path) -> None:
    told = run("bench", "calibration", "--quick", "--out", tmp_path)
    assert told.exit_code == 0, told.stderr
    lines = told.stdout.splitlines()
    assert "beside the plain OpenCV chain" in lines[0]
    assert lines[2].split()[:6] == ["wall,", "p95,", "median,", "mm", "0.0020", "0.0300"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "calibration.json",
        "calibration.png",
        "seeds-quick",
    ]
    done = run("bench", "calibration", "--quick", "--json", "--out", tmp_path)
    values = json.loads(done.stdout, parse_constant=pytest.fail)
    assert values["table"][0]["ours"] == "0.0020"
    assert len(values["trials"]) == 4
    assert values["true_rig"]["wall_p95_mm"] > 0
    kept = json.loads((tmp_path / "calibration.json").read_text())
    assert kept == {key: values[key] for key in values if key != "written"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("tea",), "study must be one of calibration"),
        (("calibration", "--only", "speed"), "--only chooses metrics"),
        (("--seeds", "3"), "belong to a study"),
        (("calibration", "--quick", "--seeds", "3"), "leave --seeds out"),
        (("calibration", "--seeds", "0"), "greater than or equal to 1"),
    ],
)
def test_wrong_use(words: tuple[str, ...], message: str, tmp_path: Path) -> None:
    told = run("bench", *words, *(("--out", tmp_path) if "--seeds" not in words else ()))
    assert told.exit_code == 2
    assert message in told.stderr
    assert not list(tmp_path.iterdir())
