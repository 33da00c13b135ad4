"""The studies that ``fringeworks bench STUDY`` knows."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from fringeworks.errors import UsageError
from fringeworks.experiments.calibrations import study_calibrations
from fringeworks.experiments.check_study import study_check
from fringeworks.experiments.extended_study import study_extended
from fringeworks.experiments.models import study_models
from fringeworks.experiments.orders import study_orders
from fringeworks.experiments.study import StudyMaker
from fringeworks.experiments.watching import study_watching
from fringeworks.experiments.zones import study_zones

STUDIES: Mapping[str, StudyMaker] = MappingProxyType(
    {
        "calibration": study_calibrations,
        "check": study_check,
        "extended": study_extended,
        "models": study_models,
        "orders": study_orders,
        "watch": study_watching,
        "zones": study_zones,
    }
)


def named_study(name: str) -> StudyMaker:
    """The study called `name`; UsageError for another name."""
    if name not in STUDIES:
        raise UsageError(f"study must be one of {', '.join(STUDIES)}, got '{name}'")
    return STUDIES[name]
