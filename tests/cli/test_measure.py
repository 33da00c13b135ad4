"""``measure`` on clouds whose forms are known: forms, the search for them, sections."""

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
    "sphere": {"centre_mm", "centre_sigma_mm"},
    "cylinder": {
        "axis_point_mm", "axis_point_sigma_mm", "axis_direction", "axis_tilt_sigma_deg",
    },
}  # fmt: skip


def test_a_form_is_measured_where_it_is(scanned: tuple[str, Path]) -> None:
    form, cloud = scanned
    found = measure(form, cloud, *BOX)
    assert set(found) == KEYS[form] | {
        "radius_mm", "radius_sigma_mm", "radius_scale_sigma_mm", "form_rms_mm", "range_mm",
        "band95_mm", "points", "weighted", "left_out", "cloud", "frame", "figures",
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


WALL_POINTS = {
    form: int(np.count_nonzero(cloud_of(form).xyz[..., 2] > 800)) for form in ("sphere", "cylinder")
}


def test_weights_that_are_all_one(scanned: tuple[str, Path]) -> None:
    """Sigma is the same everywhere; across the form it falls off towards its rims."""
    form, cloud = scanned
    found = measure(form, cloud, *BOX, "--weighted")
    assert found["weighted"] is True
    assert found["radius_mm"] != measure(form, cloud, *BOX)["radius_mm"]
    assert abs(found["radius_mm"] - RADIUS[form]) < 0.05


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
    robust = measure(form, cloud, "--robust")
    assert abs(robust["radius_mm"] - RADIUS[form]) < 5 * robust["radius_sigma_mm"]
    # 0.2 % of the form's own points lie beyond four standard deviations or at its rim.
    assert robust["left_out"] == pytest.approx(WALL_POINTS[form], rel=0.02)
    assert robust["points"] + robust["left_out"] == np.count_nonzero(cloud_of(form).valid)


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


@pytest.fixture(scope="module")
def cone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A right-angled cone, its apex on top, pixels 1 mm apart."""
    y, x = np.mgrid[5.0:60, -50.0:51]
    square = y**2 - x**2
    noise = np.random.default_rng(2).normal(0, SD, x.shape)
    z = np.where(square > 0.2 * y**2, -np.sqrt(np.abs(square)) + noise, np.nan)
    flat = np.full(x.shape, SD, np.float32)
    xyz = (np.stack([x, y, z], axis=-1) + CENTRE).astype(np.float32)
    path = tmp_path_factory.mktemp("cone") / "cloud.npz"
    write_cloud(path, Cloud(xyz, flat, flat, flat, frame="camera"))
    return path


class TestCone:
    def test_values(self, cone: Path) -> None:
        found = measure("cone", cone)
        assert set(found) == {
            "apex_mm", "apex_sigma_mm", "axis_direction", "axis_tilt_sigma_deg", "half_angle_deg",
            "half_angle_sigma_deg", "form_rms_mm", "range_mm", "band95_mm", "points", "weighted",
            "left_out", "cloud", "frame", "figures",
        }  # fmt: skip
        assert abs(found["half_angle_deg"] - 45) < 5 * found["half_angle_sigma_deg"] < 1
        np.testing.assert_allclose(found["axis_direction"], [0, 1, 0], atol=5e-3)
        off = np.abs(np.subtract(found["apex_mm"], CENTRE))
        assert np.all(off < 5 * np.array(found["apex_sigma_mm"]))

    def test_words_and_picture(self, cone: Path, tmp_path: Path) -> None:
        done = run("measure", "cone", cone, "--figures", tmp_path)
        assert "half angle sigma" in done.stdout
        assert "degrees by the points' scatter" in done.stdout
        assert (tmp_path / "cone.png").stat().st_size > 20_000


def test_sigmas_of_a_plane(tmp_path: Path) -> None:
    write_cloud(tmp_path / "c.npz", cloud_of("sphere"))
    found = measure("plane", tmp_path / "c.npz", "--box", ":,:,850:")
    assert 0 <= found["offset_sigma_mm"] < 1e-4
    assert 0 <= found["tilt_sigma_deg"] < 1e-4
    write_cloud(tmp_path / "three.xyz", cloud_of("sphere"))
    (tmp_path / "three.xyz").write_text("0 0 700\n10 0 700\n0 10 701\n")
    assert measure("plane", tmp_path / "three.xyz")["offset_sigma_mm"] is None
    assert "unknown: there are no more" in run("measure", "plane", tmp_path / "three.xyz").stdout


class TestAuto:
    def test_what_is_there(self, scanned: tuple[str, Path], tmp_path: Path) -> None:
        form, cloud = scanned
        found = measure("auto", cloud, "--figures", tmp_path)
        assert {one["form"] for one in found["forms"]} == {form, "plane"}
        (round_,) = (one for one in found["forms"] if one["form"] == form)
        assert abs(round_["radius_mm"] - RADIUS[form]) < 5 * round_["radius_sigma_mm"]
        assert sum(one["points"] for one in found["forms"]) <= found["points"]
        assert found["tolerance_mm"] == pytest.approx(4 * found["noise_mm"])
        assert (tmp_path / "forms.png").stat().st_size > 10_000

    def test_words(self, scanned: tuple[str, Path]) -> None:
        form, cloud = scanned
        told = run("measure", "auto", cloud, *BOX).stdout
        assert told.startswith("1 form in ")
        assert f"1  {form}" in told
        assert "of no form" in told

    def test_a_cloud_without_grid(self, scanned: tuple[str, Path], tmp_path: Path) -> None:
        form, _ = scanned
        write_cloud(tmp_path / "c.ply", cloud_of(form))
        done = run("measure", "auto", tmp_path / "c.ply", "--figures", tmp_path)
        assert done.exit_code == 0, done.stderr
        assert (tmp_path / "forms.png").exists()

    def test_wrong_use(self, scanned: tuple[str, Path]) -> None:
        assert run("measure", "auto", scanned[1], "--least", "0").exit_code == 2
        assert run("measure", "auto", scanned[1], "--tolerance", "-1").exit_code == 2
        done = run("measure", "auto", scanned[1], "--box", "0:1,0:1,:")
        assert done.exit_code == 1
        assert "at least 100 points" in done.stderr


@pytest.fixture(scope="module")
def rod(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rod") / "cloud.npz"
    write_cloud(path, cloud_of("cylinder"))
    return path


class TestSection:
    def test_one(self, rod: Path, tmp_path: Path) -> None:
        options = ("--along", "y", "--at", "3.5", *BOX, "--figures", tmp_path)
        found = measure("section", rod, *options)
        # Columns up to 0.89 R: 46 mm each side.
        assert found["half_chord_mm"] == pytest.approx(46, abs=0.2)
        assert abs(found["radius_mm"] - RADIUS["cylinder"]) < 5 * found["radius_sigma_mm"]
        assert found["points"] == 93
        assert found["end_a_mm"][1] == pytest.approx(3.5, abs=1e-6)
        assert (tmp_path / "section.png").stat().st_size > 20_000

    def test_a_series_along_the_fitted_axis(self, rod: Path, tmp_path: Path) -> None:
        found = measure("section", rod, "--range=-20:20", *BOX, "--figures", tmp_path)
        assert found["sections"] == 41
        assert found["along"][1] == pytest.approx(1, abs=1e-5)
        off = abs(found["radius_mean_mm"] - RADIUS["cylinder"])
        assert off < 5 * np.mean(found["radius_sigma_mm"]) / np.sqrt(41)
        assert found["at_mm"][0] == -20
        assert (tmp_path / "series.png").stat().st_size > 20_000

    def test_where_no_arc_is(self, rod: Path) -> None:
        done = run("measure", "section", rod, "--along", "y", "--box", ":,:,850:")
        assert done.exit_code == 0
        assert "none: the 14 points do not tell a circle from a line" in done.stdout

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            (["--at", "1", "--range", "0:9"], "--at is for one section, --range for many"),
            (["--range", "0:"], "--range must have both ends"),
            (["--range", "0:9", "--step", "0"], "--step must be above 0"),
            (["--range", "0:9000", "--step", "0.01"], "more than 10000"),
            (["--along", "w"], "--along must be numbers"),
            (["--along", "1,2"], "--along must be x, y, z, cylinder or NX,NY,NZ"),
        ],
    )
    def test_wrong_use(self, rod: Path, options: list[str], message: str) -> None:
        done = run("measure", "section", rod, *options, *BOX)
        assert done.exit_code == 2
        assert message in plain(done.stderr)

    def test_a_cloud_without_grid(self, rod: Path, tmp_path: Path) -> None:
        write_cloud(tmp_path / "c.xyz", cloud_of("cylinder"))
        done = run("measure", "section", tmp_path / "c.xyz", "--along", "y", *BOX)
        assert done.exit_code == 2
        assert "give its thickness" in plain(done.stderr)
        found = measure("section", tmp_path / "c.xyz", "--along", "y", "--thickness", "3", *BOX)
        assert abs(found["radius_mm"] - RADIUS["cylinder"]) < 5 * found["radius_sigma_mm"]
