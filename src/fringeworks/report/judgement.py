"""All that can be said about a calibration from the rig alone: what its page and JSON show.

The rig's file keeps the observations, the covariance, and what two halves of the views came to.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.covariance import Covariance, read_covariance
from fringeworks.calibrate.judge.halves import Halves
from fringeworks.calibrate.judge.uncertainty import Field, lay_field, point_sigma
from fringeworks.calibrate.projected.record import model_of
from fringeworks.calibrate.record import CalibrationRecord, read_record
from fringeworks.errors import FormatError, UsageError
from fringeworks.model import Quality, Rig
from fringeworks.report.parameters import PARTS
from fringeworks.report.summary import Summary, summarise_record, summarise_rig


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A calibrated rig with what can be said about it; `lacks` says why something is left out."""

    rig: Rig
    quality: Quality
    record: CalibrationRecord
    covariance: Covariance | None
    field: Field | None
    lacks: tuple[str, ...]

    @property
    def model(self) -> str:
        """``joint`` or ``paper``."""
        return model_of(self.rig.further)

    @property
    def halves(self) -> Halves | None:
        """Two halves of the views compared; None where they could not be."""
        return self.record.halves


def judge_calibration(rig: Rig) -> Judged:
    """Look at a rig in every way that its record allows.

    Raises
    ------
    FormatError
        The rig has no record of its calibration, or a damaged one.
    """
    record = read_record(rig.further)
    if record is None or rig.quality is None:
        raise FormatError("the rig keeps no record of its calibration: nothing to report")
    covariance, field = read_covariance(rig.further), None
    lacks = []
    if covariance is None and model_of(rig.further) != "paper":  # the paper's record says why
        lacks.append("no covariance: the views leave some parameter open")
    try:
        field = lay_field(rig)
    except UsageError as error:
        lacks.append(str(error))
    return Judged(rig, rig.quality, record, covariance, field, (*lacks, *record.left_out))


def summarise_judged(judged: Judged) -> Summary:
    """All numbers of the page in plain values."""
    covariance = judged.covariance
    return {
        "quality": asdict(judged.quality),
        **summarise_record(judged.record),
        "rig": summarise_rig(judged.rig),
        "sigma": None if covariance is None else covariance.only(*PARTS).sigma,
        "systematic": None
        if covariance is None or judged.field is None
        else point_medians(judged.rig, covariance, judged.field),
        "left_out": list(judged.lacks),
    }


def point_medians(rig: Rig, covariance: Covariance, field: Field) -> Summary:
    """Medians over the image at each depth, mm."""
    out: Summary = {"depths_mm": field.depths_mm.tolist()}
    for key, aligned in (("aligned", True), ("as_it_stands", False)):
        sigma = point_sigma(rig, covariance, field, aligned=aligned)
        out[key] = {name: _medians(getattr(sigma, name)) for name in ("depth_mm", "lateral_mm")}
    return out


def _medians(maps: NDArray[np.float64]) -> list[float | None]:
    known = [values[np.isfinite(values)] for values in maps]
    return [float(np.median(values)) if values.size else None for values in known]
