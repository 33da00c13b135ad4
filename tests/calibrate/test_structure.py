"""Structure in what a calibration leaves, on views whose faults are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import CalibrationSettings, View
from fringeworks.calibrate.adjust.bundle import refine
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.judge.structure import (
    CELLS_IN_VIEW,
    Structure,
    _excess,
    find_structure,
)
from fringeworks.errors import CalibrationError
from tests.calibrate.synthetic import board_poses, dense_sites, rig_state, views_of

Array = NDArray[np.float64]

VIEWS = 8
SITE_SIGMA_PX = 0.02
ONE_SD = np.sqrt(2 / (2 * CELLS_IN_VIEW**2 * VIEWS))
"""Of a mean of squares of so many normal numbers: two coordinates in each cell of each view."""


def seen(bow: tuple[float, float] = (0.0, 0.0)) -> tuple[RigState, list[View]]:
    """Eight views with dense sites and noise, of a board bowed by so many mm."""
    rng = np.random.default_rng(5)
    state = replace(rig_state(board_poses(VIEWS, rng=rng)), board_shape=np.array(bow))
    sites = dense_sites(state, sigma=SITE_SIGMA_PX, rng=rng)
    views = views_of(state, sigma=0.01, site_sigma=SITE_SIGMA_PX, rng=rng)
    return state, [replace(view, dense=part) for view, part in zip(views, sites, strict=True)]


def moved(view: View, columns: Array) -> View:
    """The same with so many px added to each site's column."""
    sites = view.sites
    shown = sites.projector_px + np.column_stack([columns, np.zeros(len(sites))])
    return replace(view, dense=replace(sites, projector_px=shown))


def test_noise_has_none() -> None:
    found = find_structure(*seen())
    assert found.in_views == pytest.approx(1.0, abs=5 * ONE_SD)
    for ratio in (found.on_board, found.in_camera, found.in_projector):
        assert ratio == pytest.approx(1.0, abs=5 * np.sqrt(2 / 128))  # 8 x 8 cells, two axes
    assert found.finding is None


def test_a_refined_solution_leaves_none() -> None:
    """It takes some of the noise away: 16 numbers shared by all, and six for each view."""
    state, views = seen()
    found = find_structure(refine(state, views, CalibrationSettings()).state, views)
    taken = (22 + 6 * VIEWS) / (2 * CELLS_IN_VIEW**2 * VIEWS)
    assert 1 - taken - 5 * ONE_SD < found.in_views < 1 + 5 * ONE_SD


def test_a_bowed_board_is_named() -> None:
    state, views = seen(bow=(0.2, 0.1))
    flat = replace(state, board_shape=np.zeros(2))
    found = find_structure(refine(flat, views, CalibrationSettings()).state, views)
    assert found.in_views > 2
    assert found.on_board > 2 * max(found.in_camera, found.in_projector)
    assert found.finding is not None
    assert "same places of the board" in str(found.finding)
    assert "--board-shape paraboloid" in found.finding.remedy


def test_its_shape_solved_for_leaves_none() -> None:
    state, views = seen(bow=(0.2, 0.1))
    settings = CalibrationSettings(board_shape="paraboloid")
    found = find_structure(refine(state, views, settings).state, views)
    assert found.in_views < 1 + 5 * ONE_SD
    assert found.finding is None


def test_a_wave_that_stays_in_the_projector_is_none_of_the_boards() -> None:
    """Six waves of a site's sigma over the columns: no lens of five terms has them."""
    state, views = seen()
    spoilt = [moved(v, 0.02 * np.sin(v.sites.projector_px[:, 0] / 15)) for v in views]
    found = find_structure(refine(state, spoilt, CalibrationSettings()).state, spoilt)
    assert found.in_projector > 2 * found.on_board
    told = replace(found, in_views=2.0).finding
    assert told is not None
    assert "no fixed places of the board" in str(told)


def test_what_views_have_each_for_itself_is_seen() -> None:
    """Half of the board shifted, one way in every other view: over all views it cancels."""
    state, views = seen()
    signs = np.where(np.arange(VIEWS) % 2, 0.01, -0.01)
    spoilt = [
        moved(view, sign * np.sign(view.sites.camera_px[:, 1] - 240.0))
        for view, sign in zip(views, signs, strict=True)
    ]
    found = find_structure(state, spoilt)
    assert found.in_views > 2.5
    assert found.on_board < 0.7 * found.in_views


def test_each_cell_is_weighed_by_its_own_count() -> None:
    """Sums of 5 and 20 ones, squared, over 5 and 20: 5 and 20; four are too few."""
    cell = np.repeat([0, 2, 3], [5, 20, 4])
    assert _excess(np.ones((29, 2)), cell) == pytest.approx(12.5)


def test_one_in_few_wrong_codes_is_no_structure() -> None:
    """A fringe off in a corner of one view: clipped, it speaks for its cell alone."""
    state, views = seen()
    far = views[0].sites
    shown = far.projector_px.copy()
    shown[:10] += 32.0
    found = find_structure(
        state, [replace(views[0], dense=replace(far, projector_px=shown)), *views[1:]]
    )
    assert found.finding is None


def test_too_few_sites() -> None:
    state, views = seen()
    few = np.arange(len(views[0].sites)) % 300 == 0
    thin = replace(views[0], dense=views[0].sites.only(few))
    alone = replace(state, camera_from_board=state.camera_from_board[:1])
    with pytest.raises(CalibrationError, match="no cell has five"):
        find_structure(alone, [thin])


def test_only_what_is_large_is_told() -> None:
    assert Structure(1.5, 9.0, 1.0, 1.0).finding is None
    assert Structure(1.7, 9.0, 1.0, 1.0).finding is not None
