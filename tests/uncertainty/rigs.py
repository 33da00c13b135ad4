"""A rig with a covariance, from views by projection alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from fringeworks.calibrate import CalibrationSettings
from fringeworks.calibrate.adjust.bundle import refine
from fringeworks.calibrate.adjust.covariance import KEY
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Camera, Lens, Pose, Projector, Rig
from tests.calibrate.synthetic import board_poses, rig_state, views_of

VIEWS = 8
CORNER_SIGMA, SITE_SIGMA = 0.05, 0.02
VOLUME_MM = (560.0, 740.0)


def truth() -> RigState:
    """The rig that all calibrations see."""
    return rig_state(board_poses(VIEWS, rng=np.random.default_rng(11)))


def rig_of(state: RigState, further: Mapping[str, Any] | None = None) -> Rig:
    """The state as a rig."""
    relation = state.projector_from_camera
    return Rig(
        Camera(752, 480, Lens.from_vector(state.camera)),
        Projector(608, 684, Lens.from_vector(state.projector)),
        Pose(rotation_matrix(relation[:3]), relation[3:]),
        volume_mm=VOLUME_MM,
        further=further or {},
    )


@cache
def calibrated(seed: int = 0) -> Rig:
    """What noisy corners and maps at them give, refined from the truth."""
    rng = np.random.default_rng(seed)
    views = views_of(truth(), sigma=CORNER_SIGMA, site_sigma=SITE_SIGMA, rng=rng)
    fit = refine(truth(), views, CalibrationSettings())
    assert fit.covariance is not None
    return rig_of(fit.state, {KEY: fit.covariance.as_plain()})
