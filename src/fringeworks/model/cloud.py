"""The organised cloud: one point per camera pixel."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.model.capture import Frames
from fringeworks.model.finding import Finding
from fringeworks.model.rig import Pose

ReasonMap: TypeAlias = NDArray[np.uint8]


class Reason(IntEnum):
    """Why a pixel has no point; the first that holds."""

    VALID = 0
    NOT_DECODED = 1
    OFF_LINE = 2
    OUTSIDE = 3
    MIXED = 4
    GRAZING = 5


REASON_WORDS = {
    Reason.NOT_DECODED: "not decoded",
    Reason.OFF_LINE: "off the epipolar line",
    Reason.OUTSIDE: "outside the volume",
    Reason.MIXED: "at an edge, seeing both sides of it",
    Reason.GRAZING: "at grazing incidence",
}


def describe_reasons(reason: ReasonMap) -> str:
    """Shares of all pixels, reason by reason, in words."""
    counts = np.bincount(reason.ravel(), minlength=len(Reason)) / reason.size
    parts = [f"{counts[why]:.1%} {words}" for why, words in REASON_WORDS.items() if counts[why]]
    return ", ".join(parts) or "all pixels have a point"


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points of one scan on the camera's pixel grid.

    Attributes
    ----------
    xyz
        ``(H, W, 3)`` float32, mm, in the frame called `frame`; NaN where void.
    sigma_mm
        ``(H, W)`` float32: random part of the uncertainty, one standard deviation along z.
    intensity
        ``(H, W)`` float32: grey level of the white frame, or the fringes' offset.
    colour
        ``(H, W, 3)`` RGB of the white frame where the camera saw colour, else None.
    epipolar_px
        ``(H, W)`` float32: what is left between measured and projected coordinate across the
        epipolar line, projector px; NaN everywhere if one axis alone was coded.
    scale_sigma
        How well the scale of all its lengths is known, a share, one standard deviation: that of
        the rig. None where nobody knows.
    findings
        What the user should know of how the points came about.
    systematic_mm
        ``(H, W)`` float32: systematic part of the uncertainty, one standard deviation along z, from
        the rig's calibration; the points of one scan, and of all scans with the rig, share it.
        NaN where void. None where the rig does not keep how well it is known.
    reason
        ``(H, W)`` uint8, a `Reason` per pixel; None where nobody kept them.
    frame_from_camera
        Where the camera stood that saw the cloud; None for the camera's own frame, and where
        nobody knows. Every sigma stays that along the camera's z.
    """

    xyz: NDArray[np.float32]
    sigma_mm: NDArray[np.float32]
    intensity: NDArray[np.float32]
    epipolar_px: NDArray[np.float32]
    colour: Frames | None = None
    frame: str = "camera"
    scale_sigma: float | None = None
    findings: tuple[Finding, ...] = ()
    systematic_mm: NDArray[np.float32] | None = None
    reason: ReasonMap | None = None
    frame_from_camera: Pose | None = None

    @property
    def valid(self) -> NDArray[np.bool_]:
        return np.asarray(np.isfinite(self.xyz).all(axis=-1))

    def points(self) -> NDArray[np.float64]:
        """``(n, 3)`` valid points, mm, row by row."""
        return self.xyz[self.valid].astype(np.float64)

    def seen_from_camera(self) -> NDArray[np.float64]:
        """``(H, W, 3)`` points about the camera, mm; as they are where its place is not known."""
        points = self.xyz.astype(np.float64)
        pose = self.frame_from_camera
        return points if pose is None else pose.inverse().apply(points)
