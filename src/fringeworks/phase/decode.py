"""From a capture to projector coordinates: demodulate every set, then order the finest.

Each axis is decoded by itself: a method (`methods`) tells the orders of its finest fringes, from
which the coordinate is taken. A Gray code alone gives the centre of its cell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fringeworks.errors import DecodeError
from fringeworks.kernels.orders import place
from fringeworks.model import (
    AXES,
    Axis,
    Capture,
    CodedAxis,
    Fringe,
    GrayCode,
    ProjectorMap,
    Response,
    Void,
    WrappedPhase,
    describe_voids,
)
from fringeworks.model.phase import VOID_ORDER
from fringeworks.phase.demodulate import MaskRules
from fringeworks.phase.exposures import check_exposures, demodulate_fringe
from fringeworks.phase.gloss import without_other_light
from fringeworks.phase.gray import GrayReading, read_gray
from fringeworks.phase.methods import (
    METHODS,
    READS,
    WITHOUT_WINDOW,
    OrdersName,
    check_orders,
    choose_method,
)
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.phase.response import correct_frames
from fringeworks.phase.window import Volume, coordinate_window

OUTSIDE_SIGMAS = 5.0
"""A coordinate outside the projector's image by more than this many sigma is void."""

NOTHING_CODED = "The capture has neither fringes nor a Gray code"


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

    @property
    def finest(self) -> tuple[WrappedPhase, ...]:
        """The finest fringes of every axis that has any."""
        known = (axis.phase.wrapped for axis in self.coded if axis.phase is not None)
        return (*known, *(wrapped for wrapped, _ in self.relative))

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
            raise DecodeError(f"no pixel is valid along any axis ({voids}). {self._advice()}")
        return ProjectorMap(by_name.get("x"), by_name.get("y"))

    def _advice(self) -> str:
        """What to look at where no pixel is valid."""
        if any((axis.void == Void.ORDER).any() for axis in self.coded):
            return (
                "Fringes are seen, but not which they are: look at the order of the images in "
                "capture.toml, and at the depth range if one is given or asked for (--rig, "
                "--z-range), or choose another method (--orders)"
            )
        return "Look at the frames' exposure, and at the order of the images in capture.toml"


def decode_capture(
    capture: Capture,
    *,
    group: str | None = None,
    rules: MaskRules | None = None,
    orders: OrdersName = "auto",
    volume: Volume | None = None,
    response: Response | None = None,
) -> ProjectorMap:
    """Projector coordinates of a capture; see `decode_phases`, which it calls.

    Raises
    ------
    DecodeError
        No axis of the capture can be decoded, or no pixel is valid.
    """
    decoding = decode_phases(
        capture, group=group, rules=rules, orders=orders, volume=volume, response=response
    )
    return decoding.projector_map()


def decode_phases(
    capture: Capture,
    *,
    group: str | None = None,
    rules: MaskRules | None = None,
    orders: OrdersName = "auto",
    volume: Volume | None = None,
    response: Response | None = None,
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
    orders
        The method that tells fringe orders.
    volume
        Where objects can be, for methods that ask.
    response
        What is taken from images or phases before anything is made of them.

    Raises
    ------
    DecodeError
        Sets that show the same cannot be fused (`exposures.check_exposures`); frames that a method
        reads besides fringes cannot be read; or no axis has what the method asked for reads.
    FormatError
        A Gray code has nothing to tell light from dark by.
    UsageError
        There is no such method.
    """
    check_orders(orders)
    raw, rules = capture.select(group), rules or MaskRules()
    check_exposures(raw.sequence)
    chosen = correct_frames(raw, response)
    phases = {axis: _demodulate_axis(chosen, axis, rules, (raw, response)) for axis in AXES}
    coded: list[CodedAxis] = []
    relative: list[tuple[WrappedPhase, str]] = []
    for axis in AXES:
        if not phases[axis]:
            elsewhere = next((item for items in phases.values() for item in items), None)
            reading = _read_gray_alone(chosen, axis, elsewhere, rules)
            coded += [] if reading is None else [_axis_from_gray(chosen, reading, rules)]
            continue
        frames = AxisFrames(chosen, axis, tuple(phases[axis]))
        told = _tell_orders(frames, orders, volume)
        if isinstance(told, str):
            relative.append((frames.finest, told))
        else:
            found = _axis_from_fringes(frames, told)
            coded.append(without_other_light(found, frames.phases) if rules.other_light else found)
    if orders != "auto" and relative and not coded:
        raise DecodeError("; ".join(why for _, why in relative))
    return Decoding(tuple(coded), tuple(relative))


def _tell_orders(frames: AxisFrames, orders: OrdersName, volume: Volume | None) -> Ordered | str:
    """Orders of an axis, or why nothing tells them.

    Raises
    ------
    DecodeError
        The method has frames of its own, and they cannot be read.
    """
    try:
        name = choose_method(orders, frames)
    except DecodeError as error:
        return str(error)
    if volume is not None and name not in WITHOUT_WINDOW:
        window = coordinate_window(volume, frames.axis, frames.capture.shape)
        frames = replace(frames, window=window)
    try:
        return METHODS[name](frames)
    except DecodeError as error:
        if name in READS and name != "gray":
            raise
        return str(error)


def _read_gray_alone(
    capture: Capture, axis: Axis, fringes: WrappedPhase | None, rules: MaskRules
) -> GrayReading | None:
    least = rules.modulation_share * capture.sensor.full_scale
    return read_gray(capture, axis, fringes=fringes, least_modulation=least)


def _demodulate_axis(
    capture: Capture, axis: Axis, rules: MaskRules, raw: tuple[Capture, Response | None]
) -> list[WrappedPhase]:
    """Each fringe once, whatever the exposures at which it was shown."""
    shown = dict.fromkeys(fringe for fringe, *_ in capture.find(Fringe) if fringe.axis == axis)
    return [demodulate_fringe(fringe, capture, raw[1], rules=rules, raw=raw[0]) for fringe in shown]


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


def _axis_from_fringes(frames: AxisFrames, ordered: Ordered) -> CodedAxis:
    """The coordinate of the finest fringes."""
    phase, extent = ordered.phase, frames.capture.sequence.extent(frames.axis)
    finest, order, margin = phase.wrapped, phase.order, phase.margin
    coordinate = np.empty_like(finest.phase)
    period_px, zero_px = finest.fringe.period_px, finest.fringe.zero_px
    place(finest.phase, order, margin, period_px, zero_px, coordinate)
    sigma = finest.sigma * np.float32(period_px / (2 * np.pi))
    beyond = np.abs(coordinate - (extent - 1) / 2) - extent / 2
    good = beyond <= OUTSIDE_SIGMAS * sigma
    void = np.where(good, Void.VALID, Void.ORDER).astype(np.uint8)
    for wrapped in frames.phases:
        np.copyto(void, wrapped.void, where=~good & (wrapped.void != Void.VALID))
    bad = ~good
    coordinate[bad], sigma[bad], margin[bad], order[bad] = np.nan, np.nan, np.nan, VOID_ORDER
    return CodedAxis(
        axis=frames.axis,
        coordinate=coordinate,
        sigma=sigma,
        offset=finest.offset,
        modulation=finest.modulation,
        phase=phase,
        void=void,
        route=ordered.route,
    )


def _name_of(code: GrayCode) -> str:
    return f"Gray code of {code.code_px:g} px cells"
