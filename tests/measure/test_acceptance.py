"""An acceptance test's parts: artefacts, trimming, positions, planarity, decisions, findings."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, UsageError
from fringeworks.geometry.forms import fit_plane, fit_sphere
from fringeworks.measure.acceptance import (
    Artefacts,
    BallFound,
    CalibratedLength,
    Certificate,
    FlatFound,
    Form,
    Lot,
    Warmth,
    certify,
)
from fringeworks.measure.acceptance.certificate import Reading
from fringeworks.measure.acceptance.decision import decide
from fringeworks.measure.acceptance.positions import (
    cap_angle,
    measure_ball,
    measure_bar,
    measure_flat,
)
from fringeworks.measure.acceptance.trimming import fit_trimmed
from fringeworks.measure.region import Region
from tests.measure.artefacts import ball_points, cloud_of, flat_cloud

Array = NDArray[np.float64]

COOL = Warmth()


class TestArtefacts:
    def test_a_warm_bar_is_longer_and_less_known(self) -> None:
        # 100 mm of steel at 24 degrees: 4 K x 11.5e-6 x 100 mm = 4.6 um more. Of U stay 1 um of
        # the certificate, 4 K x 1e-6 x 100 mm = 0.4 um of the expansion, 0.5 K x 11.5e-6 x 100 mm
        # = 0.575 um of the thermometer.
        bar = CalibratedLength(100.0, 0.001, 11.5e-6, 1e-6)
        warmth = Warmth(24.0, 0.5)
        assert bar.at(warmth) == pytest.approx(100.0046, abs=1e-9)
        assert bar.u95_at(warmth) == pytest.approx(np.hypot(1.0, np.hypot(0.4, 0.575)) * 1e-3)
        assert bar.at(COOL) == 100.0

    def test_a_form_counts_as_half_a_standard_deviation(self) -> None:
        """u = sqrt((3 / 2)^2 + (4 / 2)^2) = 2.5, twice that is 5."""
        assert Form(3.0, 4.0).test_u95_mm == pytest.approx(5.0)


class TestTrimming:
    @pytest.mark.parametrize(("wild", "stay_flat"), [(3, True), (4, False)])
    def test_three_of_a_thousand_may_go(self, wild: int, stay_flat: bool) -> None:
        points = flat_cloud(np.zeros((25, 40))).points()
        rng = np.random.default_rng(0)
        points[rng.choice(1000, wild, replace=False), 2] += 5.0
        trimmed = fit_trimmed(points, fit_plane)
        assert trimmed.left_out == 3
        assert (trimmed.fit.flatness_mm < 1e-9) is stay_flat

    def test_less_than_one_is_none(self) -> None:
        assert fit_trimmed(ball_points(333), fit_sphere).left_out == 0
        assert fit_trimmed(ball_points(334), fit_sphere).left_out == 1

    def test_more_is_refused(self) -> None:
        with pytest.raises(UsageError, match=r"trim_per_mille must be 0 to 3, got 3\.1"):
            fit_trimmed(ball_points(100), fit_sphere, per_mille=3.1)


def find_ball(points: Array, diameter: float = 40.0) -> BallFound:
    return measure_ball(points, CalibratedLength(diameter), form=Form(), warmth=COOL, name="ball 1")


class TestPositions:
    @pytest.mark.parametrize("scale", [1.0, 1.001, 0.998])
    def test_a_wrong_scale_is_in_size_and_spacing(self, scale: float) -> None:
        """All points scaled, as by a rig whose baseline is wrong: PS and SD of it, PF without."""
        ends = [
            scale * ball_points(2000, centre=(x, 0.0, 650.0), radius=15.0, seed=seed)
            for seed, x in enumerate((-50.0, 50.0))
        ]
        ball = find_ball(ends[0], 30.0)
        assert ball.ps_mm == pytest.approx(30 * (scale - 1), abs=1e-6)
        assert ball.pf_mm < 1e-6
        bar = measure_bar((ends[0], ends[1]), CalibratedLength(100.0), warmth=COOL, name="bar 1")
        assert bar.sd_mm == pytest.approx(100 * (scale - 1), abs=1e-6)
        assert bar.distance_mm == pytest.approx(100 * scale, abs=1e-6)

    def test_a_warm_artefact_is_held_against_its_warm_length(self) -> None:
        ball = CalibratedLength(40.0, 0.001, cte_per_k=1e-5)
        found = measure_ball(
            ball_points(1500), ball, form=Form(0.003, 0.004), warmth=Warmth(30.0), name="warm"
        )
        assert found.ps_mm == pytest.approx(-0.004, abs=1e-6)
        assert found.ps_u95_mm == pytest.approx(0.001)
        assert found.pf_u95_mm == pytest.approx(0.005)

    def test_what_a_surface_says(self) -> None:
        """Normal deviations of 0.1 mm: 3.92 sigma hold 95 %, each number to five sigma."""
        found = find_ball(ball_points(20_000, sd=0.1)).surface
        assert (found.points, found.left_out) == (19_940, 60)
        assert found.rms_mm == pytest.approx(0.0985, rel=5 / np.sqrt(2 * 20_000))
        # density at 1.96 is 0.0584: sigma of the quantiles' difference is below
        # 0.1 sqrt(2 x 0.025 / 20000) / 0.0584; trimming takes 1.5 per mille off either end
        assert found.band95_mm == pytest.approx(0.392, abs=0.0136 + 0.006)
        assert found.noise_range_mm == pytest.approx(found.range_mm, rel=0.15)

    def test_a_cap_by_its_angle(self) -> None:
        """Even over a cap of 60 degrees, 99 % lie within acos(1 - 0.99 (1 - cos 60))."""
        points = ball_points(50_000, half_deg=60.0)
        expected = 2 * np.degrees(np.arccos(1 - 0.99 * 0.5))
        assert cap_angle(points, np.array([0, 0, 650.0])) == pytest.approx(expected, abs=0.3)

    def test_what_does_not_count(self) -> None:
        few, narrow = find_ball(ball_points(999)), find_ball(ball_points(1000, half_deg=40.0))
        assert few.faults == ("999 points, at least 1000 are needed",)
        # 80 degrees hold 99 % of them; the percentile of a thousand points scatters by one
        (fault,) = narrow.faults
        assert re.fullmatch(r"seen over (79|80|81) degrees, at least 90 are needed", fault)
        assert find_ball(ball_points(1000, half_deg=46.0)).faults == ()
        ends = (ball_points(1000), ball_points(900, centre=(100.0, 0.0, 650.0)))
        bar = measure_bar(ends, CalibratedLength(100.0), warmth=COOL, name="bar")
        assert bar.faults == ("ball 2: 900 points, at least 1000 are needed",)

    def test_a_region_without_a_ball(self) -> None:
        with pytest.raises(MeasurementError, match="lie on one plane"):
            find_ball(flat_cloud(np.zeros((30, 40))).points())


class TestFlats:
    def find(self, across: Array, region: Region | None = None, pitch: float = 1.0) -> FlatFound:
        cloud = flat_cloud(across, pitch=pitch)
        return measure_flat(cloud, region or Region(), flat=Form(0.003, 0.004), name="flat 1")

    def test_the_range_of_a_region(self) -> None:
        across = np.zeros((40, 60))
        across[20, 30:34] = 0.5, 0.5, -0.5, -0.5
        across[5, 5] = 9.0  # outside
        found = self.find(across, Region(pixels=((10, 59), (10, 39))))
        # 1500 points: four may go, and these four are the farthest
        assert found.surface.left_out == 4
        assert found.f_mm < 1e-6
        whole = self.find(across, Region(pixels=((30, 59), (10, 39))))  # 900 points: two
        assert whole.f_mm > 0.5
        assert whole.faults == ("900 points, at least 1000 are needed",)
        assert found.f_u95_mm == pytest.approx(0.005)

    def test_its_size_however_it_lies(self) -> None:
        v, u = np.mgrid[:61, :141].astype(float)
        turn = np.radians(33.0)
        x, y = u * np.cos(turn) - v * np.sin(turn), u * np.sin(turn) + v * np.cos(turn)
        cloud = cloud_of(np.stack([x, y, 600 + 0.4 * y], axis=-1))
        stretched = np.hypot(1, 0.4)  # y is seen from the side
        found = measure_flat(cloud, Region(), flat=Form(), name="flat")
        rectangle = found.corners_mm
        sides = np.linalg.norm(np.roll(rectangle, -1, axis=0) - rectangle, axis=1)
        np.testing.assert_allclose(sides, [*found.size_mm, *found.size_mm], rtol=1e-6)
        assert 140 < found.size_mm[0] < 140 * stretched
        assert 60 < found.size_mm[1] < 60 * stretched

    def test_noise_is_all_of_it(self) -> None:
        """Noise alone: point and patch have its sigma, means of 100 points a tenth of it."""
        across = np.random.default_rng(2).normal(0, 0.1, (100, 100))
        planarity = self.find(across).planarity
        assert planarity.patch_mm == pytest.approx(9.9)
        assert planarity.point_precision_mm is not None
        assert planarity.local_mm is not None
        assert planarity.global_mm is not None
        # the 30 points that are left out take 1.5 % with them
        assert planarity.point_precision_mm == pytest.approx(0.0985, rel=0.05)
        assert planarity.local_mm == pytest.approx(0.0985, rel=5 / np.sqrt(2e4) + 0.001)
        assert planarity.global_mm == pytest.approx(0.1 / 10 * 5, rel=0.35)  # of 100 means

    def test_bend_ripple_and_noise_are_kept_apart(self) -> None:
        u = np.mgrid[:100, :200][1].astype(float)
        bend = self.find(np.cos(2 * np.pi * u / 200)).planarity
        ripple = self.find(0.5 * np.sin(2 * np.pi * u / 10)).planarity
        assert bend.point_precision_mm is not None
        assert bend.point_precision_mm < 0.001
        assert bend.local_mm is not None
        assert bend.local_mm < 0.04
        # from a crest to a tenth of a period beside it, and the same at the trough
        assert bend.global_mm == pytest.approx(2 * np.sin(np.pi / 5) / (np.pi / 5), rel=0.02)
        # of two periods of a sine its line takes 6 / (2 pi)^2 of the variance; its mean is nothing
        left = 1 - 6 / (2 * np.pi) ** 2
        assert ripple.local_mm == pytest.approx(0.5 * np.sqrt(left / 2), rel=0.02)
        assert ripple.global_mm is not None
        assert ripple.global_mm < 0.06

    def test_a_list_of_points_has_no_neighbours(self) -> None:
        across = np.random.default_rng(3).normal(0, 0.1, (60, 80))
        points = flat_cloud(across).points()
        found = measure_flat(cloud_of(points), Region(), flat=Form(), name="flat")
        assert found.planarity.point_precision_mm is None
        assert found.planarity.local_mm is not None


class TestDecisions:
    @pytest.mark.parametrize(
        ("value", "decision"),
        [
            (0.0, "conforms"),
            (0.08, "conforms"),
            (-0.08, "conforms"),
            (0.081, "undecided"),
            (-0.12, "undecided"),
            (0.121, "fails"),
            (-0.121, "fails"),
        ],
    )
    def test_limits_are_shrunk_by_the_uncertainty(self, value: float, decision: str) -> None:
        """A limit of 0.1 with U = 0.02."""
        assert decide(value, 0.1 + 1e-12, 0.02) == decision

    def lot(self, *values: float, limit: float | None = 0.1) -> Lot:
        readings = tuple(Reading(f"bar {i}", value, 0.01) for i, value in enumerate(values, 1))
        return Lot("SD", readings, limit)

    def test_all_must_conform(self) -> None:
        good = (0.01,) * 6
        assert self.lot(*good, -0.05).outcome == "conforms"
        assert self.lot(*good, -0.095).outcome == "undecided"
        assert self.lot(*good, -0.2).outcome == "fails"
        assert self.lot(*good).outcome == "incomplete"
        assert self.lot(0.2).outcome == "fails"
        assert self.lot(*good, 0.2, limit=None).outcome == "no limit"

    def test_the_worst_is_that_of_the_largest_size(self) -> None:
        worst = self.lot(0.02, -0.05, 0.03).worst
        assert worst is not None
        assert (worst.name, worst.value_mm) == ("bar 2", -0.05)
        assert self.lot().worst is None

    def test_what_has_faults_does_not_count(self) -> None:
        lot = self.lot(*(0.01,) * 7)
        spoilt = replace(lot.readings[0], value_mm=5.0, faults=("too few",))
        lot = replace(lot, readings=(spoilt, *lot.readings[1:]))
        assert lot.outcome == "incomplete"
        assert lot.decisions[0] is None
        assert lot.worst is not None
        assert lot.worst.value_mm == 0.01


def certificate(**changes: object) -> Certificate:
    """Ten balls of 40 mm in the corners of a volume of 180 x 130 x 160 mm, its middle and front."""
    corners = [(x, y, z) for z in (600.0, 720.0) for y in (-42.0, 42.0) for x in (-70.0, 70.0)]
    places = [*corners, (0.0, 0.0, 600.0), (0.0, 0.0, 660.0)]
    balls = tuple(
        replace(find_ball(ball_points(1200, centre=centre)), name=f"ball {number}")
        for number, centre in enumerate(places, start=1)
    )
    whole = Certificate(
        name="test",
        volume_mm=(180.0, 130.0, 160.0),
        artefacts=Artefacts(ball=CalibratedLength(40.0)),
        limits_mm={"PF": 0.1, "PS": 0.1},
        trim_per_mille=3.0,
        balls=balls,
    )
    return certify(replace(whole, **changes))  # type: ignore[arg-type]


class TestCertificate:
    def test_what_conforms(self) -> None:
        found = certificate()
        assert [lot.quantity for lot in found.lots] == ["PF", "PS"]
        assert [lot.needed for lot in found.lots] == [10, 10]
        assert found.outcome == "conforms"
        assert found.findings == ()
        assert found.diagonal_mm == pytest.approx(np.sqrt(180**2 + 130**2 + 160**2))

    def test_a_limit_of_what_was_not_measured_is_not_kept(self) -> None:
        found = certificate(limits_mm={"PF": 0.1, "SD": 0.1})
        assert {lot.quantity: lot.outcome for lot in found.lots} == {
            "PF": "conforms",
            "PS": "no limit",
            "SD": "incomplete",
        }
        assert found.outcome == "incomplete"

    def test_all_of_it_needs_ten_ten_seven_and_six(self) -> None:
        limits = {"PF": 1.0, "PS": 1.0, "SD": 1.0, "F": 1.0}
        assert [lot.needed for lot in certificate(limits_mm=limits).lots] == [10, 10, 7, 6]

    def test_without_limits_nothing_is_decided(self) -> None:
        assert certificate(limits_mm={}).outcome == "no limit"

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"volume_mm": (90.0, 65.0, 80.0)}, r"a tenth to a fifth .*: 14 to 27 mm, got 40 mm"),
            (
                {"artefacts": Artefacts(CalibratedLength(40.0), Form(0.03))},
                "form must be at most a fifth of the limit of PF, 0.1 mm, got 0.03 mm",
            ),
            (
                {"balls": certificate().balls[:4]},
                "at least a third of the volume's 160 mm along z, got 0 mm",
            ),
        ],
    )
    def test_what_such_a_test_wants_otherwise(
        self, changes: dict[str, object], message: str
    ) -> None:
        (found,) = certificate(**changes).findings
        assert found.severity == "warning"
        assert re.search(message, found.message)

    def test_an_uncertainty_as_large_as_the_limit(self) -> None:
        balls = tuple(replace(ball, ps_u95_mm=0.1) for ball in certificate().balls)
        found = certificate(balls=balls)
        assert [lot.outcome for lot in found.lots] == ["conforms", "undecided"]
        assert "as large as the limit of PS" in found.findings[0].message

    def test_everyday_words(self) -> None:
        ends = [ball_points(1000, centre=(x, 0.0, 650.0)) for x in (0.0, 100.2)]
        bar = measure_bar((ends[0], ends[1]), CalibratedLength(100.0), warmth=COOL, name="bar")
        short = replace(bar, sd_mm=-0.1)
        artefacts = Artefacts(bar=CalibratedLength(100.0), flat=Form())
        noise = np.random.default_rng(1).normal(0, 0.1, (50, 100))
        flats = [
            measure_flat(flat_cloud(scale * noise), Region(), flat=Form(), name="flat")
            for scale in (1.0, 7.0)
        ]
        words = certificate(artefacts=artefacts, bars=(bar, short), flats=tuple(flats)).words
        assert words.dimension_trueness == pytest.approx(0.002, abs=1e-8)
        assert words.dimension_error_share == pytest.approx(0.0005, abs=1e-8)
        one, seven = (flat.planarity for flat in flats)
        assert one.local_mm is not None
        assert words.local_planarity_mm == pytest.approx(5 * one.local_mm, rel=0.01)
        assert words.global_planarity_mm == seven.global_mm
