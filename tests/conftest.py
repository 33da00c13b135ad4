"""What every test may ask for: the real captures, and a still, deterministic surrounding."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import pytest
from hypothesis import settings

from fringeworks.files import data_folder, find_data
from tests.browser import NAMES, Browser, find_program

IN_CI = os.environ.get("CI", "").lower() == "true"

mpl.use("Agg")
# A first call compiles, so a deadline would measure numba. In CI the examples do not vary.
settings.register_profile("fringeworks", deadline=None, derandomize=IN_CI, print_blob=True)
settings.load_profile("fringeworks")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real captures; it need not exist: `real` says so where it matters."""
    return data_folder()


@pytest.fixture(scope="session")
def real(data_dir: Path) -> Callable[[str], Path]:
    """Path of a real capture by name, as `real("procam-graycode")`.

    Where it is missing the test is skipped with the reason; with CI=true it fails.
    """

    def find(name: str) -> Path:
        folder = find_data(name)
        if folder is not None:
            return folder
        reason = f"real capture {name!r} not found below {data_dir} (set FRINGEWORKS_DATA)"
        if IN_CI:
            pytest.fail(reason)
        pytest.skip(reason)

    return find


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Browser:
    """Chromium; where it is missing the test is skipped with the reason, with CI=true it fails."""
    program = find_program()
    if program is None:
        reason = f"no browser found (looked for {', '.join(NAMES)})"
        if IN_CI:
            pytest.fail(reason)
        pytest.skip(reason)
    return Browser(program, tmp_path_factory.mktemp("browser"))
