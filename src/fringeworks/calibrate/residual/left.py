"""What a model leaves of the sites of a rig's own calibration.

The record has the board's pose in each view and sites all over it: camera pixels at which the
decoded maps say where in the projector their light comes from. A pixel's ray is cut with the
board, and the model says which coordinate that point has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.board_shape import BoardFrame, cut_rays
from fringeworks.calibrate.adjust.state import SHAPE_NAMES
from fringeworks.calibrate.record import CalibrationRecord, ViewRecord, read_record
from fringeworks.errors import CalibrationError, UsageError
from fringeworks.geometry.lens import project, unproject
from fringeworks.kernels.paper_model import Equation, extended_ray, turned_ray
from fringeworks.model import AXES, Axis, Lens, ModelName, Rig
from fringeworks.reconstruct.geometric import equation_of

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Left:
    """Residuals of n sites.

    Attributes
    ----------
    places
        ``(n, 3)`` camera px u and v, and the measured coordinate, projector px.
    residual
        ``(n,)`` measured coordinate less the model's, px.
    sigma
        ``(n,)`` standard deviation of the measured one, px.
    view
        ``(n,)`` which view each was seen in.
    """

    places: Array
    residual: Array
    sigma: Array
    view: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.residual)

    def only(self, chosen: NDArray[np.bool_]) -> Left:
        """The chosen ones, by a mask ``(n,)``."""
        return Left(
            self.places[chosen], self.residual[chosen], self.sigma[chosen], self.view[chosen]
        )


def find_left(rig: Rig, model: ModelName, axis: Axis) -> Left:
    """What a model of the rig leaves along an axis.

    Raises
    ------
    CalibrationError
        The rig keeps no record of its calibration, or no sites in it.
    UsageError
        The extended model is asked for and the rig has none along this axis.
    """
    record = read_record(rig.further)
    if record is None:
        raise CalibrationError(
            "the rig keeps no record of its calibration, so that nobody knows what its model "
            "leaves: calibrate it again"
        )
    views = [entry for entry in record.views if entry.view.dense is not None]
    if not views:
        raise CalibrationError(
            "the rig's calibration has no sites beside the corners, too few for a residual field"
        )
    surface = _surface_of(record)
    parts = [_left_of(rig, model, axis, (entry, surface)) for entry in views]
    places, residual, sigma = (np.concatenate(part) for part in zip(*parts, strict=True))
    count = [len(part[1]) for part in parts]
    left = Left(places, residual, sigma, np.repeat(np.arange(len(parts)), count))
    return left.only(np.isfinite(residual))


def _surface_of(record: CalibrationRecord) -> tuple[BoardFrame, Array]:
    frame = BoardFrame.of(entry.view.board_mm for entry in record.views)
    return frame, np.array([record.board_shape[name] for name in SHAPE_NAMES])


def _left_of(
    rig: Rig, model: ModelName, axis: Axis, seen: tuple[ViewRecord, tuple[BoardFrame, Array]]
) -> tuple[Array, Array, Array]:
    entry, surface = seen
    sites, pose, place = entry.view.sites, entry.camera_from_board, AXES.index(axis)
    ideal = unproject(sites.camera_px, rig.camera.lens.vector)
    rays = np.column_stack([ideal, np.ones(len(ideal))])
    depth, _ = cut_rays(rays, np.vstack([pose.rotation, pose.translation_mm]), surface)
    measured = sites.projector_px[:, place]
    expected = _coordinates(rig, model, axis, rays * depth[:, None])
    return (
        np.column_stack([sites.camera_px, measured]),
        measured - expected,
        sites.sigma_px[:, place],
    )


def _coordinates(rig: Rig, model: ModelName, axis: Axis, points: Array) -> Array:
    """``(n,)`` projector px that a model gives points ``(n, 3)``, mm, camera frame."""
    if model == "extended":
        if rig.extended is None or rig.extended.axis != axis:
            raise UsageError(f"the rig has no extended parameters along {axis}")
        return _coordinates_by_phase(points, equation_of(rig, rig.extended))
    lens = rig.projector.lens if model == "full" else _pinhole(rig.projector.lens)
    return project(rig.projector_from_camera.apply(points), lens.vector)[:, AXES.index(axis)]


def _pinhole(lens: Lens) -> Lens:
    return replace(lens, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0)


def _coordinates_by_phase(points: Array, equation: Equation) -> Array:
    """Equation 4 the other way: with z less Kz known, ``F A - w B = z (F C - w D)`` gives w."""
    x, y, z = points.T
    c, d = turned_ray(*extended_ray(x / z, y / z, equation), equation)
    inner = z - equation.offset
    w = equation.focal * (equation.a - inner * c) / (equation.b - inner * d)
    return np.asarray((w - equation.phase) / equation.per_px + equation.centre)
