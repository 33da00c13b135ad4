"""An acceptance plan carried out: every position's cloud read or scanned, and measured."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

from fringeworks.errors import DecodeError, FormatError, MeasurementError
from fringeworks.files import read_capture, read_cloud, read_rig
from fringeworks.files.acceptance import Plan, Position
from fringeworks.files.inside import locate_inside
from fringeworks.measure.acceptance import BallFound, BarFound, Certificate, FlatFound, certify
from fringeworks.measure.acceptance.positions import measure_ball, measure_bar, measure_flat
from fringeworks.measure.region import select_points
from fringeworks.model import Capture, Cloud, Finding, Pattern, Progress, Rig, no_progress
from fringeworks.pipeline import scan

Found: TypeAlias = BallFound | BarFound | FlatFound
Settings: TypeAlias = tuple[tuple[Pattern, float | None, int], ...]

CLOUDS_KEPT = 2
"""Positions that share a cloud stand next to each other in any sensible plan."""


def run_plan(
    plan: Plan, folder: Path, *, rig: Path | None = None, progress: Progress = no_progress
) -> Certificate:
    """Measure all positions of a plan whose data are in `folder`, and say what came of them.

    A position that gives no result is a finding, and missing in its lot.

    Parameters
    ----------
    rig
        Scans the captures in place of the plan's own.

    Raises
    ------
    FormatError
        Data are missing or damaged or outside of `folder`, or there are captures and no rig.
    MeasurementError
        No position gives a result.
    """
    source = _Source.of(plan, folder, rig)
    clouds = lru_cache(maxsize=CLOUDS_KEPT)(source.cloud)
    found: list[Found] = []
    for position in progress(plan.positions, "measuring"):
        try:
            found.append(_measure(position, clouds(position.source, position.is_capture), plan))
        except (DecodeError, MeasurementError) as error:
            source.findings.append(Finding("warning", f"{position.name} gives no result: {error}."))
    if not found:
        raise MeasurementError(f"no position gives a result; {source.findings[0].message}")
    return certify(
        Certificate(
            name=plan.name,
            volume_mm=plan.volume_mm,
            artefacts=plan.artefacts,
            limits_mm=plan.limits_mm,
            trim_per_mille=plan.trim_per_mille,
            balls=tuple(one for one in found if isinstance(one, BallFound)),
            bars=tuple(one for one in found if isinstance(one, BarFound)),
            flats=tuple(one for one in found if isinstance(one, FlatFound)),
            findings=tuple(source.findings),
        )
    )


@dataclass(slots=True)
class _Source:
    """Where clouds come from, and what was noticed on the way."""

    folder: Path
    rig: Rig | None
    settings: Settings | None = None
    findings: list[Finding] = field(default_factory=list)

    @classmethod
    def of(cls, plan: Plan, folder: Path, rig: Path | None) -> _Source:
        scanned = next((item for item in plan.positions if item.is_capture), None)
        if scanned is None:
            return cls(folder, None)
        if rig is None and plan.rig is None:
            raise FormatError(
                f"{folder}: {scanned.name} is a capture, so the plan must name a rig, or --rig"
            )
        own = None if plan.rig is None else _inside(folder, plan.rig, what="rig")
        known = rig or own
        assert known is not None
        return cls(folder, read_rig(known))

    def cloud(self, name: str, is_capture: bool) -> Cloud:
        """The cloud of a file, or of a capture."""
        if not is_capture:
            return read_cloud(_inside(self.folder, name, what="cloud"))
        assert self.rig is not None
        capture = read_capture(_inside(self.folder, name, what="capture"))
        self._check_settings(capture)
        return scan(capture, self.rig)

    def _check_settings(self, capture: Capture) -> None:
        """A test has the same settings at all positions."""
        settings = tuple(
            (item.pattern, item.exposure_ms, item.repeats) for item in capture.sequence.sets
        )
        self.settings = self.settings or settings
        if settings != self.settings:
            self.findings.append(
                Finding(
                    "warning",
                    f"{capture.name} was taken with other settings than the first capture.",
                    "Measure all positions with the same settings.",
                )
            )


def _inside(folder: Path, name: str, *, what: str) -> Path:
    return locate_inside(folder, name, what=what, whose="plan")


def _measure(position: Position, cloud: Cloud, plan: Plan) -> Found:
    match position.artefact:
        case "ball":
            return _measure_ball(position, cloud, plan)
        case "bar":
            return _measure_bar(position, cloud, plan)
        case "flat":
            return _measure_flat(position, cloud, plan)


def _measure_ball(position: Position, cloud: Cloud, plan: Plan) -> BallFound:
    artefacts = plan.artefacts
    assert artefacts.ball is not None
    return measure_ball(
        select_points(cloud, position.regions[0]),
        artefacts.ball,
        form=artefacts.ball_form,
        warmth=artefacts.warmth,
        name=position.name,
        trim_per_mille=plan.trim_per_mille,
    )


def _measure_bar(position: Position, cloud: Cloud, plan: Plan) -> BarFound:
    artefacts = plan.artefacts
    assert artefacts.bar is not None
    first, second = (select_points(cloud, region) for region in position.regions)
    return measure_bar(
        (first, second),
        artefacts.bar,
        warmth=artefacts.warmth,
        name=position.name,
        trim_per_mille=plan.trim_per_mille,
    )


def _measure_flat(position: Position, cloud: Cloud, plan: Plan) -> FlatFound:
    assert plan.artefacts.flat is not None
    return measure_flat(
        cloud,
        position.regions[0],
        flat=plan.artefacts.flat,
        name=position.name,
        trim_per_mille=plan.trim_per_mille,
    )
