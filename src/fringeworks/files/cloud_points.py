"""What the formats of points share: the valid points, their colours in 8 bit, and what is void."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.model import Cloud
from fringeworks.model.frame import UNKNOWN_FRAME

MAX_POINTS = 200_000_000
"""Most that a header is believed."""

WHITE_PERCENTILE = 99.5
"""Of deep grey levels, what becomes 255 in 8 bit: one glint does not darken the rest."""

LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601

RGB = ("red", "green", "blue")


def float32(array: NDArray[Any]) -> NDArray[np.float32]:
    """Single precision; what is too large for it is infinite, and so not valid."""
    with np.errstate(over="ignore", invalid="ignore"):
        return array.astype(np.float32)


def eight_bit(cloud: Cloud) -> NDArray[np.uint8]:
    """RGB ``(n, 3)`` of the valid points: the colour, else the grey of the intensity.

    Levels scale by 255 over their `WHITE_PERCENTILE` where that lies above 255; 8 bit stays as it
    is. So colours follow the levels steadily, whatever the sensor's depth.
    """
    if cloud.colour is not None:
        levels = cloud.colour[cloud.valid].astype(np.float32)
    else:
        levels = np.repeat(np.nan_to_num(cloud.intensity[cloud.valid])[:, None], 3, axis=-1)
    white = max(255.0, float(np.percentile(levels, WHITE_PERCENTILE)) if levels.size else 0.0)
    scaled: NDArray[np.uint8] = np.rint(np.clip(levels * (255 / white), 0, 255)).astype(np.uint8)
    return scaled


def points_cloud(
    path: Path,
    xyz: NDArray[Any],
    *,
    sigma_mm: NDArray[Any] | None = None,
    intensity: NDArray[Any] | None = None,
    rgb: NDArray[np.uint8] | None = None,
    frame: str = UNKNOWN_FRAME,
    scale_sigma: float | None = None,
) -> Cloud:
    """A cloud of what a file of points tells, ``(rows, columns, 3)``; the rest is NaN or None.

    `rgb` that is grey throughout is an intensity and no colour.

    Raises
    ------
    FormatError
        No point is finite.
    """
    single = float32(xyz)
    if not np.isfinite(single).all(axis=-1).any():
        raise FormatError(f"{path}: holds no points")
    void = np.full(xyz.shape[:2], np.nan, dtype=np.float32)
    grey = rgb is None or bool(np.all(rgb == rgb[..., :1]))
    if intensity is None and rgb is not None:
        intensity = rgb @ LUMA
    return Cloud(
        xyz=single,
        sigma_mm=void if sigma_mm is None else float32(sigma_mm),
        intensity=void if intensity is None else float32(intensity),
        epipolar_px=void,
        colour=None if grey else rgb,
        frame=frame,
        scale_sigma=scale_sigma,
    )
