"""Corners of a projected checkerboard in the camera's image, and which of the projector's they are.

The paper shows a projected checkerboard at every pose of the printed one (its figure 4) and does
not say how the two keep apart. Here the frame is divided by the white frame, both less the black
one: what is printed, and the light's own fall-off, cancel. A corner counts where it lies on white,
away from all edges of the print, whose pixels see both sides; what is about it may be printed on,
but for ink so black that only noise is left to divide by.

Which corner is which the squares do not tell: all look alike, and the camera seldom sees the first.
The decoded maps tell it where the capture has them, and nothing else is taken from them; without
maps the whole projected checkerboard must be in view.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.boards.found import (
    SMALLEST_SQUARE_PX,
    grid_steps,
    right_handed,
    square_sizes,
    to_8_bit,
)
from fringeworks.calibrate.boards.saddle import refine_saddles
from fringeworks.calibrate.dense import bright_parts
from fringeworks.errors import CalibrationError
from fringeworks.model import Capture, Checkerboard, CheckerboardTarget, ProjectorMap
from fringeworks.model.sequence import PROJECTOR_EDGE_PX

Array = NDArray[np.float64]

LEAST_PROJECTED = 8
HOW_TO_PROJECT = (
    "`fringeworks patterns paper-calibrate` writes one (in capture.toml: kind checkerboard, "
    "square_px)"
)

LARGEST_RESIDUAL_PX = 3.0
"""Camera px, of a homography between decoded coordinates and pixels: lenses bend it by one."""

HOMOGRAPHY_PIXELS = 5000
LEAST_LIGHT = 0.05
"""Of that of the board's white parts: by less the frame is not divided."""

LEAST_AGREEMENT = 0.5
"""Of 1 where every square is as bright as it was drawn, 0 where by chance, -1 where black and white
are exchanged."""


@dataclass(frozen=True, slots=True, eq=False)
class ProjectedCorners:
    """Corners of the projected checkerboard that were found; m of them.

    Attributes
    ----------
    projector_px
        ``(m, 2)``, exact: they were drawn there.
    camera_px, camera_sigma_px
        ``(m, 2)``.
    reasons
        One per corner: why it is left out, empty where it is kept.
    cut
        How many more lie on white parts of the board, but could not be fitted.
    """

    projector_px: Array
    camera_px: Array
    camera_sigma_px: Array
    reasons: tuple[str, ...]
    cut: int

    @property
    def kept(self) -> NDArray[np.bool_]:
        """``(m,)`` corners that take part in the calibration."""
        return np.array([not reason for reason in self.reasons], dtype=np.bool_)


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """A projected checkerboard as the camera sees it.

    `light` ``(H, W)`` is the white frame without the black one, `share` how much of it the
    checkerboard leaves, 0 to 1; `grid` its inner corners, in projector px for mm.
    """

    name: str
    light: NDArray[np.float32]
    share: NDArray[np.float32]
    saturated: NDArray[np.bool_]
    grid: CheckerboardTarget

    @property
    def corners_px(self) -> Array:
        """``(n, 2)`` projector px of all inner corners, row by row."""
        return self.grid.corners_mm()[:, :2] + PROJECTOR_EDGE_PX + self.grid.pitch_x_mm


def find_projected(
    capture: Capture, printed: tuple[Array, float], projector_map: ProjectorMap | None
) -> ProjectedCorners:
    """Corners of a capture's projected checkerboard on the board's white parts.

    Parameters
    ----------
    capture
        With a white frame and a set of kind checkerboard.
    printed
        Where the board is: ``(n, 2)`` camera px of its printed corners, and the size of its
        smallest square, px.
    projector_map
        Of both axes, to tell which corner is which; None where the capture codes less.

    Raises
    ------
    CalibrationError
        Naming the capture: a frame is missing, the projected squares cannot be told apart or are
        not those that capture.toml describes, or fewer than 12 corners are found.
    """
    shown = _shown(capture)
    corners, square_px = printed
    if projector_map is None:
        everything = _find_whole(shown)
        to_camera, corners = everything[0], np.concatenate([corners, everything[1]])
    else:
        to_camera = _from_maps(shown, projector_map, bright_parts(shown.light, corners, square_px))
    _refuse_other_squares(shown, to_camera)
    usable = bright_parts(shown.light, corners, square_px) & ~shown.saturated
    found = _refine(shown, to_camera, usable)
    if len(found.reasons) < LEAST_PROJECTED:
        raise CalibrationError(
            f"{capture.name}: only {len(found.reasons)} corners of the projected checkerboard were "
            f"found on white parts of the board, {found.cut} more are cut by black print or too "
            f"faint; at least {LEAST_PROJECTED} are needed: project smaller squares, print larger "
            "ones, and look at the exposure of the white frame"
        )
    return found


def _shown(capture: Capture) -> _Shown:
    boards, white, black = capture.find(Checkerboard), capture.white(), capture.black()
    if not boards:
        raise CalibrationError(
            f"{capture.name}: no projected checkerboard, which --model paper calibrates the "
            f"projector from: {HOW_TO_PROJECT}; --model joint does without"
        )
    if white is None:
        raise CalibrationError(
            f"{capture.name}: no white frame; the projected checkerboard is divided by it: add a "
            "set of kind uniform with level 1"
        )
    pattern, *_ = boards[0]
    grid = _inner_corners(pattern.square_px, capture.sequence.width, capture.sequence.height)
    if grid.corner_count < LEAST_PROJECTED or min(grid.columns, grid.rows) < 2:
        raise CalibrationError(
            f"{capture.name}: the projected checkerboard has {grid.columns} x {grid.rows} inner "
            f"corners in all, at least {LEAST_PROJECTED} are needed: project smaller squares"
        )
    dark = np.float32(capture.sensor.black_level) if black is None else black
    light = white - dark
    image = capture.level_of(pattern) - dark
    lit = light > 1.0
    share = np.clip(np.where(lit, image, 0.5) / np.where(lit, light, 1.0), 0.0, 1.5)
    return _Shown(
        name=capture.name,
        light=light,
        share=share.astype(np.float32),
        saturated=white >= _white_saturation(capture),
        grid=grid,
    )


def _white_saturation(capture: Capture) -> float:
    place = capture.sequence.white_set
    assert place is not None
    return capture.saturation_of(capture.sequence.sets[place].pattern)


def _inner_corners(square_px: float, width: int, height: int) -> CheckerboardTarget:
    """The grid of a projected checkerboard, whose squares count from the image's corner."""
    columns, rows = (int(np.ceil(extent / square_px)) - 1 for extent in (width, height))
    return CheckerboardTarget(columns, rows, square_px, square_px)


def _from_maps(shown: _Shown, projector_map: ProjectorMap, on_board: NDArray[np.bool_]) -> Array:
    """``(3, 3)`` homography, camera from projector px, of the decoded coordinates on the board."""
    column, row = (axis.coordinate for axis in projector_map.axes)
    y, x = np.nonzero(on_board & np.isfinite(column) & np.isfinite(row))
    some = slice(None, None, 1 + len(x) // HOMOGRAPHY_PIXELS)
    y, x = y[some], x[some]
    decoded = np.stack([column[y, x], row[y, x]], axis=-1).astype(np.float64)
    return _homography(shown, decoded, np.stack([x, y], axis=-1).astype(np.float64))


def _homography(shown: _Shown, projector_px: Array, camera_px: Array) -> Array:
    found = None
    if len(camera_px) >= LEAST_PROJECTED:
        found, _ = cv2.findHomography(projector_px, camera_px, cv2.RANSAC, LARGEST_RESIDUAL_PX)
    if found is None:
        raise CalibrationError(
            f"{shown.name}: the decoded coordinates on the board are too few to tell which of the "
            "projected corners is which: is it lit and well exposed in the fringes?"
        )
    return np.asarray(found, dtype=np.float64)


def _find_whole(shown: _Shown) -> tuple[Array, Array]:
    """The homography as `_from_maps`, and ``(n, 2)`` camera px, of all projected corners."""
    grid = shown.grid
    found, corners = cv2.findChessboardCornersSB(
        to_8_bit(cv2.medianBlur(shown.share, 3)),
        (grid.columns, grid.rows),
        flags=cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE,
    )
    if not found:
        raise CalibrationError(
            f"{shown.name}: which of the projected corners is which cannot be told: the capture "
            "does not code both axes of the projector, and the whole projected checkerboard, "
            f"{grid.columns} x {grid.rows} inner corners, is not in view; code both axes, as the "
            "preset paper-calibrate does"
        )
    seen = right_handed(corners.reshape(-1, 2).astype(np.float64), grid)
    seen = max(_turns(seen, grid), key=lambda turned: _upright(shown, turned))
    return _homography(shown, shown.corners_px, seen), seen


def _turns(corners: Array, grid: CheckerboardTarget) -> list[Array]:
    """The same corners in every order that keeps the grid's shape and sees it from the front."""
    laid_out = corners.reshape(grid.rows, grid.columns, 2)
    turned = [np.rot90(laid_out, quarter) for quarter in range(4)]
    return [part.reshape(-1, 2) for part in turned if part.shape == laid_out.shape]


def _upright(shown: _Shown, corners: Array) -> tuple[bool, float]:
    """Whether black and white agree, and by how far the projector's x runs right: for sorting.

    Half a turn of a board with both counts odd, or both even, shows in no square.
    """
    agree = _agreement(shown, _homography(shown, shown.corners_px, corners)) > LEAST_AGREEMENT
    along = np.diff(corners.reshape(shown.grid.rows, shown.grid.columns, 2), axis=1)
    return agree, float(along[..., 0].mean())


def _agreement(shown: _Shown, to_camera: Array) -> float:
    """By what share of white light the middles of white squares are brighter than black ones'."""
    grid = shown.grid
    column, row = np.meshgrid(np.arange(grid.columns + 1), np.arange(grid.rows + 1))
    middles = np.stack([column.ravel(), row.ravel()], axis=-1) + 0.5
    places = _move(to_camera, middles * grid.pitch_x_mm + PROJECTOR_EDGE_PX)
    x, y = np.rint(np.nan_to_num(places, nan=-1)).astype(int).T
    height, width = shown.light.shape
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    white = ((column + row) % 2 == 1).ravel()[inside]
    seen, weight = shown.share[y[inside], x[inside]], shown.light[y[inside], x[inside]]
    if not weight[white].any() or not weight[~white].any():
        return 0.0
    bright, dark = (np.average(seen[part], weights=weight[part]) for part in (white, ~white))
    return float(bright - dark)


def _refuse_other_squares(shown: _Shown, to_camera: Array) -> None:
    if not _agreement(shown, to_camera) > LEAST_AGREEMENT:
        raise CalibrationError(
            f"{shown.name}: the projected squares are not where a checkerboard of "
            f"{shown.grid.pitch_x_mm:g} px has them: is square_px in capture.toml right, is the "
            "image's first square black, and was it shown unscaled and not mirrored?"
        )


def _refine(shown: _Shown, to_camera: Array, usable: NDArray[np.bool_]) -> ProjectedCorners:
    """Fit the corners near which there are usable pixels."""
    corners = shown.corners_px
    expected = _move(to_camera, corners)
    if np.nanmedian(square_sizes(expected, shown.grid)) < SMALLEST_SQUARE_PX:
        raise CalibrationError(
            f"{shown.name}: the projected squares are below {SMALLEST_SQUARE_PX:g} px in the "
            "camera's image: project larger ones"
        )
    steps = grid_steps(expected, shown.grid)
    x, y = np.rint(np.nan_to_num(expected, nan=-1)).astype(int).T
    height, width = usable.shape
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    inside[inside] = usable[y[inside], x[inside]]
    lit = shown.light > LEAST_LIGHT * np.median(shown.light[usable])
    image = np.where(lit & ~shown.saturated, shown.share, np.nan)
    fitted = refine_saddles(image, expected[inside], steps[inside])
    good = np.array([not reason for reason in fitted.reasons], dtype=np.bool_)
    return ProjectedCorners(
        projector_px=corners[inside][good],
        camera_px=fitted.pixels[good],
        camera_sigma_px=fitted.sigma[good],
        reasons=("",) * int(good.sum()),
        cut=int((~good).sum()),
    )


def _move(to_camera: Array, places: NDArray[np.floating]) -> Array:
    """Places ``(n, 2)`` through a homography; NaN where they lie behind the camera."""
    moved = np.column_stack([places, np.ones(len(places))]) @ to_camera.T
    sign = np.sign(np.median(moved[:, 2]))
    depth = np.where(moved[:, 2] * sign > 0, moved[:, 2], np.nan)
    return np.asarray(moved[:, :2] / depth[:, None])
