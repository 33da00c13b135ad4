"""Fringe orders on the command line: the code frame with a rig, without, and by name."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from fringeworks.files import read_phase
from tests.cli.scenes import run

PAPER = ("twin", "balls", "--rig", "paper", "--preset", "paper", "--axes", "x")


@pytest.fixture(scope="module")
def coded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two balls under fringes, Gray code and the paper's code frame."""
    folder = tmp_path_factory.mktemp("coded") / "balls"
    assert run(*PAPER, "--out", folder).exit_code == 0
    return folder


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory, coded: Path) -> Path:
    """The same capture without its Gray code."""
    folder = tmp_path_factory.mktemp("alone") / "balls"
    shutil.copytree(coded, folder)
    head, *sets = (coded / "capture.toml").read_text().split("[[set]]")
    kept = [text for text in sets if 'kind = "gray"' not in text]
    (folder / "capture.toml").write_text("[[set]]".join([head, *kept]))
    return folder


def test_repeating_orders_need_a_rig_or_a_range(alone: Path, tmp_path: Path) -> None:
    done = run("decode", alone, "--out", tmp_path / "p.npz")
    assert done.exit_code == 1
    assert "--rig rig.json" in done.stderr
    assert "--z-range MIN:MAX" in done.stderr
    assert not (tmp_path / "p.npz").exists()


def test_a_rig_gives_the_volume(alone: Path, coded: Path, tmp_path: Path) -> None:
    arguments = ("--rig", coded / "true_rig.json", "--out", tmp_path / "p.npz")
    done = run("decode", alone, *arguments)
    assert done.exit_code == 0, done.stderr
    assert "code frame of 2, 3, 4, 5, 6, 8 px" in done.stdout
    by_code = read_phase(tmp_path / "p.npz")
    assert run("decode", coded, "--out", tmp_path / "gray.npz").exit_code == 0
    by_gray = read_phase(tmp_path / "gray.npz")
    both = np.isfinite(by_code["column"]) & np.isfinite(by_gray["column"])
    assert np.count_nonzero(both) > 15_000
    np.testing.assert_array_equal(by_code["column"][both], by_gray["column"][both])


def test_a_range_that_the_objects_are_not_in(alone: Path, coded: Path, tmp_path: Path) -> None:
    # Nearer than 400 mm the code's repeats stand elsewhere: nothing, or not those orders.
    arguments = ("--rig", coded / "true_rig.json", "--z-range", "300:320")
    done = run("decode", alone, *arguments, "--out", tmp_path / "p.npz")
    assert done.exit_code == 1


def test_by_name(coded: Path, tmp_path: Path) -> None:
    rig = coded / "true_rig.json"
    arguments = ("scan", coded, "--rig", rig, "--out", tmp_path / "c.npz", "--json")
    counts = []
    for orders in ("gray", "code-frame"):
        done = run(*arguments, "--orders", orders)
        assert done.exit_code == 0, done.stderr
        counts.append(json.loads(done.stdout)["points"])
    # Gray's edges void a few pixels more or less than a region's.
    assert counts[1] == pytest.approx(counts[0], rel=0.01)
    done = run(*arguments, "--orders", "staircase")
    assert done.exit_code == 1
    assert "no staircase (`--code staircase`) along x" in done.stderr


def test_de_bruijn_needs_neither(tmp_path: Path) -> None:
    folder = tmp_path / "balls"
    options = ("--code", "none", "--codewords", "de-bruijn")
    assert run(*PAPER, *options, "--out", folder).exit_code == 0
    done = run("decode", folder, "--out", tmp_path / "p.npz", "--json")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["axes"]["x"]["valid_share"] > 0.05


def test_wrong_use(tmp_path: Path) -> None:
    done = run("decode", "c", "--out", tmp_path / "p.npz", "--z-range", "1:2")
    assert done.exit_code == 2
    assert "--z-range needs --rig rig.json" in done.stderr
    done = run("patterns", "paper", "--projector", "64x64", "--out", tmp_path / "x",
               "--codewords", "strong")  # fmt: skip
    assert done.exit_code == 2
    assert "--codewords must be paper, robust, de-bruijn, none, or periods" in done.stderr
