"""How much of each codeword's contrast reaches the camera.

A projector pixel is a box whose value is the pattern at its centre. What it shows of a cosine of
period p is that cosine, the copies of its frequency that sampling makes about every whole cycle
per pixel, and of each only the box's share: ``sum_f sinc(f) cos(2 pi f (xi - 1/2))`` over
f = 1/p, 1 - 1/p, 1 + 1/p. At p = 2 the first two coincide, and a code that only the camera had to
see would be brighter than its fringes. The optics then take ``exp(-2 pi^2 s^2 f^2)``, where s is
the blur in projector px: of the projector's lens, of the camera's, and of the phase's own noise,
which smears the abscissa. The fringes by which a code is measured lose their share too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Codeword

Array = NDArray[np.float64]

COPIES = ((0, 1), (1, -1), (1, 1))
"""Frequencies ``a + b / p`` of a sampled cosine; those above two cycles per px are never seen."""

BLURS_PX = (0.4, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0)
"""Blurs that are tried: between two of them no codeword's transfer changes by a third of B."""


def blur_transfer(frequency: Array | float, blur_px: Array | float) -> Array:
    """Share of a cosine's amplitude that a pixel's box and a blur leave; cycles per px, px."""
    smooth = np.exp(-2 * np.square(np.pi * np.asarray(blur_px) * frequency))
    return np.asarray(np.sinc(frequency) * smooth)


def draw_templates(code: Codeword, blurs_px: Sequence[float], bins: int) -> Array:
    """What c = (I - A) / B is inside a fringe: ``(blurs, codewords, bins)``.

    Bins divide the fringe evenly from xi = 0 to P, and each holds its mean.
    """
    width = code.period_px / bins
    places = (np.arange(bins) + 0.5) * width - 0.5
    words = np.array(code.codewords_px)[:, np.newaxis]
    blurs = np.array(blurs_px)[:, np.newaxis, np.newaxis]
    waves = np.zeros((len(blurs_px), len(words), bins))
    for whole, sign in COPIES:
        frequency = whole + sign / words
        mean = np.sinc(frequency * width) * np.cos(2 * np.pi * frequency * places)
        waves += blur_transfer(frequency, blurs) * mean
    return waves / blur_transfer(1 / code.period_px, blurs)
