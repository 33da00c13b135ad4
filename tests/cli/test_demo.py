"""The demo, its report in a real browser, and the bench as a command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.bench import suite
from fringeworks.bench.metric import Metric
from fringeworks.cli.calibrate import find_captures
from fringeworks.errors import UsageError
from fringeworks.files import (
    data_folder,
    find_data,
    read_board,
    read_capture,
    read_cloud,
    read_rig,
    read_truth,
)
from tests.browser import Browser
from tests.cli.scenes import run, shrink_camera


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], str]:
    """The quick demo without real images: its folder, its numbers, and what it says beside them.

    Its camera has a quarter of the paper's pixels.
    """
    folder = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FRINGEWORKS_DATA", str(folder / "nothing"))
        shrink_camera(patch, 2)
        done = run("demo", "--quick", "--json", "--out", folder / "out")
    assert done.exit_code == 0, done.stderr
    return folder / "out", json.loads(done.stdout, parse_constant=pytest.fail), done.stderr


@pytest.mark.slow
def test_the_loop_finds_the_truth(quick: tuple[Path, dict[str, Any], str]) -> None:
    """Five poses only: these bars are there to notice what breaks, not to show what is best.

    Noise alone gives the radius a sigma of 0.008 mm, twice that of four times the pixels; the
    calibration errs by about half as much again.
    One percent of the baseline, 1.9 mm, would be 1.3 % of every depth: 0.3 mm is a sixth of that.
    """
    measures = {row["name"]: row for row in quick[1]["twin"]["measures"]}
    radius = measures["cylinder, radius"]
    assert radius["truth"] == 52.5
    assert radius["measured"] == pytest.approx(52.5, abs=0.03)
    assert measures["two objects, cylinder's radius"]["measured"] == pytest.approx(52.5, abs=0.04)
    assert measures["predicted over observed sigma"]["measured"] == pytest.approx(1.0, abs=0.1)
    assert measures["cylinder, depth bias p95"]["measured"] < 0.02
    form = measures["cylinder, form rms"]["measured"]
    assert form == pytest.approx(quick[1]["twin"]["form_rms_predicted_mm"], rel=0.1)
    assert measures["baseline"]["measured"] == pytest.approx(189.325, abs=0.3)
    assert quick[1]["twin"]["poses"] == 5


@pytest.mark.slow
def test_the_demo_says_what_real_images_it_lacks(quick: tuple[Path, dict[str, Any], str]) -> None:
    _, values, said = quick
    assert values["real"] is None
    for word in ("sample/procam-half", "nothing", "examples/README.md", "FRINGEWORKS_DATA"):
        assert word in said
    assert "error" not in said.lower()


@pytest.mark.slow
def test_the_demo_leaves_everything_it_used(quick: tuple[Path, dict[str, Any], str]) -> None:
    out, values, _ = quick
    assert json.loads((out / "demo.json").read_text()) == values
    twin = out / "twin"
    assert read_capture(twin / "board" / "pose_04").sequence == read_capture(twin / "two").sequence
    assert read_board(twin / "board" / "board.toml").pitch_x_mm == 13.0
    assert read_rig(twin / "rig.json").quality is not None
    for name in ("cylinder", "two"):
        cloud = read_cloud(twin / name / "cloud.npz")
        truth = read_truth(twin / name / "truth.npz")
        both = cloud.valid & np.isfinite(truth.column)  # not where only a pixel's edge is lit
        assert np.abs(cloud.xyz - truth.xyz)[both].max() < 15  # a fringe more or less is 65 mm
    pictures = {path.name for path in (out / "figures").iterdir()}
    assert {"bias.png", "capture.png", "residuals.png", "depth.png", "cloud.png"} <= pictures


@pytest.mark.slow
def test_the_report_opens_in_a_browser(
    quick: tuple[Path, dict[str, Any], str], browser: Browser
) -> None:
    visit = browser.visit(quick[0] / "report.html", height=1600)
    assert visit.console == []
    assert visit.requests == set()
    seen = visit.picture[500:1250].reshape(-1, 3)  # where the cylinder's cloud is drawn
    assert len(np.unique(seen, axis=0)) > 1000


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
