"""The working range that section 4.5 gives, 364 to 2169 mm: a wall at both ends, and in between.

The rig was calibrated at 540 to 780 mm: the ends are extrapolated to, as the paper's must be.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from fringeworks.experiments.held_rig import Still
from fringeworks.experiments.paper.chapter import Chapter, Grid, Row
from fringeworks.experiments.paper.lab import Lab
from fringeworks.experiments.truth import inner_pixels
from fringeworks.geometry.forms import PlaneFit, fit_plane
from fringeworks.model import Rig
from fringeworks.pipeline import cloud_of
from fringeworks.reconstruct.full import CloudRules
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Material, Object, Plane, Scene
from fringeworks.twin.scenes import place
from fringeworks.uncertainty.phase_noise import ALBEDO, shorten_exposure
from fringeworks.uncertainty.seen import wall_at, working_range

DEPTHS_MM, QUICK_DEPTHS_MM = (364.0, 650.0, 2169.0), (364.0, 2169.0)
FOCUS_MM = 650.0
HEAD = ("wall at", "points in", "plane rms", "without noise", "of the view", "depth off")
RIM_PX = 16.0
"""Of the projector's image that is left out at its sides: out of focus, light mixes with dark."""

KEPT = 0.2
"""Share of the depth that is kept about a wall."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A wall facing the camera, scanned.

    Attributes
    ----------
    lit
        Share of the image with points.
    rms_mm, quiet_rms_mm
        About the plane that fits best, with noise and without.
    off_mm
        Median error of the depth without noise.
    field_mm
        Width of the camera's view there.
    """

    depth_mm: float
    lit: float
    rms_mm: float
    quiet_rms_mm: float
    off_mm: float
    field_mm: float


def look_at_ends(lab: Lab) -> Chapter:
    """Walls at both ends and at the working distance."""
    depths = QUICK_DEPTHS_MM if lab.quick else DEPTHS_MM
    walls = lab.spread(partial(scan_wall, lab), depths, "walls")
    works = working_range(lab.true_rig)
    words = (
        "Far away the projector's light is spent on a larger area and the fringes are wider; near "
        "by the two images part; and both ends are out of focus, so that light mixes with dark at "
        f"the sides of the projector's image, of which {RIM_PX:g} px are left out. Walls facing "
        "the camera, scanned with the jointly calibrated rig, exposed as long as their distance "
        'asks for. "Of the view" is the rms without noise as a share of the width of the view.'
    )
    return Chapter(
        heading="Both ends of the working range: section 4.5",
        words=words,
        rows=(
            Row(
                "working range, mm",
                "364 to 2169",
                f"{works[0]:.0f} to {works[1]:.0f}",
                "where the projector lights 70 % of what it can of the camera's image",
            ),
        ),
        grids=(Grid("Walls by the full model, mm", HEAD, [_cells(wall) for wall in walls]),),
        numbers={"working_range_mm": list(works), "walls": [asdict(wall) for wall in walls]},
    )


def _cells(wall: Wall) -> tuple[str, ...]:
    return (
        f"{wall.depth_mm:.0f} mm",
        f"{wall.lit:.0%}",
        f"{wall.rms_mm:.3f}",
        f"{wall.quiet_rms_mm:.4f}",
        f"{wall.quiet_rms_mm / wall.field_mm:.1e}",
        f"{wall.off_mm:+.3f}",
    )


def scan_wall(lab: Lab, depth_mm: float) -> Wall:
    """Scan a wall across the camera's axis with noise and without."""
    effects = _exposed(lab.true_rig, depth_mm)
    wall = Object("wall", Plane(), place((0.0, 0.0, depth_mm)), Material(ALBEDO))
    scene = Scene("wall", (wall,))
    rules = CloudRules(z_range_mm=((1 - KEPT) * depth_mm, (1 + KEPT) * depth_mm))
    fits: list[PlaneFit] = []
    for one in (effects, effects.without_noise()):
        still = Still.of(scene, lab.true_rig, lab.patterns, effects=one)
        cloud = cloud_of(still.capture, still.projector_map, lab.good_rig, rules=rules)
        column = np.nan_to_num(still.truth.column, nan=-1.0)
        inside = (column > RIM_PX) & (column < lab.true_rig.projector.width - RIM_PX)
        inner = cloud.valid & inner_pixels(still.truth) & inside
        points = cloud.xyz[inner].astype(np.float64)
        fits.append(fit_plane(points))
    return Wall(
        depth_mm=depth_mm,
        lit=float(inner.mean()),
        rms_mm=fits[0].form_rms_mm,
        quiet_rms_mm=fits[1].form_rms_mm,
        off_mm=float(np.median(points[:, 2])) - depth_mm,
        field_mm=lab.true_rig.camera.width * depth_mm / lab.true_rig.camera.lens.fx,
    )


def _exposed(rig: Rig, depth_mm: float) -> Effects:
    """Exposed for the distance, but not beyond what the camera holds."""
    effects = Effects()
    longer = effects.camera.exposure_ms * (depth_mm / FOCUS_MM) ** 2
    lit, _ = wall_at(rig, depth_mm)
    exposed = replace(effects, camera=replace(effects.camera, exposure_ms=longer))
    return shorten_exposure(rig, lit, exposed)
