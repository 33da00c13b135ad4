"""What a model leaves of the projector coordinate, taken from it before the model is asked.

The published cure for what the projector's lens does beyond its model, in large volumes. In the
coordinate and not in z: both axes stay consistent, every model is served alike, and a correction
of smooth size remains one where the depth is steep in the coordinate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fringeworks.kernels.residual import Polynomial, take_residual
from fringeworks.model import CodedAxis, Finding, ModelName, ProjectorMap, ResidualField, Rig


def fields_of(rig: Rig, model: ModelName) -> tuple[ResidualField, ...]:
    """The rig's residual fields of a model: of one axis, both or none."""
    return tuple(field for field in rig.residual if field.model == model)


def take_residuals(projector_map: ProjectorMap, rig: Rig, model: ModelName) -> ProjectorMap:
    """The map, coordinate by coordinate less the rig's residual fields of the model.

    Coordinates that are void stay so, and an axis without a field is as it was. The standard
    deviations stay: the fields' slopes are a hundredth and less.
    """
    fields = fields_of(rig, model)
    return ProjectorMap(
        column=_take(projector_map.column, fields), row=_take(projector_map.row, fields)
    )


def notice_fields(rig: Rig, model: ModelName) -> tuple[Finding, ...]:
    """A note where the model's coordinates are corrected."""
    fields = fields_of(rig, model)
    if not fields:
        return ()
    told = " and ".join(f"of order {field.order} along {field.axis}" for field in fields)
    return (
        Finding(
            "note", f"the rig's residual field {told} was taken from the {model} model's input."
        ),
    )


def polynomial_of(field: ResidualField) -> Polynomial:
    """The field as the kernels take it."""
    coefficients = np.array(field.coefficients, dtype=np.float64)
    return Polynomial(field.order, field.middle, field.low, field.high, coefficients)


def _take(coded: CodedAxis | None, fields: tuple[ResidualField, ...]) -> CodedAxis | None:
    for field in fields:
        if coded is not None and coded.axis == field.axis:
            corrected = np.empty_like(coded.coordinate)
            take_residual(coded.coordinate, polynomial_of(field), corrected)
            return replace(coded, coordinate=corrected)
    return coded
