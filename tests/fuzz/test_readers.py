"""Spoilt files of every kind: read, or refused by an error of ours; `make fuzz` has more."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError
from fringeworks.files.validation import read_json, read_toml
from tests.fuzz.mutate import CHANGES, MOST_BYTES
from tests.fuzz.readers import READERS
from tests.fuzz.wrapping import crc32c

EXAMPLES = 40


@pytest.mark.parametrize("name", READERS)
def test_spoilt_files(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    target = READERS[name]
    if target.needs is not None:
        pytest.importorskip(target.needs)
    folder = tmp_path_factory.mktemp("fuzz") / "in"
    folder.mkdir()
    seeds = target.prepare(folder)

    @settings(max_examples=EXAMPLES, database=None)
    @given(seed=st.integers(0, 2**32 - 1))
    def spoil(seed: int) -> None:
        target.spoil_and_read(folder, seeds, Random(seed))

    spoil()


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_a_seed_tells_the_change(change: object) -> None:
    assert callable(change)
    content = b'a = 1.5\nb = "text"\n' * 20
    one, other = (change(content, Random(7)) for _ in range(2))
    assert one == other
    assert len(change(content, Random(8))) <= 2 * MOST_BYTES


def test_the_checksum_of_e57() -> None:
    assert crc32c(b"123456789") == 0xE3069283  # its check value


# What fuzzing has found.


@pytest.mark.parametrize("text", ['"' + '\\"' * 100_000, "'" * 100_001, '"a' * 100_001])
def test_quotes_without_an_end_take_no_time(tmp_path: Path, text: str) -> None:
    """Each was tried anew as the start of a text: with the square of their number."""
    (tmp_path / "a.toml").write_text(f"a = {text}")
    with pytest.raises(FormatError, match="not valid TOML"):
        read_toml(tmp_path / "a.toml")


def test_a_dotted_key_behind_quotes_is_found(tmp_path: Path) -> None:
    """Inside a longer text quotes need no partner: what follows it on the line is a key yet."""
    (tmp_path / "a.toml").write_text('a = {b = """ " """, ' + "c." * 200 + "d = 1}\n")
    with pytest.raises(FormatError, match="at most 100 parts"):
        read_toml(tmp_path / "a.toml")


def test_a_capture_of_endless_sets(tmp_path: Path) -> None:
    """Each was held against all before it, with the square of their number."""
    set_of_one = '[[set]]\nkind = "uniform"\nlevel = 1.0\nimages = ["a.png"]\n'
    head = 'format = "fringeworks-capture/1"\n[projector]\nwidth = 32\nheight = 24\n'
    (tmp_path / "capture.toml").write_text(head + set_of_one * 5000)
    with pytest.raises(FormatError, match="set must hold at most 1000 entries"):
        READERS["capture"].read(tmp_path / "capture.toml")


def test_a_key_that_stands_twice_is_found_at_once(tmp_path: Path) -> None:
    """It was looked for by counting each: with the square of their number."""
    keys = ", ".join(f'"{number}": 0' for number in range(200_000))
    (tmp_path / "a.json").write_text(f'{{{keys}, "199999": 1}}')
    with pytest.raises(FormatError, match="'199999' stands twice"):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("name", "head", "deep"),
    [
        ("yml", b"%YAML:1.0\n---\na: ", b"["),
        ("yml", b"%YAML:1.0\n---\na: ", b"{a:"),
        ("yml", b"%YAML:1.0\n---\na: ", b"- "),
        ("xml", b"<?xml version='1.0'?><opencv_storage>", b"<a>"),
    ],
)
def test_brackets_within_brackets(tmp_path: Path, name: str, head: bytes, deep: bytes) -> None:
    """OpenCV's parser ended the process, out of stack."""
    path = tmp_path / READERS[name].file
    path.write_bytes(head + deep * 1_000_000)
    with pytest.raises(FormatError, match=r"at most 20000 brackets, tags and lists, got 10000"):
        READERS[name].read(path)
    path.write_bytes(head + deep * 19_000)  # the parser still has the stack for these
    with pytest.raises(FormatError):
        READERS[name].read(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("board", b"k" * 100_000 + b" = 1\n"),
        ("capture", b"k" * 100_000 + b" = 1\nk = 2\n"),
        ("rig", b'{"format": "fringeworks-rig/1", "' + b"k" * 100_000 + b'": 1}'),
        ("yml", b"%YAML:1.0\n---\n" + b"k" * 3000 + b": 1\n" + b"m" * 3000 + b": 1\n"),
    ],
)
def test_messages_do_not_repeat_the_file(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / READERS[name].file
    path.write_bytes(content)
    with pytest.raises(FormatError) as caught:
        READERS[name].read(path)
    assert len(str(caught.value)) < 2000
