"""From a capture to projector coordinates: demodulate every set, then order the finest.

Each axis is decoded by itself: its Gray code, if it has one, places a pixel within a cell; the
chain of `temporal` goes on from there to the finest period, from which the coordinate is taken.
A Gray code alone gives the centre of its cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fringeworks.errors import DecodeError
from fringeworks.model import (
    AXES,
    AbsolutePhase,
    Axis,
    Capture,
    CodedAxis,
    Fringe,
    GrayCode,
    ProjectorMap,
    Void,
    WrappedPhase,
    describe_voids,
)
from fringeworks.model.phase import VOID_ORDER
from fringeworks.phase.demodulate import MaskRules, demodulate
from fringeworks.phase.gray import GrayReading, read_gray
from fringeworks.phase.temporal import plan_chain, run_chain

OUTSIDE_SIGMAS = 5.0
"""A coordinate outside the projector's image by more than this many sigma is void."""

NOTHING_CODED = "The capture has neither fringes nor a Gray code"

SAFE_MARGIN = 0.1
SAFE_SIGMAS = 5.0
"""Under a Gray code noise decides the order where a doubtful bit leaves less margin than the
former, or where less is left than this many sigma of the phase. Only plain codes whose cells are
as wide as the fringes bring pixels there, at the edges of their cells."""


@dataclass(frozen=True, slots=True)
class Decoding:
    """All that a capture says of its pixels.

    Attributes
    ----------
    coded
        The axes whose projector coordinate is known.
    relative
        Finest fringes of the axes whose orders nothing tells, with the reason for each.
    """

    coded: tuple[CodedAxis, ...]
    relative: tuple[tuple[WrappedPhase, str], ...]

    def projector_map(self) -> ProjectorMap:
        """The coordinates of the axes that have any; an axis that is void everywhere is left out.

        Raises
        ------
        DecodeError
            No axis is coded, or no pixel of any coded axis is valid.
        """
        if not self.coded:
            reasons = "; ".join(f"axis {w.fringe.axis}: {why}" for w, why in self.relative)
            raise DecodeError(f"no axis has a projector coordinate. {reasons or NOTHING_CODED}")
        by_name = {axis.axis: axis for axis in self.coded if axis.valid_share}
        if not by_name:
            voids = "; ".join(f"{axis.axis}: {describe_voids(axis.void)}" for axis in self.coded)
            raise DecodeError(
                f"no pixel is valid along any axis ({voids}). Look at the frames' exposure, and "
                "at the order of the images in capture.toml"
            )
        return ProjectorMap(by_name.get("x"), by_name.get("y"))


def decode_capture(
    capture: Capture, *, group: str | None = None, rules: MaskRules | None = None
) -> ProjectorMap:
    """Projector coordinates of a capture; see `decode_phases`, which it calls.

    Raises
    ------
    DecodeError
        No axis of the capture can be decoded, or no pixel is valid.
    """
    return decode_phases(capture, group=group, rules=rules).projector_map()


def decode_phases(
    capture: Capture, *, group: str | None = None, rules: MaskRules | None = None
) -> Decoding:
    """Decode each axis that the capture's group codes.

    Parameters
    ----------
    capture
        Frames and their sequence.
    group
        Which alternative to decode, where the capture has several; the first by default.
    rules
        What makes a pixel void.

    Raises
    ------
    DecodeError
        One set of fringes stands in the group with several exposures.
    FormatError
        A Gray code has nothing to tell light from dark by.
    """
    chosen, rules = capture.select(group), rules or MaskRules()
    phases = {axis: _demodulate_axis(chosen, axis, rules) for axis in AXES}
    coded: list[CodedAxis] = []
    relative: list[tuple[WrappedPhase, str]] = []
    for axis in AXES:
        here, any_axis = phases[axis], [item for items in phases.values() for item in items]
        reading = read_gray(
            chosen,
            axis,
            fringes=next(iter(here or any_axis), None),
            least_modulation=rules.modulation_share * chosen.sensor.full_scale,
        )
        try:
            if here:
                coded.append(_axis_from_fringes(chosen.sequence.extent(axis), reading, here))
            elif reading is not None:
                coded.append(_axis_from_gray(chosen, reading, rules))
        except DecodeError as error:
            relative.append((_finest(here), str(error)))
    return Decoding(tuple(coded), tuple(relative))


def _demodulate_axis(capture: Capture, axis: Axis, rules: MaskRules) -> list[WrappedPhase]:
    phases: list[WrappedPhase] = []
    for fringe, frames, repeats in capture.find(Fringe):
        if fringe.axis != axis:
            continue
        if any(done.fringe == fringe for done in phases):
            raise DecodeError(
                f"fringes of {fringe.period_px:g} px along {axis} stand twice in one group: "
                "exposures are not fused yet; give each its own `group` in capture.toml"
            )
        phases.append(demodulate(frames, fringe, capture.sensor, repeats=repeats, rules=rules))
    return phases


def _finest(phases: Sequence[WrappedPhase]) -> WrappedPhase:
    return min(phases, key=lambda wrapped: wrapped.fringe.period_px)


def _axis_from_gray(capture: Capture, reading: GrayReading, rules: MaskRules) -> CodedAxis:
    """The centre of the cell."""
    contrast = reading.contrast
    least = np.maximum(
        rules.modulation_share * capture.sensor.full_scale,
        rules.modulation_sigmas * reading.noise.sigma(contrast.offset),
    )
    void = np.full(least.shape, Void.VALID, np.uint8)
    void[np.isnan(reading.coordinate)] = Void.ORDER
    void[contrast.modulation < least] = Void.MODULATION
    good, nan = void == Void.VALID, np.float32(np.nan)
    return CodedAxis(
        axis=reading.code.axis,
        coordinate=np.where(good, reading.coordinate, nan),
        sigma=np.where(good, reading.sigma, nan),
        offset=contrast.offset,
        modulation=contrast.modulation,
        phase=None,
        void=void,
        route=(_name_of(reading.code),),
    )


def _axis_from_fringes(
    extent: int, reading: GrayReading | None, phases: Sequence[WrappedPhase]
) -> CodedAxis:
    """The coordinate of the finest fringes, along the chain that `plan_chain` finds.

    It starts from the Gray code, or else from the centre of the projector's image for all pixels.
    """
    centre = (extent - 1) / 2
    reference, reach, route = np.full((1, 1), centre, np.float32), extent / 2, list[str]()
    if reading is not None:
        reference, reach = reading.coordinate, reading.code.code_px / 2
        route = [_name_of(reading.code)]
    chain = plan_chain([wrapped.fringe for wrapped in phases], reach)
    coordinate, order, margin = run_chain(phases, chain, reference)
    finest = _finest(phases)
    sigma = finest.sigma * np.float32(finest.fringe.period_px / (2 * np.pi))
    beyond = np.abs(coordinate - centre) - extent / 2
    void = np.full(sigma.shape, Void.ORDER, np.uint8)
    void[beyond <= OUTSIDE_SIGMAS * sigma] = Void.VALID
    if reading is not None:
        void[reading.at_edge & (margin < SAFE_MARGIN)] = Void.ORDER
        void[margin * np.float32(np.pi) < SAFE_SIGMAS * finest.sigma] = Void.ORDER
    for n, wrapped in enumerate(phases):
        if any(carrier.weights[n] for carrier in chain):
            np.copyto(void, wrapped.void, where=wrapped.void != Void.VALID)
    bad = void != Void.VALID
    coordinate[bad], sigma[bad], margin[bad], order[bad] = np.nan, np.nan, np.nan, VOID_ORDER
    return CodedAxis(
        axis=finest.fringe.axis,
        coordinate=coordinate,
        sigma=sigma,
        offset=finest.offset,
        modulation=finest.modulation,
        phase=AbsolutePhase(finest, order, margin),
        void=void,
        route=(*route, *map(str, chain)),
    )


def _name_of(code: GrayCode) -> str:
    return f"Gray code of {code.code_px:g} px cells"
