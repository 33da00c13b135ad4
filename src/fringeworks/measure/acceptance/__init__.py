"""Acceptance of an area-measuring sensor, in the manner of VDI/VDE 2634-2.

A ball at ten places, a ball bar at seven, a flat at six. What comes out is held against stated
limits by ISO 14253-1, and told in everyday words beside. The standards themselves are not quoted
here: who needs a certificate by the letter reads them. `docs/acceptance.md` is the guide.
"""

from fringeworks.measure.acceptance.artefacts import Artefacts, CalibratedLength, Form, Warmth
from fringeworks.measure.acceptance.certificate import Certificate, Lot
from fringeworks.measure.acceptance.findings import certify
from fringeworks.measure.acceptance.positions import BallFound, BarFound, FlatFound

__all__ = [
    "Artefacts",
    "BallFound",
    "BarFound",
    "CalibratedLength",
    "Certificate",
    "FlatFound",
    "Form",
    "Lot",
    "Warmth",
    "certify",
]
