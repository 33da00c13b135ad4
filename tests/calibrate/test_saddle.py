"""The fit of a corner's image, on images that its model did not make."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate.boards.found import grid_steps
from fringeworks.calibrate.boards.saddle import (
    FALLBACK_SIGMA_PX,
    LARGEST_REACH_PX,
    MODEL_SIGMA_PX,
    refine_saddles,
)
from fringeworks.model import CheckerboardTarget
from tests.calibrate.boards import board_view, photograph, seen, squares_ink

BOARD = CheckerboardTarget(5, 4, 10.0, 10.0)
VIEW = board_view(BOARD, square_px=26.0, tilt=0.3)
TRUTH = seen(VIEW, BOARD.corners_mm())
STEPS = grid_steps(TRUTH, BOARD)
START = TRUTH + np.random.default_rng(5).uniform(-1.0, 1.0, TRUTH.shape)

Array = NDArray[np.float64]


@cache
def picture(blur_px: float) -> Array:
    return photograph(VIEW, squares_ink(BOARD), blur_px=blur_px)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize(("blur_px", "bar"), [(0.25, 2e-3), (0.6, 1e-3), (1.5, 4e-3)])
def test_without_noise(blur_px: float, bar: float) -> None:
    """What is left is the picture's sampling, and where the blur is wide that the edges, 15 px
    long and not at right angles, melt at the corner in a way the product of two does not say."""
    fit = refine_saddles(picture(blur_px), START, STEPS)
    assert set(fit.reasons) == {""}
    assert rms(fit.pixels - TRUTH) < bar
    plain = START.astype(np.float32).reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    cv2.cornerSubPix(picture(blur_px).astype(np.float32), plain, (6, 6), (-1, -1), stop)
    assert rms(fit.pixels - TRUTH) < rms(plain.reshape(-1, 2) - TRUTH) / 3


def test_sharp_edges_almost_along_the_pixels() -> None:
    """There an edge's look depends on where in its pixel it lies; 0.02 px if that is not minded."""
    view = board_view(BOARD, square_px=26.0, turn=0.01)
    truth = seen(view, BOARD.corners_mm())
    sharp = photograph(view, squares_ink(BOARD), blur_px=0.25)
    fit = refine_saddles(sharp, truth + 0.3, grid_steps(truth, BOARD))
    assert rms(fit.pixels - truth) < 4e-3


def test_grey_levels_may_have_any_unit() -> None:
    fit = refine_saddles(picture(0.6), START, STEPS)
    deep = refine_saddles(picture(0.6) * 257 + 0.0, START, STEPS)
    np.testing.assert_allclose(deep.pixels, fit.pixels, atol=1e-9)
    np.testing.assert_allclose(deep.sigma, fit.sigma, rtol=1e-6)


def test_the_same_image_gives_the_same_bits() -> None:
    first = refine_saddles(picture(0.6), START, STEPS)
    second = refine_saddles(picture(0.6), START, STEPS)
    np.testing.assert_array_equal(first.pixels, second.pixels)


@pytest.mark.parametrize("blur_px", [0.25, 0.6, 1.5])
def test_predicted_sigma_is_the_sampled_one(blur_px: float) -> None:
    """40 images of 20 corners: the rms of 1600 errors is right to 1.8 %; 6 sigma is 11 %."""
    rng = np.random.default_rng(3)
    errors, variances = [], []
    for _ in range(40):
        noisy = picture(blur_px) + rng.normal(0, 2.0, picture(blur_px).shape)
        fit = refine_saddles(noisy, START, STEPS)
        errors.append(fit.pixels - TRUTH)
        variances.append(fit.sigma**2 - MODEL_SIGMA_PX**2)
    assert rms(np.array(errors)) == pytest.approx(np.sqrt(np.mean(variances)), rel=0.11)


def test_shot_noise_is_seen_pixel_by_pixel() -> None:
    """Noise on the white squares only: still the sampled sigma, where a common one errs."""
    rng = np.random.default_rng(4)
    clean, errors, variances = picture(0.6), [], []
    for _ in range(40):
        noisy = clean + rng.normal(0, 4.0, clean.shape) * (clean > 130)
        fit = refine_saddles(noisy, START, STEPS)
        errors.append(fit.pixels - TRUTH)
        variances.append(fit.sigma**2 - MODEL_SIGMA_PX**2)
    assert rms(np.array(errors)) == pytest.approx(np.sqrt(np.mean(variances)), rel=0.15)


def test_sloping_light() -> None:
    y, x = np.mgrid[: picture(0.6).shape[0], : picture(0.6).shape[1]]
    sloping = picture(0.6) * (0.6 + 0.004 * x - 0.002 * y)
    assert rms(refine_saddles(sloping, START, STEPS).pixels - TRUTH) < 1e-3


def test_white_cut_off_at_full_scale() -> None:
    cut = np.minimum(picture(0.6), 110.0)
    assert rms(refine_saddles(cut, START, STEPS).pixels - TRUTH) < 0.01


def test_void_pixels_are_left_out() -> None:
    holes = picture(0.6).copy()
    holes[np.random.default_rng(0).random(holes.shape) < 0.15] = np.nan
    fit = refine_saddles(holes, START, STEPS)
    assert set(fit.reasons) == {""}
    assert rms(fit.pixels - TRUTH) < 2e-3


def test_print_inside_the_squares_is_out_of_reach() -> None:
    """A marker's worth of black in each white square; without `arm` it is in the window."""
    marked = photograph(
        VIEW,
        lambda x, y: np.maximum(
            squares_ink(BOARD)(x, y),
            1.0 * (np.maximum(np.abs(x % 10 - 5), np.abs(y % 10 - 5)) < 2.5),
        ),
        blur_px=0.6,
    )
    assert rms(refine_saddles(marked, START, STEPS, arm=0.12).pixels - TRUTH) < 3e-3
    assert rms(refine_saddles(marked, START, STEPS).pixels - TRUTH) > 0.01


@pytest.mark.parametrize(
    ("level", "reason"),
    [(np.nan, "too few pixels"), (80.0, "no contrast"), (np.inf, "too few pixels")],
)
def test_a_corner_that_cannot_be_fitted_keeps_its_place(level: float, reason: str) -> None:
    spoilt = picture(0.6).copy()
    x, y = TRUTH[7].astype(int)
    spoilt[y - 14 : y + 15, x - 14 : x + 15] = level
    fit = refine_saddles(spoilt, START, STEPS)
    assert reason in fit.reasons[7]
    np.testing.assert_array_equal(fit.pixels[7], START[7])
    np.testing.assert_array_equal(fit.sigma[7], FALLBACK_SIGMA_PX)
    assert [bool(reason) for reason in fit.reasons].count(True) < BOARD.corner_count


def test_noise_that_drowns_the_corners() -> None:
    """Half the contrast is 50 levels, less than twice the noise."""
    noisy = picture(0.6) + np.random.default_rng(2).normal(0, 35.0, picture(0.6).shape)
    fit = refine_saddles(noisy, START, STEPS)
    assert fit.reasons.count("no contrast about the corner") > BOARD.corner_count / 2
    assert all(fit.reasons)


def test_noise_has_no_corners() -> None:
    noise = np.random.default_rng(8).normal(100, 20, picture(0.6).shape)
    fit = refine_saddles(noise, START, STEPS)
    assert all(fit.reasons)
    np.testing.assert_array_equal(fit.pixels, START)


def test_corners_outside_the_image() -> None:
    fit = refine_saddles(picture(0.6), START + 5000.0, STEPS)
    assert set(fit.reasons) == {"too few pixels about the corner"}


def test_edges_along_the_pixels_without_blur() -> None:
    """Nothing says how blurred they are: the fit must not stumble over that."""
    level = np.where((np.arange(60) < 30)[:, None] ^ (np.arange(60) < 30), 20.0, 200.0)
    fit = refine_saddles(level, np.array([[29.1, 30.2]]), 20.0 * np.eye(2)[None])
    assert fit.reasons == ("",)
    np.testing.assert_allclose(fit.pixels, 29.5, atol=0.02)


def test_large_squares_take_no_larger_window() -> None:
    """A stain beyond the reach changes nothing."""
    large = cv2.resize(picture(1.5), None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC)
    at = (TRUTH[:1] + 0.5) * 4 - 0.5
    first = refine_saddles(np.asarray(large), at, STEPS[:1] * 4)
    stained = np.asarray(large).copy()
    x, y = (at[0] + STEPS[0, 0] * 4 * 0.35).astype(int)  # on an edge
    assert np.hypot(x - at[0, 0], y - at[0, 1]) > 1.6 * LARGEST_REACH_PX
    stained[y - 4 : y + 5, x - 4 : x + 5] = 0
    second = refine_saddles(stained, at, STEPS[:1] * 4)
    np.testing.assert_array_equal(first.pixels, second.pixels)
