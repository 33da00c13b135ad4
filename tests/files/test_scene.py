from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_scene, write_scene
from fringeworks.files.scene_schema import (
    BlendTable,
    BoardTable,
    BoxTable,
    ConeTable,
    CylinderTable,
    ObjectTable,
    PlaneTable,
    SphereTable,
)
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Pose
from fringeworks.twin.scene import (
    Blend,
    Board,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Material,
    Object,
    Plane,
    Scene,
    Shape,
    Sphere,
)
from fringeworks.twin.scenes import SCENES, named_scene

TURN_RAD = 1e-13
"""Written degrees are rounded by 5e-13, 9e-15 rad along each axis; the rest is the rounding of
matrices whose elements have an eps of 2e-16."""


def posed(x: float, *turn: float) -> Pose:
    return Pose(rotation_matrix(np.radians(turn or (0.0, 0.0, 0.0))), np.array([x, 1.5, 700.0]))


SHAPES: tuple[Shape, ...] = (
    Plane(),
    Plane(300.0, 200.0),
    Sphere(25.4),
    Cylinder(52.5, 120.0),
    Cone(30.0, 60.0),
    Box((10.0, 20.0, 30.0)),
    Blend((Capsule((0, 0, 0), 5.0, (0, 30.0, 0), 4.0), Capsule((1, 2, 3), 2.5, (4, 5, 6), 2.0))),
    Blend((Capsule((0, 0, 0), 5.0, (0, 30.0, 0), 4.0),), smooth_mm=2.5),
    Board(11, 8, 13.0),
    Board(11, 8, 13.0, "circles", diameter_mm=6.5),
    Board(7, 5, 20.0, "charuco", marker_mm=14.0, dictionary="DICT_5X5_100", margin_mm=5.0),
    Board(
        9,
        6,
        15.0,
        print_scale=(1e-3, -5e-4),
        print_sigma_mm=0.02,
        print_seed=3,
        bow_mm=(0.5, -0.25),
    ),
)


def scene_of(*shapes: Shape, name: str = "still") -> Scene:
    objects = tuple(
        Object(f"object {number}", shape, posed(-10.0 * number, 10.0 * number, 90.0, 0.0))
        for number, shape in enumerate(shapes)
    )
    return Scene(name, objects)


def assert_same(one: Scene, other: Scene) -> None:
    assert (one.name, one.posed) == (other.name, other.posed)
    assert len(one.objects) == len(other.objects)
    for item, again in zip(one.objects, other.objects, strict=True):
        assert_close(item.camera_from_object, again.camera_from_object)
        place = item.camera_from_object
        assert replace(again, camera_from_object=place) == item
    assert len(one.poses) == len(other.poses)
    for pose, repeated in zip(one.poses, other.poses, strict=True):
        assert_close(pose, repeated)


def assert_close(one: Pose, other: Pose) -> None:
    np.testing.assert_array_equal(one.translation_mm, other.translation_mm)
    np.testing.assert_allclose(one.rotation, other.rotation, rtol=0, atol=TURN_RAD)


def test_every_shape_reads_back(tmp_path: Path) -> None:
    scene = scene_of(*SHAPES)
    write_scene(tmp_path / "scene.toml", scene)
    assert_same(scene, read_scene(tmp_path / "scene.toml"))


def test_material_motion_and_poses_read_back(tmp_path: Path) -> None:
    material = Material(0.5, 0.1, 0.25, 120.0)
    board = Object("board", Board(11, 8, 13.0), posed(0.0), material, (1.0, -2.0, 0.5))
    wall = Object("wall", Plane(), posed(0.0))
    poses = (posed(1.0), posed(2.0, 0.0, -30.0, 5.0))
    scene = Scene("shown", (board, wall), "board", poses)
    write_scene(tmp_path / "a" / "scene.toml", scene)
    assert_same(scene, read_scene(tmp_path / "a" / "scene.toml"))


@pytest.mark.parametrize("name", SCENES)
def test_named_scenes_read_back(tmp_path: Path, name: str) -> None:
    write_scene(tmp_path / "scene.toml", named_scene(name))
    assert_same(named_scene(name), read_scene(tmp_path / "scene.toml"))


turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
places = st.tuples(*[st.floats(-1e5, 1e5)] * 3)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(turn=turns, place=places, radius=st.floats(1e-3, 1e5), albedo=st.floats(0, 1))
def test_no_digit_is_lost(
    tmp_path: Path, turn: Any, place: Any, radius: float, albedo: float
) -> None:
    pose = Pose(rotation_matrix(np.array(turn)), np.array(place))
    scene = Scene("ball", (Object("ball", Sphere(radius), pose, Material(albedo)),))
    write_scene(tmp_path / "scene.toml", scene)
    assert_same(scene, read_scene(tmp_path / "scene.toml"))


@pytest.mark.parametrize(
    ("table", "noun"),
    [
        (PlaneTable, Plane),
        (SphereTable, Sphere),
        (CylinderTable, Cylinder),
        (ConeTable, Cone),
        (BoxTable, Box),
        (BlendTable, Blend),
        (BoardTable, Board),
    ],
)
def test_a_shape_has_its_fields_as_keys(table: type[ObjectTable], noun: type[Shape]) -> None:
    own = set(table.model_fields) - set(ObjectTable.model_fields) - {"shape"}
    assert own == {item.name for item in fields(noun)} - {"kind"}


def test_material_fields_are_keys_of_every_object() -> None:
    assert {item.name for item in fields(Material)} < set(ObjectTable.model_fields)


BALL = {"name": "ball", "shape": "sphere", "radius_mm": 20.0, "position_mm": [0.0, 0.0, 600.0]}


def document(*objects: dict[str, Any], **further: Any) -> dict[str, Any]:
    return {"format": "fringeworks-scene/1", "object": list(objects) or [BALL], **further}


def read(folder: Path, description: dict[str, Any] | str) -> Scene:
    text = description if isinstance(description, str) else tomlkit.dumps(description)
    (folder / "two.toml").write_text(text, encoding="utf-8")
    return read_scene(folder / "two.toml")


def test_what_is_not_given(tmp_path: Path) -> None:
    scene = read(tmp_path, document())
    assert (scene.name, scene.posed, scene.poses) == ("two", None, ())
    (ball,) = scene.objects
    assert (ball.material, ball.velocity_mm_s) == (Material(), (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(ball.camera_from_object.rotation, np.eye(3))
    wall = {"name": "wall", "shape": "plane", "position_mm": [0, 0, 700]}
    assert read(tmp_path, document(wall)).objects[0].shape == Plane(math.inf, math.inf)


def test_rotations_are_degrees_about_their_vector(tmp_path: Path) -> None:
    """90 degrees about x turn the shape's z axis, a cylinder's, into -y: upwards."""
    scene = read(tmp_path, document({**BALL, "rotation_deg": [90.0, 0.0, 0.0]}))
    turned = scene.objects[0].camera_from_object.apply(np.array([0.0, 0.0, 10.0]))
    np.testing.assert_allclose(turned, [0.0, -10.0, 600.0], atol=1e-14)


def test_the_pages_example(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    start = page.index('format = "fringeworks-scene/1"')
    scene = read(tmp_path, page[start : page.index("```", start)])
    assert scene.objects[0].shape == Cylinder(52.5, 120.0)


def without(key: str) -> dict[str, Any]:
    return {name: value for name, value in BALL.items() if name != key}


POSE = {"object": "ball", "position_mm": [0.0, 0.0, 650.0]}
BOARD = {**BALL, "shape": "checkerboard", "columns": 9, "rows": 6, "square_mm": 10.0}
del BOARD["radius_mm"]
HAND = {**without("radius_mm"), "shape": "blend"}


@pytest.mark.parametrize(
    ("description", "message"),
    [
        ({"object": [BALL]}, "format must be 'fringeworks-scene/1', the key is missing"),
        (document(format="fringeworks-rig/1"), "format must be 'fringeworks-scene/1', got 'fring"),
        (document(light=1), "unknown key 'light'; known here: format, name, object, pose"),
        (document(poses=[]), "unknown key 'poses', did you mean 'pose'"),
        ("format = 'fringeworks-scene/1'", "two.toml: object is missing"),
        (document(object=[]), "object must not be empty"),
        (document({**BALL, "radius": 2.0}), r"object 1 \(sphere\): unknown key 'radius', did you"),
        (
            document({**BALL, "color": 2.0}),
            r"unknown key 'color'; known here: .*, shape, radius_mm$",
        ),
        (document(without("radius_mm")), r"object 1 \(sphere\): radius_mm is missing"),
        (document(BALL, without("shape")), "object 2: shape is missing"),
        (document(without("position_mm")), r"object 1 \(sphere\): position_mm is missing"),
        (document(without("name")), r"object 1 \(sphere\): name is missing"),
        (document({**BALL, "shape": "spere"}), "object 1: shape must be one of plane, sphere, .*"),
        (document({**BALL, "shape": "spere"}), "got 'spere', did you mean 'sphere'"),
        (document({**BALL, "shape": 3}), "object 1: shape must be one of plane, .* got '3'"),
        (document({**BALL, "radius_mm": "20"}), "radius_mm must be a number, got '20'"),
        (document({**BALL, "radius_mm": math.nan}), "radius_mm must be a finite number, got nan"),
        (document({**BALL, "radius_mm": math.inf}), "radius_mm must be a finite number, got inf"),
        (document({**BALL, "radius_mm": 1e7}), r"radius_mm must be <= 1e\+06, got 10000000"),
        (document({**BALL, "position_mm": [0, 0]}), "position_mm must hold 3 entries, got 2"),
        (document({**BALL, "rotation_deg": [0, 0, 1e9]}), r"rotation_deg\[2\] must be <= 36000"),
        (document({**HAND, "capsules": []}), r"object 1 \(blend\): capsules must not be empty"),
        (document({**HAND, "capsules": [[1.0] * 7]}), r"capsules\[0\] must hold 8 entries, got 7"),
        (document({**BOARD, "columns": 2}), r"object 1 \(checkerboard\): columns must be >= 3"),
        (document({**BOARD, "columns": 1001}), "columns must be <= 1000, got 1001"),
        (document({**BOARD, "bow": 1}), r"object 1 \(checkerboard\): unknown key 'bow'"),
        (document({**BOARD, "print_seed": -1}), "print_seed must be >= 0, got -1"),
        (document(pose=[{"object": "ball"}]), "pose 1: position_mm is missing"),
        (document(pose=[POSE, {**POSE, "turn": 1}]), "pose 2: unknown key 'turn'"),
        (
            document(pose=[{**POSE, "object": "bal"}]),
            "pose 1: object must be the name of one, got 'bal', did you mean 'ball'",
        ),
        (
            document(BALL, {**BALL, "name": "other"}, pose=[POSE, {**POSE, "object": "other"}]),
            "pose 2: object must be 'ball' as in pose 1, got 'other'; write a scene file for each",
        ),
        ("format = ", r"not valid TOML: .*\(at"),
    ],
)
def test_refusals(tmp_path: Path, description: Any, message: str) -> None:
    with pytest.raises(FormatError, match=message) as caught:
        read(tmp_path, description)
    assert str(tmp_path / "two.toml") in str(caught.value)


@pytest.mark.parametrize(
    ("description", "message"),
    [
        (document({**BALL, "radius_mm": 0.0}), "radius_mm"),
        (document({**BALL, "albedo": 1.5}), "albedo"),
        (document({**BALL, "albedo": 0.8, "gloss": 0.3}), "gloss"),
        (document(BALL, BALL), "'ball'"),
        (document({**BOARD, "shape": "charuco"}), "marker_mm"),
    ],
)
def test_values_that_make_no_scene_are_the_files(
    tmp_path: Path, description: dict[str, Any], message: str
) -> None:
    """`twin.check` knows which; here they are errors of the file, by its path."""
    with pytest.raises(FormatError, match=rf"two\.toml: .*{message}"):
        read(tmp_path, description)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"none\.toml: cannot be read \(No such file"):
        read_scene(tmp_path / "none.toml")


MIRROR = Pose(np.diag([1.0, 1.0, -1.0]), np.array([0.0, 0.0, 600.0]))
STRETCH = Pose(1.001 * np.eye(3), np.array([0.0, 0.0, 600.0]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"camera_from_object": MIRROR}, "rotation"),
        ({"camera_from_object": STRETCH}, "rotation"),
        ({"shape": Sphere(math.nan)}, "radius_mm"),
        ({"shape": Sphere(2e6)}, "radius_mm must be 1e-06 to 1e"),
        ({"shape": Sphere(np.float32(2.0))}, "cannot be written as TOML"),  # type: ignore[arg-type]
    ],
)
def test_what_cannot_be_written(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    ball = replace(Object("ball", Sphere(20.0), posed(0.0)), **change)
    with pytest.raises(UsageError, match=message):
        write_scene(tmp_path / "scene.toml", Scene("ball", (ball,)))
    assert list(tmp_path.iterdir()) == []
