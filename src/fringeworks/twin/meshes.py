"""Meshes under rays: Embree (float32) names the triangle, `kernels.mesh` says where on it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MissingExtraError, UsageError
from fringeworks.kernels.mesh import aim, hide_behind_mesh, look_at_mesh
from fringeworks.kernels.rays import Body
from fringeworks.model import Pose
from fringeworks.twin.bodies import placed_body
from fringeworks.twin.scene import MOST_MM, Mesh

Array = NDArray[np.float64]

MESH = -1
"""Shape code of a body that the analytic kernels never meet."""


@dataclass(frozen=True, slots=True, eq=False)
class MeshBody:
    """A mesh at its place, with its search tree.

    Attributes
    ----------
    body
        Its ball and place.
    triangles
        Corners ``(m, 3, 3)`` about the ball's middle, mm, and unit normals ``(m, 3)``.
    tree
        Embree's scene.
    """

    body: Body
    triangles: tuple[Array, Array]
    tree: Any

    def look(
        self, index: int, rays: tuple[Array, Array], sight: tuple[Array, NDArray[np.int16], Array]
    ) -> None:
        """Enter the mesh where rays (origins, directions) meet it before anything else.

        `sight` is distance, surface and normals of what they met so far.
        """
        found = self._find(rays, False, sight[0])
        look_at_mesh(self.body, index, rays, self.triangles, found, sight)

    def hide(self, points: Array, origins: Array, hidden: NDArray[np.bool_]) -> None:
        """Mark the points ``(n, 3)`` between which and their origins the mesh stands."""
        highs = np.where(hidden, -np.inf, np.inf)
        rays = (origins, points)
        found = self._find(rays, True, highs)
        hide_behind_mesh(self.body, rays, self.triangles, found, hidden)

    def _find(
        self, rays: tuple[Array, Array], ends: bool, highs: Array
    ) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        """Rays near the mesh and the first triangle that each meets, -1 for none."""
        chosen, origins, directions = aim(self.body, rays, ends, highs)
        if not len(chosen):
            return chosen, np.empty(0, np.int32)
        return chosen, np.asarray(self.tree.run(origins, directions), dtype=np.int32)


def mesh_body(mesh: Mesh, camera_from_object: Pose) -> MeshBody:
    """A mesh made ready for rays; triangles without area are left out.

    Raises
    ------
    UsageError
        See `check_mesh`.
    MissingExtraError
        Embree is not installed.
    """
    check_mesh(mesh)
    used = mesh.vertices[mesh.faces]
    low, high = used.min(axis=(0, 1)), used.max(axis=(0, 1))
    middle = np.asarray((low + high) / 2, dtype=np.float64)
    corners = used - middle
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    whole = lengths > 0
    corners, normals = corners[whole], normals[whole] / lengths[whole, None]
    radius = float(np.sqrt(np.max(np.sum(corners**2, axis=-1))))
    body = placed_body(MESH, np.empty(0), (middle, radius), camera_from_object)
    return MeshBody(body, (np.ascontiguousarray(corners), normals), _tree(corners))


def check_mesh(mesh: Mesh) -> None:
    """Refuse a mesh that no ray can meet soundly.

    Raises
    ------
    UsageError
        No faces, faces that name vertices that are not there, vertices that are not finite or
        beyond `MOST_MM`, or no triangle with any area.
    """
    name, vertices, faces = mesh.source, mesh.vertices, mesh.faces
    _check_shapes(mesh)
    if not len(faces):
        raise UsageError(f"{name} must have faces, got none: is it a cloud of points?")
    wrong = int(np.count_nonzero((faces < 0) | (faces >= len(vertices))))
    if wrong:
        raise UsageError(
            f"{name} must have faces that name its {len(vertices)} vertices, got {wrong} indices "
            "outside them: export the mesh again"
        )
    broken = int(np.count_nonzero(~np.isfinite(vertices).all(axis=1)))
    if broken:
        raise UsageError(
            f"{name} must have finite vertices, got {broken} of {len(vertices)} with NaN or "
            "infinity: repair the mesh, or remove those vertices and their faces"
        )
    far = float(np.abs(vertices).max())
    if far > MOST_MM:
        raise UsageError(
            f"{name} must have coordinates of at most {MOST_MM:g} mm, got {far:g}: check its units "
            "and its scale"
        )
    edges = vertices[faces[:, 1:]] - vertices[faces[:, :1]]
    if not np.cross(edges[:, 0], edges[:, 1]).any():
        raise UsageError(f"{name} must have triangles with an area, got {len(faces)} without")


def _check_shapes(mesh: Mesh) -> None:
    for array, what in ((mesh.vertices, "vertices"), (mesh.faces, "faces")):
        if array.ndim != 2 or array.shape[1] != 3:
            raise UsageError(f"{mesh.source}: {what} must be (n, 3), got {array.shape}")
    if mesh.faces.dtype.kind not in "iu":
        raise UsageError(f"{mesh.source}: faces must be integers, got {mesh.faces.dtype}")


def _tree(corners: Array) -> Any:
    try:
        scenes = import_module("embreex.rtcore_scene")
        meshing = import_module("embreex.mesh_construction")
    except ImportError as missing:
        raise MissingExtraError(
            "meshes need Embree: pip install fringeworks[mesh] (there is no Embree wheel for "
            "64-bit Arm Linux; scenes of plain shapes work without)"
        ) from missing
    tree = scenes.EmbreeScene(
        robust=True
    )  # rays do not slip through between neighbouring triangles
    meshing.TriangleMesh(tree, np.ascontiguousarray(corners, dtype=np.float32))
    return tree
