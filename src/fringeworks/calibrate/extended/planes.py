"""What the paper's ten parameters are fitted to: points on planes whose depth is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.sites import together

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class PlanePoints:
    """Points on planes whose depth is known; n of them.

    Attributes
    ----------
    rays
        ``(2, n)`` x and y of the calibrated, undistorted rays (x, y, 1).
    coordinate
        ``(n,)`` measured projector px along the phase axis.
    depth
        ``(n,)`` z of the plane along the ray, mm.
    sigma
        ``(n,)`` standard deviation of `coordinate`, px.
    plane
        ``(n,)`` which plane each lies on.
    """

    rays: Array
    coordinate: Array
    depth: Array
    sigma: Array
    plane: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.coordinate)

    def alike(self, scores: Array) -> float:
        """How far scores ``(n,)`` of neighbours on a plane are alike: 1 where not at all.

        A lens that the model cannot follow moves whole regions, and all pixels of one say no more
        than one; see `together`.
        """
        each = [
            together(scores[chosen, None], self.rays[:, chosen].T)
            for chosen in (self.plane == plane for plane in np.unique(self.plane))
        ]
        return max(1.0, float(np.mean(each)))
