"""``fringeworks twin``: captures that every other command reads, with their truth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.cli.twin import twin
from fringeworks.files import read_board, read_capture, read_rig, read_truth, write_rig
from fringeworks.files.scene import read_scene, write_scene
from fringeworks.files.sensor import read_sensor, write_sensor
from fringeworks.model import Camera, Lens, Projector, Rig
from fringeworks.twin.effects import AmbientEffects, Effects
from fringeworks.twin.scenes import SCENES, board_scene, cylinder_scene, paper_rig
from tests.cli.scenes import run

PATTERNS = ("--preset", "measure", "--axes", "x", "--steps", "4", "--periods", "16")


def small_rig() -> Rig:
    """The paper's rig with an eighth of its camera's pixels per side, and a quarter's rows."""
    rig = paper_rig()
    lens = rig.camera.lens
    camera = Camera(94, 60, Lens(lens.fx / 8, lens.fy / 8, 47.0, 29.5, lens.k1, lens.k2))
    return Rig(camera, rig.projector, rig.projector_from_camera)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "small.json"
    write_rig(path, small_rig())
    return path


def test_a_scan_of_the_simulated_capture_meets_its_truth(rig: Path, tmp_path: Path) -> None:
    """With the true rig, errors are noise, half of them below 0.674 sigma, and what pixels of
    2.6 mm make of a curved surface by averaging over four columns each: as much again."""
    capture = tmp_path / "capture"
    done = run("twin", "cylinder", "--rig", rig, *PATTERNS, "--out", capture, "--json")
    assert done.exit_code == 0, done.stderr
    (told,) = json.loads(done.stdout, parse_constant=pytest.fail)["captures"]
    truth = read_truth(capture / "truth.npz")
    assert told["surfaces"] == ["cylinder"] == list(truth.names)
    assert told["seen_share"] == pytest.approx(float(np.mean(truth.surface == 0)))
    assert 640 < told["z_mm"]["min"] < told["z_mm"]["max"] < 705

    done = run("scan", capture, "--rig", rig, "--out", tmp_path / "cloud.npz", "--json")
    assert done.exit_code == 0, done.stderr
    with np.load(tmp_path / "cloud.npz") as cloud:
        error = (cloud["xyz"][..., 2] - truth.xyz[..., 2]) / cloud["sigma_mm"]
    inner = np.isfinite(error)
    assert np.count_nonzero(inner) > 1000
    assert 0.5 < np.median(np.abs(error[inner])) < 1.5


def test_what_made_it_stands_beside_it(rig: Path, tmp_path: Path) -> None:
    sensor = tmp_path / "sensor.toml"
    effects = replace(Effects(), ambient=AmbientEffects(light_per_ms=0.02))
    write_sensor(sensor, effects)
    first, again = tmp_path / "first", tmp_path / "again"
    done = run("twin", "two", "--rig", rig, *PATTERNS, "--sensor", sensor, "--out", first)
    assert done.exit_code == 0, done.stderr
    assert "cylinder, cone" in done.stdout
    assert read_sensor(first / "sensor.toml") == effects
    assert read_rig(first / "true_rig.json").camera == small_rig().camera
    assert [item.name for item in read_scene(first / "scene.toml").objects] == ["cylinder", "cone"]

    made_from = ("--rig", first / "true_rig.json", "--sensor", first / "sensor.toml")
    done = run("twin", first / "scene.toml", *made_from, *PATTERNS, "--out", again)
    assert done.exit_code == 0, done.stderr
    for name in ("fringe_x_p16_1.png", "white.png"):
        assert (first / name).read_bytes() == (again / name).read_bytes()


def test_the_seed_decides_the_noise(rig: Path, tmp_path: Path) -> None:
    frames = []
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        arguments = ("--rig", rig, *PATTERNS, "--seed", seed, "--out", tmp_path / name)
        assert run("twin", "wall", *arguments).exit_code == 0
        frames.append(read_capture(tmp_path / name).frames)
    for same, other, third in zip(*frames, strict=True):
        assert np.array_equal(same, other)
        assert not np.array_equal(same, third)


def test_a_posed_board_becomes_a_capture_per_pose(rig: Path, tmp_path: Path) -> None:
    scene = board_scene()
    write_scene(tmp_path / "three.toml", replace(scene, poses=scene.poses[:3]))
    out = tmp_path / "board"
    done = run("twin", tmp_path / "three.toml", "--rig", rig, *PATTERNS, "--out", out)
    assert done.exit_code == 0, done.stderr
    assert sorted(path.name for path in out.iterdir()) == [
        "board.toml",
        *(f"pose_0{i}" for i in range(3)),
    ]
    board = read_board(out / "board.toml")
    assert (board.columns, board.rows, board.pitch_x_mm) == (11, 8, 13.0)
    images = [read_capture(out / f"pose_0{i}").frames[-1] for i in range(3)]
    assert not np.array_equal(images[0], images[1])
    assert "pose_02" in done.stdout


def test_a_capture_is_not_replaced_unasked(rig: Path, tmp_path: Path) -> None:
    arguments = ("twin", "wall", "--rig", rig, *PATTERNS, "--out", tmp_path / "wall")
    assert run(*arguments).exit_code == 0
    before = {path: path.read_bytes() for path in (tmp_path / "wall").iterdir()}
    done = run(*arguments, "--seed", 5)
    assert done.exit_code == 2
    assert "holds a capture already" in done.stderr
    assert before == {path: path.read_bytes() for path in (tmp_path / "wall").iterdir()}
    assert run(*arguments, "--seed", 5, "--overwrite").exit_code == 0


def blind_rig() -> Rig:
    rig = small_rig()
    away = replace(
        rig.projector_from_camera, translation_mm=rig.projector_from_camera.translation_mm + 5000.0
    )
    return replace(rig, projector_from_camera=away)


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("twin", "nonsense"), 2, "scene must be a file or one of cylinder, two, hand"),
        (("twin", "missing.toml"), 1, "missing.toml: cannot be read"),
        (("twin", "{outside}"), 2, "scene 'cylinder': the camera sees nothing of it (cylinder)"),
        (("twin", "wall", "--rig", "{blind}"), 2, "the rig points away"),
        (("twin", "wall", "--rig", "nonsense"), 2, "rig must be a file or one of paper, warped"),
        (("twin", "wall", "--sensor", "{dark}"), 1, "camera.exposure_ms must be"),
    ],
)
def test_bad_input(
    arguments: tuple[str, ...], status: int, words: str, rig: Path, tmp_path: Path
) -> None:
    moved = cylinder_scene().objects[0]
    pose = replace(moved.camera_from_object, translation_mm=np.array([5000.0, 0.0, 700.0]))
    write_scene(
        tmp_path / "outside.toml",
        replace(cylinder_scene(), objects=(replace(moved, camera_from_object=pose),)),
    )
    write_rig(tmp_path / "blind.json", blind_rig())
    (tmp_path / "dark.toml").write_text(
        'format = "fringeworks-sensor/1"\n[camera]\nexposure_ms = 0.0\n'
    )
    files = {
        "outside": tmp_path / "outside.toml",
        "blind": tmp_path / "blind.json",
        "dark": tmp_path / "dark.toml",
    }
    filled = [argument.format(**files) for argument in arguments]
    if "--rig" not in filled:
        filled += ["--rig", str(rig)]
    done = run(*filled, *PATTERNS, "--out", tmp_path / "out")
    assert (done.exit_code, done.stdout) == (status, "")
    assert words in done.stderr
    assert not (tmp_path / "out" / "capture.toml").exists()


def test_the_help_names_every_scene() -> None:
    said = run("twin", "--help").stdout
    assert all(name in said for name in SCENES)
    assert twin.__doc__ is not None
    assert isinstance(paper_rig().projector, Projector)


@pytest.fixture
def own(rig: Path, tmp_path: Path) -> tuple[object, ...]:
    """Somebody's scene, rig and sensor in one folder, and a call that reads them."""
    folder = tmp_path / "own"
    write_scene(folder / "scene.toml", cylinder_scene())
    write_sensor(folder / "sensor.toml", Effects())
    (folder / "small.json").write_bytes(rig.read_bytes())
    made_from = ("--rig", folder / "small.json", "--sensor", folder / "sensor.toml")
    return ("twin", folder / "scene.toml", *made_from, *PATTERNS)


@pytest.mark.parametrize("options", [(), ("--overwrite",)])
def test_its_own_input_is_never_replaced(
    own: tuple[object, ...], tmp_path: Path, options: tuple[str, ...]
) -> None:
    before = {path: path.read_bytes() for path in (tmp_path / "own").iterdir()}
    done = run(*own, "--out", tmp_path / "own", *options)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "is read here and would be replaced" in done.stderr
    assert {path: path.read_bytes() for path in (tmp_path / "own").iterdir()} == before


@pytest.mark.parametrize("name", ["truth.npz", "scene.toml", "true_rig.json", "white.png"])
def test_other_peoples_files_are_not_replaced_unasked(
    own: tuple[object, ...], tmp_path: Path, name: str
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).write_text("mine")
    done = run(*own, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert f"{name}: is there already; choose another folder or overwrite it" in done.stderr
    assert (tmp_path / "out" / name).read_text() == "mine"
    assert run(*own, "--out", tmp_path / "out", "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("out", "status", "words"),
    [
        ("a.txt", 2, "a.txt: must be a folder, but is a file"),
        ("a.txt/b/c", 2, "a.txt: must be a folder, but is a file"),
        ("n" * 300, 1, "cannot be written (File name too long)"),
    ],
)
def test_where_no_folder_can_be(
    own: tuple[object, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    out: str,
    status: int,
    words: str,
) -> None:
    """Said before anything is simulated."""
    monkeypatch.setattr("fringeworks.acquire.simulated.simulate", pytest.fail)
    (tmp_path / "a.txt").touch()
    done = run(*own, "--out", tmp_path / out)
    assert done.exit_code == status
    assert words in done.stderr


def test_what_fails_in_the_end_leaves_an_earlier_capture(
    own: tuple[object, ...], tmp_path: Path
) -> None:
    """A read noise of 1e15 electrons is more grey levels than a capture.toml may say."""
    out = ("--out", tmp_path / "out", "--overwrite")
    assert run(*own, *out).exit_code == 0
    noisy = replace(Effects(), camera=replace(Effects().camera, read_noise_e=1e15))
    write_sensor(tmp_path / "own" / "sensor.toml", noisy)
    done = run(*own, *out)
    assert done.exit_code == 2
    assert "could not be read back" in done.stderr
    assert "read_noise" in done.stderr
    assert (tmp_path / "out" / "capture.toml").exists()


def test_a_pose_out_of_view_is_named_before_any_capture(rig: Path, tmp_path: Path) -> None:
    scene = board_scene()
    away = replace(scene.poses[1], translation_mm=np.array([5000.0, 0.0, 700.0]))
    write_scene(tmp_path / "two.toml", replace(scene, poses=(scene.poses[0], away)))
    out = tmp_path / "board"
    done = run("twin", tmp_path / "two.toml", "--rig", rig, *PATTERNS, "--out", out)
    assert done.exit_code == 2
    assert "scene 'pose_01': the camera sees nothing of it" in done.stderr
    assert not out.exists()
