from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from fringeworks.errors import FormatError
from fringeworks.files import write_rig, write_scene
from fringeworks.files.mesh import write_mesh
from fringeworks.files.station import Station, Timing, read_station
from fringeworks.files.station_devices import (
    FolderSettings,
    GenicamSettings,
    GenTLSettings,
    PluginSettings,
    SimulatedProjectorSettings,
    WindowSettings,
)
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import named_rig
from tests.files.test_mesh import pyramid
from tests.files.test_scene import scene_of

DEVICES = """[projector]
kind = "simulated"
[camera]
kind = "simulated"
"""
REAL = """[projector]
kind = "window"
display = 1
[camera]
kind = "genicam"
exposure_ms = 20
"""
GOOD = f"""format = "fringeworks-station/1"
{DEVICES}[simulated]
scene = "cylinder"
rig = "paper"
"""


def station(folder: Path, text: str) -> Station:
    (folder / "station.toml").write_text(text, encoding="utf-8")
    return read_station(folder / "station.toml")


def test_what_is_not_given_is_the_default(tmp_path: Path) -> None:
    read = station(tmp_path, GOOD)
    assert read.simulated is not None
    assert read.simulated.scene.name == "cylinder"
    assert read.simulated.rig.camera == named_rig("paper").camera
    assert read.rig is read.simulated.rig
    assert read.simulated.effects == Effects()
    assert read.projector == SimulatedProjectorSettings(latency_ms=20.0)
    assert (read.exposure_ms, read.simulated.seed) == (10.0, 0)
    assert read.timing == Timing(settle_ms=60.0, drop_frames=0, timeout_s=2.0, retries=3)
    assert read.facts == {
        "projector_kind": "simulated",
        "projector_latency_ms": 20.0,
        "camera_kind": "simulated",
        "scene": "cylinder",
        "rig": "paper",
        "seed": 0,
    }


def test_every_key(tmp_path: Path) -> None:
    text = GOOD.replace(
        '[camera]\nkind = "simulated"', '[camera]\nkind = "simulated"\nexposure_ms = 7'
    )
    text = text.replace("[camera]", "latency_ms = 45.0\n[camera]")
    text += "seed = 5\n[timing]\nsettle_ms = 90\ntimeout_s = 0.5\nretries = 0\n"
    read = station(tmp_path, text)
    assert read.simulated is not None
    assert read.projector == SimulatedProjectorSettings(latency_ms=45.0)
    assert (read.exposure_ms, read.simulated.seed) == (7.0, 5)
    assert read.timing == Timing(settle_ms=90.0, timeout_s=0.5, retries=0)


def test_real_devices(tmp_path: Path) -> None:
    text = f'format = "fringeworks-station/1"\n{REAL}[sensor]\ngain = 0.5\nread_noise = 1.0\n'
    read = station(tmp_path, text)
    assert read.projector == WindowSettings(display=1)
    assert read.camera == GenicamSettings(exposure_ms=20.0)
    assert read.exposure_ms == 20.0
    assert read.sensor.sensor(1023.0).gain == 0.5
    assert (read.simulated, read.rig, read.board) == (None, None, None)


def test_files_stand_relative_to_the_stations(tmp_path: Path) -> None:
    """Their digest is a fact: another content under the same name is another station."""
    write_rig(tmp_path / "rig.json", named_rig("paper"))
    text = GOOD.replace('"paper"', '"rig.json"')
    read = station(tmp_path, text)
    assert read.rig is not None
    assert read.rig.projector == named_rig("paper").projector
    write_rig(tmp_path / "rig.json", named_rig("warped"))
    changed = station(tmp_path, text)
    assert str(read.facts["rig"]).startswith("rig.json (sha256 ")
    assert read.facts["rig"] != changed.facts["rig"]
    assert read.facts["scene"] == changed.facts["scene"]


def test_a_scenes_meshes_are_facts_too(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    write_scene(tmp_path / "part.toml", scene_of(pyramid()))
    text = GOOD.replace('"cylinder"', '"part.toml"')
    before = station(tmp_path, text).facts["scene"]
    mesh = pyramid()
    write_mesh(tmp_path / "part_1.ply", replace(mesh, vertices=2 * mesh.vertices))
    assert station(tmp_path, text).facts["scene"] != before


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[camera]",
            "latency_ms = 60.5\n[camera]",
            "settle_ms must be at least projector.latency_ms, 60.5, got 60",
        ),
        ('[camera]\nkind = "simulated"', '[camera]\nkind = "genicam"', "both be 'simulated' or"),
        ('[projector]\nkind = "simulated"', '[projector]\nkind = "window"', "got 'window' and"),
        (DEVICES, REAL, "simulated belongs to simulated devices"),
        (
            '[camera]\nkind = "simulated"',
            '[camera]\nkind = "eye"',
            "kind must be one of simulated, genicam, gentl, opencv, folder, plugin, got 'eye'",
        ),
        ('[camera]\nkind = "simulated"\n', "", "camera is missing"),
        (DEVICES, 'camera = 3\n[projector]\nkind = "simulated"\n', "camera must be a table"),
        ('kind = "simulated"\n[sim', 'kind = "simulated"\nexposure_ms = 1e-4\n[sim', ">= 0.001"),
        ('rig = "paper"', f'rig = "paper"\nseed = {10**4000}', "seed must be <= 922"),
        ('"cylinder"', r'"a\u0000.toml"', "cannot be read"),
        ('"paper"', r'"a\u0000.json"', "cannot be read"),
        ('rig = "paper"', 'rig = "paper"\nsensor = "a\\u0000"', "cannot be read"),
        ('scene = "cylinder"\n', "", "simulated.scene is missing"),
        ('"cylinder"', '"cylindre"', r"station\.toml: scene must be a file or one of"),
        ('"paper"', '"papper"', "rig must be a file or one of paper"),
        ('"cylinder"', '"none.toml"', "none.toml: cannot be read"),
        ('rig = "paper"', 'rig = "paper"\nsensor = "none.toml"', "none.toml: cannot be read"),
        ('rig = "paper"', 'rig = "paper"\nsede = 1', "unknown key 'simulated.sede'"),
        ('rig = "paper"', 'rig = "paper"\n[timing]\nretries = -1', "timing.retries must be >= 0"),
        ('rig = "paper"', 'rig = "paper"\n[timing]\ntimeout_s = 0', "timing.timeout_s must be > 0"),
        ("station/1", "station/2", "format must be 'fringeworks-station/1'"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(FormatError, match=message):
        station(tmp_path, GOOD.replace(old, new))


def test_the_stations_of_the_docs_are_read(tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.json", named_rig("paper"))
    docs = Path(__file__).parents[2] / "docs"
    blocks = [
        block
        for page in ("devices.md", "formats.md")
        for block in re.findall(r"```toml\n(.*?)```", (docs / page).read_text(), re.DOTALL)
        if "fringeworks-station/1" in block
    ]
    assert len(blocks) >= 5
    for block in blocks:
        station(tmp_path, block)


def test_a_folders_path_is_relative_to_the_stations(tmp_path: Path) -> None:
    text = f'format = "fringeworks-station/1"\n{REAL}'.replace('"genicam"', '"folder"\npath = "in"')
    read = station(tmp_path, text)
    assert read.camera == FolderSettings(str(tmp_path / "in"), exposure_ms=20.0)
    assert read.facts["camera_path"] == "in"
    producer = text.replace('"folder"\npath = "in"', '"gentl"\nproducer = "/opt/a.cti"')
    assert station(tmp_path, producer).camera == GenTLSettings("/opt/a.cti", exposure_ms=20.0)


def test_a_plug_ins_options(tmp_path: Path) -> None:
    text = f'format = "fringeworks-station/1"\n{REAL}'
    plugin = text.replace('"genicam"', '"plugin"\nname = "eye"')
    assert station(tmp_path, plugin).camera == PluginSettings("eye", {}, 20.0)
    given = plugin.replace('"eye"', '"eye"\noptions = { a = 1 }')
    assert station(tmp_path, given).camera == PluginSettings("eye", {"a": 1}, 20.0)
