"""``fringeworks check``: words, JSON, pictures and page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fringeworks.cli.app import app
from fringeworks.experiments.faults import FAULTS, good
from fringeworks.files import write_capture


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("check") / "bent"
    write_capture(FAULTS["gamma"](2, 2).capture, folder)
    return folder


def test_json_has_the_findings_with_cost_and_remedy(bent: Path, tmp_path: Path) -> None:
    page = tmp_path / "check.html"
    run = CliRunner().invoke(
        app, ["check", str(bent), "--json", "--figures", str(tmp_path), "--report", str(page)]
    )

    assert run.exit_code == 0, run.output
    found = json.loads(run.stdout)
    assert not found["clean"]
    assert found["mm_per_px"] is None
    first = found["findings"][0]
    assert (first["name"], first["unit"]) == ("gamma", "px")
    assert first["cost"] > 0
    assert (tmp_path / "1_gamma.png").is_file()
    assert "linear mode" in page.read_text(encoding="utf-8")


def test_words_name_fault_cost_and_remedy(bent: Path) -> None:
    run = CliRunner().invoke(app, ["check", str(bent)])

    assert run.exit_code == 0, run.output
    assert "1 fault, the costliest first" in run.stdout
    assert "gamma (" in run.stdout
    assert "not looked for: epipolar lines" in run.stdout


def test_a_clean_capture_is_said_to_be_clean(tmp_path: Path) -> None:
    folder = tmp_path / "clean"
    write_capture(good(0, 2), folder)
    run = CliRunner().invoke(app, ["check", str(folder), "--json"])

    assert run.exit_code == 0, run.output
    told = json.loads(run.stdout)
    assert told["clean"]
    assert any("--rig" in reason for reason in told["not_looked_for"])
