"""Calibrations of other programs: by hand-written files, round trips, and OpenCV's projection."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.io import loadmat, savemat

from fringeworks.errors import FormatError, FringeworksError, UsageError
from fringeworks.files import mat5, read_rig, write_rig
from fringeworks.files.exchange import (
    NAMES,
    Given,
    read_foreign,
    write_matlab,
    write_opencv,
    write_ros,
)
from fringeworks.geometry.lens import project
from fringeworks.model import Rig
from tests.cli.scenes import RIG, plain, run

SIZES = Given(camera=(752, 480), projector=(608, 684))

MATRICES: dict[str, Any] = {
    "camera_matrix": np.array([[1974.0, 0, 376], [0, 1970, 240], [0, 0, 1]]),
    "camera_distortion": np.array([[-0.1, 0.05, 2e-4, -3e-4, 0.01]]),
    "projector_matrix": np.array([[1013.0, 0, 300], [0, 1015, 340], [0, 0, 1]]),
    "projector_distortion": np.array([[-0.05, 0.03, 1e-3, -5e-4, 0]]),
    "rotation": RIG.projector_from_camera.rotation,
    "translation": RIG.projector_from_camera.translation_mm[:, None],
}
"""Those of `RIG`."""


def write(path: Path, values: dict[str, Any]) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        storage.write(name, value)
    storage.release()
    return path


def same(found: Rig, wanted: Rig) -> None:
    np.testing.assert_array_equal(found.camera.lens.vector, wanted.camera.lens.vector)
    np.testing.assert_array_equal(found.projector.lens.vector, wanted.projector.lens.vector)
    a, b = found.projector_from_camera, wanted.projector_from_camera
    np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-15)
    np.testing.assert_array_equal(a.translation_mm, b.translation_mm)
    for device in ("camera", "projector"):
        one, other = getattr(found, device), getattr(wanted, device)
        assert (one.width, one.height) == (other.width, other.height)


@pytest.mark.parametrize("suffix", [".yml", ".yaml", ".xml", ".mat"])
def test_there_and_back(tmp_path: Path, suffix: str) -> None:
    writer = write_matlab if suffix == ".mat" else write_opencv
    (path,) = writer(tmp_path / f"rig{suffix}", RIG)
    same(read_foreign(path), RIG)


@pytest.mark.parametrize("suffix", [".yml", ".xml"])
@pytest.mark.parametrize("place", range(max(map(len, NAMES.values()))))
def test_every_name_is_known(tmp_path: Path, place: int, suffix: str) -> None:
    named = {names[min(place, len(names) - 1)]: MATRICES[role] for role, names in NAMES.items()}
    same(read_foreign(write(tmp_path / f"a{suffix}", named), SIZES), RIG)


def test_slstudio(tmp_path: Path) -> None:
    """It writes float32 and its sizes as numbers."""
    values = dict(zip(("Kc", "kc", "Kp", "kp", "Rp", "Tp"), MATRICES.values(), strict=True))
    single = {name: np.asarray(value, dtype=np.float32) for name, value in values.items()}
    sizes = {"frameWidth": 752, "frameHeight": 480, "screenResX": 608, "screenResY": 684}
    rig = read_foreign(write(tmp_path / "calibration.xml", {**single, "cam_error": 0.2, **sizes}))
    # half an ulp of a float32 is 6e-8 of the number
    np.testing.assert_allclose(rig.camera.lens.vector, RIG.camera.lens.vector, rtol=6e-8)
    assert (rig.camera.width, rig.camera.height) == (752, 480)
    assert (rig.projector.width, rig.projector.height) == (608, 684)
    write_rig(tmp_path / "rig.json", rig)  # whose rotation has to be one to 1e-6
    read_rig(tmp_path / "rig.json")


def test_opencv_reads_what_it_is_given(tmp_path: Path) -> None:
    (path,) = write_opencv(tmp_path / "rig.yml", RIG)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    read = {name: storage.getNode(name).mat() for name in ("proj_K", "proj_kc", "R", "T")}
    points = np.array([[10.0, -20, 700], [80, 60, 650]])
    rvec, _ = cv2.Rodrigues(read["R"])
    pixels, _ = cv2.projectPoints(points, rvec, read["T"], read["proj_K"], read["proj_kc"])
    ours = project(RIG.projector_from_camera.apply(points), RIG.projector.lens.vector)
    np.testing.assert_allclose(pixels[:, 0], ours, atol=1e-9)


def test_matlab_counts_from_one_and_writes_rows(tmp_path: Path) -> None:
    (path,) = write_matlab(tmp_path / "rig.mat", RIG)
    params = loadmat(path, squeeze_me=True, struct_as_record=False)["stereoParams"]
    camera, projector = params.CameraParameters1, params.CameraParameters2
    np.testing.assert_array_equal(camera.ImageSize, [480, 752])
    np.testing.assert_array_equal(
        camera.IntrinsicMatrix, [[1974, 0, 0], [0, 1970, 0], [377, 241, 1]]
    )
    # rows as vectors: X2 = X1 R + t, and (x y 1) times the intrinsic matrix, pixels from one
    point = np.array([10.0, -20, 700])
    moved = point @ params.RotationOfCamera2 + params.TranslationOfCamera2
    np.testing.assert_allclose(moved, RIG.projector_from_camera.apply(point), atol=1e-12)
    plain_lens = replace(RIG.projector.lens, k1=0, k2=0, p1=0, p2=0, k3=0)
    pixel = (moved / moved[2]) @ projector.IntrinsicMatrix
    np.testing.assert_allclose(pixel[:2] - 1, project(moved, plain_lens.vector), atol=1e-9)


def test_matlab_with_k_and_two_radial_terms(tmp_path: Path) -> None:
    """`K` of later versions is not transposed."""
    device = {
        "K": np.array([[1974.0, 0, 377], [0, 1970, 241], [0, 0, 1]]),
        "RadialDistortion": [-0.1, 0.05],
        "TangentialDistortion": [2e-4, -3e-4],
        "ImageSize": [480, 752],
    }
    params = {
        "CameraParameters1": device,
        "CameraParameters2": device,
        "RotationOfCamera2": np.eye(3),
        "TranslationOfCamera2": [-180.0, 5, 20],
    }
    savemat(tmp_path / "a.mat", {"anything": params}, do_compression=True)
    lens = read_foreign(tmp_path / "a.mat").camera.lens
    assert (lens.cx, lens.cy, lens.k2, lens.p1, lens.p2, lens.k3) == (
        376,
        240,
        0.05,
        2e-4,
        -3e-4,
        0,
    )


def test_matlab_lacks_a_field(tmp_path: Path) -> None:
    lacking = {"s": {"CameraParameters2": {"Skew": 0.0}, "Units": 1.0}}
    savemat(tmp_path / "a.mat", lacking, do_compression=True)
    with pytest.raises(FormatError, match="CameraParameters1 is missing, the struct has"):
        read_foreign(tmp_path / "a.mat")


def test_a_mat_that_is_not_packed(tmp_path: Path) -> None:
    """Version 6; texts, cells and complex numbers are not looked at."""
    (path,) = write_matlab(tmp_path / "rig.mat", RIG)
    params = loadmat(path, struct_as_record=True)["stereoParams"]
    further = {"units": "mm", "views": np.array([[1, "a"]], dtype=object), "z": 1j}
    savemat(tmp_path / "a.mat", {**further, "p": params}, do_compression=False)
    same(read_foreign(tmp_path / "a.mat"), RIG)


def test_matlab_7_3_is_named(tmp_path: Path) -> None:
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    (tmp_path / "a.mat").write_bytes(head + bytes(512))
    with pytest.raises(FormatError, match=r"version 7\.3 is not read: save it again with -v7"):
        read_foreign(tmp_path / "a.mat")


def test_matlab_bombs_are_not_unpacked(tmp_path: Path) -> None:
    packed = zlib.compress(bytes(mat5.MAX_UNPACKED + 8), 9)
    part = struct.pack("<II", 15, len(packed)) + packed
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + part)
    with pytest.raises(FormatError, match="more than 67108864 bytes unpacked"):
        read_foreign(tmp_path / "a.mat")


@pytest.mark.parametrize("suffix", [".yml", ".xml", ".mat"])
def test_a_damaged_file_is_an_error_of_ours(tmp_path: Path, suffix: str) -> None:
    """Three bytes changed, or the end cut off: read as some rig, or refused with a message."""
    (path,) = (write_matlab if suffix == ".mat" else write_opencv)(tmp_path / f"a{suffix}", RIG)
    whole, rng = path.read_bytes(), np.random.default_rng(3)
    refused = 0
    for _ in range(100):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), 3):
            data[place] = rng.integers(0, 128)
        path.write_bytes(data[: rng.integers(len(data) // 2, 2 * len(data))])
        try:
            write_rig(tmp_path / "rig.json", read_foreign(path))
        except FringeworksError:
            refused += 1
    assert refused > 30


def test_ros(tmp_path: Path) -> None:
    paths = write_ros(tmp_path / "ros", RIG)
    assert [path.name for path in paths] == ["camera.yaml", "projector.yaml", "transform.yaml"]
    # OpenCV's reader takes this YAML once it has its first line
    text = "%YAML:1.0\n---\n" + paths[1].read_text()
    info = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    assert info.getNode("distortion_model").string() == "plumb_bob"
    assert info.getNode("image_width").real() == 608
    data = info.getNode("distortion_coefficients").getNode("data")
    terms = [data.at(index).real() for index in range(data.size())]
    assert terms == RIG.projector.lens.vector[4:].tolist()
    shift = re.search(r"translation_m: \[(.*)\]", paths[2].read_text())
    assert shift is not None
    # where the projector's centre is in the camera's frame
    centre = RIG.projector_from_camera.inverse().translation_mm / 1000
    np.testing.assert_allclose([float(part) for part in shift[1].split(",")], centre, atol=1e-15)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"R": None}, "no rotation: one of R, Rp, .* the file has D1, D2, M1, M2, T"),
        ({"M1": np.eye(2)}, r"the camera's matrix must be 3x3, got \(2, 2\)"),
        ({"M2": np.array([[1e3, 5, 0], [0, 1e3, 0], [0, 0, 1]])}, r"projector's pixels are skewed"),
        ({"D1": np.ones((1, 8))}, "distortion must be k1 k2 p1 p2 and k3, got 8 terms"),
        ({"D1": np.ones((1, 2))}, "got 2 terms"),
        ({"R": np.diag([1.0, 1, -1])}, "the rotation is none"),
        ({"R": 1.01 * np.eye(3)}, "the rotation is none: it is off by 0.01"),
        ({"T": np.ones(4)}, "three numbers, got 4"),
        ({"T": np.full((3, 1), np.nan)}, "T must hold numbers"),
    ],
)
def test_what_is_no_rig(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    names = ("M1", "D1", "M2", "D2", "R", "T")
    values = {**dict(zip(names, MATRICES.values(), strict=True)), **changes}
    path = write(tmp_path / "a.yml", {k: v for k, v in values.items() if v is not None})
    with pytest.raises(FormatError, match=message):
        read_foreign(path, SIZES)


def test_what_the_file_does_not_say(tmp_path: Path) -> None:
    names = ("M1", "D1", "M2", "D2", "R", "T")
    values = dict(zip(names, MATRICES.values(), strict=True))
    path = write(tmp_path / "a.yml", values)
    with pytest.raises(UsageError, match="the camera's image is: give it with --camera"):
        read_foreign(path)
    with pytest.raises(UsageError, match="the projector's image is: give it with --projector"):
        read_foreign(path, Given(camera=(752, 480)))
    metres = write(tmp_path / "m.yml", {**values, "T": values["T"] / 1000})
    with pytest.raises(UsageError, match="give --unit m;"):
        read_foreign(metres, SIZES)
    found = read_foreign(metres, replace(SIZES, unit="m"))
    assert found.baseline_mm == pytest.approx(RIG.baseline_mm, rel=1e-15)
    near = read_foreign(metres, replace(SIZES, unit="mm"))
    assert near.baseline_mm == pytest.approx(RIG.baseline_mm / 1000, rel=1e-15)


def test_distortion_of_eight_terms_that_are_zero(tmp_path: Path) -> None:
    names = ("M1", "D1", "M2", "D2", "R", "T")
    values = dict(zip(names, MATRICES.values(), strict=True))
    values["D1"] = np.hstack([values["D1"], np.zeros((1, 3))])
    same(read_foreign(write(tmp_path / "a.yml", values), SIZES), RIG)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.yml", b"%YAML:1.0\n---\n a: [1, {{{"),
        ("a.xml", b""),
        ("a.xml", b"<?xml version='1.0'?><html></html>"),
        ("a.yml", b"\xff\xfe\x00"),
        ("a.mat", b"xx" * 200),
        ("a.mat", b""),
        ("a.mat", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"\x0f\x00\x00\x00" * 4),
        ("a.mat", bytes(5 * 2**20)),
    ],
)
def test_no_such_file_at_all(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FormatError, match=name):
        read_foreign(tmp_path / name, SIZES)


def test_suffixes(tmp_path: Path) -> None:
    for call in (
        lambda: read_foreign(tmp_path / "a.json"),
        lambda: write_opencv(tmp_path / "a.mat", RIG),
        lambda: write_matlab(tmp_path / "a.yml", RIG),
        lambda: write_ros(tmp_path / "a.yml", RIG),
    ):
        with pytest.raises(UsageError, match="must be"):
            call()


def test_the_commands(tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.json", RIG)
    for to, out in (("opencv", "a.xml"), ("mat", "a.mat")):
        done = run("export", tmp_path / "rig.json", "--to", to, "--out", tmp_path / out)
        assert done.exit_code == 0, done.stderr
        done = run("import", tmp_path / out, "--out", tmp_path / "back.json")
        assert done.exit_code == 0, done.stderr
        same(read_rig(tmp_path / "back.json"), RIG)
    done = run("export", tmp_path / "rig.json", "--to", "ros", "--out", tmp_path / "ros")
    assert "wrote 3 files" in done.stdout
    done = run("import", tmp_path / "a.xml", "--camera", "big", "--out", tmp_path / "x.json")
    assert done.exit_code == 2
    assert "--camera must be WIDTHxHEIGHT" in plain(done.stderr)


def test_a_real_file(real: Callable[[str], Path], tmp_path: Path) -> None:
    """What the author of procam-graycode solved with his own program: X2 = R X1 + T, in mm."""
    file = real("procam-graycode") / "author_calibration_result.xml"
    sizes = ("--camera", "1280x1024", "--projector", "1920x1080")
    done = run("import", file, *sizes, "--out", tmp_path / "rig.json")
    assert done.exit_code == 0, done.stderr
    assert read_rig(tmp_path / "rig.json").baseline_mm == pytest.approx(644.2, abs=0.1)
