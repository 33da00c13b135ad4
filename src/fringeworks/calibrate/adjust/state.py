"""What the refinement can move, as one vector, and what its parts are called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.geometry.lens import LENS_NAMES

Array = NDArray[np.float64]

POSE_NAMES = ("rx_rad", "ry_rad", "rz_rad", "tx_mm", "ty_mm", "tz_mm")
SHAPE_NAMES = ("bow_x_mm", "bow_y_mm")

_LENS = len(LENS_NAMES)
POSE = len(POSE_NAMES)
CAMERA = slice(0, _LENS)
PROJECTOR = slice(_LENS, 2 * _LENS)
RELATION = slice(2 * _LENS, 2 * _LENS + POSE)
SHAPE = slice(RELATION.stop, RELATION.stop + len(SHAPE_NAMES))
SHARED = SHAPE.stop
"""How many parameters all views share."""

DECENTRING = [start + LENS_NAMES.index(name) for start in (0, _LENS) for name in ("p1", "p2")]


@dataclass(frozen=True, slots=True, eq=False)
class RigState:
    """Everything the refinement can move.

    Lenses are ``(9,)`` as in `geometry.lens`. Poses are ``(6,)``: rotation vector, rad, and
    translation, mm; `camera_from_board` is ``(views, 6)``. `board_shape` is ``(2,)``, see
    `board_shape`.
    """

    camera: Array
    projector: Array
    projector_from_camera: Array
    camera_from_board: Array
    board_shape: Array = field(default_factory=lambda: np.zeros(len(SHAPE_NAMES)))

    @property
    def vector(self) -> Array:
        """``(26 + 6 views,)``: camera, projector, relative pose, board's shape, board poses."""
        shared = (self.camera, self.projector, self.projector_from_camera, self.board_shape)
        return np.concatenate([*shared, self.camera_from_board.ravel()])

    @classmethod
    def from_vector(cls, vector: Array) -> RigState:
        return cls(
            camera=vector[CAMERA],
            projector=vector[PROJECTOR],
            projector_from_camera=vector[RELATION],
            camera_from_board=vector[SHARED:].reshape(-1, POSE),
            board_shape=vector[SHAPE],
        )


def pose_columns(index: int) -> NDArray[np.intp]:
    """Where the pose of a view stands in `RigState.vector`."""
    return np.arange(SHARED + POSE * index, SHARED + POSE * (index + 1), dtype=np.intp)


def free_indices(settings: CalibrationSettings, views: int) -> NDArray[np.intp]:
    """Indices into `RigState.vector` of the parameters that move."""
    camera = [place for place, name in enumerate(LENS_NAMES) if name in settings.camera_free]
    projector = [
        _LENS + place for place, name in enumerate(LENS_NAMES) if name in settings.projector_free
    ]
    shape = range(SHAPE.start, SHAPE.stop) if settings.board_shape != "flat" else ()
    poses = range(SHARED, SHARED + POSE * views)
    relation = range(RELATION.start, RELATION.stop)
    return np.array([*camera, *projector, *relation, *shape, *poses], dtype=np.intp)


def parameter_names(views: Sequence[str]) -> tuple[str, ...]:
    """Names of `RigState.vector` for views of these names: ``camera.fx``, ``pose_3.tz_mm``."""
    parts = [
        ("camera", LENS_NAMES),
        ("projector", LENS_NAMES),
        ("projector_from_camera", POSE_NAMES),
        ("board", SHAPE_NAMES),
        *((view, POSE_NAMES) for view in views),
    ]
    return tuple(f"{part}.{name}" for part, names in parts for name in names)
