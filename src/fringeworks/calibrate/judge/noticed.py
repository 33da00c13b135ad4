"""What a solved rig or its views show of faults that residuals of corners do not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit
from fringeworks.calibrate.adjust.start import USUAL_MM, other_units
from fringeworks.calibrate.judge.coverage import notice_bare_parts
from fringeworks.calibrate.judge.structure import find_structure
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import ImageSize
from fringeworks.errors import CalibrationError
from fringeworks.model import AXES, Finding

Array = NDArray[np.float64]
Sizes: TypeAlias = tuple[ImageSize, ImageSize]
"""Of the camera's and the projector's image."""

PANEL_RATIOS = (0.5, 1.0, 2.0)
"""fy / fx of square pixels, and of the diamond lattices of the DLP3000 and DLP4500."""

LARGEST_STRETCH = 0.02
OFF_CENTRE = 0.15
"""Of the image's size, both ways: beyond it the size is doubted."""

SWAPPED_OFF_CENTRE = 0.04
CENTRED = 0.02
"""Where the point is off by more than the former, and by less than the latter with width and
height exchanged, that is told too."""

SIGMAS = 5.0

BLUR_RATIO = 2.0
BLUR_PX = 1.5
LARGEST_RESPONSE_RAD = 0.02
"""Of the phase: gamma 1.1 under three steps leaves 0.027, gamma 2 leaves 0.22."""

LARGEST_BEAT_PX = 0.15
"""An image resampled to the nearest pixel is off by half a pixel either way, a wave of 0.3 px;
clean captures of the twin leave up to 0.03 px."""


def notice(fit: Fit, views: Sequence[View], sizes: Sizes) -> list[Finding]:
    """Findings about a solved rig: distance, panel, ripples, blur, and coverage."""
    return [
        *notice_distance(fit.state.camera_from_board),
        *_stretched_panel(fit),
        *_off_centre(fit, sizes[1]),
        *_ripples(views),
        *_blur(views),
        *notice_bare_parts(fit, views, sizes),
    ]


def odd_regions(fit: Fit, views: Sequence[View]) -> Finding | None:
    """That sites err together over whole regions; None too where there are too few to tell."""
    try:
        return find_structure(fit.state, views).finding
    except CalibrationError:
        return None


def notice_distance(camera_from_board: Array) -> Iterator[Finding]:
    """That boards, ``(v, 6)`` poses, stand nearer or farther than boards mostly do."""
    distance = float(np.median(camera_from_board[:, 5]))
    if not USUAL_MM[0] <= distance <= USUAL_MM[1]:
        message = f"the board comes out {distance:.3g} mm from the camera."
        remedy = f"If it was not, the pitch in board.toml is not in mm{other_units(distance)}."
        yield Finding("warning", message, remedy, name="board distance", where="board")


def _stretched_panel(fit: Fit) -> Iterator[Finding]:
    ratio = fit.state.projector[1] / fit.state.projector[0]
    nearest = min(PANEL_RATIOS, key=lambda panel: abs(np.log(ratio / panel)))
    off = abs(ratio / nearest - 1)
    if off > LARGEST_STRETCH + SIGMAS * _sigma(
        fit, {"fx": -1 / fit.state.projector[0], "fy": 1 / fit.state.projector[1]}
    ):
        yield Finding(
            "warning",
            f"the projector's focal lengths have the ratio fy / fx = {ratio:.3f}; panels have "
            "1 (square pixels), 2 or 0.5 (diamond ones).",
            "Its image is scaled on the way to the panel: project in the native resolution, "
            "without keystone correction, and give that resolution in capture.toml.",
            name="stretched output",
            where="projector",
        )


def _off_centre(fit: Fit, size: ImageSize) -> Iterator[Finding]:
    """A lens may be shifted one way, mostly up; hardly ever both ways."""
    sigma = max(_sigma(fit, {name: 1.0}) / min(size.width, size.height) for name in ("cx", "cy"))
    centre = fit.state.projector[2:4]
    off = _nearest_middle(centre, (size.width, size.height)) - SIGMAS * sigma
    exchanged = _nearest_middle(centre, (size.height, size.width)) < CENTRED
    if off > (SWAPPED_OFF_CENTRE if exchanged else OFF_CENTRE):
        hint = " With the two exchanged it would be." if exchanged else ""
        yield Finding(
            "warning",
            f"the projector's principal point ({centre[0]:.0f}, {centre[1]:.0f}) is the middle of "
            f"its {size.width} x {size.height} px in neither direction.{hint}",
            "Check the projector's width and height in capture.toml.",
            name="projector size",
            where="projector",
        )


def _nearest_middle(centre: Array, extents: tuple[int, int]) -> float:
    """How far a point is from the middle in its better direction, as a share of the image."""
    return float(np.min(np.abs((centre + 0.5) / extents - 0.5)))


def _sigma(fit: Fit, slopes: dict[str, float]) -> float:
    """Standard deviation of a linear combination of the projector's lens parameters."""
    if fit.covariance is None:
        return 0.0
    weights = [slopes.get(name.removeprefix("projector."), 0.0) for name in fit.covariance.names]
    return float(np.sqrt(weights @ fit.covariance.matrix @ weights))


def _ripples(views: Sequence[View]) -> Iterator[Finding]:
    for axis in AXES:
        found = [ripple for view in views for ripple in view.ripples if ripple.axis == axis]
        curved = [ripple for ripple in found if ripple.harmonic]
        if len(curved) > len(found) / 2:
            swing = float(np.median([ripple.amplitude_rad for ripple in curved]))
            if swing > LARGEST_RESPONSE_RAD:
                yield _curved_response(axis, swing, curved[0].steps)
            continue
        beats = [ripple for ripple in found if not ripple.harmonic]
        if len(beats) > len(found) / 2:
            swing = float(np.median([ripple.amplitude_px for ripple in beats]))
            if swing > LARGEST_BEAT_PX:
                period = float(np.median([ripple.period_px for ripple in beats]))
                yield _beat(axis, swing, period)


def _curved_response(axis: str, swing: float, steps: int) -> Finding:
    return Finding(
        "warning",
        f"the phase along {axis} ripples by {swing:.2f} rad, {steps} waves per period: light is no "
        "straight line of the grey level (gamma), and so few steps do not cancel that.",
        "Switch gamma off in projector and camera, avoid overexposure, or capture more steps "
        "(preset 'calibrate').",
        name="gamma",
        cost=float(swing / np.sqrt(2)),
        unit="rad",
        where=f"axis {axis}",
    )


def _beat(axis: str, swing: float, period: float) -> Finding:
    return Finding(
        "warning",
        f"the coordinates along {axis} ripple by {swing:.2f} px every {period:.1f} px of the "
        "projector: two grids of pixels beat.",
        "The image is scaled on the way to the panel: project in the native resolution, without "
        "keystone correction. If it is not, look for light that changes from frame to frame.",
        name="scaled output",
        cost=float(swing / np.sqrt(2)),
        unit="px",
        where=f"axis {axis}",
    )


def _blur(views: Sequence[View]) -> Iterator[Finding]:
    blurs = np.array([view.blur_px for view in views])
    if not np.isfinite(blurs).any():
        return
    usual = float(np.nanmedian(blurs))
    for view, blur in zip(views, blurs, strict=True):
        if blur > max(BLUR_RATIO * usual, BLUR_PX):
            yield Finding(
                "warning",
                f"{view.name} is blurred: {blur:.1f} px in its image, {usual:.1f} px in the "
                "others'.",
                "Look for motion, and for the depth of focus; capture that pose again.",
                name="blur",
                where=view.name,
            )
