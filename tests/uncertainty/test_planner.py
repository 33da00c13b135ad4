"""Plans are held against the budget of the rig that they say."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.errors import MeasurementError, UsageError
from fringeworks.geometry.lens import project
from fringeworks.twin.scenes import paper_rig
from fringeworks.uncertainty.planner import move_projector, plan

RANGE_MM = (550.0, 800.0)


def test_every_choice_keeps_what_was_asked() -> None:
    found = plan(paper_rig(), RANGE_MM, 0.1)
    assert len(found) > 3
    assert all(choice.worst_mm <= 0.1 for choice in found)
    assert all(min(choice.lit_share) >= 0.7 for choice in found)
    order = [(choice.steps, choice.baseline_mm) for choice in found]
    assert order == sorted(order)
    assert len({(choice.baseline_mm, choice.period_px) for choice in found}) == len(found)


def test_fewer_steps_would_not_do() -> None:
    """The next smaller N has a sigma larger by the root of their ratio."""
    steps = (3, 4, 6, 8, 12, 16)
    for choice in plan(paper_rig(), RANGE_MM, 0.1):
        place = steps.index(choice.steps)
        if place:
            assert choice.worst_mm * np.sqrt(choice.steps / steps[place - 1]) > 0.1


def test_sigma_falls_with_the_baseline_and_rises_with_the_square_of_depth() -> None:
    """``z z_p / (f b)``: at small angles by the baselines' ratio, light and blur being alike."""
    choices = {
        (round(choice.baseline_mm), choice.period_px): choice
        for choice in plan(paper_rig(), RANGE_MM, 10.0)
    }
    baselines = sorted({baseline for baseline, _ in choices})
    first, second = baselines[:2]
    ratio = choices[first, 16.0].worst_mm / choices[second, 16.0].worst_mm
    assert ratio == pytest.approx(second / first, rel=0.1)


def test_a_moved_projector_looks_at_its_aim() -> None:
    moved = move_projector(paper_rig(), 250.0, 700.0)
    assert moved.baseline_mm == pytest.approx(250.0)
    aim = moved.projector_from_camera.apply(np.array([[0.0, 0.0, 700.0]]))
    assert project(aim, moved.projector.lens.vector)[0] == pytest.approx([303.5, 341.5], abs=1e-6)
    before = paper_rig().projector_from_camera.inverse().translation_mm
    after = moved.projector_from_camera.inverse().translation_mm
    assert np.cross(before, after) == pytest.approx(np.zeros(3), abs=1e-6)


def test_what_cannot_be_reached_says_what_can() -> None:
    with pytest.raises(
        MeasurementError, match=r"no choice reaches 0\.001 mm .* the nearest is 0\.0"
    ):
        plan(paper_rig(), RANGE_MM, 0.001)
    with pytest.raises(MeasurementError, match="no baseline lights 70%"):
        plan(paper_rig(), (100.0, 8000.0), 1.0)


@pytest.mark.parametrize(
    ("z_range", "sigma", "message"),
    [
        ((800.0, 550.0), 0.1, "the range must rise"),
        ((0.0, 550.0), 0.1, "the range must rise from above 0"),
        (RANGE_MM, 0.0, "sigma must be above 0 mm, got 0"),
    ],
)
def test_wishes_that_make_no_sense(
    z_range: tuple[float, float], sigma: float, message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        plan(paper_rig(), z_range, sigma)
