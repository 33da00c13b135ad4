"""Section 4's route for single objects: three fringes, spatial unwrapping, one integer.

No order code is looked at. The integer comes from where the object is known to stand; what it costs
to be wrong by one is told, and the same pixels are held against Gray code.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fringeworks.experiments.held_rig import Still
from fringeworks.experiments.paper.chapter import Chapter, Row, Shown
from fringeworks.experiments.paper.lab import Lab
from fringeworks.geometry.forms import fit_cylinder
from fringeworks.model import Capture, Cloud, Fringe, ModelName, ProjectorMap, Rig, Uniform
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.regions import find_regions
from fringeworks.phase.window import Volume
from fringeworks.pipeline import cloud_of
from fringeworks.reconstruct.full import CloudRules
from fringeworks.report.canvas import Shade, map_figure
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Scene
from fringeworks.twin.scenes import cylinder_scene, hand_scene
from fringeworks.uncertainty.budget import make_budget
from fringeworks.uncertainty.contributions import Setting

STANDS_MM: Mapping[str, tuple[float, float]] = {"cylinder": (620.0, 715.0), "hand": (610.0, 700.0)}
"""What is known beforehand of where each single object is: depths, mm."""

ALL_DEPTHS = CloudRules(z_range_mm=(200.0, 5000.0))
SLIP_DEPTHS_MM = (600.0, 650.0, 700.0)


@dataclass(frozen=True, slots=True, eq=False)
class Routed:
    """A scene by the paper's route: its three fringes, what they say, and what Gray code says."""

    still: Still
    fringes: Capture
    projector_map: ProjectorMap

    def cloud(self, rig: Rig, model: ModelName) -> Cloud:
        """By one of the pipeline's models."""
        return cloud_of(self.fringes, self.projector_map, rig, model=model)


def route(lab: Lab, scene: Scene) -> Routed:
    """Decode a single object's capture without any order code."""
    still = lab.still(scene)
    fringes = only_fringes(still.capture)
    volume = Volume(lab.good_rig, STANDS_MM[scene.name])
    return Routed(still, fringes, decode_capture(fringes, orders="objects", volume=volume))


def only_fringes(capture: Capture) -> Capture:
    """The capture without its codes: fringes, white and black."""
    kept = [
        place
        for place, item in enumerate(capture.sequence.sets)
        if isinstance(item.pattern, Fringe | Uniform)
    ]
    sets = tuple(capture.sequence.sets[place] for place in kept)
    return replace(
        capture,
        sequence=replace(capture.sequence, sets=sets),
        frames=tuple(capture.frames[place] for place in kept),
    )


def slip(routed: Routed, rig: Rig, fringes: int) -> Cloud:
    """The cloud with every order wrong by so many fringes."""
    column = routed.projector_map.column
    assert column is not None, "the fringes run along x"
    assert column.phase is not None, "they are fringes"
    shift = np.float32(fringes * column.phase.fringe.period_px)
    moved = replace(column, coordinate=column.coordinate + shift)
    wrong = replace(routed.projector_map, column=moved)
    return cloud_of(routed.fringes, wrong, rig, rules=ALL_DEPTHS)


def follow_route(lab: Lab) -> Chapter:
    """The single objects' phases against Gray code's, and what slips cost."""
    routed = {scene.name: route(lab, scene) for scene in (cylinder_scene(), hand_scene())}
    same = {name: _agreement(one) for name, one in routed.items()}
    cylinder, rig = routed["cylinder"], lab.good_rig
    right = cylinder.cloud(rig, "full")
    slips = {step: _describe_slip(slip(cylinder, rig, step), right) for step in (-1, 1)}
    (fringe, *_), *_ = cylinder.fringes.find(Fringe)
    depth = make_budget(Setting(rig, (fringe,), Effects()), SLIP_DEPTHS_MM).fringe_mm
    words = (
        "A single object needs no code: its fringes are unwrapped from pixel to pixel, and one "
        "whole number puts it where it is known to stand. That number has to be right: a fringe "
        "too many or too few moves the whole object, and changes its size."
    )
    rows = [
        Row(f"{name}: pixels as by Gray code", "", f"{share:.2%} of {count}")
        for name, (share, count) in same.items()
    ]
    at = ", ".join(f"{z:.0f}" for z in SLIP_DEPTHS_MM)
    rows.append(Row(f"depth of a fringe at {at} mm, mm", "", ", ".join(f"{d:.1f}" for d in depth)))
    rows += [
        Row(
            f"order {step:+d}: the cylinder moves by, mm",
            "",
            f"{found['least']:.1f} to {found['most']:.1f}",
            f"and has a radius of {found['radius']:.2f} mm",
        )
        for step, found in slips.items()
    ]
    return Chapter(
        heading="Single objects without a code: section 4",
        words=words,
        rows=rows,
        pictures=(_draw_relative(routed["hand"]),),
        numbers={
            "same_as_gray": {name: share for name, (share, _) in same.items()},
            "slips": {str(step): found for step, found in slips.items()},
            "fringe_mm": dict(zip(map(str, SLIP_DEPTHS_MM), depth.tolist(), strict=True)),
        },
    )


def _draw_relative(routed: Routed) -> Shown:
    column = routed.projector_map.column
    assert column is not None, "the fringes run along x"
    assert column.phase is not None, "they are fringes"
    figure = map_figure(
        find_regions(column.phase.wrapped).phase,
        Shade("relative phase, rad"),
        "the hand's three fringes, unwrapped from pixel to pixel",
    )
    return Shown("route_hand", figure, "The hand's phase, before its whole number is added.")


def _agreement(routed: Routed) -> tuple[float, int]:
    """Share of the pixels that both have whose coordinate is the same, and their number."""
    gray, found = routed.still.projector_map.column, routed.projector_map.column
    assert gray is not None, "Gray code runs along x"
    assert found is not None, "the fringes run along x"
    both = np.isfinite(gray.coordinate) & np.isfinite(found.coordinate)
    same = np.abs(gray.coordinate - found.coordinate)[both] < 1e-3
    return float(same.mean()), int(both.sum())


def _describe_slip(wrong: Cloud, right: Cloud) -> dict[str, float]:
    moved = np.abs(wrong.xyz[..., 2] - right.xyz[..., 2])
    least, most = np.nanpercentile(moved, (2.5, 97.5))
    return {
        "least": float(least),
        "most": float(most),
        "radius": fit_cylinder(wrong.points()).radius_mm,
    }
