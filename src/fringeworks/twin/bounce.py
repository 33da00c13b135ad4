"""Light that goes from one surface to another before the camera sees it: one bounce.

The projector's image is cut into blocks. Where a block's middle lands there is a patch; its area,
its distance and its slope cancel, so that it receives ``intensity x solid angle of the block``.
Patches light a coarse grid of camera pixels by form factors (diffusely: a gloss lobe is left out),
with shadows, and within each surface the grid is spread to all pixels. Narrow parts of a surface
without a grid point stay dark.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.shading import exchange_light
from fringeworks.twin.cast import Caster, Sight
from fringeworks.twin.effects import ProjectorEffects
from fringeworks.twin.optics import Optics
from fringeworks.twin.shade import vignetting

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array: TypeAlias = NDArray[np.float64]
Floats: TypeAlias = NDArray[np.float32]

BLOCKS = 24
"""Blocks of the projector's image along each axis."""

GRID_PX = 8
"""Camera pixels from one receiver to the next."""

LEAST_COSINE = 0.02
"""A patch lit at a more grazing angle than this is too long to stand for its middle."""

SAME_FACING = 0.8
"""Cosine of two normals above which receivers of one object are on the same face."""

OTHER_FACE = 1e-3
"""Weight of a receiver on another face: it counts only where none is on the same."""

PAIRS_AT_ONCE = 200_000


@dataclass(frozen=True, slots=True, eq=False)
class Bounce:
    """What carries the light of a shown image to the camera's pixels over other surfaces.

    Attributes
    ----------
    carried
        ``(receivers, BLOCKS^2)`` float32: irradiance for a block of white.
    spread
        ``(H W, receivers)``: from the receivers to all pixels.
    """

    carried: Floats
    spread: csr_array

    def gather(self, light: Floats, *, width: int, height: int) -> Floats:
        """Indirect irradiance ``(height, width)`` while the projector shows light ``(H, W)``."""
        means = block_means(light).astype(np.float32).ravel()
        return np.asarray(self.spread @ (self.carried @ means)).reshape(height, width)


def find_bounce(
    caster: Caster, camera: Optics, projector: Optics, *, effects: ProjectorEffects
) -> Bounce:
    """Prepare the bounce for a scene that stands still."""
    senders = _find_patches(caster, projector, effects)
    columns, rows = _grid(camera.width), _grid(camera.height)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(np.float64)
    receivers = caster.look(*camera.rays(pixels))
    carried = _carry(caster, senders, receivers)
    full = caster.look(*camera.rays(camera.pixel_grid()))
    return Bounce(carried, _spread(full, receivers, columns=columns, rows=rows))


@dataclass(frozen=True, slots=True, eq=False)
class _Patches:
    """Where the middles of blocks land: ``(n, 3)`` mm, areas mm^2, radiosity for white."""

    points: Array
    normals: Array
    areas: Array
    radiosity: Array


def block_means(light: Floats) -> Array:
    """Means ``(BLOCKS, BLOCKS)`` of an image ``(H, W)`` over its blocks."""
    first_rows, first_columns = (_edges(count)[:-1] for count in light.shape)
    sums = np.add.reduceat(np.add.reduceat(light, first_rows, axis=0), first_columns, axis=1)
    sizes = [np.diff(_edges(count)) for count in light.shape]
    return np.asarray(sums / np.outer(*sizes))


def _edges(count: int) -> NDArray[np.int64]:
    """First pixels of the blocks along one axis, and the end."""
    return np.linspace(0, count, min(BLOCKS, count) + 1).astype(np.int64)


def _grid(count: int) -> NDArray[np.int64]:
    """Receivers along one axis, both ends among them."""
    return np.unique(np.append(np.arange(0, count, GRID_PX), count - 1))


def _find_patches(caster: Caster, projector: Optics, effects: ProjectorEffects) -> _Patches:
    u, v = _edges(projector.width) - 0.5, _edges(projector.height) - 0.5
    middle = np.stack(np.meshgrid((u[1:] + u[:-1]) / 2, (v[1:] + v[:-1]) / 2), axis=-1)
    size = np.stack(np.meshgrid(np.diff(u), np.diff(v)), axis=-1)
    middle, size = middle.reshape(-1, 2), size.reshape(-1, 2)
    origins, directions = projector.rays(middle)
    sight = caster.look(origins, directions)
    cosine = -np.sum(sight.normals * directions, axis=1)
    passed = vignetting(middle, projector, effects.vignetting)
    with np.errstate(invalid="ignore", divide="ignore"):
        areas = _solid_angles(projector, middle, size) * sight.distance**2 / cosine
        strength = passed * cosine * (effects.focus_mm / sight.distance) ** 2
    usable = (sight.surface >= 0) & (cosine > LEAST_COSINE)
    radiosity = np.where(usable, sight.albedo * strength, 0.0)
    return _Patches(sight.points, sight.normals, np.where(usable, areas, 0.0), radiosity)


def _solid_angles(projector: Optics, middle: Array, size: Array) -> Array:
    """Solid angles ``(n,)`` of blocks, from the directions through the middles of their sides."""
    across, down = (
        projector.rays(middle + half)[1] - projector.rays(middle - half)[1]
        for half in (size * (0.5, 0.0), size * (0.0, 0.5))
    )
    return np.asarray(np.linalg.norm(np.cross(across, down), axis=1))


def _carry(caster: Caster, senders: _Patches, receivers: Sight) -> Floats:
    """Irradiance ``(receivers, senders)`` for white, some senders at a time."""
    carried = np.zeros((len(receivers.points), len(senders.points)), np.float32)
    seen, sent = (np.flatnonzero(of) for of in (receivers.surface >= 0, senders.radiosity > 0))
    points, normals = receivers.points[seen], receivers.normals[seen]
    at_once = max(1, PAIRS_AT_ONCE // max(1, len(seen)))
    for start in range(0, len(sent), at_once):
        some = sent[start : start + at_once]
        factors = np.empty((len(seen), len(some)), np.float32)
        places = senders.points[some]
        patches = (places, senders.normals[some], senders.areas[some])
        exchange_light(patches, (points, normals), factors)
        i, j = np.nonzero(factors)
        hidden = caster.hidden(points[i], places[j])
        factors[i[hidden], j[hidden]] = 0.0
        carried[np.ix_(seen, some)] = factors * senders.radiosity[some].astype(np.float32)
    return carried


def _spread(
    full: Sight, receivers: Sight, *, columns: NDArray[np.int64], rows: NDArray[np.int64]
) -> csr_array:
    """Bilinear weights of the four receivers around each pixel, those of its own face alone."""
    from scipy.sparse import csr_array

    left, right = _brackets(columns)
    above, below = _brackets(rows)
    index, weight = [], []
    for down, row_share in (above, below):
        for across, column_share in (left, right):
            index.append((down[:, None] * len(columns) + across).ravel())
            share = (row_share[:, None] * column_share).ravel()
            weight.append(share * _likeness(full, receivers, index[-1]))
    weights, indices = np.stack(weight, axis=1), np.stack(index, axis=1)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0)
    ends = np.arange(0, weights.size + 1, 4)
    shape = (len(weights), len(receivers.points))
    return csr_array((weights.astype(np.float32).ravel(), indices.ravel(), ends), shape=shape)


def _brackets(
    places: NDArray[np.int64],
) -> tuple[tuple[NDArray[np.int64], Array], tuple[NDArray[np.int64], Array]]:
    """For each pixel up to the last place: the place before and after it, and their shares."""
    pixels = np.arange(places[-1] + 1)
    before = np.clip(np.searchsorted(places, pixels, "right") - 1, 0, max(len(places) - 2, 0))
    after = np.minimum(before + 1, len(places) - 1)
    gap = np.maximum(places[after] - places[before], 1)
    share = (pixels - places[before]) / gap
    return (before, 1 - share), (after, share)


def _likeness(full: Sight, receivers: Sight, index: NDArray[np.int64]) -> Array:
    """One where pixel and receiver lie on the same face, little on the same object, else zero."""
    same = (full.surface >= 0) & (full.surface == receivers.surface[index])
    facing = np.einsum("ij,ij->i", full.normals, receivers.normals[index])
    return np.where(same, np.where(facing > SAME_FACING, 1.0, OTHER_FACE), 0.0)
