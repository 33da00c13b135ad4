"""A small simulated station before a tilted wall: the paper's rig with an eighth of its pixels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fringeworks.files import write_rig, write_sensor
from fringeworks.model import Camera, Sequence
from fringeworks.patterns import make_sequence
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import paper_rig

PATTERNS = ("--preset", "measure", "--steps", "3", "--periods", "38")


def write_station(folder: Path) -> Path:
    rig = paper_rig()
    lens = replace(rig.camera.lens, fx=247.0, fy=247.0, cx=46.5, cy=29.5)
    write_rig(folder / "rig.json", replace(rig, camera=Camera(94, 60, lens)))
    write_sensor(folder / "sensor.toml", Effects(samples=1))
    path = folder / "station.toml"
    path.write_text(
        'format = "fringeworks-station/1"\n[projector]\nkind = "simulated"\n'
        '[camera]\nkind = "simulated"\n'
        '[simulated]\nscene = "wall"\nrig = "rig.json"\nsensor = "sensor.toml"\n'
    )
    return path


def make_patterns(width: int, height: int) -> Sequence:
    return make_sequence(
        "measure", width=width, height=height, axes=("x",), steps=3, periods_px=(38.0,)
    )
