"""What stands before the twin's rig: shapes, what they are made of, and where they are.

Lengths are mm. A shape has a frame of its own, in which its parameters are said; an object places
that frame in the camera's. Surfaces are seen from both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Pose

Vector: TypeAlias = tuple[float, float, float]

MOST_MM = 1e6
"""Largest length of a scene."""


@dataclass(frozen=True, slots=True)
class Plane:
    """The rectangle ``|x| <= width / 2, |y| <= height / 2`` of z = 0; infinite unless told."""

    width_mm: float = math.inf
    height_mm: float = math.inf


@dataclass(frozen=True, slots=True)
class Sphere:
    """The sphere about the origin."""

    radius_mm: float


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder about the z axis, from z = -length / 2 to length / 2, closed by two discs."""

    radius_mm: float
    length_mm: float


@dataclass(frozen=True, slots=True)
class Cone:
    """A cone about the z axis: its base, a disc, at z = 0 and its apex at z = height."""

    radius_mm: float
    height_mm: float


@dataclass(frozen=True, slots=True)
class Box:
    """A box centred on the origin, its edges along the axes."""

    size_mm: Vector


@dataclass(frozen=True, slots=True)
class Capsule:
    """A round-ended cone: all spheres whose centre and radius run linearly between two ends."""

    start_mm: Vector
    start_radius_mm: float
    end_mm: Vector
    end_radius_mm: float


@dataclass(frozen=True, slots=True)
class Blend:
    """A free form: capsules that melt into each other over `smooth_mm`.

    The surface is where the smooth minimum of the capsules' distances is zero.
    """

    capsules: tuple[Capsule, ...]
    smooth_mm: float = 4.0


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles: vertices ``(n, 3)``, mm, and faces ``(m, 3)``, indices; shaded flat.

    `source` says where they come from, for messages.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    source: str = "mesh"


@dataclass(frozen=True, slots=True)
class Board:
    """A printed target on a sheet, with what is wrong with real ones.

    The frame is that of `CheckerboardTarget`: origin at the first inner corner, x along the
    columns, y along the rows, z = 0 on the ideal sheet, whose printed side looks to -z (a board
    facing the camera needs no turn). `columns` and `rows` count inner corners.

    Attributes
    ----------
    kind
        A checkerboard, its first square (up and left of the first corner) black; ChArUco, with
        markers of `dictionary` and `marker_mm` in its white squares as OpenCV draws them; or black
        circles of `diameter_mm` on white, their centres `square_mm` apart where the corners are.
    margin_mm
        White sheet around the outermost squares.
    print_scale
        Share by which the print is too large, along x and y.
    print_sigma_mm
        Standard deviation of each corner's place; between corners the print follows bilinearly.
    print_seed
        Seed of those places.
    bow_mm
        Height of the sheet's middle over its edges, along x and y: z gains
        ``-bow_x (1 - x'^2) - bow_y (1 - y'^2)`` with x', y' from -1 to 1 over the sheet, towards
        the camera where positive.
    """

    columns: int
    rows: int
    square_mm: float
    kind: Literal["checkerboard", "charuco", "circles"] = "checkerboard"
    marker_mm: float | None = None
    dictionary: str = "DICT_4X4_250"
    diameter_mm: float | None = None
    margin_mm: float = 10.0
    print_scale: tuple[float, float] = (0.0, 0.0)
    print_sigma_mm: float = 0.0
    print_seed: int = 0
    bow_mm: tuple[float, float] = (0.0, 0.0)


Shape: TypeAlias = Plane | Sphere | Cylinder | Cone | Box | Blend | Mesh | Board


@dataclass(frozen=True, slots=True)
class Material:
    """How a surface reflects.

    Attributes
    ----------
    albedo
        Share of the light that Lambert's law spreads, 0 to 1; for a board, its white.
    dark_albedo
        The same for a board's black.
    gloss
        Share of the light in the lobe about the mirror's direction, 0 to 1 (Phong, energy
        preserving: ``gloss (n + 2) / 2 cos^n``).
    gloss_exponent
        n of that lobe: 10 satin, 200 polished.
    """

    albedo: float = 0.8
    dark_albedo: float = 0.06
    gloss: float = 0.0
    gloss_exponent: float = 30.0


@dataclass(frozen=True, slots=True)
class Object:
    """A shape with its material, its place, and how it moves while frames are taken."""

    name: str
    shape: Shape
    camera_from_object: Pose
    material: Material = field(default_factory=Material)
    velocity_mm_s: Vector = (0.0, 0.0, 0.0)

    @property
    def moves(self) -> bool:
        return any(self.velocity_mm_s)


@dataclass(frozen=True, slots=True)
class Scene:
    """Objects, in the camera's frame.

    `poses` are further places of the object called `posed`, one capture each: how a board is
    shown to a rig. Without them the scene is one capture.
    """

    name: str
    objects: tuple[Object, ...]
    posed: str | None = None
    poses: tuple[Pose, ...] = ()

    def views(self) -> tuple[Scene, ...]:
        """One scene per capture: per pose, called pose_00, pose_01..., else the scene itself."""
        if not self.poses:
            return (self,)
        return tuple(self._at(pose, f"pose_{place:02d}") for place, pose in enumerate(self.poses))

    def _at(self, pose: Pose, name: str) -> Scene:
        moved = (
            replace(item, camera_from_object=pose) if item.name == self.posed else item
            for item in self.objects
        )
        return Scene(name, tuple(moved))
