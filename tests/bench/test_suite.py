"""The suite: its groups, its keys, and the whole-process figures."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

import pytest

from fringeworks.bench import process, suite
from fringeworks.bench.metric import Metric
from fringeworks.errors import UsageError
from fringeworks.files.capture import read_capture
from fringeworks.phase.decode import decode_capture

Item = TypeVar("Item")


def test_groups_run_in_order_and_progress_sees_them(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[object] = []

    def measure(*, quick: bool) -> list[Metric]:
        return [Metric(f"one.{quick}", 1.0, "x", "higher")]

    def watch(items: Sequence[Item], description: str) -> Iterable[Item]:
        seen.extend(items)
        return items

    monkeypatch.setattr(suite, "GROUPS", {"one": measure, "two": lambda *, quick: []})
    assert suite.run_suite(quick=True, progress=watch) == [Metric("one.True", 1.0, "x", "higher")]
    assert seen == ["one", "two"]
    assert suite.run_suite(only=["two"]) == []


def test_an_unknown_group_is_refused() -> None:
    with pytest.raises(UsageError, match=r"only must name groups of .*speed.*, got 'speeed'"):
        suite.run_suite(only=["speeed"])


def test_a_command_is_timed_or_its_failure_told() -> None:
    good = process._measure("process.help", ["--help"], 1, "bar")
    assert good.value is not None
    assert good.value > 0
    bad = process._measure("process.none", ["no-such-verb"], 1, "bar")
    assert bad.value is None
    assert bad.note.startswith("skipped: it failed with: ")


def test_the_rendered_capture_decodes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(process, "SIZE", (160, 96))
    axes = decode_capture(read_capture(process._render(tmp_path / "capture"))).axes
    assert [axis.valid_share for axis in axes] == [1.0, 1.0]


def test_real_data_is_looked_for_where_the_variable_says(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("FRINGEWORKS_DATA", str(tmp_path))
    assert process.real_capture() is None
    capture = tmp_path.joinpath("real", *process.REAL)
    capture.mkdir(parents=True)
    assert process.real_capture() == capture
