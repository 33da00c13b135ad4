"""``acquire`` as a process of its own, before whatever may end it half way."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.files import read_capture, read_image
from fringeworks.files.acquiring import ACQUIRING_JSON
from tests.devices.lightcrafter_emulator import Board, emulate
from tests.devices.screens import open_screens

MODULE = '''
"""A camera that fails as its surroundings tell; it notes that it was let go."""
import os
import time

import numpy as np

from fringeworks.devices import Grab
from fringeworks.errors import DeviceError
from fringeworks.model import Sensor


class Eye:
    name, width, height, sensor = "eye", 160, 120, Sensor(255.0)

    def __init__(self, *, let_go):
        self.let_go, self.count = let_go, 0
        self.rng = np.random.default_rng(0)

    def grab(self, *, exposure_ms, timeout_s):
        self.count += 1
        if self.count == int(os.environ.get("GONE_AT", -1)):
            raise DeviceError("the camera was unplugged")
        start_s = time.monotonic()
        time.sleep(exposure_ms / 1000)
        image = np.full((120, 160), 100, np.uint8)
        if self.count >= int(os.environ.get("BUSY_FROM", 10**6)):
            image = self.rng.integers(0, 255, (120, 160), dtype=np.uint8)
        return Grab(self.count, start_s, lambda: image)

    def close(self):
        with open(self.let_go, "a") as file:
            file.write("let go\\n")
'''

PRESET = ("acquire", "measure", "--axes", "x", "--steps", "3")
LIMIT_BYTES = 12_000
"""A plain image and the journal are shorter, an image of noise is longer."""

POINTER_PX = 200

STATION = """
format = "fringeworks-station/1"
[projector]
{projector}
[camera]
kind = "plugin"
name = "eye"
exposure_ms = 5.0
options = {{let_go = "{let_go}"}}
[timing]
settle_ms = 10.0
timeout_s = 1.0
"""


@dataclass
class Place:
    """A folder with a station, and the process that acquires there."""

    folder: Path
    environment: dict[str, str]

    @property
    def out(self) -> Path:
        return self.folder / "capture"

    @property
    def let_go(self) -> int:
        path = self.folder / "let_go"
        return len(path.read_text().splitlines()) if path.exists() else 0

    def taken(self) -> list[str]:
        return sorted(path.name for path in self.out.glob("[!.]*.png"))

    def acquire(
        self,
        *,
        until: Callable[[], bool] | None = None,
        send: int = 0,
        limited: bool = False,
        **environment: object,
    ) -> tuple[int, str]:
        """Exit status and what it said on standard error; `send` a signal once `until` holds."""
        command = [sys.executable, "-m", "fringeworks", *PRESET]
        told = {key: str(value) for key, value in environment.items()}
        process = subprocess.Popen(
            [*command, "--station", str(self.folder / "station.toml"), "--out", str(self.out)],
            env={**self.environment, **told},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=limit_files if limited else None,
        )
        try:
            while until is not None and not until() and process.poll() is None:
                time.sleep(0.005)
            if send:
                process.send_signal(send)
            said = process.communicate(timeout=30)[1]
        finally:
            process.kill()
        return process.returncode, said


def limit_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT_BYTES, LIMIT_BYTES))


def make_place(folder: Path, *, projector: str) -> Place:
    metadata = folder / "site" / "eye-1.0.dist-info"
    metadata.mkdir(parents=True)
    (folder / "site" / "eye.py").write_text(MODULE)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: eye\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[fringeworks.cameras]\neye = eye:Eye\n")
    text = STATION.format(projector=projector, let_go=(folder / "let_go").as_posix())
    (folder / "station.toml").write_text(text)
    paths = [str(folder / "site"), os.environ.get("PYTHONPATH", "")]
    return Place(folder, {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))})


def assert_unfinished(place: Place, *, said: str, status: tuple[int, int]) -> None:
    """Nothing is half there; images, journal and what was said agree.

    The last image may have been written but not noted: it is taken again.
    """
    assert status[0] == status[1], said
    left: dict[str, Any] = json.loads((place.out / ACQUIRING_JSON).read_text())
    assert len(place.taken()) - len(left["images"]) in (0, 1)
    assert set(left["images"]) <= set(place.taken())
    assert {path.name for path in place.out.iterdir()} == {*place.taken(), ACQUIRING_JSON}
    assert all(read_image(place.out / name).shape == (120, 160) for name in place.taken())
    assert "goes on from" in said
    following = [word for word in said.replace(":", " ").split() if word.endswith(".png")]
    assert following
    assert not set(following) & set(left["images"])
    assert "Traceback" not in said


def test_whatever_ends_it_half_way_it_goes_on(tmp_path: Path) -> None:
    """Ctrl-C, SIGTERM, the camera gone, the disk full, the projector's line broken, in turn."""
    with emulate() as (board, port):
        projector = f'kind = "lightcrafter"\nhost = "127.0.0.1"\nport = {port}'
        place = make_place(tmp_path, projector=projector)

        def more(count: int) -> Callable[[], bool]:
            least = len(place.taken()) + count
            return lambda: len(place.taken()) >= least and bool(board.shown.any())

        ways: list[tuple[int, dict[str, Any]]] = [
            (130, {"until": more(2), "send": signal.SIGINT}),
            (143, {"until": more(4), "send": signal.SIGTERM}),
            (3, {"GONE_AT": 3}),
            (1, {"BUSY_FROM": 2, "limited": True}),
        ]
        for expected, way in ways:
            before = len(place.taken())
            status, said = place.acquire(**way)
            assert_unfinished(place, said=said, status=(status, expected))
            assert len(place.taken()) > before
            assert not board.shown.any()
        hung_up = hang_up_at_the_next_image(board)
        status, said = place.acquire()
        assert_unfinished(place, said=said, status=(status, 3))
        assert "it hung up" in said
        assert hung_up()
        assert not board.shown.any()
        assert place.acquire()[0] == 0
        assert place.let_go == len(ways) + 2
        assert not board.shown.any()
    capture = read_capture(place.out)
    assert len(capture.provenance["resumed_at"]) == len(ways) + 1
    assert not (place.out / ACQUIRING_JSON).exists()


def hang_up_at_the_next_image(board: Board) -> Callable[[], bool]:
    command = 0x0105
    board.faults.hang_up.add(command)
    return lambda: command not in board.faults.hang_up


def test_a_window_is_dark_after_it(tmp_path: Path) -> None:
    pytest.importorskip("pygame")
    with open_screens((192, 128)) as screens:
        place = make_place(tmp_path, projector='kind = "window"\nwidth = 192')
        place.environment |= {"DISPLAY": screens.display, "SDL_VIDEODRIVER": "x11"}
        status, said = place.acquire(
            until=lambda: len(place.taken()) > 2 and bool(screens.shot().any()),
            send=signal.SIGTERM,
        )
        assert_unfinished(place, said=said, status=(status, 143))

        # The pointer of the X server itself has come back.
        assert np.count_nonzero(screens.shot().any(axis=2)) < POINTER_PX
        assert place.let_go == 1
