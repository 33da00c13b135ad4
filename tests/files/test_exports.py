"""Every export read back by a reader that is not ours."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import FormatError, MeasurementError, MissingExtraError, UsageError
from fringeworks.files import read_cloud, write_cloud
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.frames import move_cloud
from fringeworks.model import Cloud, Pose
from fringeworks.model.frame import Frame
from tests.files.test_cloud import H, W, colours, plane

FACES = 2 * (H - 1) * (W - 1) - 1
"""One corner of the grid is void, which costs a triangle."""


def step() -> Cloud:
    """Two planes, 20 mm apart in depth, that meet between two columns: the edge jumps."""
    y, x = np.mgrid[:6, :8].astype(np.float32)
    z = np.where(x < 4, 500, 520).astype(np.float32)
    flat = np.full(x.shape, 0.01, np.float32)
    return Cloud(np.stack([x, y, z], axis=-1), flat, 100 + flat, flat)


def load(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    trimesh = pytest.importorskip("trimesh")
    loaded = trimesh.load(path, process=False)
    mesh = loaded.to_mesh() if hasattr(loaded, "to_mesh") else loaded
    return np.array(mesh.vertices), np.array(mesh.faces)


@pytest.mark.parametrize("name", ["a.stl", "a.obj", "a.glb", "a.ply"])
def test_meshes(tmp_path: Path, name: str) -> None:
    """The plane's area, and fronts that look at the camera."""
    write_cloud(tmp_path / name, plane(), faces=True)
    vertices, faces = load(tmp_path / name)
    if name.endswith("glb"):  # metres, y up, z to the viewer: half a turn about x
        vertices = vertices * [1000, -1000, -1000]
    corners = vertices[faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    assert len(faces) == FACES
    np.testing.assert_allclose(np.linalg.norm(areas, axis=1), np.sqrt(1.25) / 2, rtol=1e-3)
    expected = np.broadcast_to([-0.25, 0, -0.5], areas.shape)
    np.testing.assert_allclose(areas, expected, atol=2e-4)  # float32 of 0.5 m, in mm
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    np.testing.assert_allclose(low, [0, 0, 496.5], atol=1e-4)
    np.testing.assert_allclose(high, [7, 5, 500], atol=1e-4)


@pytest.mark.parametrize("name", ["a.stl", "a.obj", "a.glb", "a.ply"])
def test_jumps_stay_open(tmp_path: Path, name: str) -> None:
    write_cloud(tmp_path / name, step(), faces=True)
    vertices, faces = load(tmp_path / name)
    depths = np.abs(vertices[faces][..., 2])
    assert np.ptp(depths, axis=1).max() < 1e-6 * depths.max()
    assert len(faces) == 2 * 5 * 6


def test_colours_of_meshes(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    cloud = replace(plane(), colour=colours())
    expected = colours()[cloud.valid]
    for name in ("a.obj", "a.ply"):
        write_cloud(tmp_path / name, cloud, faces=True)
        mesh = trimesh.load(tmp_path / name, process=False)
        np.testing.assert_allclose(mesh.visual.vertex_colors[:, :3], expected, atol=1)


def test_a_mesh_needs_a_grid(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.xyz", plane())
    loose = read_cloud(tmp_path / "a.xyz")
    for name in ("a.stl", "a.obj", "a.glb", "b.ply"):
        with pytest.raises(MeasurementError, match="a mesh needs a cloud on the camera's grid"):
            write_cloud(tmp_path / name, loose, faces=True)
        assert not (tmp_path / name).exists()
    with pytest.raises(UsageError, match=r"a mesh must be \.ply, \.stl, \.obj or \.glb"):
        write_cloud(tmp_path / "a.npz", plane(), faces=True)


def test_e57_by_its_library(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57")
    cloud = replace(plane(), colour=colours())
    write_cloud(tmp_path / "a.e57", cloud)
    file = pye57.E57(str(tmp_path / "a.e57"))
    scan = file.read_scan(0, intensity=True, colors=True, row_column=True)
    metres = np.stack([scan["cartesianX"], scan["cartesianY"], scan["cartesianZ"]], axis=-1)
    np.testing.assert_allclose(metres, cloud.points() / 1000, atol=1e-7)  # float32 of half a metre
    np.testing.assert_array_equal(scan["colorGreen"], colours()[cloud.valid][:, 1])
    np.testing.assert_array_equal(scan["rowIndex"], np.nonzero(cloud.valid)[0])
    np.testing.assert_allclose(scan["intensity"], cloud.intensity[cloud.valid])
    assert file.get_header(0)["name"].value() == "board"
    file.close()
    again = read_cloud(tmp_path / "a.e57")
    np.testing.assert_allclose(again.xyz, cloud.xyz, atol=1e-4)
    np.testing.assert_array_equal(again.colour[again.valid], colours()[cloud.valid])  # type: ignore[index]


def test_what_is_no_e57(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pye57")
    (tmp_path / "a.e57").write_bytes(b"ASTM-E57 and no more")
    with pytest.raises(FormatError, match=r"a\.e57: not a readable E57 [^\n]*$"):
        read_cloud(tmp_path / "a.e57")
    monkeypatch.setitem(sys.modules, "pye57", None)
    with pytest.raises(MissingExtraError, match=r"pip install fringeworks\[e57\]"):
        write_cloud(tmp_path / "b.e57", plane())


def test_mat_by_scipy(tmp_path: Path) -> None:
    from scipy.io import loadmat

    pose = Pose(rotation_matrix(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2, 3]))
    bare = replace(plane(), frame="camera", scale_sigma=1e-4, colour=colours())
    cloud = move_cloud(bare, Frame("station", pose))
    write_cloud(tmp_path / "a.mat", cloud)
    found = loadmat(tmp_path / "a.mat", squeeze_me=True)
    np.testing.assert_array_equal(found["xyz_mm"], cloud.xyz)
    np.testing.assert_array_equal(found["sigma_mm"], cloud.sigma_mm)
    np.testing.assert_array_equal(found["colour"], colours())
    assert (str(found["frame"]), float(found["scale_sigma"])) == ("station", 1e-4)
    np.testing.assert_allclose(found["frame_from_camera"][:3, 3], [1, 2, 3])
    with pytest.raises(UsageError, match=r"'\.mat' is written but not read"):
        read_cloud(tmp_path / "a.mat")


def test_pcd_by_its_own_header(tmp_path: Path) -> None:
    """Read as the header says, with nothing of our reader."""
    cloud = replace(plane(), colour=colours())
    write_cloud(tmp_path / "a.pcd", cloud)
    data = (tmp_path / "a.pcd").read_bytes()
    head, body = data.split(b"DATA binary\n", 1)
    keys = dict(line.split(" ", 1) for line in head.decode().splitlines() if line[0] != "#")
    kinds = zip(keys["FIELDS"].split(), keys["TYPE"].split(), keys["SIZE"].split(), strict=True)
    dtype = np.dtype([(name, f"<{kind.lower()}{size}") for name, kind, size in kinds])
    points = np.frombuffer(body, dtype).reshape(int(keys["HEIGHT"]), int(keys["WIDTH"]))
    np.testing.assert_array_equal(np.stack([points[c] for c in "xyz"], axis=-1), cloud.xyz)
    np.testing.assert_allclose(points["normal_x"][2, 3], -1 / 5**0.5, atol=1e-6)
    np.testing.assert_array_equal(points["rgb"][2, 3] >> 8 & 255, colours()[2, 3, 1])
    assert keys["VIEWPOINT"] == "0 0 0 1 0 0 0"
    assert np.isnan(points["x"][0, 0])
    again = read_cloud(tmp_path / "a.pcd")
    np.testing.assert_array_equal(again.xyz, cloud.xyz)
    np.testing.assert_array_equal(again.sigma_mm, cloud.sigma_mm)


ASCII = """# made elsewhere
VERSION .7
FIELDS x y z rgb
SIZE 4 4 4 4
TYPE F F F U
COUNT 1 1 1 1
WIDTH 2
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 2
DATA ascii
1 2 3 16711680
4 5 nan 255
"""


def test_foreign_pcd(tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_text(ASCII)
    cloud = read_cloud(tmp_path / "a.pcd")
    np.testing.assert_array_equal(cloud.points(), [[1, 2, 3]])
    assert cloud.colour is not None
    assert cloud.colour.tolist() == [[[255, 0, 0], [0, 0, 255]]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("FIELDS x y z", "FIELDS x y q", "FIELDS lack z"),
        ("WIDTH 2", "WIDTH -2", "must hold 1 to"),
        ("4 5 nan 255", "# 5 nan 255", "cut off: the header says 2 points, got 1"),
        ("WIDTH 2", "WIDTH 3", "POINTS must be WIDTH times HEIGHT, 3"),
        ("WIDTH 2", "WIDTH 2\nWIDTH 1", "'WIDTH' stands twice"),
        ("COUNT 1 1 1 1", "COUNT 2 1 1 1", "field x must have COUNT 1, got '2'"),
        ("1 2 3 16711680", "1 2 nan 16711680", "holds no points"),
        ("DATA ascii", "DATA binary", "cut off: the header says 2 points"),
        ("DATA ascii", "DATA binary_compressed", "DATA must be binary or ascii"),
        ("TYPE F F F U", "TYPE F F F", "must be of one length"),
        ("TYPE F F F U", "TYPE F F F S", "field 'rgb' is not understood"),
        ("FIELDS x y z rgb", "FIELDS x y z x", "FIELDS: "),
        ("1 2 3 ", "1 two 3 ", "not a readable PCD"),
        ("DATA ascii\n", "", "its header has no end"),
        ("HEIGHT 1\n", "", "no WIDTH or HEIGHT"),
    ],
)
def test_what_is_no_pcd(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in ASCII
    (tmp_path / "a.pcd").write_text(ASCII.replace(old, new, 1))
    with pytest.raises(FormatError, match=rf"a\.pcd: .*{message}"):
        read_cloud(tmp_path / "a.pcd")


@pytest.mark.parametrize("kind", ["binary", "ascii"])
def test_a_pcd_is_not_believed(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """800 GB of points that nobody wrote: nothing reads, and so nothing allocates, that many."""
    claim = ASCII.replace("WIDTH 2", "WIDTH 200000000").replace("POINTS 2\n", "")
    claim = claim.replace("COUNT 1 1 1 1", "COUNT 1 1 1 1000").replace("rgb", "more")
    (tmp_path / "a.pcd").write_text(claim.replace("DATA ascii", f"DATA {kind}"))
    for name in ("loadtxt", "frombuffer"):
        monkeypatch.setattr(np, name, pytest.fail)
    with pytest.raises(FormatError, match="cut off: the header says 200000000 points"):
        read_cloud(tmp_path / "a.pcd")


def test_padding_of_a_pcd(tmp_path: Path) -> None:
    """Fields called _ are nobody's, and may stand several times."""
    text = ASCII.replace("FIELDS x y z rgb", "FIELDS x y _ _")
    (tmp_path / "a.pcd").write_text(text)
    with pytest.raises(FormatError, match="FIELDS lack z"):
        read_cloud(tmp_path / "a.pcd")
    text = text.replace("_ _", "z _ _").replace("4 4 4 4", "4 4 4 4 4").replace("F U", "F U U")
    text = text.replace("1 1 1 1", "1 1 1 1 1").replace("16711680", "0 0").replace("255", "0 0")
    (tmp_path / "a.pcd").write_text(text)
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.pcd").points(), [[1, 2, 3]])


@pytest.mark.parametrize("name", ["a.ply", "a.pcd", "a.xyz", "a.e57"])
def test_no_points_are_not_written(tmp_path: Path, name: str) -> None:
    """What `read_cloud` would refuse."""
    void = replace(plane(), xyz=np.full_like(plane().xyz, np.nan))
    (tmp_path / name).write_text("old")
    with pytest.raises(FormatError, match="the cloud has no points to write"):
        write_cloud(tmp_path / name, void)
    assert (tmp_path / name).read_text() == "old"
    write_cloud(tmp_path / "a.npz", void)
    assert not read_cloud(tmp_path / "a.npz").valid.any()


def test_text_without_numbers(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("nan 1 2\n1e300 0 0\n")
    with pytest.raises(FormatError, match=r"a\.xyz: holds no points"):
        read_cloud(tmp_path / "a.xyz")


def test_an_e57_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library's own errors are of no common type, and tell of its sources."""
    pye57 = pytest.importorskip("pye57")

    def fail(*_: object, **__: object) -> None:
        raise pye57.libe57.E57Exception("disk full (ErrorWriteFailed)\n\n  Debug info:\n here")

    (tmp_path / "a.e57").write_text("old")
    monkeypatch.setattr(pye57.E57, "write_scan_raw", fail)
    with pytest.raises(FormatError, match=r"a\.e57: cannot be written \(disk full [^\n]*\)$"):
        write_cloud(tmp_path / "a.e57", plane())
    assert [path.name for path in tmp_path.iterdir()] == ["a.e57"]
    assert (tmp_path / "a.e57").read_text() == "old"


def test_an_e57_is_not_believed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pye57")
    write_cloud(tmp_path / "a.e57", plane())
    monkeypatch.setattr("fringeworks.files.e57.MAX_POINTS", 10)
    with pytest.raises(FormatError, match="points, more than 10"):
        read_cloud(tmp_path / "a.e57")


def test_a_frame_that_cannot_be_printed(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.npz", plane())
    arrays = dict(np.load(tmp_path / "a.npz"))
    np.savez(tmp_path / "b.npz", **{**arrays, "frame": np.array("a\ud800")})
    assert read_cloud(tmp_path / "b.npz").frame == "unknown"


def test_ply_keeps_the_scale(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", replace(plane(), scale_sigma=1.5e-4))
    assert read_cloud(tmp_path / "a.ply").scale_sigma == 1.5e-4
    data = (tmp_path / "a.ply").read_bytes()
    for words in (b"nan", b"-1.0", b"1e999", b"1.2.3"):
        (tmp_path / "b.ply").write_bytes(data.replace(b"0.00015", words))
        assert read_cloud(tmp_path / "b.ply").scale_sigma is None


def test_normals_of_a_noisy_plane(tmp_path: Path) -> None:
    """Neighbour differences at a spacing of 0.3 mm would lean by 0.05 / 0.3 rad and more."""
    y, x = np.mgrid[:60, :80] * 0.3
    z = 600 + np.random.default_rng(1).normal(0, 0.05, x.shape)
    sigma = np.full(x.shape, 0.05, np.float32)
    cloud = Cloud(np.stack([x, y, z], -1).astype(np.float32), sigma, sigma, sigma)
    write_cloud(tmp_path / "a.ply", cloud)
    trimesh = pytest.importorskip("trimesh")
    normals = np.array(
        trimesh.load(tmp_path / "a.ply").metadata["_ply_raw"]["vertex"]["data"].tolist()
    )[:, 3:6]
    lean = np.hypot(normals[:, 0], normals[:, 1])
    assert np.sqrt(np.mean(lean**2)) < 0.06
    assert (normals[:, 2] < 0).all()


def test_npz_keeps_the_camera(tmp_path: Path) -> None:
    pose = Pose(rotation_matrix(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2, 3]))
    moved = move_cloud(replace(plane(), frame="camera"), Frame("station", pose))
    write_cloud(tmp_path / "a.npz", moved)
    again = read_cloud(tmp_path / "a.npz")
    assert again.frame_from_camera is not None
    np.testing.assert_array_equal(again.frame_from_camera.rotation, pose.rotation)
    arrays = dict(np.load(tmp_path / "a.npz"))
    for wrong, message in (
        (np.eye(3), r"must be numbers of shape \(4, 4\)"),
        (2 * np.eye(4), "must be a rotation and a translation"),
    ):
        np.savez(tmp_path / "b.npz", **{**arrays, "frame_from_camera": wrong})
        with pytest.raises(FormatError, match=message):
            read_cloud(tmp_path / "b.npz")
