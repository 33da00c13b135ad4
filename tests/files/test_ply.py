from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError
from fringeworks.files import write_cloud
from fringeworks.files.ply import read_ply
from fringeworks.model import Cloud
from tests.files.test_cloud import plane

HEADER = """\
ply
format binary_little_endian 1.0
comment frame board
comment units mm; sigma: random part, one standard deviation along z
element vertex 47
property float x
property float y
property float z
property float nx
property float ny
property float nz
property uchar red
property uchar green
property uchar blue
property float sigma
end_header
"""


def test_the_file_byte_by_byte(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", plane())
    data = (tmp_path / "a.ply").read_bytes()
    assert data.startswith(HEADER.encode())
    body = data[len(HEADER) :]
    assert len(body) == 47 * 31
    # pixel (2, 3) is the 18th valid one; the plane's normal is (-1, 0, -2) / sqrt 5
    values = struct.unpack_from("<6f3Bf", body, 18 * 31)
    expected = (3, 2, 498.5, -1 / 5**0.5, 0, -2 / 5**0.5, 62, 62, 62, 0.03)
    np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-6)


def test_normals_that_the_grid_does_not_give_are_zero(tmp_path: Path) -> None:
    cloud = plane()
    xyz = np.full_like(cloud.xyz, np.nan)
    xyz[2, 3] = cloud.xyz[2, 3]
    lonely = Cloud(xyz, cloud.sigma_mm, cloud.intensity, cloud.epipolar_px)
    write_cloud(tmp_path / "a.ply", lonely)
    (vertex,) = read_ply(tmp_path / "a.ply").vertices
    assert [vertex[name] for name in ("nx", "ny", "nz")] == [0, 0, 0]
    assert vertex["z"] == 498.5


def test_a_frame_name_cannot_break_the_header(tmp_path: Path) -> None:
    cloud = plane()
    named = Cloud(
        cloud.xyz, cloud.sigma_mm, cloud.intensity, cloud.epipolar_px, frame="a\nend_header\nß"
    )
    write_cloud(tmp_path / "a.ply", named)
    points = read_ply(tmp_path / "a.ply")
    assert points.comments[0] == "frame a end_header ß"
    assert len(points.vertices) == 47


def ply(*lines: str, body: bytes = b"", end: str = "\n") -> bytes:
    header = ["ply", "format binary_little_endian 1.0", *lines, "end_header"]
    return "".join(line + end for line in header).encode() + body


XYZ = ("property float x", "property double y", "property short z")
POINT = struct.pack("<fdh", 1.5, 2.5, 3)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_foreign_files(tmp_path: Path, end: str) -> None:
    """Other types, unknown properties, elements before and lists after the vertices."""
    lines = (
        "obj_info made elsewhere",
        "element camera 2",
        "property int number",
        "element vertex 2",
        *XYZ,
        "property uchar quality",
        "element face 1",
        "property list uchar int vertex_indices",
    )
    body = bytes(8) + (POINT + b"\x07") * 2 + bytes(13)
    (tmp_path / "a.ply").write_bytes(ply(*lines, body=body, end=end))
    vertices = read_ply(tmp_path / "a.ply").vertices
    assert len(vertices) == 2
    assert tuple(vertices[1]) == (1.5, 2.5, 3, 7)


VERTICES = "element vertex 1"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a PLY file"),
        (b"solid stl", "not a PLY file"),
        (b"ply\nformat ascii 1.0\nend_header\n1 2 3\n", "got 'format ascii 1.0'"),
        (
            b"ply\nformat binary_big_endian 1.0\nend_header\n",
            "PLY must be binary_little_endian 1.0, got 'format binary_big_endian 1.0'",
        ),
        (b"ply\nend_header\n", "PLY must be binary_little_endian 1.0, got ''"),
        (b"ply\nformat binary_little_endian 1.0\n", "the PLY header has no end"),
        (b"ply\n" + b"comment x\n" * 10_000, "the PLY header has no end"),
        (ply(), "the PLY has no vertices"),
        (ply("element vertex 0", *XYZ), "the PLY has no points"),
        (ply(VERTICES, *XYZ[:2], body=POINT), "vertices lack the property z"),
        (ply(VERTICES, *XYZ, body=POINT[:-1]), "cut off: the header says 1 points"),
        (ply("element vertex 900000000000000", *XYZ, body=POINT), "cut off: the header says 9000"),
        (ply("element vertex -1", *XYZ), "PLY header line 'element vertex -1' is not understood"),
        (ply("element vertex many", *XYZ), "is not understood"),
        (ply("element vertex " + "9" * 5000, *XYZ), "is not understood"),
        (ply(VERTICES, "property list uchar int x"), "property 'list uchar int x' of vertex is no"),
        (ply("element face 1", "property list uchar int i", VERTICES, *XYZ), "must come first"),
        (ply(VERTICES, "property half x"), "property 'half x' of vertex is not understood"),
        (ply(VERTICES, *XYZ, "property float x"), "properties of vertex: "),
    ],
)
def test_refusals(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(FormatError) as caught:
        read_ply(tmp_path / "a.ply")
    assert message in str(caught.value)
    assert str(tmp_path / "a.ply") in str(caught.value)


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_spoilt_files_are_refused_or_read(tmp_path: Path, data: st.DataObject) -> None:
    spoilt = bytearray(HEADER.encode() + bytes(47 * 31))
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(HEADER) - 1))
        spoilt[start : start + data.draw(st.integers(0, 6))] = data.draw(st.binary(max_size=5))
    (tmp_path / "a.ply").write_bytes(spoilt)
    try:
        read_ply(tmp_path / "a.ply")
    except FormatError as error:
        message = str(error)
    else:
        return
    assert "a.ply" in message


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(0, len(HEADER) + 47 * 31 - 1))
def test_cut_off_anywhere_it_is_refused(tmp_path: Path, cut: int) -> None:
    (tmp_path / "a.ply").write_bytes((HEADER.encode() + bytes(47 * 31))[:cut])
    with pytest.raises(FormatError):
        read_ply(tmp_path / "a.ply")
