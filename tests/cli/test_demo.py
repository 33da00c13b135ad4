"""The demo where it has nothing to run on, and the bench as a command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fringeworks.bench import suite
from fringeworks.bench.metric import Metric
from fringeworks.cli.calibrate import find_captures
from fringeworks.errors import UsageError
from fringeworks.files import data_folder, find_data
from tests.cli.scenes import run


def test_without_data_the_demo_says_what_it_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FRINGEWORKS_DATA", str(tmp_path))
    done = run("demo", "--out", tmp_path / "out")
    assert (done.exit_code, done.stdout) == (1, "")
    for word in ("sample/procam-half", str(tmp_path), "examples/README.md", "FRINGEWORKS_DATA"):
        assert word in done.stderr
    assert "error" not in done.stderr.lower()
    assert not (tmp_path / "out").exists()


def test_data_are_looked_for_beside_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FRINGEWORKS_DATA", raising=False)
    checkout = Path(__file__).resolve().parents[2]
    assert data_folder() == checkout.parent / "shared" / "data"


def test_sets_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FRINGEWORKS_DATA", str(tmp_path))
    (tmp_path / "sample" / "dome").mkdir(parents=True)
    assert find_data("dome") == tmp_path / "sample" / "dome"
    (tmp_path / "real" / "dome").mkdir(parents=True)
    assert find_data("dome") == tmp_path / "real" / "dome"
    assert find_data("plane") is None


def test_captures_of_a_folder_stand_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for name in ("pose_10", "pose_9", "pose_1"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "capture.toml").touch()
    (tmp_path / "other").mkdir()
    assert [path.name for path in find_captures([tmp_path])] == ["pose_1", "pose_9", "pose_10"]
    assert find_captures([tmp_path / "pose_9"]) == [tmp_path / "pose_9"]
    with pytest.raises(UsageError, match="neither a capture nor a folder of captures"):
        find_captures([tmp_path / "other"])


def test_bench_prints_metrics(monkeypatch: pytest.MonkeyPatch) -> None:
    metrics = [
        Metric("speed.wrap", 0.5, "ms", "lower", "bar 1"),
        Metric("speed.peer", None, "x", "higher", "skipped: not installed"),
    ]
    monkeypatch.setattr(suite, "run_suite", lambda **_: metrics)
    told = run("bench")
    assert told.exit_code == 0, told.stderr
    assert told.stdout.splitlines()[1].split() == ["speed.wrap", "0.5", "ms", "bar", "1"]
    values = json.loads(run("bench", "--json").stdout)["metrics"]
    assert values[0] == {
        "key": "speed.wrap",
        "value": 0.5,
        "unit": "ms",
        "direction": "lower",
        "note": "bar 1",
    }
    assert values[1]["value"] is None
