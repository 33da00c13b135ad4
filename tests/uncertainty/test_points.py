"""The systematic part of each point against sampling, and its intervals against the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.covariance import Covariance, read_covariance
from fringeworks.calibrate.judge.uncertainty import state_of, triangulate_points
from fringeworks.errors import ShapeError
from fringeworks.kernels.sampling import read_sigma
from fringeworks.model import Axis, Camera, Cloud, Lens, Pose, Projector, Rig
from fringeworks.uncertainty.budget import draw_states
from fringeworks.uncertainty.points import WEIGHTS, add_systematic, systematic_sigma
from fringeworks.uncertainty.seen import Seen, wall_at
from tests.uncertainty.rigs import calibrated, rig_of, truth

Array = NDArray[np.float64]

SAMPLES = 8000
"""A standard deviation of so many is known to 1 / sqrt(2 n) = 0.8 %."""


def covariance_of(rig: Rig) -> Covariance:
    found = read_covariance(rig.further)
    assert found is not None
    return found


def wavy_depth(rig: Rig) -> NDArray[np.float32]:
    """Depths over all of the calibrated volume, with a jump."""
    v, u = np.mgrid[: rig.camera.height, : rig.camera.width]
    return np.asarray(640 + 40 * np.sin(u / 90) + 0.05 * v + 40.0 * (u > 400), dtype=np.float32)


@pytest.mark.parametrize("axis", [None, "x"])
def test_predicted_is_sampled(axis: Axis | None) -> None:
    """Parameters drawn, pixels triangulated anew: within the bar of 3 %, 3.8 sigma of the draws."""
    rig = calibrated()
    depth = wavy_depth(rig)
    predicted = systematic_sigma(depth, rig, covariance_of(rig), axis=axis)
    pixels = np.array([[60, 40], [380, 230], [410, 250], [200, 420], [330, 60]])
    places = pixels[:, 1], pixels[:, 0]
    seen = Seen.of(rig, pixels.astype(float), depth[places].astype(float))
    rng = np.random.default_rng(1)
    states = draw_states(covariance_of(rig), state_of(rig), count=SAMPLES, rng=rng)
    sampled = [
        triangulate_points(one, seen.camera_px, seen.projector_px, weights=WEIGHTS[axis])[:, 2]
        for one in states
    ]
    ratio = predicted[places] / np.std(sampled, axis=0)
    assert np.abs(ratio - 1).max() < 0.03


def test_one_parameter_by_hand() -> None:
    """A projector's cx known to 0.1 px: as much of the column, and nothing of the row.

    Between pinholes side by side ``x_p = cx + f b / z`` (b counted to the left), and a tenth of a
    pixel is ``z^2 / (f b)`` of it: 600^2 / (1000 x 120) x 0.1 = 0.3 mm. Rows with a baseline of 40
    share in the mean: 120^2 / (120^2 + 40^2) = 0.9 of it is left.
    """
    pinhole = Lens(1000.0, 1000.0, 50.0, 40.0)
    pose = Pose(np.eye(3), np.array([120.0, 40.0, 0.0]))
    rig = Rig(Camera(100, 80, pinhole), Projector(400, 200, pinhole), pose)
    alone = Covariance(("projector.cx",), np.array([[0.01]]), 1, 1.0)
    depth = np.full((80, 100), 600.0, np.float32)
    np.testing.assert_allclose(systematic_sigma(depth, rig, alone, axis="x"), 0.3, rtol=1e-5)
    np.testing.assert_allclose(systematic_sigma(depth, rig, alone), 0.27, rtol=1e-5)
    assert not systematic_sigma(depth, rig, alone, axis="y").any()


def test_between_nodes_it_is_linear() -> None:
    """A grid of 1 + 2 s + 3 v + 5 u, which straight lines give back at every pixel."""
    s, v, u = np.meshgrid([0.001, 0.002, 0.003], [0.0, 4.0, 8.0], [0.0, 3.0, 6.0], indexing="ij")
    depth = np.linspace(340, 990, 63, dtype=np.float32).reshape(9, 7)
    out = np.empty_like(depth)
    grid, start = 1 + 200 * s + 3 * v + 5 * u, (0.001, 0.0, 0.0)
    read_sigma(depth, grid, start, (1000.0, 0.25, 1 / 3), 0.0, out)
    row, column = np.mgrid[:9, :7]
    expected = np.sqrt(1 + 200 / depth + 3 * row + 5 * column) * depth.astype(float) ** 2
    np.testing.assert_allclose(out, expected, rtol=1e-6)


def test_the_grid_tells_every_pixel() -> None:
    """Read linearly between nodes, against nodes that stand about one pixel."""
    rig = calibrated()
    depth, covariance = wavy_depth(rig), covariance_of(rig)
    coarse = systematic_sigma(depth, rig, covariance)
    some = (slice(3, None, 93), slice(5, None, 111))
    v, u = np.mgrid[: rig.camera.height, : rig.camera.width]
    alone = []
    for row, column in zip(v[some].ravel(), u[some].ravel(), strict=True):
        single = np.full_like(depth, np.nan)
        single[row, column] = depth[row, column]
        alone.append(systematic_sigma(single, rig, covariance)[row, column])
    np.testing.assert_allclose(coarse[some].ravel(), alone, rtol=0.01)


def test_the_scale_adds_its_share_of_the_depth() -> None:
    rig, depth = calibrated(), wavy_depth(calibrated())
    plain = systematic_sigma(depth, rig, covariance_of(rig))
    scaled = systematic_sigma(depth, replace(rig, scale_sigma=3e-4), covariance_of(rig))
    expected = np.hypot(plain, 3e-4 * depth)
    np.testing.assert_allclose(scaled, expected, rtol=1e-5)


def cloud_of(depth: NDArray[np.float32]) -> Cloud:
    xyz = np.stack([depth, depth, depth], axis=-1)
    return Cloud(xyz, depth * 0, depth * 0, depth * 0)


def test_a_cloud_gets_it_where_it_has_points() -> None:
    rig, depth = calibrated(), wavy_depth(calibrated())
    depth[:100] = np.nan
    found = add_systematic(cloud_of(depth), rig).systematic_mm
    assert found is not None
    assert found.dtype == np.float32
    assert np.array_equal(np.isfinite(found), np.isfinite(depth))
    assert 0.01 < np.nanmedian(found) < 1
    empty = add_systematic(cloud_of(depth * np.float32(np.nan)), rig).systematic_mm
    assert empty is not None
    assert np.isnan(empty).all()


def test_without_a_covariance_nobody_knows() -> None:
    rig = rig_of(truth())
    assert add_systematic(cloud_of(wavy_depth(rig)), rig).systematic_mm is None


def test_a_map_of_another_camera_is_refused() -> None:
    with pytest.raises(ShapeError, match=r"must be \(480, 752\) like the rig's camera"):
        add_systematic(cloud_of(np.full((3, 4), 600, np.float32)), calibrated())


def coverage(seeds: range) -> float:
    """Share of true depths within 1.96 sigma of those that the calibrations measure."""
    exact = rig_of(truth())
    wall = [wall_at(exact, depth)[0] for depth in (560.0, 650.0, 740.0)]
    hits = []
    for seed in seeds:
        rig = calibrated(seed)
        for seen in wall:
            found = triangulate_points(state_of(rig), seen.camera_px, seen.projector_px)[:, 2]
            at = Seen(seen.points, seen.camera_px, seen.projector_px)
            sigma = _sigma_at(rig, at)
            hits.append(np.abs(found - seen.points[:, 2]) < 1.96 * sigma)
    return float(np.mean(np.concatenate(hits)))


def _sigma_at(rig: Rig, seen: Seen) -> Array:
    depth = np.full((rig.camera.height, rig.camera.width), np.nan, np.float32)
    places = tuple(np.rint(seen.camera_px).astype(int).T[::-1])
    depth[places] = seen.points[:, 2]
    return np.asarray(systematic_sigma(depth, rig, covariance_of(rig))[places], dtype=float)


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    """The 95 % ones in 90 to 99 % of the points; `bench --only accuracy` takes 50 calibrations.

    Points of one calibration err together, in about three independent ways: the share scatters by
    sqrt(0.95 0.05 / 48) = 3.1 %.
    """
    assert 0.90 < coverage(range(16)) < 0.99
