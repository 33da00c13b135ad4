"""Section 4.5 and figure 10: a random-dot sensor after the paper's Kinect, by the same measures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np

from fringeworks.experiments.held_rig import Still
from fringeworks.experiments.paper.chapter import Chapter, Row, Shown
from fringeworks.experiments.paper.correlate import STEP_PX, WINDOW_PX, read_speckle
from fringeworks.experiments.paper.lab import Lab
from fringeworks.experiments.paper.route import route
from fringeworks.experiments.paper.sampling import mean_over_squares
from fringeworks.experiments.truth import inner_pixels
from fringeworks.geometry.forms import CylinderFit, fit_plane
from fringeworks.model import Cloud
from fringeworks.pipeline import cloud_of
from fringeworks.report.reproduction import draw_tinted
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Scene
from fringeworks.twin.scenes import CYLINDER_RADIUS_MM, cylinder_scene, hand_scene
from fringeworks.twin.speckle import SpeckleSensor, facing_plane, see_speckle
from fringeworks.twin.truth import Truth

DISTANCE_MM = 650.0
DEPTH = "depth z, mm"


@dataclass(frozen=True, slots=True)
class Measured:
    """Plane rms, and the cylinder's radius and form rms, mm."""

    plane_rms_mm: float
    radius_mm: float
    form_rms_mm: float

    @classmethod
    def of(cls, plane_rms_mm: float, cylinder: CylinderFit) -> Measured:
        return cls(plane_rms_mm, cylinder.radius_mm, cylinder.form_rms_mm)


def compare_kinect(lab: Lab) -> Chapter:
    """A plane at 650 mm, the cylinder and the hand by both sensors."""
    sensor = SpeckleSensor()
    (flat, truth), (round_one, _), (hand, _) = _look(lab, sensor)
    scans = {
        scene.name: route(lab, scene).cloud(lab.good_rig, "full")
        for scene in (cylinder_scene(), hand_scene())
    }
    plane, seen = _our_plane(lab)
    theirs = Measured.of(_plane_rms(flat, truth), lab.fit_cylinder(round_one))
    ours = Measured.of(_plane_rms(plane, seen), lab.fit_cylinder(scans["cylinder"]))
    window = WINDOW_PX * DISTANCE_MM / sensor.rig.camera.lens.fx
    smooth = _smooth(plane, round(window * lab.true_rig.camera.lens.fx / DISTANCE_MM))
    smooth_rms = _plane_rms(smooth, seen)
    step = DISTANCE_MM**2 / (sensor.rig.camera.lens.fx * sensor.baseline_mm) * STEP_PX
    return Chapter(
        heading="Beside a speckle sensor: section 4.5, figure 10",
        words=(
            "An active random-dot sensor after what is known of the paper's Kinect: 640x480, a "
            f"baseline of {sensor.baseline_mm:g} mm, disparities in eighths of a pixel by "
            "correlating windows of 9x9 px with a reference plane, "
            f"{sensor.range_mm[0]:g} to {sensor.range_mm[1]:g} mm. At 650 mm one step of disparity "
            f'is {step:.2f} mm of depth. The paper says "much worse", by eye.'
        ),
        rows=_rows(theirs, ours, (window, smooth_rms)),
        pictures=_pictures({"cylinder": round_one, "hand": hand}, scans),
        clouds=((scans["hand"], "The hand by three fringes and no code."),),
        numbers={
            "speckle": asdict(theirs),
            "fringes": asdict(ours),
            "step_mm": step,
            "fringes_over_windows_mm": smooth_rms,
        },
    )


def _look(lab: Lab, sensor: SpeckleSensor) -> list[tuple[Cloud, Truth]]:
    """Plane, cylinder and hand by the speckle sensor."""
    scenes = (facing_plane(DISTANCE_MM), cylinder_scene(), hand_scene())
    rng = np.random.default_rng(0)
    plane = facing_plane(sensor.reference_mm)
    reference, _ = see_speckle(plane, sensor, sensor.reference_mm, rng=rng)

    def look(job: tuple[Scene, np.random.Generator]) -> tuple[Cloud, Truth]:
        frame, true = see_speckle(job[0], sensor, DISTANCE_MM, rng=job[1])
        return read_speckle(frame, reference, sensor), true

    jobs = list(zip(scenes, rng.spawn(len(scenes)), strict=True))
    return lab.spread(look, jobs, "speckle sensor")


def _rows(theirs: Measured, ours: Measured, smooth: tuple[float, float]) -> list[Row]:
    """`smooth` is the speckle's window, mm, and our plane's rms over such."""
    window, rms = smooth
    true = f"true {CYLINDER_RADIUS_MM:g}"
    return [
        Row("plane at 650 mm, rms, speckle, mm", "much worse", f"{theirs.plane_rms_mm:.3f}"),
        Row(
            "plane at 650 mm, rms, fringes, mm",
            "",
            f"{ours.plane_rms_mm:.3f}",
            "of every pixel of 0.33 mm, with three fringes",
        ),
        Row(
            f"the same over windows of {window:.0f} mm, as the speckle's are, mm",
            "",
            f"{rms:.4f}",
            f"{theirs.plane_rms_mm / rms:.0f} times better",
        ),
        Row("cylinder, radius, speckle, mm", "", f"{theirs.radius_mm:.2f}", true),
        Row("cylinder, radius, fringes, mm", "", f"{ours.radius_mm:.2f}", true),
        Row("cylinder, form rms, speckle, mm", "", f"{theirs.form_rms_mm:.3f}"),
        Row("cylinder, form rms, fringes, mm", "", f"{ours.form_rms_mm:.3f}"),
    ]


def _pictures(theirs: Mapping[str, Cloud], ours: Mapping[str, Cloud]) -> list[Shown]:
    speckle, fringes = (
        draw_tinted({f"{name}, {by}": cloud for name, cloud in clouds.items()}, 2, label=DEPTH)
        for by, clouds in (("speckle", theirs), ("fringes", ours))
    )
    return [
        Shown("figure_10_speckle", speckle, "Figure 10: cylinder and hand by the speckle sensor."),
        Shown("figure_09b_hand", fringes, "Figure 9b, beside it: the same by fringes."),
    ]


def _plane_rms(plane: Cloud, truth: Truth) -> float:
    inner = plane.valid & inner_pixels(truth)
    return fit_plane(plane.xyz[inner].astype(np.float64)).form_rms_mm


def _smooth(cloud: Cloud, size: int) -> Cloud:
    """Every point the mean of a square of so many pixels."""
    means = [mean_over_squares(cloud.xyz[..., axis], size) for axis in range(3)]
    return replace(cloud, xyz=np.stack(means, axis=-1))


def _our_plane(lab: Lab) -> tuple[Cloud, Truth]:
    still = Still.of(facing_plane(DISTANCE_MM), lab.true_rig, lab.patterns, effects=Effects())
    return cloud_of(still.capture, still.projector_map, lab.good_rig), still.truth
