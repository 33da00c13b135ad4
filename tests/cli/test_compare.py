"""``convert``, ``frame``, ``compare``, ``change`` and ``merge`` from files to numbers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.acquire.simulated import write_simulations
from fringeworks.files import read_cloud, read_rig, write_cloud, write_rig
from fringeworks.files.frame import read_frame, write_frame
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Pose, Rig
from fringeworks.model.frame import Frame
from fringeworks.patterns import make_sequence
from fringeworks.twin.scene import Object, Scene
from fringeworks.twin.scenes import BOARD, PAPER, board_pose, paper_rig, wall_scene
from tests.cli.scenes import plain, run
from tests.measure.seen import MIDDLE_MM, balls_scene, cut, off_balls, renoise, see, wall_with_step

TURNS = (0.0, 35.0, 80.0)
AXIS = Pose(rotation_matrix(np.array([np.pi / 2 + 0.1, 0.0, 0.0])), np.array([5.0, 20.0, 670.0]))
"""camera_from_table: z of the table is up, leaning a little."""


def tell(*arguments: object) -> dict[str, Any]:
    done = run(*arguments, "--json")
    assert done.exit_code == 0, done.stderr
    values: dict[str, Any] = json.loads(done.stdout, parse_constant=pytest.fail)
    return values


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wall before and after a block came, whole and small, and two views of the balls."""
    folder = tmp_path_factory.mktemp("scans")
    rng = np.random.default_rng(1)
    write_cloud(folder / "before.npz", renoise(see(wall_scene()), rng))
    write_cloud(folder / "again.npz", renoise(see(wall_scene()), rng))
    write_cloud(folder / "after.npz", renoise(see(wall_with_step()), rng))
    for turn in (0, 40):
        write_cloud(folder / f"view_{turn}.npz", renoise(see(balls_scene(turn)[0]), rng))
    for name in ("before", "after"):
        write_cloud(folder / f"small_{name}.npz", cut(read_cloud(folder / f"{name}.npz")))
    return folder


def test_change_is_told_and_drawn(scans: Path, tmp_path: Path) -> None:
    options = ("--figures", tmp_path / "figures", "--report", tmp_path / "page.html")
    found = tell("change", scans / "before.npz", scans / "after.npz", *options)
    (region,) = found["regions"]
    assert found["changed"]
    assert region["volume_mm3"] == pytest.approx(807, abs=20)
    assert (tmp_path / "figures" / "change.png").stat().st_size > 10_000
    assert "What changed" in (tmp_path / "page.html").read_text()
    words = run("change", scans / "before.npz", scans / "after.npz")
    assert "1 region" in words.stdout
    assert "nearer" in words.stdout
    mean, sigma = region["mean_mm"], region["mean_sigma_mm"]
    assert f"+{mean:.4f} ± {sigma:.4f}" in words.stdout  # two digits of sigma, as many of the value
    assert 0.001 <= sigma < 0.01


def test_no_change_is_no_error(scans: Path) -> None:
    assert tell("change", scans / "before.npz", scans / "again.npz")["changed"] is False
    done = run("change", scans / "before.npz", scans / "again.npz", "--window", 4)
    assert done.exit_code == 2
    assert "window_px must be odd" in done.stderr


def test_compare_with_a_cloud_and_with_a_mesh(scans: Path, tmp_path: Path) -> None:
    first, second = scans / "small_before.npz", tmp_path / "second.npz"
    write_cloud(second, cut(read_cloud(scans / "again.npz")))
    assert run("convert", first, tmp_path / "wall.stl").exit_code == 0
    for reference in (first, tmp_path / "wall.stl"):
        options = ("--tolerance", 0.5, "--figures", tmp_path / "figures")
        page = ("--report", tmp_path / "page.html", "--out", tmp_path / "painted.ply")
        found = tell("compare", second, reference, *options, *page)
        # two noises of 0.05 mm; the wall leans by 10 degrees; a nearest face is of three points
        assert 0.04 < found["rms_mm"] < 0.075
        assert abs(found["mean_mm"]) < 2e-3
        assert found["within_share"] == 1.0
        assert {Path(path).name for path in found["files"]} == {
            "deviation.png",
            "histogram.png",
            "page.html",
            "painted.ply",
        }
    assert found["noise_rms_mm"] == pytest.approx(0.05, rel=0.1)  # across noisy faces
    painted = read_cloud(tmp_path / "painted.ply").colour
    assert painted is not None
    assert "positive outside" in run("compare", second, first).stdout


def test_compare_after_alignment(scans: Path, tmp_path: Path) -> None:
    """A view moved by eight degrees comes back to the surface that it was seen of."""
    pytest.importorskip("small_gicp")
    cloud = read_cloud(scans / "view_0.npz")
    turn = rotation_matrix(np.array([0.0, 0.14, 0.02]))
    pose = Pose(turn, MIDDLE_MM - turn @ MIDDLE_MM + np.array([4.0, 2.0, -3.0]))
    moved = replace(cloud, xyz=pose.apply(cloud.xyz.astype(float)).astype(np.float32))
    write_cloud(tmp_path / "moved.npz", replace(moved, frame="elsewhere"))
    out = tmp_path / "back.npz"
    found = tell("compare", tmp_path / "moved.npz", scans / "view_0.npz", "--align", "--out", out)
    assert found["rms_mm"] < 0.01
    assert found["align_rms_mm"] < 0.01
    back = read_cloud(out)
    assert back.frame == "view_0"
    np.testing.assert_allclose(back.points(), cloud.points(), atol=0.01)
    away = replace(cloud, xyz=cloud.xyz + np.float32(300))
    write_cloud(tmp_path / "away.npz", away)
    far = run("compare", tmp_path / "away.npz", scans / "view_0.npz")
    assert far.exit_code == 1
    assert "--align brings the cloud to it" in plain(far.stderr)


def test_scale_belongs_to_meshes(scans: Path) -> None:
    done = run("compare", scans / "again.npz", scans / "before.npz", "--scale", 25.4)
    assert done.exit_code == 2
    assert "a cloud is in mm" in done.stderr


@pytest.mark.parametrize("by", ["x", "y", "z"])
def test_convert_paints_by_coordinate(scans: Path, tmp_path: Path, by: str) -> None:
    out = tmp_path / "a.ply"
    told = tell("convert", scans / "view_0.npz", out, "--colour", by, "--mesh")
    cloud = read_cloud(out)
    assert told["points"] == int(cloud.valid.sum())
    assert cloud.colour is not None
    place = cloud.points()[:, "xyz".index(by)]
    green = cloud.colour[0, :, 1].astype(float)  # of viridis it rises all the way
    rising = np.corrcoef(place, green)[0, 1]
    assert rising < -0.9 if by == "z" else rising > 0.9


def test_convert_moves_and_brings_back(scans: Path, tmp_path: Path) -> None:
    pose = Pose(rotation_matrix(np.array([0.2, 0.1, 0.0])), np.array([1.0, 2.0, 3.0]))
    write_frame(tmp_path / "frame.json", Frame("robot", pose))
    there, back = tmp_path / "there.npz", tmp_path / "back.npz"
    told = tell("convert", scans / "view_0.npz", there, "--frame", tmp_path / "frame.json")
    assert told["frame"] == "robot"
    tell("convert", there, back, "--frame", "camera")
    expected = read_cloud(scans / "view_0.npz").points()
    np.testing.assert_allclose(read_cloud(there).points(), pose.apply(expected), atol=1e-4)
    np.testing.assert_allclose(read_cloud(back).points(), expected, atol=1e-4)
    done = run("convert", scans / "view_0.npz", there, "--frame", tmp_path / "none.json")
    assert done.exit_code == 1
    assert "none.json: cannot be read (No such file" in done.stderr


def test_a_datum_from_a_cloud(scans: Path, tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.json", paper_rig())
    out = tmp_path / "frame.json"
    picks = ("--line", "100,240 650,240", "--origin", "376,100", "--pixels", "50:700,50:430")
    keep = ("--rig", tmp_path / "rig.json", "--keep")
    tell("frame", "datum", scans / "before.npz", *picks, *keep, "--out", out)
    frame = read_frame(out)
    assert frame.name == "station"
    wall = wall_scene().objects[0].camera_from_object.rotation[:, 2]
    np.testing.assert_allclose(frame.frame_from_camera.rotation[2], -wall, atol=1e-4)
    kept = read_rig(tmp_path / "rig.json").further["station_from_camera"]
    np.testing.assert_allclose(kept["rotation"], frame.frame_from_camera.rotation)
    done = run("frame", "datum", scans / "before.npz", *picks, "--keep", "--out", out)
    assert (done.exit_code, "--keep and --rig belong together" in done.stderr) == (2, True)
    done = run(
        "frame", "datum", scans / "before.npz", "--line", "1", "--origin", "1,1", "--out", out
    )
    assert (done.exit_code, "--line must be pixels as 120,300" in done.stderr) == (2, True)


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Rig]:
    """Captures of a board on a table at three angles."""
    folder = tmp_path_factory.mktemp("turned")
    rig = paper_rig()
    sequence = make_sequence("measure", width=608, height=684)
    first = board_pose((0, 0, 650), (0, 40, 0))
    poses = []
    for turn in TURNS:
        about = (
            AXIS.rotation @ rotation_matrix(np.array([0, 0, np.deg2rad(turn)])) @ AXIS.rotation.T
        )
        shift = AXIS.translation_mm + about @ (first.translation_mm - AXIS.translation_mm)
        poses.append(Pose(about @ first.rotation, shift))
    scene = Scene("board", (Object("board", BOARD, poses[0], PAPER),), "board", tuple(poses))
    write_simulations(scene, rig, sequence, folder)
    write_rig(folder / "rig.json", rig)
    return folder, rig


def test_a_turntable_and_a_board(turned: tuple[Path, Rig], tmp_path: Path) -> None:
    """Axis within 0.05 mm at the things' place and 0.02 degrees; then views merge by it."""
    folder, _ = turned
    using = ("--rig", folder / "rig.json", "--board", folder / "board.toml")
    views = [folder / f"pose_{number:02d}" for number in range(3)]
    found = tell("frame", "turntable", *views, *using, "--out", tmp_path / "table.json")
    np.testing.assert_allclose(found["angles_deg"], TURNS, atol=0.02)
    assert found["rms_mm"] < 0.1
    table = read_frame(tmp_path / "table.json").frame_from_camera
    assert np.linalg.norm(np.cross(table.rotation[2], AXIS.rotation[:, 2])) < 1e-3
    assert np.linalg.norm(table.apply(AXIS.translation_mm)[:2]) < 0.05
    single = tell("frame", "board", views[0], *using, "--out", tmp_path / "board.json")
    assert single["rms_mm"] < 0.1
    middle = read_frame(tmp_path / "board.json").frame_from_camera.apply(np.array([0.0, 0, 650]))
    np.testing.assert_allclose(middle, [65, 45.5, 0], atol=0.1)


def test_merging_by_a_turntable_and_by_surfaces(scans: Path, tmp_path: Path) -> None:
    """The table turns about -y, the balls were turned about y: hence the sign."""
    table = Pose(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), np.array([0.0, -690, 0]))
    write_frame(tmp_path / "table.json", Frame("table", table))
    views = [scans / "view_0.npz", scans / "view_40.npz"]
    using = ("--frame", tmp_path / "table.json", "--angles", "0,-40")
    out = tmp_path / "whole.ply"
    told = tell("merge", *views, *using, "--by", "frame", "--out", out)
    assert told["points"] == sum(int(read_cloud(view).valid.sum()) for view in views)
    merged = read_cloud(out)
    assert merged.frame == "table"
    things = (merged.points() - table.translation_mm) @ table.rotation - MIDDLE_MM
    assert abs(off_balls(things).mean()) < 2e-3
    wrong = ("--frame", tmp_path / "table.json", "--angles", "0,-39.5")
    told = tell("merge", *views, *wrong, "--out", out)  # half a degree is 0.4 mm at the rim
    merged = read_cloud(out)
    things = (merged.points() - table.translation_mm) @ table.rotation - MIDDLE_MM
    assert told["loose_motions"] == 0
    assert off_balls(things).std() < 0.055


def test_merging_by_targets(scans: Path, tmp_path: Path) -> None:
    turn = rotation_matrix(np.array([0.0, np.deg2rad(40), 0.0]))
    places = {"A": (30, -28, 10), "B": (5, -30, -35), "C": (38, 8, -12)}
    lines = ['format = "fringeworks-targets/1"']
    for name, rotation in (("view_0.npz", np.eye(3)), ("view_40.npz", turn)):
        lines += ["[[view]]", f'cloud = "{name}"', "[view.targets]"]
        for target, place in places.items():
            at = MIDDLE_MM + rotation @ np.array(place, dtype=float)
            lines.append(f"{target} = [{at[0]}, {at[1]}, {at[2]}]")
    (tmp_path / "targets.toml").write_text("\n".join(lines))
    views = [scans / "view_0.npz", scans / "view_40.npz"]
    using = ("--by", "targets", "--targets", tmp_path / "targets.toml", "--out", tmp_path / "a.ply")
    told = tell("merge", *views, *using)
    assert (told["targets"], told["frame"]) == (6, "camera")
    assert told["targets_rms_mm"] < 1e-6
    assert abs(off_balls(read_cloud(tmp_path / "a.ply").points() - MIDDLE_MM).mean()) < 2e-3
    done = run("merge", *views, scans / "after.npz", *using)
    assert done.exit_code == 1
    assert "has no [[view]] with cloud = 'after.npz'" in done.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--by", "targets"), "--by targets and --targets belong together"),
        (("--targets", "a.toml"), "--by targets and --targets belong together"),
        (
            ("--by", "targets", "--targets", "a", "--frame", "a", "--angles", "0,1"),
            "--by targets takes no --angles",
        ),
        (("--frame", "a.json", "--angles", "0,nan"), "--angles must be numbers"),
        (("--out", "a.stl"), "a mesh needs one cloud's grid"),
        (("--out", "a.foo"), "cloud format '.foo' is not known"),
        (("--within", "0"), "within_mm must be positive"),
        (("--angles", "0,1"), "--angles and --frame belong together"),
        (("--frame", "a.json", "--angles", "0"), "--angles must be one per cloud, 2, got 1"),
    ],
)
def test_wrong_use_of_merge(scans: Path, options: tuple[str, ...], message: str) -> None:
    views = (scans / "view_0.npz", scans / "view_40.npz")
    done = run("merge", *views, "--out", scans / "never.ply", *options)
    assert (done.exit_code, message in plain(done.stderr)) == (2, True), done.stderr


def refused(*arguments: object) -> str:
    """What a command says that must not run: one line, and the status of wrong use."""
    done = run(*arguments)
    assert done.exit_code == 2, (done.exception, done.stderr)
    assert done.stderr.count("\n") == 1
    return str(done.stderr)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--within", "nan"), "within_mm must be positive"),
        (("--within", "-1", "--align"), "within_mm must be positive"),
        (("--tolerance", "-0.1"), "--tolerance must be positive"),
        (("--scale", "-1"), "scale must be positive"),
        (("--out", "a.foo"), "cloud format '.foo' is not known"),
    ],
)
def test_wrong_use_of_compare(
    scans: Path, tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    """Before anything is drawn."""
    clouds = (scans / "small_before.npz", scans / "small_after.npz")
    assert message in refused("compare", *clouds, *options, "--figures", tmp_path / "figures")
    assert not list(tmp_path.iterdir())


def test_clouds_of_two_frames(scans: Path, tmp_path: Path) -> None:
    """Their coordinates have nothing to do with each other, however near they are."""
    elsewhere = replace(read_cloud(scans / "small_after.npz"), frame="robot")
    write_cloud(tmp_path / "robot.npz", elsewhere)
    pair = (scans / "small_before.npz", tmp_path / "robot.npz")
    assert "frame 'camera' and the reference in 'robot'" in refused("compare", *pair)
    assert "frames 'camera' and 'robot'" in refused("change", *pair)


def test_change_takes_sigma_and_room(scans: Path, tmp_path: Path) -> None:
    """Without sigma nothing is significant: that is no answer."""
    cloud = read_cloud(scans / "small_after.npz")
    write_cloud(tmp_path / "cut.npz", cloud)
    write_cloud(tmp_path / "bare.npz", replace(cloud, sigma_mm=np.nan * cloud.sigma_mm))
    done = run("change", tmp_path / "cut.npz", tmp_path / "bare.npz")
    assert (done.exit_code, "say no sigma" in done.stderr) == (1, True)
    done = run("change", tmp_path / "cut.npz", tmp_path / "cut.npz", "--window", "999")
    assert (done.exit_code, "window_px must be at most" in done.stderr) == (1, True)


def test_nothing_to_compare(scans: Path, tmp_path: Path) -> None:
    cloud = read_cloud(scans / "small_after.npz")
    write_cloud(tmp_path / "void.npz", replace(cloud, xyz=np.nan * cloud.xyz))
    for options, message in (((), "no points to compare"), (("--align",), "aligning takes 100")):
        done = run("compare", tmp_path / "void.npz", scans / "small_after.npz", *options)
        assert (done.exit_code, message in done.stderr) == (1, True)
    done = run("compare", scans / "small_after.npz", tmp_path / "void.npz")
    assert (done.exit_code, "void.npz: the cloud has no" in done.stderr) == (1, True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--line", "nan,5 50,5", "--origin", "5,5"), "--line must be pixels"),
        (("--line", "5,5", "--origin", "5,5"), "--line takes two pixels or more"),
        (("--line", "5,5 50,5", "--origin", "5,5 6,6"), "and --origin one"),
        (("--line", "5,5 50,5", "--origin", "5,5", "--rig", "r.json"), "belong together"),
        (("--line", "300,200 400,200", "--origin", "300,200", "--name", "a\nb"), "printable"),
    ],
)
def test_wrong_use_of_datum(
    scans: Path, tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    out = tmp_path / "frame.json"
    assert message in refused("frame", "datum", scans / "before.npz", *options, "--out", out)
    assert not out.exists()


def test_names_are_no_formulas(scans: Path, tmp_path: Path) -> None:
    """A dollar in a file's name begins one in a figure's title, and this one has no end."""
    name = tmp_path / "$x^{$ 球.npz"
    write_cloud(name, read_cloud(scans / "small_after.npz"))
    tell("compare", name, name, "--figures", tmp_path / "figures")
    assert (tmp_path / "figures" / "deviation.png").exists()
