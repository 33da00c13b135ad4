"""The search for forms: on points whose forms are known, and on scans of the digital twin."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, UsageError
from fringeworks.geometry.forms import ConeFit, CylinderFit, PlaneFit, SphereFit
from fringeworks.geometry.forms.named import FITS, Shape, guess_shape, shape_of
from fringeworks.geometry.neighbours import local_planes, spacing_of, tree_of
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.found import (
    FoundForms,
    SearchRules,
    find_forms,
    keep_largest,
    noise_at,
)
from fringeworks.measure.region import Region
from fringeworks.model import Cloud
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import measure_cone, measure_cylinder, measure_plane, measure_sphere, scan
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import named_scene, paper_rig
from fringeworks.twin.simulate import simulate
from tests.scenes import coarser

Array = NDArray[np.float64]

SD = 0.05
BALL, ROD = np.array([-60.0, 0.0, 650.0]), np.array([60.0, 0.0, 680.0])


def grid(width: float, height: float, pitch: float = 1.0) -> Array:
    x, y = np.mgrid[-width / 2 : width / 2 : pitch, -height / 2 : height / 2 : pitch]
    return np.stack([x.ravel(), y.ravel()], axis=1)


def ball(radius: float) -> Array:
    """What a camera far away sees of a ball about `BALL`, pixels of 0.7 mm."""
    across = grid(2 * radius, 2 * radius, 0.7)
    square = radius**2 - np.sum(across**2, axis=1)
    seen = square > 0.1 * radius**2
    return np.asarray(BALL + np.column_stack([across[seen], -np.sqrt(square[seen])]))


def rod(radius: float, length: float) -> Array:
    """The same of an upright cylinder about `ROD`."""
    across = grid(1.9 * radius, length)
    return np.asarray(ROD + np.column_stack([across, -np.sqrt(radius**2 - across[:, 0] ** 2)]))


def wall() -> Array:
    flat = grid(240, 160)
    return np.column_stack([flat, np.full(len(flat), 720.0)])


def noisy(points: Array, seed: int = 0) -> Array:
    points = points + np.random.default_rng(seed).normal(0, SD, points.shape) * [0, 0, 1]
    return np.random.default_rng(seed + 1).permutation(points)


def find(points: Array, seed: int = 0, **rules: object) -> FoundForms:
    wanted = SearchRules(**rules)  # type: ignore[arg-type]
    return find_forms(points, rules=wanted, rng=np.random.default_rng(seed))


class TestKnownForms:
    @pytest.mark.parametrize("seed", range(3))
    def test_wall_ball_and_rod(self, seed: int) -> None:
        parts = (wall(), ball(40), rod(30, 120))
        points = noisy(np.concatenate(parts), seed)
        found = find(points, seed)
        assert [form.name for form in found.forms] == ["plane", "sphere", "cylinder"]
        flat, round_, straight = (form.fit for form in found.forms)
        assert isinstance(flat, PlaneFit)
        assert isinstance(straight, CylinderFit)
        assert isinstance(round_, SphereFit)
        # Noise along z alone: slopes see less of it, so that five sigma hold more than needed.
        assert flat.offset_mm == pytest.approx(-720, abs=5 * SD / np.sqrt(len(parts[0])))
        assert abs(straight.radius_mm - 30) < 5 * straight.radius_sigma_mm
        assert abs(round_.radius_mm - 40) < 5 * round_.radius_sigma_mm
        # Four standard deviations along z, and a sample's neighbours at the rims.
        for form, part in zip(found.forms, parts, strict=True):
            assert np.count_nonzero(form.members) == pytest.approx(len(part), rel=0.01)
        members = np.stack([form.members for form in found.forms])
        assert members.sum(axis=0).max() == 1  # a point lies on one form at most
        np.testing.assert_array_equal(found.labels >= 0, members.any(axis=0))

    def test_the_frame_does_not_matter(self) -> None:
        turn = rotation_matrix(np.array([0.5, -1.0, 0.3]))
        points = noisy(np.concatenate([wall(), ball(40)]))
        still, moved = find(points), find(points @ turn.T + [5, 6, 7])
        assert [form.name for form in moved.forms] == [form.name for form in still.forms]
        for a, b in zip(still.forms, moved.forms, strict=True):
            # The same points but for a few at the tolerance, which the search's draws decide.
            assert np.mean(a.members != b.members) < 1e-3

    def test_a_simpler_form_is_preferred(self) -> None:
        """A plane lies on huge spheres, a cylinder on slim cones."""
        for points, name in ((wall(), "plane"), (rod(30, 120), "cylinder"), (ball(40), "sphere")):
            assert [form.name for form in find(noisy(points)).forms] == [name]

    def test_exact_points(self) -> None:
        found = find(np.concatenate([wall(), ball(40)]))
        assert [form.name for form in found.forms] == ["plane", "sphere"]
        assert found.noise_mm > 0

    def test_parts_of_different_noise(self) -> None:
        """Most of the points are exact: the tolerance follows the noise from place to place."""
        found = find(np.concatenate([wall(), noisy(ball(40))]))
        assert [form.name for form in found.forms] == ["plane", "sphere"]
        assert found.forms[1].share == pytest.approx(len(ball(40)) / 47_633, rel=0.02)

    def test_steps_of_a_gray_code(self) -> None:
        """Cells of 20 mm, each smooth by itself, 3.5 mm from end to end: the points' sigma tells.

        A step's standard deviation is its height over the root of 12, 1 mm.
        """
        points = wall()
        points[:, 2] += 3.5 * ((points[:, 0] / 20) % 1 - 0.5)
        assert len(find(points, most=6).forms) == 6
        rng = np.random.default_rng(0)
        found = find_forms(points, sigma_mm=np.full(len(points), 3.5 / np.sqrt(12)), rng=rng)
        assert [form.name for form in found.forms] == ["plane"]
        assert found.noise_mm == pytest.approx(3.5 / np.sqrt(12))
        assert found.forms[0].share > 0.99
        exact = find(noisy(wall()))
        known = find_forms(noisy(wall()), sigma_mm=np.full(len(points), SD), rng=rng)
        assert known.noise_mm == exact.noise_mm  # an honest sigma changes nothing

    def test_only_what_is_asked_for(self) -> None:
        points = noisy(np.concatenate([wall(), ball(40)]))
        (form,) = find(points, names=("sphere",)).forms
        assert isinstance(form.fit, SphereFit)
        assert form.fit.radius_mm == pytest.approx(40, abs=0.05)
        assert len(find(points, most=1).forms) == 1

    def test_small_forms_need_to_be_asked_for(self) -> None:
        points = noisy(np.concatenate([wall(), ball(8)]))
        share = len(ball(8)) / len(points)
        assert share < 0.03
        assert len(find(points).forms) == 1
        assert [form.name for form in find(points, least_share=share / 2).forms] == [
            "plane",
            "sphere",
        ]

    def test_a_wavy_sheet_is_none(self) -> None:
        flat = grid(200, 120)
        wave = 3 * np.sin(flat[:, 0] / 8) * np.cos(flat[:, 1] / 6)
        with pytest.raises(MeasurementError, match=r"no form \(plane, .*allow a larger tolerance"):
            find(noisy(np.column_stack([flat, 700 + wave])))

    def test_scattered_points_are_none(self) -> None:
        points = np.random.default_rng(0).uniform(-50, 50, (3000, 3))
        with pytest.raises(MeasurementError, match="no form"):
            find(points, tolerance_mm=0.5)


class TestNothingToFind:
    def test_degenerate_points(self) -> None:
        with pytest.raises(MeasurementError, match="at least 100 points, got 99"):
            find(np.zeros((99, 3)))
        with pytest.raises(MeasurementError, match="are one point"):
            find(np.ones((500, 3)))
        with pytest.raises(MeasurementError, match="no form"):
            find(np.linspace(0, 100, 500)[:, None] * [1.0, 2.0, 2.0])
        points = wall()
        points[3, 1] = np.nan
        with pytest.raises(MeasurementError, match="1 of the 38400 points are not finite"):
            find(points)

    @pytest.mark.parametrize(
        ("rules", "message"),
        [
            ({"tolerance_mm": 0.0}, "tolerance_mm must be positive, got 0"),
            ({"tolerance_mm": np.nan}, "tolerance_mm must be positive, got nan"),
            ({"least_share": 0.0}, r"least_share must be in \(0, 1\], got 0"),
            ({"least_share": 1.5}, "got 1.5"),
        ],
    )
    def test_rules_that_make_no_sense(self, rules: dict[str, float], message: str) -> None:
        with pytest.raises(UsageError, match=message):
            SearchRules(**rules)  # type: ignore[arg-type]


class TestParts:
    def test_noise_and_normals(self) -> None:
        points = noisy(wall())
        # Its plane through 25 points takes three degrees of freedom, which are accounted for;
        # the median of chi over 22 degrees lies 1.5 % below its rms.
        noises = noise_at(points[:2000], points)
        assert np.median(noises) == pytest.approx(0.985 * SD, rel=0.03)
        tree = tree_of(points)
        normals, _ = local_planes(points[:500], tree, count=60)
        # 60 points within 4.4 mm: slopes to 2 * 0.05 / (4.4 sqrt 60) = 0.003; worse at rims.
        assert np.median(np.hypot(normals[:, 0], normals[:, 1])) < 0.005
        assert spacing_of(points[:500], tree) == pytest.approx(1.0, abs=0.02)

    @pytest.mark.parametrize("name", list(FITS))
    def test_a_guess_on_an_exact_patch(self, name: str) -> None:
        rng = np.random.default_rng(1)
        turn, size = rotation_matrix(np.array([0.4, -0.8, 0.2])), {"cone": 0.4}.get(name, 30.0)
        truth = Shape(name, np.array([3.0, -4, 600]), turn[:, 2], size)  # type: ignore[arg-type]
        angle, along = rng.uniform(-1, 1, 300), rng.uniform(40, 90, 300)
        if name == "plane":
            local = np.stack([along, angle * 30, np.zeros(300)], axis=1)
        elif name == "sphere":
            local = np.stack([np.sin(angle), np.sin(along), np.ones(300)], axis=1)
            local *= size / np.linalg.norm(local, axis=1, keepdims=True)
        else:
            away = along * np.tan(size) if name == "cone" else size
            local = np.stack([away * np.cos(angle), away * np.sin(angle), along], axis=1)
        points = truth.point + local @ turn.T
        np.testing.assert_allclose(truth.distances(points), 0, atol=1e-10)
        guess = guess_shape(truth.name, points, truth.normals(points))
        assert guess is not None
        # A cone's slope is taken at its middle height, which Taubin's weights put nearly right.
        loose = 0.5 if name == "cone" else 1e-6
        np.testing.assert_allclose(guess.distances(points), 0, atol=loose)
        if name != "sphere":
            assert abs(guess.axis @ truth.axis) == pytest.approx(1, abs=1e-9)

    @pytest.mark.parametrize("name", list(FITS))
    def test_a_fit_as_a_shape(self, name: str) -> None:
        points = noisy(rod(30, 120))[:400]
        points[:, [0, 2]] += (points[:, 1:2] / 200) * (points - ROD)[:, [0, 2]]  # 8.5 degrees
        fit = FITS[name](points)  # type: ignore[index]
        np.testing.assert_allclose(shape_of(fit).distances(points), fit.deviations_mm, atol=1e-8)


@cache
def twin_scan(scene: str, coarse: float = 1.5) -> Cloud:
    """The scene as the paper's rig scans it with three steps, its lenses known, with noise.

    Its camera has so many times fewer pixels each way.
    """
    rig = coarser(paper_rig(), coarse)
    sequence = make_sequence("paper", width=608, height=684)
    rng = np.random.default_rng(1)
    capture = simulate(named_scene(scene), rig, sequence, effects=Effects(), rng=rng).capture
    return scan(capture, rig)


OPEN = (-np.inf, np.inf)


def half(side: str) -> Region:
    """The left or the right half of the scene."""
    return Region(box_mm=((-np.inf, 0.0) if side == "left" else (0.0, np.inf), OPEN, OPEN))


class TestTwin:
    def test_balls(self) -> None:
        cloud = twin_scan("balls")
        found = find(cloud.points())
        assert [form.name for form in found.forms] == ["sphere", "sphere"]
        spheres = [form.fit for form in found.forms if isinstance(form.fit, SphereFit)]
        for fit in spheres:
            plain = measure_sphere(cloud, half("left" if fit.centre_mm[0] < 0 else "right"))
            # Of the points 0.1 % are off: a sigma or so.
            assert abs(fit.radius_mm - plain.radius_mm) < 3 * plain.radius_sigma_mm
            assert fit.radius_mm == pytest.approx(20, abs=0.05)
        apart = np.linalg.norm(spheres[0].centre_mm - spheres[1].centre_mm)
        assert apart == pytest.approx(120, abs=0.05)

    @pytest.mark.slow
    def test_two(self) -> None:
        cloud = twin_scan("two", 1.0)  # the apex is known to 0.1 mm
        found = find(cloud.points())
        assert [form.name for form in found.forms] == ["cylinder", "cone"]
        straight, cone = (form.fit for form in found.forms)
        assert isinstance(straight, CylinderFit)
        assert isinstance(cone, ConeFit)
        plain, other = measure_cylinder(cloud, half("left")), measure_cone(cloud, half("right"))
        assert abs(straight.radius_mm - plain.radius_mm) < 3 * plain.radius_sigma_mm
        assert straight.radius_mm == pytest.approx(52.5, abs=0.03)
        assert abs(cone.half_angle_deg - other.half_angle_deg) < 3 * other.half_angle_sigma_deg
        assert cone.half_angle_deg == pytest.approx(np.degrees(np.arctan(38 / 110)), abs=0.05)
        np.testing.assert_allclose(cone.apex_mm, [62, -58, 665], atol=0.2)
        assert np.mean(found.labels < 0) < 0.01

    @pytest.mark.slow
    def test_cylinder(self) -> None:
        cloud = twin_scan("cylinder")
        (form,) = find(cloud.points()).forms
        assert isinstance(form.fit, CylinderFit)
        plain = measure_cylinder(cloud)
        assert abs(form.fit.radius_mm - plain.radius_mm) < 3 * plain.radius_sigma_mm
        assert form.fit.radius_mm == pytest.approx(52.5, abs=0.03)

    @pytest.mark.slow
    def test_step(self) -> None:
        cloud = twin_scan("step")
        found = find(cloud.points())
        assert [form.name for form in found.forms] == ["plane"] * 3
        fits = [form.fit for form in found.forms if isinstance(form.fit, PlaneFit)]
        offsets = sorted(-fit.offset_mm for fit in fits)
        np.testing.assert_allclose(offsets, [680, 700, 720], atol=0.03)
        boxed = measure_plane(cloud, Region(box_mm=(OPEN, OPEN, (670, 690))))
        assert abs(offsets[0] + boxed.offset_mm) < 3 * boxed.offset_sigma_mm

    def test_a_hand_is_none(self) -> None:
        with pytest.raises(MeasurementError, match="no form"):
            find(twin_scan("hand").points())

    def test_the_largest_is_kept(self) -> None:
        cloud = twin_scan("balls")
        kept = keep_largest(cloud, half("left"), "sphere", rng=np.random.default_rng(0))
        assert kept.valid.sum() > 0.99 * (cloud.valid & (cloud.xyz[..., 0] < 0)).sum()
        assert kept.points()[:, 0].max() < 0
        # Of both balls the one with more points is kept, and a plain fit then is right.
        alone = keep_largest(cloud, Region(), "sphere", rng=np.random.default_rng(0))
        assert measure_sphere(alone).radius_mm == pytest.approx(20, abs=0.05)
        assert measure_sphere(cloud).form_rms_mm > 1
