"""Views of one thing put together: by surfaces, by targets, by a turntable."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.geometry.pose import compose_poses, rotation_matrix, rotation_vector
from fringeworks.measure.merging import merge_clouds, register_targets, scan_views
from fringeworks.measure.registration import align_coarsely, register_views
from fringeworks.model import Cloud, Pose
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import scan
from fringeworks.twin.scenes import paper_rig
from fringeworks.twin.simulate import simulate
from tests.measure.seen import MIDDLE_MM, balls_scene, off_balls

TURNS = range(0, 360, 60)
BAR_MM = 0.05


@pytest.fixture(scope="module")
def views() -> list[tuple[Cloud, Pose]]:
    """Six captures of the balls, simulated with noise and scanned; ``thing_from_camera``."""
    rig = paper_rig()
    sequence = make_sequence("measure", width=608, height=684)
    found = []
    for turn in TURNS:
        scene, camera_from_thing = balls_scene(turn)
        capture = simulate(scene, rig, sequence, rng=np.random.default_rng(turn)).capture
        found.append((scan(capture, rig), camera_from_thing.inverse()))
    return found


def nudged(pose: Pose, rng: np.random.Generator) -> Pose:
    """Turned by a degree or so about the thing's middle, and moved by 0.7 mm an axis."""
    turn = rotation_matrix(rng.normal(0, 0.02, 3))
    shift = MIDDLE_MM - turn @ MIDDLE_MM + rng.normal(0, 0.7, 3)
    return Pose(*compose_poses((turn, shift), (pose.rotation, pose.translation_mm)))


def test_six_views_of_a_known_thing(views: list[tuple[Cloud, Pose]]) -> None:
    """The bar: 0.05 mm, for where each view is put and for the mean of its points."""
    clouds = [cloud for cloud, _ in views]
    first = views[0][1].inverse()
    truth = [
        Pose(*compose_poses((first.rotation, first.translation_mm), (p.rotation, p.translation_mm)))
        for _, p in views
    ]
    rng = np.random.default_rng(6)
    starts = [truth[0], *(nudged(pose, rng) for pose in truth[1:])]
    found = register_views(scan_views(clouds), starts)
    assert found.loose == 0
    merged = merge_clouds(clouds, found.poses, frame="camera")
    assert merged.xyz.shape == (1, sum(int(cloud.valid.sum()) for cloud in clouds), 3)
    for cloud, pose, true in zip(clouds, found.poses, truth, strict=True):
        points = cloud.points()
        off = np.linalg.norm(pose.apply(points) - true.apply(points), axis=1)
        assert off.max() <= BAR_MM
        assert abs(off_balls(views[0][1].apply(pose.apply(points))).mean()) <= BAR_MM / 2
    away = starts[1].apply(clouds[1].points()) - truth[1].apply(clouds[1].points())
    assert np.linalg.norm(away, axis=1).max() > 20 * BAR_MM  # what there was to find


def test_views_that_do_not_meet(views: list[tuple[Cloud, Pose]]) -> None:
    parts = scan_views([views[0][0], views[1][0]])
    far = Pose(np.eye(3), np.array([500.0, 0, 0]))
    with pytest.raises(MeasurementError, match="the views do not overlap, or start too far"):
        register_views(parts, [Pose.identity(), far])


TARGETS = {
    name: np.array(place) for name, place in zip("ABCDE", np.eye(5, 3) * 80 + 600, strict=True)
}


def seen_targets(
    rng: np.random.Generator, sd: float
) -> tuple[list[dict[str, NDArray[np.float64]]], list[Pose]]:
    """Three views of some of the targets each, and their true poses."""
    poses = [Pose.identity()]
    poses += [Pose(rotation_matrix(rng.normal(0, 1, 3)), rng.normal(0, 50, 3)) for _ in range(2)]
    names = ("ABCD", "BCDE", "ACDE")
    views = [
        {name: pose.inverse().apply(TARGETS[name]) + rng.normal(0, sd, 3) for name in seen}
        for seen, pose in zip(names, poses, strict=True)
    ]
    return views, poses


def test_targets_put_views_together() -> None:
    views, poses = seen_targets(np.random.default_rng(1), 0.0)
    found, left = register_targets(views)
    assert left.max() < 1e-9
    for pose, true in zip(found, poses, strict=True):
        np.testing.assert_allclose(pose.rotation, true.rotation, atol=1e-12)
        np.testing.assert_allclose(pose.translation_mm, true.translation_mm, atol=1e-9)


def test_noise_of_targets_is_left_over() -> None:
    """Of 12 sightings with 3 coordinates, 5 places and 2 poses take 27: 9 are left."""
    rng = np.random.default_rng(2)
    left = [register_targets(seen_targets(rng, 0.02)[0])[1] for _ in range(100)]
    squares = np.array([np.sum(one**2) for one in left])
    assert np.mean(squares) == pytest.approx(9 * 0.02**2, rel=5 * np.sqrt(2 / 9 / 100))


def test_targets_are_least_squares() -> None:
    """As a general solver has it, with all places and poses free at once."""
    from scipy.optimize import least_squares

    views, _ = seen_targets(np.random.default_rng(3), 0.5)
    poses, left = register_targets(views)
    places = {
        name: np.mean([p.apply(v[name]) for v, p in zip(views, poses, strict=True) if name in v], 0)
        for name in TARGETS
    }

    def misses(values: NDArray[np.float64]) -> NDArray[np.float64]:
        moved = [Pose.identity()]
        moved += [Pose(rotation_matrix(v[:3]), v[3:]) for v in values[:12].reshape(2, 6)]
        at = dict(zip(TARGETS, values[12:].reshape(5, 3), strict=True))
        return np.concatenate(
            [p.apply(v[name]) - at[name] for v, p in zip(views, moved, strict=True) for name in v]
        )

    start = [np.concatenate([rotation_vector(p.rotation), p.translation_mm]) for p in poses[1:]]
    best = least_squares(misses, np.concatenate([*start, *(places[name] for name in TARGETS)]))
    assert np.sum(left**2) == pytest.approx(2 * best.cost, rel=1e-6)


def test_too_few_targets() -> None:
    views, _ = seen_targets(np.random.default_rng(1), 0.0)
    views[1] = {"A": views[0]["A"], "E": views[1]["E"]}
    with pytest.raises(MeasurementError, match="view 2 shares 1 targets with those before it"):
        register_targets(views)


def test_coarse_alignment_far_from_the_origin() -> None:
    """Of a thing of 30 mm, whose coordinates are a building's: as about the origin."""
    pytest.importorskip("small_gicp")
    y, x = np.mgrid[:40, :50] * 0.6
    target = np.stack([x, y, 3 * np.sin(x / 3) + 2 * np.cos(y / 4)], axis=-1).reshape(-1, 3)
    for far in (0.0, 1e7):
        moved = target + far + [0.3, 0.1, 0.2]
        pose = align_coarsely(moved, target + far)
        np.testing.assert_allclose(pose.apply(moved), target + far, rtol=0, atol=0.02)
    with pytest.raises(MeasurementError, match="does not come near the reference"):
        align_coarsely(target + 1e7, target)
