"""Rigs as poor as the paper's, drawn at random: board, corners, calibration, scan; no images.

Each draw is the paper's section 4 in closed form. A rig is drawn about the twin's, with distorted
lenses, and a board with what is wrong with cheap prints. The camera sees printed corners and
projected ones with noise of the size that the paper reports of its reprojection; our own paper mode
(`calibrate.projected`) calibrates from them; the extended parameters are fitted to the same boards;
held-out forms are scanned without noise. The priors below are stated, not tuned, and no draw is
left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate import CalibrationSettings, ImageSize
from fringeworks.calibrate.extended.fit import Mode, fit_extended
from fringeworks.calibrate.extended.planes import PlanePoints
from fringeworks.calibrate.projected.fit import PaperFit, fit_paper
from fringeworks.experiments.extended_rigs import PERIOD_PX, PHASE_PX, Kind, draw_true, scan_forms
from fringeworks.experiments.paper.poor_board import Priors, Sheet, see_pose
from fringeworks.experiments.ray_forms import (
    CYLINDER_MM,
    FormErrors,
    Forms,
    Seen,
    judge_scan,
)
from fringeworks.geometry.lens import pixel_rays, project, project_jacobian, unproject
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.kernels.paper_model import TURN
from fringeworks.model import Camera, Extended, Lens, Pose, Projector, Rig
from fringeworks.twin.scenes import BOARD, BOARD_POSES, board_pose

Array = NDArray[np.float64]
Scan = tuple[tuple[Array, ...], Array, tuple[Array, ...]]

MODELS = ("equations 1 to 3", "extended, paper", "extended, MAP", "full")
POINTS_PER_BOARD = 1800
NEWTON_STEPS = 8

LENSES = Kind("poor", distorted=True, corner_px=0.0)
"""Lenses and pose as the study of drawn rigs draws them; the corners' noise is ours here."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """What one rig's scans err by, mm, and how its calibration looked.

    Attributes
    ----------
    errors
        By each of `MODELS`.
    chord_mm
        By each of them: half the distance of the outermost points of a section, less the true.
    camera_std_px, projector_std_px
        Of the reprojection, along x and y, as the paper reports it.
    camera_std_mm
        The camera's along x at 600 mm.
    """

    errors: Mapping[str, FormErrors]
    chord_mm: Mapping[str, float]
    camera_std_px: tuple[float, float]
    projector_std_px: tuple[float, float]
    camera_std_mm: float


def draw_rig(priors: Priors, seed: int) -> Drawn:
    """Draw, calibrate, fit and scan one rig; the same seed draws the same rig for all priors."""
    true = sharpen(draw_true(LENSES, np.random.default_rng([seed, 0])), priors.resolution)
    board = Sheet.draw(priors, np.random.default_rng([seed, 1]))
    rng = np.random.default_rng([seed, 2])
    views = [
        see_pose(place, board, true, priors=priors, rng=rng) for place in range(len(BOARD_POSES))
    ]
    sizes = tuple(ImageSize(item.width, item.height) for item in (true.camera, true.projector))
    made = fit_paper(views, (sizes[0], sizes[1]), CalibrationSettings())
    found = _rig_of(made, true)
    points = board_points((true, found), made, board, rng=rng)
    forms = Forms.of(true)
    scans = _scan_all(forms, (found, shift_phase(found, priors.phase_rad)), points)
    residuals = np.concatenate(
        [
            part[view.printed.kept]
            for view, part in zip(made.views, made.camera_residual_px, strict=True)
        ]
    )
    spread = residuals.std(axis=0)
    return Drawn(
        errors={name: judge_scan(forms, scan) for name, scan in scans.items()},
        chord_mm={name: _chord_error(forms.cylinder, scan[1]) for name, scan in scans.items()},
        camera_std_px=(float(spread[0]), float(spread[1])),
        projector_std_px=(float(made.alone_px[0]), float(made.alone_px[1])),
        camera_std_mm=float(spread[0]) * 600.0 / true.camera.lens.fx,
    )


def sharpen(rig: Rig, times: int) -> Rig:
    """The same rig with so many times the camera's pixels along each axis."""
    lens = rig.camera.lens
    finer = replace(
        lens,
        fx=lens.fx * times,
        fy=lens.fy * times,
        cx=(lens.cx + 0.5) * times - 0.5,
        cy=(lens.cy + 0.5) * times - 0.5,
    )
    return replace(rig, camera=Camera(rig.camera.width * times, rig.camera.height * times, finer))


def _rig_of(fit: PaperFit, true: Rig) -> Rig:
    state = fit.state
    pose = state.projector_from_camera
    return replace(
        true,
        camera=replace(true.camera, lens=Lens.from_vector(state.camera)),
        projector=Projector(
            true.projector.width, true.projector.height, Lens.from_vector(state.projector)
        ),
        projector_from_camera=Pose(rotation_matrix(pose[:3]), pose[3:].copy()),
    )


def board_points(
    rigs: tuple[Rig, Rig], fit: PaperFit, board: Sheet, *, rng: np.random.Generator
) -> PlanePoints:
    """Points all over the boards, by depths of the planes where the calibration has them.

    `rigs` are the true one and the one that was found.
    """
    true, found = rigs
    rays, coordinate, depth = [], [], []
    low, high = -BOARD.square_mm, BOARD.square_mm * np.array([BOARD.columns, BOARD.rows])
    for place, pose in zip(BOARD_POSES, fit.state.camera_from_board, strict=True):
        flat = rng.uniform(low, high, (POINTS_PER_BOARD, 2))
        points = board_pose(*place).apply(np.column_stack([flat, board.height(flat)]))
        ideal = unproject(project(points, true.camera.lens.vector), found.camera.lens.vector)
        lit = project(true.projector_from_camera.apply(points), true.projector.lens.vector)
        normal = rotation_matrix(pose[:3])[:, 2]
        rays.append(ideal.T)
        depth.append(float(normal @ pose[3:]) / (ideal @ normal[:2] + normal[2]))
        coordinate.append(lit[:, 0] + PHASE_PX * rng.standard_normal(POINTS_PER_BOARD))
    count = len(BOARD_POSES)
    return PlanePoints(
        rays=np.concatenate(rays, axis=1),
        coordinate=np.concatenate(coordinate),
        depth=np.concatenate(depth),
        sigma=np.full(count * POINTS_PER_BOARD, PHASE_PX),
        plane=np.repeat(np.arange(count), POINTS_PER_BOARD),
    )


def shift_phase(rig: Rig, phase_rad: float) -> Rig:
    """The rig with phi_0, which follows from the principal point, off by so much."""
    lens = rig.projector.lens
    moved = replace(lens, cx=lens.cx + phase_rad * PERIOD_PX / TURN)
    return replace(rig, projector=replace(rig.projector, lens=moved))


def _scan_all(forms: Forms, rigs: tuple[Rig, Rig], points: PlanePoints) -> dict[str, Scan]:
    """The forms by each of `MODELS`: by the rig, the paper's by that with phi_0 off."""
    rig, off = rigs
    scans = {MODELS[0]: scan_forms(forms, off, Extended("x", PERIOD_PX))}
    modes: tuple[tuple[str, Mode], ...] = ((MODELS[1], "paper"), (MODELS[2], "map"))
    for name, mode in modes:
        fit = fit_extended(points, off, axis="x", period_px=PERIOD_PX, mode=mode)
        scans[name] = scan_forms(forms, off, fit.extended)
    return {**scans, MODELS[3]: scan_fully(forms, rig)}


def scan_fully(forms: Forms, rig: Rig) -> Scan:
    """The forms by the full model, from the projector's column alone."""

    def scan(seen: Seen) -> Array:
        rays = pixel_rays(seen.camera_px, rig.camera.lens.vector)
        return rays * _depths(rays, seen.projector_px[:, 0], rig)[:, None]

    return (
        tuple(scan(seen) for seen in forms.planes),
        scan(forms.cylinder),
        tuple(scan(seen) for seen in forms.balls),
    )


def _depths(rays: Array, column: Array, rig: Rig) -> Array:
    """``(n,)`` z at which rays ``(n, 3)`` meet a projector column, by Newton's method."""
    pose, lens = rig.projector_from_camera, rig.projector.lens.vector
    along = rays @ pose.rotation.T
    z = np.full(len(rays), CYLINDER_MM[2])
    for _ in range(NEWTON_STEPS):
        seen, by_point, _ = project_jacobian(along * z[:, None] + pose.translation_mm, lens)
        z += (column - seen[:, 0]) / np.einsum("ni,ni->n", by_point[:, 0], along)
    return z


def _chord_error(seen: Seen, scanned: Array) -> float:
    """Mean over the rows of half the distance of the outermost points, less the true one."""
    rows = np.round(seen.points[:, 1] / 2.0)  # sections 2 mm thick
    errors = []
    for row in np.unique(rows):
        here = np.flatnonzero(rows == row)
        ends = here[[np.argmin(seen.points[here, 0]), np.argmax(seen.points[here, 0])]]
        measured, true = (_half(points[ends]) for points in (scanned, seen.points))
        errors.append(measured - true)
    return float(np.mean(errors))


def _half(ends: Array) -> float:
    """Half the distance of two points across the axis, which is upright."""
    return float(np.hypot(*(ends[1] - ends[0])[[0, 2]]) / 2)
