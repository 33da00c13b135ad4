"""The straight line, end to end: read this file first.

    capture --demodulate, unwrap--> projector map --triangulate--> cloud --measure--> numbers
    captures of a board --observe, solve--> rig

Each step is a pure function of one room; here they only follow each other.
"""

from __future__ import annotations

from fringeworks.errors import ShapeError
from fringeworks.geometry.forms import (
    CylinderFit,
    PlaneFit,
    SphereFit,
    fit_cylinder,
    fit_plane,
    fit_sphere,
)
from fringeworks.measure.board import BoardPlane, BoardSpacing, corner_spacing, fit_board
from fringeworks.measure.region import Region, select_points
from fringeworks.model import Capture, Cloud, ProjectorMap, Rig, Target
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.demodulate import MaskRules
from fringeworks.phase.methods import OrdersName
from fringeworks.phase.window import volume_of
from fringeworks.reconstruct.full import CloudRules, triangulate


def scan(
    capture: Capture,
    rig: Rig,
    *,
    group: str | None = None,
    orders: OrdersName = "auto",
    mask_rules: MaskRules | None = None,
    cloud_rules: CloudRules | None = None,
) -> Cloud:
    """Capture to cloud, in the camera's frame, with the full model."""
    capture = capture.select(group)
    volume = volume_of(rig, cloud_rules.z_range_mm if cloud_rules else None)
    projector_map = decode_capture(capture, rules=mask_rules, orders=orders, volume=volume)
    return cloud_of(capture, projector_map, rig, rules=cloud_rules)


def cloud_of(
    capture: Capture, projector_map: ProjectorMap, rig: Rig, *, rules: CloudRules | None = None
) -> Cloud:
    """The cloud of a capture that is decoded already.

    Raises
    ------
    ShapeError
        The capture's projector is not of the size of the rig's; or as `triangulate`.
    """
    shown, known = capture.sequence, rig.projector
    if (shown.width, shown.height) != (known.width, known.height):
        raise ShapeError(
            f"the capture's projector must be {known.width}x{known.height} like the rig's, "
            f"got {shown.width}x{shown.height}"
        )
    return triangulate(
        projector_map, rig, intensity=capture.white(), colour=capture.colour, rules=rules
    )


def measure_plane(cloud: Cloud, region: Region | None = None) -> PlaneFit:
    """Orthogonal least-squares plane through the region's points."""
    return fit_plane(select_points(cloud, region or Region()))


def measure_sphere(cloud: Cloud, region: Region | None = None) -> SphereFit:
    """Orthogonal least-squares sphere through the region's points."""
    return fit_sphere(select_points(cloud, region or Region()))


def measure_cylinder(cloud: Cloud, region: Region | None = None) -> CylinderFit:
    """Orthogonal least-squares cylinder through the region's points."""
    return fit_cylinder(select_points(cloud, region or Region()))


def measure_board(
    cloud: Cloud, rig: Rig, board: Target, *, view: str
) -> tuple[BoardSpacing, BoardPlane] | None:
    """A board's squares and plane on its cloud, where the rig was calibrated from `view`.

    The corners' pixels are those of the calibration; None if it did not use that view, or saw
    a part of the board alone.
    """
    from fringeworks.calibrate.record import read_record  # a scan need not load what calibrates

    record = read_record(rig.further)
    views = () if record is None else record.views
    corners = next((entry.view.camera_px for entry in views if entry.name == view), None)
    if corners is None or len(corners) != board.corner_count:
        return None
    grid = {"columns": board.columns, "rows": board.rows}
    return corner_spacing(cloud, corners, **grid), fit_board(cloud, corners, **grid)
