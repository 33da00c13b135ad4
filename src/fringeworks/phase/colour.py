"""Colour-coded fringe order (Su): one frame in which every fringe has a colour.

Each channel is taken between black and white, ``v = (I - I_black) / (I_white - I_black)``, which
takes the surface's own colour and ambient light out. What is left is crosstalk: a channel of the
camera sees the projector's other primaries too, ``v = M t`` for the colour t. M is fitted to the
frame itself, from the colours that are nearest at first. A fringe near its edges sees two colours
and does not vote there; the others vote with a likelihood that no single pixel can turn, nor any
single fringe, and the sequence of a whole region decides (`sequence_decoding`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import Capture, Colour, FloatMap, Noise, WrappedPhase
from fringeworks.model.sequence import fringe_orders
from fringeworks.patterns.checks import parse_colour
from fringeworks.phase.chained import find_carrier, refine
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.phase.sequence_decoding import (
    admissible_starts,
    doubt_fringes,
    find_starts,
    gather_evidence,
    place_regions,
)
from fringeworks.phase.spatial import unwrap_spatial

EDGE_PX = 2.0
MOST_EDGE = 0.25
"""So near its fringe's edges, projector px but at most this share of it, a pixel is blurred."""

LEAST_CONTRAST_SIGMAS = 5.0
"""White must stand out so far from black in every channel."""

MODEL_SIGMA = 0.05
"""What the model of crosstalk leaves, share of white: gloss, projectors that mix light badly."""

LEAST_SHARE = 0.01
"""Share of all pixels that have any colour whatever."""

FITS = 3
"""Rounds of naming pixels and fitting crosstalk."""

Floats = NDArray[np.float32]


def order_by_colour(frames: AxisFrames) -> Ordered:
    """Orders of the fringes that the colours belong to, then of the finest.

    Raises
    ------
    DecodeError
        The capture has no colour frame along the axis, saw it in grey, has no white and black in
        colour, or no fringes of its period.
    """
    colour, shares, sigma = _find_shares(frames)
    carrier = find_carrier(frames, colour, name="colour frame")
    palette = list(dict.fromkeys(colour.palette))
    letters = np.array([palette.index(name) for name in colour.palette])
    orders = np.arange(
        len(fringe_orders(frames.capture.sequence.extent(frames.axis), colour.period_px))
    )
    likely = _letter_likelihood(shares, sigma, _primaries(palette), use=_inner(carrier))
    unwrapped = unwrap_spatial(carrier)
    starts = find_starts(
        doubt_fringes(gather_evidence(unwrapped, likely)),
        letters[orders % len(letters)],
        admissible=admissible_starts(unwrapped, frames.window),
    )
    route = (f"colour frame of {len(palette)} colours",)
    return refine(frames, place_regions(unwrapped, starts), route)


def _find_shares(frames: AxisFrames) -> tuple[Colour, Floats, Floats]:
    """The axis's first colour frame and, ``(3, H, W)``, what it is between black and white."""
    capture = frames.capture
    for colour, images, _ in capture.find(Colour):
        if colour.axis == frames.axis:
            if images.ndim != 4:
                raise DecodeError(
                    f"the colour frame along {frames.axis} was seen in grey: record it with a "
                    "colour camera"
                )
            _check_exposure(capture, colour)
            seen = images.mean(axis=0, dtype=np.float32)
            return colour, *_between(seen, capture, frames.finest.noise)
    raise DecodeError(
        f"the capture has no colour frame along {frames.axis}: add one (`--code colour`), or "
        "choose another method"
    )


def _check_exposure(capture: Capture, colour: Colour) -> None:
    """White and black in colour are those of their first set: the colour frame's must be alike."""
    shown = capture.sequence
    places = [place for place in (shown.white_set, shown.black_set) if place is not None]
    uniform = {shown.sets[place].exposure_ms for place in places}
    first = next(item.exposure_ms for item in shown.sets if item.pattern == colour)
    if shown.reference_ms is not None and uniform - {first}:
        raise DecodeError(
            f"the first colour frame along {colour.axis} and the first white and black must have "
            "one exposure: put those of equal exposure_ms first in capture.toml"
        )


def _between(seen: Floats, capture: Capture, noise: Noise) -> tuple[Floats, Floats]:
    """Shares of white and their sigma, ``(3, H, W)``; NaN where they say nothing."""
    white, black = capture.colour, capture.dark_colour
    if white is None or black is None:
        missing = "white" if white is None else "black"
        raise DecodeError(
            f"colours are told between black and white, and the capture has no {missing} frame "
            "in colour: record it with the same camera"
        )
    span = np.asarray(white.astype(np.float32) - black, np.float32)
    grain = np.asarray(noise.sigma(seen), np.float32)
    lit = (span > LEAST_CONTRAST_SIGMAS * grain) & (white < capture.sensor.saturation)
    span[~lit.all(axis=-1)] = np.nan
    shares = np.asarray((seen - black) / span, np.float32)
    sigma = np.asarray(np.sqrt(2) * grain / span, np.float32)
    return np.moveaxis(shares, -1, 0), np.moveaxis(sigma, -1, 0)


def _primaries(palette: list[str]) -> Floats:
    """``(3, colours)``, 0 to 1."""
    return np.array([parse_colour(name) for name in palette], np.float32).T


def _inner(carrier: WrappedPhase) -> NDArray[np.bool_]:
    edge = min(EDGE_PX / carrier.fringe.period_px, MOST_EDGE)
    inside: NDArray[np.bool_] = np.abs(carrier.phase) < 2 * np.pi * (0.5 - edge)
    return inside


def _letter_likelihood(
    shares: Floats, sigma: Floats, primaries: Floats, *, use: NDArray[np.bool_]
) -> FloatMap:
    """Log-likelihood ``(colours, H, W)`` of every colour; NaN outside `use` and where unknown."""
    use = use & np.isfinite(shares).all(axis=0)
    seen, spread = shares[:, use], np.hypot(sigma[:, use], np.float32(MODEL_SIGMA))
    weight, mixing = spread.max(axis=0), np.eye(3, dtype=np.float32)
    for _ in range(FITS):
        cost = _misfit(seen, spread, mixing @ primaries)
        shown = primaries[:, cost.argmin(axis=0)]
        mixing = _fit_mixing(seen / weight, shown / weight, before=mixing)
    cost = _misfit(seen, spread, mixing @ primaries)
    odds = np.exp(-0.5 * (cost - cost.min(axis=0)))
    odds /= odds.sum(axis=0)
    likely = np.full((len(primaries.T), *use.shape), np.nan, np.float32)
    likely[:, use] = np.log((1 - LEAST_SHARE) * odds + LEAST_SHARE / len(odds))
    return likely


def _misfit(seen: Floats, spread: Floats, expected: Floats) -> Floats:
    """Chi squared ``(colours, n)`` of shares ``(3, n)``."""
    return np.stack(
        [np.square((seen - colour[:, None]) / spread).sum(axis=0) for colour in expected.T]
    )


def _fit_mixing(seen: Floats, shown: Floats, *, before: Floats) -> Floats:
    """M of ``seen = M shown`` by least squares; as before where the colours do not tell it."""
    normal = shown @ shown.T
    if np.linalg.matrix_rank(normal) < 3:
        return before
    return np.linalg.solve(normal, shown @ seen.T).T.astype(np.float32)
