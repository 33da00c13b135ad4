"""The surface behind the interactive view: thinned, joined where it is whole, packed."""

from __future__ import annotations

import dataclasses
import json
import re
from base64 import b64decode
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.report.blocks import CloudView
from fringeworks.report.surface import Surface, find_surface
from fringeworks.report.viewer import quantise, write_viewer
from tests.report.surfaces import (
    MIDDLE_X,
    MIDDLE_Z,
    RADIUS,
    cloud_of,
    cylinder_before_wall,
    rays,
    spiral,
)


def triangles_of(surface: Surface) -> NDArray[np.int64]:
    """``(n, 3)`` node numbers, read off the cells in plain loops."""
    rows, columns = surface.cells.shape
    found = []
    for row, column in np.ndindex(rows, columns):
        node = row * columns + column
        corners = [node, node + 1, node + columns + 1, node + columns]
        for without in range(4):
            if surface.cells[row, column] >> without & 1:
                found.append([corner for i, corner in enumerate(corners) if i != without])
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def closed_share(surface: Surface) -> float:
    """Triangles over those of a surface without any gap."""
    rows, columns = surface.cells.shape
    return float(len(triangles_of(surface)) / (2 * (rows - 1) * (columns - 1)))


@pytest.mark.parametrize("most", [100_000, 4_000])
def test_no_triangle_spans_a_jump(most: int) -> None:
    cloud, on_cylinder = cylinder_before_wall()
    surface = find_surface(cloud, most=most)
    label = on_cylinder[:: surface.stride, :: surface.stride].ravel()
    corners = label[triangles_of(surface)]
    assert (corners.all(axis=1) | ~corners.any(axis=1)).all()
    # Both edges of the cylinder are open, two cells wide at most each; all else is closed.
    assert closed_share(surface) >= 1 - 4 / (surface.cells.shape[1] - 1) - 1e-12


@pytest.mark.parametrize(("degrees", "closed"), [(0, 1), (60, 1), (79, 1), (81, 0)])
def test_a_slope_is_closed_up_to_eighty_degrees(degrees: float, closed: int) -> None:
    # One pixel turns the ray by 1 / 208: steps are 1 + tan(81°) / 416 = 1.5 % off their limit.
    assert closed_share(find_surface(spiral(degrees))) == closed


def test_noise_makes_no_jumps() -> None:
    # Pixels are 3.1 mm apart, so a step of 17.7 mm is steep: 1.6 sigma of the noise between two
    # points, and only sigma tells. 5 sigma come once in two million of the 14,000 edges.
    assert closed_share(find_surface(spiral(0, sigma=8.0, noise=8.0))) == 1
    assert closed_share(find_surface(spiral(0, sigma=0.0, noise=8.0))) < 0.9


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_normals_are_the_forms_up_to_its_edges(noise: float) -> None:
    cloud, on_cylinder = cylinder_before_wall(230, 360, sigma=noise)
    normals = find_surface(cloud).normals
    across = cloud.xyz[..., ::2] - np.array([MIDDLE_X, MIDDLE_Z])
    true = np.stack([across[..., 0], np.zeros(normals.shape[:2]), across[..., 1]], axis=-1) / RADIUS
    true[~on_cylinder] = (0, 0, -1)
    cosine = np.einsum("...i,...i->...", normals, true)
    tilt = np.rad2deg(np.arccos(np.clip(cosine[normals.any(axis=-1)], -1, 1)))
    # Without noise the window is 3 px: the cylinder turns by 3° in as many near its rim.
    # With noise the window leaves slopes of a few percent, and no more beside a jump.
    assert np.percentile(tilt, 99) < (3 if noise == 0 else 15)
    assert normals.any(axis=-1).mean() > 0.97


def test_void_points_take_their_triangles_with_them() -> None:
    cloud = spiral(30)
    cloud.xyz[20, 30] = np.nan
    surface = find_surface(cloud)
    full = 2 * 59 * 79
    assert not (triangles_of(surface) == 20 * 80 + 30).any()
    # Of four cells around it each keeps the triangle of its three other corners.
    assert len(triangles_of(surface)) == full - 4
    assert not surface.valid[20, 30]
    touched = np.flatnonzero(surface.normals.any(axis=-1))
    assert np.array_equal(touched, np.unique(triangles_of(surface)))


def test_thinning_keeps_to_its_limit() -> None:
    cloud, _ = cylinder_before_wall()
    surface = find_surface(cloud, most=2_600)
    assert surface.stride == 3
    assert np.count_nonzero(surface.valid) <= 2_600
    assert np.array_equal(surface.grid, cloud.xyz[::3, ::3].astype(np.float64))


def test_points_far_off_are_left_out_and_counted() -> None:
    cloud, _ = cylinder_before_wall()
    cloud.xyz[5, 5] = (0, 0, 40_000)
    surface = find_surface(cloud)
    assert surface.left_out == 1
    assert not surface.valid[5, 5]
    assert "1 far off left out" in write_viewer(CloudView(cloud, "x"), "")


def test_a_cloud_without_points_is_refused() -> None:
    with pytest.raises(UsageError, match="cloud must have points to be shown, got none"):
        find_surface(cloud_of(np.full((4, 4, 3), np.nan)))


def test_a_single_point_is_a_view() -> None:
    xyz = np.full((4, 4, 3), np.nan)
    xyz[1, 2] = (1, 2, 650)
    assert packed(write_viewer(CloudView(cloud_of(xyz), "x"), ""))["lowest"] == [1, 2, 650]


coordinates = st.floats(-1e5, 1e5, width=32)


@given(arrays(np.float64, st.tuples(st.integers(1, 30), st.just(3)), elements=coordinates))
def test_quantising_is_right_to_half_a_step(points: NDArray[np.float64]) -> None:
    counts, lowest, step = quantise(points)
    assert counts.dtype == np.uint16
    error = np.abs(lowest + step * counts - points).max()
    assert error <= step / 2 + 4 * np.spacing(2e5)  # four roundings at twice the largest number


def packed(html: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json">(.*?)</script>', html, re.DOTALL)
    assert found is not None
    return dict(json.loads(found[1]))


def test_what_is_packed_is_the_surface() -> None:
    cloud, _ = cylinder_before_wall()
    data = packed(write_viewer(CloudView(cloud, "x"), ""))
    counts = np.frombuffer(b64decode(data["points"]), "<u2").reshape(-1, 3)
    points = data["lowest"] + data["step"] * counts
    assert np.abs(points - cloud.points()).max() <= data["step"] / 2 + 1e-9
    cells = np.frombuffer(b64decode(data["cells"]), np.uint8).reshape(-1, data["columns"])
    assert np.array_equal(cells, find_surface(cloud).cells)
    normals = np.frombuffer(b64decode(data["normals"]), np.int8).reshape(-1, 3) / 127.0
    surface = find_surface(cloud)
    assert np.abs(normals - surface.normals[surface.valid]).max() < 0.5001 / 127


def test_colours_follow_the_values() -> None:
    cloud, _ = cylinder_before_wall()
    depth, image, sigma = packed(write_viewer(CloudView(cloud, "x"), ""))["modes"]
    assert [mode["name"] for mode in (depth, image, sigma)] == ["depth", "camera image", "sigma"]
    levels = np.frombuffer(b64decode(image["levels"]), np.uint8).astype(float)
    low, high = float(image["low"]), float(image["high"])
    inside = (cloud.intensity > low) & (cloud.intensity < high)
    read = low + levels / 254 * (high - low)
    # half a step of colour, and the legend's numbers have no decimals
    assert np.abs(read - cloud.intensity.ravel())[inside.ravel()].max() < (high - low) / 508 + 1


def test_what_is_not_known_is_no_choice_or_grey() -> None:
    cloud, _ = cylinder_before_wall()
    nothing = dataclasses.replace(cloud, sigma_mm=np.full_like(cloud.sigma_mm, np.nan))
    modes = packed(write_viewer(CloudView(nothing, "x"), ""))["modes"]
    assert [mode["name"] for mode in modes] == ["depth", "camera image"]
    cloud.sigma_mm[0, 0] = np.nan
    sigma = packed(write_viewer(CloudView(cloud, "x"), ""))["modes"][2]
    levels = np.frombuffer(b64decode(sigma["levels"]), np.uint8)
    assert (levels == 255).tolist() == [True] + [False] * (levels.size - 1)


def test_a_caption_cannot_leave_its_script() -> None:
    caption = "</script><script>alert('<!--')</script>"
    html = write_viewer(CloudView(cylinder_before_wall(20, 30)[0], caption), "")
    assert html.count("<script") == html.count("</script>") == 1
    assert packed(html)["caption"] == caption


def test_rays_are_the_cameras() -> None:
    direction = rays(5, 7)
    assert direction[2, 3] == pytest.approx([0, 0, 1])
    assert direction[0, 6, 0] > 0 > direction[0, 6, 1]
