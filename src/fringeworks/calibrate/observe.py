"""One view of the board: every corner in camera and in projector pixels."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.boards.corners import board_images, find_board, square_sizes
from fringeworks.calibrate.boards.found import FoundCorners
from fringeworks.calibrate.dense import find_sites
from fringeworks.calibrate.judge.ripple import Ripple, find_ripples
from fringeworks.calibrate.local_fit import LocalFit, fit_local
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.calibrate.sites import Sites
from fringeworks.errors import CalibrationError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Capture, CodedAxis, ProjectorMap, Target, corners_at

Array = NDArray[np.float64]

LEAST_SUPPORT = 0.2
"""Share of the window that must be decoded; with dark squares void it is one half."""

LARGEST_IMBALANCE = 0.3
"""A window that lacks one of its quarters has 0.2, one that lacks a half 0.42."""

LARGEST_SIGMA_PX = 0.5
LEAST_SHARE_OF_CORNERS = 0.25
LEAST_CORNERS = 12
SMALLEST_AREA = 1e-9
"""Of a camera pixel in projector px^2; below it the coordinates do not change, mirrored or not."""

KEPT = ""
TOO_FEW = "too few decoded pixels about the corner"
ONE_SIDED = "decoded pixels on one side of the corner only"
SCATTERED = "decoded coordinates scatter"


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What both devices see of the board in one capture; n corners.

    Attributes
    ----------
    board_mm
        ``(n, 3)`` corners in the board's frame, at the capture's temperature.
    camera_px, projector_px
        ``(n, 2)``; `projector_px` is NaN where nothing could be fitted.
    camera_sigma_px, projector_sigma_px
        ``(n, 2)`` standard deviations of the coordinates.
    reasons
        One per corner: why it is left out, empty where it is kept.
    image
        Which image the corners were found in.
    dense
        Sites all over the board's bright parts; None where the maps were not asked.
    blur_px
        Standard deviation of the camera image's blur; NaN where it is not known.
    ripples
        Waves in the maps, along with the dense sites.
    """

    name: str
    board_mm: Array
    camera_px: Array
    projector_px: Array
    camera_sigma_px: Array
    projector_sigma_px: Array
    reasons: tuple[str, ...]
    image: str = "white frame"
    dense: Sites | None = None
    blur_px: float = np.nan
    ripples: tuple[Ripple, ...] = ()

    @property
    def corner_sites(self) -> Sites:
        """The kept corners' own places: what the maps say there does not depend on the board."""
        parts = (self.camera_px, self.projector_px, self.projector_sigma_px)
        return Sites(*parts).only(self.kept)

    @property
    def sites(self) -> Sites:
        """Dense where there are any; the corners' are made of the same pixels."""
        return self.corner_sites if self.dense is None else self.dense

    @property
    def kept(self) -> NDArray[np.bool_]:
        """``(n,)`` corners that take part in the calibration."""
        return np.array([reason == KEPT for reason in self.reasons], dtype=np.bool_)

    @property
    def pixels(self) -> Array:
        """``(n, 4)``: camera x, y and projector x, y."""
        return np.concatenate([self.camera_px, self.projector_px], axis=1)

    def kept_in_camera(self, camera_from_board: Array) -> Array:
        """``(k, 3)`` kept corners in the camera's frame, mm, from the board's pose ``(6,)``."""
        turn, shift = rotation_matrix(camera_from_board[:3]), camera_from_board[3:]
        return np.asarray(self.board_mm[self.kept] @ turn.T + shift)

    @property
    def mirrored(self) -> bool:
        """Whether the affine map from camera to projector px turns left to right."""
        kept = self.kept
        design = np.column_stack([self.camera_px[kept], np.ones(kept.sum())])
        affine, *_ = np.linalg.lstsq(design, self.projector_px[kept], rcond=None)
        return bool(np.linalg.det(affine[:2]) < -SMALLEST_AREA)

    @property
    def left_out(self) -> dict[str, int]:
        """Number of corners left out, by reason."""
        return dict(Counter(reason for reason in self.reasons if reason != KEPT))


def observe_board(
    capture: Capture,
    projector_map: ProjectorMap,
    board: Target,
    *,
    settings: CalibrationSettings | None = None,
    mirrored: bool = False,
) -> View:
    """Find the board in a capture and read its corners' projector coordinates.

    Each coordinate comes from a robust quadratic fit of the decoded map in a round window about
    the corner, `settings.window_squares` local squares in radius, weighted by 1 / sigma^2. Of a
    ChArUco board only the corners that are seen take part. Where the board's expansion and both
    temperatures are known, its corners are where the warmth has moved them.

    Parameters
    ----------
    mirrored
        Whether a view whose projector coordinates are mirrored is given all the same.

    Raises
    ------
    CalibrationError
        Naming the capture: an axis is not coded, the board is not found or too small, too few
        corners have a projector coordinate, or (unless `mirrored`) the projector's image is
        mirrored.
    """
    settings = settings or CalibrationSettings()
    column, row = _both_axes(capture.name, projector_map)
    image, found = _locate(capture, projector_map, board)
    squares = square_sizes(found.on_board(board), board)[found.index]
    squares = np.where(np.isfinite(squares), squares, np.nanmin(squares))  # one seen by itself
    fits = [
        (_fit(column, at, radius), _fit(row, at, radius))
        for at, radius in zip(found.pixels, settings.window_squares * squares, strict=True)
    ]
    view = View(
        name=capture.name,
        board_mm=corners_at(board, capture.sensor.temperature_c)[found.index],
        camera_px=found.pixels,
        projector_px=np.array([[fit.value for fit in pair] for pair in fits]),
        camera_sigma_px=found.sigma,
        projector_sigma_px=np.array([[fit.sigma for fit in pair] for pair in fits]),
        reasons=tuple(_judge(pair) for pair in fits),
        image=image,
        blur_px=found.blur_px,
    )
    _refuse_few(view, projector_map)
    if not mirrored:
        refuse_mirrored(view)
    if not settings.dense:
        return view
    places = found.pixels[view.kept], view.projector_px[view.kept]
    return replace(
        view,
        dense=find_sites(projector_map, places, float(squares.min())),
        ripples=find_ripples(projector_map, found.pixels),
    )


def _both_axes(name: str, projector_map: ProjectorMap) -> tuple[CodedAxis, CodedAxis]:
    column, row = projector_map.column, projector_map.row
    if column is None or row is None:
        coded = "x" if row is None else "y"
        raise CalibrationError(
            f"{name}: only axis {coded} of the projector is coded; calibration needs both, "
            "capture the preset 'calibrate' or add a set along the other axis"
        )
    return column, row


def _locate(
    capture: Capture, projector_map: ProjectorMap, board: Target
) -> tuple[str, FoundCorners]:
    """The first image with the board, and its corners; the first image's reason if none has it."""
    reason = None
    for name, image in board_images(capture, projector_map):
        try:
            return name, find_board(image, board)
        except CalibrationError as error:
            reason = reason or f"{capture.name}: {error} (looked at the {name} first)"
    raise CalibrationError(reason or f"{capture.name}: no image to look for the board in")


def _fit(axis: CodedAxis, at: Array, radius: float) -> LocalFit:
    return fit_local(axis.coordinate, axis.sigma, at=at, radius=radius)


def _judge(fits: tuple[LocalFit, LocalFit]) -> str:
    """Why a corner is left out; empty if it is kept."""
    if any(not np.isfinite(fit.value) or fit.support < LEAST_SUPPORT for fit in fits):
        return TOO_FEW
    if any(fit.imbalance > LARGEST_IMBALANCE for fit in fits):
        return ONE_SIDED
    if any(fit.sigma > LARGEST_SIGMA_PX for fit in fits):
        return SCATTERED
    return KEPT


def _refuse_few(view: View, projector_map: ProjectorMap) -> None:
    kept, offered = int(view.kept.sum()), len(view.reasons)
    if kept < max(LEAST_CORNERS, LEAST_SHARE_OF_CORNERS * offered):
        causes = ", ".join(f"{count} {reason}" for reason, count in view.left_out.items())
        shares = ", ".join(f"{axis.axis} {axis.valid_share:.0%}" for axis in projector_map.axes)
        raise CalibrationError(
            f"{view.name}: only {kept} of {offered} corners have a projector coordinate "
            f"({causes}); decoded pixels: {shares}. Does the projector's image cover the board, "
            "is it bright enough there, and does capture.toml list the frames in their order?"
        )


def refuse_mirrored(view: View) -> None:
    """Raise `CalibrationError` where camera and projector see the board turned left to right."""
    if view.mirrored:
        raise CalibrationError(
            f"{view.name}: the projector's coordinates are mirrored against the camera's: one of "
            "the two images is flipped (rear projection or ceiling mode, a mirrored camera "
            "image), or capture.toml has the frames of the two axes swapped"
        )
