"""Sites: camera pixels at which the decoded maps say where their light comes from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Sites:
    """Places ``(m, 2)``, camera px, taken as known, with what the maps say there.

    `projector_px` and its standard deviation `sigma_px` are ``(m, 2)``, column and row; none of
    them is void.
    """

    camera_px: Array
    projector_px: Array
    sigma_px: Array

    def __len__(self) -> int:
        return len(self.camera_px)

    def only(self, chosen: NDArray[np.bool_]) -> Sites:
        """The chosen ones, by a mask ``(m,)``."""
        parts = (self.camera_px, self.projector_px, self.sigma_px)
        return Sites(*(part[chosen] for part in parts))


CELLS_ACROSS = 4
"""Of the board's image, each way, over which sites are averaged to see how far they err alike."""


def together(scores: Array, places: Array) -> float:
    """Variance of the means of neighbouring scores over that of independent ones.

    Noise errs by itself, site by site: one. A board that is not flat or a lens beyond the model
    moves whole regions: as many as share a region, and so many times less do they say.

    Parameters
    ----------
    scores
        ``(m, 2)`` residuals over their standard deviations.
    places
        ``(m, 2)`` camera px.
    """
    low, high = places.min(axis=0), places.max(axis=0)
    across = np.minimum((places - low) / (high - low) * CELLS_ACROSS, CELLS_ACROSS - 1).astype(int)
    cell = across[:, 0] * CELLS_ACROSS + across[:, 1]
    count = np.bincount(cell)
    sums = np.stack([np.bincount(cell, score) for score in scores.T], axis=1)[count > 0]
    of_means = np.mean(sums**2 / count[count > 0, None])
    return float(of_means / np.mean(scores**2))
