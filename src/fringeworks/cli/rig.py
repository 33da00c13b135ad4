"""A rig's numbers, printed."""

from __future__ import annotations

from typing import Any

from fringeworks.cli.output import Output


def print_lens(output: Output, name: str, lens: dict[str, Any]) -> None:
    """One device's size and lens."""
    output.line(f"{name}: {lens['width']}x{lens['height']} px")
    distortion = " ".join(f"{key} {lens[key]:.4f}" for key in ("k1", "k2", "p1", "p2", "k3"))
    output.facts(
        [
            ("focal lengths", f"{lens['fx']:.2f} {lens['fy']:.2f} px"),
            ("principal point", f"{lens['cx']:.2f} {lens['cy']:.2f} px"),
            ("distortion", distortion),
        ]
    )


def print_pose(output: Output, summary: dict[str, Any]) -> None:
    """How the devices stand to each other, where the rig holds, how well its scale is known."""
    x, y, z = summary["translation_mm"]
    output.line("projector from camera")
    facts = [
        ("translation", f"{x:.2f} {y:.2f} {z:.2f} mm, baseline {summary['baseline_mm']:.2f} mm"),
        ("rotation", f"{summary['rotation_deg']:.3f} deg in all"),
    ]
    if summary["volume_mm"] is not None:
        near, far = summary["volume_mm"]
        facts.append(("volume", f"z = {near:.0f} to {far:.0f} mm, camera frame"))
    if summary["scale_sigma"] is None:
        scale = "uncertainty not known: measure the pitch (pitch_sigma_mm in board.toml)"
    else:
        scale = f"known to {summary['scale_sigma']:.1e} of every length, 1 sd, by the board's pitch"
    facts.append(("scale", scale))
    output.facts(facts)
