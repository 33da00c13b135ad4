"""Which parts of the two images the boards never were in, though measuring will use them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import ImageSize
from fringeworks.geometry.lens import pixel_rays, project
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Finding

Array = NDArray[np.float64]
Sizes: TypeAlias = tuple[ImageSize, ImageSize]

GRID = (30, 24)
PARTS = (
    ("upper left", "upper middle", "upper right"),
    ("middle left", "middle", "middle right"),
    ("lower left", "lower middle", "lower right"),
)
LEAST_USED = 0.03
"""Of all places, that a part must hold to be used at all."""

LARGEST_BARE = 0.5
"""Of the used places; less is what fourteen poses of a board leave of the corners."""


def notice_bare_parts(fit: Fit, views: Sequence[View], sizes: Sizes) -> Iterator[Finding]:
    """A finding for a device of whose used image more than half lies in parts without a board."""
    camera, projector = _used_places(fit, views, sizes)
    seen = (
        [np.concatenate([view.camera_px[view.kept], view.sites.camera_px]) for view in views],
        [np.concatenate([view.projector_px[view.kept], view.sites.projector_px]) for view in views],
    )
    devices = zip(("camera", "projector"), (camera, projector), seen, sizes, strict=True)
    for device, used, observed, size in devices:
        bare, share = bare_parts(used, np.concatenate(observed), size)
        if share > LARGEST_BARE:
            yield Finding(
                "warning",
                f"no board was in {share:.0%} of the {device}'s image: {', '.join(bare)}. Its lens "
                "is guessed there.",
                "Add poses with the board in those parts, or a larger board.",
                name="bare image",
                where=device,
            )


def bare_parts(used: Array, seen: Array, size: ImageSize) -> tuple[list[str], float]:
    """Ninths of an image without any of ``(m, 2)`` px seen, and their share of those used."""
    at, there = _ninth(used, size), set(_ninth(seen, size).tolist())
    counts = np.bincount(at, minlength=9)
    bare = [n for n in range(9) if counts[n] > LEAST_USED * len(at) and n not in there]
    return [PARTS[n // 3][n % 3] for n in bare], float(counts[bare].sum() / max(len(at), 1))


def _ninth(places: Array, size: ImageSize) -> NDArray[np.intp]:
    scaled = (places + 0.5) / [size.width, size.height]
    inside = scaled[((scaled >= 0) & (scaled < 1)).all(axis=1)]
    x, y = (3 * inside).astype(np.intp).T
    return np.asarray(3 * y + x, dtype=np.intp)


def _used_places(fit: Fit, views: Sequence[View], sizes: Sizes) -> tuple[Array, Array]:
    """Places all over the camera's image, and their projector px at the boards' depths."""
    size, state = sizes[0], fit.state
    x, y = np.meshgrid(
        *(np.linspace(0, n - 1, k) for n, k in zip((size.width, size.height), GRID, strict=True))
    )
    camera = np.column_stack([x.ravel(), y.ravel()])
    rays = pixel_rays(camera, state.camera)
    depths = [
        view.kept_in_camera(pose)[:, 2]
        for view, pose in zip(views, state.camera_from_board, strict=True)
    ]
    near, far = np.min(np.concatenate(depths)), np.max(np.concatenate(depths))
    points = np.concatenate([rays * near, rays * far])
    relation = state.projector_from_camera
    moved = points @ rotation_matrix(relation[:3]).T + relation[3:]
    return camera, project(moved, state.projector)
