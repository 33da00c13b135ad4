"""The paper's model, section 2 (geometric) and 3.2 (extended): depth from one axis, no iteration.

The projector is a pinhole: its distortion is ignored, as in the paper, which leaves 0.1 to 0.3 mm
on a rig that has any (docs/extended.md). The camera's distortion is taken out of the ray. x and y
are the calibrated ray's; with the extended D1 and D2 in equations 2 and 3 a cloud is sheared by
Ku0 / f and scaled by Kfc / f.
"""

from __future__ import annotations

import numpy as np

from fringeworks.errors import DecodeError, UsageError
from fringeworks.kernels.paper_model import TURN, Equation
from fringeworks.kernels.paper_model import triangulate_by_phase as triangulate_kernel
from fringeworks.model import (
    Axis,
    Cloud,
    CodedAxis,
    Extended,
    FloatMap,
    Frames,
    ProjectorMap,
    Rig,
)
from fringeworks.reconstruct.full import (
    CloudRules,
    check_size,
    depth_window,
    no_point_message,
    notice_misfits,
)
from fringeworks.reconstruct.masks import reasons_of


def triangulate_by_phase(
    projector_map: ProjectorMap,
    rig: Rig,
    *,
    extended: Extended | None = None,
    intensity: FloatMap | None = None,
    colour: Frames | None = None,
    rules: CloudRules | None = None,
    literal: bool = False,
) -> Cloud:
    """Cloud in the camera's frame by equations 1 to 3, or 4 to 7 with `extended`.

    Parameters
    ----------
    projector_map
        One axis is used: that of `extended`, else the rules', else x where it is coded.
    extended
        Fitted with this rig, to fringes of this axis and period; None is all zero.
    intensity, colour
        What the points look like; `intensity` defaults to the axis's offset.
    literal
        x and y as the paper prints them, from the extended D1 and D2.

    Returns
    -------
    cloud
        With `sigma_mm` from the coordinate's sigma and the model's own slope; no epipolar residual.

    Raises
    ------
    ShapeError
        The map's size is not the rig's camera's.
    UsageError
        `extended` belongs to another axis or period, the rules ask for an axis that is not coded
        or for an empty depth range.
    DecodeError
        No point is left.
    """
    rules = rules or CloudRules()
    check_size(projector_map, rig)
    window = depth_window(rig, rules)
    coded = _chosen_axis(projector_map, rules.axis, extended)
    extended = extended or Extended(coded.axis, period_px=_period(coded) or TURN)
    xyz = np.empty((*projector_map.shape, 3), np.float32)
    sigma = np.empty(projector_map.shape, np.float32)
    triangulate_kernel(
        coded.coordinate,
        coded.sigma,
        rig.camera.lens.vector,
        equation_of(rig, extended),
        window,
        literal,
        xyz,
        sigma,
    )
    if not np.isfinite(sigma).any():
        raise DecodeError(no_point_message(projector_map, window))
    return Cloud(
        xyz,
        sigma,
        coded.offset if intensity is None else intensity,
        np.full_like(sigma, np.nan),
        colour,
        scale_sigma=rig.scale_sigma,
        findings=notice_misfits(projector_map),
        reason=reasons_of([coded.coordinate], sigma),
    )


def equation_of(rig: Rig, extended: Extended) -> Equation:
    """Rig and ten parameters in the letters of `kernels.paper_model`."""
    pose, camera, projector = rig.projector_from_camera, rig.camera.lens, rig.projector.lens
    row, per_px = (0 if extended.axis == "x" else 1), TURN / extended.period_px
    focal, centre = (
        (projector.fx, projector.cx) if extended.axis == "x" else (projector.fy, projector.cy)
    )
    along, ahead = pose.rotation[row].tolist(), pose.rotation[2].tolist()
    x_focal, y_focal = camera.fx + extended.Kfc, camera.fy + extended.Kfc
    return Equation(
        per_px=per_px,
        centre=centre,
        phase=extended.Kphi,
        focal=(focal + extended.Kfp) * per_px,
        a=float(-pose.translation_mm[row]) + extended.C1,
        b=float(-pose.translation_mm[2]) + extended.C2,
        along=(along[0], along[1], along[2] + extended.C3),
        ahead=(ahead[0], ahead[1], ahead[2] + extended.C4),
        x_shift=extended.Ku0 / camera.fx,
        y_shift=extended.Kv0 / camera.fy,
        x_scale=camera.fx / x_focal,
        y_scale=camera.fy / y_focal,
        x_focal=x_focal,
        y_focal=y_focal,
        offset=extended.Kz,
    )


def _chosen_axis(
    projector_map: ProjectorMap, asked: Axis | None, extended: Extended | None
) -> CodedAxis:
    """The axis to use, which `extended` must be of."""
    wanted = asked or (extended.axis if extended else None)
    coded = {axis.axis: axis for axis in projector_map.axes}
    if wanted not in (None, *coded):
        raise UsageError(
            f"axis must be one that the capture codes ({', '.join(coded)}), got {wanted}"
        )
    chosen = projector_map.axes[0] if wanted is None else coded[wanted]
    if extended is not None:
        _check_belongs(extended, chosen)
    return chosen


def _check_belongs(extended: Extended, coded: CodedAxis) -> None:
    period = _period(coded)
    if extended.axis == coded.axis and extended.period_px == period:
        return
    has = "a Gray code alone" if period is None else f"fringes of {period:g} px"
    raise UsageError(
        f"the rig's extended parameters belong to fringes of {extended.period_px:g} px along "
        f"{extended.axis}, the capture has {has} along {coded.axis}: calibrate with --extended "
        "from captures of these fringes, or scan with --model full"
    )


def _period(coded: CodedAxis) -> float | None:
    return None if coded.phase is None else coded.phase.fringe.period_px
