"""What of a test is not as such a test wants it: sizes of the artefacts, their form, places."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fringeworks.measure.acceptance.artefacts import Form
from fringeworks.measure.acceptance.certificate import Certificate, Quantity
from fringeworks.measure.acceptance.positions import FlatFound
from fringeworks.model import Finding

BALL_SHARE = (0.1, 0.2)
BAR_SHARE = 0.3
FLAT_SHARE = 0.5
"""Sizes of the artefacts as shares of the measuring volume's diagonal."""

LEAST_FLAT_MM = 50.0
FORM_SHARE = 0.2
"""An artefact's form and the limit of what is measured on it."""

SPREAD = 1 / 3
"""Of each side of the volume: balls closer together than this do not test it."""


def certify(certificate: Certificate) -> Certificate:
    """The same with findings: what such a test wants otherwise."""
    found = (*_sizes(certificate), *_forms(certificate), *_places(certificate))
    return replace(certificate, findings=(*certificate.findings, *found))


def _sizes(certificate: Certificate) -> Iterator[Finding]:
    """Artefacts that are too small, or too large, for the volume."""
    diagonal, artefacts = certificate.diagonal_mm, certificate.artefacts
    of = f"of the volume's diagonal, {diagonal:.0f} mm"
    if artefacts.ball is not None and certificate.balls:
        low, high = (share * diagonal for share in BALL_SHARE)
        if not low <= artefacts.ball.value_mm <= high:
            yield _warn(
                f"The ball's diameter must be a tenth to a fifth {of}: {low:.0f} to {high:.0f} mm, "
                f"got {artefacts.ball.value_mm:g} mm."
            )
    bar = artefacts.bar
    if bar is not None and certificate.bars and bar.value_mm < BAR_SHARE * diagonal:
        yield _warn(f"The ball bar must be at least 0.3 {of}, got {bar.value_mm:g} mm.")
    small = [flat for flat in certificate.flats if _too_small(flat, diagonal)]
    for flat in small[:1]:
        yield _warn(
            f"Flats must be measured over at least half {of}, by {LEAST_FLAT_MM:.0f} mm: "
            f"{len(small)} of {len(certificate.flats)} are not, {flat.name} over "
            f"{flat.size_mm[0]:.0f} x {flat.size_mm[1]:.0f} mm."
        )


def _too_small(flat: FlatFound, diagonal_mm: float) -> bool:
    long, short = flat.size_mm
    return long < FLAT_SHARE * diagonal_mm or short < LEAST_FLAT_MM


def _forms(certificate: Certificate) -> Iterator[Finding]:
    """Artefacts that are not known well enough for their limit."""
    artefacts, limits = certificate.artefacts, certificate.limits_mm
    forms: tuple[tuple[Quantity, str, Form | None], ...] = (
        ("PF", "ball", artefacts.ball_form),
        ("F", "flat", artefacts.flat),
    )
    for quantity, name, form in forms:
        limit = limits.get(quantity)
        if form is not None and limit is not None and form.range_mm > FORM_SHARE * limit:
            yield _warn(
                f"The {name}'s own form must be at most a fifth of the limit of {quantity}, "
                f"{limit:g} mm, got {form.range_mm:g} mm."
            )
    for lot in certificate.lots:
        limit = lot.limit_mm
        if limit is not None and any(one.u95_mm >= limit for one in lot.readings):
            yield _warn(
                f"The test's own uncertainty is as large as the limit of {lot.quantity}: nothing "
                "can conform.",
                "Have the artefact calibrated better, or know its temperature better.",
            )


def _places(certificate: Certificate) -> Iterator[Finding]:
    """Balls that are not spread over the volume."""
    if len(certificate.balls) < 2:
        return
    span = np.ptp([ball.centre_mm for ball in certificate.balls], axis=0)
    for axis, reach, side in zip("xyz", span, certificate.volume_mm, strict=True):
        if reach < SPREAD * side:
            yield _warn(
                f"The balls' centres must span at least a third of the volume's {side:.0f} mm "
                f"along {axis}, got {reach:.0f} mm.",
                "Spread the positions over the volume.",
            )


def _warn(message: str, remedy: str = "") -> Finding:
    return Finding("warning", message, remedy)
