"""The paper's models as clouds: bit for bit at zero, their sigma, their axis, x and y."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import DecodeError, ShapeError, UsageError
from fringeworks.model import (
    AbsolutePhase,
    Axis,
    Camera,
    CodedAxis,
    Extended,
    Fringe,
    Noise,
    ProjectorMap,
    Reason,
    Rig,
    WrappedPhase,
)
from fringeworks.reconstruct.full import CloudRules, triangulate
from fringeworks.reconstruct.geometric import triangulate_by_phase
from tests.scenes import CAMERA, POSE, PROJECTOR, RIG, map_of, plane_points

PERIOD = 32.0
STRAIGHT = replace(
    RIG,
    projector=replace(
        PROJECTOR, lens=replace(PROJECTOR.lens, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0)
    ),
)
"""The camera keeps its distortion: the ray is undistorted. The projector has none."""

TILTED = plane_points(STRAIGHT, (0.2, -0.1, -1.0), -650.0)
# Half a unit in the last place of a float32 coordinate at 814 px is 3e-5 px; one px is worth 2.6 mm
# of depth along x, up to 290 mm along y, where this rig has hardly any baseline.
ROUNDING_PX = 3.1e-5
MM_PER_PX = {"x": 2.6, "y": 290.0}
TEN = Extended("x", PERIOD, C1=0.05, C2=0.08, Kphi=0.02, Ku0=17.9, Kfc=-6.975, Kz=0.2)


def with_fringes(projector_map: ProjectorMap, period_px: float = PERIOD) -> ProjectorMap:
    """The same as if measured by fringes of that period."""
    return ProjectorMap(
        None if projector_map.column is None else _fringed(projector_map.column, period_px),
        None if projector_map.row is None else _fringed(projector_map.row, period_px),
    )


def _fringed(axis: CodedAxis, period_px: float) -> CodedAxis:
    flat = axis.offset
    wrapped = WrappedPhase(
        Fringe(axis.axis, period_px, (0.0, 2.0, 4.0)),
        phase=flat,
        offset=flat,
        modulation=flat,
        residual=flat,
        sigma=flat,
        noise=Noise(1.0, 0.0, 0.0, "camera"),
        void=axis.void,
    )
    return replace(axis, phase=AbsolutePhase(wrapped, np.zeros(flat.shape, np.int32), flat))


@pytest.mark.parametrize("axis", ["x", "y"])
def test_points_come_back_where_the_projector_does_not_distort(axis: Axis) -> None:
    cloud = triangulate_by_phase(map_of(STRAIGHT, TILTED, axes=axis), STRAIGHT)
    assert cloud.valid.all()
    assert np.abs(cloud.xyz - TILTED).max() < 3 * ROUNDING_PX * MM_PER_PX[axis]
    full = triangulate(map_of(STRAIGHT, TILTED, axes=axis), STRAIGHT)
    assert np.abs(cloud.xyz - full.xyz).max() < 1e-4  # both round z to float32: 3e-5 mm each
    np.testing.assert_allclose(cloud.sigma_mm, full.sigma_mm, rtol=1e-5)
    assert np.isnan(cloud.epipolar_px).all()


def test_a_distorting_projector_leaves_what_the_model_ignores() -> None:
    """Seen by a pinhole of the same focal length and centre, the same map is a bent surface."""
    seen = map_of(RIG, TILTED, axes="x")
    cloud = triangulate_by_phase(seen, RIG)
    np.testing.assert_array_equal(cloud.xyz, triangulate_by_phase(seen, STRAIGHT).xyz)
    assert np.abs(cloud.xyz[..., 2] - TILTED[..., 2]).max() > 1


@pytest.mark.parametrize("period", [32.0, 17.3])
def test_all_ten_at_zero_change_no_bit(period: float) -> None:
    """Whatever the period: the same operations, and the same ones without `extended`."""
    coded = with_fringes(map_of(RIG, TILTED, axes="x"), period)
    one = triangulate_by_phase(coded, RIG)
    zeros = triangulate_by_phase(coded, RIG, extended=Extended("x", period))
    np.testing.assert_array_equal(one.xyz, zeros.xyz)
    np.testing.assert_array_equal(one.sigma_mm, zeros.sigma_mm)


def test_predicted_sigma_is_the_observed_one() -> None:
    noise = np.random.default_rng(7).normal(0, 0.02, (*TILTED.shape[:2], 2))
    coded = with_fringes(map_of(STRAIGHT, TILTED, axes="x", noise=noise))
    quiet = with_fringes(map_of(STRAIGHT, TILTED, axes="x"))
    clouds = [triangulate_by_phase(each, STRAIGHT, extended=TEN) for each in (coded, quiet)]
    scores = (clouds[0].xyz[..., 2] - clouds[1].xyz[..., 2]) / clouds[1].sigma_mm
    assert abs(np.std(scores) - 1) < 5 / np.sqrt(2 * scores.size)


def test_x_and_y_are_the_calibrated_rays() -> None:
    """Literally read, equations 2 and 3 with 6 and 7 shear by Ku0 / f and scale by Kfc / f: the
    paper's -6.975 of 1974 px are 0.35 %, 0.18 mm on its cylinder of 52.5 mm."""
    coded = with_fringes(map_of(STRAIGHT, TILTED, axes="x"))
    ours = triangulate_by_phase(coded, STRAIGHT, extended=TEN).xyz.astype(np.float64)
    read = triangulate_by_phase(coded, STRAIGHT, extended=TEN, literal=True).xyz.astype(np.float64)
    rays = TILTED / TILTED[..., 2:]
    rounding = 1.5e-7 * np.abs(ours).max()
    np.testing.assert_allclose(ours, rays * ours[..., 2:], atol=rounding)
    f = CAMERA.lens.fx
    shear = (read[..., 0] * (f - 6.975) - ours[..., 0] * f) / ours[..., 2]
    np.testing.assert_allclose(shear, 17.9, atol=3 * rounding * f / 550)
    np.testing.assert_array_equal(read[..., 2], ours[..., 2])
    assert 52.5 * 6.975 / (f - 6.975) == pytest.approx(0.18, abs=0.01)


def test_parameters_of_other_fringes_are_refused() -> None:
    coded = map_of(RIG, TILTED, axes="x")
    with pytest.raises(UsageError, match="belong to fringes of 32 px along x, the capture has f"):
        triangulate_by_phase(with_fringes(coded, 16.0), RIG, extended=TEN)
    with pytest.raises(UsageError, match="has a Gray code alone along x: calibrate with --exten"):
        triangulate_by_phase(coded, RIG, extended=TEN)
    row = with_fringes(map_of(RIG, TILTED, axes="y"))
    with pytest.raises(UsageError, match=r"axis must be one that the capture codes \(y\), got x"):
        triangulate_by_phase(row, RIG, extended=TEN)
    both = with_fringes(map_of(RIG, TILTED))
    with pytest.raises(UsageError, match="along x, the capture has fringes of 32 px along y"):
        triangulate_by_phase(both, RIG, extended=TEN, rules=CloudRules(axis="y"))


def test_of_both_axes_one_is_used() -> None:
    both = map_of(RIG, TILTED)
    one = triangulate_by_phase(both, RIG)
    np.testing.assert_array_equal(
        one.xyz, triangulate_by_phase(map_of(RIG, TILTED, axes="x"), RIG).xyz
    )
    other = triangulate_by_phase(both, RIG, rules=CloudRules(axis="y"))
    np.testing.assert_array_equal(
        other.xyz, triangulate_by_phase(map_of(RIG, TILTED, axes="y"), RIG).xyz
    )
    y = replace(TEN, axis="y")
    assert triangulate_by_phase(with_fringes(both), RIG, extended=y).valid.any()


def test_voids_and_windows_are_told() -> None:
    coded = map_of(RIG, TILTED, axes="x")
    assert coded.column is not None
    coded.column.coordinate[5, 6] = np.nan
    cloud = triangulate_by_phase(coded, RIG, rules=CloudRules(z_range_mm=(640.0, 660.0)))
    assert cloud.reason is not None
    assert cloud.reason[5, 6] == Reason.NOT_DECODED
    assert (cloud.reason[~cloud.valid] > 0).all()
    depths = cloud.points()[:, 2]
    assert 640 < depths.min() < depths.max() < 660
    with pytest.raises(DecodeError, match="no pixel gives a point between z = 10 and 20 mm"):
        triangulate_by_phase(coded, RIG, rules=CloudRules(z_range_mm=(10, 20)))
    other = Rig(Camera(640, 480, CAMERA.lens), PROJECTOR, POSE)
    with pytest.raises(ShapeError, match="must be 640x480 like the rig's camera"):
        triangulate_by_phase(coded, other)
