"""The ways of finding a response, by the names that the command line has for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Literal, TypeAlias

from fringeworks.errors import DecodeError, UsageError
from fringeworks.model import (
    AXES,
    Capture,
    Fringe,
    GreyCurve,
    ImageExponent,
    PhaseTerms,
    Response,
    Way,
)
from fringeworks.phase.response import predistortion_of
from fringeworks.phase.response_fit.levels import fit_curve, has_levels
from fringeworks.phase.response_fit.passive import fit_exponent, fit_terms, see_by_plane
from fringeworks.phase.response_fit.periods import fit_periods, has_periods
from fringeworks.phase.response_fit.seen import (
    Seen,
    gray_is_fine,
    many_steps,
    see_by_gray,
    see_by_steps,
)

WayName: TypeAlias = Literal["auto"] | Way

REFERENCES: Mapping[Way, Callable[[Capture], Iterator[Seen]]] = MappingProxyType(
    {"gray": see_by_gray, "steps": see_by_steps, "plane": see_by_plane}
)


def find_response(
    capture: Capture,
    *,
    way: WayName = "auto",
    exponent: bool = False,
    group: str | None = None,
) -> Response:
    """The response that a capture shows.

    Parameters
    ----------
    way
        `auto` takes grey levels, else many steps, else a Gray code of small cells, else two
        periods; a plane only if it is asked for: nothing in the capture tells that it is one.
    exponent
        An exponent of the images in place of terms of the phase; by `gray` or `steps`.
    group
        Which alternative of the capture.

    Raises
    ------
    DecodeError
        The capture does not hold what the way needs, or mixes exposures.
    UsageError
        An exponent by a way that has no true phase.
    """
    chosen = capture.select(group)
    if chosen.sequence.reference_ms is not None:
        raise DecodeError(
            f"{capture.name} has frames of several exposures: the response is found at one; record "
            "it without --exposures"
        )
    name = choose_way(chosen) if way == "auto" else way
    if exponent and name not in ("gray", "steps"):
        raise UsageError(f"an exponent is found by gray or steps, which know the phase, not {name}")
    return Response(
        way=name,
        source=chosen.name if group is None else f"{chosen.name}, group {group}",
        correction=_correction(chosen, name, exponent=exponent),
        width=chosen.sequence.width,
        height=chosen.sequence.height,
        predistorted_by=predistortion_of(chosen),
    )


def _correction(
    capture: Capture, way: Way, *, exponent: bool
) -> GreyCurve | ImageExponent | tuple[PhaseTerms, ...]:
    if way == "levels":
        return fit_curve(capture)
    if exponent:
        return fit_exponent(capture, REFERENCES[way](capture))
    terms = fit_periods(capture) if way == "periods" else fit_terms(REFERENCES[way](capture))
    if not terms:
        raise DecodeError(f"{capture.name} has nothing that the way '{way}' can use. {NEEDS}")
    return terms


NEEDS = (
    "It takes grey levels (`patterns response`), fringes of twice the steps beside the others "
    "(steps), a Gray code whose cells are small beside the fringes (gray), fringes of two periods "
    "(periods), or a flat scene (plane)"
)


def choose_way(capture: Capture) -> Way:
    """What `auto` takes.

    Raises
    ------
    DecodeError
        The capture has nothing to find a response by.
    """
    if has_levels(capture):
        return "levels"
    if any(many_steps(capture, axis) is not None for axis in AXES):
        return "steps"
    if any(gray_is_fine(capture, fringe) for fringe, *_ in capture.find(Fringe)):
        return "gray"
    if any(has_periods(capture, axis) for axis in AXES):
        return "periods"
    raise DecodeError(f"{capture.name} does not tell the response by itself. {NEEDS}")
