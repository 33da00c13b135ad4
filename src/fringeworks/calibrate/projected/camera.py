"""Paper mode's camera, by itself: Zhang's method on the printed corners.

Those with a reprojection error above 0.25 px are left out (the paper's section 4.2), and the camera
is solved again, until the same ones stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.observe import View
from fringeworks.calibrate.projected.corners import ProjectedCorners
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.errors import CalibrationError
from fringeworks.geometry.lens import project
from fringeworks.geometry.pose import rotation_matrix

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

KEPT_PX = 0.25
"""Feature points with a larger reprojection error are left out: the paper's section 4.2."""

BEYOND_KEPT = f"reprojection error above {KEPT_PX:g} px"
LEAST_LEFT = 8
MOST_ROUNDS = 5
STOP = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-12)
FIXED = {"k1": cv2.CALIB_FIX_K1, "k2": cv2.CALIB_FIX_K2, "k3": cv2.CALIB_FIX_K3}


@dataclass(frozen=True, slots=True, eq=False)
class PosedView:
    """One pose: the printed corners, whose projector px are void, and the projected ones."""

    printed: View
    projected: ProjectedCorners

    @property
    def name(self) -> str:
        return self.printed.name


def calibrate_camera(
    views: Sequence[PosedView], size: ImageSize, settings: CalibrationSettings
) -> tuple[Array, Array, Sequence[PosedView]]:
    """Lens ``(9,)``, board poses ``(views, 6)``, and the views without corners beyond 0.25 px.

    Raises
    ------
    CalibrationError
        The corners fix no lens, or fewer than 8 of a view are left.
    """
    for _ in range(MOST_ROUNDS):
        board = [view.printed.board_mm[view.printed.kept] for view in views]
        pixels = [view.printed.camera_px[view.printed.kept] for view in views]
        try:
            lens, poses = zhang(board, pixels, size, free=settings.camera_free)
        except cv2.error as error:
            raise CalibrationError(
                f"the printed corners fix no lens of the camera ({error.err}): are those of some "
                "view all on one line, or the board's counts wrong?"
            ) from error
        before, views = views, _within_kept(views, in_camera(lens, poses, views))
        if keep_same(before, views):
            break
    return lens, poses, views


def zhang(
    board: Sequence[Array],
    pixels: Sequence[Array],
    size: ImageSize,
    *,
    free: Sequence[str],
    start: Array | None = None,
) -> tuple[Array, Array]:
    """Lens ``(9,)`` of one device and poses ``(views, 6)`` of the boards before it, by OpenCV.

    Focal lengths and principal point are free, of the distortion what `free` names. A `start` has
    its principal point inside the image.

    Raises
    ------
    cv2.error
        A view's points lie on one line, or the start is not taken.
    """
    flags = sum(flag for name, flag in FIXED.items() if name not in free)
    flags |= 0 if {"p1", "p2"} <= set(free) else cv2.CALIB_ZERO_TANGENT_DIST
    matrix = np.eye(3)
    if start is not None:
        flags |= cv2.CALIB_USE_INTRINSIC_GUESS
        matrix[[0, 1, 0, 1], [0, 1, 2, 2]] = start[:4]
    _, solved, distortion, turns, shifts = cv2.calibrateCamera(
        [part.astype(np.float32) for part in board],
        [part.astype(np.float32) for part in pixels],
        (size.width, size.height),
        matrix,
        np.zeros(5),
        flags=flags,
        criteria=STOP,
    )
    found = (solved[0, 0], solved[1, 1], solved[0, 2], solved[1, 2])
    lens = np.array([*found, *np.ravel(distortion)[:5]], dtype=np.float64)
    poses = [np.concatenate([np.ravel(a), np.ravel(b)]) for a, b in zip(turns, shifts, strict=True)]
    return lens, np.array(poses, dtype=np.float64)


def _within_kept(views: Sequence[PosedView], residuals: Sequence[Array]) -> list[PosedView]:
    """The views without the printed corners beyond 0.25 px; those found again within it return."""
    out = []
    for view, part in zip(views, residuals, strict=True):
        far = np.hypot(*part.T) > KEPT_PX
        reasons = mark_far(view.printed.reasons, far, BEYOND_KEPT)
        left = reasons.count("")
        if left < LEAST_LEFT:
            raise CalibrationError(
                f"{view.name}: only {left} of {len(far)} printed corners are reprojected within "
                f"{KEPT_PX:g} px ({rms_of(part):.2f} px rms), at least {LEAST_LEFT} are needed: "
                "are the board's pitches right in x and y, is it flat, did anything move, is the "
                "white frame sharp? Leave the capture out if only this one is bad"
            )
        out.append(replace(view, printed=replace(view.printed, reasons=reasons)))
    return out


def mark_far(reasons: Sequence[str], far: Mask, why: str) -> tuple[str, ...]:
    """The reasons with `why` where a corner is far, and without it where it is not.

    A corner that is left out for another reason stays so.
    """
    return tuple(
        (why if beyond else "") if reason in ("", why) else reason
        for reason, beyond in zip(reasons, far, strict=True)
    )


def keep_same(before: Sequence[PosedView], after: Sequence[PosedView]) -> bool:
    """Whether the same corners are kept."""
    return all(
        a.printed.reasons == b.printed.reasons and a.projected.reasons == b.projected.reasons
        for a, b in zip(before, after, strict=True)
    )


def in_camera(lens: Array, poses: Array, views: Sequence[PosedView]) -> list[Array]:
    """Per view ``(n, 2)`` px of all its printed corners, measured minus projected."""
    return [
        view.printed.camera_px - project(move_points(pose, view.printed.board_mm), lens)
        for view, pose in zip(views, poses, strict=True)
    ]


def move_points(pose: Array, points: Array) -> Array:
    """Points ``(n, 3)`` moved by a pose ``(6,)``."""
    return np.asarray(points @ rotation_matrix(pose[:3]).T + pose[3:])


def rms_of(residuals: Array) -> float:
    """Root mean squared distance of ``(n, 2)``."""
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))
