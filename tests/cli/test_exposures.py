"""Several exposures through the commands: written, simulated, decoded, scanned, drawn, checked."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fringeworks.files import read_capture, read_cloud, write_rig
from fringeworks.model import Camera, Lens
from fringeworks.twin.scenes import paper_rig
from tests.cli.scenes import plain, run


@pytest.fixture(scope="module")
def ladder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The contrast scene at two exposures, seen by a small camera; its rig beside it."""
    folder = tmp_path_factory.mktemp("ladder")
    rig = paper_rig()
    small = Camera(188, 120, Lens(493.5, 493.5, 94.95, 58.675))
    write_rig(folder / "rig.json", type(rig)(small, rig.projector, rig.projector_from_camera))
    done = run(
        "twin", "contrast", "--rig", folder / "rig.json", "--preset", "measure", "--axes", "x",
        "--exposures", "4,64", "--out", folder / "seen",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    return folder


def test_files_have_names_of_their_own(ladder: Path) -> None:
    names = {path.name for path in (ladder / "seen").glob("*.png")}
    assert len(names) == 2 * 17
    assert {"fringe_x_p16_4ms_0.png", "white_64ms.png"} <= names
    exposures = [item.exposure_ms for item in read_capture(ladder / "seen").sequence.sets]
    assert exposures == [4.0] * 4 + [64.0] * 4


def test_decode_says_and_draws_which_were_fused(ladder: Path, tmp_path: Path) -> None:
    arguments = ("decode", ladder / "seen", "--out", tmp_path / "p.npz")
    assert "exposures  fused; weighing most: 4 ms " in run(*arguments).stdout
    done = run(*arguments, "--json", "--figures", tmp_path / "figures")
    told = json.loads(done.stdout)["axes"]["x"]["exposures"]
    assert [entry["exposure_ms"] for entry in told] == [4.0, 64.0]
    assert sum(entry["share"] for entry in told) == pytest.approx(1.0)
    assert (tmp_path / "figures" / "exposures_x.png").is_file()


def test_scan_says_so_and_brightness_is_of_the_longest(ladder: Path, tmp_path: Path) -> None:
    out = tmp_path / "cloud.npz"
    done = run("scan", ladder / "seen", "--rig", ladder / "rig.json", "--out", out)
    assert done.exit_code == 0, done.output
    assert "exposures were fused; the decoded pixels rest most on 4 ms (" in plain(done.stderr)
    intensity = read_cloud(out).intensity
    assert np.nanmax(intensity) > 255  # the white box at 64 ms, were there no full scale


def test_check_finds_nothing_wrong_with_it(ladder: Path) -> None:
    assert json.loads(run("check", ladder / "seen", "--json").stdout)["findings"] == []


def test_patterns_list_the_exposures(tmp_path: Path) -> None:
    done = run(
        "patterns", "measure", "--projector", "64x48", "--axes", "x", "--exposures", "2,8",
        "--out", tmp_path / "shown",
    )  # fmt: skip
    assert "fringes along x, period 16 px, 8 ms" in done.stdout
    assert (tmp_path / "shown" / "fringe_x_p16_8ms_7.png").is_file()


@pytest.mark.parametrize("exposures", ["2,2", "0,1", "-1", "none"])
def test_refused(tmp_path: Path, exposures: str) -> None:
    done = run(
        "patterns", "measure", "--projector", "64x48", f"--exposures={exposures}",
        "--out", tmp_path / "shown",
    )  # fmt: skip
    assert done.exit_code == 2
    assert "exposures must be one or more different times above 0 ms" in plain(done.stderr)
