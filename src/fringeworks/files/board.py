"""Read and write ``board.toml``: the calibration board."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from fringeworks.errors import FormatError
from fringeworks.files.atomic import write_text
from fringeworks.files.nouns import describe_noun
from fringeworks.files.toml import lay_out_toml
from fringeworks.files.validation import Table, read_toml, shorten, suggest, validated
from fringeworks.model import CharucoTarget, CheckerboardTarget, CirclesTarget, Target, kind_of

MIN_PITCH_MM, MAX_PITCH_MM = 0.1, 10_000.0
LARGEST_SIGMA = 0.1
"""Of the pitch: nobody measures it worse, and µm taken for mm are beyond it."""

Corners = Annotated[int, Field(ge=3, le=1000)]


class GridFile(Table):
    """What every board's file has: counts of inner corners or circles, pitch in mm."""

    columns: Corners
    rows: Corners
    square_mm: float | None = None
    pitch_x_mm: float | None = None
    pitch_y_mm: float | None = None
    pitch_sigma_mm: Annotated[float, Field(ge=0)] | None = None
    cte_per_k: Annotated[float, Field(ge=-1e-2, le=1e-2)] | None = None
    temperature_c: Annotated[float, Field(ge=-273.15)] | None = None


class CheckerboardFile(GridFile):
    """``board.toml`` of a printed checkerboard."""

    kind: Literal["checkerboard"]


class CharucoFile(GridFile):
    """That of a ChArUco board; `dictionary` is one of OpenCV's."""

    kind: Literal["charuco"]
    marker_mm: Annotated[float, Field(gt=0)]
    dictionary: Annotated[str, Field(pattern="^DICT_[A-Z0-9_]+$")]


class CirclesFile(GridFile):
    """That of a symmetric grid of circles; `square_mm` is the pitch."""

    kind: Literal["circles"]
    diameter_mm: Annotated[float, Field(gt=0)]


BoardFile: TypeAlias = CheckerboardFile | CharucoFile | CirclesFile

KINDS: dict[str, tuple[type[BoardFile], type[Target]]] = {
    "checkerboard": (CheckerboardFile, CheckerboardTarget),
    "charuco": (CharucoFile, CharucoTarget),
    "circles": (CirclesFile, CirclesTarget),
}


def read_board(path: str | Path) -> Target:
    """The board that ``board.toml`` describes; lengths in mm.

    Raises
    ------
    FormatError
        Not TOML, a key missing, unknown or out of bounds, or a kind that is not known.
    """
    path = Path(path)
    return _parse(read_toml(path), path)


def write_board(path: str | Path, target: Target) -> None:
    """Write ``board.toml``, atomic; it reads back as it is.

    Raises
    ------
    UsageError
        A board that `read_board` would refuse.
    FormatError
        The file cannot be written.
    """
    path = Path(path)
    keys = {"kind": kind_of(target), **describe_noun(target)}
    if target.pitch_x_mm == target.pitch_y_mm:
        keys["square_mm"] = keys.pop("pitch_x_mm")
        del keys["pitch_y_mm"]
    write_text(path, lay_out_toml(keys, lambda again: _parse(again, path), what="board"))


def _parse(document: dict[str, Any], path: Path) -> Target:
    table, noun = KINDS[_kind(document, path)]
    board = validated(table, document, path)
    pitch_x, pitch_y = _pitch(board, path)
    _check_print(board, min(pitch_x, pitch_y), path)
    _check_sigma(board.pitch_sigma_mm, min(pitch_x, pitch_y), path)
    given = board.model_dump(exclude={"kind", "square_mm", "pitch_x_mm", "pitch_y_mm"})
    return noun(pitch_x_mm=pitch_x, pitch_y_mm=pitch_y, **given)


def _kind(document: dict[str, Any], path: Path) -> str:
    kind = document.get("kind", "checkerboard")  # which then says that the kind is missing
    if isinstance(kind, str) and kind in KINDS:
        return kind
    wanted = ", ".join(f"'{name}'" for name in KINDS)
    hint = suggest(kind, KINDS) if isinstance(kind, str) else ""
    raise FormatError(f"{path}: kind must be one of {wanted}, got {shorten(kind)}{hint}")


def _pitch(board: BoardFile, path: Path) -> tuple[float, float]:
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


def _check_print(board: BoardFile, pitch: float, path: Path) -> None:
    """A marker must fit its square, a circle its place."""
    for key in ("marker_mm", "diameter_mm"):
        value = getattr(board, key, None)
        if value is not None and not value < pitch:
            raise FormatError(f"{path}: {key} must be below the pitch ({pitch:g}), got {value:g}")


def _check_sigma(sigma: float | None, pitch: float, path: Path) -> None:
    if sigma is not None and sigma > LARGEST_SIGMA * pitch:
        raise FormatError(
            f"{path}: pitch_sigma_mm must be at most a tenth of the pitch ({pitch:g}), "
            f"got {sigma:g}; is it in µm?"
        )
