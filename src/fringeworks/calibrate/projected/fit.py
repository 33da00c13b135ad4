"""The paper's calibration: the camera alone, then the projector from what the camera says.

Section 4.2 of the paper. The printed corners calibrate the camera by Zhang's method and give the
board's poses; those that it reprojects beyond 0.25 px are left out, as in the paper. Rays through
the projected corners are cut with the board: they become points of known place, and the projector
is calibrated from them as a camera that looks backwards. Last comes its pose to the camera, over
all views. Nothing found later moves anything found before: the camera's error becomes the
projector's, which the joint model does without.

Departures: the lens has five terms, where the paper names none; the projector starts from a linear
solution, its principal point moved into the image, where `cv2.calibrateCamera` wants it, and free
from there; projected corners are left out beyond six standard deviations, since the paper's own
0.77 px would leave hardly any within 0.25 px.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.spread import robust_sigma
from fringeworks.calibrate.adjust.start import LARGEST_RMS_PX, PROJECTOR_CAUSES, start_state
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.judge.trim import DOES_NOT_FIT
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.projected.camera import (
    LEAST_LEFT,
    MOST_ROUNDS,
    PosedView,
    calibrate_camera,
    in_camera,
    keep_same,
    mark_far,
    move_points,
    rms_of,
    zhang,
)
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.errors import CalibrationError
from fringeworks.geometry.lens import pixel_rays, project, project_jacobian
from fringeworks.geometry.minimise import Block, minimise
from fringeworks.geometry.pose import move_jacobian, rotation_matrix

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class PaperFit:
    """A rig by the paper's way, with what it leaves.

    Attributes
    ----------
    views
        With the reasons of the corners that were left out.
    projected_mm
        Per view ``(m, 3)`` where its projected corners lie on the board, mm.
    camera_residual_px, projector_residual_px
        Per view measured minus projected px: ``(n, 2)`` of all its printed corners in the camera,
        and ``(m, 2)`` of all its projected ones in the projector, kept or not.
    alone_px
        ``(2,)`` standard deviations over x and y of what the projector's own calibration leaves,
        whose boards lie where they fit it best: the paper's figure.
    """

    state: RigState
    views: tuple[PosedView, ...]
    projected_mm: tuple[Array, ...]
    camera_residual_px: tuple[Array, ...]
    projector_residual_px: tuple[Array, ...]
    alone_px: Array


def fit_paper(
    views: Sequence[PosedView],
    sizes: tuple[ImageSize, ImageSize],
    settings: CalibrationSettings,
) -> PaperFit:
    """Calibrate the camera, then the projector, then the pose between them.

    Parameters
    ----------
    views
        Three at least.
    sizes
        Of the camera's and the projector's image.
    settings
        Which terms of distortion are free, and `trim_sigmas` of the projected corners.

    Raises
    ------
    CalibrationError
        The corners fix no lens, a view keeps fewer than 8 of either kind, the board has nearly one
        orientation in all views, or no projector explains the projected corners.
    """
    camera, poses, views = calibrate_camera(views, sizes[0], settings)
    mapped = [
        _on_board(view.projected.camera_px, camera, pose)
        for view, pose in zip(views, poses, strict=True)
    ]
    for _ in range(MOST_ROUNDS):
        state, alone = _calibrate_projector((views, mapped), sizes, settings)
        state = replace(state, camera=camera, camera_from_board=poses)
        state = replace(state, projector_from_camera=_pose_between(state, views, mapped))
        residuals = _in_projector(state, views, mapped)
        before, views = views, _without_far(views, residuals, settings)
        if keep_same(before, views):
            break
    return PaperFit(
        state=state,
        views=tuple(views),
        projected_mm=tuple(mapped),
        camera_residual_px=tuple(in_camera(camera, poses, views)),
        projector_residual_px=tuple(residuals),
        alone_px=alone.std(axis=0),
    )


def _on_board(camera_px: Array, lens: Array, pose: Array) -> Array:
    """``(m, 3)`` mm, z = 0, where the rays of pixels meet the board."""
    rays = pixel_rays(camera_px, lens)
    turn, shift = rotation_matrix(pose[:3]), pose[3:]
    depth = (turn[:, 2] @ shift) / (rays @ turn[:, 2])
    places = (rays * depth[:, None] - shift) @ turn
    places[:, 2] = 0.0
    return np.asarray(places)


def _calibrate_projector(
    seen: tuple[Sequence[PosedView], Sequence[Array]],
    sizes: tuple[ImageSize, ImageSize],
    settings: CalibrationSettings,
) -> tuple[RigState, Array]:
    """The projector's lens in a state, and ``(n, 2)`` px that its calibration by itself leaves.

    The state is that of `start_state` otherwise, which also refuses what no rig could be.
    """
    views, mapped = seen
    start = start_state([_both(view, places) for view, places in zip(*seen, strict=True)], sizes[0])
    board = [places[view.projected.kept] for view, places in zip(views, mapped, strict=True)]
    pixels = [view.projected.projector_px[view.projected.kept] for view in views]
    size = sizes[1]
    inside = start.projector.copy()
    inside[2:4] = np.clip(inside[2:4], 1, [size.width - 2, size.height - 2])
    try:
        lens, poses = zhang(board, pixels, size, free=settings.projector_free, start=inside)
    except cv2.error as error:
        raise CalibrationError(
            f"no projector explains the projected corners ({error.err}); {PROJECTOR_CAUSES}"
        ) from error
    left = [
        there - project(move_points(pose, places), lens)
        for there, pose, places in zip(pixels, poses, board, strict=True)
    ]
    return replace(start, projector=lens), np.concatenate(left)


def _both(view: PosedView, places: Array) -> View:
    """The projected corners as corners of the board that both devices see."""
    found = view.projected
    return View(
        name=view.name,
        board_mm=places,
        camera_px=found.camera_px,
        projector_px=found.projector_px,
        camera_sigma_px=found.camera_sigma_px,
        projector_sigma_px=found.camera_sigma_px,
        reasons=found.reasons,
    )


def _pose_between(state: RigState, views: Sequence[PosedView], mapped: Sequence[Array]) -> Array:
    """``(6,)`` projector_from_camera that fits all kept projected corners, the lenses as found."""
    points = np.concatenate(
        [
            move_points(pose, places[view.projected.kept])
            for pose, places, view in zip(state.camera_from_board, mapped, views, strict=True)
        ]
    )
    pixels = np.concatenate([view.projected.projector_px[view.projected.kept] for view in views])

    def model(pose: Array) -> Iterator[Block]:
        moved, by_pose = move_jacobian(pose, points)
        seen, by_point, _ = project_jacobian(moved, state.projector)
        yield (pixels - seen).ravel(), -(by_point @ by_pose).reshape(-1, 6), np.arange(6)

    return minimise(model, state.projector_from_camera).parameters


def _in_projector(
    state: RigState, views: Sequence[PosedView], mapped: Sequence[Array]
) -> list[Array]:
    return [
        view.projected.projector_px
        - project(
            move_points(state.projector_from_camera, move_points(pose, places)), state.projector
        )
        for pose, places, view in zip(state.camera_from_board, mapped, views, strict=True)
    ]


def _without_far(
    views: Sequence[PosedView], residuals: Sequence[Array], settings: CalibrationSettings
) -> list[PosedView]:
    """The views without the projected corners beyond so many robust standard deviations."""
    kept = [part[view.projected.kept] for view, part in zip(views, residuals, strict=True)]
    _refuse_nonsense(views, kept)
    bound = settings.trim_sigmas * robust_sigma(np.concatenate(kept))
    out = []
    for view, part in zip(views, residuals, strict=True):
        reasons = mark_far(view.projected.reasons, np.abs(part).max(axis=1) > bound, DOES_NOT_FIT)
        left = reasons.count("")
        if left < LEAST_LEFT:
            raise CalibrationError(
                f"{view.name}: only {left} of its projected corners fit those of the other views "
                f"({rms_of(part):.2f} px rms in the projector), at least {LEAST_LEFT} are needed; "
                f"{PROJECTOR_CAUSES}"
            )
        out.append(replace(view, projected=replace(view.projected, reasons=reasons)))
    return out


def _refuse_nonsense(views: Sequence[PosedView], residuals: Sequence[Array]) -> None:
    rms = rms_of(np.concatenate(residuals))
    if not rms <= LARGEST_RMS_PX:
        worst = max(range(len(views)), key=lambda place: rms_of(residuals[place]))
        raise CalibrationError(
            f"the projected corners do not fit a lens: {rms:.1f} px rms in the projector, worst in "
            f"{views[worst].name} ({rms_of(residuals[worst]):.1f} px); {PROJECTOR_CAUSES}"
        )
