"""Boards seen by a known rig: views by projection alone, images by sampling the squares."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate import View
from fringeworks.calibrate.adjust.board_shape import BoardFrame
from fringeworks.calibrate.adjust.projection import project_corners, project_sites
from fringeworks.calibrate.adjust.state import SHARED, RigState, pose_columns
from fringeworks.calibrate.sites import Sites
from fringeworks.geometry.lens import project, unproject
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import CheckerboardTarget, Rig

Array = NDArray[np.float64]

BOARD = CheckerboardTarget(columns=11, rows=8, pitch_x_mm=13.0, pitch_y_mm=13.0)
CAMERA = np.array([1974.0, 1970.0, 376.0, 240.0, -0.1, 0.05, 0.0, 0.0, 0.0])
# Offset optics: the principal point lies below the projector's 684 rows.
PROJECTOR = np.array([1013.0, 2026.0, 300.0, 720.0, -0.05, 0.03, 0.0, 0.0, 0.0])
RELATION = np.array([0.02, 0.28, -0.01, -180.0, 5.0, 20.0])


def board_poses(count: int, *, rng: np.random.Generator, tilt: float = 0.55) -> Array:
    """``(count, 6)`` camera_from_board: centres near the axis, tilted by up to `tilt` rad."""
    poses = []
    for _ in range(count):
        turn = rng.uniform(-tilt, tilt, 3)
        centre = np.array([rng.uniform(-40, 40), rng.uniform(-15, 15), rng.uniform(560, 740)])
        middle = BOARD.corners_mm().mean(axis=0)
        poses.append(np.concatenate([turn, centre - rotation_matrix(turn) @ middle]))
    return np.array(poses)


def rig_state(poses: Array) -> RigState:
    return RigState(CAMERA, PROJECTOR, RELATION, poses)


def on_board(pose: Array, bow: Array, board: Array) -> Array:
    """Points of the board ``(n, 3)``, bowed by so many mm in x and y, in the camera's frame."""
    span = BOARD.corners_mm().max(axis=0)[:2]
    scaled = 2 * board[:, :2] / span - 1
    raised = board + np.outer((scaled**2 - 1) @ bow, [0, 0, 1])
    return np.asarray(raised @ rotation_matrix(pose[:3]).T + pose[3:])


def read_maps(state: RigState, index: int, camera_px: Array) -> Array:
    """``(n, 2)`` projector px that the board shows at camera pixels.

    Where a ray meets a bowed board is iterated: cut the plane at the height of the last cut.
    """
    pose, relation = state.camera_from_board[index], state.projector_from_camera
    rays = np.column_stack([unproject(camera_px, state.camera), np.ones(len(camera_px))])
    turn = rotation_matrix(pose[:3])
    span = BOARD.corners_mm().max(axis=0)[:2]
    points, height = np.zeros_like(rays), np.zeros(len(rays))
    for _ in range(20):
        depth = (turn[:, 2] @ pose[3:] + height) / (rays @ turn[:, 2])
        points = rays * depth[:, None]
        at = (points - pose[3:]) @ turn
        height = ((2 * at[:, :2] / span - 1) ** 2 - 1) @ state.board_shape
    return project(points @ rotation_matrix(relation[:3]).T + relation[3:], state.projector)


def dense_sites(
    state: RigState, *, sigma: float, rng: np.random.Generator, across: int = 3
) -> list[Sites]:
    """`across` sites along every square's side, one square beyond the corners too, in each pose."""
    x, y = (np.arange(-1, count, 1 / across) for count in (BOARD.columns, BOARD.rows))
    x, y = np.meshgrid(x, y)
    pitch = np.array([BOARD.pitch_x_mm, BOARD.pitch_y_mm])
    board = np.column_stack([np.column_stack([x.ravel(), y.ravel()]) * pitch, np.zeros(x.size)])
    out = []
    for index, pose in enumerate(state.camera_from_board):
        places = project(on_board(pose, state.board_shape, board), state.camera)
        maps = read_maps(state, index, places)
        noisy = maps + rng.normal(0, sigma, maps.shape)
        out.append(Sites(places, noisy, np.full_like(maps, sigma)))
    return out


def views_of(
    state: RigState,
    *,
    sigma: float = 0.0,
    site_sigma: float | None = None,
    rng: np.random.Generator | None = None,
) -> list[View]:
    """What both devices see of the board in each pose, with normal noise on every coordinate.

    The maps are read at the camera's corners, wherever these err to, and add `site_sigma` of
    their own, by default `sigma`.
    """
    rng = rng or np.random.default_rng(0)
    site_sigma = sigma if site_sigma is None else site_sigma
    spread = np.full((BOARD.corner_count, 2), max(sigma, 0.01))
    views = []
    for index, pose in enumerate(state.camera_from_board):
        in_camera = on_board(pose, state.board_shape, BOARD.corners_mm())
        camera = project(in_camera, state.camera)
        camera += rng.normal(0, sigma, camera.shape)
        projector = read_maps(state, index, camera)
        views.append(
            View(
                name=f"pose_{index}",
                board_mm=BOARD.corners_mm(),
                camera_px=camera,
                projector_px=projector + rng.normal(0, site_sigma, projector.shape),
                camera_sigma_px=spread,
                projector_sigma_px=np.full_like(spread, max(site_sigma, 0.01)),
                reasons=("",) * BOARD.corner_count,
            )
        )
    return views


def residuals_and_jacobian(state: RigState, views: Sequence[View]) -> tuple[Array, Array]:
    """``(m,)`` residuals, px, of all kept corners and sites, and ``(m, parameters)`` derivatives.

    Rows: view by view, camera x and y of each corner, then column and row of each site. Columns
    follow `RigState.vector`.
    """
    frame = BoardFrame.of(view.board_mm for view in views)
    residuals, rows = [], []
    for index, (view, pose) in enumerate(zip(views, state.camera_from_board, strict=True)):
        corners = project_corners(state, pose, (view.board_mm[view.kept], frame))
        sites = project_sites(state, pose, (view.sites.camera_px, frame))
        residuals += [view.camera_px[view.kept] - corners[0], view.sites.projector_px - sites[0]]
        derivatives = np.concatenate([corners[1], sites[1]]).reshape(-1, corners[1].shape[-1])
        row = np.zeros((len(derivatives), len(state.vector)))
        row[:, np.r_[:SHARED, pose_columns(index)]] = -derivatives
        rows.append(row)
    return np.concatenate(residuals).ravel(), np.concatenate(rows)


def triangulate_corners(rig: Rig, camera_px: Array, projector_px: Array) -> Array:
    """``(n, 3)`` mm: midpoints of the rays of both devices, camera frame."""
    pose = rig.projector_from_camera
    one = np.ones((len(camera_px), 1))
    first = np.hstack([unproject(camera_px, rig.camera.lens.vector), one])
    second = np.hstack([unproject(projector_px, rig.projector.lens.vector), one]) @ pose.rotation
    origin = -pose.rotation.T @ pose.translation_mm
    points = []
    for a, b in zip(first, second, strict=True):
        near, *_ = np.linalg.lstsq(np.stack([a, -b], axis=1), origin, rcond=None)
        points.append((near[0] * a + origin + near[1] * b) / 2)
    return np.array(points)


def square_sides(points: Array, board: CheckerboardTarget) -> Array:
    """Distances of all adjacent corners, mm."""
    grid = points.reshape(board.rows, board.columns, 3)
    sides: Sequence[Array] = [
        np.linalg.norm(np.diff(grid, axis=axis), axis=-1).ravel() for axis in (0, 1)
    ]
    return np.concatenate(sides)


def render_board(
    pose: Array, *, width: int = 752, height: int = 480, noise: float = 1.0, seed: int = 1
) -> NDArray[np.uint8]:
    """The board as `CAMERA` sees it: 3 x 3 samples per pixel, white margin, grey surrounding."""
    fine = 3
    v, u = np.mgrid[: height * fine, : width * fine]
    pixels = (np.stack([u, v], axis=-1) + 0.5) / fine - 0.5
    rays = np.concatenate([unproject(pixels, CAMERA), np.ones((*u.shape, 1))], axis=-1)
    turn = rotation_matrix(pose[:3])
    depth = (turn[:, 2] @ pose[3:]) / (rays @ turn[:, 2])
    on_board = (rays * depth[..., None] - pose[3:]) @ turn
    x, y = on_board[..., 0] / BOARD.pitch_x_mm, on_board[..., 1] / BOARD.pitch_y_mm
    dark = (np.floor(x) + np.floor(y)) % 2 == 0
    squares = (x > -1) & (x < BOARD.columns) & (y > -1) & (y < BOARD.rows)
    paper = (x > -2) & (x < BOARD.columns + 1) & (y > -2) & (y < BOARD.rows + 1)
    grey = np.where(squares & dark, 30.0, np.where(paper, 200.0, 80.0))
    image = grey.reshape(height, fine, width, fine).mean(axis=(1, 3))
    noisy = image + np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))


@cache
def reference() -> tuple[Array, NDArray[np.uint8]]:
    """A pose and the board's image in it, rendered once for all tests."""
    pose = board_poses(1, rng=np.random.default_rng(21))[0]
    return pose, render_board(pose)


def true_corners(pose: Array) -> Array:
    """``(n, 2)`` px of the board's corners in `CAMERA`."""
    return project(BOARD.corners_mm() @ rotation_matrix(pose[:3]).T + pose[3:], CAMERA)


def true_projector_map(pose: Array, *, width: int = 752, height: int = 480) -> Array:
    """``(H, W, 2)`` projector px of the board's plane at each pixel of `CAMERA`."""
    v, u = np.mgrid[:height, :width].astype(float)
    rays = np.concatenate([unproject(np.stack([u, v], -1), CAMERA), np.ones((*u.shape, 1))], -1)
    normal = rotation_matrix(pose[:3])[:, 2]
    points = rays * ((normal @ pose[3:]) / (rays @ normal))[..., None]
    return project(points @ rotation_matrix(RELATION[:3]).T + RELATION[3:], PROJECTOR)
