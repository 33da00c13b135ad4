"""An acquisition goes on where it stopped, if it is the same."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.acquire import Timing, count_taken, journal
from fringeworks.acquire.lock import LOCK
from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_capture, read_image, write_image
from fringeworks.files.acquiring import ACQUIRING_JSON
from fringeworks.model import Fringe, PatternSet, Sequence
from tests.acquire.benches import (
    NAMES,
    SEQUENCE,
    Interrupted,
    acquire,
    assert_every_image_shows_its_pattern,
    make_bench,
)
from tests.devices.stages import flat


def grabs_of_a_whole_run(folder: Path) -> int:
    done = acquire(folder)
    return done.taken + done.frames.stale


def interrupt(folder: Path, *, at: int, **options: Any) -> None:
    bench = make_bench()
    with pytest.raises(KeyboardInterrupt):
        acquire(folder, bench, camera=Interrupted(bench[0].camera, at=at), **options)


def test_an_interruption_at_any_grab_is_made_good(tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    count = grabs_of_a_whole_run(whole)
    for at in range(count):
        folder = tmp_path / str(at)
        interrupt(folder, at=at)
        taken = [path.name for path in folder.glob("*.png")]
        assert set(taken) == set(NAMES[: len(taken)])
        assert count_taken(folder) == len(taken)
        assert not (folder / "capture.toml").exists()
        done = acquire(folder)
        assert done.taken == len(NAMES) - len(taken)
        for name in NAMES:
            assert np.array_equal(read_image(folder / name), read_image(whole / name))
        assert {path.name for path in folder.iterdir()} == {*NAMES, "capture.toml"}


class Killed(BaseException):
    """Nothing catches it."""


@pytest.mark.parametrize("write", ["write_image", "write_acquiring", "write_text"])
@pytest.mark.parametrize("after", [False, True])
def test_a_kill_at_any_write_is_made_good(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: str, after: bool
) -> None:
    """Before or after each of its writes: image, journal, capture.toml."""
    real = getattr(journal, write)
    at = -1
    while True:
        at += 1
        calls = iter(range(10_000))

        def fatal(*arguments: Any, at: int = at, calls: Any = calls) -> None:
            deadly = next(calls) == at
            if not deadly or after:
                real(*arguments)
            if deadly:
                raise Killed

        folder = tmp_path / str(at)
        with monkeypatch.context() as patch:
            patch.setattr(journal, write, fatal)
            try:
                acquire(folder)
                break
            except Killed:
                pass
        acquire(folder)
        assert_every_image_shows_its_pattern(folder)
        assert not (folder / ACQUIRING_JSON).exists()
        assert read_capture(folder).sequence.sets[0].pattern == SEQUENCE.sets[0].pattern
    assert at == {"write_image": 10, "write_acquiring": 11, "write_text": 1}[write]


def test_times_go_on_and_the_pause_is_named(tmp_path: Path) -> None:
    interrupt(tmp_path, at=12)
    taken = count_taken(tmp_path)
    acquire(tmp_path)
    capture = read_capture(tmp_path)
    times = [time for item in capture.sequence.sets for time in item.timestamps_s or ()]
    assert (np.diff(times) > 0).all()
    assert capture.provenance["resumed_at"] == [NAMES[taken]]


def test_counts_are_those_of_all_runs(tmp_path: Path) -> None:
    """An interrupted run's frames since its last image are not on disk and not counted."""
    interrupt(tmp_path, at=12)
    first = json.loads((tmp_path / ACQUIRING_JSON).read_text())["frames"]["stale"]
    done = acquire(tmp_path)
    assert first > 0
    assert done.frames.stale > first
    assert read_capture(tmp_path).provenance["frames"]["stale"] == done.frames.stale


WHITE_BY_8_MS = replace(SEQUENCE.sets[2], exposure_ms=8.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"exposure_ms": 12.0}, "exposure_ms was 10.0, is 12.0"),
        ({"timing": Timing(settle_ms=80.0)}, "settle_ms was 60.0, is 80.0"),
        ({"facts": {"scene": "two"}}, "scene was wall, is two"),
        ({"facts": {}}, "scene was wall, is not given"),
        (
            {"sequence": replace(SEQUENCE, sets=(*SEQUENCE.sets[:2], WHITE_BY_8_MS))},
            "its sequence had 'exposure_ms = 5.0', has 'exposure_ms = 8.0'",
        ),
        (
            {"sequence": replace(SEQUENCE, sets=SEQUENCE.sets[:3])},
            r"its sequence had .*, has 'no more'",
        ),
    ],
)
def test_another_acquisition_does_not_go_on(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    interrupt(tmp_path, at=12, facts={"scene": "wall"})
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(UsageError, match=message) as caught:
        acquire(tmp_path, **{"facts": {"scene": "wall"}, **change})
    assert "--overwrite" in str(caught.value)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_patience_may_change(tmp_path: Path) -> None:
    interrupt(tmp_path, at=12)
    taken = count_taken(tmp_path)
    done = acquire(tmp_path, timing=Timing(timeout_s=5.0, retries=9))
    assert done.taken == len(NAMES) - taken


def test_an_image_that_was_changed_since_is_taken_again(tmp_path: Path) -> None:
    interrupt(tmp_path, at=12)
    taken = count_taken(tmp_path)
    assert taken > 2
    write_image(tmp_path / NAMES[0], flat(7))
    (tmp_path / NAMES[1]).unlink()
    assert count_taken(tmp_path) == taken - 2
    assert acquire(tmp_path).taken == len(NAMES) - taken + 2
    assert_every_image_shows_its_pattern(tmp_path)


def test_nothing_is_replaced_unasked(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    with pytest.raises(UsageError, match=r"holds 1 files already \(first: notes.txt\)"):
        acquire(tmp_path)
    acquire(tmp_path, overwrite=True)
    with pytest.raises(UsageError, match="holds a capture already"):
        acquire(tmp_path)
    with pytest.raises(UsageError, match="must be a folder, but is a file"):
        acquire(tmp_path / "notes.txt")


def test_overwriting_begins_anew(tmp_path: Path) -> None:
    """The old description goes first; the images of an unfinished run count for nothing."""
    acquire(tmp_path)
    interrupt(tmp_path, at=12, overwrite=True)
    assert not (tmp_path / "capture.toml").exists()
    assert 0 < count_taken(tmp_path) < len(NAMES)
    assert acquire(tmp_path, overwrite=True).taken == len(NAMES)


@pytest.mark.parametrize("text", ["", "[]", '{"format": "fringeworks-acquiring/1"}', "{"])
def test_a_damaged_journal_says_so(tmp_path: Path, text: str) -> None:
    (tmp_path / ACQUIRING_JSON).write_text(text)
    with pytest.raises(FormatError, match=r"\.acquiring\.json"):
        acquire(tmp_path)
    assert acquire(tmp_path, overwrite=True).taken == len(NAMES)


def test_a_capture_says_how_it_was_taken(tmp_path: Path) -> None:
    bench = make_bench()
    done = acquire(tmp_path, bench, facts={"scene": "wall", "seed": 3})
    capture = read_capture(tmp_path)
    assert done.path == tmp_path / "capture.toml"
    assert capture.sensor == bench[0].camera.sensor
    untimed = tuple(replace(item, timestamps_s=None) for item in capture.sequence.sets)
    assert replace(capture.sequence, sets=untimed) == SEQUENCE
    assert capture.provenance["acquired"].startswith("fringeworks ")
    assert capture.provenance["exposure_ms"] == 10.0
    assert (capture.provenance["scene"], capture.provenance["seed"]) == ("wall", 3)
    assert "resumed_at" not in capture.provenance


def test_what_cannot_be_shown_is_wrong_use(tmp_path: Path) -> None:
    wide = Sequence(48, 16, (PatternSet(Fringe("x", 8.0, (0.0, 2.0, 4.0))),))
    with pytest.raises(UsageError, match="projector's size, 24x16 px, got 48x16 px"):
        acquire(tmp_path, sequence=wide)
    with pytest.raises(UsageError, match=r"timeout_s must be above 0\.02, two exposures"):
        acquire(tmp_path, timing=Timing(timeout_s=0.02))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("held", "who"), [(None, "process"), ("", "another process")])
def test_one_acquisition_at_a_time(tmp_path: Path, held: str | None, who: str) -> None:
    """The lock names a process that lives, this one, or none that could be asked for."""
    (tmp_path / LOCK).write_text(str(os.getpid()) if held is None else held)
    with pytest.raises(UsageError, match=rf"{who} .*acquires into it; .* remove .*{LOCK}"):
        acquire(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]


@pytest.mark.skipif(os.name != "posix", reason="elsewhere no process can be asked whether it lives")
def test_what_a_dead_process_locked_is_taken_over(tmp_path: Path) -> None:
    gone = subprocess.check_output([sys.executable, "-c", "import os; print(os.getpid())"])
    (tmp_path / LOCK).write_bytes(gone)
    assert acquire(tmp_path).taken == len(NAMES)
    assert not (tmp_path / LOCK).exists()


def test_an_interrupted_run_unlocks(tmp_path: Path) -> None:
    interrupt(tmp_path, at=12)
    assert not (tmp_path / LOCK).exists()


def with_image(text: str, name: str) -> str:
    """A journal that claims an image of one byte more."""
    document = json.loads(text)
    document["images"][name] = {"sha256": hashlib.sha256(b"x").hexdigest(), "time_s": 1e9}
    return json.dumps(document)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda _: "[" * 100_000, "too deeply nested; begin anew"),
        (lambda text: with_image(text, "a\0.png"), "must be a name"),
        (lambda text: with_image(text, "/dev/zero"), "leaves the acquisition's folder"),
    ],
)
def test_a_hostile_journal(tmp_path: Path, spoil: Callable[[str], str], message: str) -> None:
    interrupt(tmp_path, at=12)
    taken = tmp_path / ACQUIRING_JSON
    taken.write_text(spoil(taken.read_text()))
    with pytest.raises(FormatError, match=message):
        acquire(tmp_path)
    with pytest.raises(FormatError, match=message):
        count_taken(tmp_path)


def test_images_that_are_not_planned_count_for_nothing(tmp_path: Path) -> None:
    """Times go on after the last one of the sequence's own."""
    interrupt(tmp_path, at=12)
    taken = tmp_path / ACQUIRING_JSON
    taken.write_text(with_image(taken.read_text(), "other.png"))
    (tmp_path / "other.png").write_bytes(b"x")
    acquire(tmp_path)
    sets = read_capture(tmp_path).sequence.sets
    assert max(time for item in sets for time in item.timestamps_s or ()) < 1e6
