"""Sections against closed forms: crossings, end points, arcs, series; and weights of fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.region import Region
from fringeworks.measure.section import CutPlane, cut, make_slicer, radius_series
from fringeworks.measure.weights import LEAST_OF_MEDIAN, normal_sigma
from fringeworks.model import Camera, Cloud, Pose, Rig
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import measure_cylinder, measure_plane, scan
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import cylinder_scene, paper_rig
from fringeworks.twin.simulate import simulate

Array = NDArray[np.float64]

X, Y = np.array([1.0, 0, 0]), np.array([0.0, 1, 0])
RADIUS, CENTRE_Z = 52.5, 700.0


def cloud_of(xyz: Array, sigma: float = 0.0) -> Cloud:
    flat = np.full(xyz.shape[:2], sigma, np.float32)
    return Cloud(xyz.astype(np.float32), flat, flat, flat)


def rod(sd: float = 0.0, *, reach: float = 0.9, seed: int = 0) -> Cloud:
    """An upright cylinder on a grid of 0.5 mm, seen up to a share of its radius; a wall behind."""
    y, x = np.mgrid[-40:40.1:0.5, -60:60.1:0.5]
    seen = np.abs(x) <= reach * RADIUS
    depth = np.sqrt(np.where(seen, RADIUS**2 - x**2, 0))
    away = 1 + np.random.default_rng(seed).normal(0, 1, x.shape) * sd / RADIUS
    z = np.where(seen, CENTRE_Z - depth * away, 800.0)
    return cloud_of(np.stack([np.where(seen, x * away, x), y, z], axis=-1), sd)


ROD_ALONE = Region(box_mm=((-np.inf, np.inf), (-np.inf, np.inf), (0.0, 750.0)))


class TestCut:
    def test_numbers_by_hand(self) -> None:
        # z = 600 + x / 2 over four columns and two rows; the plane x = 1.5 lies half way between
        # columns 1 and 2: one crossing per row.
        y, x = np.mgrid[0:2.0, 0:4.0]
        section = cut(cloud_of(np.stack([x, y, 600 + x / 2], axis=-1)), CutPlane(X, 1.5))
        np.testing.assert_allclose(section.points_mm, [[1.5, 0, 600.75], [1.5, 1, 600.75]])
        assert section.half_chord_mm == pytest.approx(0.5)
        np.testing.assert_allclose(section.plane.basis, [[0, 1, 0], [0, 0, 1]], atol=1e-15)
        np.testing.assert_allclose(section.curve_mm, [[0, 600.75], [1, 600.75]])

    def test_the_papers_end_points(self) -> None:
        section = cut(rod(), CutPlane(Y, 10.2), ROD_ALONE)
        # The outermost columns at or inside 0.9 R: 47 mm; between rows nothing is lost.
        np.testing.assert_allclose(section.ends_mm[:, 0], [-47, 47], atol=1e-4)
        assert section.half_chord_mm == pytest.approx(47, abs=1e-4)
        arc = section.fit_arc()
        # float32 rounds depths of 650 mm at 3e-5 mm; chords between rows are straight lines.
        assert arc.radius_mm == pytest.approx(RADIUS, abs=1e-4)
        np.testing.assert_allclose(arc.centre_mm, [0, CENTRE_Z], atol=1e-4)
        assert np.all(np.diff(section.curve_mm[:, 0]) > 0)

    def test_depth_jumps_stay_open(self) -> None:
        with pytest.raises(MeasurementError, match="meets 0 points"):
            cut(rod(), CutPlane(X, 47.2))  # between the rod's last column and the wall's first

    def test_one_point_per_row_or_column(self) -> None:
        """Those of both directions would share their noise."""
        turned = np.array([1.0, 1.0, 0]) / np.sqrt(2)
        assert len(cut(rod(), CutPlane(Y, 0.2), ROD_ALONE).points_mm) == 189
        assert len(cut(rod(), CutPlane(turned, 0.1), ROD_ALONE).points_mm) <= 161

    def test_a_slab(self) -> None:
        points = rod().points()
        loose = cloud_of(points[points[:, 2] < 750][None])
        with pytest.raises(UsageError, match="without the camera's grid is cut by a slab"):
            cut(loose, CutPlane(Y, 0))
        section = cut(loose, CutPlane(Y, 0), thickness_mm=1.2)
        assert len(section.points_mm) == 3 * 189
        np.testing.assert_allclose(section.points_mm[:, 1], 0, atol=1e-12)
        assert section.fit_arc().radius_mm == pytest.approx(RADIUS, abs=1e-4)
        with pytest.raises(UsageError, match="thickness_mm must be positive, got 0"):
            cut(loose, CutPlane(Y, 0), thickness_mm=0.0)

    def test_any_frame(self) -> None:
        turn, move = rotation_matrix(np.array([0.4, -1.0, 0.2])), np.array([5.0, 6, 7])
        still = rod(0.05)
        pose = Pose(turn, move)
        xyz = (still.xyz.astype(np.float64) @ turn.T + move).astype(np.float32)
        there = replace(still, xyz=xyz, frame="board", frame_from_camera=pose)
        normal = turn @ Y
        moved = cut(there, CutPlane(normal, 10.2 + float(normal @ move)))
        kept = cut(still, CutPlane(Y, 10.2))
        assert len(moved.points_mm) == len(kept.points_mm)
        ends = kept.ends_mm @ turn.T + move
        flip = np.sign((moved.ends_mm[1] - moved.ends_mm[0]) @ (ends[1] - ends[0]))
        np.testing.assert_allclose(moved.ends_mm[:: int(flip)], ends, atol=1e-3)

    def test_where_nothing_is(self) -> None:
        with pytest.raises(MeasurementError, match="meets 0 points; the cloud lies between -40"):
            cut(rod(), CutPlane(Y, 100.0))
        with pytest.raises(ShapeError, match=r"normal must be \(3,\)"):
            CutPlane(np.zeros(2), 0.0)
        for wrong in ([0.0, 0, 0], [2.0, 0, 0], [np.nan, 0, 0]):
            with pytest.raises(UsageError, match="normal must be of length one"):
                CutPlane(np.array(wrong), 0.0)
        with pytest.raises(UsageError, match="at_mm must be finite"):
            CutPlane(X, float("nan"))

    def test_a_line_has_no_arc(self) -> None:
        y, x = np.mgrid[0:20.0, 0:20.0]
        section = cut(cloud_of(np.stack([x, y, 600 + x / 2], axis=-1)), CutPlane(Y, 5.5))
        with pytest.raises(MeasurementError, match="line"):
            section.fit_arc()


class TestSeries:
    def test_mean_and_sd(self) -> None:
        sd = 0.05
        slicer = make_slicer(rod(sd), ROD_ALONE)
        series = radius_series(slicer, Y, np.arange(-30, 30.5, 1.0))
        assert series.measured == 61
        # A section lies between two rows: their noises average, and 61 arcs are independent but
        # where they share a row (every row is used at most once at 1 mm of pitch 0.5).
        sigma = float(np.mean(series.radius_sigma_mm))
        assert abs(series.mean_mm(series.radius_mm) - RADIUS) < 5 * sigma / np.sqrt(61)
        assert series.sd_mm(series.radius_mm) == pytest.approx(sigma, rel=5 / np.sqrt(2 * 60))
        assert series.mean_mm(series.half_chord_mm) == pytest.approx(47.0, abs=0.05)

    def test_what_is_outside_has_no_radius(self) -> None:
        series = radius_series(make_slicer(rod(), ROD_ALONE), Y, [-100.0, 0.0])
        assert series.measured == 1
        assert np.isnan(series.radius_mm[0])
        assert np.isnan(series.sd_mm(series.radius_mm))
        with pytest.raises(MeasurementError, match="none of the 2 sections shows an arc"):
            radius_series(make_slicer(rod(), ROD_ALONE), Y, [-100.0, 100.0])


def half_the_rows(rig: Rig) -> Rig:
    """Those about the middle: an upright cylinder looks alike in all."""
    camera, lens = rig.camera, rig.camera.lens
    rows = camera.height // 2
    cut = Camera(camera.width, rows, replace(lens, cy=lens.cy - rows // 2))
    return replace(rig, camera=cut)


class TestWeights:
    def test_sigma_along_the_normal_by_hand(self) -> None:
        # A plane facing the camera: sigma itself on the axis; aside the ray is longer, but its
        # part along z is one.
        y, x = np.mgrid[-1:2.0, -1:2.0]
        cloud = cloud_of(np.stack([100 * x, 100 * y, np.full(x.shape, 600.0)], axis=-1), 0.1)
        fit = measure_plane(cloud)
        np.testing.assert_allclose(normal_sigma(cloud, None, fit), 0.1, rtol=1e-6)
        turn = rotation_matrix(np.array([0.3, 1.0, -0.5]))
        xyz = (cloud.xyz.astype(np.float64) @ turn.T).astype(np.float32)
        pose = Pose(turn, np.zeros(3))
        there = replace(cloud, xyz=xyz, frame_from_camera=pose)
        np.testing.assert_allclose(normal_sigma(there, None, measure_plane(there)), 0.1, rtol=1e-5)

    def test_grazing_points_count_for_little_more(self) -> None:
        cloud = rod(0.05)
        across = normal_sigma(cloud, ROD_ALONE, measure_cylinder(cloud, ROD_ALONE))
        assert across.max() == pytest.approx(0.05, rel=0.02)  # facing, and rays nearly along z
        assert across.min() >= LEAST_OF_MEDIAN * np.median(across)

    def test_unknown_sigma(self) -> None:
        cloud = rod(0.05)
        cloud.sigma_mm[3, 120] = np.nan
        with pytest.raises(MeasurementError, match="1 of the 30429 points have no sigma"):
            measure_cylinder(cloud, ROD_ALONE, weighted=True)

    @pytest.mark.slow
    def test_less_scatter_and_more_bias(self) -> None:
        """Why `--weighted` is no default: what grazing points err by is common to all scans."""
        rig = half_the_rows(paper_rig())
        sequence = make_sequence("measure", width=608, height=684, axes=("x",))
        errors = []
        for seed in range(8):
            rng = np.random.default_rng(100 + seed)
            made = simulate(cylinder_scene(), rig, sequence, effects=Effects(), rng=rng)
            cloud = scan(made.capture, rig)
            fits = [measure_cylinder(cloud, weighted=weighted) for weighted in (False, True)]
            errors.append([fit.radius_mm - RADIUS for fit in fits])
        (plain, weighted), (scatter, less) = np.mean(errors, 0), np.std(errors, axis=0, ddof=1)
        assert less < 0.8 * scatter
        assert abs(plain) < 0.003
        assert 0.004 < weighted < 0.012
        print(f"\nplain {plain:.4f} sd {scatter:.4f} mm, weighted {weighted:.4f} sd {less:.4f} mm")
