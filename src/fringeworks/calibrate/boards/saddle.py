"""Where a checkerboard's corner is, to a hundredth of a pixel: a model of its image is fitted.

The corner of four squares is a saddle of grey levels: two crossing edges of one blur under light
that may slope (`kernels.saddle`). `cv2.cornerSubPix`, which asks that gradients stand at right
angles to the lines from the corner, errs by 0.02 to 0.04 px on sharp noise-free images; this fit
errs there by 0.0003 px, and with noise by what the noise allows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.saddle import ASTRAY, COLUMNS, FITTED, FLAT, VOID, fit_saddles

Array = NDArray[np.float64]

REACH = 0.45
"""Half the window in local squares: windows of neighbours share no pixel, so that the corners'
errors are independent, and the next edges, a whole square away, stay outside."""

LARGEST_REACH_PX = 20.0
"""The work grows with its square; and over longer arms a lens bends the edges."""

LARGEST_ARM_PX = 6.0
"""Further from both edges pixels say nothing about them, only of the light."""

MODEL_SIGMA_PX = 0.002
"""What a point spread that is no Gaussian leaves, added to the noise; a disc of 0.6 px standard
deviation leaves 0.0035 px."""

FALLBACK_SIGMA_PX = 0.2
"""Of a corner that keeps the detector's place: OpenCV's errs by 0.1 px and more."""

REASONS = {
    FITTED: "",
    VOID: "too few pixels about the corner",
    FLAT: "no contrast about the corner",
    ASTRAY: "the image about the corner is not that of four squares",
}


@dataclass(frozen=True, slots=True, eq=False)
class Saddles:
    """Refined corners; n of them.

    Attributes
    ----------
    pixels
        ``(n, 2)`` camera px; the start where nothing could be fitted.
    sigma
        ``(n, 2)`` standard deviations, px.
    reasons
        Why a corner keeps its start, empty where it was fitted.
    blur_px
        Standard deviation of the image's blur: the median of the fitted corners, NaN without.
    """

    pixels: Array
    sigma: Array
    reasons: tuple[str, ...]
    blur_px: float


def refine_saddles(
    image: NDArray[np.generic], start: Array, steps: Array, *, arm: Array | float = np.inf
) -> Saddles:
    """Fit the corners near `start` to the image's own grey levels.

    Parameters
    ----------
    image
        ``(H, W)`` grey levels of any depth; NaN is void. White that is cut off at full scale
        does not matter: it moves the edges on either side of the corner alike.
    start
        ``(n, 2)`` px, right to a fifth of a square.
    steps
        ``(n, 2, 2)`` px: the way to the next corner along the board's x, and along its y.
    arm
        How far from an edge pixels are used, in steps, where there is print inside the squares;
        one number or ``(n,)``.

    Notes
    -----
    Variances are the fit's own, from every pixel's residual, and `MODEL_SIGMA_PX` squared.
    """
    sides = np.linalg.norm(steps, axis=-1).max(axis=-1)
    reach = np.minimum(REACH, LARGEST_REACH_PX / sides)
    narrow = np.minimum(arm, LARGEST_ARM_PX / sides)
    windows = np.stack([reach, narrow], axis=-1)
    corners = np.concatenate([start, steps.reshape(-1, 4)], axis=1).astype(np.float64)
    results = np.empty((len(start), COLUMNS))
    values = np.array(image, dtype=np.float64, order="C")
    values[~np.isfinite(values)] = np.nan
    fit_saddles(values, corners, windows, results)
    fitted = results[:, 5:6] == FITTED
    sigma = np.sqrt(results[:, 2:4] + MODEL_SIGMA_PX**2)
    return Saddles(
        pixels=np.where(fitted, results[:, :2], start),
        sigma=np.where(fitted, sigma, FALLBACK_SIGMA_PX),
        reasons=tuple(REASONS[outcome] for outcome in results[:, 5]),
        blur_px=float(np.median(results[fitted[:, 0], 4])) if fitted.any() else np.nan,
    )
