"""The paper's models: time per point beside the full one's, and their fit beside scipy's.

The paper promises "no computational burden" and "no iteration". All three take the camera's
distortion out of the ray; the full model iterates for the projector's besides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fringeworks.bench.metric import Metric
from fringeworks.bench.speed import QUICK_SECONDS, SECONDS, ratio_metric
from fringeworks.bench.timing import Work, one_thread, race
from fringeworks.calibrate.extended.fit import (
    PAPER_FREE,
    PRIORS,
    Mode,
    fit_extended,
)
from fringeworks.calibrate.extended.planes import PlanePoints
from fringeworks.errors import CalibrationError
from fringeworks.geometry.lens import project, unproject
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.kernels.paper_model import TURN, extended_ray, triangulate_by_phase, turned_ray
from fringeworks.kernels.triangulate import triangulate
from fringeworks.model import Extended, Rig
from fringeworks.reconstruct.geometric import equation_of
from fringeworks.twin.scenes import paper_rig

Array = NDArray[np.float64]

POINTS, QUICK_POINTS = 1_000_000, 20_000
PERIOD_PX, NOISE_MM = 32.0, 0.15
PLANES, SEED, SIGMA_PX = 14, 4, 0.07
TRUE = Extended("x", PERIOD_PX, C1=0.05, C2=0.08, Kphi=0.1, Ku0=3.0, Kfc=-2.0, Kz=0.1)
FIT_TURNS, MODEL_TURNS = (2, 3), (5, 60)
PRIOR_SIGMA = np.array([PRIORS[name] for name in Extended.NAMES])
LARGEST_APART = 1e-8
WINDOW_MM = (100.0, 3000.0)
TOLERANCE, DEFAULT_TOLERANCE = 1e-12, 1e-8
"""Where scipy stops: to look at the parameters, and by itself."""


@dataclass(frozen=True, slots=True, eq=False)
class PlainFit:
    """Equations 4 to 8 as anybody would write them with numpy and scipy; with priors for "map"."""

    points: PlanePoints
    rig: Rig
    mode: Mode

    def solve(self, jacobian: Literal["2-point", "cs"] = "2-point") -> Array:
        """The ten, by `scipy.optimize.least_squares`; "cs", complex steps, is exact and slow."""
        names = Extended.NAMES if self.mode == "map" else PAPER_FREE
        free = [Extended.NAMES.index(name) for name in names]

        def residuals(values: Array) -> Array:
            ten = np.zeros(len(Extended.NAMES), values.dtype)
            ten[free] = values
            return self.residuals(ten)

        tolerance = TOLERANCE if jacobian == "cs" else DEFAULT_TOLERANCE
        found = least_squares(
            residuals,
            np.zeros(len(free)),
            jac=jacobian,
            x_scale=PRIOR_SIGMA[free],
            ftol=tolerance,
            xtol=tolerance,
            gtol=tolerance,
        )
        ten = np.zeros(len(Extended.NAMES))
        ten[free] = found.x
        return ten

    def residuals(self, ten: Array) -> Array:
        """``(n + 10,)`` in standard deviations."""
        c1, c2, c3, c4, kfp, kphi, ku0, kv0, kfc, kz = ten
        camera, projector = self.rig.camera.lens, self.rig.projector.lens
        (r11, r12, r13), _, (r31, r32, r33) = self.rig.projector_from_camera.rotation
        tx, _, tz = -self.rig.projector_from_camera.translation_mm
        d1 = (self.points.rays[0] * camera.fx + ku0) / (camera.fx + kfc)
        d2 = (self.points.rays[1] * camera.fy + kv0) / (camera.fy + kfc)
        w = TURN / PERIOD_PX * (self.points.coordinate - projector.cx) + kphi
        f = TURN / PERIOD_PX * (projector.fx + kfp)
        up = f * (tx + c1) - w * (tz + c2)
        down = f * (r11 * d1 + r12 * d2 + r13 + c3) - w * (r31 * d1 + r32 * d2 + r33 + c4)
        off = (self.points.depth - up / down - kz) / NOISE_MM
        return off if self.mode == "paper" else np.concatenate([off, ten / PRIOR_SIGMA])


def measure_models(*, quick: bool = False) -> list[Metric]:
    """Times of the models and of the fit; of fewer points, in short turns, where `quick`."""
    with one_thread():
        times = _model_times(QUICK_SECONDS if quick else SECONDS)
        count = QUICK_POINTS if quick else POINTS
        return [*times, *(_fit_beside_scipy(count, mode) for mode in ("map", "paper"))]


def plane_points(rig: Rig, count: int, extended: Extended) -> PlanePoints:
    """Points on planes spread over the rig's volume, measured by exactly these parameters.

    No noise: scipy's two-point Jacobian errs by so much that with it the least sum of noisy
    squares would be elsewhere. With z less Kz known, ``F A - w B = z (F C - w D)`` gives w.
    """
    rng, equation = np.random.default_rng(SEED), equation_of(rig, extended)
    rays, depth, many = [], [], count // PLANES
    for z in np.linspace(560, 760, PLANES):
        normal = rotation_matrix(rng.uniform(-0.5, 0.5, 3))[:, 2]
        pixels = rng.uniform(0, (rig.camera.width - 1, rig.camera.height - 1), (many, 2))
        rays.append(unproject(pixels, rig.camera.lens.vector).T)
        depth.append(normal[2] * z / (normal[:2] @ rays[-1] + normal[2]))
    x, y = np.concatenate(rays, axis=1)
    z = np.concatenate(depth)
    c, d = turned_ray(*extended_ray(x, y, equation), equation)
    inner = z - equation.offset
    w = equation.focal * (equation.a - inner * c) / (equation.b - inner * d)
    coordinate = (w - equation.phase) / equation.per_px + equation.centre
    plane = np.repeat(np.arange(PLANES), many)
    return PlanePoints(np.stack([x, y]), coordinate, z, np.full_like(z, SIGMA_PX), plane)


def _fit_beside_scipy(count: int, mode: Mode) -> Metric:
    """Scipy's time over ours; both must come to the same ten."""
    rig = paper_rig()
    plain, few = (
        PlainFit(plane_points(rig, many, TRUE), rig, mode) for many in (count, QUICK_POINTS)
    )

    def ours(plain: PlainFit = plain) -> Array:
        return fit_extended(
            plain.points, rig, axis="x", period_px=PERIOD_PX, mode=mode, noise_mm=NOISE_MM
        ).extended.vector

    two_point, exact = _apart(ours(), plain.solve()), _apart(ours(few), few.solve("cs"))
    if exact > LARGEST_APART:
        raise CalibrationError(f"scipy gives other parameters: {exact:.3g} prior sigma apart")
    result = race(ours, plain.solve, seconds=0.0, turns=FIT_TURNS)
    what = f"{len(plain.points)} points, least_squares 2-point, bar >= 35 at 1e6"
    same = (
        f"prior sigma apart: {exact:.1g} from it with an exact Jacobian, bar <= 1e-8, "
        f"{two_point:.1g} with 2-point"
    )
    return ratio_metric(f"speed.extended_fit.{mode}_vs_scipy", result, "higher", what, same)


def _apart(one: Array, other: Array) -> float:
    return float(np.max(np.abs(one - other) / PRIOR_SIGMA))


def _model_times(seconds: float) -> list[Metric]:
    """Time per point of each, against the geometric one in turn."""
    rig = paper_rig()
    course = _Course.of(rig)
    geometric = course.paper(Extended("x", PERIOD_PX))
    metrics: list[Metric] = []
    for name, work in (
        ("extended", course.paper(TRUE)),
        ("full", course.full),
    ):
        result = race(geometric, work, seconds=seconds, turns=MODEL_TURNS)
        if not metrics:
            metrics.append(_time_per_point("geometric", result.ours, course.size))
        metrics.append(_time_per_point(name, result.theirs, course.size))
        note = "times as long as the geometric model"
        metrics.append(ratio_metric(f"speed.models.{name}_vs_geometric", result, "lower", note))
    return metrics


def _time_per_point(name: str, seconds: Array, size: int) -> Metric:
    nanoseconds = 1e9 * float(np.median(seconds)) / size
    note = f"best {1e9 * float(seconds.min()) / size:.3g}; one axis, ray undistorted, one thread"
    return Metric(f"speed.models.{name}_ns_per_point", nanoseconds, "ns", "lower", note)


@dataclass(frozen=True, slots=True, eq=False)
class _Course:
    """A plane's columns over the camera's whole image, and where the points go."""

    rig: Rig
    coordinates: NDArray[np.float32]
    sigmas: NDArray[np.float32]
    xyz: NDArray[np.float32]
    sigma: NDArray[np.float32]

    @classmethod
    def of(cls, rig: Rig) -> _Course:
        y, x = np.mgrid[: rig.camera.height, : rig.camera.width].astype(np.float64)
        rays = unproject(np.stack([x, y], axis=-1), rig.camera.lens.vector)
        points = np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1) * 660.0
        lit = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)
        coordinates = np.stack([lit[..., 0], np.zeros_like(x)]).astype(np.float32)
        sigmas = np.full_like(coordinates, 0.05)
        sigmas[1] = np.inf
        shape = coordinates.shape[1:]
        return cls(
            rig, coordinates, sigmas, np.empty((*shape, 3), np.float32), np.empty(shape, np.float32)
        )

    @property
    def size(self) -> int:
        return self.sigma.size

    def paper(self, extended: Extended) -> Work:
        """Points by the paper's model."""
        equation, lens = equation_of(self.rig, extended), self.rig.camera.lens.vector
        column, sigma = self.coordinates[0], self.sigmas[0]
        return lambda: triangulate_by_phase(
            column, sigma, lens, equation, WINDOW_MM, False, self.xyz, self.sigma
        )

    def full(self) -> None:
        """Points by the full model."""
        pose = self.rig.projector_from_camera
        triangulate(
            self.coordinates,
            self.sigmas,
            self.rig.camera.lens.vector,
            self.rig.projector.lens.vector,
            np.ascontiguousarray(pose.rotation),
            np.ascontiguousarray(pose.translation_mm),
            WINDOW_MM,
            self.xyz,
            self.sigma,
            np.empty_like(self.sigma),
        )
