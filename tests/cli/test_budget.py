"""``budget``: tables, pictures and plans."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fringeworks.files import read_image, write_rig
from fringeworks.model import Camera
from fringeworks.twin.scenes import paper_rig
from tests.cli.scenes import plain, run
from tests.uncertainty.rigs import calibrated


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "rig.json"
    write_rig(path, calibrated())
    return path


def values_of(*arguments: object) -> dict[str, Any]:
    done = run("budget", *arguments, "--json")
    assert done.exit_code == 0, done.stderr
    values: dict[str, Any] = json.loads(done.stdout, parse_constant=pytest.fail)
    return values


def test_where_it_comes_from(rig: Path, tmp_path: Path) -> None:
    found = values_of("--rig", rig, "--out", tmp_path)
    assert found["depths_mm"][0] == 560.0
    assert found["depths_mm"][-1] == 740.0
    assert {source["kind"] for source in found["sources"]} == {"model", "parameters", "phase"}
    sampled = found["monte_carlo_mm"]
    assert sampled["depths_mm"] == [560.0, 650.0, 740.0]
    assert sampled["phase"][1] == pytest.approx(found["classes_mm"]["phase"][7], rel=0.1)
    assert found["images_mm"] is None
    assert read_image(tmp_path / "budget.png").shape[0] > 300
    assert found["figures"] == [(tmp_path / "budget.png").as_posix()]


def test_what_it_says(rig: Path) -> None:
    told = plain(run("budget", "--rig", rig).stdout)
    for words in (
        "class sigma of z, mm, at z = 560 mm 650 mm 740 mm",
        "parameters rotation R",
        "of the form alone (aligned)",
        "phase camera: shot noise",
        "all together",
        "one fringe of depth, mm",
        "working range",
    ):
        assert words in told
    without = plain(run("budget", "--rig", "paper", "--z-range", "600:700").stdout)
    assert "600 mm 650 mm 700 mm" in without
    assert "the rig keeps no covariance" in without


def test_choices_change_the_numbers(rig: Path) -> None:
    """Four times the steps halve the noise; equation 1 leaves distortion out."""
    few = values_of("--rig", rig, "--steps", 4, "--axes", "x")
    many = values_of("--rig", rig, "--steps", 16, "--axes", "x", "--model", "geometric")
    shot = [
        next(one for one in found["sources"] if one["name"] == "camera: shot noise")["sigma_mm"]
        for found in (few, many)
    ]
    assert shot[0] == pytest.approx([2 * value for value in shot[1]])
    assert max(few["classes_mm"]["model"]) <= 1e-3 < min(many["classes_mm"]["model"])


def test_images_agree_with_the_closed_form(tmp_path: Path) -> None:
    """On the middle of the camera's image; a tenth leaves room for the flicker that was drawn."""
    rig = paper_rig()
    lens = replace(rig.camera.lens, cx=rig.camera.lens.cx - 296, cy=rig.camera.lens.cy - 180)
    write_rig(tmp_path / "cut.json", replace(rig, camera=Camera(160, 120, lens)))
    found = values_of("--rig", tmp_path / "cut.json", "--axes", "x", "--twin")
    closed = [found["classes_mm"]["phase"][place] for place in (0, 7, 14)]
    observed, predicted = found["images_mm"]
    assert observed == pytest.approx(closed, rel=0.1)
    assert predicted == pytest.approx(closed, rel=0.1)


def test_a_plan() -> None:
    found = values_of("--rig", "paper", "--plan", "550:800", "--sigma", 0.1)
    best = found["choices"][0]
    assert max(best["sigma_mm"]) <= 0.1
    told = plain(run("budget", "--rig", "paper", "--plan", "550:800", "--sigma", 0.1).stdout)
    assert told.startswith(f"a baseline of {best['baseline_mm']:.0f} mm with fringes of")
    assert "(wanted 0.1 mm)" in told


@pytest.mark.parametrize(
    ("options", "status", "message"),
    [
        (["--plan", "550:800"], 2, "--plan and --sigma go together"),
        (["--plan", "800:550", "--sigma", "0.1"], 2, "must rise"),
        (["--plan", "550:800", "--sigma", "0.001"], 1, "no choice reaches 0.001 mm"),
        (["--z-range", "700:"], 2, "--z-range must rise from above 0, MIN:MAX in mm"),
        (["--z-range", "10:20"], 2, "must light the wall at z = 10 mm"),
    ],
)
def test_what_it_refuses(options: list[str], status: int, message: str) -> None:
    done = run("budget", "--rig", "paper", *options)
    assert done.exit_code == status
    assert message in plain(done.stderr)
    assert done.stdout == ""
