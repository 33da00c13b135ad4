"""What a calibration keeps of itself in the rig's file, as plain values.

Enough to judge it, view by view, and to solve it again: `views_from_record` gives back the
observations that `calibrate_rig` had.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.bundle import Fit, all_residuals, rms_px
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.errors import FormatError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import CheckerboardTarget

Array = NDArray[np.float64]


def make_record(
    fit: Fit,
    views: Sequence[View],
    *,
    board: CheckerboardTarget,
    settings: CalibrationSettings,
    failed: Sequence[tuple[str, str]],
    findings: Sequence[str],
) -> dict[str, Any]:
    """JSON-able record of a calibration; void numbers are None.

    Per view: name, pose, root mean squared residuals of the kept corners, counts with reasons,
    and per corner the observations, their standard deviations and residuals, of those left out
    too. `rms_of_all_px` is over all corners that could be measured, kept or not.
    """
    residuals = all_residuals(fit.state, views)
    camera_rms, projector_rms, joint_rms = rms_px(residuals)
    return {
        "board": {"kind": "checkerboard", **asdict(board)},
        "settings": asdict(settings),
        "sigma_px": {"camera": fit.sigma_px[0], "projector": fit.sigma_px[1]},
        "rms_of_all_px": {"camera": camera_rms, "projector": projector_rms, "joint": joint_rms},
        "failed_captures": [{"name": name, "reason": reason} for name, reason in failed],
        "findings": list(findings),
        "views": [
            _view_record(view, pose, part)
            for view, pose, part in zip(views, fit.state.camera_from_board, residuals, strict=True)
        ],
    }


def views_from_record(record: Mapping[str, Any]) -> list[View]:
    """The views of a `make_record`, ready for `calibrate_rig`.

    Raises
    ------
    FormatError
        A key is missing or does not hold what `make_record` writes.
    """
    try:
        return [_view_from(entry) for entry in record["views"]]
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(
            f"the rig's record of its calibration is incomplete: {error!r}"
        ) from error


def _view_record(view: View, pose: Array, residuals: Array) -> dict[str, Any]:
    camera_rms, projector_rms, _ = rms_px([residuals[view.kept]])
    return {
        "name": view.name,
        "image": view.image,
        "camera_from_board": {
            "rotation": rotation_matrix(pose[:3]).tolist(),
            "translation_mm": pose[3:].tolist(),
        },
        "camera_rms_px": camera_rms,
        "projector_rms_px": projector_rms,
        "offered": len(view.reasons),
        "kept": int(view.kept.sum()),
        "left_out": view.left_out,
        "reasons": list(view.reasons),
        "board_mm": _plain(view.board_mm),
        "camera_px": _plain(view.camera_px),
        "projector_px": _plain(view.projector_px),
        "camera_sigma_px": _plain(view.camera_sigma_px),
        "projector_sigma_px": _plain(view.projector_sigma_px),
        "camera_residual_px": _plain(residuals[:, :2]),
        "projector_residual_px": _plain(residuals[:, 2:]),
    }


def _view_from(entry: Mapping[str, Any]) -> View:
    return View(
        name=str(entry["name"]),
        board_mm=_array(entry["board_mm"], 3),
        camera_px=_array(entry["camera_px"], 2),
        projector_px=_array(entry["projector_px"], 2),
        camera_sigma_px=_array(entry["camera_sigma_px"], 2),
        projector_sigma_px=_array(entry["projector_sigma_px"], 2),
        reasons=tuple(str(reason) for reason in entry["reasons"]),
        image=str(entry["image"]),
    )


def _plain(values: Array) -> list[list[float | None]]:
    """Nested lists with None for NaN."""
    return [[float(x) if np.isfinite(x) else None for x in row] for row in values]


def _array(rows: Sequence[Sequence[float | None]], width: int) -> Array:
    return np.array(rows, dtype=np.float64).reshape(-1, width)
