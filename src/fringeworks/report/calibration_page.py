"""A calibration on one page: what to look at first, then numbers, parameters, views, uncertainty.

It is made from the rig alone, whose file keeps the observations and the covariance.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fringeworks.calibrate.extended.words import FIT_KEY, UNITS
from fringeworks.calibrate.judge.halves import LARGEST_RATIO
from fringeworks.calibrate.judge.uncertainty import MIDDLE, pixel_sigma, point_sigma
from fringeworks.calibrate.record import CalibrationRecord, ViewRecord
from fringeworks.model import Rig
from fringeworks.report.blocks import (
    Block,
    Details,
    Gallery,
    Number,
    Numbers,
    Page,
    Picture,
    Section,
    Table,
    Text,
    Verdict,
)
from fringeworks.report.calibration import draw_calibration
from fringeworks.report.judgement import Judged, point_medians, summarise_judged
from fringeworks.report.parameters import (
    baseline_sigma,
    correlation_table,
    parameter_table,
    with_sigma,
)
from fringeworks.report.uncertainty import draw_halves, draw_pixels, draw_points

CAPTIONS = {
    "residuals": "What the solution leaves at every corner that was kept, px.",
    "views": "The same, view by view. One that stands out moved, was blurred or badly lit.",
    "coverage": "Where the corners lie in both images, and which way each one misses. "
    "Lenses are known where corners are; arrows that agree with their neighbours are model error.",
    "boards": "Camera, projector and the poses of the board.",
}


def make_calibration_page(judged: Judged) -> Page:
    """The page; its figures are drawn at once."""
    sections = [
        Section("What to look at", [_findings(judged)]),
        Section("How well it fits", [Numbers(list(_numbers(judged)))]),
        Section("View by view", [_views(judged.record), _gallery(judged.rig)]),
        Section("How well points and pixels are known", list(_uncertainty(judged))),
        Section("Two halves of the views", list(_halves(judged))),
        Section("Parameters", list(_parameters(judged))),
        *_extended(judged.rig.further.get(FIT_KEY)),
        Section("All numbers", [Details("calibration.json", summarise_judged(judged))]),
    ]
    return Page("Calibration of camera and projector", _lead(judged), sections)


def _extended(fit: Mapping[str, Any] | None) -> Iterator[Section]:
    """What `calibrate --extended` found, if it was asked."""
    if fit is None:
        return
    rows = [
        (name, unit, f"{fit['parameters'][name]:.5g}", _told(fit["sigma"].get(name)))
        for name, unit in ((name, UNITS[name]) for name in fit["parameters"])
    ]
    yield Section(
        "The paper's ten parameters",
        [
            Text("\n\n".join(f"{line[0].upper()}{line[1:]}." for line in fit["words"])),
            Table(("parameter", "unit", "value", "1 sd"), rows, numbers=(2, 3)),
        ],
    )


def _told(sigma: float | None) -> str:
    return "held at 0" if sigma is None else f"{sigma:.2g}"


def _lead(judged: Judged) -> str:
    rig, quality = judged.rig, judged.quality
    further = (
        "below stands how well points are known, and whether halves of the views agree."
        if judged.covariance is not None
        else "how well points are known is not told here."
    )
    paper = " and a projected checkerboard, as the paper does" if judged.model == "paper" else ""
    return (
        f"A camera of {rig.camera.width}x{rig.camera.height} px and a projector of "
        f"{rig.projector.width}x{rig.projector.height} px, {rig.baseline_mm:.1f} mm apart, from "
        f"{quality.views_used} views of a board{paper}. Small residuals alone do not make a "
        f"calibration good: {further}"
    )


def _findings(judged: Judged) -> Block:
    found = judged.record.findings
    if not found:
        agree = ", and two halves of the views agree" if judged.halves is not None else ""
        return Text(f"No finding: all captures gave a view, tilted enough, that fits{agree}.")
    return Table(
        ("finding", "what to do"),
        [(one.message, one.remedy) for one in found],
        verdicts=[Verdict("doubtful", one.severity) for one in found],
    )


def _numbers(judged: Judged) -> Iterator[Number]:
    quality, record = judged.quality, judged.record
    yield Number("camera rms", f"{quality.camera_rms_px:.3f} px", "distance per kept corner")
    yield Number("projector rms", f"{quality.projector_rms_px:.3f} px", "distance per kept corner")
    all_views = quality.views_used + len(record.failed_captures)
    yield Number("views used", f"{quality.views_used} of {all_views}")
    kept = f"{quality.observations_used} of {quality.observations_offered}"
    yield Number("corners kept", kept, f"joint rms over all: {record.rms_of_all_px[2]:.3f} px")
    yield from _lengths(judged)
    if judged.rig.scale_sigma is not None:
        yield Number(
            "scale known to", f"{judged.rig.scale_sigma:.1e}", "1 sd, by the board's pitch"
        )
    yield from _judgements(judged)


def _lengths(judged: Judged) -> Iterator[Number]:
    """Baseline and focal lengths, each with its standard deviation where there is one."""
    rig, covariance = judged.rig, judged.covariance
    if covariance is None:
        yield Number("baseline", f"{rig.baseline_mm:.2f} mm")
        return
    value, sigma = with_sigma(rig.baseline_mm, baseline_sigma(rig, covariance))
    yield Number("baseline", f"{value} mm", f"1 sd {sigma} mm")
    for device in ("camera", "projector"):
        lens = getattr(rig, device).lens
        for name in ("fx", "fy"):
            known = covariance.sigma.get(f"{device}.{name}")
            if known is not None:
                value, sigma = with_sigma(getattr(lens, name), known)
                yield Number(f"{device} {name}", f"{value} px", f"1 sd {sigma} px")


def _judgements(judged: Judged) -> Iterator[Number]:
    """Systematic uncertainty and cross-validation, mm."""
    if judged.covariance is not None and judged.field is not None:
        medians = point_medians(judged.rig, judged.covariance, judged.field)
        yield Number(
            "depth known to",
            _length(medians["aligned"]["depth_mm"][MIDDLE]),
            "1 sd, systematic, aligned, median at the middle depth",
        )
    if judged.halves is not None:
        halves = judged.halves
        grade = Verdict("good", "as they scatter")
        if halves.ratio > LARGEST_RATIO:
            grade = Verdict("bad", f"beyond {LARGEST_RATIO:g} times")
        predicted = f"rms; {_length(halves.predicted_rms_mm)} predicted"
        yield Number("two halves differ by", _length(halves.rms_mm), predicted, grade)


def _length(value_mm: float | None) -> str:
    if value_mm is None:
        return "unknown"
    return f"{value_mm:.2f} mm" if value_mm >= 1.0 else f"{1e3 * value_mm:.1f} µm"


def _views(record: CalibrationRecord) -> Table:
    rows = [
        (
            view.name,
            f"{view.camera_rms_px:.3f}",
            f"{view.projector_rms_px:.3f}",
            f"{view.kept_count} of {view.offered_count}",
            "none" if view.view.dense is None else f"{len(view.view.dense)}",
            _reasons(view),
        )
        for view in record.views
    ]
    rows += [(name, "", "", "none", "", reason) for name, reason in record.failed_captures]
    head = (
        "view",
        "camera rms, px",
        "projector rms, px",
        "corners kept",
        "dense sites",
        "left out",
    )
    return Table(head, rows, numbers=(1, 2, 3, 4))


def _reasons(view: ViewRecord) -> str:
    return ", ".join(f"{count}: {reason}" for reason, count in view.view.left_out.items())


def _gallery(rig: Rig) -> Gallery:
    return Gallery(
        [Picture(figure, CAPTIONS[name], CAPTIONS[name]) for name, figure in draw_calibration(rig)]
    )


def _uncertainty(judged: Judged) -> Iterator[Block]:
    rig, covariance, field = judged.rig, judged.covariance, judged.field
    if covariance is None or field is None:
        yield Text(f"Left out: {'; '.join(judged.lacks)}.")
        return
    yield Text(
        "What the scatter of the observations leaves open in the parameters, carried through the "
        "triangulation: an error that all scans with this rig share, beside the random one that "
        f"every cloud tells. The board's own pitch is not in it: {_scale(rig)}.\n\n"
        "Aligned means that the rigid motion that fits best over all points shown is taken out: a "
        "cloud that is turned and shifted as a whole measures the same. As it stands is "
        "what counts where coordinates in the camera's frame matter."
    )
    aligned, as_it_stands = (
        draw_points(point_sigma(rig, covariance, field, aligned=way), field.depths_mm, rig.camera)
        for way in (True, False)
    )
    caption = "Systematic uncertainty of measured points over the camera's image, {}."
    yield Picture(aligned, caption.format("aligned"), "Maps of depth and lateral uncertainty")
    yield Picture(as_it_stands, caption.format("as it stands"), "The same in the camera's frame")
    pixels = [pixel_sigma(rig, covariance, field, aligned=way) for way in (False, True)]
    yield Picture(
        draw_pixels(pixels[0], pixels[1], rig.camera),
        "Uncertainty of the pixel at which each device sees a known point at the middle depth. "
        "Aligned, each device may first be moved as fits best: what is left is its lens.",
        "Maps of the projection uncertainty of camera and projector",
    )


def _scale(rig: Rig) -> str:
    if rig.scale_sigma is None:
        return "if that is wrong by 1e-3, so is every length (board.toml does not say how well " + (
            "it is known)"
        )
    return f"it is known to a share of {rig.scale_sigma:.1e} (1 sd), and so is every length"


def _halves(judged: Judged) -> Iterator[Block]:
    halves = judged.halves
    if halves is None:
        why = judged.record.left_out or ("the rig's record keeps none",)
        yield Text(f"Left out: {why[-1]}.")
        return
    yield Text(
        "The rig was solved again from every other view, and from the rest. Both rigs triangulate "
        f"the same pixels; after rigid alignment they differ by {_length(halves.rms_mm)} rms, "
        f"{halves.ratio:.2f} times what their covariances predict. Above {LARGEST_RATIO:g} the "
        "model is wrong by more than the observations scatter, and no standard deviation on this "
        "page can be trusted. Either half has half the views: the rig from all of them is better."
    )
    yield Picture(
        draw_halves(halves, judged.rig.camera),
        "Distance of the same points in both rigs at the middle depth, and its predicted rms.",
        "Maps of the difference of two halves, found and predicted",
    )


def _parameters(judged: Judged) -> Iterator[Block]:
    if judged.covariance is None:
        yield Text(f"Left out: {judged.lacks[0]}.")
        return
    yield parameter_table(judged.rig, judged.covariance, judged.record.board_shape)
    yield correlation_table(judged.covariance)
