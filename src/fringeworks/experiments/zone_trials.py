"""Things in, beside and before a zone, one simulated scan each: is the alarm right.

A camera and a projector look at a wall two metres away, and a zone ends ten millimetres before it.
The thing is a ball or a cube, of any turn and any albedo from 0.2 to 0.8.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.zones import Zone, ZoneRules, ZoneView, look_at_zone, measure_zone
from fringeworks.model import Camera, Lens, Pose, Projector, Rig, Sequence
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import scan
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Box, Material, Object, Plane, Scene, Sphere
from fringeworks.twin.simulate import simulate

Place: TypeAlias = Literal["inside", "outside", "empty"]
Array: TypeAlias = NDArray[np.float64]

WALL_MM, GAP_MM = 2010.0, 10.0
ZONE = Zone("zone", ((-200.0, 200.0), (-150.0, 150.0), (1000.0, WALL_MM - GAP_MM)))
ALBEDOS = (0.2, 0.8)
BASELINE_MM, AIM_MM = 250.0, 1500.0
STEPS, PERIOD_PX = 4, 16.0
DEPTHS_MM = (900.0, 2100.0)


@dataclass(frozen=True, slots=True)
class ZoneTrial:
    """What a scan said of the zone.

    Attributes
    ----------
    place
        Where the thing was: inside, outside by `GAP_MM` at least, or nowhere.
    size_mm
        Diameter or edge; 0 for an empty scene.
    depth_mm, albedo
        Of its middle, and how bright it is; NaN for an empty scene.
    points, needed_points, alarm
        See `measure.zones.Occupation`.
    """

    place: Place
    size_mm: float
    depth_mm: float
    albedo: float
    points: int
    needed_points: int
    alarm: bool


@dataclass(frozen=True, slots=True, eq=False)
class Workplace:
    """A rig, its patterns, what its light does, and how its camera sees the zone."""

    rig: Rig
    sequence: Sequence
    effects: Effects
    view: ZoneView


def make_workplace(pixel_step: int = 1) -> Workplace:
    """The part of a camera's image that sees the zone; every n-th of its pixels if told."""
    n = pixel_step
    camera = Camera(460 // n, 350 // n, Lens(1100 / n, 1100 / n, 229.5 / n, 174.5 / n))
    projector = Projector(608, 684, Lens(900.0, 900.0, 303.5, 341.5))
    turn = rotation_matrix(np.array([0.0, -np.arctan2(BASELINE_MM, AIM_MM), 0.0]))
    centre = np.array([BASELINE_MM, 0.0, 0.0])
    rig = Rig(camera, projector, Pose(turn.T, -turn.T @ centre), volume_mm=DEPTHS_MM)
    sequence = make_sequence(
        "measure",
        width=projector.width,
        height=projector.height,
        axes=("x",),
        steps=STEPS,
        periods_px=(PERIOD_PX,),
    )
    effects = Effects()
    light = replace(effects.projector, light_per_ms=0.045, focus_mm=AIM_MM)
    effects = replace(effects, projector=light)
    return Workplace(rig, sequence, effects, look_at_zone(ZONE, camera))


def run_trial(
    workplace: Workplace, place: Place, size_mm: float, *, rng: np.random.Generator
) -> ZoneTrial:
    """One scan with a thing of this size somewhere inside, somewhere outside, or without it."""
    things: tuple[Object, ...] = ()
    depth_mm = albedo = np.nan
    if place != "empty":
        thing = _thing(place, size_mm, rng)
        things, albedo = (thing,), thing.material.albedo
        depth_mm = float(thing.camera_from_object.translation_mm[2])
    wall = Object("wall", Plane(), Pose(np.eye(3), np.array([0.0, 0.0, WALL_MM])))
    made = simulate(
        Scene(place, (wall, *things)),
        workplace.rig,
        workplace.sequence,
        effects=workplace.effects,
        rng=rng,
    )
    found = measure_zone(scan(made.capture, workplace.rig), workplace.view, ZoneRules())
    size_mm = size_mm if things else 0.0
    said = (found.points, found.needed_points, found.alarm)
    return ZoneTrial(place, size_mm, depth_mm, albedo, *said)


def _thing(place: Place, size_mm: float, rng: np.random.Generator) -> Object:
    low, high = np.array(ZONE.box_mm).T
    reach = np.sqrt(3) / 2 * size_mm  # of a cube's corners
    position = rng.uniform(low + reach, high - reach)
    if place == "outside":
        position = _beside(position, reach + GAP_MM, rng)
    shape = Sphere(size_mm / 2) if rng.random() < 0.5 else Box((size_mm, size_mm, size_mm))
    turn = rotation_matrix(rng.uniform(-np.pi, np.pi, 3))
    return Object("thing", shape, Pose(turn, position), Material(rng.uniform(*ALBEDOS)))


def _beside(position: Array, distance_mm: float, rng: np.random.Generator) -> Array:
    """The position moved out through a side, or through the face towards the camera."""
    faces = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0)]
    axis, end = faces[rng.integers(len(faces))]
    moved = position.copy()
    moved[axis] = ZONE.box_mm[axis][end] + (2 * end - 1) * distance_mm
    return moved
