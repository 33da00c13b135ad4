"""The calibrated scene in space: camera, projector and every pose of the board."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D
from numpy.typing import NDArray

from fringeworks.calibrate.record import ViewRecord
from fringeworks.geometry.lens import unproject
from fringeworks.model import Camera, Pose, Projector, Rig
from fringeworks.report.canvas import CAMERA_COLOUR, PROJECTOR_COLOUR, new_figure, view_colours

FRUSTUM_SHARE = 0.3
"""How far the drawn frustums reach, as a share of the farthest board's depth."""

Array = NDArray[np.float64]


def draw_scene(rig: Rig, views: Sequence[ViewRecord]) -> Figure:
    """Frustums and boards, the camera's z pointing into the picture and its y down."""
    boards = [_board_corners(view) for view in views]
    reach = FRUSTUM_SHARE * float(np.concatenate(boards)[:, 2].max())
    figure = new_figure(6.0, width_in=9.0)
    axes = figure.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    camera = _frustum(rig.camera, Pose.identity(), reach)
    projector = _frustum(rig.projector, rig.projector_from_camera.inverse(), reach)
    _draw_frustum(axes, camera, CAMERA_COLOUR, "camera")
    _draw_frustum(axes, projector, PROJECTOR_COLOUR, "projector")
    for corners, colour in zip(boards, view_colours(len(boards)), strict=True):
        patch = Poly3DCollection([_shown(corners)], alpha=0.45, facecolor=colour, edgecolor="0.2")
        axes.add_collection3d(patch)
    _frame(axes, _shown(np.concatenate([camera, projector, *boards])))
    axes.set_title(f"{len(boards)} poses of the board, baseline {rig.baseline_mm:.1f} mm")
    return figure


def _board_corners(view: ViewRecord) -> Array:
    """``(4, 3)`` outermost inner corners of the board in the camera's frame, mm, in a loop."""
    board = view.view.board_mm
    (x0, y0, _), (x1, y1, _) = board.min(axis=0), board.max(axis=0)
    loop = np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]])
    return view.camera_from_board.apply(loop)


def _frustum(device: Camera | Projector, camera_from_device: Pose, reach: float) -> Array:
    """``(5, 3)``: the centre and the image's four corners at depth `reach`, camera frame, mm."""
    right, bottom = device.width - 0.5, device.height - 0.5
    corners = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
    ideal = unproject(corners, device.lens.vector)
    if not np.isfinite(ideal).all():  # the distortion has no inverse out there
        lens = device.lens.vector
        ideal = (corners - lens[2:4]) / lens[:2]
    rays = np.column_stack([ideal, np.ones(4)]) * reach
    return camera_from_device.apply(np.concatenate([np.zeros((1, 3)), rays]))


def _shown(points: Array) -> Array:
    """Camera frame to the plot's: x right, depth into the picture, height up."""
    return np.asarray(points[:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0]))


def _draw_frustum(axes: Axes3D, frustum: Array, colour: str, name: str) -> None:
    points = _shown(frustum)
    edges = [points[[0, corner]] for corner in range(1, 5)]
    edges.append(points[[1, 2, 3, 4, 1]])
    axes.add_collection3d(Line3DCollection(edges, colors=colour, linewidths=1.2))
    axes.text(*points[0], f"{name}   ", color=colour, ha="right", va="center")


def _frame(axes: Axes3D, points: Array) -> None:
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.05 * (high - low).max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_zlim(low[2] - margin, high[2] + margin)
    axes.set_box_aspect(high - low + 2 * margin, zoom=1.25)
    axes.set_xlabel("x, mm", labelpad=2)
    axes.set_ylabel("depth z, mm", labelpad=12)
    axes.set_zlabel("-y, mm", labelpad=6)
    axes.tick_params(labelsize=8, pad=1)
    axes.view_init(elev=20, azim=-40)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4))
