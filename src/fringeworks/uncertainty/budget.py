"""The error budget: what of a depth's standard deviation comes from where, over depth.

The classes are those of the paper's section 3.1 and figure 2: the computed model, the parameters
of the calibration, the phase map. Each source alone is carried to z by first derivatives, at points
of a wall across the camera's axis, and is the root mean square over those that are lit. The
parameters are correlated, and strongly: their sum in quadrature says little, so their joint effect
by the whole covariance stands beside them and is what counts. `sample_budget` needs no derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.covariance import Covariance
from fringeworks.calibrate.adjust.state import SHARED, RigState
from fringeworks.calibrate.judge.uncertainty import (
    rigid_motions,
    shared_covariance,
    state_of,
    triangulate_points,
    variances,
    without_motion,
)
from fringeworks.errors import UsageError
from fringeworks.model import AXES, Fringe
from fringeworks.model import Sequence as Patterns
from fringeworks.reconstruct.table import make_table
from fringeworks.uncertainty.contributions import DISTORTION, Kind, Setting, Wall, contributions
from fringeworks.uncertainty.phase_noise import phase_variances

Array = NDArray[np.float64]

KINDS: tuple[Kind, ...] = get_args(Kind)
SAMPLES = 1000
SAMPLED_POINTS = 24


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """One source of uncertainty.

    Attributes
    ----------
    kind
        The paper's class.
    name
        What it is.
    sigma_mm
        ``(depths,)``: standard deviation of z that it alone makes, over the wall.
    counts
        Whether its class takes it into account: a model that is not used costs nothing.
    """

    kind: Kind
    name: str
    sigma_mm: Array
    counts: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Budget:
    """Sources and totals over depth; all ``(depths,)``, mm unless said.

    Attributes
    ----------
    depths_mm
        Where they hold.
    sources
        Each alone.
    parameters_mm, aligned_mm
        All parameters together, by their covariance: as it stands, and after the one rigid motion
        of all depths that fits best. None where the rig keeps no covariance.
    scale_mm
        What the scale of the board alone makes; None where nobody knows it.
    lit_share
        Of the camera's image.
    camera_px_mm, fringe_mm
        Width of a camera pixel; the depth of one fringe, which a wrong order is wrong by.
    """

    depths_mm: Array
    sources: tuple[Source, ...]
    parameters_mm: Array | None
    aligned_mm: Array | None
    scale_mm: Array | None
    lit_share: Array
    camera_px_mm: Array
    fringe_mm: Array

    def of_kind(self, kind: Kind) -> Array:
        """A class together: parameters by their covariance and the scale, others in quadrature."""
        if kind == "parameters":
            parts = [part for part in (self.parameters_mm, self.scale_mm) if part is not None]
        else:
            parts = [one.sigma_mm for one in self.sources if one.kind == kind and one.counts]
        return _quadrature([np.zeros_like(self.depths_mm), *parts])

    @property
    def total_mm(self) -> Array:
        """The three classes in quadrature."""
        return _quadrature([self.of_kind(kind) for kind in KINDS])


def finest_fringes(sequence: Patterns) -> tuple[Fringe, ...]:
    """Of each coded axis, the fringes of the shortest period; UsageError where there are none."""
    found = [item.pattern for item in sequence.sets if isinstance(item.pattern, Fringe)]
    by_axis = [[fringe for fringe in found if fringe.axis == axis] for axis in AXES]
    if not found:
        raise UsageError("a budget needs fringes, got a sequence without any")
    return tuple(min(some, key=lambda fringe: fringe.period_px) for some in by_axis if some)


def make_budget(setting: Setting, depths_mm: Sequence[float]) -> Budget:
    """Sources over these depths, mm.

    Raises
    ------
    UsageError
        The projector lights nothing of a wall at one of them.
    FormatError
        The rig's covariance is damaged.
    """
    walls = [Wall.at(setting, depth) for depth in depths_mm]
    found = [contributions(setting, wall) for wall in walls]
    sources = [
        Source(*name, np.array([one[name] for one in found]), counts=_counts(setting, name))
        for name in found[0]
    ]
    sources.insert(1, _table_source(setting, depths_mm))
    depths, scale, covariance = (
        np.array(depths_mm, float),
        setting.rig.scale_sigma,
        setting.covariance,
    )
    joint = (None, None) if covariance is None else _joint(setting, walls, covariance)
    return Budget(
        depths_mm=depths,
        sources=tuple(sources),
        parameters_mm=joint[0],
        aligned_mm=joint[1],
        scale_mm=None if scale is None else scale * depths,
        lit_share=np.array([wall.lit_share for wall in walls]),
        camera_px_mm=depths / setting.rig.camera.lens.fx,
        fringe_mm=np.array([wall.fringe_mm for wall in walls]),
    )


def sample_budget(
    setting: Setting, depths_mm: Sequence[float], *, rng: np.random.Generator
) -> Mapping[Kind, Array]:
    """The same by Monte Carlo, ``(depths,)`` mm: draws that the full model triangulates.

    Per wall `SAMPLES` draws at some of its points: parameters by their covariance (zero where the
    rig keeps none), and camera noise on the phase.
    """
    rows: list[tuple[float, float]] = []
    for depth in depths_mm:
        wall = Wall.at(setting, depth)
        rows.append((_sample_parameters(setting, wall, rng), _sample_phase(setting, wall, rng)))
    parameters, phase = np.array(rows).T
    return {"parameters": parameters, "phase": phase}


def draw_states(
    covariance: Covariance, middle: RigState, *, count: int, rng: np.random.Generator
) -> list[RigState]:
    """Rigs as the covariance has them about `middle`."""
    values, vectors = np.linalg.eigh(shared_covariance(covariance))
    spread = vectors * np.sqrt(np.maximum(values, 0))
    drawn = rng.normal(size=(count, SHARED)) @ spread.T
    return [RigState.from_vector(middle.vector + one) for one in drawn]


def _table_source(setting: Setting, depths_mm: Sequence[float]) -> Source:
    """The largest error of the table that `scan` uses where it holds: a bound, not a deviation."""
    axis = setting.fringes[0].axis if len(setting.fringes) == 1 else None
    near, far = min(depths_mm), max(depths_mm)
    table = make_table(setting.rig, axis, (near, max(far, 1.01 * near)))
    bound = table.bound_mm if table.holds else 0.0
    name = "table in place of the full model, its bound"
    return Source("model", name, np.full(len(depths_mm), bound), counts=not setting.geometric)


def _counts(setting: Setting, name: tuple[Kind, str]) -> bool:
    return setting.geometric or name != DISTORTION


def _quadrature(parts: Sequence[Array]) -> Array:
    return np.asarray(np.sqrt(np.sum(np.square(parts), axis=0)))


def _joint(setting: Setting, walls: Sequence[Wall], covariance: Covariance) -> tuple[Array, Array]:
    """Per wall what all parameters make of its depth, and the same aligned."""
    shared = shared_covariance(covariance)
    by = np.concatenate([wall.depth_by_parameters(setting) for wall in walls])
    points = np.concatenate([wall.seen.points for wall in walls])
    aligned = without_motion(by, rigid_motions(points))
    ends = np.cumsum([len(wall.seen.points) for wall in walls])[:-1]
    both = (
        np.array([part.mean() for part in np.split(variances(one[:, 2:], shared)[:, 0], ends)])
        for one in (by, aligned)
    )
    stands, fitted = (np.sqrt(mean) for mean in both)
    return stands, fitted


def _some(wall: Wall, rng: np.random.Generator) -> NDArray[np.intp]:
    count = len(wall.seen.points)
    return rng.permutation(count)[:SAMPLED_POINTS]


def _sample_parameters(setting: Setting, wall: Wall, rng: np.random.Generator) -> float:
    covariance = setting.covariance
    if covariance is None:
        return 0.0
    some = _some(wall, rng)
    camera, projector = wall.seen.camera_px[some], wall.seen.projector_px[some]
    states = draw_states(covariance, state_of(setting.rig), count=SAMPLES, rng=rng)
    found = [triangulate_points(one, camera, projector, weights=wall.weights) for one in states]
    error = np.array(found)[..., 2] - wall.seen.points[some, 2]
    return float(np.sqrt(np.mean(error**2)))


def _sample_phase(setting: Setting, wall: Wall, rng: np.random.Generator) -> float:
    some, state = _some(wall, rng), state_of(setting.rig)
    errors = []
    for _ in range(SAMPLES):
        seen = wall.seen.projector_px[some].copy()
        for one in wall.fringes:
            variance = np.sum(list(phase_variances(one, setting.effects).values()), axis=0)
            px = np.sqrt(variance[some]) * one.fringe.period_px / (2 * np.pi)
            seen[:, AXES.index(one.fringe.axis)] += rng.normal(0, px)
        points = triangulate_points(state, wall.seen.camera_px[some], seen, weights=wall.weights)
        errors.append(points[:, 2] - wall.seen.points[some, 2])
    return float(np.sqrt(np.mean(np.square(errors))))
