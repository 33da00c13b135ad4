from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from fringeworks.errors import FormatError
from fringeworks.files.atomic import STALE_S, replacing


def test_success_replaces_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "rig.json"
    target.write_text("old")
    with replacing(target) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".json"
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_failure_keeps_the_old_file_and_leaves_nothing_behind(tmp_path: Path) -> None:
    target = tmp_path / "rig.json"
    target.write_text("old")

    def write_half() -> None:
        with replacing(target) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_link_stays_and_what_it_points_to_is_replaced(tmp_path: Path) -> None:
    target, link = tmp_path / "store" / "rig.json", tmp_path / "rig.json"
    target.parent.mkdir()
    target.write_text("old")
    try:
        link.symlink_to(target)
    except OSError:
        pytest.skip("this system makes no symbolic links for us")
    with replacing(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert target.read_text() == "new"


@pytest.mark.parametrize("name", ["r" * 240 + ".json", "r." + "j" * 240])
def test_the_longest_names(tmp_path: Path, name: str) -> None:
    with replacing(tmp_path / name) as temporary:
        temporary.write_text("new")
    assert (tmp_path / name).read_text() == "new"


def test_what_a_killed_writer_left_goes_when_it_is_a_day_old(tmp_path: Path) -> None:
    old, new = (tmp_path / f".fringeworks-{digit * 32}.png" for digit in "ab")
    other = tmp_path / ".fringeworks-mine.png"
    for path in (old, new, other):
        path.write_text("half")
    for path, age in ((old, STALE_S + 60), (new, STALE_S - 60), (other, 2 * STALE_S)):
        os.utime(path, (time.time() - age,) * 2)
    with replacing(tmp_path / "rig.json") as temporary:
        temporary.write_text("new")
    assert set(tmp_path.iterdir()) == {new, other, tmp_path / "rig.json"}


def test_parents_are_made(tmp_path: Path) -> None:
    target = tmp_path / "out" / "demo" / "rig.json"
    with replacing(target) as temporary:
        temporary.write_text("new")
    assert target.read_text() == "new"


def test_a_target_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    target = tmp_path / "taken"
    (target / "inside").mkdir(parents=True)
    with (
        pytest.raises(FormatError, match=r"taken: cannot be written \(.+\)"),
        replacing(target) as temporary,
    ):
        temporary.write_text("new")
    assert list(tmp_path.iterdir()) == [target]


def test_a_file_where_a_folder_should_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    target = tmp_path / "file" / "rig.json"
    with pytest.raises(FormatError, match="cannot be written"), replacing(target) as temporary:
        temporary.write_text("new")
