"""The command as a whole: what it lists, how fast it answers, how it ends."""

from __future__ import annotations

import subprocess
import sys
from typing import get_args

import pytest

from fringeworks import __version__
from fringeworks.cli import sequences
from fringeworks.patterns import PRESETS, Code
from tests.cli.scenes import plain, run

VERBS = (
    "patterns",
    "devices",
    "preview",
    "acquire",
    "twin",
    "board",
    "calibrate",
    "verify",
    "import",
    "export",
    "check",
    "response",
    "decode",
    "scan",
    "convert",
    "frame",
    "merge",
    "measure",
    "compare",
    "change",
    "accept",
    "budget",
    "demo",
    "reproduce",
    "bench",
)
FRAME = VERBS.index("frame")
HEAVY = ("numpy", "scipy", "numba", "cv2", "matplotlib", "rich.progress")


def python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout


def test_help_lists_the_verbs_that_exist_and_no_other() -> None:
    done = run("--help")
    assert done.exit_code == 0
    listed = [line.split()[0] for line in done.stdout.splitlines() if line.startswith("  ")]
    assert [word for word in listed if word in VERBS] == list(VERBS)


@pytest.mark.parametrize(
    "verb",
    [*VERBS[:FRAME], "frame board", "merge", "measure plane", *VERBS[FRAME + 3 :]],
)
def test_every_verb_has_help_with_an_example(verb: str) -> None:
    done = run(*verb.split(), "--help")
    assert done.exit_code == 0
    assert f"Example: fringeworks {verb}" in plain(done.stdout)
    assert "--json" in done.stdout


@pytest.mark.parametrize("arguments", [["--help"], ["decode", "--help"], ["--version"]])
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    """This is why it answers at once; seconds are not gated, they depend on the machine."""
    loaded = python(
        "import sys\n"
        "from fringeworks.cli.app import app\n"
        f"try: app({arguments!r})\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        f"print('LOADED', [name for name in {HEAVY!r} if name in sys.modules])"
    )
    assert loaded.splitlines()[-1] == "LOADED []"


def test_version_as_a_module() -> None:
    command = [sys.executable, "-m", "fringeworks", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, f"fringeworks {__version__}\n")


def test_choices_are_those_of_the_package() -> None:
    """They are written out in the command so that its help need not import the package."""
    assert set(get_args(sequences.Preset)) == set(PRESETS)
    assert get_args(sequences.Code) == get_args(Code)


@pytest.mark.parametrize(
    "arguments", [["nonsense"], ["decode"], ["decode", "x"], ["scan", "x", "--frobnicate"]]
)
def test_wrong_use_ends_with_2(arguments: list[str]) -> None:
    done = run(*arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert "Error" in done.stderr


def test_an_error_is_one_line_on_standard_error() -> None:
    done = run("decode", "/no/such/capture", "--out", "phase.npz")
    assert (done.exit_code, done.stdout) == (1, "")
    assert done.stderr == "error: /no/such/capture: no such file or folder\n"


def test_an_interruption_ends_with_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("fringeworks.files.read_capture", interrupt)
    done = run("decode", "capture", "--out", "phase.npz")
    assert (done.exit_code, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_a_bug_shows_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("fringeworks.files.read_capture", fail)
    done = run("decode", "capture", "--out", "phase.npz")
    assert done.exit_code == 1
    assert isinstance(done.exception, ZeroDivisionError)
