"""A command that is killed leaves the old file or the new one, and can be repeated."""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

import pytest

from tests.fuzz.kills import COMMANDS, OLD, TEMPORARY, check_files, prepare

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="SIGKILL and a fork server"),
]

FEW = ("patterns", "decode", "scan", "convert", "response")
"""Those of CI; `python -m tests.fuzz --kills 20` has all, and more kills."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kills")
    prepare(folder)
    return folder


@pytest.mark.parametrize("name", FEW)
def test_before_a_change_of_the_files(folder: Path, name: str) -> None:
    command, random = COMMANDS[name], Random(name)
    target = folder / command.writes
    if target.suffix:
        target.write_bytes(OLD)
    # A file is opened once and renamed once; a folder has dozens of changes.
    places = (0, 1) if target.suffix else (0, 1, random.randrange(2, 40))
    for place in places:
        assert command.run(folder, kill_at=place) == -9
        check_files(target)
        assert not target.suffix or target.read_bytes() == OLD
    assert command.run(folder) == 0, (folder / "log.txt").read_text()
    check_files(target)
    assert not target.suffix or target.read_bytes() != OLD


def test_a_folder_whose_temporaries_stayed_is_a_capture(folder: Path) -> None:
    """After the kills above, and with one that a kill has left for certain."""
    command = COMMANDS["patterns"]
    (folder / "shown" / f"{TEMPORARY}{'0' * 32}.png").write_bytes(b"half an image")
    for place in (6, 7):
        command.run(folder, kill_at=place)
    assert any(path.name.startswith(TEMPORARY) for path in (folder / "shown").iterdir())
    assert command.run(folder) == 0
    check_files(folder / "shown")
