"""Read and write ``response.json``, and the same table under `response` in a rig."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import Field

from fringeworks.errors import FormatError
from fringeworks.files.atomic import write_text
from fringeworks.files.validation import Table, check_format, read_json, validated
from fringeworks.model import (
    GreyCurve,
    ImageExponent,
    PhaseTerms,
    RegionCurve,
    Response,
    Rig,
)

Item = TypeVar("Item")

RESPONSE_FORMAT = "fringeworks-response/1"
RIG_KEY = "response"
MOST_LEVELS = 4096
MOST_TERMS = 16
LEAST_STEP = 1e-6
"""Of full scale: finer than any projector's levels."""

Share = Annotated[float, Field(ge=0, le=1)]
Shares = Annotated[list[Share], Field(min_length=2, max_length=MOST_LEVELS)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Range = Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)]
NotNegative = Annotated[float, Field(ge=0)]
Coefficient = Annotated[float, Field(ge=-math.pi, le=math.pi)]
Coefficients = Annotated[list[Coefficient], Field(min_length=1, max_length=MOST_TERMS)]


class RegionTable(Table):
    """See `RegionCurve`."""

    rows: Range
    columns: Range
    light: Shares


class CurveTable(Table):
    """See `GreyCurve`."""

    levels: Shares
    light: Shares
    harmonics: Pair
    left: Pair
    regions: Annotated[list[RegionTable], Field(default_factory=list, max_length=64)]


class ExponentTable(Table):
    """See `ImageExponent`."""

    exponent: Annotated[float, Field(gt=0, le=100)]
    before_rad: NotNegative
    after_rad: NotNegative


class TermsTable(Table):
    """See `PhaseTerms`; angles of the shifts in degrees."""

    axis: Literal["x", "y"]
    period_px: Annotated[float, Field(ge=2)]
    shifts_deg: Annotated[list[float], Field(min_length=3, max_length=256)]
    cos_rad: Coefficients
    sin_rad: Coefficients
    before: NotNegative
    after: NotNegative
    unit: Literal["rad", "px"]


class ProjectorTable(Table):
    """Size of the projector's image, px."""

    width: Annotated[int, Field(ge=1)]
    height: Annotated[int, Field(ge=1)]


class ResponseFile(Table):
    """The whole ``response.json``: one of `curve`, `exponent` and `terms`."""

    format: Literal["fringeworks-response/1"]
    way: Literal["levels", "gray", "steps", "plane", "periods"]
    source: str
    projector: ProjectorTable
    predistorted_by: str | None = None
    curve: CurveTable | None = None
    exponent: ExponentTable | None = None
    terms: Annotated[list[TermsTable], Field(min_length=1, max_length=64)] | None = None


def read_response(path: str | Path) -> Response:
    """The response of a ``response.json``.

    Raises
    ------
    FormatError
        Not JSON, a key missing, unknown or out of bounds, levels that do not rise, or other than
        one correction.
    """
    path = Path(path)
    return _parse(read_json(path), path)


def write_response(path: str | Path, response: Response) -> None:
    """Write ``response.json``, atomic; every number reads back as it is.

    Raises
    ------
    FormatError
        The file cannot be written.
    """
    write_text(Path(path), json.dumps(describe_response(response), indent=1) + "\n")


def response_of_rig(rig: Rig) -> Response | None:
    """What a rig keeps under `response`; None where it keeps nothing.

    Raises
    ------
    FormatError
        It keeps something else there.
    """
    table = rig.further.get(RIG_KEY)
    if table is None:
        return None
    if not isinstance(table, Mapping):
        raise FormatError(f"the rig's {RIG_KEY} must be a table like response.json")
    return _parse(dict(table), Path(f"rig, {RIG_KEY}"))


def rig_with_response(rig: Rig, response: Response) -> Rig:
    """The rig that keeps this response."""
    return replace(rig, further={**rig.further, RIG_KEY: describe_response(response)})


def describe_response(response: Response) -> dict[str, Any]:
    """The document of a response."""
    head = {
        "format": RESPONSE_FORMAT,
        "way": response.way,
        "source": response.source,
        "projector": {"width": response.width, "height": response.height},
        "predistorted_by": response.predistorted_by,
    }
    match response.correction:
        case GreyCurve() as curve:
            return {**head, "curve": _lists(asdict(curve))}
        case ImageExponent() as exponent:
            return {**head, "exponent": asdict(exponent)}
        case terms:
            return {**head, "terms": [_describe_terms(item) for item in terms]}


def _describe_terms(terms: PhaseTerms) -> dict[str, Any]:
    return {
        "axis": terms.axis,
        "period_px": terms.period_px,
        "shifts_deg": [math.degrees(shift) for shift in terms.shifts_rad],
        "cos_rad": list(terms.cos),
        "sin_rad": list(terms.sin),
        "before": terms.before,
        "after": terms.after,
        "unit": terms.unit,
    }


def _lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    return [_lists(item) for item in value] if isinstance(value, tuple | list) else value


def _parse(document: dict[str, Any], path: Path) -> Response:
    check_format(document, RESPONSE_FORMAT, path)
    file = validated(ResponseFile, document, path)
    given = [item for item in (file.curve, file.exponent, file.terms) if item is not None]
    if len(given) != 1:
        raise FormatError(f"{path}: must hold one of curve, exponent and terms, got {len(given)}")
    return Response(
        way=file.way,
        source=file.source,
        correction=_correction(file, path),
        width=file.projector.width,
        height=file.projector.height,
        predistorted_by=file.predistorted_by,
    )


def _correction(
    file: ResponseFile, path: Path
) -> GreyCurve | ImageExponent | tuple[PhaseTerms, ...]:
    if file.curve is not None:
        return _curve(file.curve, path)
    if file.exponent is not None:
        return ImageExponent(**file.exponent.model_dump())
    return tuple(_terms(table, path) for table in file.terms or ())


def _curve(table: CurveTable, path: Path) -> GreyCurve:
    lights = [table.light, *(region.light for region in table.regions)]
    if any(len(light) != len(table.levels) for light in lights):
        raise FormatError(f"{path}: curve.light must hold as many values as curve.levels")
    ends = (table.levels[0], table.levels[-1]) == (0, 1)
    if not ends or not (np.diff(table.levels) >= LEAST_STEP).all():
        raise FormatError(f"{path}: curve.levels must rise from 0 to 1, by {LEAST_STEP:g} or more")
    if any((light[0], light[-1]) != (0, 1) or (np.diff(light) < 0).any() for light in lights):
        raise FormatError(f"{path}: curve.light must go from 0 to 1 and never fall")
    return GreyCurve(
        levels=tuple(table.levels),
        light=tuple(table.light),
        harmonics=_pair(table.harmonics),
        left=_pair(table.left),
        regions=tuple(
            RegionCurve(_pair(item.rows), _pair(item.columns), tuple(item.light))
            for item in table.regions
        ),
    )


def _pair(values: list[Item]) -> tuple[Item, Item]:
    first, second = values
    return first, second


def _terms(table: TermsTable, path: Path) -> PhaseTerms:
    if len(table.cos_rad) != len(table.sin_rad):
        raise FormatError(f"{path}: terms need as many cos_rad as sin_rad")
    terms = PhaseTerms(
        axis=table.axis,
        period_px=table.period_px,
        shifts_rad=tuple(math.radians(shift) for shift in table.shifts_deg),
        cos=tuple(table.cos_rad),
        sin=tuple(table.sin_rad),
        before=table.before,
        after=table.after,
        unit=table.unit,
    )
    if terms.folds:
        raise FormatError(f"{path}: terms of {terms.period_px:g} px must not fold the phase over")
    return terms
