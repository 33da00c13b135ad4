"""Read and write acceptance plans: artefacts, limits, and where each position's data are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from fringeworks.errors import FormatError
from fringeworks.files.acceptance_schema import (
    PLAN_FORMAT,
    AnyPosition,
    BallTable,
    BarTable,
    PlanFile,
)
from fringeworks.files.atomic import write_text
from fringeworks.files.toml import lay_out_toml
from fringeworks.files.validation import check_format, format_problems, read_toml, validated
from fringeworks.measure.acceptance.artefacts import Artefacts, CalibratedLength, Form, Warmth
from fringeworks.measure.acceptance.certificate import Quantity
from fringeworks.measure.acceptance.trimming import MOST_PER_MILLE
from fringeworks.measure.region import Region

LARGEST_SHARE = 0.1
"""Of a length, its uncertainty: nobody calibrates worse, and µm taken for mm are beyond it."""

QUANTITIES: tuple[Quantity, ...] = ("PF", "PS", "SD", "F")


@dataclass(frozen=True, slots=True)
class Position:
    """Where one position's data are.

    Attributes
    ----------
    source
        A cloud's file or a capture's folder, as the plan says it, relative to the plan's folder.
    regions
        The part of the cloud that shows the artefact; of a bar two, one for each ball.
    """

    name: str
    artefact: Literal["ball", "bar", "flat"]
    source: str
    is_capture: bool
    regions: tuple[Region, ...]


@dataclass(frozen=True, slots=True)
class Plan:
    """A whole test; `rig` is the rig that scans its captures, as the plan says it."""

    name: str
    volume_mm: tuple[float, float, float]
    artefacts: Artefacts
    positions: tuple[Position, ...]
    limits_mm: Mapping[Quantity, float] = field(default_factory=dict)
    trim_per_mille: float = MOST_PER_MILLE
    rig: str | None = None


def read_plan(path: str | Path) -> Plan:
    """The plan of a TOML file; it does not look at the data that it names.

    Raises
    ------
    FormatError
        Not TOML, a key missing, unknown or out of bounds, a position that names no data, both
        kinds, an artefact without its certificate, or what another position has.
    """
    path = Path(path)
    return _parse(read_toml(path), path)


def write_plan(path: str | Path, plan: Plan) -> None:
    """Write a plan, atomic; it reads back as it is.

    Raises
    ------
    UsageError
        A plan that `read_plan` would refuse.
    FormatError
        The file cannot be written.
    """
    path = Path(path)
    write_text(path, lay_out_toml(_describe(plan), lambda again: _parse(again, path), what="plan"))


def _parse(document: dict[str, Any], path: Path) -> Plan:
    check_format(document, PLAN_FORMAT, path)
    file = validated(PlanFile, document, path)
    problems = [*_wrong_artefacts(file), *_wrong_positions(file)]
    if problems:
        raise FormatError(format_problems(path, problems))
    limits = {name: getattr(file.limits, f"{name}_mm") for name in QUANTITIES}
    return Plan(
        name=file.name or path.stem,
        volume_mm=(file.volume_mm[0], file.volume_mm[1], file.volume_mm[2]),
        artefacts=_artefacts(file),
        positions=tuple(_position(item, name) for item, name in _named(file)),
        limits_mm={name: limit for name, limit in limits.items() if limit is not None},
        trim_per_mille=file.trim_per_mille,
        rig=file.rig,
    )


def _artefacts(file: PlanFile) -> Artefacts:
    ball, bar, flat = file.ball, file.bar, file.flat
    return Artefacts(
        ball=None if ball is None else ball.length(ball.diameter_mm, ball.diameter_u95_mm),
        ball_form=Form() if ball is None else Form(ball.form_mm, ball.form_u95_mm),
        bar=None if bar is None else bar.length(bar.length_mm, bar.length_u95_mm),
        flat=None if flat is None else flat.form(),
        warmth=Warmth(file.temperature_c, file.temperature_u95_k),
    )


def _named(file: PlanFile) -> Iterator[tuple[AnyPosition, str]]:
    """Positions with their names: those that have none are counted by artefact, from 1."""
    seen: Counter[str] = Counter()
    for item in file.position:
        seen[item.artefact] += 1
        yield item, item.name or f"{item.artefact} {seen[item.artefact]}"


def _position(item: AnyPosition, name: str) -> Position:
    source = item.capture if item.cloud is None else item.cloud
    assert source is not None
    return Position(name, item.artefact, source, item.cloud is None, item.regions())


def _wrong_artefacts(file: PlanFile) -> Iterator[str]:
    lengths: tuple[tuple[str, BallTable | BarTable | None], ...] = (
        ("ball.diameter", file.ball),
        ("bar.length", file.bar),
    )
    for key, table in lengths:
        if table is None:
            continue
        value, u95 = (getattr(table, key.split(".")[1] + end) for end in ("_mm", "_u95_mm"))
        if u95 > LARGEST_SHARE * value:
            yield (
                f"{key}_u95_mm must be at most a tenth of the length ({value:g}), got {u95:g}; "
                "is it in µm?"
            )


def _wrong_positions(file: PlanFile) -> Iterator[str]:
    names: Counter[str] = Counter()
    places: dict[object, int] = {}
    for number, (item, name) in enumerate(_named(file), start=1):
        start = f"position {number} ({item.artefact}): "
        names[name] += 1
        if names[name] == 2:
            yield f"{start}name must be no other position's, got '{name}'"
        if getattr(file, item.artefact) is None:
            yield f"{start}its certificate, the table [{item.artefact}], is missing"
        if (item.cloud is None) == (item.capture is None):
            given = "neither" if item.cloud is None else "both"
            yield f"{start}give either cloud or capture, got {given}"
        elif (first := places.setdefault(_place(item), number)) != number:
            yield f"{start}the same place as position {first}; measure each anew"
        for region in item.regions():
            yield from (f"{start}{problem}" for problem in _wrong_region(region))


def _place(item: AnyPosition) -> object:
    return item.artefact, item.cloud, item.capture, item.regions()


def _wrong_region(region: Region) -> Iterator[str]:
    for key, ranges in (("box_mm", region.box_mm), ("pixels", region.pixels)):
        for low, high in ranges or ():
            if not low < high:
                yield f"{key} must hold ranges from low to high, got [{low:g}, {high:g}]"


def _describe(plan: Plan) -> dict[str, Any]:
    artefacts, warmth = plan.artefacts, plan.artefacts.warmth
    document = {
        "format": PLAN_FORMAT,
        "name": plan.name,
        "rig": plan.rig,
        "volume_mm": list(plan.volume_mm),
        "temperature_c": warmth.temperature_c,
        "temperature_u95_k": warmth.u95_k,
        "trim_per_mille": plan.trim_per_mille,
        "limits": {f"{name}_mm": limit for name, limit in plan.limits_mm.items()},
        "ball": artefacts.ball
        and {
            **_describe_length(artefacts.ball, "diameter"),
            **_describe_form(artefacts.ball_form, "form"),
        },
        "bar": artefacts.bar and _describe_length(artefacts.bar, "length"),
        "flat": artefacts.flat and _describe_form(artefacts.flat, "flatness"),
        "position": [_describe_position(item) for item in plan.positions],
    }
    return {key: value for key, value in document.items() if value is not None}


def _describe_length(length: CalibratedLength, name: str) -> dict[str, float]:
    return {
        f"{name}_mm": length.value_mm,
        f"{name}_u95_mm": length.u95_mm,
        "cte_per_k": length.cte_per_k,
        "cte_u95_per_k": length.cte_u95_per_k,
        "calibrated_at_c": length.calibrated_at_c,
    }


def _describe_form(form: Form, name: str) -> dict[str, float]:
    return {f"{name}_mm": form.range_mm, f"{name}_u95_mm": form.u95_mm}


def _describe_position(item: Position) -> dict[str, Any]:
    source = {"capture" if item.is_capture else "cloud": item.source}
    head = {"artefact": item.artefact, "name": item.name, **source}
    regions = [_describe_region(region) for region in item.regions]
    if item.artefact == "bar":
        return {**head, "first": regions[0], "second": regions[1]}
    return {**head, **regions[0]}


def _describe_region(region: Region) -> dict[str, Any]:
    ranges = {"box_mm": region.box_mm, "pixels": region.pixels}
    return {key: [list(ends) for ends in given] for key, given in ranges.items() if given}
