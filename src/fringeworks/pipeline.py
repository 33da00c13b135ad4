"""The straight line, end to end: read this file first.

    capture --demodulate, unwrap--> projector map --triangulate--> cloud --measure--> numbers
    captures of a board --observe, solve--> rig

Each step is a pure function of one room; here they only follow each other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from fringeworks.errors import ShapeError, UsageError
from fringeworks.files.response import response_of_rig
from fringeworks.geometry.forms import (
    ConeFit,
    CylinderFit,
    PlaneFit,
    SphereFit,
    fit_cone,
    fit_cylinder,
    fit_plane,
    fit_sphere,
)
from fringeworks.measure.board import BoardPlane, BoardSpacing, corner_spacing, fit_board
from fringeworks.measure.region import Region, select_points
from fringeworks.measure.weights import normal_sigma
from fringeworks.model import (
    Axis,
    Capture,
    Cloud,
    ModelName,
    ProjectorMap,
    Response,
    Rig,
    Target,
)
from fringeworks.phase.decode import Decoding, decode_phases
from fringeworks.phase.demodulate import MaskRules
from fringeworks.phase.exposures import notice_exposures
from fringeworks.phase.gloss import notice_one_period
from fringeworks.phase.methods import OrdersName
from fringeworks.phase.response import choose_response, notice_response
from fringeworks.phase.window import volume_of
from fringeworks.reconstruct.full import CloudRules, triangulate
from fringeworks.reconstruct.fused import scan_fused
from fringeworks.reconstruct.fused_plan import prepare_scan
from fringeworks.reconstruct.geometric import triangulate_by_phase
from fringeworks.reconstruct.masks import mask_edges
from fringeworks.reconstruct.residual import fields_of, notice_fields, take_residuals

Form = TypeVar("Form", PlaneFit, SphereFit, CylinderFit, ConeFit)


def scan(
    capture: Capture,
    rig: Rig,
    *,
    group: str | None = None,
    orders: OrdersName = "auto",
    mask_rules: MaskRules | None = None,
    cloud_rules: CloudRules | None = None,
    model: ModelName = "full",
    response: Response | None = None,
) -> Cloud:
    """Capture to cloud, in the camera's frame; in one pass over the frames where that can be.

    `response` is taken from images or phases; without it the rig's own, where that fits.
    """
    capture, kept = capture.select(group), response_of_rig(rig)
    used = choose_response(capture, response, kept)
    plain = used is None and not (mask_rules and mask_rules.other_light)
    if model == "full" and plain and not fields_of(rig, model):
        plan = prepare_scan(
            capture, rig, orders=orders, mask_rules=mask_rules, cloud_rules=cloud_rules
        )
        cloud = None if plan is None else scan_fused(plan, capture, rig)
        if plan is not None and cloud is not None:
            findings = (*cloud.findings, *notice_response(capture, used, kept))
            cloud = replace(cloud, findings=findings)
            return finish_cloud(cloud, rig, axis=plan.axis, rules=cloud_rules)
    cloud, _ = scan_stages(
        capture,
        rig,
        orders=orders,
        mask_rules=mask_rules,
        cloud_rules=cloud_rules,
        model=model,
        response=response,
    )
    return cloud


def scan_stages(
    capture: Capture,
    rig: Rig,
    *,
    orders: OrdersName = "auto",
    mask_rules: MaskRules | None = None,
    cloud_rules: CloudRules | None = None,
    model: ModelName = "full",
    response: Response | None = None,
) -> tuple[Cloud, Decoding]:
    """The same cloud one stage after the other, and what was decoded on the way."""
    volume = volume_of(rig, cloud_rules.z_range_mm if cloud_rules else None)
    kept = response_of_rig(rig)
    used = choose_response(capture, response, kept)
    decoding = decode_phases(capture, rules=mask_rules, orders=orders, volume=volume, response=used)
    cloud = cloud_of(capture, decoding.projector_map(), rig, rules=cloud_rules, model=model)
    fused = notice_exposures(decoding.finest)
    other = mask_rules is not None and mask_rules.other_light
    blind = notice_one_period(capture.sequence.sets) if other else ()
    findings = (*cloud.findings, *notice_response(capture, used, kept), *fused, *blind)
    return replace(cloud, findings=findings), decoding


def cloud_of(
    capture: Capture,
    projector_map: ProjectorMap,
    rig: Rig,
    *,
    rules: CloudRules | None = None,
    model: ModelName = "full",
) -> Cloud:
    """The cloud of a capture that is decoded already.

    Raises
    ------
    ShapeError
        The capture's projector is not of the size of the rig's; or as `triangulate`.
    UsageError
        The extended model is asked for and the rig has none; or as `triangulate_by_phase`.
    """
    shown, known = capture.sequence, rig.projector
    if (shown.width, shown.height) != (known.width, known.height):
        raise ShapeError(
            f"the capture's projector must be {known.width}x{known.height} like the rig's, "
            f"got {shown.width}x{shown.height}"
        )
    projector_map = take_residuals(projector_map, rig, model)
    if model != "full":
        cloud = _cloud_by_phase(capture, projector_map, rig, rules=rules, model=model)
        return replace(cloud, findings=(*cloud.findings, *notice_fields(rig, model)))
    cloud = triangulate(
        projector_map, rig, intensity=capture.white(), colour=capture.colour, rules=rules
    )
    cloud = replace(cloud, findings=(*cloud.findings, *notice_fields(rig, model)))
    alone = projector_map.axes[0].axis if len(projector_map.axes) == 1 else None
    return finish_cloud(cloud, rig, axis=alone, rules=rules)


def _cloud_by_phase(
    capture: Capture,
    projector_map: ProjectorMap,
    rig: Rig,
    *,
    rules: CloudRules | None,
    model: ModelName,
) -> Cloud:
    """By the paper's models; what its calibration leaves open is told of the full model alone."""
    if model == "extended" and rig.extended is None:
        raise UsageError(
            "the rig has no extended parameters: calibrate with --extended map (or paper), or "
            "scan with --model geometric or full"
        )
    cloud = triangulate_by_phase(
        projector_map,
        rig,
        extended=rig.extended if model == "extended" else None,
        intensity=capture.white(),
        colour=capture.colour,
        rules=rules,
    )
    edges = (rules or CloudRules()).edges
    return cloud if edges is None else mask_edges(cloud, rig, edges)


def finish_cloud(
    cloud: Cloud, rig: Rig, *, axis: Axis | None = None, rules: CloudRules | None = None
) -> Cloud:
    """The triangulated cloud without its edges, and with what the calibration leaves open.

    `axis` is the one that alone was used, None where both were.
    """
    rules = rules or CloudRules()
    if rules.edges is not None:
        cloud = mask_edges(cloud, rig, rules.edges)
    if "covariance" not in rig.further:
        return cloud
    from fringeworks.uncertainty.points import add_systematic  # loads what calibrates

    return add_systematic(cloud, rig, axis=rules.axis or axis)


def measure_plane(
    cloud: Cloud, region: Region | None = None, *, weighted: bool = False
) -> PlaneFit:
    """Orthogonal least-squares plane through the region's points.

    `weighted` weighs each point by its random sigma along the normal (`measure.weights`).
    """
    return _measure(fit_plane, cloud, region, weighted=weighted)


def measure_sphere(
    cloud: Cloud, region: Region | None = None, *, weighted: bool = False
) -> SphereFit:
    """Orthogonal least-squares sphere through the region's points; see `measure_plane`."""
    return _measure(fit_sphere, cloud, region, weighted=weighted)


def measure_cylinder(
    cloud: Cloud, region: Region | None = None, *, weighted: bool = False
) -> CylinderFit:
    """Orthogonal least-squares cylinder through the region's points; see `measure_plane`."""
    return _measure(fit_cylinder, cloud, region, weighted=weighted)


def measure_cone(cloud: Cloud, region: Region | None = None, *, weighted: bool = False) -> ConeFit:
    """Orthogonal least-squares cone through the region's points; see `measure_plane`."""
    return _measure(fit_cone, cloud, region, weighted=weighted)


def _measure(
    fit: Callable[..., Form], cloud: Cloud, region: Region | None, *, weighted: bool
) -> Form:
    points = select_points(cloud, region or Region())
    found = fit(points)
    return fit(points, sigma_mm=normal_sigma(cloud, region, found)) if weighted else found


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
