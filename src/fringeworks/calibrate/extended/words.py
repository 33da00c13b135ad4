"""An extended fit in words: what it gained, what the planes tell of the ten and what not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fringeworks.calibrate.extended.fit import PRIORS, ExtendedFit
from fringeworks.model import Extended

UNITS: Mapping[str, str] = {
    **dict.fromkeys(("C1", "C2", "Kz"), "mm"),
    **dict.fromkeys(("C3", "C4"), ""),
    **dict.fromkeys(("Kfp", "Ku0", "Kv0", "Kfc"), "px"),
    "Kphi": "rad",
}

FIT_KEY = "extended_fit"
"""Where a rig keeps `summarise_fit`, in `Rig.further`."""

HARDLY = 0.9
"""Posterior over prior from which a parameter is the prior's, not the planes'."""

WELL = 0.1

SLIGHT = 1e-4
"""Share of a prior standard deviation that is not worth a word."""


def describe_fit(fit: ExtendedFit) -> list[str]:
    """Sentences, most wanted first."""
    degeneracy, extended = fit.degeneracy, fit.extended
    best, worst = degeneracy.singular_mm[0], degeneracy.singular_mm[degeneracy.usable - 1]
    lines = [
        f"{fit.points} points on {fit.planes} planes, fringes of {extended.period_px:g} px along "
        f"{extended.axis}: depth rms {fit.rms_before_mm:.3f} mm by the geometric model, "
        f"{fit.rms_mm:.3f} mm by the extended one",
        f"neighbours err alike, so that each point counts as if known to {fit.noise_mm:.3g} mm",
        f"effective degrees of freedom {fit.effective_dof:.1f} of {len(fit.free)}; rank "
        f"{degeneracy.rank} of {len(Extended.NAMES)}, {degeneracy.usable} of use, condition "
        f"{degeneracy.condition:.0f}: a standard deviation of the prior moves the depth by "
        f"{best:.3g} mm in the best seen direction, by {1e3 * worst:.2g} µm in the worst of use",
    ]
    lines += [_null_words(null) for null in degeneracy.nulls]
    return lines + _seen_words(fit)


def _null_words(null: Mapping[str, float]) -> str:
    (name, change), *rest = null.items()
    others = [(other, value) for other, value in rest if abs(value) > SLIGHT * PRIORS[other]]
    if not others:
        return f"no plane tells {name}: it moves no depth at all"
    undone = ", ".join(f"{other} {value:+.3g}" for other, value in others)
    return f"no plane tells {name} by itself: {name} {change:+.3g} with {undone} changes no depth"


def _seen_words(fit: ExtendedFit) -> list[str]:
    if fit.mode == "paper":
        return ["six without priors: where the planes say little they go where noise takes them"]
    ratio = {name: fit.sigma[name] / fit.prior[name] for name in fit.free}
    well = [name for name, value in ratio.items() if value < WELL]
    hardly = [name for name, value in ratio.items() if value > HARDLY]
    return [
        f"known ten times better than before, one by one: {', '.join(well) or 'none'}; as before: "
        f"{', '.join(hardly) or 'none'}; combinations of them are known better"
    ]


def tabulate_fit(fit: ExtendedFit) -> list[tuple[str, str, str, str, str, str]]:
    """Rows: name, unit, value, sigma, prior sigma and their ratio; a dash where there is none."""
    rows = []
    for name in Extended.NAMES:
        value = f"{getattr(fit.extended, name):.5g}"
        if name not in fit.free:
            rows.append((name, UNITS[name], value, "-", "-", "-"))
            continue
        sigma, prior = fit.sigma[name], fit.prior[name]
        known = (f"{prior:g}", f"{sigma / prior:.2g}") if fit.mode == "map" else ("-", "-")
        rows.append((name, UNITS[name], value, f"{sigma:.2g}", *known))
    return rows


def summarise_fit(fit: ExtendedFit) -> dict[str, Any]:
    """The same in plain values."""
    return {
        "mode": fit.mode,
        "axis": fit.extended.axis,
        "period_px": fit.extended.period_px,
        "parameters": {name: getattr(fit.extended, name) for name in Extended.NAMES},
        "sigma": dict(fit.sigma),
        "prior_sigma": dict(fit.prior) if fit.mode == "map" else None,
        "effective_dof": fit.effective_dof,
        "rank": fit.degeneracy.rank,
        "usable": fit.degeneracy.usable,
        "condition": fit.degeneracy.condition,
        "singular_mm": fit.degeneracy.singular_mm.tolist(),
        "nulls": [dict(null) for null in fit.degeneracy.nulls],
        "rms_before_mm": fit.rms_before_mm,
        "rms_mm": fit.rms_mm,
        "noise_mm": fit.noise_mm,
        "points": fit.points,
        "planes": fit.planes,
        "words": describe_fit(fit),
    }
