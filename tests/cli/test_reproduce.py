"""The command: once in full, quickly, and with a chapter of one row in place of all others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fringeworks.experiments.paper import reproduce
from fringeworks.experiments.paper.chapter import Chapter, Row
from fringeworks.experiments.paper.lab import Lab
from tests.cli.scenes import run, shrink_camera

ROW = Row("radius, mm", "52.53", "52.50", "true 52.5")


def make(lab: Lab) -> Chapter:
    return Chapter("A chapter", "Words.", (ROW,), numbers={"quick": lab.quick, "nan": float("nan")})


@pytest.fixture
def _one_chapter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reproduce, "CHAPTERS", {"one": make})
    monkeypatch.setattr(Lab, "prepare", lambda lab, scenes: None)


@pytest.mark.slow
def test_the_whole_paper_quickly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a quick look has no room to get wrong: four poses, one capture of each scene.

    The camera's pixels are a third larger: half as large again, a codeword may be lost.
    """
    shrink_camera(monkeypatch, 4 / 3)
    done = run("reproduce", "--quick", "--json", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.stderr
    chapters = json.loads(done.stdout)["chapters"]
    assert set(chapters) == set(reproduce.CHAPTERS)
    drawn = {path.name[:9] for path in (tmp_path / "out" / "figures").iterdir()}
    assert drawn >= {f"figure_{number:02d}" for number in range(1, 15)}
    rows = {
        row["quantity"]: row["ours"] for chapter in chapters.values() for row in chapter["rows"]
    }
    assert float(rows["the same without noise, mm"]) == pytest.approx(52.5, abs=0.02)
    assert rows["hand: pixels as by Gray code"].startswith(("100.00%", "99.9"))


@pytest.mark.usefixtures("_one_chapter")
def test_rows_are_printed_and_files_written(tmp_path: Path) -> None:
    done = run("reproduce", "--quick", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "A chapter"
    assert lines[2].split() == ["radius,", "mm", "52.53", "52.50", "true", "52.5"]
    values = json.loads((tmp_path / "out" / "reproduction.json").read_text())
    assert values["chapters"]["one"]["numbers"] == {"quick": True, "nan": None}
    for name in ("reproduction.md", "comparison.md"):
        assert "| radius, mm | 52.53 | 52.50 |" in (tmp_path / "out" / name).read_text()
    assert "A chapter" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.usefixtures("_one_chapter")
def test_json_is_the_file(tmp_path: Path) -> None:
    done = run("reproduce", "--json", "--out", tmp_path / "out")
    values = json.loads(done.stdout, parse_constant=pytest.fail)
    kept = json.loads((tmp_path / "out" / "reproduction.json").read_text())
    assert values["chapters"] == kept["chapters"]
    assert len(values["written"]) == 4


def test_help_has_an_example() -> None:
    assert "reproduce --out out/reproduce --quick" in run("reproduce", "--help").stdout


def test_every_figure_of_the_paper_has_a_chapter() -> None:
    source = Path(reproduce.__file__).parent
    text = "".join(path.read_text(encoding="utf-8") for path in sorted(source.glob("*.py")))
    for number in range(1, 15):
        assert f"figure_{number:02d}" in text
