"""Points that a cloud is better without: mixed pixels at edges, and grazing incidence.

A pixel on an edge sees both of its sides, and its phase is that of neither: its point hangs
between two surfaces, or beside the only one. The phase cannot tell (its modulation is good), the
neighbours can, see `kernels.masks`. Valid-point detection after Feng, Chen, Zuo and Gu (Optics
Express 23, 7535, 2015) works on modulation and phase alike; here it works on the cloud, so that it
holds for every model and whatever the orders came from.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from fringeworks.errors import DecodeError, UsageError
from fringeworks.kernels.masks import judge_marks, judge_slopes, mark_beside, mark_edges
from fringeworks.model import Cloud, FloatMap, Reason, Rig
from fringeworks.model.cloud import ReasonMap, describe_reasons

Three: TypeAlias = tuple[np.float32, np.float32, np.float32]
Four: TypeAlias = tuple[np.float32, np.float32, np.float32, np.float32]


@dataclass(frozen=True, slots=True)
class EdgeRules:
    """What a point must do to stay beside an edge or on a slope.

    Attributes
    ----------
    grazing_cos
        Least cosine of the angle between the surface's normal and the ray of either device,
        above 0 and below 1. A link between neighbours that is steeper is a jump.
    jump_sigmas
        By how many sigma of both ends a link must be steeper.
    fade_share
        A pixel beside a void is mixed where it is darker than this share of the one behind it.
    """

    grazing_cos: float = 0.1
    jump_sigmas: float = 5.0
    fade_share: float = 0.75

    def __post_init__(self) -> None:
        if not 0 < self.grazing_cos < 1:
            raise UsageError(f"grazing_cos must be in (0, 1), got {self.grazing_cos:g}")
        if not self.jump_sigmas >= 0:
            raise UsageError(f"jump_sigmas must be 0 or more, got {self.jump_sigmas:g}")
        if not 0 <= self.fade_share <= 1:
            raise UsageError(f"fade_share must be in [0, 1], got {self.fade_share:g}")


def reasons_of(coordinates: Sequence[FloatMap], sigma_mm: FloatMap) -> ReasonMap:
    """``(H, W)`` `Reason` of each pixel, as far as what was triangulated tells.

    Parameters
    ----------
    coordinates
        The projector coordinates that were used, px; NaN where not decoded.
    sigma_mm
        Of the points that they gave; NaN where there is none in the depth window.
    """
    reason = np.isnan(sigma_mm).view(np.uint8) * np.uint8(Reason.OUTSIDE)
    for coordinate in coordinates:
        reason[np.isnan(coordinate)] = Reason.NOT_DECODED
    return reason


def mask_edges(cloud: Cloud, rig: Rig, rules: EdgeRules | None = None) -> Cloud:
    """The cloud without mixed pixels and without grazing incidence.

    Parameters
    ----------
    cloud
        In the camera's frame, on its grid. Its arrays are written to: points that go become NaN.
    rig
        The rig that made it. The camera's distortion, a few percent of a slope, is left out.
    rules
        Limits.

    Returns
    -------
    Cloud
        Of the same arrays, with `Cloud.reason`.

    Raises
    ------
    DecodeError
        No point is left.
    """
    rules = rules or EdgeRules()
    steepness, lens, view = _as_kernels_take_them(rules, rig)
    depth, sigma = np.ascontiguousarray(cloud.xyz[..., 2]), cloud.sigma_mm
    reason = reasons_of([depth], depth) if cloud.reason is None else cloud.reason.copy()
    marks, before = np.empty_like(reason), reason == Reason.VALID
    mark_edges(depth, sigma, cloud.intensity.astype(np.float32, copy=False), steepness, marks)
    mark_beside(reason, marks)
    judge_marks(depth, sigma, marks, steepness, reason)
    depth[reason != Reason.VALID] = np.nan
    judge_slopes(depth, lens, view, reason)
    gone = np.nonzero(before & (reason != Reason.VALID))
    if len(gone[0]) == np.count_nonzero(before):
        raise DecodeError(f"no point is left: {describe_reasons(reason)}")
    for values in (cloud.xyz, cloud.sigma_mm, cloud.epipolar_px):
        values[gone] = np.nan
    return replace(cloud, reason=reason)


def _as_kernels_take_them(rules: EdgeRules, rig: Rig) -> tuple[Four, Four, tuple[Four, Three]]:
    """Limits of links, the camera's pinhole, and what `facing` asks for, in single precision."""
    lens, square = rig.camera.lens, rules.grazing_cos**2
    tangent = math.sqrt(1 / square - 1)
    limits = _single(tangent / lens.fx, tangent / lens.fy, rules.jump_sigmas, rules.fade_share)
    centre = _single(*rig.projector_from_camera.inverse().translation_mm)
    view = (_single(lens.fx, lens.fy, square, 0.0), centre)
    return limits, _single(lens.fx, lens.fy, lens.cx, lens.cy), view


def _single(*values: float) -> Any:
    return tuple(np.float32(value) for value in values)
