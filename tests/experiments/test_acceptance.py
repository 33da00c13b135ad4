"""Plans carried out, on the twin and on clouds: where artefacts stand, what a wrong scale does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.errors import FormatError, MeasurementError
from fringeworks.experiments.acceptance import run_plan
from fringeworks.experiments.acceptance_twin import (
    ARTEFACTS,
    BALL_MM,
    BAR_MM,
    MIDDLE_MM,
    VOLUME_MM,
    place_artefacts,
)
from fringeworks.experiments.calibrations import half_rig
from fringeworks.files import write_capture, write_cloud, write_rig
from fringeworks.files.acceptance import Plan, Position
from fringeworks.measure.region import Region
from fringeworks.model import Cloud, Pose
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import scan
from fringeworks.twin.cast import Caster
from fringeworks.twin.effects import Effects
from fringeworks.twin.optics import optics_of
from fringeworks.twin.scene import Plane, Scene, Sphere
from fringeworks.twin.scenes import paper_rig
from fringeworks.twin.simulate import simulate
from fringeworks.twin.truth import find_truth
from tests.measure.artefacts import ball_points, cloud_of, flat_cloud


class TestPlaces:
    def test_ten_seven_and_six(self) -> None:
        placed = place_artefacts()
        kinds = [item.position.artefact for item in placed]
        assert [kinds.count(name) for name in ("ball", "bar", "flat")] == [10, 7, 6]
        assert len({item.position.name for item in placed}) == 23

    def test_all_within_the_volume_and_of_the_size_that_it_wants(self) -> None:
        """Balls of the bar may stand out of it: their centres count. Flats are planes: corners."""
        for item in place_artefacts():
            for thing in item.scene.objects:
                match thing.shape:
                    case Sphere(radius):
                        reach = np.full((1, 3), radius if item.position.artefact == "ball" else 0.0)
                    case Plane(width, height):
                        signs = np.array([(x, y, 0) for x in (-1, 1) for y in (-1, 1)])
                        corners = signs * (width / 2, height / 2, 0)
                        reach = np.abs(corners @ thing.camera_from_object.rotation.T)
                    case _:
                        pytest.fail("no artefact")
                off = np.abs(thing.camera_from_object.translation_mm - MIDDLE_MM) + reach
                assert (off <= np.array(VOLUME_MM) / 2 + 1e-9).all(), item.position.name
        diagonal = np.linalg.norm(VOLUME_MM)
        assert 0.1 * diagonal <= BALL_MM <= 0.2 * diagonal
        assert 0.3 * diagonal <= BAR_MM

    def test_all_are_seen_and_lit(self) -> None:
        """Whole, and but for a crescent that the projector does not reach."""
        optics = optics_of(half_rig(paper_rig()))
        for item in place_artefacts():
            truth = find_truth(Caster(item.scene), *optics)
            seen = truth.surface >= 0
            border = np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]])
            assert not border.any(), item.position.name
            assert np.isfinite(truth.column[seen]).mean() > 0.95, item.position.name


def test_a_scaled_rig_shows_in_size_and_spacing(tmp_path: Path) -> None:
    """A baseline 0.2 % too long makes all of space so: SD and PS differ by that share, F does not.

    The same noise-free captures are scanned with both rigs; masks, which decide by mm, may keep
    other pixels at the edges, and are worth less than a micrometre here.
    """
    true = half_rig(paper_rig())
    pose = true.projector_from_camera
    scaled = replace(true, projector_from_camera=Pose(pose.rotation, 1.002 * pose.translation_mm))
    wanted = ("ball 10", "bar 1", "flat 3")
    placed = [item for item in place_artefacts() if item.position.name in wanted]
    sequence = make_sequence("paper", width=true.projector.width, height=true.projector.height)
    rng = np.random.default_rng(0)
    found = []
    captures = [
        simulate(item.scene, true, sequence, effects=Effects().without_noise(), rng=rng).capture
        for item in placed
    ]
    for name, rig in (("true", true), ("scaled", scaled)):
        for item, capture in zip(placed, captures, strict=True):
            write_cloud(tmp_path / name / item.position.source, scan(capture, rig))
        plan = Plan("scaled", VOLUME_MM, ARTEFACTS, tuple(wide(item.position) for item in placed))
        found.append(run_plan(plan, tmp_path / name))
    right, wrong = found
    assert wrong.balls[0].ps_mm - right.balls[0].ps_mm == pytest.approx(0.002 * 40, abs=0.003)
    assert wrong.bars[0].sd_mm - right.bars[0].sd_mm == pytest.approx(0.002 * 100, abs=0.003)
    assert wrong.flats[0].f_mm == pytest.approx(right.flats[0].f_mm, rel=0.05)


def wide(position: Position) -> Position:
    """With boxes 4 mm wider: the scaled ball has moved by 1.4 mm."""
    boxes = [region.box_mm for region in position.regions]
    wider = [box and tuple((low - 4, high + 4) for low, high in box) for box in boxes]
    regions = tuple(Region(box_mm=box) for box in wider)  # type: ignore[arg-type]
    return replace(position, regions=regions)


def plan_of(*positions: Position) -> Plan:
    return Plan("a plan", (180.0, 130.0, 160.0), ARTEFACTS, positions, {"F": 1.0})


def flat(number: int, source: str, *, is_capture: bool = False) -> Position:
    return Position(f"flat {number}", "flat", source, is_capture, (Region(),))


class TestRunning:
    def test_clouds_of_any_format(self, tmp_path: Path) -> None:
        """A ball of 40.1 mm as points alone, a flat on its grid."""
        write_cloud(tmp_path / "ball.xyz", cloud_of(ball_points(2000, radius=20.05)))
        write_cloud(tmp_path / "sub" / "flat.npz", flat_cloud(np.zeros((60, 140))))
        ball = Position("ball 1", "ball", "ball.xyz", False, (Region(),))
        found = run_plan(plan_of(ball, flat(1, "sub/flat.npz")), tmp_path)
        assert found.balls[0].ps_mm == pytest.approx(0.1, abs=1e-3)
        assert found.flats[0].f_mm < 1e-3

    def test_a_position_without_result_is_missing(self, tmp_path: Path) -> None:
        write_cloud(tmp_path / "flat.npz", flat_cloud(np.zeros((60, 140))))
        nowhere = replace(
            flat(2, "flat.npz"), regions=(Region(pixels=((500.0, 600.0), (0.0, 9.0))),)
        )
        found = run_plan(plan_of(flat(1, "flat.npz"), nowhere), tmp_path)
        assert [one.name for one in found.flats] == ["flat 1"]
        assert "flat 2 gives no result: the region holds no point" in found.findings[0].message
        with pytest.raises(MeasurementError, match="no position gives a result; flat 2 gives"):
            run_plan(plan_of(nowhere), tmp_path)

    def test_data_stay_in_their_folder(self, tmp_path: Path) -> None:
        with pytest.raises(FormatError, match=r"cloud path '\.\./flat\.npz' leaves the plan's"):
            run_plan(plan_of(flat(1, "../flat.npz")), tmp_path)
        with pytest.raises(FormatError, match="no such file"):
            run_plan(plan_of(flat(1, "flat.npz")), tmp_path)

    def test_captures_need_a_rig_and_the_same_settings(self, tmp_path: Path) -> None:
        rig = half_rig(paper_rig())
        scene = next(item.scene for item in place_artefacts() if item.position.name == "flat 1")
        for name, preset in (("one", "paper"), ("two", "calibrate")):
            capture_into(tmp_path / name, scene, preset)
        plan = plan_of(*(flat(i, name, is_capture=True) for i, name in enumerate(("one", "two"))))
        with pytest.raises(FormatError, match="flat 0 is a capture, so the plan must name a rig"):
            run_plan(plan, tmp_path)
        write_rig(tmp_path / "own.json", rig)
        found = run_plan(replace(plan, rig="own.json"), tmp_path)
        assert [len(found.flats), len(found.findings)] == [2, 1]
        assert "two was taken with other settings" in found.findings[0].message
        again = run_plan(plan, tmp_path, rig=tmp_path / "own.json")
        assert again.flats[0].f_mm == found.flats[0].f_mm


def capture_into(folder: Path, scene: Scene, preset: str) -> None:
    rig = half_rig(paper_rig())
    size = {"width": rig.projector.width, "height": rig.projector.height}
    sequence = make_sequence(preset, **size)  # type: ignore[arg-type]
    made = simulate(scene, rig, sequence, rng=np.random.default_rng(1))
    write_capture(made.capture, folder)


def test_clouds_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two flats in one cloud."""
    reads = []

    def read(path: Path) -> Cloud:
        reads.append(path)
        return flat_cloud(np.zeros((60, 140)))

    monkeypatch.setattr("fringeworks.experiments.acceptance.read_cloud", read)
    half = Region(pixels=((0.0, 69.0), (0.0, 59.0)))
    run_plan(plan_of(flat(1, "a.npz"), replace(flat(2, "a.npz"), regions=(half,))), tmp_path)
    assert len(reads) == 1
