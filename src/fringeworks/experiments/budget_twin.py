"""The random part of an error budget from images: the twin's walls with and without noise."""

from __future__ import annotations

from collections.abc import Sequence as Depths

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Cloud, Pose, Rig, Sequence
from fringeworks.pipeline import scan
from fringeworks.reconstruct.full import CloudRules
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Material, Object, Plane, Scene
from fringeworks.twin.simulate import simulate
from fringeworks.uncertainty.phase_noise import ALBEDO, shorten_exposure
from fringeworks.uncertainty.seen import wall_at

Array = NDArray[np.float64]

KEPT = 0.2
"""Share of the depth that is kept about a wall."""


def sample_images(
    rig: Rig,
    sequence: Sequence,
    depths_mm: Depths[float],
    *,
    effects: Effects,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Observed and predicted sigma of the depth of walls, mm, ``(depths,)``: root mean squares.

    The observed one is of the differences between a scan and the same scan without noise, the
    predicted one what the noisy cloud says of itself.
    """
    rows = []
    for depth in depths_mm:
        wall, _ = wall_at(rig, depth)
        lit = shorten_exposure(rig, wall, effects)
        rules = CloudRules(z_range_mm=((1 - KEPT) * depth, (1 + KEPT) * depth))
        noisy, quiet = (
            _scan_wall(rig, sequence, depth, effects=one, rng=rng, rules=rules)
            for one in (lit, lit.without_noise())
        )
        both = noisy.valid & quiet.valid
        difference = (noisy.xyz - quiet.xyz)[both, 2].astype(np.float64)
        predicted = noisy.sigma_mm[both].astype(np.float64)
        rows.append([np.sqrt(np.mean(np.square(one))) for one in (difference, predicted)])
    observed, predicted = np.array(rows).T
    return observed, predicted


def _scan_wall(
    rig: Rig,
    sequence: Sequence,
    depth_mm: float,
    *,
    effects: Effects,
    rng: np.random.Generator,
    rules: CloudRules,
) -> Cloud:
    pose = Pose(np.eye(3), np.array([0.0, 0.0, depth_mm]))
    scene = Scene("wall", (Object("wall", Plane(), pose, Material(ALBEDO)),))
    made = simulate(scene, rig, sequence, effects=effects, rng=rng)
    return scan(made.capture, rig, cloud_rules=rules)
