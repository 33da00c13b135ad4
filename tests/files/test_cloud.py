from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_cloud, write_cloud
from fringeworks.model import Cloud, Reason

H, W = 6, 8


def plane() -> Cloud:
    """A plane that falls by 0.5 mm per column, with one void pixel at its edge."""
    row, column = np.mgrid[:H, :W].astype(np.float32)
    xyz = np.stack([column, row, 500 - column / 2], axis=-1).astype(np.float32)
    xyz[0, 0] = np.nan
    sigma = (0.01 * (1 + row)).astype(np.float32)
    return Cloud(xyz, sigma, 20 * column + row, 0.1 * row, frame="board")


def colours(dtype: Any = np.uint8) -> Any:
    rng = np.random.default_rng(5)
    return rng.integers(0, 250, (H, W, 3)).astype(dtype)


@pytest.mark.parametrize("colour", [None, colours(), colours(np.uint16)])
def test_npz_keeps_everything(tmp_path: Path, colour: Any) -> None:
    cloud = replace(plane(), colour=colour, scale_sigma=1.5e-4)
    write_cloud(tmp_path / "a.npz", cloud)
    again = read_cloud(tmp_path / "a.npz")
    for name in ("xyz", "sigma_mm", "intensity", "epipolar_px", "colour"):
        np.testing.assert_array_equal(getattr(again, name), getattr(cloud, name))
    assert (again.frame, again.scale_sigma) == ("board", 1.5e-4)
    assert again.xyz.dtype == np.float32


def test_npz_keeps_what_is_known_of_each_point(tmp_path: Path) -> None:
    reason = np.zeros((H, W), np.uint8)
    reason[0, 0] = Reason.MIXED
    cloud = replace(plane(), systematic_mm=2 * plane().sigma_mm, reason=reason)
    write_cloud(tmp_path / "a.npz", cloud)
    again = read_cloud(tmp_path / "a.npz")
    assert again.systematic_mm is not None
    np.testing.assert_array_equal(again.systematic_mm, 2 * cloud.sigma_mm)
    np.testing.assert_array_equal(again.reason, reason)
    write_cloud(tmp_path / "b.npz", plane())
    without = read_cloud(tmp_path / "b.npz")
    assert (without.systematic_mm, without.reason) == (None, None)


def test_npz_is_as_documented(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.npz", plane())
    with np.load(tmp_path / "a.npz", allow_pickle=False) as arrays:
        assert set(arrays) == {"xyz", "sigma_mm", "intensity", "epipolar_px", "frame"}
        assert arrays["xyz"].shape == (H, W, 3)
        assert str(arrays["frame"]) == "board"


def test_npz_with_xyz_alone(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", xyz=plane().xyz.astype(float))
    cloud = read_cloud(tmp_path / "a.npz")
    np.testing.assert_array_equal(cloud.xyz, plane().xyz)
    assert cloud.frame == "unknown"
    assert cloud.scale_sigma is None
    assert np.isnan(cloud.sigma_mm).all()
    assert np.isnan(cloud.epipolar_px).all()


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"points": np.zeros(3)}, "holds no xyz; is it a cloud"),
        ({"xyz": np.zeros((4, 3))}, r"xyz must be \(H, W, 3\), got \(4, 3\)"),
        ({"xyz": np.zeros((0, 4, 3))}, r"xyz must be \(H, W, 3\), got \(0, 4, 3\)"),
        ({"xyz": np.zeros((2, 2, 3), "S1")}, r"xyz must be numbers of shape \(2, 2, 3\), got \|S1"),
        (
            {"xyz": np.zeros((2, 2, 3)), "sigma_mm": np.zeros(4)},
            r"sigma_mm must be numbers of shape \(2, 2\), got float64 of \(4,\)",
        ),
        (
            {"xyz": np.zeros((2, 2, 3)), "reason": np.full((2, 2), 9, np.uint8)},
            r"reason must be uint8 below 6 of shape \(2, 2\), got uint8 of \(2, 2\)",
        ),
        (
            {"xyz": np.zeros((2, 2, 3)), "reason": np.zeros((2, 2))},
            r"reason must be uint8 below 6 of shape \(2, 2\), got float64 of \(2, 2\)",
        ),
        (
            {"xyz": np.zeros((2, 2, 3)), "colour": np.zeros((2, 2, 3))},
            r"colour must be uint8 or uint16 of shape \(2, 2, 3\), got float64",
        ),
        (
            {"xyz": np.zeros((2, 2, 3)), "scale_sigma": np.array(-1e-4)},
            "scale_sigma must be one number, 0 or more, got -0.0001",
        ),
        ({"xyz": np.zeros((2, 2, 3)), "scale_sigma": np.zeros(2)}, "scale_sigma must be one"),
    ],
)
def test_npz_refusals(tmp_path: Path, arrays: dict[str, Any], message: str) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(FormatError, match=message):
        read_cloud(tmp_path / "a.npz")


def test_ply_has_the_valid_points(tmp_path: Path) -> None:
    cloud = plane()
    write_cloud(tmp_path / "a.ply", cloud)
    again = read_cloud(tmp_path / "a.ply")
    assert again.xyz.shape == (1, H * W - 1, 3)
    np.testing.assert_array_equal(again.xyz[0], cloud.xyz[cloud.valid])
    np.testing.assert_array_equal(again.sigma_mm[0], cloud.sigma_mm[cloud.valid])
    np.testing.assert_allclose(again.intensity[0], cloud.intensity[cloud.valid])
    assert again.colour is None
    assert again.frame == "board"


def test_ply_colour_is_8_bit(tmp_path: Path) -> None:
    cloud = replace(plane(), colour=colours())
    write_cloud(tmp_path / "a.ply", cloud)
    again = read_cloud(tmp_path / "a.ply").colour
    assert again is not None
    np.testing.assert_array_equal(again[0], colours()[cloud.valid])


@pytest.mark.parametrize("white", [1023, 1100, 4095, 65535])
def test_deep_levels_scale_by_their_percentile(tmp_path: Path, white: int) -> None:
    """The 99.5 percentile becomes 255; all three channels of 47 points have 141 levels."""
    colour = (colours().astype(np.uint32) * white // 255).astype(np.uint16)
    cloud = replace(plane(), colour=colour)
    write_cloud(tmp_path / "a.ply", cloud)
    again = read_cloud(tmp_path / "a.ply").colour
    assert again is not None
    levels = colour[cloud.valid]
    expected = np.clip(levels * (255 / np.percentile(levels, 99.5)), 0, 255)
    np.testing.assert_allclose(again[0], expected, atol=0.51)  # rounding, and float32 at its edge


def test_brightness_is_steady_in_the_brightest_level(tmp_path: Path) -> None:
    """A little more light is a little more brightness: no steps at 255, 1023, 4095."""
    row, column = np.mgrid[:H, :W]
    ramp = ((8 * row + column) / 47).astype(np.float32)

    def darkest_half(brightest: float) -> float:
        write_cloud(tmp_path / "a.ply", replace(plane(), intensity=brightest * ramp))
        return float(read_cloud(tmp_path / "a.ply").intensity[0, :24].mean())

    means = [darkest_half(level) for level in (250, 255, 260, 1000, 1023, 1024, 1100, 4200)]
    np.testing.assert_allclose(means[1:], means[1], atol=1.0)
    assert means[0] == pytest.approx(means[1] * 250 / 255, abs=1.0)


def test_xyz_is_text(tmp_path: Path) -> None:
    cloud = plane()
    write_cloud(tmp_path / "a.xyz", cloud)
    lines = (tmp_path / "a.xyz").read_text().splitlines()
    assert lines[:2] == ["1 0 499.5", "2 0 499"]
    again = read_cloud(tmp_path / "a.xyz")
    np.testing.assert_array_equal(again.xyz[0], cloud.xyz[cloud.valid])
    assert again.frame == "unknown"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "holds no points"),
        (b"# only words\n", "holds no points"),
        (b"1 2\n", "not lines of x y z"),
        (b"1 2 three\n", "not lines of x y z"),
        (b"\xff\xfe\x00", "not lines of x y z"),
    ],
)
def test_xyz_refusals(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.xyz").write_bytes(data)
    with pytest.raises(FormatError, match=rf"a\.xyz: {message}"):
        read_cloud(tmp_path / "a.xyz")


@pytest.mark.parametrize("suffix", ["npz", "ply", "xyz", "NPZ"])
def test_no_such_file(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(FormatError, match="no such file"):
        read_cloud(tmp_path / f"a.{suffix}")
    with pytest.raises(FormatError, match="cannot be read"):
        read_cloud(tmp_path / f"{'a' * 300}.{suffix}")


@pytest.mark.parametrize("name", ["a.las", "cloud"])
def test_other_suffixes(tmp_path: Path, name: str) -> None:
    message = rf"cloud format '{Path(name).suffix}' is not known; use one of \.npz, \.ply, \.pcd"
    with pytest.raises(UsageError, match=message):
        write_cloud(tmp_path / name, plane())
    with pytest.raises(UsageError, match=message):
        read_cloud(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_meshes_are_written_alone(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"cloud format '\.stl' is written but not read"):
        read_cloud(tmp_path / "a.stl")
