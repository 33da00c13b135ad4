"""One trial of the study of calibrations: a board in poses of its own, captured, solved, held.

The same captures go to our calibration and to the plain chain of OpenCV (`plain_chain`). Poses,
noise and flicker are drawn anew for each seed.
"""

from __future__ import annotations

import os
from collections.abc import Sequence as Items
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate import CalibrationSettings, ImageSize, View, calibrate_rig, observe_board
from fringeworks.calibrate.adjust.covariance import read_covariance
from fringeworks.calibrate.adjust.state import SHAPE_NAMES
from fringeworks.calibrate.judge.structure import Structure, find_structure
from fringeworks.calibrate.judge.uncertainty import state_of
from fringeworks.calibrate.record import read_record
from fringeworks.calibrate.settings import BoardModel
from fringeworks.errors import CalibrationError
from fringeworks.experiments.held_rig import (
    HeldRig,
    Predicted,
    Yardstick,
    hold_covariance,
    hold_rig,
)
from fringeworks.experiments.plain_chain import PlainView, calibrate_plainly, observe_plainly
from fringeworks.geometry.lens import project
from fringeworks.geometry.pose import rotation_vector
from fringeworks.model import Pose, Rig
from fringeworks.phase.decode import decode_capture
from fringeworks.twin.optics import KEY as BEYOND
from fringeworks.twin.scene import Object, Scene
from fringeworks.twin.scenes import BOARD, BOARD_POSES, PAPER, board_pose, target_of
from fringeworks.twin.simulate import simulate

Array = NDArray[np.float64]

MIDDLE_MM = np.array([8.0, 6.0, 15.0])
TURN_DEG = 6.0
"""How far, at most, a drawn pose is from one of the board scene's, whose tilts are 20 to 36."""

MARGIN_PX = 4.0
"""Of the camera's image that the outermost squares keep free."""

DRAWS = 1000


@dataclass(frozen=True, slots=True)
class Kind:
    """What sort of trial: the board's bow, mm, and the shapes that are solved for."""

    name: str
    bow_mm: tuple[float, float] = (0.0, 0.0)
    shapes: tuple[BoardModel, ...] = ("flat",)


@dataclass(frozen=True, slots=True)
class Outcome:
    """One calibration, and what it says of itself.

    Attributes
    ----------
    camera_rms_px, projector_rms_px
        Over the corners kept, as anybody tells it.
    kept, offered
        Corners in all views.
    held
        The rig against the truth.
    predicted, halves_ratio, structure
        What ours says of itself besides; the plain chain says nothing.
    k3
        Devices for which k3 was wanted.
    findings
        In words.
    """

    camera_rms_px: float
    projector_rms_px: float
    kept: int
    offered: int
    held: HeldRig
    predicted: Predicted | None = None
    halves_ratio: float | None = None
    structure: Structure | None = None
    k3: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Trial:
    """What was made of one seed's captures: ours by the board's shape, and the plain chain's."""

    kind: str
    seed: int
    ours: dict[BoardModel, Outcome]
    plain: Outcome


def run_trial(kind: Kind, yardstick: Yardstick, *, seed: int, poses: int) -> Trial:
    """Draw, capture, calibrate both ways, compare; the same seed gives the same numbers."""
    rng = np.random.default_rng(seed)
    scenes = _scenes(kind, draw_poses(yardstick.rig, poses, rng=rng))
    seeds = rng.spawn(len(scenes))

    def observe(job: tuple[Scene, np.random.Generator]) -> tuple[View, PlainView]:
        made = simulate(job[0], yardstick.rig, yardstick.sequence, rng=job[1]).capture
        decoded = decode_capture(made)
        view = observe_board(made, decoded, target_of(BOARD))
        return view, observe_plainly(made, decoded, view)

    with ThreadPoolExecutor(os.cpu_count()) as pool:  # the kernels hold no lock
        seen = list(pool.map(observe, zip(scenes, seeds, strict=True)))
    ours, plain = zip(*seen, strict=True)
    return Trial(
        kind=kind.name,
        seed=seed,
        ours={shape: _ours(ours, yardstick, shape) for shape in kind.shapes},
        plain=_judge(calibrate_plainly(plain, yardstick.rig), yardstick),
    )


def beyond_model(rig: Rig) -> bool:
    """Whether its lenses do what no calibration can find, so that it has no true parameters."""
    return BEYOND in rig.further


def draw_poses(rig: Rig, count: int, *, rng: np.random.Generator) -> list[Pose]:
    """camera_from_board of poses spread like the board scene's, each drawn about one of those.

    All squares stay in the camera's view and in the projector's light.
    """
    places = np.linspace(0, len(BOARD_POSES) - 1, count).round().astype(int)
    return [_draw_pose(rig, *np.array(BOARD_POSES[place], float), rng=rng) for place in places]


def _draw_pose(rig: Rig, middle: Array, turn: Array, *, rng: np.random.Generator) -> Pose:
    for _ in range(DRAWS):
        x, y, z = middle + MIDDLE_MM * rng.uniform(-1, 1, 3)
        a, b, c = turn + TURN_DEG * rng.uniform(-1, 1, 3)
        pose = board_pose((x, y, z), (a, b, c))
        if _in_view(rig, pose):
            return pose
    raise CalibrationError(f"no pose about {middle.tolist()} mm shows the whole board")


def _in_view(rig: Rig, pose: Pose) -> bool:
    x, y = np.meshgrid([-1, BOARD.columns], [-1, BOARD.rows])
    flat = np.column_stack([x.ravel(), y.ravel(), np.zeros(4)]) * BOARD.square_mm
    points = pose.apply(flat)
    seen = project(points, rig.camera.lens.vector)
    shown = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)
    size = np.array([rig.camera.width, rig.camera.height]) - 1 - MARGIN_PX
    screen = np.array([rig.projector.width, rig.projector.height]) - 1
    in_camera = (seen >= MARGIN_PX).all() and (seen <= size).all()
    return bool(in_camera and (shown >= 0).all() and (shown <= screen).all())


def _scenes(kind: Kind, poses: Items[Pose]) -> list[Scene]:
    board = replace(BOARD, bow_mm=kind.bow_mm)
    return [
        Scene(f"pose_{place:02d}", (Object("board", board, pose, PAPER),))
        for place, pose in enumerate(poses)
    ]


def _ours(views: Items[View], yardstick: Yardstick, shape: BoardModel) -> Outcome:
    true = yardstick.rig
    rig = calibrate_rig(
        views,
        target_of(BOARD),
        camera_size=ImageSize(true.camera.width, true.camera.height),
        projector_size=ImageSize(true.projector.width, true.projector.height),
        settings=CalibrationSettings(board_shape=shape),
    )
    covariance, record = read_covariance(rig.further), read_record(rig.further)
    assert covariance is not None
    assert record is not None
    poses = [view.camera_from_board for view in record.views]
    state = replace(
        state_of(rig),
        camera_from_board=np.array(
            [np.concatenate([rotation_vector(p.rotation), p.translation_mm]) for p in poses]
        ),
        board_shape=np.array([record.board_shape[name] for name in SHAPE_NAMES]),
    )
    lenses = {"camera": rig.camera.lens, "projector": rig.projector.lens}
    return replace(
        _judge(rig, yardstick),
        predicted=None if beyond_model(true) else hold_covariance(rig, covariance, yardstick),
        halves_ratio=None if record.halves is None else record.halves.ratio,
        structure=find_structure(state, [view.view for view in record.views]),
        k3=tuple(device for device, lens in lenses.items() if lens.k3),
        findings=tuple(str(found) for found in record.findings),
    )


def _judge(rig: Rig, yardstick: Yardstick) -> Outcome:
    quality = rig.quality
    assert quality is not None
    return Outcome(
        camera_rms_px=quality.camera_rms_px,
        projector_rms_px=quality.projector_rms_px,
        kept=quality.observations_used,
        offered=quality.observations_offered,
        held=hold_rig(rig, yardstick),
    )
