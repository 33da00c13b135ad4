"""What each way of telling fringe orders makes of the same scene as the scene gets worse.

Two isolated objects before the paper's rig, with half the camera's pixels each way: the twin knows
each pixel's order. Every method reads a capture of its own patterns; the fringes are three steps of
32 px in all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fringeworks.errors import DecodeError
from fringeworks.experiments.truth import inner_pixels
from fringeworks.model import Capture, Fringe, Rig, Sequence, Uniform
from fringeworks.patterns import make_sequence
from fringeworks.phase.chained import order_by_frequencies, order_by_gray
from fringeworks.phase.codeframe import order_by_code_frame
from fringeworks.phase.colour import order_by_colour
from fringeworks.phase.demodulate import demodulate
from fringeworks.phase.number_theory import order_by_number_theory
from fringeworks.phase.objects import by_objects, depth_window
from fringeworks.phase.orders import AxisFrames, OrderMethod
from fringeworks.phase.paper_code import code_correlation, paper_code
from fringeworks.phase.staircase import order_by_staircase
from fringeworks.phase.window import Volume, coordinate_window
from fringeworks.twin.effects import Effects, crosstalk_response
from fringeworks.twin.scene import Scene
from fringeworks.twin.simulate import simulate
from fringeworks.twin.truth import Truth

PERIOD_PX = 32.0
B_SHARE = 0.2
"""Modulation of the scene's fringes, share of full scale: the median pixel's."""

CROSSTALK = 0.1
"""Of the colour camera, where nothing else is said."""

RANGE_MM = (550.0, 800.0)
"""Where objects may be: three fringes deep."""

NARROW_MM = (625.0, 700.0)
"""Not quite the depth of one fringe about the scene, which fills 627 to 698 mm of it."""


DEEPER_MM = (610.0, 715.0)
"""For whole objects of 38 and 46 mm: deeper than a fringe, by less than an object."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A method with the patterns that it reads.

    Attributes
    ----------
    name
        As on the command line, or what tells two uses of one method apart.
    tell
        The method.
    options
        Of ``make_sequence("paper", ...)``.
    range_mm
        Where objects may be, for methods that ask for it.
    """

    name: str
    tell: OrderMethod
    options: Mapping[str, Any] = field(default_factory=dict)
    range_mm: tuple[float, float] | None = None

    def sequence(self, rig: Rig) -> Sequence:
        given: dict[str, Any] = {
            "axes": ("x",),
            "periods_px": (PERIOD_PX,),
            "code": "none",
            "codewords_px": (),
        }
        size = rig.projector
        return make_sequence(
            "paper", width=size.width, height=size.height, **{**given, **self.options}
        )

    @property
    def in_colour(self) -> bool:
        return self.options.get("code") == "colour"

    def frames(self, rig: Rig) -> int:
        """Images of one axis: fringes and code, white and black too where they are read."""
        sets = self.sequence(rig).sets
        return sum(
            item.image_count
            for item in sets
            if self.in_colour or not isinstance(item.pattern, Uniform)
        )


WORDS = {"codewords_px": "paper"}

CONTENDERS = (
    Contender("gray", order_by_gray, {"code": "gray"}),
    Contender("complementary gray", order_by_gray, {"code": "complementary"}),
    Contender("staircase", order_by_staircase, {"code": "staircase"}),
    Contender("colour", order_by_colour, {"code": "colour"}),
    Contender("hierarchical", order_by_frequencies, {"periods_px": (638.4, 128.0, 32.0)}),
    Contender("heterodyne", order_by_frequencies, {"periods_px": (32.0, 33.69, 40.53)}),
    Contender("number-theoretical", order_by_number_theory, {"periods_px": (32.0, 40.0, 50.0)}),
    Contender("code-frame", order_by_code_frame, WORDS, RANGE_MM),
    Contender("code-frame, robust", order_by_code_frame, {"codewords_px": "robust"}, RANGE_MM),
    Contender("code-frame, de-bruijn", order_by_code_frame, {"codewords_px": "de-bruijn"}),
    Contender("code-correlation", code_correlation, WORDS, RANGE_MM),
    Contender("paper-code", paper_code, WORDS, RANGE_MM),
    Contender("depth-window", depth_window, range_mm=NARROW_MM),
    Contender("objects", by_objects, range_mm=DEEPER_MM),
)


@dataclass(frozen=True, slots=True)
class Condition:
    """One thing that gets worse.

    Attributes
    ----------
    name, unit
        Of what changes.
    levels
        From harmless to bad.
    told
        The one of them that the table tells.
    change
        The effects at a level.
    """

    name: str
    unit: str
    levels: tuple[float, ...]
    told: float
    change: Callable[[Effects, float], Effects]

    def admits(self, contender: Contender) -> bool:
        """Crosstalk is for those who look at colours."""
        return contender.in_colour or self.name != "crosstalk"


def _noisy(effects: Effects, sigma: float) -> Effects:
    """Read noise of `sigma` times B; the shot noise of every camera comes on top."""
    electrons = sigma * B_SHARE * effects.camera.full_well_e
    return replace(effects, camera=replace(effects.camera, read_noise_e=electrons))


def _blurred(effects: Effects, columns: float) -> Effects:
    return replace(effects, projector=replace(effects.projector, blur_px=columns))


def _pale(effects: Effects, black: float) -> Effects:
    return replace(effects, projector=replace(effects.projector, black_light=black))


def _textured(effects: Effects, share: float) -> Effects:
    """Every pixel has a gain of its own: an albedo that changes from pixel to pixel."""
    return replace(effects, camera=replace(effects.camera, prnu=share))


def _lit(effects: Effects, share: float) -> Effects:
    per_ms = share / effects.camera.exposure_ms
    return replace(effects, ambient=replace(effects.ambient, light_per_ms=per_ms))


def _mixed(effects: Effects, share: float) -> Effects:
    response = crosstalk_response(share)
    return replace(effects, camera=replace(effects.camera, colour_response=response))


CONDITIONS = (
    Condition("noise", "sigma / B", (0.01, 0.05, 0.1, 0.15, 0.2), 0.2, _noisy),
    Condition("blur", "projector px", (0.4, 0.8, 1.2, 2.0, 3.0, 4.0), 1.2, _blurred),
    Condition("contrast", "black / white", (0.0, 0.2, 0.4, 0.6, 0.8), 0.6, _pale),
    Condition("texture", "sd of albedo", (0.01, 0.1, 0.2, 0.3, 0.5), 0.3, _textured),
    Condition("ambient", "share of full scale", (0.0, 0.2, 0.4, 0.6, 0.8), 0.4, _lit),
    Condition("crosstalk", "share of a neighbour", (0.0, 0.1, 0.2, 0.3, 0.4), 0.2, _mixed),
)


@dataclass(frozen=True, slots=True)
class Told:
    """What a method told of one capture.

    Attributes
    ----------
    pixels
        Those with a wrapped phase, on one lit surface with all their neighbours.
    certain, wrong
        How many of them have an order, and how many a wrong one.
    refusal
        Why there is none, where the method raised an error; empty otherwise.
    """

    pixels: int
    certain: int
    wrong: int
    refusal: str = ""

    @property
    def coverage(self) -> float:
        return self.certain / max(self.pixels, 1)

    @property
    def wrong_share(self) -> float:
        """Of the certain ones; NaN without any."""
        return self.wrong / self.certain if self.certain else np.nan


def run_trials(
    contenders: tuple[Contender, ...],
    scene: Scene,
    rig: Rig,
    effects: Effects,
    *,
    rng: np.random.Generator,
) -> dict[str, Told]:
    """One capture per sequence, and what every contender tells of its own."""
    captures: dict[Sequence, tuple[Capture, Truth]] = {}
    told = {}
    for contender in contenders:
        sequence = contender.sequence(rig)
        if sequence not in captures:
            seen = effects
            if contender.in_colour and not effects.camera.colour_response:
                seen = _mixed(effects, CROSSTALK)
            made = simulate(scene, rig, sequence, effects=seen, rng=rng)
            captures[sequence] = made.capture, made.truth
        told[contender.name] = judge(contender, *captures[sequence], rig)
    return told


def judge(contender: Contender, capture: Capture, truth: Truth, rig: Rig) -> Told:
    """Hold the orders of a capture against the truth."""
    phases = tuple(
        demodulate(images, fringe, capture.sensor, repeats=repeats)
        for fringe, images, repeats in capture.find(Fringe)
    )
    window = None
    if contender.range_mm is not None:
        window = coordinate_window(Volume(rig, contender.range_mm), "x", capture.shape)
    frames = AxisFrames(capture, "x", phases, window)
    wrapped = frames.finest
    use = inner_pixels(truth) & np.isfinite(wrapped.phase)
    try:
        ordered = contender.tell(frames)
    except DecodeError as error:
        return Told(int(use.sum()), 0, 0, str(error))
    turns = (truth.column - wrapped.fringe.zero_px) / wrapped.fringe.period_px
    true = np.rint(turns - wrapped.phase / (2 * np.pi))
    certain = use & np.isfinite(ordered.phase.margin)
    wrong = certain & (ordered.phase.order != true)
    return Told(int(use.sum()), int(certain.sum()), int(wrong.sum()))
