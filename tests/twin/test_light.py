"""Projector light against hand-drawn pixels, closed-form edges and brute force."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fringeworks.errors import ShapeError, UsageError
from fringeworks.model import Axis, Frames
from fringeworks.twin.blur import blur, discrete_gaussian
from fringeworks.twin.effects import Lattice, ProjectorEffects
from fringeworks.twin.lattice import interpolate
from fringeworks.twin.light import Lamp, LightTable, blur_sigma_px, choose_sigmas, respond

Array = NDArray[np.float64]

WIDTH, HEIGHT = 64, 48
RATIO = 2.0
"""Rows per column of the same angle, as of a DLP3000."""

LINEAR = ProjectorEffects(bits=16, black_light=0.0)
WHITE = 65535


def make_lamp(
    lattice: Lattice = "square", sigmas: tuple[float, ...] = (0.0,), ratio: float = RATIO
) -> Lamp:
    return Lamp(replace(LINEAR, lattice=lattice), WIDTH, HEIGHT, ratio, np.array(sigmas))


def read(table: LightTable, u: Array | float, v: Array | float, level: float = 0.0) -> Array:
    """Light of a table at places, as a camera of one ray per pixel would gather it."""
    u, v = np.broadcast_arrays(np.atleast_1d(u).astype(float), np.atleast_1d(v).astype(float))
    samples = np.stack([u, v, np.full(u.shape, level), np.ones(u.shape)], axis=-1)
    light: Array = table.gather(samples[None].astype(np.float32))[0].astype(np.float64)
    return light


def strip(profile: Array, axis: Axis) -> Frames:
    """A 16-bit image whose light 0 .. 1 varies along one axis."""
    line = profile[None] if axis == "x" else profile[:, None]
    levels: Frames = np.round(np.broadcast_to(line, (HEIGHT, WIDTH)) * WHITE).astype(np.uint16)
    return levels


def random_image(seed: int = 0) -> Frames:
    image: Frames = np.random.default_rng(seed).integers(0, WHITE, (HEIGHT, WIDTH), np.uint16)
    return image


def extent(axis: Axis) -> int:
    return WIDTH if axis == "x" else HEIGHT


def places(axis: Axis, along: Array) -> tuple[Array, Array]:
    """u, v of places along an axis, in the image's middle across."""
    other = np.full_like(along, 20.3)
    return (along, other) if axis == "x" else (other, along)


# Light through pixel centres


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("period", [16.0, 32.0])
def test_sinusoids_without_a_lattice_keep_their_phase(axis: Axis, period: float) -> None:
    pixels, shifts = np.arange(extent(axis)), 2 * np.pi * np.arange(8) / 8
    phase = 2 * np.pi * (pixels + 0.5) / period
    along = np.random.default_rng(1).uniform(-0.5, extent(axis) - 0.5, 4000)
    lamp = make_lamp("none")
    frames = [
        read(lamp.show(strip(0.5 + 0.5 * np.cos(phase - shift), axis)), *places(axis, along))
        for shift in shifts
    ]
    found = np.arctan2(np.sin(shifts) @ frames, np.cos(shifts) @ frames)
    off = np.angle(np.exp(1j * (found - 2 * np.pi * (along + 0.5) / period)))
    error_px = off * period / (2 * np.pi)
    inside = (along > 0) & (along < extent(axis) - 1)
    # Rounding to 16 bits: 0.29 levels sqrt(2 / 8) over B = 32768 is 4.5e-6 rad, 2.3e-5 px of 32,
    # and reading in single precision 1e-7 of light; 5 sigma.
    assert np.abs(error_px[inside]).max() < 1.5e-4
    # Beyond the last centre Lagrange's remainder (2 pi / 16)^8 0.2 joins it: 2.8e-4 px of 16.
    assert np.abs(error_px[~inside]).max() < 6e-4


def test_steps_without_a_lattice_are_ramps() -> None:
    step = (np.arange(WIDTH) >= 30).astype(float)
    table = make_lamp("none").show(strip(step, "x"))
    assert read(table, 29.5, 7.0) == pytest.approx(0.5, abs=1e-6)
    light = read(table, np.linspace(0, WIDTH - 1, 800), 7.0)
    assert light.min() >= 0
    assert light.max() <= 1


def test_interpolation_is_exact_for_polynomials() -> None:
    x = np.arange(12.0)
    places = (np.arange(14 * 4) + 0.5) / 4 - 1.5
    inside = (places > -0.625) & (places < 11.625)
    cubic = 0.5 + 0.01 * x - 0.002 * x**2 + 1e-4 * x**3
    expected = 0.5 + 0.01 * places - 0.002 * places**2 + 1e-4 * places**3
    np.testing.assert_allclose(interpolate(cubic, 4, 1)[inside], expected[inside], atol=1e-13)


# Pixels


@pytest.mark.parametrize("axis", ["x", "y"])
def test_square_pixels_are_flat_and_lie_side_by_side(axis: Axis) -> None:
    profile = np.random.default_rng(2).random(extent(axis))
    table = make_lamp().show(strip(profile, axis))
    # Away from borders by half a sample, 1/16 px.
    for offset in (-0.43, 0.0, 0.2, 0.43):
        along = np.arange(float(extent(axis))) + offset
        np.testing.assert_allclose(read(table, *places(axis, along)), profile, atol=2e-5)


def test_diamond_columns_by_hand() -> None:
    # One column of diamonds: at v = 0 it is the box |u - 30| < 1/2, a row lower the box about
    # 30.5, and between the rows both are half as wide.
    lit = (np.arange(WIDTH) == 30).astype(float)
    table = make_lamp("diamond").show(strip(lit, "x"))
    u = np.array([29.4, 29.6, 30.4, 30.6, 30.9, 31.1])
    # At the row's middle, 1/16 row from the nearest sample, the other column has 1/16 of the light.
    np.testing.assert_allclose(read(table, u, 20.0), [0, 1, 1, 0, 0, 0], atol=0.07)
    np.testing.assert_allclose(read(table, u, 21.0), [0, 0, 1, 1, 1, 0], atol=0.07)
    u = np.array([29.6, 29.9, 30.1, 30.4, 30.6, 30.9])
    np.testing.assert_allclose(read(table, u, 20.5), [0, 1, 1, 1, 1, 0], atol=0.07)


def test_diamond_rows_by_hand() -> None:
    # Row 20 alone: tips at u = c reach from v = 19 to 21; between its pixels nothing is lit.
    lit = (np.arange(HEIGHT) == 20).astype(float)
    table = make_lamp("diamond").show(strip(lit, "y"))
    v = np.array([18.8, 19.4, 20.0, 20.6, 21.2])
    np.testing.assert_allclose(read(table, 30.0, v), [0, 1, 1, 1, 0], atol=0.07)
    np.testing.assert_allclose(read(table, 30.5, v[[0, 1, 3, 4]]), 0, atol=0.07)
    odd = make_lamp("diamond").show(strip((np.arange(HEIGHT) == 21).astype(float), "y"))
    np.testing.assert_allclose(read(odd, 30.5, v + 1), [0, 1, 1, 1, 0], atol=0.07)


def covering_pixel(u: Array, v: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Column and row of the diamond over each place, by trying all those near it."""
    best, column, row = np.full(u.shape, np.inf), np.zeros(u.shape, int), np.zeros(u.shape, int)
    for down in range(-2, 3):
        r = np.round(v).astype(int) + down
        for across in range(-2, 3):
            c = np.round(u).astype(int) + across
            away = np.abs(u - c - (r % 2) / 2) / 0.5 + np.abs(v - r)
            closer = away < best
            best[closer], column[closer], row[closer] = away[closer], c[closer], r[closer]
    assert best.max() <= 1 + 1e-12  # the diamonds tile the plane
    return column, row


def brute_force(image: Frames, lattice: Lattice, sigma: float) -> tuple[Array, int]:
    """Light of an image on a raster of 16 samples per px with a Gaussian, margin 4 px."""
    per_px, margin = 16, 4
    u = (np.arange((WIDTH + 2 * margin) * per_px) + 0.5) / per_px - 0.5 - margin
    v = (np.arange((HEIGHT + 2 * margin) * per_px) + 0.5) / per_px - 0.5 - margin
    u, v = (axis.astype(float) for axis in np.meshgrid(u, v))
    if lattice == "diamond":
        column, row = covering_pixel(u, v)
    else:
        column, row = np.round(u).astype(int), np.round(v).astype(int)
    inside = (column >= 0) & (column < WIDTH) & (row >= 0) & (row < HEIGHT)
    light = np.where(inside, image[row.clip(0, HEIGHT - 1), column.clip(0, WIDTH - 1)] / WHITE, 0)
    return gaussian_filter(light, (sigma * RATIO * per_px, sigma * per_px), mode="nearest"), per_px


@pytest.mark.parametrize("lattice", ["square", "diamond"])
@pytest.mark.parametrize("kind", ["x", "y", "image"])
def test_light_equals_brute_force(lattice: Lattice, kind: str) -> None:
    rng = np.random.default_rng(5)
    image = random_image()
    if kind != "image":
        axis: Axis = "x" if kind == "x" else "y"
        image = strip(rng.random(extent(axis)), axis)
    expected, per_px = brute_force(image, lattice, 0.5)
    rows, columns = rng.integers(8 * per_px, 40 * per_px, (2, 3000))
    u, v = ((index + 0.5) / per_px - 0.5 - 4 for index in (columns, rows))
    found = read(make_lamp(lattice, (0.5,)).show(image), u, v)
    off = found - expected[rows, columns]
    # Straight lines between samples: h^2 / 8 times second derivatives, about 1 / sigma^2 times the
    # rms of 0.15 that blurred noise has: 1e-3 for strips (h = 1/8), 5e-3 for rasters (h = 1/4),
    # where diamonds are besides taken from eight points each.
    assert off.std() < (1e-3 if kind != "image" else 5e-3)
    assert abs(off.mean()) < 1e-3


@pytest.mark.parametrize("lattice", ["square", "diamond", "none"])
def test_white_is_even_and_dark_outside(lattice: Lattice) -> None:
    lamp = make_lamp(lattice, (0.3, 0.4))
    table = lamp.show(strip(np.ones(WIDTH), "x"))
    rng = np.random.default_rng(3)
    u, v = rng.uniform(4, WIDTH - 5, 500), rng.uniform(4, HEIGHT - 5, 500)
    np.testing.assert_allclose(read(table, u, v, level=0.5), 1.0, atol=1e-5)
    if lattice != "none":  # that one is cut by whoever receives it
        outside = read(table, np.array([-3.0, WIDTH + 2.0, 30, 30]), np.array([9, 9, -5, 53.0]))
        np.testing.assert_allclose(outside, 0.0, atol=1e-6)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_light_falls_to_half_at_the_images_edges(axis: Axis) -> None:
    table = make_lamp("square", (0.5,)).show(strip(np.ones(WIDTH), "x"))
    edges = np.array([-0.5, extent(axis) - 0.5])
    np.testing.assert_allclose(read(table, *places(axis, edges)), 0.5, atol=1e-5)


def test_diamond_rows_end_a_quarter_to_the_right() -> None:
    # Even rows end at -1/2 and W - 1/2, odd ones half a column further right.
    table = make_lamp("diamond", (0.5,)).show(strip((np.arange(HEIGHT) > 3).astype(float), "y"))
    rows = 10 + np.arange(32) / 16
    light = [read(table, edge, rows).mean() for edge in (-0.25, WIDTH - 0.25)]
    np.testing.assert_allclose(light, 0.5, atol=1e-3)


# Blur


def moments(x: Array, values: Array) -> tuple[float, float]:
    """Mean and variance of a rising edge's slope."""
    slope, middle = np.diff(values), (x[1:] + x[:-1]) / 2
    mean = float((slope * middle).sum() / slope.sum())
    return mean, float((slope * (middle - mean) ** 2).sum() / slope.sum())


ZIGZAG: dict[Axis, tuple[float, float]] = {"x": (0.25, 1 / 48), "y": (0.0, 1 / 12)}
"""Mean and variance, px, of an edge of diamonds: a column's runs evenly between 0 and 1/2 px to
the right of a square's, a row's between half a row above and below it."""


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("lattice", ["square", "diamond"])
@pytest.mark.parametrize("sigma", [0.25, 0.4, 1.0])
def test_blur_of_a_step_has_the_sigma_asked_for(axis: Axis, lattice: Lattice, sigma: float) -> None:
    edge = extent(axis) // 2 - 0.5
    image = strip((np.arange(extent(axis)) > edge).astype(float), axis)
    along = np.linspace(edge - 14, edge + 14, 28 * 64 + 1)
    table = make_lamp(lattice, (sigma,)).show(image)
    # The mean over a period of the lattice across.
    found = np.zeros_like(along)
    for beside in np.arange(16) / 8 + 20:
        other = np.full_like(along, beside)
        u, v = (along, other) if axis == "x" else (other, along)
        found += read(table, u, v) / 16
    mean, variance = moments(along, found)
    wanted = sigma if axis == "x" else sigma * RATIO
    shift, extra = ZIGZAG[axis] if lattice == "diamond" else (0.0, 0.0)
    assert mean == pytest.approx(edge + shift, abs=2e-3)
    # Reading on straight lines between samples adds up to half a percent of the least sigma.
    assert math.sqrt(variance - extra) == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_blur_of_a_raster_has_the_sigma_asked_for(axis: Axis) -> None:
    edge = extent(axis) // 2 - 0.5
    image = strip((np.arange(extent(axis)) > edge).astype(float), axis)
    image[0, 0] = image[0, -1] = image[-1, 0] = 1234  # makes it no strip
    along = np.linspace(edge - 14, edge + 14, 28 * 64 + 1)
    table = make_lamp("square", (0.4,)).show(image)
    assert not table.wraps
    mean, variance = moments(along, read(table, *places(axis, along)))
    assert mean == pytest.approx(edge, abs=1e-4)
    assert math.sqrt(variance) == pytest.approx(0.4 if axis == "x" else 0.4 * RATIO, rel=2e-3)


def test_light_between_two_widths() -> None:
    # Linear in the variance: halfway between 0.6 and 0.75 in variance an edge has that variance.
    edge = 31.5
    along = np.linspace(edge - 8, edge + 8, 1025)
    table = make_lamp("square", (0.6, 0.75)).show(strip((np.arange(64) > 31).astype(float), "x"))
    _, variance = moments(along, read(table, along, 20.0, level=0.5))
    assert variance == pytest.approx((0.6**2 + 0.75**2) / 2, rel=5e-3)
    profile = read(table, along, 20.0, level=0.5)
    exact = 0.5 * (1 + np.vectorize(math.erf)((along - edge) / math.sqrt(2 * variance)))
    assert np.abs(profile - exact).max() < 4.5e-3  # LEVEL_RATIO's figure, and the reading's


@given(st.floats(0.0, 40.0))
def test_discrete_gaussian_has_its_variance(variance: float) -> None:
    weights = discrete_gaussian(variance)
    n = np.arange(len(weights)) - len(weights) // 2
    assert weights.sum() == pytest.approx(1, abs=1e-12)
    # Cut off at six sigmas.
    assert weights @ n**2 == pytest.approx(variance, rel=1e-6, abs=1e-12)


def test_blur_keeps_light_and_variance() -> None:
    image = np.zeros((61, 61), np.float32)
    image[30, 30] = 1
    spread = blur(image, across=2.0, down=0.5)
    n = np.arange(61) - 30
    assert spread.sum() == pytest.approx(1, abs=1e-6)
    assert spread.sum(axis=0) @ n**2 == pytest.approx(2.0, rel=1e-5)
    assert spread.sum(axis=1) @ n**2 == pytest.approx(0.5, rel=1e-5)


def test_defocus_by_hand() -> None:
    # 3.2 px m (1 / 0.5 m - 1 / 0.64 m) = 3.2 x 0.4375 = 1.4; with 0.4 in quadrature.
    effects = replace(LINEAR, blur_px=0.4, defocus_px_m=3.2, focus_mm=640.0)
    sigma = blur_sigma_px(np.array([500.0, 640.0]), effects)
    np.testing.assert_allclose(sigma, [math.hypot(1.4, 0.4), 0.4], rtol=1e-12)


@given(st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_widths_cover_what_is_asked(one: float, other: float) -> None:
    least, most = sorted((one, other))
    sigmas = choose_sigmas(least, most)
    assert sigmas[0] == pytest.approx(least)
    assert sigmas[-1] == pytest.approx(most)
    assert (np.diff(sigmas) >= 0).all()
    steps = sigmas[1:][sigmas[:-1] >= 0.1] / sigmas[:-1][sigmas[:-1] >= 0.1]
    assert (steps <= 1.25 + 1e-9).all()
    assert len(sigmas) <= 18


# Response


def test_response_by_hand() -> None:
    level = np.array([0.0, 0.5, 1.0])
    np.testing.assert_allclose(respond(level, replace(LINEAR, gamma=2.0)), [0, 0.25, 1])
    points = ((0.0, 0.0), (0.5, 0.3), (1.0, 1.0))
    np.testing.assert_allclose(respond(level, replace(LINEAR, response=points)), [0, 0.3, 1])
    fine = respond(np.linspace(0, 1, 101), replace(LINEAR, response=points))
    assert (np.diff(fine) > 0).all()


def test_black_light_lifts_black_alone() -> None:
    effects = replace(LINEAR, bits=8, black_light=0.1, gamma=2.0)
    image = np.array([[0, 51, 255]] * 2, np.uint8)  # 51 / 255 = 0.2, squared 0.04
    light = Lamp(effects, 3, 2, 1.0, np.zeros(1)).light(image)
    np.testing.assert_allclose(light[0], [0.1, 0.1 + 0.9 * 0.04, 1.0], rtol=1e-6)


def test_images_that_do_not_fit() -> None:
    lamp = Lamp(replace(LINEAR, bits=10), WIDTH, HEIGHT, 1.0, np.zeros(1))
    with pytest.raises(ShapeError, match=r"image must be \(48, 64\), got \(64, 48\)"):
        lamp.show(np.zeros((WIDTH, HEIGHT), np.uint16))
    with pytest.raises(UsageError, match="at most 1023, got 1024"):
        lamp.show(np.full((HEIGHT, WIDTH), 1024, np.uint16))
