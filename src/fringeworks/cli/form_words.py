"""What ``fringeworks measure`` says of a form: names and values for two columns."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

Values: TypeAlias = dict[str, Any]


def _plane_facts(found: Values) -> list[tuple[str, str]]:
    return [
        ("normal", _numbers(found["normal"], digits=6)),
        ("tilt sigma", _sigma(found["tilt_sigma_deg"], "degrees")),
        ("offset", f"{found['offset_mm']:.4f} mm"),
        ("offset sigma", _sigma(found["offset_sigma_mm"], "mm")),
        *_scale("offset", found),
        *_spread(found),
        ("flatness", f"{found['flatness_mm']:.4f} mm"),
    ]


def _sphere_facts(found: Values) -> list[tuple[str, str]]:
    return [("centre", _numbers(found["centre_mm"], digits=4) + " mm"), *_radius(found)]


def _cylinder_facts(found: Values) -> list[tuple[str, str]]:
    return [
        ("axis point", _numbers(found["axis_point_mm"], digits=4) + " mm"),
        ("axis direction", _numbers(found["axis_direction"], digits=6)),
        *_radius(found),
    ]


def _cone_facts(found: Values) -> list[tuple[str, str]]:
    return [
        ("apex", _numbers(found["apex_mm"], digits=4) + " mm"),
        ("apex sigma", " ".join(f"{one:.2g}" for one in found["apex_sigma_mm"]) + " mm"),
        ("axis direction", _numbers(found["axis_direction"], digits=6)),
        ("half angle", f"{found['half_angle_deg']:.4f} degrees"),
        ("half angle sigma", _sigma(found["half_angle_sigma_deg"], "degrees")),
        *_spread(found),
        ("range", f"{found['range_mm']:.4f} mm"),
    ]


FACTS: Mapping[str, Callable[[Values], list[tuple[str, str]]]] = {
    "plane": _plane_facts,
    "sphere": _sphere_facts,
    "cylinder": _cylinder_facts,
    "cone": _cone_facts,
}


def _sigma(value: float, unit: str) -> str:
    if not math.isfinite(value):
        return "unknown: there are no more points than it takes"
    return f"{value:.2g} {unit} by the points' scatter, each on its own"


def _radius(found: Values) -> list[tuple[str, str]]:
    return [
        ("radius", f"{found['radius_mm']:.4f} mm"),
        ("radius sigma", _sigma(found["radius_sigma_mm"], "mm")),
        *_scale("radius", found),
        *_spread(found),
        ("range", f"{found['range_mm']:.4f} mm"),
    ]


def _scale(length: str, found: Values) -> list[tuple[str, str]]:
    """What the calibration board's pitch adds to the length's uncertainty, if that is known."""
    sigma = found[f"{length}_scale_sigma_mm"]
    if sigma is None:
        return []
    return [(f"{length} scale sigma", f"{sigma:.2g} mm by the calibration board's pitch")]


def _spread(found: Values) -> list[tuple[str, str]]:
    return [
        ("form rms", f"{found['form_rms_mm']:.4f} mm"),
        ("band95", f"{found['band95_mm']:.4f} mm"),
    ]


def _numbers(values: Iterable[float], *, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)
