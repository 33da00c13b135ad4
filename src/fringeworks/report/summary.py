"""What a stage found, in plain values: what commands print, and their ``--json``.

Units stand in the names; NaN is None, which JSON knows.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.forms import ConeFit, CylinderFit, PlaneFit, SphereFit
from fringeworks.geometry.forms.named import FormFit
from fringeworks.model import Cloud, CodedAxis, Lens, Noise, Rig, Void, WrappedPhase
from fringeworks.model.cloud import REASON_WORDS, ReasonMap
from fringeworks.model.phase import VOID_WORDS, VoidMap
from fringeworks.phase.decode import Decoding
from fringeworks.report.findings import summarise_finding

if TYPE_CHECKING:  # a scan need not load what calibrates, nor what simulates
    from fringeworks.calibrate.record import CalibrationRecord, ViewRecord
    from fringeworks.twin.truth import Truth

Summary = dict[str, Any]

COORDINATES = {"x": "column", "y": "row"}
NOISE_WORDS = {
    "camera": "the capture's [camera] table",
    "residual": "the residual of the fit",
    "high-pass": "high-pass differences of the frames",
}


def summarise_decoding(decoding: Decoding) -> dict[str, Summary]:
    """One summary per axis: ``absolute`` says whether its coordinate is known."""
    axes = {axis.axis: _summarise_coded(axis) for axis in decoding.coded}
    for wrapped, reason in decoding.relative:
        axes[wrapped.fringe.axis] = _summarise_relative(wrapped, reason)
    return {name: axes[name] for name in sorted(axes)}


def _summarise_coded(axis: CodedAxis) -> Summary:
    return {
        "absolute": True,
        "coordinate": COORDINATES[axis.axis],
        "route": list(axis.route),
        "valid_share": axis.valid_share,
        "voids": _void_shares(axis.void),
        "sigma_px_median": _median(axis.sigma),
        "noise": None if axis.phase is None else _noise(axis.phase.wrapped.noise),
        "exposures": [] if axis.phase is None else _exposures(axis.phase.wrapped),
    }


def _summarise_relative(wrapped: WrappedPhase, reason: str) -> Summary:
    return {
        "absolute": False,
        "reason": reason,
        "period_px": wrapped.fringe.period_px,
        "valid_share": float(np.mean(np.isfinite(wrapped.phase))),
        "voids": _void_shares(wrapped.void),
        "sigma_rad_median": _median(wrapped.sigma),
        "noise": _noise(wrapped.noise),
        "exposures": _exposures(wrapped),
    }


def _exposures(wrapped: WrappedPhase) -> list[Summary]:
    """Fused exposures, and of how many of the decoded pixels each is the one that weighs most."""
    fusion = wrapped.fusion
    if fusion is None:
        return []
    told = zip(fusion.exposures_ms, fusion.shares, strict=True)
    return [{"exposure_ms": exposure_ms, "share": share} for exposure_ms, share in told]


def _void_shares(void: VoidMap) -> dict[str, float]:
    """Share of all pixels that each rule made void, by the rule's words; zero ones left out."""
    counts = np.bincount(void.ravel(), minlength=len(Void))
    return {
        words: float(counts[rule] / void.size) for rule, words in VOID_WORDS.items() if counts[rule]
    }


def _noise(noise: Noise) -> Summary:
    return {
        "source": noise.source,
        "from": NOISE_WORDS[noise.source],
        "read_grey": noise.read,
        "gain_grey": noise.gain,
    }


def summarise_cloud(cloud: Cloud) -> Summary:
    """Number of points, where they are, and how well they are known."""
    points = cloud.points()
    low, high = np.percentile(points[:, 2], [1, 99])
    epipolar = cloud.epipolar_px[np.isfinite(cloud.epipolar_px)].astype(np.float64)
    return {
        "points": len(points),
        "valid_share": float(np.mean(cloud.valid)),
        "frame": cloud.frame,
        "z_mm": {"p1": float(low), "median": float(np.median(points[:, 2])), "p99": float(high)},
        "sigma_mm_median": _median(cloud.sigma_mm),
        "systematic_mm_median": None
        if cloud.systematic_mm is None
        else _median(cloud.systematic_mm[cloud.valid]),
        "reasons": {} if cloud.reason is None else _reason_shares(cloud.reason),
        "epipolar_rms_px": float(np.sqrt(np.mean(epipolar**2))) if epipolar.size else None,
        "scale_sigma": cloud.scale_sigma,
    }


def _reason_shares(reason: ReasonMap) -> dict[str, float]:
    """Share of all pixels that have no point for each reason, by its words; zeros left out."""
    counts = np.bincount(reason.ravel(), minlength=len(REASON_WORDS) + 1)
    return {
        words: float(counts[why] / reason.size)
        for why, words in REASON_WORDS.items()
        if counts[why]
    }


def summarise_truth(truth: Truth) -> Summary:
    """Which surfaces a simulated capture sees, how much of the image, and how much of it is lit."""
    seen = truth.surface >= 0
    depth = truth.xyz[..., 2][seen]
    return {
        "surfaces": [truth.names[place] for place in np.unique(truth.surface[seen])],
        "seen_share": float(np.mean(seen)),
        "lit_share": float(np.mean(np.isfinite(truth.column[seen]))),
        "z_mm": {"min": float(depth.min()), "max": float(depth.max())},
    }


def summarise_plane(plane: PlaneFit, scale_sigma: float | None = None) -> Summary:
    """The plane and how far its points lie from it; `scale_sigma` is the cloud's."""
    return {
        "normal": [float(value) for value in plane.normal],
        "offset_mm": plane.offset_mm,
        "offset_sigma_mm": plane.offset_sigma_mm,
        "offset_scale_sigma_mm": _by_scale(abs(plane.offset_mm), scale_sigma),
        "tilt_sigma_deg": plane.tilt_sigma_deg,
        "flatness_mm": plane.flatness_mm,
        "form_rms_mm": plane.form_rms_mm,
        "band95_mm": plane.band95_mm,
        "points": len(plane.deviations_mm),
    }


def summarise_sphere(sphere: SphereFit, scale_sigma: float | None = None) -> Summary:
    """The sphere and how far its points lie from it; `scale_sigma` is the cloud's."""
    return {
        "centre_mm": [float(value) for value in sphere.centre_mm],
        "centre_sigma_mm": _sigmas(sphere.covariance, slice(0, 3)),
        **_round(sphere, scale_sigma),
    }


def summarise_cylinder(cylinder: CylinderFit, scale_sigma: float | None = None) -> Summary:
    """The cylinder and how far its points lie from it; `scale_sigma` is the cloud's."""
    return {
        "axis_point_mm": [float(value) for value in cylinder.axis_point_mm],
        "axis_point_sigma_mm": _sigmas(cylinder.covariance, slice(0, 3)),
        "axis_direction": [float(value) for value in cylinder.axis_direction],
        "axis_tilt_sigma_deg": _tilt(cylinder.covariance),
        **_round(cylinder, scale_sigma),
    }


def summarise_cone(cone: ConeFit) -> Summary:
    """The cone and how far its points lie from it; its angle does not know the scale."""
    return {
        "apex_mm": [float(value) for value in cone.apex_mm],
        "apex_sigma_mm": _sigmas(cone.covariance, slice(0, 3)),
        "axis_direction": [float(value) for value in cone.axis_direction],
        "axis_tilt_sigma_deg": _tilt(cone.covariance),
        "half_angle_deg": cone.half_angle_deg,
        "half_angle_sigma_deg": cone.half_angle_sigma_deg,
        "form_rms_mm": cone.form_rms_mm,
        "range_mm": cone.range_mm,
        "band95_mm": cone.band95_mm,
        "points": len(cone.deviations_mm),
    }


def summarise_form(form: FormFit, scale_sigma: float | None = None) -> Summary:
    """Any of the four; `scale_sigma` is the cloud's."""
    match form:
        case PlaneFit():
            return summarise_plane(form, scale_sigma)
        case SphereFit():
            return summarise_sphere(form, scale_sigma)
        case CylinderFit():
            return summarise_cylinder(form, scale_sigma)
        case ConeFit():
            return summarise_cone(form)


def _sigmas(covariance: NDArray[np.float64], which: slice) -> list[float]:
    return [float(value) for value in np.sqrt(np.diag(covariance)[which])]


def _tilt(covariance: NDArray[np.float64]) -> float:
    """Standard deviation, degrees, of an axis' direction, rows 3 to 5, where it is known worst."""
    largest = float(np.linalg.eigvalsh(covariance[3:6, 3:6])[-1])
    return math.degrees(math.sqrt(max(largest, 0.0)))


def _round(form: SphereFit | CylinderFit, scale_sigma: float | None) -> Summary:
    return {
        "radius_mm": form.radius_mm,
        "radius_sigma_mm": form.radius_sigma_mm,
        "radius_scale_sigma_mm": _by_scale(form.radius_mm, scale_sigma),
        "form_rms_mm": form.form_rms_mm,
        "range_mm": form.range_mm,
        "band95_mm": form.band95_mm,
        "points": len(form.deviations_mm),
    }


def _by_scale(length_mm: float, scale_sigma: float | None) -> float | None:
    """What of a length's standard deviation, mm, its scale alone makes."""
    return None if scale_sigma is None else length_mm * scale_sigma


def summarise_rig(rig: Rig) -> Summary:
    """Lenses, pose and volume in the words of ``rig.json``."""
    turn = rig.projector_from_camera.rotation
    angle = math.acos(float(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    return {
        "camera": _lens(rig.camera.lens, rig.camera.width, rig.camera.height),
        "projector": _lens(rig.projector.lens, rig.projector.width, rig.projector.height),
        "baseline_mm": rig.baseline_mm,
        "translation_mm": [float(value) for value in rig.projector_from_camera.translation_mm],
        "rotation_deg": math.degrees(angle),
        "volume_mm": None if rig.volume_mm is None else list(rig.volume_mm),
        "scale_sigma": rig.scale_sigma,
    }


def _lens(lens: Lens, width: int, height: int) -> Summary:
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    values = dict(zip(names, (float(value) for value in lens.vector), strict=True))
    return {"width": width, "height": height, **values}


def summarise_record(record: CalibrationRecord | None) -> Summary:
    """Views, failed captures, findings, k3, halves, what is left out; empty without a record."""
    if record is None:
        empty: Summary = {key: [] for key in ("views", "failed_captures", "findings", "k3")}
        return {**empty, "halves": None, "left_out": []}
    return {
        "views": [_view(view) for view in record.views],
        "failed_captures": [
            {"name": name, "reason": reason} for name, reason in record.failed_captures
        ],
        "findings": [summarise_finding(finding) for finding in record.findings],
        "k3": [asdict(trial) for trial in record.k3],
        "halves": None if record.halves is None else record.halves.numbers,
        "left_out": list(record.left_out),
    }


def _view(record: ViewRecord) -> Summary:
    return {
        "name": record.name,
        "image": record.view.image,
        "camera_rms_px": record.camera_rms_px,
        "projector_rms_px": record.projector_rms_px,
        "kept": record.kept_count,
        "offered": record.offered_count,
        "left_out": record.view.left_out,
    }


def _median(values: NDArray[np.floating]) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else None
