"""An active random-dot sensor, after the Kinect that the paper compares with (section 4.5).

One camera and one projector with parallel axes, side by side; the projector always shows the same
dots. What a scene shows is compared, by a reader that stands elsewhere, with what a plane facing
the sensor showed once, the reference: nearer, the dots move along the camera's rows. Sizes are
those that are known of the paper's: 640x480 px, 75 mm, 500 to 3500 mm, disparities in eighths.

The dots come from a laser and a diffractive element: sharp at every depth, as bright as need be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fringeworks.errors import UsageError
from fringeworks.model import (
    Camera,
    Frames,
    Lens,
    PatternSet,
    Pose,
    Projector,
    Rig,
    Sequence,
    Speckle,
)
from fringeworks.twin.effects import CameraEffects, Effects, ProjectorEffects
from fringeworks.twin.scene import Material, Object, Plane, Scene
from fringeworks.twin.simulate import simulate
from fringeworks.twin.truth import Truth

WIDTH, HEIGHT, FOCAL_PX = 640, 480, 580.0
FINER = 2
"""Projector px per camera px: dots have no place on the camera's grid."""

DOT_PX = 4.0
"""Of the projector; two of the camera, the least that a camera samples."""

EXTRA_PX = 160
"""How much wider than the camera's the projector's image is: the dots move by this much."""

BASELINE_MM = 75.0
RANGE_MM = (500.0, 3500.0)
REFERENCE_MM = 1000.0
WHITE_SHARE = 0.6
"""Of full scale that a lit white surface shows: such sensors set their own exposure."""


@dataclass(frozen=True, slots=True)
class SpeckleSensor:
    """The sensor.

    Attributes
    ----------
    baseline_mm
        Distance of projector and camera, the projector to the right.
    reference_mm
        Where the plane of the reference image stood.
    range_mm
        Depths that it measures.
    seed
        Of the dots.
    """

    baseline_mm: float = BASELINE_MM
    reference_mm: float = REFERENCE_MM
    range_mm: tuple[float, float] = RANGE_MM
    seed: int = 1

    @property
    def rig(self) -> Rig:
        """Camera and projector, without distortion."""
        camera = Camera(WIDTH, HEIGHT, _lens(WIDTH, HEIGHT, FOCAL_PX))
        width, height = FINER * (WIDTH + EXTRA_PX), FINER * HEIGHT
        projector = Projector(width, height, _lens(width, height, FINER * FOCAL_PX))
        beside = Pose(np.eye(3), np.array([-self.baseline_mm, 0.0, 0.0]))
        return Rig(camera, projector, beside, volume_mm=self.range_mm)

    @property
    def sequence(self) -> Sequence:
        """The one image that it projects."""
        projector = self.rig.projector
        return Sequence(
            projector.width, projector.height, (PatternSet(Speckle(self.seed, DOT_PX)),)
        )


def see_speckle(
    scene: Scene, sensor: SpeckleSensor, distance_mm: float, *, rng: np.random.Generator
) -> tuple[Frames, Truth]:
    """What the sensor takes of a scene, exposed for a distance: grey levels ``(480, 640)``.

    With what its camera's pixel centres see. The reference is a `facing_plane` at
    `SpeckleSensor.reference_mm`, taken so.

    Raises
    ------
    UsageError
        The distance is not in the sensor's range, or the scene cannot be simulated.
    """
    near, far = sensor.range_mm
    if not near <= distance_mm <= far:
        raise UsageError(f"distance_mm must be {near:g} to {far:g}, got {distance_mm:g}")
    effects = speckle_effects(distance_mm)
    made = simulate(scene, sensor.rig, sensor.sequence, effects=effects, rng=rng)
    return made.capture.frames[0][0], made.truth


def facing_plane(z_mm: float) -> Scene:
    """A plane across the camera's axis."""
    wall = Object("plane", Plane(), Pose(np.eye(3), np.array([0.0, 0.0, z_mm])), Material(0.8))
    return Scene("plane", (wall,))


def speckle_effects(distance_mm: float) -> Effects:
    """A cheap 8 bit camera, dots sharp at every depth, exposed for white at a distance."""
    projector = ProjectorEffects(
        bits=8, black_light=0.01, blur_px=0.5, focus_mm=distance_mm, defocus_px_m=0.0
    )
    camera = CameraEffects(read_noise_e=40.0, blur_px=0.6)
    lit = WHITE_SHARE / camera.exposure_ms
    return replace(Effects(camera, projector), projector=replace(projector, light_per_ms=lit))


def _lens(width: int, height: int, focal_px: float) -> Lens:
    return Lens(focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)
