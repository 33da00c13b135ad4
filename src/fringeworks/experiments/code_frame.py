"""The paper's section 5 on the digital twin: Table 1, figures 11 to 13, and its own check.

Two isolated objects, cylinder and cone; fringes of three steps, the code frame, and Gray code as
what the absolute phase must equal. The template is a pose of the calibration board.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fringeworks.model import AbsolutePhase, Capture, Fringe, Rig, Sequence
from fringeworks.patterns import make_sequence, render
from fringeworks.phase.codeframe import find_code_frame
from fringeworks.phase.codeword_names import (
    FRINGE_S,
    FringeCut,
    NameCodeword,
    name_by_spectrum,
    peak_frequency,
    table_hz,
)
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.demodulate import demodulate, wrap_three_steps
from fringeworks.phase.feature_points import find_periods
from fringeworks.phase.orders import AxisFrames, OrderMethod
from fringeworks.phase.paper_code import cut_fringe, read_code_frame
from fringeworks.phase.regions import find_regions
from fringeworks.phase.template import template_window
from fringeworks.phase.window import CoordinateWindow
from fringeworks.report.canvas import save_figures
from fringeworks.report.code_frame import draw_code_reading, draw_pattern, draw_profile
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Scene
from fringeworks.twin.scenes import board_scene, paper_rig, two_scene
from fringeworks.twin.simulate import simulate

IDEAL_SAMPLES = 30
"""Of the 32 samples of a fringe: the cut from zero crossing to zero crossing loses two."""

IDEAL_OFFSET_HZ = 0.5

PROFILE_PX = 224
"""Figure 12 shows seven fringes: every codeword and the first again."""


@dataclass(frozen=True, slots=True)
class Printed:
    """A row of Table 1: the codeword's period, px, and its frequencies, Hz."""

    period_px: float
    ideal_hz: float
    captured_hz: float
    tolerance_hz: float


TABLE_1 = (
    Printed(2.0, 80.5, 82.0, 1.0),
    Printed(3.0, 53.2, 54.0, 0.5),
    Printed(4.0, 40.5, 41.0, 0.5),
    Printed(5.0, 32.6, 33.5, 0.5),
    Printed(6.0, 27.3, 28.0, 0.5),
    Printed(8.0, 20.5, 21.0, 0.5),
)


@dataclass(frozen=True, slots=True)
class Seen:
    """What the fringes of one codeword show in a capture.

    `median_hz` and `spread_hz`, half the range that holds the middle 80 %, are of the spectra's
    peaks; `right` is the share of the `fringes` that are named rightly.
    """

    median_hz: float
    spread_hz: float
    right: float
    fringes: int


@dataclass(frozen=True, slots=True)
class FringeScore:
    """Of all whole `fringes` of a capture the share that is `named`, and of those the `wrong`."""

    fringes: int
    named: float
    wrong: float


@dataclass(frozen=True, slots=True)
class Score:
    """A method's orders against the truth, shares of the pixels that Gray code orders.

    `differs` is the share of the ordered pixels whose absolute phase is not Gray code's.
    """

    ordered: float
    wrong: float
    differs: float


def ideal_hz(period_px: float) -> float:
    """Table 1, ideal column: the peak of a cosine sampled from 0 on, cut to 30 samples, zero mean.

    A fringe of 32 samples counts as 0.2 s, and 0.5 is added. This gives the printed figures but
    for 3 px: 53.7, where the paper has 53.2, the same peak without the 0.5.
    """
    cosine = np.cos(2 * np.pi * np.arange(IDEAL_SAMPLES) / period_px)
    return peak_frequency(cosine) * 32 / FRINGE_S + IDEAL_OFFSET_HZ


def captured_hz(period_px: float) -> float:
    """Table 1, captured column: ``160 / p + 1``, within every tolerance that it prints."""
    return table_hz(32 / period_px)


def twin_frames(
    scene: Scene, *, blur_px: float | None = None, seed: int = 0
) -> tuple[AxisFrames, NDArray[np.float64]]:
    """What the paper's rig captures of a scene along x, and the true column, px, ``(H, W)``.

    `blur_px` is the projector's point spread at every depth; None leaves the twin's own. Nothing
    is known beforehand of where the light comes from: see `see_template`.
    """
    effects = Effects()
    if blur_px is not None:
        sharp = replace(effects.projector, blur_px=blur_px, defocus_px_m=0.0)
        effects = replace(effects, projector=sharp)
    rig = paper_rig()
    rng = np.random.default_rng(seed)
    shown = simulate(scene, rig, _sequence(rig), effects=effects, rng=rng)
    return frames_of(shown.capture), shown.truth.column


def see_template(*, seed: int = 0) -> CoordinateWindow:
    """The window of the paper's template: the first pose of the board, ordered by Gray code."""
    frames, _ = twin_frames(board_scene().views()[0], seed=seed)
    code, _ = find_code_frame(frames)
    column = decode_phases(frames.capture).projector_map().column
    assert column is not None, "the sequence codes x"
    return template_window(column.coordinate, code)


def _sequence(rig: Rig) -> Sequence:
    projector = rig.projector
    return make_sequence("paper", width=projector.width, height=projector.height, axes=("x",))


def frames_of(capture: Capture) -> AxisFrames:
    """The capture's first fringes, demodulated, for methods that tell orders."""
    fringe, stack, repeats = capture.find(Fringe)[0]
    return AxisFrames(
        capture, fringe.axis, (demodulate(stack, fringe, capture.sensor, repeats=repeats),)
    )


def measure_codewords(frames: AxisFrames, column: NDArray[np.float64]) -> dict[float, Seen]:
    """Every whole fringe's peak by the period, px, of its true codeword: Table 1 as captured.

    `column` is the true one, px, ``(H, W)``.
    """
    code, _ = find_code_frame(frames)
    peaks: dict[int, list[tuple[float, bool]]] = {}
    for cut, true in _fringes_of(frames, column):
        index, margin = name_by_spectrum(cut, code)
        hertz = table_hz(peak_frequency(cut.grey) * cut.length_px)
        peaks.setdefault(true, []).append((hertz, margin > 0 and index == true))
    return {code.codewords_px[true]: _describe(peaks[true]) for true in sorted(peaks)}


def score_fringes(
    name: NameCodeword, frames: AxisFrames, column: NDArray[np.float64]
) -> FringeScore:
    """How often single fringes are named rightly: wherever a feature point could have been set."""
    code, _ = find_code_frame(frames)
    named = [(*name(cut, code), true) for cut, true in _fringes_of(frames, column)]
    certain = [index == true for index, margin, true in named if margin > 0]
    return FringeScore(len(named), len(certain) / len(named), 1 - float(np.mean(certain)))


def _fringes_of(frames: AxisFrames, column: NDArray[np.float64]) -> Iterator[tuple[FringeCut, int]]:
    """Every whole fringe and the index of its true codeword."""
    code, grey = find_code_frame(frames)
    region, phase = find_regions(frames.finest).region, frames.finest.phase
    order = true_order(frames, column)
    for period in find_periods(phase, region, code.axis):
        if np.isfinite(order[period.pixel]):
            true = code.codeword_of(int(order[period.pixel]))
            yield cut_fringe(period, grey, phase), code.codewords_px.index(true)


def _describe(peaks: list[tuple[float, bool]]) -> Seen:
    hertz, right = np.array(peaks, dtype=np.float64).T
    low, median, high = np.percentile(hertz, [10, 50, 90])
    return Seen(float(median), float(high - low) / 2, float(right.mean()), len(peaks))


def true_order(frames: AxisFrames, column: NDArray[np.float64]) -> NDArray[np.float64]:
    """The order that each pixel's wrapped phase has by the true column; NaN where void."""
    fringe = frames.finest.fringe
    turns = (column - fringe.zero_px) / fringe.period_px
    return np.rint(turns - frames.finest.phase / (2 * np.pi))


def score_method(method: OrderMethod, frames: AxisFrames, column: NDArray[np.float64]) -> Score:
    """Orders and absolute phase against the truth and against Gray code (the paper's check)."""
    gray = decode_phases(frames.capture).coded[0].phase
    assert gray is not None, "the capture has fringes"
    found, order = method(frames).phase, true_order(frames, column)
    placed = np.isfinite(gray.margin) & np.isfinite(order)
    both = placed & np.isfinite(found.margin)
    return Score(
        ordered=float(both.sum() / placed.sum()),
        wrong=_share(found.order != order, both),
        differs=_share(_differ(found, gray), both),
    )


def _differ(found: AbsolutePhase, gray: AbsolutePhase) -> NDArray[np.bool_]:
    return np.asarray(np.abs(found.phase - gray.phase) > 1e-9)


def _share(of: NDArray[np.bool_], among: NDArray[np.bool_]) -> float:
    return float(of[among].mean()) if among.any() else 0.0


def make_figures(folder: Path, *, seed: int = 0) -> list[Path]:
    """Figures 11, 12, 13a, 13b and 13c as PNG files, from the twin's scene `two`."""
    frames, _ = twin_frames(two_scene(), seed=seed)
    return save_figures(
        draw_code_frame(replace(frames, window=see_template(seed=seed + 1))), folder
    )


def draw_code_frame(frames: AxisFrames) -> Iterator[tuple[str, Figure]]:
    """Name and figure of each: the design, then what the method reads in the capture."""
    reading, shown = read_code_frame(frames), frames.capture.sequence
    fringe, code = frames.finest.fringe, reading.code
    width, height = shown.width, shown.height
    image = render(code, width=width, height=height)[0]
    sinusoids = render(fringe, width=width, height=height)[:, :1, :PROFILE_PX]
    phase = wrap_three_steps(sinusoids)
    zero_shift = sinusoids[fringe.shifts_rad.index(0.0), 0]
    yield "code_pattern", draw_pattern(image, code)
    yield "code_profile", draw_profile(zero_shift, image[0, :PROFILE_PX], phase[0], name="x")
    yield from draw_code_reading(reading)
