"""How well each point of a cloud is known across a form: the weights of a weighted fit.

An error of depth moves a point along its ray (x / z, y / z, 1), so that across a surface of normal
n it counts ``sigma_z |n . ray|``: least where the surface is seen at a grazing angle. It is the
random part alone. What is systematic, as the mixing of edges and slopes within a pixel, is largest
just there, which is why no fit is weighted unless that is asked for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.geometry.forms.named import FormFit, shape_of
from fringeworks.measure.region import Region, chosen_pixels
from fringeworks.model import Cloud

Array = NDArray[np.float64]

LEAST_OF_MEDIAN = 0.2
"""No point counts for more than it would with this share of the median sigma."""


def normal_sigma(cloud: Cloud, region: Region | None, fit: FormFit) -> Array:
    """``(n,)`` random sigma, mm, of the region's points along the normals of a form through them.

    Raises
    ------
    MeasurementError
        The cloud does not keep the sigma of some of the points.
    """
    chosen = chosen_pixels(cloud, region or Region())
    sigma = cloud.sigma_mm[chosen].astype(np.float64)
    unknown = int(np.count_nonzero(~(sigma > 0)))
    if unknown:
        raise MeasurementError(
            f"{unknown} of the {len(sigma)} points have no sigma to weigh them by: scan into .npz "
            "or .ply, which keep it, or measure without weights"
        )
    seen = cloud.seen_from_camera()[chosen]
    rays = seen / seen[:, 2:]
    if cloud.frame_from_camera is not None:
        rays = rays @ cloud.frame_from_camera.rotation.T
    normals = shape_of(fit).normals(cloud.xyz[chosen].astype(np.float64))
    across = sigma * np.abs(np.einsum("ni,ni->n", normals, rays))
    return np.asarray(np.maximum(across, LEAST_OF_MEDIAN * np.median(across)))
