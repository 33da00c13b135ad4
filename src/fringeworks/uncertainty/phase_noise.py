"""What the phase scatters by and what bends it, for a wall in the light of a projector.

Light, optics and electronics are those of the twin's `Effects`, in closed form: light falls off
with the distance squared and with the cosine of its incidence; fringes fade with the blur of the
projector, of the camera seen in projector pixels, and with the size of both devices' pixels. The
phase of N equal steps then has ``sigma_phi = sqrt(2 / N) sigma_I / B`` (docs/patterns.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.lens import project
from fringeworks.model import AXES, Fringe, Rig
from fringeworks.twin.effects import Effects
from fringeworks.twin.expose import sensor_of
from fringeworks.twin.light import blur_sigma_px, respond
from fringeworks.twin.optics import optics_of
from fringeworks.twin.shade import vignetting
from fringeworks.uncertainty.seen import Seen

Array = NDArray[np.float64]

ALBEDO = 0.8
"""Of matt white paper or plaster."""

FULLEST = 0.9
"""Share of full scale that white may reach: a shorter exposure is taken where it would not."""

QUANTISATION_VARIANCE = 1 / 12
MOST_PERIODS = 64


@dataclass(frozen=True, slots=True, eq=False)
class FringesSeen:
    """Fringes on points of a wall.

    Attributes
    ----------
    fringe
        Period and steps.
    offset, modulation
        ``(n,)`` grey levels above black.
    ambient
        ``(n,)`` grey levels, part of the offset.
    transfer
        ``(n,)`` share of the pattern's modulation that is left.
    blur_px
        ``(n,)`` standard deviation of both devices' point spreads together, projector px.
    """

    fringe: Fringe
    offset: Array
    modulation: Array
    ambient: Array
    transfer: Array
    blur_px: Array


def see_fringes(rig: Rig, wall: Seen, fringe: Fringe, effects: Effects) -> FringesSeen:
    """Fringes on a wall across the camera's axis, as `twin` would form them."""
    white, ambient = _light(rig, wall, shorten_exposure(rig, wall, effects))
    blur = _blur_px(rig, wall, fringe, effects)
    aperture = _camera_px(rig, wall, fringe)
    turns = 1 / fringe.period_px
    transfer = np.exp(-2 * (np.pi * blur * turns) ** 2) * np.sinc(turns) * np.sinc(aperture * turns)
    black = effects.projector.black_light
    scale = sensor_of(effects.camera).full_scale
    return FringesSeen(
        fringe=fringe,
        offset=scale * (white * (1 + black) / 2 + ambient),
        modulation=scale * white * (1 - black) / 2 * transfer,
        ambient=scale * ambient,
        transfer=transfer,
        blur_px=blur,
    )


def phase_variances(seen: FringesSeen, effects: Effects) -> dict[str, Array]:
    """Variances ``(n,)`` of the phase, rad^2, by what makes grey levels scatter.

    Light that flickers by a share f from frame to frame adds ``f (A + B cos)`` to each, all pixels
    alike; the mean over the phase is that of ``A^2 + B^2 / 4``.
    """
    sensor = sensor_of(effects.camera)
    lit = (seen.offset - seen.ambient) ** 2 + seen.modulation**2 / 4
    per_grey = 2 / len(seen.fringe.shifts_rad) / seen.modulation**2
    return {
        "camera: shot noise": (sensor.gain or 0.0) * seen.offset * per_grey,
        "camera: read noise": (sensor.read_noise or 0.0) ** 2 * per_grey,
        "camera: rounding to grey levels": QUANTISATION_VARIANCE * per_grey,
        "projector: flicker from frame to frame": effects.projector.flicker**2 * lit * per_grey,
    }


def pattern_errors(seen: FringesSeen, effects: Effects) -> dict[str, float]:
    """Root mean square errors of the phase, rad, by what the projector makes of the pattern.

    The shown columns go through rounding and response, and are blurred by the wall's median; what
    the N steps make of them is held against the phase meant. Both errors are the same in every
    scan: they ripple along the fringes.
    """
    blur, projector = float(np.median(seen.blur_px)), effects.projector
    exact = _shown(seen.fringe)
    rounded = np.rint(exact * (2**projector.bits - 1)) / (2**projector.bits - 1)
    return {
        "projector: response (gamma)": _ripple(seen.fringe, respond(exact, projector), blur),
        "projector: rounding to levels": _ripple(seen.fringe, rounded, blur),
    }


def shorten_exposure(rig: Rig, wall: Seen, effects: Effects) -> Effects:
    """The effects with an exposure at which white on the wall stays within `FULLEST`."""
    white, ambient = _light(rig, wall, effects)
    share = min(1.0, FULLEST / float((white + ambient).max(initial=1e-12)))
    camera = replace(effects.camera, exposure_ms=effects.camera.exposure_ms * share)
    return replace(effects, camera=camera)


def _light(rig: Rig, wall: Seen, effects: Effects) -> tuple[Array, Array]:
    """White's light and the ambient ``(n,)`` on the wall, shares of full scale."""
    camera, projector = optics_of(rig)
    centre = rig.projector_from_camera.inverse().translation_mm
    far = np.linalg.norm(wall.points - centre, axis=1)
    cosine = np.maximum(wall.points[:, 2] - centre[2], 0.0) / far
    passed = ALBEDO * vignetting(wall.camera_px, camera, effects.camera.vignetting)
    lit = vignetting(wall.projector_px, projector, effects.projector.vignetting)
    exposure = effects.camera.exposure_ms
    white = effects.projector.light_per_ms * exposure * passed * lit * cosine
    white *= (effects.projector.focus_mm / far) ** 2
    return white, effects.ambient.light_per_ms * exposure * passed


def _blur_px(rig: Rig, wall: Seen, fringe: Fringe, effects: Effects) -> Array:
    depth = rig.projector_from_camera.apply(wall.points)[:, 2]
    shown = blur_sigma_px(depth, effects.projector)
    if fringe.axis == "y":
        shown = shown * rig.projector.lens.fy / rig.projector.lens.fx
    return np.hypot(shown, effects.camera.blur_px * _camera_px(rig, wall, fringe))


def _camera_px(rig: Rig, wall: Seen, fringe: Fringe) -> Array:
    """``(n,)`` projector px along the axis per camera px along it, on the wall."""
    axis = AXES.index(fringe.axis)
    lens = rig.camera.lens
    beside = wall.points.copy()
    beside[:, axis] += wall.points[:, 2] / (lens.fx, lens.fy)[axis]
    moved = project(rig.projector_from_camera.apply(beside), rig.projector.lens.vector)
    return np.asarray(np.abs(moved[:, axis] - wall.projector_px[:, axis]))


def _shown(fringe: Fringe) -> Array:
    """``(N, columns)`` levels 0 to 1 of the pattern, unrounded, over one cycle of whole columns."""
    return np.asarray((1 + np.cos(_meant(fringe) - np.array(fringe.shifts_rad)[:, None])) / 2)


def _meant(fringe: Fringe) -> Array:
    """Phases, rad, of the columns of the shortest cycle in which whole periods are whole columns.

    Where no number of periods up to `MOST_PERIODS` is one, that many, rounded.
    """
    columns = np.arange(1, MOST_PERIODS + 1) * fringe.period_px
    whole = np.abs(columns - np.rint(columns)) < 1e-6
    cycle = int(np.rint(columns[np.argmax(whole)] if whole.any() else columns[-1]))
    return np.array([fringe.phase_at(place) for place in range(cycle)])


def _ripple(fringe: Fringe, light: Array, blur_px: float) -> float:
    """Root mean square error, rad, of the phase of blurred light ``(N, columns)``, a cycle."""
    turns = np.fft.rfftfreq(light.shape[1])
    transfer = np.exp(-2 * (np.pi * blur_px * turns) ** 2) * np.sinc(turns)
    seen = np.fft.irfft(np.fft.rfft(light, axis=1) * transfer, light.shape[1], axis=1)
    shifts = np.array(fringe.shifts_rad)
    design = np.column_stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)])
    _, cosine, sine = np.linalg.lstsq(design, seen, rcond=None)[0]
    error = np.angle(np.exp(1j * (np.arctan2(sine, cosine) - _meant(fringe))))
    return float(np.sqrt(np.mean((error - error.mean()) ** 2)))
