from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate.boards.circles import ellipse_offsets
from fringeworks.calibrate.boards.corners import find_board
from fringeworks.calibrate.boards.saddle import FALLBACK_SIGMA_PX, MODEL_SIGMA_PX
from fringeworks.errors import CalibrationError
from fringeworks.geometry.lens import project
from fringeworks.model import CirclesTarget, PatternSet, Sequence, Uniform
from fringeworks.twin import scenes
from fringeworks.twin.simulate import simulate
from tests.calibrate.boards import board_view, circles_ink, photograph, seen

BOARD = CirclesTarget(5, 4, 10.0, 10.0, 6.0)
VIEW = board_view(BOARD, square_px=30.0, tilt=0.3)
TRUTH = seen(VIEW, BOARD.corners_mm())

Array = NDArray[np.float64]


@cache
def picture(blur_px: float = 0.6) -> Array:
    return photograph(VIEW, circles_ink(BOARD, BOARD.diameter_mm), blur_px=blur_px)


def errors(found: Array) -> Array:
    """Of a list that may be turned by half a turn."""
    return min(found - TRUTH, found[::-1] - TRUTH, key=lambda e: float(np.abs(e).sum()))


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_offsets_are_those_of_the_ellipse_through_the_seen_rim() -> None:
    """The rim is projected point by point and its image's centre found by a fit of a conic."""
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * BOARD.diameter_mm / 2
    centres = []
    for corner in BOARD.corners_mm()[:, :2]:
        points = seen(VIEW, rim + corner)
        shift = points.mean(axis=0)
        x, y = (points - shift).T
        a, b, c, d, e = np.linalg.lstsq(
            np.stack([x * x, x * y, y * y, x, y], axis=1), np.ones(40), rcond=None
        )[0]
        centres.append(np.linalg.solve([[2 * a, b], [b, 2 * c]], [-d, -e]) + shift)
    expected = np.array(centres) - TRUTH
    assert rms(expected) > 0.05  # px: they are there to be seen
    np.testing.assert_allclose(ellipse_offsets(np.array(centres), BOARD), expected, atol=2e-3)


@pytest.mark.parametrize("blur_px", [0.4, 1.5])
def test_centres_without_noise(blur_px: float) -> None:
    """Right to the picture's sampling; left where the ellipses' centres are they err by more."""
    found = find_board(picture(blur_px), BOARD)
    assert set(found.reasons) == {""}
    assert rms(errors(found.pixels)) < 4e-3


def test_sloping_light_and_depth() -> None:
    y, x = np.mgrid[: picture().shape[0], : picture().shape[1]]
    sloping = picture() * (1 + 0.004 * x - 0.002 * y) * 200
    assert rms(errors(find_board(sloping, BOARD).pixels)) < 6e-3


def test_predicted_sigma_is_the_sampled_one() -> None:
    """30 images of 20 circles: rms of 1200 errors right to 2 %, 5 sigma 10 %; the ring's noise
    stands for that of the circle."""
    rng = np.random.default_rng(1)
    sampled, variances = [], []
    for _ in range(30):
        found = find_board(picture() + rng.normal(0, 2.0, picture().shape), BOARD)
        sampled.append(errors(found.pixels))
        variances.append(found.sigma**2 - MODEL_SIGMA_PX**2)
    assert rms(np.array(sampled)) == pytest.approx(np.sqrt(np.mean(variances)), rel=0.15)


def test_a_circle_near_the_border_keeps_the_detectors_place() -> None:
    """Its window is cut: what light falls on the sheet beyond is not known."""
    last = int(TRUTH[:, 0].argmax())
    found = find_board(picture()[:, : int(TRUTH[last, 0]) + 12], BOARD)
    spoilt = [k for k, reason in enumerate(found.reasons) if reason]
    assert [found.reasons[k] for k in spoilt] == ["too few pixels about the circle"] * len(spoilt)
    assert np.abs(found.pixels[spoilt] - TRUTH[last]).sum(axis=1).min() < 1.0
    np.testing.assert_array_equal(found.sigma[spoilt], FALLBACK_SIGMA_PX)
    assert 1 <= len(spoilt) <= 2


def test_no_circles() -> None:
    flat = np.full((100, 120), 90.0)
    with pytest.raises(CalibrationError, match="no grid of 5 x 4 dark circles"):
        find_board(flat, BOARD)


def test_a_capture_of_the_twin() -> None:
    """White frame of the paper's rig, 8 bits and noise: centres as well as their sigma says.

    The offset of an ellipse's centre, 0.017 px rms in this pose, is no part of what is left: its
    share in 176 errors of 0.01 px is known to 0.01 / (0.017 sqrt(176)) = 0.05.
    """
    pose = 1
    rig, scene = scenes.paper_rig(), scenes.board_scene().views()[pose]
    (thing,) = scene.objects
    printed = replace(scenes.BOARD, kind="circles", diameter_mm=6.5)
    shown = replace(scene, objects=(replace(thing, shape=printed),))
    white = Sequence(rig.projector.width, rig.projector.height, (PatternSet(Uniform(1.0)),))
    image = simulate(shown, rig, white, rng=np.random.default_rng(pose)).capture.white()
    assert image is not None
    target = scenes.target_of(printed)
    assert isinstance(target, CirclesTarget)
    found = find_board(image, target)
    centres = thing.camera_from_object.apply(target.corners_mm())
    true = project(centres, rig.camera.lens.vector)
    left = min(found.pixels - true, found.pixels - true[::-1], key=rms)
    offsets = ellipse_offsets(found.pixels, target)
    assert set(found.reasons) == {""}
    assert rms(left) < 1.4 * rms(found.sigma)
    assert rms(offsets) > 0.015
    assert abs(np.sum(left * offsets) / np.sum(offsets**2)) < 0.25
