from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.scenes import run, see, write_plane_scan


@pytest.fixture(scope="session")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small capture of the preset measure, decodable everywhere."""
    folder = tmp_path_factory.mktemp("seen")
    done = run("patterns", "measure", "--projector", "128x96", "--out", folder / "patterns")
    assert done.exit_code == 0, done.stderr
    see(folder / "patterns", folder / "capture")
    return folder / "capture"


@pytest.fixture(scope="session")
def plane_scan(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Capture folder and rig.json of a plane."""
    return write_plane_scan(tmp_path_factory.mktemp("plane"))
