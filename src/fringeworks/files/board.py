"""Read and write ``board.toml``: the calibration board."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from fringeworks.errors import FormatError
from fringeworks.files.atomic import write_text
from fringeworks.files.nouns import describe_noun
from fringeworks.files.toml import lay_out_toml
from fringeworks.files.validation import Table, read_toml, shorten, validated
from fringeworks.model.board import CheckerboardTarget

PLANNED_KINDS = ("charuco", "circles")

MIN_PITCH_MM, MAX_PITCH_MM = 0.1, 10_000.0

Corners = Annotated[int, Field(ge=3, le=1000)]


class CheckerboardFile(Table):
    """``board.toml`` of a printed checkerboard: inner corners, pitch in mm."""

    kind: Literal["checkerboard"]
    columns: Corners
    rows: Corners
    square_mm: float | None = None
    pitch_x_mm: float | None = None
    pitch_y_mm: float | None = None
    pitch_sigma_mm: Annotated[float, Field(ge=0)] | None = None
    cte_per_k: Annotated[float, Field(ge=-1e-2, le=1e-2)] | None = None
    temperature_c: Annotated[float, Field(ge=-273.15)] | None = None


def read_board(path: str | Path) -> CheckerboardTarget:
    """The board that ``board.toml`` describes; lengths in mm.

    Raises
    ------
    FormatError
        Not TOML, a key missing, unknown or out of bounds, or a kind that is not supported yet.
    """
    path = Path(path)
    return _parse(read_toml(path), path)


def write_board(path: str | Path, target: CheckerboardTarget) -> None:
    """Write ``board.toml``, atomic; it reads back as it is.

    Raises
    ------
    UsageError
        A board that `read_board` would refuse.
    FormatError
        The file cannot be written.
    """
    path = Path(path)
    keys = {"kind": "checkerboard", **describe_noun(target)}
    if target.pitch_x_mm == target.pitch_y_mm:
        keys["square_mm"] = keys.pop("pitch_x_mm")
        del keys["pitch_y_mm"]
    write_text(path, lay_out_toml(keys, lambda again: _parse(again, path), what="board"))


def _parse(document: dict[str, Any], path: Path) -> CheckerboardTarget:
    _check_kind(document, path)
    board = validated(CheckerboardFile, document, path)
    pitch_x, pitch_y = _pitch(board, path)
    return CheckerboardTarget(
        columns=board.columns,
        rows=board.rows,
        pitch_x_mm=pitch_x,
        pitch_y_mm=pitch_y,
        pitch_sigma_mm=board.pitch_sigma_mm,
        cte_per_k=board.cte_per_k,
        temperature_c=board.temperature_c,
    )


def _check_kind(document: dict[str, Any], path: Path) -> None:
    kind = document.get("kind")
    if kind in PLANNED_KINDS:
        raise FormatError(f"{path}: kind '{kind}' is planned, not supported yet; use checkerboard")
    if kind is not None and kind != "checkerboard":
        raise FormatError(f"{path}: kind must be 'checkerboard', got {shorten(kind)}")


def _pitch(board: CheckerboardFile, path: Path) -> tuple[float, float]:
    for key in ("square_mm", "pitch_x_mm", "pitch_y_mm"):
        value = getattr(board, key)
        if value is not None and not MIN_PITCH_MM <= value <= MAX_PITCH_MM:
            hint = "; is it in metres?" if 0 < value < MIN_PITCH_MM else ""
            raise FormatError(
                f"{path}: {key} must be {MIN_PITCH_MM:g} to {MAX_PITCH_MM:g}, got {value:g}{hint}"
            )
    both = (board.pitch_x_mm, board.pitch_y_mm)
    if board.square_mm is not None and both == (None, None):
        return board.square_mm, board.square_mm
    if board.square_mm is None and board.pitch_x_mm is not None and board.pitch_y_mm is not None:
        return board.pitch_x_mm, board.pitch_y_mm
    raise FormatError(f"{path}: give either square_mm, or both pitch_x_mm and pitch_y_mm")
