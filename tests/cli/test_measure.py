"""``measure sphere`` and ``measure cylinder`` on clouds whose forms are known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.files import write_cloud
from fringeworks.model import Cloud
from tests.cli.scenes import plain, run

SD = 0.05
RADIUS = {"sphere": 40.0, "cylinder": 52.5}
CENTRE = np.array([10.0, -5.0, 700.0])


def cloud_of(form: str) -> Cloud:
    """What a camera with pixels 1 mm apart sees of the form; half of a wall stands behind it."""
    y, x = np.mgrid[-50.0:51, -60.0:61]
    square = RADIUS[form] ** 2 - x**2 - (y**2 if form == "sphere" else 0)
    noise = np.random.default_rng(6).normal(0, SD, x.shape)
    away = 1 + noise / RADIUS[form]
    seen = square > 0.2 * RADIUS[form] ** 2
    z = np.where(seen, -np.sqrt(np.abs(square)), np.where(x > 0, 200.0, np.nan))
    scale = np.where(seen, away, 1.0)
    height = y * (scale if form == "sphere" else 1)
    xyz = np.stack([x * scale, height, z * scale], axis=-1) + CENTRE
    flat = np.full(x.shape, SD, np.float32)
    return Cloud(xyz.astype(np.float32), flat, flat, flat)


def measure(form: str, cloud: Path, *options: object) -> dict[str, Any]:
    done = run("measure", form, cloud, "--json", *options)
    assert done.exit_code == 0, done.stderr
    values: dict[str, Any] = json.loads(done.stdout, parse_constant=pytest.fail)
    return values


@pytest.fixture(scope="module", params=["sphere", "cylinder"])
def scanned(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Path]:
    path = tmp_path_factory.mktemp("forms") / "cloud.npz"
    write_cloud(path, cloud_of(request.param))
    return request.param, path


BOX = ("--box", ":,:,600:720")
KEYS = {
    "sphere": {"centre_mm"},
    "cylinder": {"axis_point_mm", "axis_direction"},
}


def test_a_form_is_measured_where_it_is(scanned: tuple[str, Path]) -> None:
    form, cloud = scanned
    found = measure(form, cloud, *BOX)
    assert set(found) == KEYS[form] | {
        "radius_mm", "radius_sigma_mm", "radius_scale_sigma_mm", "form_rms_mm", "range_mm",
        "band95_mm", "points", "cloud", "frame",
    }  # fmt: skip
    # Some 4000 points; float32 rounds at 3e-5 mm, below all of this.
    assert abs(found["radius_mm"] - RADIUS[form]) < 5 * found["radius_sigma_mm"] < 0.05
    assert found["form_rms_mm"] == pytest.approx(SD, rel=5 / np.sqrt(2 * found["points"]))
    assert found["form_rms_mm"] < found["band95_mm"] < found["range_mm"]
    assert found["frame"] == "camera"
    assert found["radius_scale_sigma_mm"] is None


def test_a_radius_is_known_no_better_than_the_boards_pitch(
    scanned: tuple[str, Path], tmp_path: Path
) -> None:
    form, plain_cloud = scanned
    cloud = tmp_path / "cloud.npz"
    write_cloud(cloud, replace(cloud_of(form), scale_sigma=1.5e-4))
    found = measure(form, cloud, *BOX)
    assert found["radius_scale_sigma_mm"] == pytest.approx(1.5e-4 * found["radius_mm"])
    assert found["radius_sigma_mm"] == measure(form, plain_cloud, *BOX)["radius_sigma_mm"]
    told = plain(run("measure", form, cloud, *BOX).stdout)
    assert "radius scale sigma 0.00" in told
    assert "by the calibration board's pitch" in told
    far = measure("plane", cloud, "--box", ":,:,850:")
    assert far["offset_scale_sigma_mm"] == pytest.approx(1.5e-4 * 900)


def test_place_of_the_sphere(tmp_path: Path) -> None:
    write_cloud(tmp_path / "c.ply", cloud_of("sphere"))
    found = measure("sphere", tmp_path / "c.ply", *BOX)
    # Known about as well as the radius, across better.
    np.testing.assert_allclose(found["centre_mm"], CENTRE, atol=6 * found["radius_sigma_mm"])


def test_place_of_the_cylinder(tmp_path: Path) -> None:
    write_cloud(tmp_path / "c.xyz", cloud_of("cylinder"))
    found = measure("cylinder", tmp_path / "c.xyz", *BOX)
    direction = np.array(found["axis_direction"])
    assert direction[1] == pytest.approx(1, abs=1e-6)
    away = np.linalg.norm(np.cross(np.array(found["axis_point_mm"]) - CENTRE, direction))
    assert away < 6 * found["radius_sigma_mm"]


def test_a_window_of_pixels(scanned: tuple[str, Path]) -> None:
    form, cloud = scanned
    found = measure(form, cloud, "--pixels", "40:79,30:69")
    assert found["points"] == 40 * 40
    assert abs(found["radius_mm"] - RADIUS[form]) < 5 * found["radius_sigma_mm"]


def test_what_it_says(scanned: tuple[str, Path]) -> None:
    form, cloud = scanned
    told = run("measure", form, cloud, *BOX).stdout
    first, *facts = told.splitlines()
    assert first.startswith(f"{form} through ")
    assert first.endswith(" points of cloud.npz, frame: camera")
    names = ["centre"] if form == "sphere" else ["axis point", "axis direction"]
    names += ["radius", "radius sigma", "form rms", "band95", "range"]
    assert [plain(line.strip().split("  ")[0]) for line in facts] == names
    assert all(" mm" in line for line in facts if "direction" not in line)


def test_no_point_is_left_out(scanned: tuple[str, Path]) -> None:
    """With the wall in the box the form is wrong, and its form rms tells."""
    form, cloud = scanned
    assert measure(form, cloud)["form_rms_mm"] > 10 * SD


def test_a_plane_is_neither(scanned: tuple[str, Path], tmp_path: Path) -> None:
    form, _ = scanned
    cloud = cloud_of("sphere")
    cloud.xyz[..., 2] = 700 + np.random.default_rng(1).normal(0, SD, cloud.xyz.shape[:2])
    write_cloud(tmp_path / "c.npz", cloud)
    done = run("measure", form, tmp_path / "c.npz", "--json")
    assert (done.exit_code, done.stdout) == (1, "")
    assert f"do not tell a {form} from a plane" in plain(done.stderr)


@pytest.mark.parametrize("form", ["sphere", "cylinder"])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--box", "0:1"], "--box must be X0:X1,Y0:Y1,Z0:Z1"),
        (["--pixels", "0:9,0:9"], "on the camera's grid"),
    ],
)
def test_wrong_use(form: str, options: list[str], message: str, tmp_path: Path) -> None:
    done = run("measure", form, tmp_path / "cloud.ply", *options)
    assert done.exit_code == 2
    assert message in done.stderr
