"""A rig held against the twin that it was calibrated from: scans without noise, parameters.

The scans are taken once and scanned with every rig. There is no noise in them, so that what is
wrong is the calibration's doing, and what any scan has: the true rig's own figures say how much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.covariance import Covariance
from fringeworks.calibrate.adjust.state import SHAPE_NAMES, parameter_names
from fringeworks.calibrate.judge.uncertainty import (
    Field,
    points_by_parameters,
    rigid_motions,
    shared_covariance,
    state_of,
    variances,
    without_motion,
)
from fringeworks.experiments.truth import Bias, find_bias, inner_pixels
from fringeworks.geometry.forms import fit_cylinder
from fringeworks.geometry.grid import grid_normals
from fringeworks.geometry.pose import rotation_vector
from fringeworks.model import Capture, Cloud, ProjectorMap, Rig, Sequence
from fringeworks.phase.decode import decode_capture
from fringeworks.pipeline import cloud_of, measure_cylinder
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Cylinder, Scene
from fringeworks.twin.scenes import cylinder_scene, wall_scene
from fringeworks.twin.simulate import simulate
from fringeworks.twin.truth import Truth

FIELD_STEP = 12
"""Every so many pixels of the wall its standard deviation is computed: it is smooth."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Still:
    """A scene captured and decoded, without noise unless `effects` say so, with its truth."""

    scene: Scene
    capture: Capture
    projector_map: ProjectorMap
    truth: Truth

    @classmethod
    def of(
        cls,
        scene: Scene,
        rig: Rig,
        sequence: Sequence,
        *,
        effects: Effects | None = None,
        seed: int = 0,
    ) -> Still:
        effects, rng = effects or Effects().without_noise(), np.random.default_rng(seed)
        made = simulate(scene, rig, sequence, effects=effects, rng=rng)
        return cls(scene, made.capture, decode_capture(made.capture), made.truth)

    def scan(self, rig: Rig) -> Cloud:
        return cloud_of(self.capture, self.projector_map, rig)

    def bias(self, rig: Rig) -> Bias:
        return find_bias(self.scan(rig), self.truth)


@dataclass(frozen=True, slots=True)
class Yardstick:
    """What every rig is held against: the true one, the wall and the cylinder, by `sequence`."""

    rig: Rig
    sequence: Sequence
    wall: Still
    cylinder: Still

    @classmethod
    def of(cls, rig: Rig, sequence: Sequence) -> Yardstick:
        wall, cylinder = (Still.of(s, rig, sequence) for s in (wall_scene(), cylinder_scene()))
        return cls(rig, sequence, wall, cylinder)


@dataclass(frozen=True, slots=True)
class HeldRig:
    """What a rig makes of the yardstick.

    Attributes
    ----------
    wall_p95_mm, cylinder_p95_mm
        95 % of the errors along the true normal, after rigid alignment, are below.
    radius_error_mm, radius_all_error_mm
        Fitted less true radius: from pixels that see the cylinder alone, and from all.
    parameter_errors
        Found less true, by name, px, mm and rad.
    """

    wall_p95_mm: float
    cylinder_p95_mm: float
    radius_error_mm: float
    radius_all_error_mm: float
    parameter_errors: dict[str, float]


@dataclass(frozen=True, slots=True)
class Predicted:
    """What a covariance says of a rig, beside what is true of it.

    `wall_rms_mm` is the error along the wall's normal by which the rig differs from the true one,
    `wall_predicted_mm` its expected root mean square; `scores` are the parameters' errors over
    their standard deviations.
    """

    wall_rms_mm: float
    wall_predicted_mm: float
    scores: dict[str, float]


def hold_rig(rig: Rig, yardstick: Yardstick) -> HeldRig:
    """Scan wall and cylinder with a rig, and compare."""
    cylinder, true = yardstick.cylinder.scan(rig), yardstick.cylinder.truth
    (thing,) = yardstick.cylinder.scene.objects
    assert isinstance(thing.shape, Cylinder)
    inner = fit_cylinder(cylinder.xyz[inner_pixels(true) & cylinder.valid].astype(np.float64))
    return HeldRig(
        wall_p95_mm=yardstick.wall.bias(rig).normal_p95_mm,
        cylinder_p95_mm=find_bias(cylinder, true).normal_p95_mm,
        radius_error_mm=inner.radius_mm - thing.shape.radius_mm,
        radius_all_error_mm=measure_cylinder(cylinder).radius_mm - thing.shape.radius_mm,
        parameter_errors=_parameter_errors(rig, yardstick.rig),
    )


def hold_covariance(rig: Rig, covariance: Covariance, yardstick: Yardstick) -> Predicted:
    """Hold a calibration's covariance against what its rig errs by.

    The wall is seen at the same pixels by this rig and by the true one, so that their difference
    has nothing of what any scan has.
    """
    wall = yardstick.wall
    error = wall.bias(rig).normal_mm - wall.bias(yardstick.rig).normal_mm
    sigma = covariance.sigma
    found = _parameter_errors(rig, yardstick.rig)
    return Predicted(
        wall_rms_mm=float(np.sqrt(np.nanmean(error**2))),
        wall_predicted_mm=_normal_sigma_mm(rig, covariance, wall.truth),
        scores={name: off / sigma[name] for name, off in found.items() if name in sigma},
    )


def _normal_sigma_mm(rig: Rig, covariance: Covariance, truth: Truth) -> float:
    """Root mean square over a surface of the systematic standard deviation along its normal.

    After the rigid motion that fits best; at every twelfth pixel each way.
    """
    some = np.zeros(truth.surface.shape, dtype=bool)
    some[::FIELD_STEP, ::FIELD_STEP] = True
    some &= inner_pixels(truth)
    points = truth.xyz[some]
    rows, columns = np.nonzero(some)
    pixels = np.stack([columns, rows], axis=1).astype(np.float64)
    lit = np.stack([truth.column[some], truth.row[some]], axis=1)
    field = Field(points[:, 2], np.ones(len(points), dtype=bool), points, pixels, lit)
    by = without_motion(points_by_parameters(state_of(rig), field), rigid_motions(points))
    normals = grid_normals(truth.xyz.astype(np.float32))[some].astype(np.float64)
    along = np.einsum("nm,nmk->nk", normals, by)[:, None]
    return float(np.sqrt(np.mean(variances(along, shared_covariance(covariance)))))


def _parameter_errors(rig: Rig, true: Rig) -> dict[str, float]:
    """All but the board's shape, which is no part of a rig, and k3, which is not free."""
    names = [name for name in parameter_names(()) if not name.endswith((".k3", *SHAPE_NAMES))]
    errors = dict(
        zip(parameter_names(()), state_of(rig).vector - state_of(true).vector, strict=True)
    )
    turned = rig.projector_from_camera.rotation @ true.projector_from_camera.rotation.T
    angle = float(np.linalg.norm(rotation_vector(turned)))
    return {
        **{name: float(errors[name]) for name in names},
        "baseline_mm": rig.baseline_mm - true.baseline_mm,
        "angle_rad": angle,
    }
