"""Points for the extended fit: what a calibration's own captures say of its boards' planes.

The rig's record has the board's pose in each view and where its corners were seen. A camera
pixel's ray is cut with that plane; the capture, decoded again, says the projector coordinate there.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from fringeworks.calibrate.adjust.board_shape import BoardFrame, cut_rays
from fringeworks.calibrate.adjust.state import SHAPE_NAMES
from fringeworks.calibrate.dense import bright_parts
from fringeworks.calibrate.extended.fit import ExtendedFit, Mode, fit_extended
from fringeworks.calibrate.extended.planes import PlanePoints
from fringeworks.calibrate.local_fit import fit_local, robust_scale
from fringeworks.calibrate.projected.camera import KEPT_PX
from fringeworks.calibrate.record import ViewRecord, read_record
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.errors import CalibrationError
from fringeworks.geometry.lens import unproject
from fringeworks.kernels.paper_model import paper_depths
from fringeworks.model import Axis, Capture, CodedAxis, Extended, Rig
from fringeworks.phase.decode import decode_capture
from fringeworks.reconstruct.geometric import equation_of

Array = NDArray[np.float64]

MOST_PER_PLANE = 100_000
"""More pixels are thinned evenly: neighbours err alike, and say no more."""


WILD_SIGMAS = 6.0
"""Points whose depth is this far from their plane, beside the plane's others, are wrong orders."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Points of one or several planes, and the fringes that they were measured by."""

    points: PlanePoints
    axis: Axis
    period_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Boards:
    """A rig with its views and the board's surface in their frames."""

    rig: Rig
    views: dict[str, ViewRecord]
    surface: tuple[BoardFrame, Array]

    @classmethod
    def of(cls, rig: Rig) -> _Boards:
        record = read_record(rig.further)
        if record is None:
            raise CalibrationError(
                "the rig keeps no record of its calibration, so that the planes of its captures "
                "are not known: calibrate it again"
            )
        frame = BoardFrame.of(entry.view.board_mm for entry in record.views)
        shape = np.array([record.board_shape[name] for name in SHAPE_NAMES])
        return cls(rig, {entry.name: entry for entry in record.views}, (frame, shape))

    def depths(self, name: str, pixels: Array) -> tuple[Array, Array]:
        """Rays ``(2, n)`` of camera pixels ``(n, 2)``, and where they meet the board, mm."""
        rays = unproject(pixels, self.rig.camera.lens.vector)
        pose = self.views[name].camera_from_board
        depth, _ = cut_rays(
            np.column_stack([rays, np.ones(len(rays))]),
            np.vstack([pose.rotation, pose.translation_mm]),
            self.surface,
        )
        return np.ascontiguousarray(rays.T), depth


def fit_captures(
    captures: Iterable[Capture], rig: Rig, *, mode: Mode = "map", weighted: bool = False
) -> ExtendedFit:
    """`fit_extended` to the captures that a rig was calibrated from; see `measure_planes`."""
    found = measure_planes(captures, rig, mode=mode)
    return fit_extended(
        found.points,
        rig,
        axis=found.axis,
        period_px=found.period_px,
        mode=mode,
        weighted=weighted,
    )


def measure_planes(captures: Iterable[Capture], rig: Rig, *, mode: Mode = "map") -> Measured:
    """Points on the boards of a rig's own calibration captures.

    Parameters
    ----------
    captures
        Those it was calibrated from; others are passed over. One at a time is enough.
    mode
        "map" takes every decoded pixel of the board's bright parts, "paper" the feature points:
        the printed corners that are reprojected within 0.25 px.

    Returns
    -------
    measured
        By the finest fringes along x, or y where x is not coded.

    Raises
    ------
    CalibrationError
        The rig keeps no record, none of the captures is in it, the captures have fringes of
        several periods or none, or too few points are left.
    """
    boards = _Boards.of(rig)
    parts: list[Measured] = []
    for capture in captures:
        if capture.name in boards.views:
            parts.append(_measure(capture, boards, mode))
            _check_same(capture.name, parts[0], parts[-1])
        del capture  # the next one is read before the loop's name is bound anew
    if not parts:
        raise CalibrationError("none of the captures is one that the rig was calibrated from")
    plane = np.repeat(np.arange(len(parts)), [len(part.points) for part in parts])
    rays, coordinate, depth, sigma = (
        np.concatenate([getattr(part.points, key) for part in parts], axis=-1)
        for key in ("rays", "coordinate", "depth", "sigma")
    )
    points = PlanePoints(np.ascontiguousarray(rays), coordinate, depth, sigma, plane)
    return Measured(points, parts[0].axis, parts[0].period_px)


def _measure(capture: Capture, boards: _Boards, mode: Mode) -> Measured:
    coded = decode_capture(capture).axes[0]
    if coded.phase is None:
        raise CalibrationError(
            f"{capture.name}: along {coded.axis} there is a Gray code alone; the extended model "
            "needs fringes"
        )
    look = _features if mode == "paper" else _bright_pixels
    pixels, coordinate, sigma = look(coded, boards.views[capture.name])
    rays, depth = boards.depths(capture.name, pixels)
    fringe = coded.phase.fringe
    equation = equation_of(boards.rig, Extended(fringe.axis, fringe.period_px))
    measured, _ = paper_depths(rays, coordinate, equation)
    off = np.asarray(measured - depth)
    good = np.isfinite(off) & (depth > 0)
    off -= np.median(off[good])
    good &= np.abs(off) <= WILD_SIGMAS * robust_scale(off[good])
    points = PlanePoints(
        rays[:, good], coordinate[good], depth[good], sigma[good], np.zeros(good.sum(), np.intp)
    )
    return Measured(points, fringe.axis, fringe.period_px)


def _check_same(name: str, first: Measured, other: Measured) -> None:
    if (first.axis, first.period_px) != (other.axis, other.period_px):
        raise CalibrationError(
            f"{name}: its finest fringes are of {other.period_px:g} px along {other.axis}, those "
            f"of the captures before of {first.period_px:g} px along {first.axis}: the extended "
            "parameters belong to one of them"
        )


def _seen(view: ViewRecord) -> NDArray[np.bool_]:
    """``(n,)`` rows of the record that are printed corners which the camera saw."""
    return np.asarray(np.isfinite(view.camera_residual_px).all(axis=1))


def _square_px(corners: Array) -> float:
    """Distance, camera px, of a corner from the one next to it."""
    nearest = np.asarray(KDTree(corners).query(corners, k=[2])[0])
    return float(np.median(nearest))


def _bright_pixels(coded: CodedAxis, view: ViewRecord) -> tuple[Array, Array, Array]:
    """Pixels ``(n, 2)``, their coordinates and sigmas ``(n,)``, evenly thinned."""
    corners = view.view.camera_px[_seen(view)]
    bright = bright_parts(coded.modulation, corners, _square_px(corners))
    rows, columns = np.nonzero(bright & np.isfinite(coded.coordinate))
    some = slice(None, None, 1 + len(rows) // MOST_PER_PLANE)
    rows, columns = rows[some], columns[some]
    return (
        np.column_stack([columns, rows]).astype(np.float64),
        coded.coordinate[rows, columns].astype(np.float64),
        coded.sigma[rows, columns].astype(np.float64),
    )


def _features(coded: CodedAxis, view: ViewRecord) -> tuple[Array, Array, Array]:
    """The same at the printed corners that are reprojected within 0.25 px."""
    seen = _seen(view)
    near = np.hypot(*view.camera_residual_px[seen].T) <= KEPT_PX
    corners = view.view.camera_px[seen]
    radius = CalibrationSettings().window_squares * _square_px(corners)
    pixels = corners[near]
    fits = [fit_local(coded.coordinate, coded.sigma, at=at, radius=radius) for at in pixels]
    return (
        pixels,
        np.array([fit.value for fit in fits]),
        np.array([fit.sigma for fit in fits]),
    )
