"""An acceptance test on one page: what is proven, everyday words, every position."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal

from fringeworks.measure.acceptance import BallFound, BarFound, Certificate, FlatFound, Lot
from fringeworks.measure.acceptance.certificate import Outcome
from fringeworks.measure.acceptance.positions import Surface
from fringeworks.report.acceptance import (
    MEANINGS,
    OUTCOME_WORDS,
    draw_places,
    draw_values,
    summarise_certificate,
)
from fringeworks.report.blocks import (
    Block,
    Details,
    Number,
    Numbers,
    Page,
    Picture,
    Section,
    Table,
    Text,
    Verdict,
)
from fringeworks.report.canvas import save_figure

GRADES: Mapping[Outcome, Literal["good", "doubtful", "bad"]] = {
    "conforms": "good",
    "undecided": "doubtful",
    "incomplete": "doubtful",
    "fails": "bad",
}

SURFACE_HEAD = ("rms", "95 %", "noise alone", "points", "left out")

HOW = (
    "In the manner of VDI/VDE 2634-2, which this page does not replace. A limit is kept where the "
    "value's size is at most the limit less U, the test's own expanded uncertainty (k = 2): of the "
    "artefact's certificate and its temperature (ISO 14253-1). PF and F are ranges, and a range "
    "is a statistic of noise: it grows with the number of points. Beside it stand the width that "
    "holds 95 % of them, in the manner of ISO 10360-13, and the range that noise of the same root "
    "mean square alone would have."
)


def make_acceptance_page(certificate: Certificate, *, figures: Path) -> Page:
    """The page; its two pictures are kept in `figures`."""
    values = Picture(
        save_figure(draw_values(certificate), figures / "values.png"),
        "Every position. Lines are the limits, dotted ones the limits less U; bars of U are drawn "
        "where they can be seen.",
        "Bars of PF, PS, SD and F at every position, beside their limits",
    )
    places = Picture(
        save_figure(draw_places(certificate), figures / "places.png"),
        "Where the artefacts stood.",
        "Outlines of balls, ball bars and flats in the measuring volume, from above and in front",
    )
    sections = [
        Section("What is proven", [_outcomes(certificate), values, Text(HOW)]),
        *_findings(certificate),
        Section("In everyday words", list(_words(certificate))),
        Section("Where it was measured", [places, _artefacts(certificate)]),
        Section("Every position", list(_positions(certificate))),
        Section("All numbers", [Details("acceptance.json", summarise_certificate(certificate))]),
    ]
    return Page(f"Acceptance: {certificate.name}", _lead(certificate), sections)


def _lead(certificate: Certificate) -> str:
    x, y, z = certificate.volume_mm
    counts = (
        (certificate.balls, "of a ball"),
        (certificate.bars, "of a ball bar"),
        (certificate.flats, "of a flat"),
    )
    told = ", ".join(f"{len(found)} {what}" for found, what in counts if found)
    return (
        f"{told[0].upper()}{told[1:]} at positions in {x:g} x {y:g} x {z:g} mm, whose diagonal is "
        f"{certificate.diagonal_mm:.0f} mm; at most {certificate.trim_per_mille:g} per mille of "
        f"the points of a form left out. Result: {OUTCOME_WORDS[certificate.outcome]}."
    )


def verdict_of(lot: Lot) -> Verdict | None:
    """None where no limit is stated."""
    if lot.limit_mm is None:
        return None
    return Verdict(GRADES[lot.outcome], OUTCOME_WORDS[lot.outcome])


def _outcomes(certificate: Certificate) -> Numbers:
    return Numbers([_outcome(lot) for lot in certificate.lots])


def _outcome(lot: Lot) -> Number:
    worst = lot.worst
    limit = "no limit" if lot.limit_mm is None else f"limit {lot.limit_mm:g} mm"
    sign = "+" if lot.quantity in ("PS", "SD") else ""
    value = "none" if worst is None else f"{worst.value_mm:{sign}.3f} mm"
    beside = f"the worst of {len(lot.counted)}, {lot.needed} needed; {limit}"
    name = f"{lot.quantity}, {MEANINGS[lot.quantity].split(':')[0]}"
    return Number(name, value, beside, verdict_of(lot))


def _findings(certificate: Certificate) -> Iterator[Section]:
    found = certificate.findings
    if found:
        table = Table(
            ("finding", "what to do"),
            [(one.message, one.remedy) for one in found],
            verdicts=[Verdict("doubtful", one.severity) for one in found],
        )
        yield Section("What to look at", [table])


def _words(certificate: Certificate) -> Iterator[Block]:
    words = certificate.words
    share, mean = words.dimension_trueness, words.dimension_error_share
    yield Numbers(
        [
            Number(
                "point precision",
                _length(words.point_precision_mm),
                "1 sd of one point against its neighbours, across a flat",
            ),
            Number(
                "local planarity",
                _length(words.local_planarity_mm),
                "rms about planes through patches a tenth of the flat wide",
            ),
            Number(
                "global planarity",
                _length(words.global_planarity_mm),
                "range of the patches' means, the worst flat",
            ),
            Number(
                "dimension trueness",
                "not measured" if share is None else f"{100 * share:+.3f} %",
                "" if mean is None else f"the worst length; all of them on average {mean:+.3%}",
            ),
        ]
    )


def _length(value_mm: float | None) -> str:
    if value_mm is None:
        return "not measured"
    return f"{value_mm:.2f} mm" if value_mm >= 1.0 else f"{1e3 * value_mm:.0f} µm"


def _artefacts(certificate: Certificate) -> Table:
    artefacts = certificate.artefacts
    rows = []
    for name, length in (("ball, diameter", artefacts.ball), ("ball bar", artefacts.bar)):
        if length is not None:
            warm = length.at(artefacts.warmth)
            u95 = length.u95_at(artefacts.warmth)
            rows.append((name, f"{length.value_mm:.4f}", f"{warm:.4f}", f"{u95:.4f}"))
    ball_form = None if artefacts.ball is None else artefacts.ball_form
    forms = (("ball, form", ball_form), ("flat, flatness", artefacts.flat))
    for name, form in forms:
        if form is not None:
            rows.append((name, f"{form.range_mm:.4f}", "", f"{form.test_u95_mm:.4f}"))
    at = f"at {artefacts.warmth.temperature_c:g} °C"
    return Table(("artefact", "calibrated, mm", f"{at}, mm", "U, mm"), rows, numbers=(1, 2, 3))


def _positions(certificate: Certificate) -> Iterator[Block]:
    lots = {lot.quantity: lot for lot in certificate.lots}
    if certificate.balls:
        yield _balls(certificate.balls, _verdicts(lots["PF"], lots["PS"]))
    if certificate.bars:
        yield _bars(certificate.bars, _verdicts(lots["SD"]))
    if certificate.flats:
        yield _flats(certificate.flats, _verdicts(lots["F"]))


def _balls(balls: Sequence[BallFound], verdicts: list[Verdict | None]) -> Table:
    rows = [(one.name, *_surface(one.surface), f"{one.ps_mm:+.4f}") for one in balls]
    head = ("", "PF, mm", *SURFACE_HEAD, "PS, mm")
    return Table(head, rows, range(1, len(head)), verdicts, caption="Ball")


def _bars(bars: Sequence[BarFound], verdicts: list[Verdict | None]) -> Table:
    rows = [
        (one.name, f"{one.distance_mm:.4f}", f"{one.sd_mm:+.4f}", *map(str, one.points))
        for one in bars
    ]
    head = ("", "distance, mm", "SD, mm", "points, first", "second")
    return Table(head, rows, range(1, len(head)), verdicts, caption="Ball bar")


def _flats(flats: Sequence[FlatFound], verdicts: list[Verdict | None]) -> Table:
    rows = [
        (one.name, *_surface(one.surface), " x ".join(f"{side:.0f}" for side in one.size_mm))
        for one in flats
    ]
    head = ("", "F, mm", *SURFACE_HEAD, "size, mm")
    return Table(head, rows, range(1, len(head)), verdicts, caption="Flat")


def _surface(surface: Surface) -> tuple[str, ...]:
    lengths = (surface.range_mm, surface.rms_mm, surface.band95_mm, surface.noise_range_mm)
    return *(f"{length:.3f}" for length in lengths), str(surface.points), str(surface.left_out)


def _verdicts(*lots: Lot) -> list[Verdict | None]:
    """One per position: its faults, else what is decided of each quantity; none without limits."""
    verdicts = [_verdict([(lot, place) for lot in lots]) for place in range(len(lots[0].readings))]
    return verdicts if any(verdicts) else []


def _verdict(told: Sequence[tuple[Lot, int]]) -> Verdict | None:
    lot, place = told[0]
    if lot.readings[place].faults:
        return Verdict("doubtful", "; ".join(lot.readings[place].faults))
    decided = [(lot.quantity, lot.decisions[place]) for lot, place in told]
    known = [(quantity, decision) for quantity, decision in decided if decision is not None]
    if not known:
        return None
    decisions = {decision for _, decision in known}
    worst = next(one for one in ("fails", "undecided", "conforms") if one in decisions)
    words = worst if len(decisions) == 1 else ", ".join(" ".join(pair) for pair in known)
    return Verdict(GRADES[worst], words)
