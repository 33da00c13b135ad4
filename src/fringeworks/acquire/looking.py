"""What a live image says of exposure and focus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from fringeworks.model import Frames, Sensor
from fringeworks.model.capture import to_grey

SATURATED_COLOUR = (255, 0, 0)
"""How saturated pixels are painted."""

SMOOTHING_PX = 1.0
"""Standard deviation of the blur that takes noise out of the focus figure."""


@dataclass(frozen=True, slots=True)
class Look:
    """Figures of one image.

    Attributes
    ----------
    saturated_share
        Share of pixels at or above the sensor's saturation.
    focus
        Standard deviation of the Laplacian of the smoothed image over its mean grey level. It is
        largest in focus; only images of one scene under one light can be compared.
    mean, least, most
        Grey levels.
    """

    saturated_share: float
    focus: float
    mean: float
    least: float
    most: float


def look_at(image: Frames, sensor: Sensor) -> Look:
    """The figures of a frame, ``(H, W)`` or ``(H, W, 3)``; a colour pixel's channels are averaged.

    A colour pixel is saturated where one of its channels is.
    """
    import cv2

    grey = to_grey(image)
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), SMOOTHING_PX)
    edges = cv2.Laplacian(smooth, cv2.CV_32F)
    mean = float(grey.mean())
    return Look(
        saturated_share=float(_saturated(image, sensor).mean()),
        focus=float(edges.std()) / mean if mean > 0 else 0.0,
        mean=mean,
        least=float(grey.min()),
        most=float(grey.max()),
    )


def paint(image: Frames, sensor: Sensor) -> Frames:
    """``(H, W, 3)`` uint8 for a screen: full scale is white, saturated pixels are red."""
    levels = np.clip(image * (255 / sensor.full_scale), 0, 255).astype(np.uint8)
    colours = np.repeat(levels[..., np.newaxis], 3, axis=2) if levels.ndim == 2 else levels.copy()
    colours[_saturated(image, sensor)] = SATURATED_COLOUR
    return cast(Frames, colours)


def _saturated(image: Frames, sensor: Sensor) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    brightest = image if image.ndim == 2 else image.max(axis=2)
    return np.asarray(brightest >= sensor.saturation)
