"""What changed: nothing by noise, a block found with its height, area and volume."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.measure.change import ChangeRules, find_change
from fringeworks.model import Cloud
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import scan
from fringeworks.twin.scene import Scene
from fringeworks.twin.scenes import paper_rig, step_scene, wall_scene
from fringeworks.twin.simulate import simulate
from tests.measure.seen import SD, cut, renoise, see, wall_with_step

WALL = wall_scene()


@pytest.fixture(scope="module")
def wall() -> Cloud:
    return see(WALL)


@pytest.fixture(scope="module")
def block() -> Cloud:
    return see(wall_with_step())


def test_noise_invents_nothing_in_twenty_repeats(wall: Cloud) -> None:
    """Each pair may fail with 1e-3: twenty at a least change of nothing with 2 %."""
    rng = np.random.default_rng(20)
    rules = ChangeRules(least_mm=0)
    for _ in range(20):
        found = find_change(renoise(wall, rng), renoise(wall, rng), rules)
        assert found.regions == ()
        assert found.noise_factor == pytest.approx(1, abs=0.01)


def test_a_block_of_two_millimetres_is_found(wall: Cloud, block: Cloud) -> None:
    """20 x 20 x 2 mm on a wall tilted by 10 degrees, so 2 / cos 10 along the axis.

    The picture's pixels are 0.35 mm, and the block hides a strip of 2 mm tan 10 behind two of its
    sides: the volume along the rays is larger by 0.35 x 20 mm^2, the area by a pixel's width.
    """
    rng = np.random.default_rng(2)
    found = find_change(renoise(wall, rng), renoise(block, rng))
    (region,) = found.regions
    assert region.kind == "changed"
    assert region.mean_mm == pytest.approx(2.03, abs=0.02)
    assert region.volume_mm3 == pytest.approx(800 + 7, abs=20)
    assert region.area_mm2 == pytest.approx(400, abs=30)
    assert region.volume_sigma_mm3 < 1
    assert region.mean_sigma_mm < 0.01
    np.testing.assert_allclose(region.centre_mm, [0, 0, 698], atol=0.7)
    assert set(np.unique(found.labels)) == {0, 1}
    (gone,) = find_change(renoise(block, rng), renoise(wall, rng)).regions
    assert gone.mean_mm == pytest.approx(-region.mean_mm, abs=0.01)
    assert gone.volume_mm3 == pytest.approx(-region.volume_mm3, abs=5)


def test_volumes_scatter_as_their_sigma_says(wall: Cloud, block: Cloud) -> None:
    rng = np.random.default_rng(8)
    wall, block = cut(wall), cut(block)
    regions = [find_change(renoise(wall, rng), renoise(block, rng)).regions[0] for _ in range(20)]
    volumes = [region.volume_mm3 for region in regions]
    # the mask follows the noise too, by some pixels on its rim: twice is allowed
    assert np.std(volumes) < 2 * regions[0].volume_sigma_mm3 * (1 + 5 / np.sqrt(40))


def test_a_faint_change_shows_in_the_windows_alone(wall: Cloud) -> None:
    """0.12 mm at 0.07 mm of noise: no pixel tells, 81 of them do."""
    rng = np.random.default_rng(4)
    raised = wall.xyz.copy()
    raised[200:260, 300:360] *= 1 - 0.12 / 700
    rules = ChangeRules(least_mm=0.05)
    (region,) = find_change(
        renoise(wall, rng), renoise(replace(wall, xyz=raised), rng), rules
    ).regions
    assert region.mean_mm == pytest.approx(0.12, abs=0.01)
    assert find_change(renoise(wall, rng), renoise(wall, rng), rules).regions == ()


def test_surfaces_that_come_and_go() -> None:
    """A box alone before nothing, taken away: no heights, but place and area."""
    low = Scene("low", (step_scene().objects[1],))  # 60 x 90 mm, its face at 700 mm
    there = see(low)
    nothing = replace(there, xyz=np.full_like(there.xyz, np.nan))
    half = there.xyz.copy()
    half[:240] = np.nan
    (region,) = find_change(replace(there, xyz=half), there).regions
    assert (region.kind, np.isnan(region.volume_mm3)) == ("appeared", True)
    (region,) = find_change(there, replace(there, xyz=half)).regions
    assert region.kind == "vanished"
    seen = np.count_nonzero(there.valid[:240])
    assert region.pixels == seen
    assert region.area_mm2 == pytest.approx(seen * (700 / 1974) ** 2, rel=0.03)  # f = 1974 px
    with pytest.raises(MeasurementError, match="no pixel has a point in both scans"):
        find_change(there, nothing)


def test_sigma_that_says_too_little_is_widened(wall: Cloud) -> None:
    """Scans that scatter three times as much as they say: the limit follows."""
    rng = np.random.default_rng(9)
    first, second = (renoise(wall, rng, sd=3 * SD) for _ in range(2))
    found = find_change(first, second, ChangeRules(least_mm=0))
    assert found.noise_factor == pytest.approx(3, rel=0.02)
    assert found.regions == ()


def test_refusals(wall: Cloud) -> None:
    sigma = wall.sigma_mm[:-1]
    other = Cloud(wall.xyz[:-1], sigma, sigma, sigma)
    with pytest.raises(ShapeError, match=r"one camera's grid .* \(480, 752\) and \(479, 752\)"):
        find_change(wall, other)
    with pytest.raises(UsageError, match="window_px must be odd and positive, got 8"):
        ChangeRules(window_px=8)
    with pytest.raises(UsageError, match="least_mm must be 0 or more"):
        ChangeRules(least_mm=-1)


def test_on_simulated_captures() -> None:
    """The whole line, noise of light and all: the same wall gives nothing, the block is there."""
    rig = paper_rig()
    sequence = make_sequence("measure", width=608, height=684, axes=("x",))

    def scanned(scene: Scene, seed: int) -> Cloud:
        rng = np.random.default_rng(seed)
        return scan(simulate(scene, rig, sequence, rng=rng).capture, rig)

    first = scanned(WALL, 0)
    assert find_change(first, scanned(WALL, 1), ChangeRules(least_mm=0)).regions == ()
    regions = find_change(first, scanned(wall_with_step(), 2)).regions
    assert regions[0].mean_mm == pytest.approx(2.03, abs=0.03)
    # at the block's rim pixels are masked as mixed: what is left of 400 mm^2
    assert 330 < regions[0].area_mm2 < 430
    assert {region.kind for region in regions[1:]} <= {"vanished"}


def test_a_wild_pixel_is_no_change(wall: Cloud) -> None:
    """One pixel 20 mm off would shift the mean of its window by 0.25 mm, 30 times its sigma."""
    rng = np.random.default_rng(12)
    before, after = (renoise(cut(wall), rng) for _ in range(2))
    after.xyz[70, 80] *= 1 + 20 / 700
    assert find_change(before, after).regions == ()
