"""What a point's neighbours tell: noise and normals, on any points, organised or not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial import KDTree

Array = NDArray[np.float64]

PLANE_FREEDOM = 3


def tree_of(points: Array) -> KDTree:
    """For questions about neighbours of points ``(n, 3)``."""
    from scipy.spatial import KDTree

    return KDTree(points, balanced_tree=False, compact_nodes=False)


def local_planes(points: Array, tree: KDTree, *, count: int) -> tuple[Array, Array]:
    """Unit normals ``(m, 3)`` and rms distances ``(m,)`` of planes through neighbours, mm.

    `points` ``(m, 3)`` are looked up in `tree`, whose `count` nearest points make each plane; the
    rms is per degree of freedom. The sign of a normal has no meaning.
    """
    count = min(count, tree.n)
    _, places = tree.query(points, count)
    around = np.asarray(tree.data)[places]
    centred = around - around.mean(axis=1, keepdims=True)
    spread, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", centred, centred))
    freedom = max(count - PLANE_FREEDOM, 1)
    return axes[..., 0], np.sqrt(np.maximum(spread[:, 0], 0.0) / freedom)


def spacing_of(points: Array, tree: KDTree) -> float:
    """Median distance of points ``(m, 3)`` from their nearest neighbour in `tree`, mm."""
    distances, _ = tree.query(points, [min(2, tree.n)])
    return float(np.median(distances))
