"""``fringeworks advise``: words, JSON, pictures, page, and the blur that a rig keeps."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fringeworks.cli.app import app
from fringeworks.diagnose.advice_blur import best_even_period
from fringeworks.files import read_capture, read_rig, write_capture, write_rig
from fringeworks.files.blur import blur_of_rig
from tests.calibrate.faults import half_rig
from tests.diagnose.probed import probe, sharpened


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("advise") / "test"
    write_capture(probe(warp=sharpened(0.6)), folder)
    return folder


def run(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(item) for item in arguments])
    assert done.exit_code == 0, done.output
    return done.stdout


def test_words_end_in_a_command_that_works(frames: Path, tmp_path: Path) -> None:
    said = run("advise", frames, "--exposure-ms", 10)
    assert "change: sharpening" in said
    command = said.strip().splitlines()[-1].split()
    assert command[:3] == ["fringeworks", "patterns", "measure"]
    out = tmp_path / "patterns"
    run(*command[1:-1], out)
    assert (out / "capture.toml").is_file()


def test_json_pictures_and_page(frames: Path, tmp_path: Path) -> None:
    page = tmp_path / "advice.html"
    asked = ("--json", "--figures", tmp_path, "--report", page, "--sigma-px", 0.05)
    found = json.loads(run("advise", frames, *asked))
    assert found["exposures_ms"] is None
    assert found["coverage"] > 0.98
    assert found["wanted_sigma_px"] == 0.05
    assert [item["name"] for item in found["change"]] == ["sharpening"]
    assert {path.stem for path in tmp_path.glob("*.png")} == {
        "exposures", "blur_x", "blur_y", "change_1_sharpening",
    }  # fmt: skip
    assert found["commands"][0] in page.read_text(encoding="utf-8")


def test_a_rig_keeps_the_blur_and_patterns_take_their_period_from_it(
    frames: Path, tmp_path: Path
) -> None:
    rig = tmp_path / "rig.json"
    write_rig(rig, half_rig())
    refused = ("patterns", "measure", "--projector", "304x342", "--rig", str(rig), "--out")
    without = CliRunner().invoke(app, [*refused, str(tmp_path / "none")])
    assert without.exit_code == 2
    assert "keeps no blur" in without.stderr

    found = json.loads(run("advise", frames, "--rig", rig, "--json"))
    kept = blur_of_rig(read_rig(rig))
    assert kept == found["blur_px"]
    shown = json.loads(run(*refused, tmp_path / "patterns", "--json"))
    period = best_even_period(max(kept.values()))
    assert f"period {period:g} px" in shown["sets"][0]["pattern"]
    assert "8 steps reject harmonics 2 to 6" in shown["explained"]
    both = CliRunner().invoke(app, [*refused, str(tmp_path / "none"), "--periods", "8"])
    assert both.exit_code == 2
    assert "leave --periods out" in both.stderr


def test_presets_are_listed_with_their_reasons() -> None:
    said = run("patterns", "--list")
    assert "multi-frequency: 4 steps reject harmonic 2 and let 3 and 5 through" in said
    assert len(said.strip().splitlines()) == 6


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--exposure-ms", "0", "positive"),
        ("--sigma-px", "-1", "positive"),
        ("--mains-hz", "5", "10"),
    ],
)
def test_wrong_use(option: str, value: str, words: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["advise", str(tmp_path), option, value])
    assert done.exit_code == 2
    assert words in done.stderr


def test_another_exposure_than_the_captures_is_refused(frames: Path, tmp_path: Path) -> None:
    once = read_capture(frames)
    sets = tuple(replace(item, exposure_ms=10.0) for item in once.sequence.sets)
    write_capture(replace(once, sequence=replace(once.sequence, sets=sets)), tmp_path / "said")
    arguments = ["advise", str(tmp_path / "said"), "--exposure-ms"]
    assert CliRunner().invoke(app, [*arguments, "20"]).exit_code == 2
    assert CliRunner().invoke(app, [*arguments, "10"]).exit_code == 0
