"""``scan`` and ``measure plane`` on a plane whose place is known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.files import read_cloud
from tests.cli.scenes import PLANE_MM, PLANE_NORMAL, run

Scan = tuple[Path, Path]


@pytest.fixture(scope="module")
def cloud(plane_scan: Scan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    capture, rig = plane_scan
    path = tmp_path_factory.mktemp("cloud") / "cloud.npz"
    done = run("scan", capture, "--rig", rig, "--out", path)
    assert done.exit_code == 0, done.stderr
    return path


def measure(cloud: Path, *options: object) -> dict[str, Any]:
    done = run("measure", "plane", cloud, "--json", *options)
    assert done.exit_code == 0, done.stderr
    values: dict[str, Any] = json.loads(done.stdout, parse_constant=pytest.fail)
    return values


def test_a_plane_is_measured_where_it_is(cloud: Path) -> None:
    """Over n points the offset's standard deviation is sigma / sqrt(n); both are known."""
    found = measure(cloud)
    sigma = float(np.nanmedian(read_cloud(cloud).sigma_mm))
    assert found["points"] > 100_000
    assert found["offset_mm"] == pytest.approx(PLANE_MM, abs=0.01)
    assert np.dot(found["normal"], PLANE_NORMAL) == pytest.approx(1, abs=1e-8)
    assert found["form_rms_mm"] < 2 * sigma
    assert found["band95_mm"] < found["flatness_mm"]
    assert found["frame"] == "camera"


def test_what_scan_says(plane_scan: Scan, tmp_path: Path) -> None:
    capture, rig = plane_scan
    arguments = ("scan", capture, "--rig", rig, "--out", tmp_path / "deep" / "cloud.ply")
    done = run(*arguments, "--figures", tmp_path / "figures", "--json")
    assert done.exit_code == 0, done.stderr
    values = json.loads(done.stdout, parse_constant=pytest.fail)
    assert values["points"] == len(read_cloud(tmp_path / "deep" / "cloud.ply").points())
    assert 0 < values["epipolar_rms_px"] < 0.1
    names = {Path(name).name for name in values["figures"]}
    assert {"depth.png", "sigma_mm.png", "epipolar_px.png", "cloud.png", "column.png"} <= names
    assert names == {path.name for path in (tmp_path / "figures").iterdir()}
    told = run(*arguments).stdout
    assert f"plane: {values['points']} points, frame: camera" in told
    assert "mm, median of the random part" in told


def test_one_axis_alone(plane_scan: Scan, tmp_path: Path) -> None:
    capture, rig = plane_scan
    arguments = ("scan", capture, "--rig", rig, "--out", tmp_path / "c.npz", "--axis", "x")
    done = run(*arguments, "--json")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["epipolar_rms_px"] is None
    assert measure(tmp_path / "c.npz")["offset_mm"] == pytest.approx(PLANE_MM, abs=0.01)


def test_a_depth_range(plane_scan: Scan, tmp_path: Path) -> None:
    capture, rig = plane_scan
    arguments = ("scan", capture, "--rig", rig, "--out", tmp_path / "c.npz", "--z-range")
    assert run(*arguments, "780:800").exit_code == 0
    z = read_cloud(tmp_path / "c.npz").points()[:, 2]
    assert (z.min() >= 780, z.max() <= 800) == (True, True)
    nothing = run(*arguments, "100:200")
    assert nothing.exit_code == 1
    assert "no pixel gives a point between z = 100 and 200 mm" in nothing.stderr
    assert run(*arguments, "200:100").exit_code == 2


def test_a_rig_of_another_camera(seen: Path, plane_scan: Scan, tmp_path: Path) -> None:
    _, rig = plane_scan
    done = run("scan", seen, "--rig", rig, "--out", tmp_path / "c.npz")
    assert done.exit_code == 1
    assert "608x684 like the rig's, got 128x96" in done.stderr


def test_a_rig_that_is_none(plane_scan: Scan, tmp_path: Path) -> None:
    capture, _ = plane_scan
    (tmp_path / "rig.json").write_text("{}")
    done = run("scan", capture, "--rig", tmp_path / "rig.json", "--out", tmp_path / "c.npz")
    assert done.exit_code == 1
    assert "format must be 'fringeworks-rig/1'" in done.stderr


def test_regions_with_negative_numbers(cloud: Path) -> None:
    whole = measure(cloud)["points"]
    apart = measure(cloud, "--box", "-50:50,-40:40,700:900")["points"]
    joined = measure(cloud, "--box=-50:50,-40:40,700:900")["points"]
    opened = measure(cloud, "--box", "-50:50,-40:40,:")["points"]
    assert 0 < apart == joined == opened < whole
    assert measure(cloud, "--pixels", "600:699,50:99")["points"] == 100 * 50


def test_what_measure_says(cloud: Path) -> None:
    told = run("measure", "plane", cloud).stdout
    lines = [line.split() for line in told.splitlines()]
    assert [line[0] for line in lines] == [
        "plane",
        "normal",
        "offset",
        "form",
        "band95",
        "flatness",
    ]
    assert all(line[-1] == "mm" for line in lines[2:])


@pytest.mark.parametrize(
    ("options", "status", "message"),
    [
        (["--box", "0:1,0:1,0:1"], 1, "the region holds no point; the cloud's points span"),
        (["--box", "0:1"], 2, "--box must be X0:X1,Y0:Y1,Z0:Z1"),
        (["--pixels", "5:5,0:9"], 2, "must rise"),
    ],
)
def test_regions_that_are_none(cloud: Path, options: list[str], status: int, message: str) -> None:
    done = run("measure", "plane", cloud, *options)
    assert (done.exit_code, done.stdout) == (status, "")
    assert message in done.stderr


def test_pixels_need_the_grid(cloud: Path, tmp_path: Path) -> None:
    done = run("measure", "plane", tmp_path / "cloud.ply", "--pixels", "0:9,0:9")
    assert done.exit_code == 2
    assert "on the camera's grid" in done.stderr
