"""A cloud against its truth, on clouds whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.experiments.truth import (
    EDGE_PX,
    find_bias,
    inner_pixels,
    predicted_form_mm,
    sigma_ratio,
)
from fringeworks.geometry.forms import fit_cylinder
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Cloud
from fringeworks.twin.truth import Truth

SHAPE = (60, 80)


def bent_sheet() -> NDArray[np.float64]:
    """``(H, W, 3)``: a patch of a cylinder of 52.5 mm about the y axis through (0, 0, 700)."""
    y, angle = np.meshgrid(np.linspace(-40, 40, 60), np.linspace(-1.0, 1.0, 80), indexing="ij")
    return np.stack([52.5 * np.sin(angle), y, 700 - 52.5 * np.cos(angle)], axis=-1)


def truth_of(xyz: NDArray[np.float64]) -> Truth:
    column = np.broadcast_to(np.arange(80.0), SHAPE).copy()
    surface = np.zeros(SHAPE, np.int16)
    return Truth(xyz, column, column, surface, ("sheet",))


def cloud_of(xyz: NDArray[np.float64], sigma_mm: float = 0.1) -> Cloud:
    flat = np.ones(SHAPE, np.float32)
    return Cloud(xyz.astype(np.float32), sigma_mm * flat, flat, np.full_like(flat, np.nan))


def test_a_rigid_motion_is_no_bias() -> None:
    """What is left is the rounding of float32: 3e-5 mm at 700 mm."""
    xyz = bent_sheet()
    turned = xyz @ rotation_matrix(np.array([0.01, -0.02, 0.01])).T + [1.0, -2.0, 0.5]
    bias = find_bias(cloud_of(turned), truth_of(xyz))
    assert bias.depth_p95_mm < 1e-4
    assert bias.normal_p95_mm < 1e-4


def test_a_ripple_of_the_depth_is_a_bias() -> None:
    """From row to row up and down by 0.05 mm: a tilt can take next to nothing of it."""
    xyz = bent_sheet()
    wrong = xyz.copy()
    wrong[..., 2] += 0.05 * (-1.0) ** np.arange(60)[:, None]
    bias = find_bias(cloud_of(wrong), truth_of(xyz))
    assert bias.depth_p95_mm == pytest.approx(0.05, rel=0.1)
    inner = inner_pixels(truth_of(xyz))
    assert np.array_equal(np.isfinite(bias.normal_mm), inner)
    assert bias.normal_p95_mm < bias.depth_p95_mm  # the sheet's sides look aside


def test_towards_the_camera_is_positive() -> None:
    xyz = bent_sheet()
    near = xyz.copy()
    near[20:40, 30:50, 2] -= 0.1
    bias = find_bias(cloud_of(near), truth_of(xyz))
    assert bias.normal_mm[30, 40] > 0.05


def test_edges_and_shadows_are_left_out() -> None:
    truth = truth_of(bent_sheet())
    truth.column[:, 40] = np.nan
    truth.surface[10, 20] = -1
    inner = inner_pixels(truth)
    assert not inner[:EDGE_PX].any()
    assert not inner[:, 40 - EDGE_PX : 41 + EDGE_PX].any()
    assert not inner[10 - EDGE_PX : 11 + EDGE_PX, 20].any()
    assert inner[30, 20]


def test_nothing_in_common_is_refused() -> None:
    xyz = bent_sheet()
    with pytest.raises(MeasurementError, match="fewer than 3 pixels in common"):
        find_bias(cloud_of(np.full_like(xyz, np.nan)), truth_of(xyz))


@pytest.mark.parametrize("observed", [0.05, 0.1, 0.2])
def test_sigma_ratio(observed: float) -> None:
    """Over 4000 pixels the ratio is known to 1 / sqrt(2 n) = 1.1 %; five of that are allowed."""
    xyz, rng = bent_sheet(), np.random.default_rng(3)
    noisy = xyz.copy()
    noisy[..., 2] += observed * rng.standard_normal(SHAPE)
    ratio = sigma_ratio(cloud_of(noisy), cloud_of(xyz), truth_of(xyz))
    assert ratio == pytest.approx(0.1 / observed, rel=0.056)


def test_predicted_form_is_that_of_noise_along_the_rays() -> None:
    xyz, rng = bent_sheet(), np.random.default_rng(4)
    noisy = xyz * (1 + 0.1 * rng.standard_normal(SHAPE) / xyz[..., 2])[..., None]
    cloud = cloud_of(noisy)
    found = fit_cylinder(cloud.points())
    assert found.form_rms_mm == pytest.approx(predicted_form_mm(cloud, found), rel=0.056)
