"""The code frame, decoded densely: the most likely orders of every region, by all its pixels.

The paper (section 5) names one fringe of each region by the peak of its spectrum, and leaves
"combining the FFT and a correlation" to future work. Here the wrapped phase tells where in its
fringe every pixel lies, so that each codeword can be held against the frame as it was drawn:
position, scale and phase known, texture and ambient light divided out. With the blur's transfer
known too, that a codeword is *not* seen is evidence as well (p = 2 fades first), and all fringes
of a region are read together, since their orders follow each other (methods page, The code frame,
decoded well).

A code whose orders repeat needs to know where objects can be; one in which a few neighbours are
unique does not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.kernels.codeframe import write_orders
from fringeworks.model import (
    AbsolutePhase,
    Codeword,
    FloatMap,
    Frames,
    UnwrappedPhase,
    WrappedPhase,
)
from fringeworks.model.phase import VOID_ORDER, Void
from fringeworks.model.sequence import fringe_orders
from fringeworks.phase.borders import settle_borders
from fringeworks.phase.chained import refine
from fringeworks.phase.groups import Orders
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.phase.patches import Patches, fit_words, gather_patches
from fringeworks.phase.regions import EdgeRules, find_regions
from fringeworks.phase.starts import Starts, find_starts
from fringeworks.phase.transfer import BLURS_PX, draw_templates
from fringeworks.phase.window import CoordinateWindow

MOST_NEIGHBOURS = 3
"""Codes in which so many neighbours, or fewer, are unique need no window."""

SAMPLES_PER_PX = 0.5
"""Independent samples of the model's error along a fringe, per projector px."""

REGION_RULES = EdgeRules(change=0.5)
"""Brightness ends a region later than it does where nothing else shows a hidden jump: the code
shows it too, and every piece needs enough of the code."""

SATURATED_SHARE = 0.5
"""With more of the fringes' pixels saturated the code frame was exposed too long."""

LEAST_GAIN_NATS = 20.0
MOST_MISFIT = 0.3
ENOUGH_PIXELS = 1000
"""Below the first no code is seen, above the second something else is; fewer pixels than the
third cannot be blamed for it, and stay void."""


def order_by_code_frame(frames: AxisFrames) -> Ordered:
    """Orders of the fringes under a code frame, then of the finest.

    Where a region's best start is not a hundred times as likely as the second its pixels are
    void. The margin is one minus their odds.

    Raises
    ------
    DecodeError
        The capture has no code frame along the axis, or no fringes under it; its orders repeat
        and no window is known; it is saturated, or does not show the code.
    """
    code, image = find_code_frame(frames)
    wrapped = find_fringes(frames, code)
    orders = orders_of(code, frames.capture.sequence.extent(frames.axis))
    if frames.window is None and neighbours_needed(orders) > MOST_NEIGHBOURS:
        raise DecodeError(
            f"the code frame along {code.axis} repeats its codewords, and alone does not tell "
            "which fringe is which: say where objects can be, by --rig rig.json, whose volume "
            "counts, or with --z-range MIN:MAX as well; or add a Gray code"
        )
    saturation = frames.capture.saturation_of(code)
    refuse_saturated(image, wrapped, saturation)
    phase = decode_code_frame(
        image,
        code,
        find_regions(wrapped, REGION_RULES),
        orders,
        window=frames.window,
        saturation=saturation,
    )
    words = ", ".join(f"{word:g}" for word in code.codewords_px)
    return refine(frames, phase, (f"code frame of {words} px",))


def decode_code_frame(
    image: Frames | FloatMap,
    code: Codeword,
    unwrapped: UnwrappedPhase,
    orders: Orders,
    *,
    window: CoordinateWindow | None,
    saturation: float,
) -> AbsolutePhase:
    """Orders of unwrapped fringes by the grey levels ``(H, W)`` of a code frame.

    -1, and NaN margin, where they are not certain.

    Raises
    ------
    DecodeError
        The image does not show the code.
    """
    patches = gather_patches(image, code, unwrapped, window=window, saturation=saturation)
    templates = draw_templates(code, BLURS_PX, patches.weight.shape[1])
    starts = _decide(patches, templates, code, orders, windowed=window is not None)
    phase = _place(unwrapped, patches, starts)
    if starts is not None:
        settle_borders(
            phase,
            image,
            code,
            unwrapped,
            patches,
            starts,
            orders,
            templates,
            saturation=saturation,
        )
    return phase


def find_code_frame(frames: AxisFrames) -> tuple[Codeword, Frames | FloatMap]:
    """The axis's first code frame, and its grey levels ``(H, W)``."""
    for code, images, _ in frames.capture.find(Codeword):
        if code.axis == frames.axis:
            alone = len(images) == 1 and frames.capture.sequence.reference_ms is None
            return code, images[0] if alone else frames.capture.level_of(code)
    raise DecodeError(
        f"the capture has no code frame along {frames.axis}: add one (`--codewords paper`), or "
        "choose another method"
    )


def find_fringes(frames: AxisFrames, code: Codeword) -> WrappedPhase:
    """The fringes along whose phase a code frame is read."""
    for wrapped in frames.phases:
        fringe = wrapped.fringe
        if (fringe.period_px, fringe.zero_px) == (code.period_px, code.zero_px):
            return wrapped
    raise DecodeError(
        f"the code frame along {code.axis} is read against fringes of {code.period_px:g} px, and "
        "the capture has none: show them too, in the same group"
    )


def orders_of(code: Codeword, extent: int) -> Orders:
    """The codewords of all fringe orders that a projector of `extent` pixels shows."""
    shown = fringe_orders(extent, code.period_px, zero_px=code.zero_px)
    index = {word: place for place, word in enumerate(code.codewords_px)}
    words = np.array([index[code.codeword_of(order)] for order in shown], dtype=np.int32)
    return Orders(words, shown[0])


def neighbours_needed(orders: Orders) -> int:
    """How many neighbouring fringes it takes to tell which they are, anywhere in the image."""
    words = tuple(orders.words.tolist())
    for count in range(1, len(words) + 1):
        runs = [words[first : first + count] for first in range(len(words) - count + 1)]
        if len(set(runs)) == len(runs):
            return count
    return len(words)


def refuse_saturated(image: Frames | FloatMap, wrapped: WrappedPhase, saturation: float) -> None:
    """DecodeError where a code frame was exposed too long for the pixels that have fringes."""
    lit = wrapped.void == Void.VALID
    if not lit.any():
        return
    share = float(np.mean(image[lit] >= saturation))
    if share > SATURATED_SHARE:
        raise DecodeError(
            f"the code frame along {wrapped.fringe.axis} is saturated on {share:.0%} of the pixels "
            "that have fringes: expose it like them"
        )


def _decide(
    patches: Patches,
    templates: NDArray[np.float64],
    code: Codeword,
    orders: Orders,
    *,
    windowed: bool,
) -> Starts | None:
    """The starts of all patches; None where there is too little to tell."""
    if not len(patches.place):
        return None
    fit, flat = fit_words(patches, templates)
    starts = find_starts(patches, fit, flat, orders, samples=SAMPLES_PER_PX * code.period_px)
    unseen, strange = starts.gain < LEAST_GAIN_NATS, starts.misfit > MOST_MISFIT
    if (unseen or strange) and patches.pixels.sum() >= ENOUGH_PIXELS:
        shown = "something else" if strange else "no codewords, or is too blurred or noisy to tell,"
        raise DecodeError(
            f"the code frame along {code.axis} shows {shown} where the fringes are: are its image "
            "and those of the fringes in the order of capture.toml, and was nothing moved?"
            + windowed
            * " And is all that is seen within the depth range?"
        )
    return None if unseen or strange else starts


def _place(unwrapped: UnwrappedPhase, patches: Patches, starts: Starts | None) -> AbsolutePhase:
    """Every pixel by its patch."""
    order = np.full(unwrapped.turns.shape, VOID_ORDER, np.int32)
    margin = np.full(unwrapped.turns.shape, np.nan, np.float32)
    if starts is not None:
        shift = np.zeros(patches.slots, np.int32)
        sure = np.full(patches.slots, np.nan, np.float32)
        shift[patches.place], sure[patches.place] = starts.shift, -np.expm1(-starts.nats)
        write_orders(patches.index, unwrapped.turns, shift, sure, order, margin)
    return AbsolutePhase(unwrapped.wrapped, order, margin)
