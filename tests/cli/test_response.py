"""``response`` and ``--response``: from grey levels to patterns and scans, on the twin."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.files import (
    read_capture,
    read_response,
    read_rig,
    write_response,
    write_rig,
    write_sensor,
)
from fringeworks.files.response import response_of_rig, rig_with_response
from fringeworks.model import PhaseTerms, Response, Rig
from fringeworks.twin.effects import Effects, ProjectorEffects
from fringeworks.twin.scenes import paper_rig
from tests.cli.scenes import run
from tests.phase.responses import banded
from tests.scenes import CAMERA, RIG


def told(*arguments: object) -> dict[str, Any]:
    done = run(*arguments, "--json")
    assert done.exit_code == 0, done.stderr
    values = json.loads(done.stdout, parse_constant=pytest.fail)
    assert isinstance(values, dict)
    return values


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "rig.json"
    write_rig(path, banded(paper_rig()))
    return path


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sensor") / "sensor.toml"
    write_sensor(path, Effects(projector=ProjectorEffects(gamma=2.2)))
    return path


@pytest.fixture(scope="module")
def response(rig: Path, sensor: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A curve found from grey levels."""
    folder = tmp_path_factory.mktemp("levels")
    shown = ("--rig", rig, "--preset", "response", "--sensor", sensor)
    told("twin", "wall", *shown, "--out", folder / "levels")
    values = told("response", folder / "levels", "--out", folder / "response.json")
    assert values["response"]["way"] == "levels"
    assert values["response"]["curve"]["harmonics"][0] == pytest.approx(1.2 / 4.2, abs=0.004)
    return folder / "response.json"


@pytest.fixture(scope="module")
def bent(rig: Path, sensor: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wall under plain fringes of gamma 2.2."""
    folder = tmp_path_factory.mktemp("bent") / "wall"
    shown = ("--rig", rig, "--preset", "paper", "--codewords", "none", "--axes", "x")
    told("twin", "wall", *shown, "--sensor", sensor, "--out", folder)
    return folder


def test_patterns_are_bent_and_say_so(response: Path, sensor: Path, tmp_path: Path) -> None:
    size = ("--projector", "608x684", "--axes", "x")
    values = told("patterns", "measure", *size, "--out", tmp_path / "p", "--response", response)
    assert values["predistorted_by"] == "the response of levels"
    told("patterns", "measure", *size, "--out", tmp_path / "plain")
    bent, plain = (read_capture(tmp_path / name) for name in ("p", "plain"))
    assert bent.provenance["predistorted_by"] == "the response of levels"
    share = plain.frames[0] / 255
    # The level that makes a share of light is its power 1/2.2; three times the flicker of 0.3 %
    # of a level's light, and half a level of rounding in either image.
    off = bent.frames[0] / 255 - share ** (1 / 2.2)
    assert np.abs(off[share > 0.1]).max() < 3 * 0.003 / 2.2 + 0.5 / 255 * (1 + 1.6)
    assert np.abs(bent.frames[0] / 255 - share).max() > 0.2
    done = run("decode", tmp_path / "p", "--out", tmp_path / "d.npz", "--response", response)
    assert done.exit_code == 2
    assert "was shown with patterns pre-distorted by the response of levels" in done.stderr
    small = ("--projector", "64x48", "--out", tmp_path / "small")
    done = run("patterns", "measure", *small, "--response", response)
    assert done.exit_code == 2
    assert "of a projector of 608x684 px, this one has 64x48" in done.stderr


def test_levels_of_bent_patterns_bend_no_others(response: Path, tmp_path: Path) -> None:
    found = replace(read_response(response), predistorted_by="the response of levels")
    write_response(tmp_path / "left.json", found)
    size = ("--projector", "608x684", "--out", tmp_path / "p")
    done = run("patterns", "measure", *size, "--response", tmp_path / "left.json")
    assert done.exit_code == 2
    assert "by a curve of plain ones" in done.stderr


def test_a_rig_keeps_no_other_projectors(bent: Path, tmp_path: Path) -> None:
    wide = Rig(CAMERA, replace(RIG.projector, width=700), RIG.projector_from_camera)
    write_rig(tmp_path / "rig.json", wide)
    before = (tmp_path / "rig.json").read_bytes()
    out = tmp_path / "r.json"
    done = run("response", bent, "--out", out, "--way", "plane", "--rig", tmp_path / "rig.json")
    assert done.exit_code == 2
    assert "of a projector of 608x684 px, this one has 700x684" in done.stderr
    assert not out.exists()
    assert (tmp_path / "rig.json").read_bytes() == before


def test_a_rigs_broken_response_is_named(bent: Path, tmp_path: Path) -> None:
    rig = tmp_path / "rig.json"
    document = json.loads((bent / "true_rig.json").read_text())
    rig.write_text(json.dumps({**document, "response": {"format": "fringeworks-response/1"}}))
    done = run("scan", bent, "--rig", rig, "--out", tmp_path / "cloud.npz")
    assert done.exit_code != 0
    assert "rig, response: way is missing" in done.stderr


def test_a_rigs_response_that_does_not_fit_is_told(bent: Path, tmp_path: Path) -> None:
    terms = PhaseTerms("x", 31.0, (2.0, 0.0, -2.0), (0.0,), (0.1,))
    kept = rig_with_response(
        read_rig(bent / "true_rig.json"), Response("gray", "a", (terms,), 608, 684)
    )
    write_rig(tmp_path / "rig.json", kept)
    values = told("scan", bent, "--rig", tmp_path / "rig.json", "--out", tmp_path / "c.npz")
    assert values["response"] is None
    assert any("the rig's response was not used: " in text for text in values["findings"])


def test_a_scan_says_what_it_used(bent: Path, response: Path, tmp_path: Path) -> None:
    rig, cloud = bent / "true_rig.json", tmp_path / "cloud.npz"
    plain = told("scan", bent, "--rig", rig, "--out", cloud)
    assert plain["response"] is None
    used = told("scan", bent, "--rig", rig, "--out", cloud, "--response", response)
    assert used["response"]["kind"] == "curve of grey levels"
    assert any("found by levels in levels, was used" in text for text in used["findings"])
    rms = [
        told("measure", "plane", path)["form_rms_mm"]
        for path in (_scan(bent, tmp_path / "a.npz"), cloud)
    ]
    assert rms[0] > 2.0
    assert rms[1] < rms[0] / 5  # a curve knows no blur; the rest is noise of three steps of 32 px


def _scan(capture: Path, out: Path, *further: object) -> Path:
    told("scan", capture, "--rig", capture / "true_rig.json", "--out", out, *further)
    return out


def test_a_rig_keeps_it_for_scans(bent: Path, tmp_path: Path) -> None:
    rig = tmp_path / "rig.json"
    rig.write_bytes((bent / "true_rig.json").read_bytes())
    figures = tmp_path / "figures"
    values = told(
        "response", bent, "--out", tmp_path / "r.json", "--way", "plane", "--rig", rig,
        "--figures", figures,
    )  # fmt: skip
    (terms,) = values["response"]["terms"]
    assert terms["before"] > 0.19
    assert terms["after"] < 0.03
    assert (figures / "response.png").stat().st_size > 10_000
    kept = response_of_rig(read_rig(rig))
    assert kept is not None
    assert kept.way == "plane"
    cloud = tmp_path / "cloud.npz"
    for exact in ((), ("--figures", figures)):
        used = told("scan", bent, "--rig", rig, "--out", cloud, *exact)
        assert used["response"]["way"] == "plane"
        assert told("measure", "plane", cloud)["form_rms_mm"] < 0.4
    decoded = told("decode", bent, "--out", tmp_path / "d.npz", "--rig", rig)
    assert decoded["response"]["kind"] == "phase terms"


def test_curves_alone_bend_patterns(bent: Path, tmp_path: Path) -> None:
    told("response", bent, "--out", tmp_path / "r.json", "--way", "plane")
    size = ("--projector", "64x48", "--out", tmp_path / "p")
    done = run("patterns", "measure", *size, "--response", tmp_path / "r.json")
    assert done.exit_code == 2
    assert "holds phase terms: patterns are pre-distorted by a curve of grey levels" in done.stderr
    assert not (tmp_path / "p").exists()


def test_what_tells_no_response(bent: Path, tmp_path: Path) -> None:
    done = run("response", bent, "--out", tmp_path / "r.json")
    assert done.exit_code == 1
    assert "wall does not tell the response by itself" in done.stderr
    assert not (tmp_path / "r.json").exists()


def test_grey_levels_have_no_steps(tmp_path: Path) -> None:
    size = ("--projector", "64x48", "--out", tmp_path / "p")
    done = run("patterns", "response", *size, "--steps", "4")
    assert done.exit_code == 2
    assert "preset response shows grey levels" in done.stderr
    assert told("patterns", "response", *size)["images"] == 52
