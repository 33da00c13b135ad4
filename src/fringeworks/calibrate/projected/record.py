"""The rig of a paper-mode calibration, and its record in the form that `record.read_record` reads.

A view's rows are its printed corners, whose projector px are void, then its projected ones, whose
camera px gave them their place on the board, so that no residual of the camera is theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.state import SHAPE_NAMES
from fringeworks.calibrate.judge.checks import Failed, alike_views, not_used
from fringeworks.calibrate.judge.noticed import notice_distance
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.projected.camera import KEPT_PX, PosedView
from fringeworks.calibrate.projected.fit import PaperFit
from fringeworks.calibrate.record import KEY
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import (
    Camera,
    Finding,
    Lens,
    Pose,
    Projector,
    Quality,
    Rig,
    Target,
    kind_of,
)
from fringeworks.model.board import scale_sigma

Array = NDArray[np.float64]

Choices: TypeAlias = tuple[Target, CalibrationSettings, Failed]
"""The printed board, the settings, and the captures that gave no view."""

LEFT_OUT = "standard deviations, and halves of the views against each other: --model joint has them"


def model_of(further: Mapping[str, Any]) -> str:
    """``paper`` or ``joint``: which model a rig's record says it was calibrated by."""
    return str(further.get(KEY, {}).get("model", "joint"))


def paper_figures(further: Mapping[str, Any]) -> dict[str, Any] | None:
    """What `make_record` keeps under ``paper``; None of a rig that was calibrated otherwise."""
    figures = further.get(KEY, {}).get("paper")
    return None if figures is None else dict(figures)


def rig_of(fit: PaperFit, sizes: tuple[ImageSize, ImageSize], choices: Choices) -> Rig:
    """The rig with its quality, its depth range, and its record."""
    state, board = fit.state, choices[0]
    (camera, projector), record = sizes, make_record(fit, choices)
    depths = np.concatenate(
        [
            view.printed.kept_in_camera(pose)[:, 2]
            for view, pose in zip(fit.views, state.camera_from_board, strict=True)
        ]
    )
    return Rig(
        camera=Camera(camera.width, camera.height, Lens.from_vector(state.camera)),
        projector=Projector(projector.width, projector.height, Lens.from_vector(state.projector)),
        projector_from_camera=_pose(state.projector_from_camera),
        volume_mm=(float(depths.min()), float(depths.max())),
        quality=_quality(fit, sum(board.corner_count for _ in choices[2])),
        further={KEY: record},
        scale_sigma=scale_sigma(board),
    )


def make_record(fit: PaperFit, choices: Choices) -> dict[str, Any]:
    """JSON-able record as `record.make_record` writes it, with ``model`` and ``paper`` beside.

    ``paper`` holds the standard deviations over x and y that the paper reports, of both devices
    calibrated by themselves, the bound that feature points are held to, and counts by kind.
    """
    board, settings, failed = choices
    camera, projector, joint = _rms(fit, every=True)
    return {
        "model": "paper",
        "board": {"kind": kind_of(board), **asdict(board)},
        "settings": asdict(settings),
        "board_shape": dict.fromkeys(SHAPE_NAMES, 0.0),
        "paper": _figures(fit),
        "rms_of_all_px": {"camera": camera, "projector": projector, "joint": joint},
        "failed_captures": [{"name": name, "reason": reason} for name, reason in failed],
        "findings": [asdict(finding) for finding in _findings(fit, failed)],
        "left_out": [LEFT_OUT],
        "views": [_view(fit, place) for place in range(len(fit.views))],
    }


def _figures(fit: PaperFit) -> dict[str, Any]:
    kept = [
        part[view.printed.kept]
        for view, part in zip(fit.views, fit.camera_residual_px, strict=True)
    ]
    masks = {
        "printed": [view.printed.kept for view in fit.views],
        "projected": [view.projected.kept for view in fit.views],
    }
    return {
        "camera_std_px": np.concatenate(kept).std(axis=0).tolist(),
        "camera_std_of_all_px": np.concatenate(fit.camera_residual_px).std(axis=0).tolist(),
        "projector_std_px": fit.alone_px.tolist(),
        "largest_reprojection_px": KEPT_PX,
        **{f"{kind}_kept": int(np.concatenate(mask).sum()) for kind, mask in masks.items()},
        **{f"{kind}_offered": len(np.concatenate(mask)) for kind, mask in masks.items()},
        "projected_not_found": sum(view.projected.cut for view in fit.views),
    }


def _findings(fit: PaperFit, failed: Failed) -> list[Finding]:
    poses = fit.state.camera_from_board
    return [*not_used(failed), *alike_views(poses), *notice_distance(poses)]


def _view(fit: PaperFit, place: int) -> dict[str, Any]:
    view, residuals = fit.views[place], _residuals(fit, place)
    rows = _rows(view, fit.projected_mm[place])
    pose = fit.state.camera_from_board[place]
    kept = residuals[rows.kept]
    return {
        "name": view.name,
        "image": rows.image,
        "camera_from_board": {
            "rotation": rotation_matrix(pose[:3]).tolist(),
            "translation_mm": pose[3:].tolist(),
        },
        "camera_rms_px": _root_mean(kept[:, :2]),
        "projector_rms_px": _root_mean(kept[:, 2:]),
        "offered": len(rows.reasons),
        "kept": int(rows.kept.sum()),
        "left_out": rows.left_out,
        "reasons": list(rows.reasons),
        **{
            key: _plain(getattr(rows, key))
            for key in (
                "board_mm",
                "camera_px",
                "projector_px",
                "camera_sigma_px",
                "projector_sigma_px",
            )
        },
        "dense": None,
        "camera_residual_px": _plain(residuals[:, :2]),
        "projector_residual_px": _plain(residuals[:, 2:]),
    }


def _rows(view: PosedView, projected_mm: Array) -> View:
    """Printed corners, then projected ones, as one view."""
    printed, projected = view.printed, view.projected
    drawn = np.zeros_like(projected.projector_px)  # where they are in the projector is exact
    return View(
        name=view.name,
        board_mm=np.concatenate([printed.board_mm, projected_mm]),
        camera_px=np.concatenate([printed.camera_px, projected.camera_px]),
        projector_px=np.concatenate([printed.projector_px, projected.projector_px]),
        camera_sigma_px=np.concatenate([printed.camera_sigma_px, projected.camera_sigma_px]),
        projector_sigma_px=np.concatenate([printed.projector_sigma_px, drawn]),
        reasons=printed.reasons + projected.reasons,
        image=printed.image,
    )


def _residuals(fit: PaperFit, place: int) -> Array:
    """``(n + m, 4)`` px: camera x, y of the printed corners, projector x, y of the projected."""
    camera, projector = fit.camera_residual_px[place], fit.projector_residual_px[place]
    rows = np.full((len(camera) + len(projector), 4), np.nan)
    rows[: len(camera), :2], rows[len(camera) :, 2:] = camera, projector
    return rows


def _rms(fit: PaperFit, *, every: bool) -> tuple[float, float, float]:
    """Root mean squared distance, px: camera, projector, and over the corners of both kinds."""
    camera, projector = (
        np.concatenate([part[keep | every] for part, keep in zip(parts, masks, strict=True)])
        for parts, masks in (
            (fit.camera_residual_px, [view.printed.kept for view in fit.views]),
            (fit.projector_residual_px, [view.projected.kept for view in fit.views]),
        )
    )
    both = np.concatenate([camera, projector])
    return _root_mean(camera), _root_mean(projector), _root_mean(both)


def _root_mean(residuals: Array) -> float:
    """Root mean squared distance of ``(n, 2)``, void ones left out."""
    squares = np.sum(residuals**2, axis=1)
    return float(np.sqrt(np.mean(squares[np.isfinite(squares)])))


def _quality(fit: PaperFit, missing: int) -> Quality:
    """Over the kept corners; each printed and each projected corner is one observation."""
    camera, projector, joint = _rms(fit, every=False)
    reasons: Sequence[str] = [
        reason for view in fit.views for reason in view.printed.reasons + view.projected.reasons
    ]
    return Quality(
        camera_rms_px=camera,
        projector_rms_px=projector,
        joint_rms_px=joint,
        views_used=len(fit.views),
        observations_used=reasons.count(""),
        observations_offered=len(reasons) + missing,
    )


def _pose(values: Array) -> Pose:
    return Pose(rotation_matrix(values[:3]), values[3:].copy())


def _plain(values: Array) -> list[list[float | None]]:
    """Nested lists with None for NaN."""
    return [[float(x) if np.isfinite(x) else None for x in row] for row in values]
