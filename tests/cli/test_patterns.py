"""``patterns``, and decode(render(x)) = x through files and commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fringeworks.files import read_capture, read_image, read_phase, write_image
from fringeworks.model import Fringe, GrayCode
from tests.cli.scenes import BRIGHT, run, see

WIDTH, HEIGHT = 160, 120


@pytest.mark.parametrize("preset", ["paper", "calibrate", "measure", "multi-frequency"])
def test_what_is_rendered_is_decoded(preset: str, tmp_path: Path) -> None:
    """The tolerance is five sigma of rounding to grey levels, twice: pattern and camera."""
    size = f"{WIDTH}x{HEIGHT}"
    done = run("patterns", preset, "--projector", size, "--out", tmp_path / "patterns")
    assert done.exit_code == 0, done.stderr
    see(tmp_path / "patterns", tmp_path / "capture")
    done = run("decode", tmp_path / "capture", "--out", tmp_path / "phase.npz", "--json")
    assert done.exit_code == 0, done.stderr
    axes = json.loads(done.stdout)["axes"]
    assert [axis["valid_share"] for axis in axes.values()] == [1.0, 1.0]

    phase = read_phase(tmp_path / "phase.npz")
    fringes = [item for item, *_ in read_capture(tmp_path / "capture").find(Fringe)]
    for name, truth in (("column", np.arange(WIDTH)), ("row", np.arange(HEIGHT)[:, None])):
        axis = "x" if name == "column" else "y"
        finest = min((f for f in fringes if f.axis == axis), key=lambda f: f.period_px)
        rounding = np.sqrt(2 / 12) / (BRIGHT * 255 / 2)
        sigma = finest.period_px / (2 * np.pi) * np.sqrt(2 / finest.frame_count) * rounding
        assert np.abs(phase[name] - truth).max() < 5 * sigma


def test_the_table_and_the_json_tell_the_same(tmp_path: Path) -> None:
    arguments = ("patterns", "paper", "--projector", "128x96", "--out")
    told = run(*arguments, tmp_path / "a")
    values = json.loads(run(*arguments, tmp_path / "b", "--json").stdout)
    assert values["images"] == len(list((tmp_path / "b").glob("*.png")))
    assert f"wrote {values['images']} images and capture.toml in {tmp_path / 'a'}" in told.stdout
    for item in values["sets"]:
        assert item["pattern"] in told.stdout
        assert item["images"][0] in told.stdout
    assert values["projector"] == {"width": 128, "height": 96}


def test_options_replace_the_preset(tmp_path: Path) -> None:
    options = ("--axes", "y", "--steps", "5", "--periods", "24", "--code", "gray", "--bits", "16")
    done = run("patterns", "paper", "--projector", "128x96", "--out", tmp_path / "p", *options)
    assert done.exit_code == 0, done.stderr
    capture = read_capture(tmp_path / "p")
    ((fringe, frames, _),) = capture.find(Fringe)
    assert (fringe.axis, fringe.period_px, fringe.frame_count) == ("y", 24.0, 5)
    assert frames.dtype == np.uint16
    ((code, _, _),) = capture.find(GrayCode)
    assert (code.complementary, code.inverted) == (False, False)


def test_no_code_frame_and_inverses_by_option(tmp_path: Path) -> None:
    options = ("--codewords", "none", "--inverted")
    done = run("patterns", "paper", "--projector", "128x96", "--out", tmp_path / "p", *options)
    assert done.exit_code == 0, done.stderr
    assert not list((tmp_path / "p").glob("*codeword*"))
    assert all(code.inverted for code, *_ in read_capture(tmp_path / "p").find(GrayCode))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--projector", "12"], "WIDTHxHEIGHT"),
        (["--projector", "0x0"], "projector"),
        (["--projector", "128x96", "--steps", "2"], "steps must be"),
        (["--projector", "128x96", "--periods", "1"], "periods_px must be"),
        (["--projector", "128x96", "--periods", "a"], "--periods must be numbers"),
        (["--projector", "128x96", "--bits", "7"], "bits must be"),
    ],
)
def test_nonsense_is_wrong_use(options: list[str], message: str, tmp_path: Path) -> None:
    done = run("patterns", "measure", "--out", tmp_path / "p", *options)
    assert done.exit_code == 2
    assert message in done.stderr
    assert not (tmp_path / "p" / "capture.toml").exists()


def test_a_folder_with_files_is_not_written_into(tmp_path: Path) -> None:
    """It may hold a measurement: the camera's images carry the names of the patterns."""
    arguments = ("patterns", "measure", "--projector", "128x96", "--out", tmp_path)
    (tmp_path / ".hidden").touch()
    assert run(*arguments).exit_code == 0
    image = next(tmp_path.glob("*_0.png"))
    measured = np.full((96, 128), 7, np.uint8)
    write_image(image, measured)
    refused = run(*arguments)
    assert refused.exit_code == 2
    assert "holds" in refused.stderr
    assert "--overwrite" in refused.stderr
    assert np.array_equal(read_image(image), measured)
    assert run(*arguments, "--overwrite").exit_code == 0
    assert not np.array_equal(read_image(image), measured)


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "p").touch()
    done = run("patterns", "measure", "--projector", "128x96", "--out", tmp_path / "p")
    assert done.exit_code == 2
    assert "must be a folder" in done.stderr
