"""The residual field's fit and choice, on sites whose residuals are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import ImageSize, View, calibrate_rig
from fringeworks.calibrate.residual.choose import choose_field, choose_fields
from fringeworks.calibrate.residual.fit import Domain, fit_polynomial, fits_without
from fringeworks.calibrate.residual.left import Left, find_left
from fringeworks.errors import CalibrationError, UsageError
from fringeworks.model import Camera, Extended, Lens, Rig
from fringeworks.model.residual import count_terms
from tests.calibrate.synthetic import (
    BOARD,
    CAMERA,
    board_poses,
    dense_sites,
    rig_state,
    views_of,
)

Array = NDArray[np.float64]

DEVICE = Camera(752, 480, Lens.from_vector(CAMERA))
VIEWS, SITES, SIGMA_PX = 12, 200, 0.02


def sites_of(seed: int = 0, views: int = VIEWS) -> Left:
    """Noise alone, at places that spread like those of boards: depth differs from view to view."""
    rng = np.random.default_rng(seed)
    view = np.repeat(np.arange(views), SITES)
    u, v = rng.uniform(60, 690, len(view)), rng.uniform(40, 440, len(view))
    deep = rng.uniform(-60, 60, views)[view] + rng.uniform(-0.1, 0.1, views)[view] * (u - 376)
    places = np.column_stack([u, v, 80 + 0.6 * u + 0.02 * v + deep])
    noise = rng.normal(0, SIGMA_PX, len(view))
    return Left(places, noise, np.full(len(view), SIGMA_PX), view)


def warped(left: Left, size_px: float) -> Left:
    """With a smooth residual of third order, the same for all views."""
    u, v, coordinate = left.places.T
    a, b, c = (u - 376) / 376, (v - 240) / 240, (coordinate - 300) / 300
    return replace(left, residual=left.residual + size_px * (a**3 - 0.5 * a * b + b * c**2))


def test_a_known_polynomial_comes_back() -> None:
    """Sites without noise; what holds terms nobody sees is 1e-7 of what the sites say."""
    left = sites_of()
    domain = Domain.of(left, DEVICE)
    design = domain.design(left.places, 3)
    terms = np.random.default_rng(1).normal(0, 0.1, count_terms(3))
    found = fit_polynomial(replace(left, residual=design @ terms), design)
    np.testing.assert_allclose(found.coefficients, terms, atol=1e-5)


def test_wrong_codes_are_let_alone() -> None:
    """One site in fifty is off by a period; least squares would be off by 0.6 px and more."""
    left = warped(sites_of(), 0.5)
    domain = Domain.of(left, DEVICE)
    design = domain.design(left.places, 3)
    clean = design @ fit_polynomial(left, design).coefficients
    wild = left.residual.copy()
    wild[::50] += 32.0
    found = design @ fit_polynomial(replace(left, residual=wild), design).coefficients
    assert np.abs(found - clean).max() < SIGMA_PX


def test_without_a_view_is_as_if_it_had_not_been_there() -> None:
    """But for the weights, of which one view in twelve has a small part."""
    left = warped(sites_of(), 0.1)
    design = Domain.of(left, DEVICE).design(left.places, 2)
    without = fits_without(left, design, fit_polynomial(left, design))
    assert without.shape == (VIEWS, count_terms(2))
    kept = left.view != 3
    alone = fit_polynomial(left.only(kept), design[kept]).coefficients
    apart = design @ (without[3] - alone)
    assert np.sqrt(np.mean(apart**2)) < 0.1 * SIGMA_PX
    assert np.abs(without[3] - without[4]).max() > 0


def test_where_no_site_was_it_does_not_run_away() -> None:
    """Of the image's corners nobody tells; without the prior noise alone makes 0.3 px there."""
    left = sites_of()
    middle = np.abs(left.places[:, 0] - 376) + np.abs(left.places[:, 1] - 240) < 180
    left = left.only(middle)
    domain = Domain.of(left, DEVICE)
    found = fit_polynomial(left, domain.design(left.places, 4)).coefficients
    corners = np.array([[0.0, 0.0, 80.0], [751.0, 479.0, 540.0], [751.0, 0.0, 531.0]])
    assert np.abs(domain.design(corners, 4) @ found).max() < 5 * SIGMA_PX


def test_unseen_views_decline_noise() -> None:
    """Two standard errors and a tenth, of the simplest order: none of these draws pass."""
    for seed in range(5):
        choice = choose_field(sites_of(seed), DEVICE, belongs=("full", "x"))
        assert choice.field is None
        assert "no residual field" in choice.words


def test_unseen_views_accept_what_they_share() -> None:
    choice = choose_field(warped(sites_of(), 0.05), DEVICE, belongs=("full", "x"))
    assert choice.field is not None
    assert choice.field.order == 3
    assert (choice.field.model, choice.field.axis) == ("full", "x")
    assert choice.rms_px[1] < 0.6 * choice.rms_px[0]
    assert choice.field.low[:2] == (0.0, 0.0)
    assert choice.field.high[:2] == (751.0, 479.0)
    assert "of order 3" in choice.words


def test_what_each_view_has_of_its_own_is_no_field() -> None:
    """Boards that are each bent another way share nothing, however much they are off."""
    left = sites_of()
    rng = np.random.default_rng(2)
    bend = rng.normal(0, 0.1, (VIEWS, 2))[left.view]
    scaled = (left.places[:, :2] - (376, 240)) / (376, 240)
    bent = replace(left, residual=left.residual + np.sum(bend * (scaled**2 - 0.3), axis=1))
    assert choose_field(bent, DEVICE, belongs=("full", "x")).field is None


def test_few_views_are_refused() -> None:
    with pytest.raises(CalibrationError, match=r"at least 5 views .* got 4"):
        choose_field(sites_of(views=4), DEVICE, belongs=("full", "x"))


@pytest.fixture(scope="module")
def calibrated() -> Rig:
    """From ten views with sites, of a rig whose projector distorts."""
    rng = np.random.default_rng(6)
    state = rig_state(board_poses(10, rng=rng))
    sites = dense_sites(state, sigma=SIGMA_PX, rng=rng)
    views: list[View] = [
        replace(view, dense=part.only(np.arange(len(part)) % 4 == 0))
        for view, part in zip(views_of(state, sigma=0.02, rng=rng), sites, strict=True)
    ]
    return calibrate_rig(
        views, BOARD, camera_size=ImageSize(752, 480), projector_size=ImageSize(608, 684)
    )


def test_a_rig_within_the_model_has_a_field_of_the_pinhole_alone(calibrated: Rig) -> None:
    """What the full model leaves is noise; the pinhole leaves the projector's distortion."""
    full = find_left(calibrated, "full", "x")
    assert np.std(full.residual) == pytest.approx(SIGMA_PX, rel=0.1)
    chosen = choose_fields(calibrated)
    assert [(choice.model, choice.axis) for choice in chosen] == [
        ("full", "x"),
        ("full", "y"),
        ("geometric", "x"),
        ("geometric", "y"),
    ]
    assert [choice.field is None for choice in chosen] == [True, True, False, False]
    assert all(choice.rms_px[1] < 0.3 * choice.rms_px[0] for choice in chosen[2:])


def test_the_extended_model_backwards(calibrated: Rig) -> None:
    """With all ten at zero it is the geometric one; a phase off by 2 pi / P moves it by a pixel."""
    geometric = find_left(calibrated, "geometric", "x").residual
    zeros, moved = (
        find_left(replace(calibrated, extended=Extended("x", 32.0, Kphi=phase)), "extended", "x")
        for phase in (0.0, 2 * np.pi / 32)
    )
    np.testing.assert_allclose(zeros.residual, geometric, atol=1e-9)
    np.testing.assert_allclose(moved.residual, geometric + 1, atol=1e-9)
    rig = replace(calibrated, extended=Extended("x", 32.0))
    assert [choice.axis for choice in choose_fields(rig, ("extended",))] == ["x"]
    with pytest.raises(UsageError, match="no extended parameters along y"):
        find_left(rig, "extended", "y")


def test_a_rig_without_a_record_is_refused(calibrated: Rig) -> None:
    with pytest.raises(CalibrationError, match="keeps no record"):
        find_left(replace(calibrated, further={}), "full", "x")
    record = dict(calibrated.further["calibration"])
    record["views"] = [view | {"dense": None} for view in record["views"]]
    with pytest.raises(CalibrationError, match="no sites beside the corners"):
        find_left(replace(calibrated, further={"calibration": record}), "full", "x")
