"""What is printed on boards, and where the corners of what a camera sees of it are."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.model import Lens, Pose
from fringeworks.twin.cast import Caster
from fringeworks.twin.scene import Board, Material, Object, Scene
from fringeworks.twin.texture import print_error, print_of, sheet_sizes
from tests.twin.prints import board_corners
from tests.twin.views import CAMERA, every_pixel, pose

Array = NDArray[np.float64]

BOARD = Board(9, 6, 14.0)
CHARUCO = Board(7, 5, 16.0, kind="charuco", marker_mm=12.0)
CIRCLES = Board(7, 5, 16.0, kind="circles", diameter_mm=9.0)
MARKED = Material(albedo=0.9, dark_albedo=0.1)
FACING = pose((0.0, 0.0, 0.0), (-50.0, -30.0, 600.0))
TILTED = pose((0.25, -0.3, 0.1), (-50.0, -30.0, 620.0))


def caster_of(board: Board, place: Pose) -> Caster:
    return Caster(Scene("board", (Object("board", board, place, MARKED),)))


def albedo_at(board: Board, points: Array, *, width_mm: float = 0.0) -> Array:
    """Albedo at points ``(n, 2)`` of a board looked at squarely from 100 mm."""
    origins = np.column_stack([points, np.full(len(points), -100.0)])
    directions = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    caster = caster_of(board, Pose.identity())
    return caster.look(origins, directions, pixel_rad=width_mm / 100).albedo


def image_of(board: Board, place: Pose, *, side: int = 2) -> NDArray[np.float32]:
    """Grey image, 0 to 255, of a board's albedo under CAMERA by `side`^2 rays per pixel."""
    caster, total = caster_of(board, place), np.zeros(CAMERA.width * CAMERA.height)
    for dx in (np.arange(side) + 0.5) / side - 0.5:
        for dy in (np.arange(side) + 0.5) / side - 0.5:
            rays = CAMERA.rays(every_pixel(CAMERA) + np.array([dx, dy]))
            sight = caster.look(*rays, pixel_rad=1 / CAMERA.lens.fx / side)
            total += np.nan_to_num(sight.albedo, nan=0.5) * 255 / side**2
    return total.reshape(CAMERA.height, CAMERA.width).astype(np.float32)


def test_squares_by_hand() -> None:
    # The first square, up and left of the first corner (the origin), is black; margin and more.
    points = np.array([[-7, -7], [7, -7], [-7, 7], [7, 7], [-20, -7], [-26, 0], [133, 91]], float)
    albedo = albedo_at(BOARD, points)
    asked = np.array([0.1, 0.9, 0.9, 0.1, 0.9, np.nan, 0.9])
    # Four sums of 1e4 mm^2, rounded to 1e-12, over the 1e-6 mm^2 that a point is looked at with.
    np.testing.assert_allclose(albedo, asked, rtol=0, atol=1e-5)
    assert sheet_sizes(BOARD) == (56.0, 35.0, 80.0, 59.0)


def test_the_back_is_white() -> None:
    turned = pose((0.0, np.pi, 0.0), (0.0, 0.0, 0.0))
    points = np.array([[0.0, 0.0, -100.0]]) + np.array([[7.0, 7.0, 0.0], [-7.0, 7.0, 0.0]])
    sight = caster_of(BOARD, turned).look(points, np.tile([0.0, 0.0, 1.0], (2, 1)))
    np.testing.assert_allclose(sight.albedo, [0.9, 0.9], rtol=0, atol=1e-12)


def test_a_footprint_is_averaged_exactly() -> None:
    # A square of 4 mm about (1, 1): 3 of 4 mm right of the corner and below it. Black share
    # (3 3 + 1 1) / 16, as the squares over the diagonal are black.
    albedo = albedo_at(BOARD, np.array([[1.0, 1.0]]), width_mm=4.0)
    np.testing.assert_allclose(albedo, 0.9 - 0.8 * 10 / 16, rtol=0, atol=1e-9)


@pytest.mark.parametrize("printed", [BOARD, replace(BOARD, kind="circles", diameter_mm=9.0)])
def test_a_footprint_against_many_points(printed: Board) -> None:
    board = replace(printed, print_sigma_mm=0.05, print_scale=(2e-3, -1e-3))
    rng = np.random.default_rng(0)
    places = rng.uniform([0, 0], [110, 70], (40, 2))
    offsets = (np.mgrid[0:100, 0:100].reshape(2, -1).T + 0.5) / 100 - 0.5
    fine = albedo_at(board, (places[:, None] + 3.0 * offsets).reshape(-1, 2))
    asked = fine.reshape(len(places), -1).mean(axis=1)
    # An edge may be off by half a step of the points, 1/200 of the width, along both axes; the
    # print's local slope, about 0.1 / 14, over half the width of 3 mm is 0.01 mm more.
    albedo = albedo_at(board, places, width_mm=3.0)
    np.testing.assert_allclose(albedo, asked, rtol=0, atol=0.8 * 2 * (0.005 + 0.004))
    assert np.ptp(asked) > 0.3


def test_circles_by_hand() -> None:
    """Points in and out of circles; and squares of 16 mm, each with the whole of one or quarters.

    A point is looked at through a square of 1e-3 mm.
    """
    points = np.array([[0, 0], [4.49, 0], [0, -4.51], [8, 8], [96, 64], [112, 0], [99.2, 67.2]])
    albedo = albedo_at(CIRCLES, points)
    np.testing.assert_allclose(albedo, [0.1, 0.1, 0.9, 0.9, 0.1, 0.9, 0.9], rtol=0, atol=1e-5)
    share = np.pi * 4.5**2 / 16**2
    places = np.array([[16, 16], [8, 8], [8, 0], [-8, -8], [88, 64]], float)
    albedo = albedo_at(CIRCLES, places, width_mm=16.0)
    asked = 0.9 - 0.8 * share * np.array([1, 1, 1, 0.25, 1])
    np.testing.assert_allclose(albedo, asked, rtol=0, atol=1e-9)


def test_charuco_is_opencvs_drawing() -> None:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    drawn = cv2.aruco.CharucoBoard((8, 6), 16.0, 12.0, dictionary).generateImage((8 * 64, 6 * 64))
    y, x = np.mgrid[: 6 * 64, : 8 * 64]
    points = (np.stack([x.ravel(), y.ravel()], axis=-1) + 0.5) / 64 * 16 - 16
    black = albedo_at(CHARUCO, points).reshape(drawn.shape) < 0.5
    # OpenCV rounds a marker's edge to whole pixels; elsewhere every pixel must agree.
    edges = cv2.morphologyEx(drawn, cv2.MORPH_GRADIENT, np.ones((5, 5), np.uint8)) > 0
    assert edges.mean() < 0.5
    np.testing.assert_array_equal(black[~edges], drawn[~edges] < 128)


def test_print_error_moves_the_corners() -> None:
    board = replace(BOARD, print_sigma_mm=0.02, print_seed=3, print_scale=(1e-3, 0.0))
    shift = print_error(board)
    assert shift.shape == (8, 11, 2)
    np.testing.assert_array_equal(print_error(replace(board, print_sigma_mm=0.04)), 2 * shift)
    assert 0.015 < shift.std() < 0.025  # 176 values: 5 sigma of a standard deviation is 27 %
    corners = board_corners(board).reshape(6, 9, 3)
    np.testing.assert_allclose(corners[4, 2, :2], [28.028, 56.0] + shift[5, 3], rtol=0, atol=1e-12)
    # The corner is where all four squares meet: a small footprint about it is half black.
    albedo = albedo_at(board, corners[..., :2].reshape(-1, 2), width_mm=0.2)
    np.testing.assert_allclose(albedo, 0.5, rtol=0, atol=0.8 * 0.01)


def test_bow_lifts_the_middle_towards_the_camera() -> None:
    board = replace(BOARD, bow_mm=(0.2, 0.1))
    corners = board_corners(board)
    x, y = (corners[:, 0] - 56) / 80, (corners[:, 1] - 35) / 59
    asked = -0.2 * (1 - x**2) - 0.1 * (1 - y**2)
    np.testing.assert_allclose(corners[:, 2], asked, rtol=0, atol=1e-12)
    assert corners[:, 2].min() < -0.29


@pytest.mark.parametrize("side", [1, 2])
@pytest.mark.parametrize("place", [FACING, TILTED])
@pytest.mark.parametrize(
    "board", [BOARD, replace(BOARD, print_sigma_mm=0.03, bow_mm=(0.3, 0.2), print_scale=(1e-3, 0))]
)
def test_corners_in_images_are_where_they_project(board: Board, place: Pose, side: int) -> None:
    # On sharp squares cornerSubPix is 0.1 px off by the corner's place within its pixel, whoever
    # drew them; the more blur the less: 0.06 at 0.7 px, 0.02 at 2 px.
    image = cv2.GaussianBlur(image_of(board, place, side=side), (0, 0), 2.0)
    asked = CAMERA.pixels(place.apply(board_corners(board)))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 200, 1e-5)
    start = asked.astype(np.float32)[:, None] + np.float32(0.7)
    found = cv2.cornerSubPix(image, start, (8, 8), (-1, -1), stop).reshape(-1, 2)
    assert np.linalg.norm(found - asked, axis=1).max() < 0.03
    assert np.abs((found - asked).mean(axis=0)).max() < 0.012


def test_an_edge_is_in_its_place_with_one_ray_per_pixel() -> None:
    # A row of pixels through the middle of a row of squares: what is black of it, from the middle
    # of one square to the middle of the next, says where the edge is.
    camera = replace(CAMERA, lens=Lens(1974.0, 1974.0, 376.2, 240.0))
    middle_y = 7.0 + FACING.translation_mm[1]
    row = np.round(1974.0 * middle_y / 600 + 240)
    pixels = np.stack([np.arange(752.0), np.full(752, row)], axis=-1)
    sight = caster_of(BOARD, FACING).look(*camera.rays(pixels), pixel_rad=1 / 1974.0)
    white = (sight.albedo - 0.1) / 0.8
    edges = 1974.0 * (FACING.translation_mm[0] + 14.0 * np.arange(9)) / 600 + 376.2
    for index, edge in enumerate(edges):
        first, last = int(edge - 20), int(edge + 20)
        share = white[first : last + 1].sum()  # white stands right of every other edge
        found = last + 0.5 - share if index % 2 else first - 0.5 + share
        # The footprint is a square across the ray, not the pixel: a turn of 0.1 rad is 0.5 %.
        assert abs(found - edge) < 0.005


@pytest.mark.parametrize("place", [FACING, TILTED])
def test_charuco_is_detected(place: Pose) -> None:
    image = cv2.GaussianBlur(image_of(CHARUCO, place), (0, 0), 0.7)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    detector = cv2.aruco.CharucoDetector(cv2.aruco.CharucoBoard((8, 6), 16.0, 12.0, dictionary))
    found, names, _, markers = detector.detectBoard(np.clip(image, 0, 255).astype(np.uint8))
    assert sorted(markers.ravel().tolist()) == list(range(24))
    order = names.ravel()
    assert len(order) == 35
    asked = CAMERA.pixels(place.apply(board_corners(CHARUCO)))[order]
    assert np.linalg.norm(found.reshape(-1, 2) - asked, axis=1).max() < 0.2


def test_grids_are_no_larger_than_they_must_be() -> None:
    across, down, ink = print_of(BOARD)
    assert (len(across), len(down), ink.shape) == (11, 8, (7, 10))
    across, down, ink = print_of(CHARUCO)  # a rim, six cells and a rim: eight steps per square
    assert (len(across), len(down), ink.shape) == (65, 49, (48, 64))


@pytest.mark.parametrize(
    ("board", "words"),
    [
        (replace(CIRCLES, diameter_mm=None), "diameter_mm must be above 0 and below square_mm"),
        (replace(CIRCLES, diameter_mm=16.0), "diameter_mm must be above 0 and below square_mm"),
        (replace(CHARUCO, marker_mm=None), "marker_mm must be above 0 and below square_mm"),
        (replace(CHARUCO, marker_mm=16.0), "marker_mm must be above 0 and below square_mm"),
        (replace(CHARUCO, dictionary="DICT_9X9"), "dictionary must be one of OpenCV's"),
        (replace(CHARUCO, columns=24, rows=24), "marker for each of the 312 white squares"),
    ],
)
def test_boards_that_cannot_be_drawn(board: Board, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        print_of(board)
