"""Every reader of `fringeworks.files`, with valid files of our own to spoil."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any

import cv2
import numpy as np
import tomlkit

from fringeworks import files
from fringeworks.errors import FringeworksError
from fringeworks.files.acceptance import read_plan
from fringeworks.files.acquiring import Acquiring, Taken, read_acquiring, write_acquiring
from fringeworks.files.exchange import Given, read_foreign, write_matlab, write_opencv
from fringeworks.files.frame import read_frame, write_frame
from fringeworks.files.mesh import read_mesh
from fringeworks.files.reference import read_reference
from fringeworks.files.station import read_station
from fringeworks.files.targets import read_targets
from fringeworks.model import Reason
from fringeworks.model.frame import Frame
from fringeworks.phase.decode import Decoding
from fringeworks.twin.effects import Effects, ProjectorEffects
from tests.files import test_acceptance, test_board, test_station
from tests.files.folders import document, make_capture, pixels
from tests.files.test_cloud import colours, plane
from tests.files.test_mesh import pyramid
from tests.files.test_phase import coded
from tests.files.test_rig_residual import FIELD
from tests.files.test_scene import SHAPES, posed, scene_of
from tests.files.test_truth import truth
from tests.fuzz.mutate import mutate
from tests.fuzz.wrapping import Spoil, behind, spoil_e57, spoil_mat, spoil_npz, spoil_png
from tests.scenes import RIG


@dataclass(frozen=True, slots=True)
class Target:
    """A reader, and how to make the files that it is tried with.

    Attributes
    ----------
    file
        Name of the spoilt file in its folder.
    make
        Writes valid files into a folder, the spoilt one's neighbours too, and names those to spoil.
    """

    file: str
    make: Callable[[Path], list[Path]]
    read: Callable[[Path], object]
    spoil: Spoil = mutate
    needs: str | None = None

    def prepare(self, folder: Path) -> list[bytes]:
        """Contents of the valid files; they have been read once."""
        seeds = [path.read_bytes() for path in self.make(folder)]
        for seed in seeds:
            (folder / self.file).write_bytes(seed)
            self.read(folder / self.file)
        return seeds

    def spoil_and_read(self, folder: Path, seeds: list[bytes], random: Random) -> bool:
        """Whether a spoilt file was read; a refusal must be ours, and say something.

        What is not one of our errors is raised.
        """
        path = folder / self.file
        path.write_bytes(self.spoil(random.choice(seeds), random))
        try:
            self.read(path)
        except FringeworksError as error:
            length = len(str(error).strip())
        else:
            return True
        assert 0 < length < LONGEST_MESSAGE, f"a message of {length} characters"
        return False


LONGEST_MESSAGE = 8000

SIZES = Given(camera=(752, 480), projector=(608, 684), unit="mm")


def _written(name: str, *writers: Callable[[Path], object]) -> Callable[[Path], list[Path]]:
    """A file from each of `writers`."""

    def make(folder: Path) -> list[Path]:
        stem, suffix = name.rsplit(".", 1)
        paths = [folder / f"{stem}-valid{number}.{suffix}" for number in range(len(writers))]
        for path, write in zip(paths, writers, strict=True):
            write(path)
        return paths

    return make


def _text(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(content, encoding="utf-8")


def _data(content: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(content)


def _make_capture(folder: Path) -> list[Path]:
    description = document()
    description["camera"] = {"full_scale": 255.0, "gain": 0.02, "read_noise": 0.8}
    description["set"][1].update(inverted=["h0.png", "h1.png"], complementary="half.png")
    make_capture(folder, description)
    for name, goal in (("link.png", folder.parent / "outside.png"), ("loop.png", "loop.png")):
        (folder / name).symlink_to(goal)
    (folder.parent / "outside.png").write_bytes((folder / "f0.png").read_bytes())
    path = folder / "valid.toml"
    path.write_text(tomlkit.dumps(description), encoding="utf-8")
    return [path]


def _image(suffix: str, *options: int) -> Callable[[Path], list[Path]]:
    """Grey and colour, 8 and 16 bit as far as the format knows them."""
    deep = suffix in ("png", "tiff", "pgm")
    kinds: list[tuple[Any, tuple[int, ...]]] = [(np.uint8, (5, 7))]
    kinds += [(np.uint16, (5, 7))] if deep else []
    kinds += [] if suffix == "pgm" else [(np.uint8, (24, 17, 3))]
    kinds += [(np.uint16, (24, 17, 3))] if deep and suffix != "pgm" else []

    def make(folder: Path) -> list[Path]:
        paths = []
        for number, (dtype, shape) in enumerate(kinds):
            path = folder / f"valid{number}.{suffix}"
            assert cv2.imwrite(str(path), pixels(path.name, dtype=dtype, shape=shape), options)
            paths.append(path)
        return paths

    return make


def _full_cloud(path: Path) -> None:
    reason = np.zeros(plane().valid.shape, np.uint8)
    reason[0, 0] = Reason.MIXED
    files.write_cloud(
        path,
        replace(
            plane(),
            colour=colours(),
            scale_sigma=1e-4,
            systematic_mm=plane().sigma_mm,
            reason=reason,
            frame_from_camera=posed(1.0),
        ),
    )


def _ascii_pcd(path: Path) -> None:
    head = "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 3\n"
    head += "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ascii\n"
    path.write_text(head + "0 0 500 1\n1 0 500 2\nnan nan nan 0\n")


def _mesh(kind: str, *, text: bool = False) -> Callable[[Path], object]:
    def write(path: Path) -> None:
        import trimesh

        shape = pyramid()
        solid = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
        content: Any = solid.export(file_type="stl_ascii" if text and kind == "stl" else kind)
        if text and kind == "ply":
            content = solid.export(file_type="ply", encoding="ascii")
        path.write_bytes(content if isinstance(content, bytes) else content.encode())

    return write


OBJ = b"mtllib a.mtl\no one\nv 0 0 0\nv 1 0 0\nv 0 2 0\nv 1 2 0\nvt 0 0\nvn 0 0 1\nusemtl x\n"
OBJ += b"f 1/1/1 2/1/1 3/1/1\ng two\nf 1//1 2//1 4//1 3//1\nf -1 -2 -3\n"


TARGETS = """format = "fringeworks-targets/1"
[[view]]
cloud = "a.npz"
targets = { left = [0.0, 1.0, 2.0], right = [3.0, 4.0, 500.0] }
[[view]]
cloud = "b.npz"
targets = { left = [0.0, 1.0, 2.5], right = [3.0, 4.5, 500.0] }
"""
STATION = test_station.GOOD.replace('"cylinder"', '"scene.toml"').replace('"paper"', '"rig.json"')
STATION += 'sensor = "sensor.toml"\nseed = 5\n[timing]\nsettle_ms = 90\nretries = 0\n'

EFFECTS = Effects(projector=ProjectorEffects(response=((0.0, 0.0), (0.5, 0.25), (1.0, 1.0))))
SCENE = scene_of(SHAPES[1], SHAPES[6], SHAPES[-1])


def _make_responses(folder: Path) -> list[Path]:
    from tests.files.test_response import RESPONSES

    paths = [folder / f"valid-{response.way}.json" for response in RESPONSES]
    for path, response in zip(paths, RESPONSES, strict=True):
        files.write_response(path, response)
    return paths


def _rig_with_field(path: Path) -> None:
    files.write_rig(path, RIG)
    document = json.loads(path.read_text())
    path.write_text(json.dumps({**document, "residual": [FIELD]}, indent=1))


def _make_station(folder: Path) -> list[Path]:
    files.write_scene(folder / "scene.toml", SCENE)
    files.write_rig(folder / "rig.json", RIG)
    files.write_sensor(folder / "sensor.toml", EFFECTS)
    return _written("station.toml", _text(STATION), _text(test_station.GOOD))(folder)


def _write_acquiring(path: Path) -> None:
    taken = {"f0.png": Taken("0" * 64, 0.5), "f1.png": Taken("1" * 64, 1.0)}
    write_acquiring(path.parent, Acquiring("text", {"seed": 5, "rig": "paper"}, taken, ("f1.png",)))
    (path.parent / ".acquiring.json").rename(path)


def _read_foreign(path: Path) -> object:
    return read_foreign(path, SIZES)


def _save_phase(path: Path) -> None:
    files.write_phase(path, Decoding((coded("x", fringes=True), coded("y", fringes=True)), ()))


READERS: dict[str, Target] = {
    "capture": Target("capture.toml", _make_capture, files.read_capture),
    "board": Target(
        "board.toml",
        _written(
            "board.toml",
            _text(test_board.GOOD + "square_mm = 5.0\n"),
            _text(test_board.CHARUCO),
            _text(test_board.CIRCLES),
        ),
        files.read_board,
    ),
    "rig": Target(
        "rig.json",
        _written("rig.json", lambda path: files.write_rig(path, RIG), _rig_with_field),
        files.read_rig,
    ),
    "scene": Target(
        "scene.toml",
        _written("scene.toml", lambda path: files.write_scene(path, SCENE)),
        files.read_scene,
    ),
    "sensor": Target(
        "sensor.toml",
        _written("sensor.toml", lambda path: files.write_sensor(path, EFFECTS)),
        files.read_sensor,
    ),
    "response": Target(
        "response.json",
        _make_responses,
        files.read_response,
    ),
    "station": Target("station.toml", _make_station, read_station),
    "targets": Target(
        "targets.toml",
        _written("targets.toml", _text(TARGETS)),
        lambda path: read_targets(path, [Path("a.npz"), Path("b.npz")]),
    ),
    "frame": Target(
        "frame.json",
        _written("frame.json", lambda path: write_frame(path, Frame("datum", posed(1.0)))),
        read_frame,
    ),
    "acceptance": Target(
        "plan.toml", _written("plan.toml", _text(test_acceptance.WHOLE)), read_plan
    ),
    "acquiring": Target(
        ".acquiring.json",
        _written("acquiring.json", _write_acquiring),
        lambda path: read_acquiring(path.parent),
    ),
    "xml": Target("a.xml", _written("a.xml", lambda path: write_opencv(path, RIG)), _read_foreign),
    "yml": Target("a.yml", _written("a.yml", lambda path: write_opencv(path, RIG)), _read_foreign),
    "mat": Target(
        "a.mat",
        _written("a.mat", lambda path: write_matlab(path, RIG)),
        _read_foreign,
        behind(spoil_mat),
    ),
    "png": Target("a.png", _image("png"), files.read_image, behind(spoil_png)),
    "tiff": Target("a.tiff", _image("tiff"), files.read_image),
    "bmp": Target("a.bmp", _image("bmp"), files.read_image),
    "pgm": Target("a.pgm", _image("pgm"), files.read_image),
    "jpeg": Target("a.jpg", _image("jpg"), files.read_image),
    "ply": Target(
        "a.ply",
        _written("a.ply", _full_cloud, lambda path: files.write_cloud(path, plane(), faces=True)),
        files.read_cloud,
    ),
    "pcd": Target("a.pcd", _written("a.pcd", _full_cloud, _ascii_pcd), files.read_cloud),
    "xyz": Target("a.xyz", _written("a.xyz", _full_cloud), files.read_cloud),
    "npz-cloud": Target(
        "a.npz", _written("a.npz", _full_cloud), files.read_cloud, behind(spoil_npz)
    ),
    "npz-phase": Target(
        "a.npz", _written("a.npz", _save_phase), files.read_phase, behind(spoil_npz)
    ),
    "npz-truth": Target(
        "a.npz",
        _written("a.npz", lambda path: files.write_truth(path, truth())),
        files.read_truth,
        behind(spoil_npz),
    ),
    "stl": Target(
        "a.stl",
        _written("a.stl", _mesh("stl"), _mesh("stl", text=True)),
        read_mesh,
        needs="trimesh",
    ),
    "obj": Target("a.obj", _written("a.obj", _data(OBJ), _mesh("obj")), read_mesh, needs="trimesh"),
    "ply-mesh": Target(
        "a.ply",
        _written("a.ply", _mesh("ply"), _mesh("ply", text=True)),
        read_mesh,
        needs="trimesh",
    ),
    "reference": Target(
        "a.ply",
        _written("a.ply", lambda path: files.write_cloud(path, plane(), faces=True)),
        read_reference,
        needs="trimesh",
    ),
    "e57": Target(
        "a.e57", _written("a.e57", _full_cloud), files.read_cloud, behind(spoil_e57), needs="pye57"
    ),
}
