from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from fringeworks.files import read_image, read_phase
from tests.cli.scenes import run


def only_sets(capture: Path, folder: Path, kinds: tuple[str, ...]) -> Path:
    """A copy of a capture with the sets of these kinds alone."""
    shutil.copytree(capture, folder)
    head, *sets = (capture / "capture.toml").read_text().split("[[set]]")
    kept = [text for text in sets if any(f'kind = "{kind}"' in text for kind in kinds)]
    (folder / "capture.toml").write_text("[[set]]".join([head, *kept]))
    return folder


def test_what_is_written_and_said(seen: Path, tmp_path: Path) -> None:
    done = run("decode", seen, "--out", tmp_path / "new" / "phase.npz")
    assert (done.exit_code, done.stderr) == (0, "")
    assert "axis x: projector column of 100.0% of the pixels" in done.stdout
    assert "fringes of 16 px" in done.stdout
    assert "void    none" in done.stdout
    assert "from the residual of the fit" in done.stdout
    arrays = read_phase(tmp_path / "new" / "phase.npz")
    assert {"column", "row", "order_x", "wrapped_y", "sigma_px_x", "offset"} <= set(arrays)


def test_json_alone_stands_on_standard_output(seen: Path, tmp_path: Path) -> None:
    done = run("decode", seen, "--out", tmp_path / "phase.npz", "--json")
    values = json.loads(done.stdout, parse_constant=pytest.fail)
    assert values["axes"]["x"]["absolute"] is True
    assert values["axes"]["x"]["noise"]["source"] == "residual"
    assert values["figures"] == values["findings"] == []


def test_figures_of_every_map(seen: Path, tmp_path: Path) -> None:
    done = run("decode", seen, "--out", tmp_path / "p.npz", "--figures", tmp_path / "f", "--json")
    drawn = [Path(name).name for name in json.loads(done.stdout)["figures"]]
    assert sorted(drawn) == sorted(path.name for path in (tmp_path / "f").iterdir())
    stages = ("modulation_{}", "wrapped_{}", "order_{}", "sigma_px_{}", "voids_{}")
    names = {stage.format(axis) + ".png" for stage in stages for axis in "xy"}
    assert set(drawn) == names | {"column.png", "row.png"}


def test_fringes_without_a_code_are_relative(seen: Path, tmp_path: Path) -> None:
    fringes = only_sets(seen, tmp_path / "fringes", ("fringe",))
    arguments = ("decode", fringes, "--out", tmp_path / "phase.npz")
    done = run(*arguments, "--figures", tmp_path / "figures")
    assert done.exit_code == 0
    assert "axis y: only relative, wrapped phase of 100.0% of the pixels" in done.stdout
    assert "the orders of the fringes of 16 px cannot be told" in done.stdout
    arrays = read_phase(tmp_path / "phase.npz")
    assert np.isfinite(arrays["wrapped_x"]).all()
    assert "column" not in arrays
    assert (tmp_path / "figures" / "wrapped_y.png").is_file()
    axis = json.loads(run(*arguments, "--json").stdout)["axes"]["x"]
    assert (axis["absolute"], axis["period_px"]) == (False, 16.0)


def test_nothing_coded_gives_no_result(seen: Path, tmp_path: Path) -> None:
    white = only_sets(seen, tmp_path / "white", ("uniform",))
    done = run("decode", white, "--out", tmp_path / "phase.npz", "--json")
    assert (done.exit_code, done.stdout) == (1, "")
    assert done.stderr.startswith("error: no axis has a projector coordinate")
    assert not (tmp_path / "phase.npz").exists()


@pytest.mark.parametrize("kinds", [("fringe", "gray", "uniform"), ("fringe",)])
def test_darkness_gives_no_result(seen: Path, tmp_path: Path, kinds: tuple[str, ...]) -> None:
    dark = only_sets(seen, tmp_path / "dark", kinds)
    for path in dark.glob("*.png"):
        cv2.imwrite(str(path), np.full((96, 128), 3, np.uint8))
    done = run("decode", dark, "--out", tmp_path / "phase.npz")
    assert done.exit_code == 1
    assert "100.0% too little modulation" in done.stderr or "no axis" in done.stderr
    assert not (tmp_path / "phase.npz").exists()


def test_least_modulation_is_a_grey_level(seen: Path, tmp_path: Path) -> None:
    """The fringes' modulation is 0.8 * 127.5 = 102 grey levels everywhere."""
    arguments = ("decode", seen, "--out", tmp_path / "phase.npz", "--json", "--min-modulation")
    assert json.loads(run(*arguments, 101).stdout)["axes"]["x"]["valid_share"] == 1.0
    assert run(*arguments, 103).exit_code == 1
    assert run(*arguments, -1).exit_code == 2


def test_a_group_that_is_not_there(seen: Path, tmp_path: Path) -> None:
    done = run("decode", seen, "--out", tmp_path / "phase.npz", "--group", "bright")
    assert done.exit_code == 2
    assert "'bright'" in done.stderr


def test_only_npz_is_written(seen: Path, tmp_path: Path) -> None:
    done = run("decode", seen, "--out", tmp_path / "phase.txt")
    assert done.exit_code == 2
    assert ".npz" in done.stderr


def test_findings_stand_on_standard_error(seen: Path, tmp_path: Path) -> None:
    folder = tmp_path / "jpeg"
    shutil.copytree(seen, folder)
    for path in folder.glob("*.png"):
        quality = [cv2.IMWRITE_JPEG_QUALITY, 100]
        cv2.imwrite(str(path.with_suffix(".jpg")), read_image(path), quality)
    text = (folder / "capture.toml").read_text().replace(".png", ".jpg")
    (folder / "capture.toml").write_text(text)
    done = run("decode", folder, "--out", tmp_path / "phase.npz", "--json")
    assert done.exit_code == 0
    assert "jpeg: warning:" in done.stderr
    assert any("JPEG" in finding for finding in json.loads(done.stdout)["findings"])
