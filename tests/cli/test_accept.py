"""``fringeworks accept``: on the twin, on clouds, on real boards, and used wrongly."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.experiments import acceptance_twin
from fringeworks.files import write_cloud
from fringeworks.files.acceptance import read_plan, write_plan
from fringeworks.measure.region import Region
from tests.cli.scenes import plain, run
from tests.measure.artefacts import flat_cloud

EXAMPLE = Path(__file__).parents[2] / "examples" / "procam-graycode" / "acceptance.toml"

FLATS = """
format = "fringeworks-acceptance/1"
name = "a bench"
volume_mm = [100.0, 80.0, 60.0]
limits = { F_mm = 0.1 }
flat = { flatness_mm = 0.004 }
"""


def accept(*arguments: object) -> dict[str, Any]:
    done = run("accept", *arguments, "--json")
    assert done.exit_code == 0, done.stderr
    values: dict[str, Any] = json.loads(done.stdout, parse_constant=pytest.fail)
    return values


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Where the twin's quick test was run, and what it said; its rig from four poses."""
    out = tmp_path_factory.mktemp("accept")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(acceptance_twin, "QUICK_POSES_STEP", 4)
        return out, accept("--twin", "--quick", "--out", out)


class TestTwin:
    def test_what_it_says(self, twin: tuple[Path, dict[str, Any]]) -> None:
        _, found = twin
        lots = {lot["quantity"]: lot for lot in found["quantities"]}
        assert [lot["needed"] for lot in lots.values()] == [10, 10, 7, 6]
        assert [len(lot["readings"]) for lot in lots.values()] == [4, 4, 3, 2]
        assert found["outcome"] in ("fails", "incomplete")
        # half the pixels, four poses: a point scatters by 0.3 mm, so a range is below 4
        assert 0.1 < found["everyday"]["point_precision_mm"] < 0.6
        assert all(0.5 < one["PF_mm"] < 4 for one in found["balls"])
        assert all(0.5 < one["noise_range_mm"] / one["PF_mm"] < 1.5 for one in found["balls"])
        assert max(abs(one["SD_mm"]) for one in found["bars"]) < 0.5

    def test_what_it_writes(self, twin: tuple[Path, dict[str, Any]]) -> None:
        out, found = twin
        kept = json.loads((out / "acceptance.json").read_text())
        assert kept == {key: value for key, value in found.items() if key in kept}
        assert set(found) - set(kept) == {"plan", "written"}
        html = (out / "acceptance.html").read_text()
        assert "Acceptance: the paper&#x27;s rig on the twin" in html
        assert "too few positions" in html or "fails" in html
        for name in ("values", "places"):
            assert (out / "figures" / f"{name}.png").stat().st_size > 10_000

    def test_a_run_that_was_cut_off_goes_on(self, twin: tuple[Path, dict[str, Any]]) -> None:
        """What is missing is made again, the same to the last digit, and nothing else is."""
        out, found = twin
        kept = Path(found["plan"]).parent
        before = {path: path.stat().st_mtime_ns for path in kept.iterdir()}
        lost = kept / "bar_4.ply"
        was = lost.read_bytes()
        lost.unlink()
        again = accept("--twin", "--quick", "--out", out)
        assert again["quantities"] == found["quantities"]
        assert lost.read_bytes() == was
        untouched = [path for path in before if path.name not in (lost.name, "plan.toml")]
        assert all(path.stat().st_mtime_ns == before[path] for path in untouched)

    def test_its_plan_is_anybodys(self, twin: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
        """With another limit, in another place."""
        _, found = twin
        plan = read_plan(found["plan"])
        write_plan(tmp_path / "plan.toml", replace(plan, limits_mm={"SD": 5.0}))
        data = Path(found["plan"]).parent
        other = accept(tmp_path / "plan.toml", "--data", data, "--out", tmp_path / "out")
        assert [bar["SD_mm"] for bar in other["bars"]] == [bar["SD_mm"] for bar in found["bars"]]
        assert other["outcome"] == "incomplete"


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """Six flats with noise of 10 µm."""
    rng = np.random.default_rng(0)
    positions = []
    for number in range(6):
        across = rng.normal(0, 0.01, (60, 90))
        write_cloud(tmp_path / f"{number}.npz", flat_cloud(across, depth=500.0))
        positions.append(f'[[position]]\nartefact = "flat"\ncloud = "{number}.npz"\n')
    (tmp_path / "plan.toml").write_text(FLATS + "".join(positions))
    return tmp_path


class TestPlans:
    def test_in_words(self, bench: Path) -> None:
        done = run("accept", bench / "plan.toml", "--out", bench / "out")
        assert done.exit_code == 0, done.stderr
        words = plain(done.stdout)
        assert "a bench: conforms" in words
        assert "F flatness: range about a plane 6 of 6" in words
        # 10 µm, of which 3 per mille of the points take 1.5 %, to 5 sigma of 6 x 5400 points
        told = re.search(r"point precision (0\.\d+) mm", words)
        assert told is not None
        assert float(told[1]) == pytest.approx(0.00985, abs=3e-4)
        assert "wrote 2 files in" in words
        assert "PF" not in words

    def test_a_test_that_fails_is_done_too(self, bench: Path) -> None:
        text = (bench / "plan.toml").read_text()
        (bench / "plan.toml").write_text(text.replace("F_mm = 0.1", "F_mm = 0.01"))
        found = accept(bench / "plan.toml", "--out", bench / "out")
        assert found["outcome"] == "fails"
        assert any("at most a fifth of the limit of F" in one for one in found["findings"])

    def test_real_boards(self, real: Callable[[str], Path], tmp_path: Path) -> None:
        """The committed plan on the set of half the pixels: four of six flats.

        A Gray code alone quantises: the board comes out to a few mm at 3 m; the calibration's own
        plane rms of it is 1 to 3 mm (`demo`).
        """
        data, rig = real("procam-half"), tmp_path / "rig.json"
        poses = sorted(data.glob("capture_*"))
        made = run("calibrate", *poses, "--board", data / "board.toml", "--out", rig)
        assert made.exit_code == 0, made.stderr
        plan = read_plan(EXAMPLE)
        halved = tuple(replace(one, regions=(half_of(one.regions[0]),)) for one in plan.positions)
        write_plan(tmp_path / "plan.toml", replace(plan, positions=halved))
        found = accept(
            tmp_path / "plan.toml", "--data", data, "--rig", rig, "--out", tmp_path / "out"
        )
        (lot,) = found["quantities"]
        assert (lot["quantity"], lot["counted"], lot["outcome"]) == ("F", 4, "no limit")
        for flat in found["flats"]:
            long, short = flat["size_mm"]
            assert 540 < long < 610  # inside of 8 x 6 squares of 75 mm
            assert 400 < short < 455
            assert 0.5 < flat["rms_mm"] < 4
            assert flat["global_mm"] < 4


def half_of(region: Region) -> Region:
    assert region.pixels is not None
    (u0, u1), (v0, v1) = region.pixels
    return Region(pixels=((u0 / 2, u1 / 2), (v0 / 2, v1 / 2)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give either a plan or --twin"),
        (("plan.toml", "--twin"), "give either a plan or --twin"),
        (("plan.toml", "--quick"), "--preset, --seed and --quick belong to --twin"),
        (("plan.toml", "--seed", 3), "--preset, --seed and --quick belong to --twin"),
        (("--twin", "--rig", "rig.json"), "--rig and --data belong to a plan"),
    ],
)
def test_wrong_use(arguments: tuple[object, ...], message: str) -> None:
    done = run("accept", *arguments)
    assert done.exit_code == 2
    assert message in plain(done.stderr)


def test_help_says_what_is_measured() -> None:
    words = plain(run("accept", "--help").stdout)
    assert "ball 10 times (PF, PS), ball bar 7 (SD), flat 6 (F), mm" in words
    assert "Example: fringeworks accept plan.toml" in words
