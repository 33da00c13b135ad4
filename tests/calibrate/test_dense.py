from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate.dense import bright_parts, find_sites
from fringeworks.calibrate.sites import Sites, together
from fringeworks.model import ProjectorMap
from tests.calibrate.synthetic import (
    read_maps,
    reference,
    rig_state,
    true_corners,
    true_projector_map,
)
from tests.scenes import coded_axis

Array = NDArray[np.float64]
POSE, PICTURE = reference()
SIGMA = 0.08
SQUARE_PX = 30.0
CORNERS = true_corners(POSE)
STATE = rig_state(POSE[None])


def find(pixels: Array, lit: NDArray[np.generic] = PICTURE) -> Sites | None:
    light = lit.astype(np.float32)
    column = replace(coded_axis("x", pixels[..., 0], SIGMA), modulation=light)
    row = replace(coded_axis("y", pixels[..., 1], SIGMA), modulation=light)
    corners = CORNERS, read_maps(STATE, 0, CORNERS)
    return find_sites(ProjectorMap(column, row), corners, SQUARE_PX)


def noisy() -> Array:
    clean = true_projector_map(POSE)
    return clean + np.random.default_rng(4).normal(0, SIGMA, clean.shape)


def scores(sites: Sites) -> Array:
    """Errors over the standard deviations that the sites say, ``(m, 2)``."""
    return (sites.projector_px - read_maps(STATE, 0, sites.camera_px)) / sites.sigma_px


def test_bright_parts_are_white_squares_without_their_edges() -> None:
    bright = bright_parts(PICTURE.astype(np.float32), CORNERS, SQUARE_PX)
    assert PICTURE[bright].min() > 150
    # half of the 10 x 7 inner squares, some 30 px wide, less 3 px all round, and a rim
    assert 35 * 20**2 < bright.sum() < 70 * 35**2
    near = [np.abs(np.argwhere(bright)[:, ::-1] - corner).max(axis=1).min() for corner in CORNERS]
    assert min(near) >= 3


def test_sites_are_right_and_know_how_well() -> None:
    sites = find(noisy())
    assert sites is not None
    assert len(sites) > 200
    # tiles of 10 px, from 30 pixels to 100
    assert SIGMA / 10.5 < np.median(sites.sigma_px) < SIGMA / 5.4
    # 400 scores and more: their rms is known to 4 %; five of that
    assert np.sqrt(np.mean(scores(sites) ** 2)) == pytest.approx(1.0, abs=0.2)
    assert np.abs(scores(sites)).max() < 5


def test_wrong_codes_and_void_pixels_do_not_pull() -> None:
    rng = np.random.default_rng(8)
    spoilt, wrong = noisy(), rng.random((480, 752))
    spoilt[wrong < 0.1] = rng.uniform(0, 600, (int((wrong < 0.1).sum()), 2))
    spoilt[wrong > 0.8] = np.nan
    sites = find(spoilt)
    assert sites is not None
    assert np.sqrt(np.mean(scores(sites) ** 2)) == pytest.approx(1.0, abs=0.25)


def test_a_gray_code_alone_gives_sites_too() -> None:
    sites = find(np.rint(true_projector_map(POSE)))
    assert sites is not None
    error = sites.projector_px - read_maps(STATE, 0, sites.camera_px)
    # a cell scatters by 0.29 px. Tiles see five columns; of the rows there is nearly one per
    # pixel, so that rounding errs alike over thirty pixels and no mean takes it out
    across, down = np.sqrt(np.mean(error**2, axis=0))
    assert across < 0.29 / np.sqrt(5) / 2
    assert down < 0.29


def test_too_little_light_is_no_site() -> None:
    assert find(np.full_like(noisy(), np.nan)) is None


def test_errors_that_neighbours_share_are_seen() -> None:
    rng = np.random.default_rng(3)
    places = rng.uniform(0, 400, (3200, 2))
    alone = rng.normal(0, 1, places.shape)
    # 16 cells and two axes: the variance of as many means is known to 25 %; four of that
    assert together(alone, places) == pytest.approx(1.0, abs=1.0)
    wave = np.sin(places / 60)
    # of 200 sites that share a cell the mean is as far off as each
    assert together(wave, places) > 50
