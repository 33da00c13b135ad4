"""``scan`` and ``measure plane`` on a plane whose place is known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.files import read_capture, read_cloud, read_rig, write_capture, write_rig
from fringeworks.model import Extended
from fringeworks.patterns import frequency_ladder
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


@pytest.fixture(scope="module")
def shallow(plane_scan: Scan, tmp_path_factory: pytest.TempPathFactory) -> Scan:
    """The capture along x alone, and a rig that knows its volume, so that it has a table."""
    folder, read = tmp_path_factory.mktemp("shallow"), read_capture(plane_scan[0])
    along_x = [n for n, item in enumerate(read.sequence.sets) if "'x'" in repr(item.pattern)]
    sequence = replace(read.sequence, sets=tuple(read.sequence.sets[n] for n in along_x))
    frames = tuple(read.frames[n] for n in along_x)
    write_capture(replace(read, sequence=sequence, frames=frames), folder / "plane")
    write_rig(folder / "rig.json", replace(read_rig(plane_scan[1]), volume_mm=(700.0, 900.0)))
    return folder / "plane", folder / "rig.json"


@pytest.mark.parametrize("way", ["--exact", "--figures"])
def test_other_ways_lead_to_the_same_points(shallow: Scan, tmp_path: Path, way: str) -> None:
    """Solving every pixel, and stopping where there is something to draw; not bit for bit."""
    capture, rig = shallow
    options = [way] if way == "--exact" else [way, tmp_path / "figures"]
    clouds = []
    for name, more in (("table.npz", []), ("other.npz", options)):
        done = run("scan", capture, "--rig", rig, "--out", tmp_path / name, *more)
        assert done.exit_code == 0, done.stderr
        clouds.append(read_cloud(tmp_path / name))
    table, other = clouds
    np.testing.assert_array_equal(table.reason, other.reason)
    np.testing.assert_allclose(table.xyz, other.xyz, rtol=0, atol=1e-3)
    assert (table.xyz[table.valid] != other.xyz[table.valid]).any()


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
        "tilt",
        "offset",
        "offset",
        "form",
        "band95",
        "flatness",
    ]
    assert all({"mm", "degrees"} & set(line) for line in lines[2:])


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


def test_the_papers_models(plane_scan: Scan, tmp_path: Path) -> None:
    """The finest fringes are of the ladder's last period; without distortion of the projector in
    the model the plane of this rig is bent. All ten at zero change nothing."""
    capture, rig = plane_scan
    out = tmp_path / "c.npz"
    geometric = run("scan", capture, "--rig", rig, "--out", out, "--model", "geometric", "--json")
    assert geometric.exit_code == 0, geometric.stderr
    assert json.loads(geometric.stdout)["epipolar_rms_px"] is None
    bent, points = measure(out)["form_rms_mm"], read_cloud(out).xyz
    assert bent > 0.1
    lacking = run("scan", capture, "--rig", rig, "--out", out, "--model", "extended")
    assert lacking.exit_code == 2
    assert "no extended parameters: calibrate with --extended map" in lacking.stderr
    read = read_rig(rig)
    finest = frequency_ladder(read.projector.width)[-1]
    write_rig(tmp_path / "zeros.json", replace(read, extended=Extended("x", finest)))
    done = run(
        "scan", capture, "--rig", tmp_path / "zeros.json", "--out", out, "--model", "extended"
    )
    assert done.exit_code == 0, done.stderr
    np.testing.assert_array_equal(read_cloud(out).xyz, points)
    write_rig(tmp_path / "other.json", replace(read, extended=Extended("x", finest + 1)))
    other = run(
        "scan", capture, "--rig", tmp_path / "other.json", "--out", out, "--model", "extended"
    )
    assert other.exit_code == 2
    assert "the rig's extended parameters belong to fringes of" in other.stderr
