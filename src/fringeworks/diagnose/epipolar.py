"""With a rig: whether both coordinates of a pixel belong to one ray of the projector."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.suspicion import Suspicion
from fringeworks.errors import FringeworksError
from fringeworks.model import CodedAxis, FloatMap, ProjectorMap, Rig
from fringeworks.phase.window import volume_of
from fringeworks.reconstruct.full import CloudRules, triangulate

LARGEST_PX = 0.35
"""Median distance from the epipolar line; calibrated rigs leave up to 0.2 px."""

SIGMAS = 4.0
FAR_PX = 3.0
"""Beyond it something else than a shift is looked for."""

MENDED = 0.2


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why points are off their lines: the fault's name, words for the message, the remedy."""

    name: str
    words: str
    remedy: str


MOVED = Explanation(
    "epipolar",
    "",
    "Camera or projector has moved, zoom or focus has changed, or this is another rig: run "
    "`fringeworks verify`, then calibrate again.",
)
EVERYWHERE = CloudRules(z_range_mm=(1.0, 1e6), epipolar_px=np.inf, edges=None, exact=True)


def mm_per_px(projector_map: ProjectorMap, rig: Rig) -> float | None:
    """Error of depth, mm, of a projector px's error, median over the points of the best axis.

    Of the points inside the rig's volume: what was decoded wrong lies anywhere.
    """
    volume, worth = volume_of(rig), []
    rules = EVERYWHERE if volume is None else replace(EVERYWHERE, z_range_mm=volume.z_range_mm)
    for axis in projector_map.axes:
        try:
            cloud = triangulate(projector_map, rig, rules=replace(rules, axis=axis.axis))
        except FringeworksError:
            continue
        worth.append(float(np.nanmedian(cloud.sigma_mm / axis.sigma)))
    known = [value for value in worth if np.isfinite(value)]
    return min(known) if known else None


def find_misses(projector_map: ProjectorMap, rig: Rig) -> Iterator[Suspicion]:
    """Points off their epipolar line, and why they are."""
    if projector_map.column is None or projector_map.row is None:
        return
    misses = _misses(projector_map, rig)
    if misses is None or not np.isfinite(misses).any():
        return
    typical = float(np.nanmedian(np.abs(misses)))
    sigmas = [float(np.nanmedian(axis.sigma)) for axis in projector_map.axes]
    noise = float(np.hypot(sigmas[0], sigmas[1]))
    if typical <= max(LARGEST_PX, SIGMAS * noise):
        return
    found = _explain(projector_map, rig, typical) if typical > FAR_PX else MOVED
    yield Suspicion(
        found.name,
        typical,
        f"the points miss their epipolar lines by {typical:.2f} px, median{found.words}.",
        found.remedy,
        "rig",
        np.asarray(np.abs(misses), np.float32),
        "distance from the epipolar line, projector px",
    )


def _explain(projector_map: ProjectorMap, rig: Rig, typical: float) -> Explanation:
    """The assumption that brings the points onto their lines, else that something has moved."""
    for cause, other in _others(projector_map):
        left = _misses(other, rig)
        if left is not None and np.nanmedian(np.abs(left)) < MENDED * typical:
            return cause
    return MOVED


def _misses(projector_map: ProjectorMap, rig: Rig) -> FloatMap | None:
    try:
        return triangulate(projector_map, rig, rules=EVERYWHERE).epipolar_px
    except FringeworksError:
        return None


def _others(found: ProjectorMap) -> Iterator[tuple[Explanation, ProjectorMap]]:
    """The map under other assumptions."""
    column, row = found.column, found.row
    assert column is not None
    assert row is not None
    swapped = Explanation(
        "axes swapped",
        "; with the sets of the two axes exchanged they meet them",
        "Exchange axis x and y of the sets in capture.toml.",
    )
    yield swapped, ProjectorMap(replace(row, axis="x"), replace(column, axis="y"))
    plain, back = slice(None), slice(None, None, -1)
    flips = {
        "flipped left to right": (plain, back),
        "flipped top to bottom": (back, plain),
        "turned by 180 degrees": (back, back),
    }
    for words, (rows, columns) in flips.items():
        mirrored = Explanation(
            "mirrored",
            f"; with the camera's image {words} they meet them",
            "Undo the mirroring in the camera's or the graphics driver's settings.",
        )
        yield (
            mirrored,
            ProjectorMap(_picked(column, rows, columns), _picked(row, rows, columns)),
        )


def _picked(axis: CodedAxis, rows: slice, columns: slice) -> CodedAxis:
    def pick(image: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.ascontiguousarray(image[rows, columns])

    return replace(
        axis,
        coordinate=pick(axis.coordinate),
        sigma=pick(axis.sigma),
        offset=pick(axis.offset),
        modulation=pick(axis.modulation),
        phase=None,
        void=np.ascontiguousarray(axis.void[rows, columns]),
    )
