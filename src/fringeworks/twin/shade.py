"""What the camera's pixels see, and where in the projector each of them gets its light.

Each pixel is sampled by rays spread like rooks on a chess board. A ray's gain is what the camera
receives for white light of one: (albedo + gloss lobe) x cosine x (focus / distance)^2 x the
vignetting of both lenses. One is white on a white surface that faces the projector on its axis at
the focal distance; the projector's intensity is the same in all directions but for vignetting.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.forming import GAIN, LEVEL, U, V
from fringeworks.kernels.shading import reflect_light
from fringeworks.twin.cast import Caster, Sight
from fringeworks.twin.effects import Effects, ProjectorEffects
from fringeworks.twin.light import SIGMAS_KEPT, blur_sigma_px, choose_sigmas
from fringeworks.twin.optics import Optics
from fringeworks.twin.scene import Scene

Array: TypeAlias = NDArray[np.float64]
Floats: TypeAlias = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A scene at one moment, as the rig sees it, before any image is shown.

    Attributes
    ----------
    samples
        ``(H n, W n, 4)`` float32, n x n rays to a pixel, one in each of its cells: projector column
        and row, px; index between `sigmas_px`, linear in the variance; gain, zero where unlit.
    reflected
        ``(H n, W n)`` float32: albedo times the camera's vignetting, what each ray receives of
        light that falls evenly on everything.
    sigmas_px
        ``(levels,)``, rising: widths of the projector's point spread, columns.
    """

    samples: Floats
    reflected: Floats
    sigmas_px: Array


def find_view(caster: Caster, camera: Optics, projector: Optics, *, effects: Effects) -> View:
    """Cast the rays of all pixels to the scene and from there to the projector."""
    side = math.isqrt(effects.samples)
    size = (camera.height * side, camera.width * side)
    samples = np.empty((*size, 4), np.float32)
    reflected = np.empty(size, np.float32)
    for offset in spread_rays(effects.samples):
        column, row = ((offset + 0.5) * side).astype(np.int64)
        cells = slice(row, None, side), slice(column, None, side)
        flat = np.empty((camera.height * camera.width, 4), np.float32)
        light = _sample(caster, (camera, projector), effects=effects, offset=offset, out=flat)
        samples[cells] = flat.reshape(camera.height, camera.width, 4)
        reflected[cells] = light.reshape(camera.height, camera.width)
    return View(samples, reflected, _set_levels(samples, effects.projector.blur_px))


def spread_rays(count: int) -> Array:
    """Places ``(count, 2)`` in a pixel, px from its centre: one in each column, row and cell.

    Column ``n a + b`` has its ray in row ``n b + (n - 1 - a)``, n^2 the count, a and b below n:
    x and y are uncorrelated.
    """
    side = math.isqrt(count)
    a, b = np.divmod(np.arange(count), side)
    places = np.stack([side * a + b, side * b + side - 1 - a], axis=1)
    return np.asarray((places + 0.5) / count - 0.5)


def vignetting(pixels: Array, device: Optics, share: float) -> Array:
    """Light ``(n,)`` that a lens passes at pixels ``(n, 2)``: ``1 - share (d / d_corner)^2``."""
    centre = np.array([device.lens.cx, device.lens.cy])
    edges = np.array([[-0.5, -0.5], [device.width - 0.5, device.height - 0.5]])
    corner = np.square(edges - centre).max(axis=0).sum()
    # One axis at a time: a sum over pairs takes three times as long.
    d2 = np.square(pixels[:, 0] - centre[0]) + np.square(pixels[:, 1] - centre[1])
    return np.asarray(np.maximum(1 - share * d2 / corner, 0.0))


def ray_angle(camera: Optics, count: int) -> float:
    """Angle, rad, that each of a pixel's rays stands for."""
    return 1 / (math.sqrt(camera.lens.fx * camera.lens.fy) * math.sqrt(count))


def materials_of(scene: Scene) -> Array:
    """Gloss and its exponent, ``(objects, 2)``."""
    return np.array([[o.material.gloss, o.material.gloss_exponent] for o in scene.objects])


def _sample(
    caster: Caster, devices: tuple[Optics, Optics], *, effects: Effects, offset: Array, out: Floats
) -> Array:
    """Fill one ray per pixel ``(n, 4)``, its level the variance for now; its reflected light."""
    camera, projector = devices
    pixels = camera.pixel_grid() + offset
    eyes, directions = camera.rays(pixels)
    sight = caster.look(eyes, directions, pixel_rad=ray_angle(camera, effects.samples))
    passed = vignetting(pixels, camera, effects.camera.vignetting)
    shown = projector.pixels(sight.points)
    sigma = blur_sigma_px(projector.depths(sight.points), effects.projector)
    lights = projector.origins_of(sight.points)
    gain = _reflect(caster.scene, sight, eyes=eyes, lights=lights)
    gain[~_in_beam(shown, sigma, projector, effects=effects.projector)] = 0.0
    lit = np.flatnonzero(gain)
    gain[lit[caster.hidden(sight.points[lit], lights[lit])]] = 0.0
    gain[lit] *= vignetting(shown[lit], projector, effects.projector.vignetting)
    gain *= effects.projector.focus_mm**2 * passed
    out[:, U], out[:, V], out[:, LEVEL], out[:, GAIN] = *shown.T, sigma**2, gain
    return np.where(sight.surface >= 0, sight.albedo * passed, 0.0)


def _reflect(scene: Scene, sight: Sight, *, eyes: Array, lights: Array) -> Array:
    out = np.empty(len(eyes))
    surfaces = (sight.points, sight.normals, sight.albedo, sight.surface)
    reflect_light(surfaces, eyes, lights, materials_of(scene), out)
    return out


def _in_beam(
    pixels: Array, sigma: Array, projector: Optics, *, effects: ProjectorEffects
) -> NDArray[np.bool_]:
    """Whether light comes by: inside the image or, blurred, near its edge."""
    if effects.lattice == "none":
        return projector.inside(pixels)
    reach = SIGMAS_KEPT * sigma + 1.0  # a diamond reaches a pixel beyond its centre
    u, v = pixels[:, 0], pixels[:, 1]
    down = reach * max(1.0, projector.lens.fy / projector.lens.fx)
    across = (u > -0.5 - reach) & (u < projector.width - 0.5 + reach)
    return np.asarray(across & (v > -0.5 - down) & (v < projector.height - 0.5 + down))


def _set_levels(samples: Floats, focus_px: float) -> Array:
    """Choose widths for the lit samples and turn their variances into levels."""
    lit = samples[..., GAIN] > 0
    variances = samples[..., LEVEL][lit].astype(np.float64)
    if variances.size == 0:
        return np.array([focus_px])
    sigmas = choose_sigmas(*np.sqrt([variances.min(), variances.max()]))
    samples[..., LEVEL][lit] = np.interp(variances, sigmas**2, np.arange(len(sigmas)))
    return sigmas
