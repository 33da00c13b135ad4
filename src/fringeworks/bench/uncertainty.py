"""Whether what a cloud says of its uncertainty is so: its random part, and its systematic part."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.bench.metric import Metric
from fringeworks.calibrate import CalibrationSettings, View
from fringeworks.calibrate.adjust.board_shape import BoardFrame
from fringeworks.calibrate.adjust.bundle import refine
from fringeworks.calibrate.adjust.projection import project_corners, project_sites
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.judge.uncertainty import (
    points_by_parameters,
    shared_covariance,
    state_of,
    triangulate_points,
    variances,
)
from fringeworks.geometry.pose import rotation_vector
from fringeworks.model import Camera, CheckerboardTarget, Pose, Rig
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import scan
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import BOARD, BOARD_POSES, board_pose, paper_rig, target_of, wall_scene
from fringeworks.twin.simulate import simulate
from fringeworks.uncertainty.seen import wall_at

Array = NDArray[np.float64]

STEPS, PERIODS_PX = (3, 4, 8), (16.0, 32.0)
SEED = 3
WINDOW = (188, 120)
"""Width and height, px, of the part of the camera's image that is simulated."""

SEEDS, QUICK_SEEDS = 50, 4
VIEWS = 8
CORNER_SIGMA_PX, SITE_SIGMA_PX = 0.05, 0.02


def measure_uncertainty(*, quick: bool = False) -> list[Metric]:
    """Predicted over observed sigma of z, and the coverage of 95 % intervals of its other part."""
    ratios = [sigma_z(steps, period) for steps in STEPS for period in PERIODS_PX]
    return [*ratios, systematic_coverage(QUICK_SEEDS if quick else SEEDS)]


def sigma_z(steps: int, period_px: float) -> Metric:
    """Predicted over observed: a wall on the twin with noise, less the same without."""
    rig = _window(paper_rig())
    sequence = make_sequence(
        "measure",
        width=rig.projector.width,
        height=rig.projector.height,
        axes=("x",),
        steps=steps,
        periods_px=(period_px,),
    )
    noisy, quiet = (
        scan(
            simulate(
                wall_scene(), rig, sequence, effects=effects, rng=np.random.default_rng(SEED)
            ).capture,
            rig,
        )
        for effects in (Effects(), Effects().without_noise())
    )
    both = noisy.valid & quiet.valid
    scores = (noisy.xyz[both, 2] - quiet.xyz[both, 2]) / noisy.sigma_mm[both]
    ratio = 1 / math.sqrt(float(np.mean(np.square(scores, dtype=np.float64))))
    note = f"bar 0.9 to 1.1; the twin's wall, {np.count_nonzero(both)} points"
    key = f"accuracy.sigma_z.{steps}_steps_{period_px:g}_px.predicted"
    return Metric(key, ratio, "x", "one", note)


def systematic_coverage(seeds: int) -> Metric:
    """Share of true depths within 1.96 systematic sigma of what so many calibrations measure.

    The paper's rig sees boards by projection alone, with normal noise; walls at three depths.
    """
    rig, poses = paper_rig(), [board_pose(*row) for row in BOARD_POSES[:VIEWS]]
    truth = replace(state_of(rig), camera_from_board=np.array([_vector(pose) for pose in poses]))
    walls = [wall_at(rig, depth)[0] for depth in (560.0, 660.0, 760.0)]
    hits = []
    for seed in range(seeds):
        views = _noisy_views(truth, np.random.default_rng([SEED, seed]))
        fit = refine(truth, views, CalibrationSettings())
        assert fit.covariance is not None
        shared = shared_covariance(fit.covariance)
        for wall in walls:
            by = points_by_parameters(fit.state, wall)[:, 2:]
            sigma = np.sqrt(variances(by, shared)[:, 0])
            found = triangulate_points(fit.state, wall.camera_px, wall.projector_px)[:, 2]
            hits.append(np.abs(found - wall.points[:, 2]) < 1.96 * sigma)
    share = float(np.mean(np.concatenate(hits)))
    note = f"bar 0.90 to 0.99; {seeds} calibrations of {VIEWS} views, 95 % intervals"
    return Metric("accuracy.systematic.coverage", share, "share", "one", note)


def _window(rig: Rig) -> Rig:
    """The rig with the middle of its camera's image alone."""
    (width, height), lens = WINDOW, rig.camera.lens
    left, top = (rig.camera.width - width) / 2, (rig.camera.height - height) / 2
    return replace(
        rig, camera=Camera(width, height, replace(lens, cx=lens.cx - left, cy=lens.cy - top))
    )


def _vector(pose: Pose) -> Array:
    return np.concatenate([rotation_vector(pose.rotation), pose.translation_mm])


def _noisy_views(truth: RigState, rng: np.random.Generator) -> list[View]:
    """Corners as the camera finds them, and the maps as they are read there."""
    target = target_of(BOARD)
    assert isinstance(target, CheckerboardTarget)
    board = target.corners_mm()
    frame, views = BoardFrame.of([board]), []
    for index, pose in enumerate(truth.camera_from_board):
        camera = project_corners(truth, pose, (board, frame))[0]
        camera = camera + rng.normal(0, CORNER_SIGMA_PX, camera.shape)
        maps = project_sites(truth, pose, (camera, frame))[0]
        views.append(
            View(
                name=f"pose_{index}",
                board_mm=board,
                camera_px=camera,
                projector_px=maps + rng.normal(0, SITE_SIGMA_PX, maps.shape),
                camera_sigma_px=np.full_like(camera, CORNER_SIGMA_PX),
                projector_sigma_px=np.full_like(camera, SITE_SIGMA_PX),
                reasons=("",) * len(board),
            )
        )
    return views
