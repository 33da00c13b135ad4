"""What a calibration keeps of itself in the rig's file, as plain values.

Enough to judge it, view by view, and to solve it again: `read_record` gives back the observations
that `calibrate_rig` had.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from fringeworks.calibrate.adjust.bundle import Fit, all_residuals, rms_px
from fringeworks.calibrate.adjust.state import SHAPE_NAMES
from fringeworks.calibrate.judge.cross_validate import Trial
from fringeworks.calibrate.judge.halves import Halves
from fringeworks.calibrate.judge.uncertainty import DEPTHS
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.record_schema import HalvesTable, RecordTable, SitesTable, ViewTable
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.calibrate.sites import Sites
from fringeworks.errors import FormatError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Finding, Pose, Target, kind_of

Array = NDArray[np.float64]

KEY = "calibration"
"""Where `Rig.further` keeps the record."""

DAMAGED = "the rig's record of its calibration is damaged"


@dataclass(frozen=True, slots=True, eq=False)
class ViewRecord:
    """One view of a calibration.

    Attributes
    ----------
    view
        What both devices saw.
    camera_from_board
        The board's pose.
    camera_rms_px, projector_rms_px
        Root mean squared distance of the kept corners.
    camera_residual_px, projector_residual_px
        ``(n, 2)`` measured minus projected px of all corners, left out or not; NaN where void.
    """

    view: View
    camera_from_board: Pose
    camera_rms_px: float
    projector_rms_px: float
    camera_residual_px: Array
    projector_residual_px: Array

    @property
    def name(self) -> str:
        return self.view.name

    @property
    def kept_count(self) -> int:
        return int(self.view.kept.sum())

    @property
    def offered_count(self) -> int:
        return len(self.view.reasons)


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationRecord:
    """What `make_record` wrote, as far as anybody reads it.

    Attributes
    ----------
    rms_of_all_px
        Camera, projector and both over all corners, kept or not.
    failed_captures
        As (name, reason).
    board_shape
        Of the board, by name; zeros where it was taken as flat.
    k3
        What came of setting it free, device by device; none where it was not tried.
    halves
        Two halves of the views compared; None where they were not.
    left_out
        What could not be told, each with its reason.
    """

    views: tuple[ViewRecord, ...]
    rms_of_all_px: tuple[float, float, float]
    findings: tuple[Finding, ...]
    failed_captures: tuple[tuple[str, str], ...]
    board_shape: Mapping[str, float]
    k3: tuple[Trial, ...] = ()
    halves: Halves | None = None
    left_out: tuple[str, ...] = ()


def make_record(
    fit: Fit,
    views: Sequence[View],
    *,
    board: Target,
    settings: CalibrationSettings,
    failed: Sequence[tuple[str, str]],
    findings: Sequence[Finding],
    k3: Sequence[Trial] = (),
    halves: Halves | str | None = None,
) -> dict[str, Any]:
    """JSON-able record of a calibration; void numbers are None.

    Per view: name, pose, root mean squared residuals of the kept corners, counts with reasons,
    and per corner the observations, their standard deviations and residuals, of those left out
    too. `rms_of_all_px` is over all corners that could be measured, kept or not. For `halves` a
    sentence may say why there are none.
    """
    residuals = all_residuals(fit.state, views)
    camera_rms, projector_rms, joint_rms = rms_px(residuals)
    return {
        "board": {"kind": kind_of(board), **asdict(board)},
        "settings": asdict(settings),
        "sigma_px": asdict(fit.spread),
        "board_shape": dict(zip(SHAPE_NAMES, fit.state.board_shape.tolist(), strict=True)),
        "rms_of_all_px": {"camera": camera_rms, "projector": projector_rms, "joint": joint_rms},
        "failed_captures": [{"name": name, "reason": reason} for name, reason in failed],
        "findings": [asdict(finding) for finding in findings],
        "k3": [asdict(trial) for trial in k3],
        "halves": _plain_halves(halves) if isinstance(halves, Halves) else None,
        "left_out": [halves] if isinstance(halves, str) else [],
        "views": [
            _view_record(view, pose, part)
            for view, pose, part in zip(views, fit.state.camera_from_board, residuals, strict=True)
        ],
    }


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
        "dense": None if view.dense is None else _plain_sites(view.dense),
        "camera_residual_px": _plain(residuals[:, :2]),
        "projector_residual_px": _plain(residuals[:, 2:]),
    }


def _plain_halves(halves: Halves) -> dict[str, Any]:
    """Numbers first, for who reads the file; maps to four digits."""
    maps = {
        "difference_mm": _rounded(halves.difference_mm),
        "predicted_mm": _rounded(halves.predicted_mm),
    }
    return {**halves.numbers, **maps}


def _rounded(maps: Array) -> list[list[list[float | None]]]:
    return [
        [[float(f"{x:.4g}") if np.isfinite(x) else None for x in row] for row in m] for m in maps
    ]


def _plain_sites(sites: Sites) -> dict[str, list[list[float]]]:
    """Rounded to a thousandth of what a site can tell: there are thousands of them."""
    return {key: np.round(values, 5).tolist() for key, values in asdict(sites).items()}


def _plain(values: Array) -> list[list[float | None]]:
    """Nested lists with None for NaN."""
    return [[float(x) if np.isfinite(x) else None for x in row] for row in values]


def read_record(further: Mapping[str, Any]) -> CalibrationRecord | None:
    """The record in `Rig.further`; None where the rig keeps none.

    Raises
    ------
    FormatError
        Naming the key that is missing or does not hold what `make_record` writes.
    """
    if KEY not in further:
        return None
    try:
        table = RecordTable.model_validate(further[KEY])
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        key = ".".join(str(part) for part in (KEY, *first["loc"]))
        raise FormatError(f"{DAMAGED}: {key}: {first['msg']}") from error
    over_all = table.rms_of_all_px
    return CalibrationRecord(
        views=tuple(_read_view(view, index) for index, view in enumerate(table.views)),
        rms_of_all_px=(over_all.camera, over_all.projector, over_all.joint),
        findings=tuple(table.findings),
        failed_captures=tuple((failed.name, failed.reason) for failed in table.failed_captures),
        board_shape=table.board_shape,
        k3=tuple(table.k3),
        halves=None if table.halves is None else _read_halves(table.halves),
        left_out=tuple(table.left_out),
    )


def _read_halves(table: HalvesTable) -> Halves:
    try:
        maps = np.array([table.difference_mm, table.predicted_mm], dtype=np.float64)
    except ValueError:  # rows of several lengths
        maps = np.empty(0)
    if maps.ndim != 4 or maps.shape[1] != DEPTHS:
        raise FormatError(
            f"{DAMAGED}: {KEY}.halves must hold two maps of one shape at {DEPTHS} depths"
        )
    if not np.nansum(maps[1]) > 0 or not np.isfinite(maps[0]).any():
        raise FormatError(f"{DAMAGED}: {KEY}.halves must hold distances that are known, above 0")
    return Halves(*maps)


def _read_sites(table: SitesTable, index: int) -> Sites:
    parts = [np.array(values) for values in (table.camera_px, table.projector_px, table.sigma_px)]
    if not len(parts[0]) == len(parts[1]) == len(parts[2]) > 0:
        raise FormatError(
            f"{DAMAGED}: {KEY}.views.{index}.dense must have "
            f"as many projector_px and sigma_px as camera_px, and at least one"
        )
    return Sites(*parts)


def _read_view(table: ViewTable, index: int) -> ViewRecord:
    count = len(table.reasons)

    def array(key: str) -> Array:
        """``(n, 2)`` or ``(n, 3)``, NaN for None."""
        values = np.array(getattr(table, key), dtype=np.float64)
        if len(values) != count or not count:
            raise FormatError(
                f"{DAMAGED}: {KEY}.views.{index}.{key} must "
                f"have a row for each of the {count} reasons, got {len(values)}"
            )
        return values

    pose = table.camera_from_board
    return ViewRecord(
        view=View(
            name=table.name,
            board_mm=array("board_mm"),
            camera_px=array("camera_px"),
            projector_px=array("projector_px"),
            camera_sigma_px=array("camera_sigma_px"),
            projector_sigma_px=array("projector_sigma_px"),
            reasons=tuple(table.reasons),
            image=table.image,
            dense=None if table.dense is None else _read_sites(table.dense, index),
        ),
        camera_from_board=Pose(np.array(pose.rotation), np.array(pose.translation_mm)),
        camera_rms_px=table.camera_rms_px,
        projector_rms_px=table.projector_rms_px,
        camera_residual_px=array("camera_residual_px"),
        projector_residual_px=array("projector_residual_px"),
    )
