"""From a parsed file to a checked one: pydantic's errors as one clear line each."""

from __future__ import annotations

import difflib
import json
import re
import stat
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from fringeworks.errors import FormatError, UsageError

MAX_TEXT_BYTES = 16 * 2**20
"""Largest description that is read; a capture.toml of a thousand images has 0.1 MB."""

MAX_KEY_PARTS = 100
"""Most dotted parts of a TOML key; tomllib takes time with the square of their number."""

SHOWN = 5
"""How many of several equal complaints a message lists."""

LONGEST_LINE = 500
"""Characters of a message's line that quotes a file: keys and names may be of any length."""

Location = tuple[int | str, ...]
Model = TypeVar("Model", bound=BaseModel)


class Table(BaseModel):
    """A table of a file: no unknown keys, no conversion of types, finite numbers only."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def read_text(path: Path) -> str:
    """A small UTF-8 text file, with or without byte order mark."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise FormatError(f"{path}: not a regular file; is it a folder or a device?")
        with path.open("rb") as file:
            data = file.read(MAX_TEXT_BYTES + 1)
        if len(data) > MAX_TEXT_BYTES:
            raise FormatError(f"{path}: larger than {MAX_TEXT_BYTES} bytes; is it the right file?")
        return data.decode("utf-8-sig")
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror or error})") from error
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: not UTF-8 text (byte {error.start})") from None
    except ValueError as error:  # NUL in the name, which another file may have given
        raise FormatError(f"{str(path)!r}: cannot be read ({error})") from None


def read_json(path: Path) -> dict[str, Any]:
    """A JSON file that holds an object, as plain Python values."""
    text = read_text(path)
    try:
        document = json.loads(
            text, parse_constant=_refuse_constant, object_pairs_hook=_refuse_twice
        )
    except RecursionError:
        raise FormatError(f"{path}: not valid JSON: too deeply nested") from None
    except ValueError as error:
        raise FormatError(f"{path}: not valid JSON: {clip(error)}") from None
    if not isinstance(document, dict):
        raise FormatError(f"{path}: must be a JSON object, got {shorten(document)}")
    return document


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number that JSON knows")


def _refuse_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = first_twice(key for key, _ in pairs)
        raise ValueError(f"the key {shorten(twice)} stands twice in one object")
    return table


def first_twice(names: Iterable[str]) -> str | None:
    """The first name that stood there before; a file may have millions."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file as plain Python values; syntax errors name the line."""
    text = read_text(path)
    _check_keys(text, path)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise FormatError(f"{path}: not valid TOML: too deeply nested") from None
    except ValueError as error:  # TOMLDecodeError, and integers of thousands of digits
        raise FormatError(f"{path}: not valid TOML: {clip(error)}") from None


# A text without an end is taken whole too: tried anew from each of its quotes, a line of quotes
# would take time with the square of its length.
_TEXT = re.compile(r'"(?:\\.|[^"\\\n])*+("?)|' + r"'[^'\n]*+('?)")
_BETWEEN_KEYS = re.compile(r"[=,{}\[\]\n]")
_KEY_DOT = re.compile(r"[\w-][ \t]*\.")


def _check_keys(text: str, path: Path) -> None:
    for words in _BETWEEN_KEYS.split(_TEXT.sub(_without_text, text)):
        if words.count(".") >= MAX_KEY_PARTS and len(_KEY_DOT.findall(words)) >= MAX_KEY_PARTS:
            raise FormatError(
                f"{path}: keys must have at most {MAX_KEY_PARTS} parts between dots, got "
                f"{shorten(words.strip())}"
            )


def _without_text(found: re.Match[str]) -> str:
    """A letter for a text; what has no end may be a key behind the end of a longer one."""
    return "s" if found[1] or found[2] else found[0]


def check_format(document: Mapping[str, Any], expected: str, path: Path) -> None:
    """Raise a FormatError where the key `format` is missing, misspelt or another one's."""
    given = document.get("format")
    if given == expected:
        return
    if "format" in document:
        raise FormatError(f"{path}: format must be '{expected}', got {shorten(given)}")
    near = difflib.get_close_matches("format", list(document), n=1)
    if near:
        raise FormatError(f"{path}: unknown key '{near[0]}', did you mean 'format'?")
    raise FormatError(f"{path}: format must be '{expected}', the key is missing")


def validated(model: type[Model], document: Mapping[str, Any], path: Path) -> Model:
    """`document` as `model`, or a FormatError with one line for each thing wrong."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        problems = [_line(model, item) for item in error.errors(include_url=False)]
        raise FormatError(format_problems(path, problems)) from None


@contextmanager
def refusing(path: Path) -> Iterator[None]:
    """A UsageError of the block as a FormatError of the file that its values came from."""
    try:
        yield
    except UsageError as error:
        raise FormatError(f"{path}: {error}") from None


def format_problems(path: Path, problems: list[str]) -> str:
    """The first few problems, one line each, every one with the file in front."""
    lines = [f"{path}: {problem}" for problem in problems[:SHOWN]]
    if len(problems) > SHOWN:
        lines.append(f"... and {len(problems) - SHOWN} more")
    return "\n".join(lines)


def suggest(name: object, known: Iterable[str]) -> str:
    """``, did you mean 'x'?`` for the nearest of the known names, or nothing."""
    near = difflib.get_close_matches(str(name), list(known), n=2, cutoff=0.6)
    return f", did you mean {' or '.join(map(repr, near))}?" if near else ""


def _line(model: type[BaseModel], item: Mapping[str, Any]) -> str:
    place, key = _place(item["loc"])
    return clip(f"{place}{_complaint(model, item, key)}")


_KINDS = {"set": "kind", "object": "shape", "position": "artefact"}
"""Arrays of tables of several kinds, and the key that tells which."""

_DEVICES = ("projector", "camera")
"""Tables of several kinds; their places have the kind between name and key."""

_COUNTED = (*_KINDS, "pose")
"""Arrays of tables that messages count from 1; all other indices count from 0."""


def _place(location: Location) -> tuple[str, str]:
    """``set 3 (fringe): `` and the key within."""
    if location[0] in _DEVICES and len(location) == 3 and isinstance(location[2], str):
        return "", _dotted((location[0], location[2]))
    if len(location) < 2 or location[0] not in _COUNTED or not isinstance(location[1], int):
        return "", _dotted(location)
    place, way = f"{location[0]} {location[1] + 1}", location[2:]
    if way and location[0] in _KINDS:
        place, way = f"{place} ({way[0]})", way[1:]
    return f"{place}: ", _dotted(way)


def _dotted(location: Location) -> str:
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return text.removeprefix(".")


_COMPARISONS = {
    "greater_than": ("must be > {}", "gt"),
    "greater_than_equal": ("must be >= {}", "ge"),
    "less_than": ("must be < {}", "lt"),
    "less_than_equal": ("must be <= {}", "le"),
    "literal_error": ("must be {}", "expected"),
}
_TYPES = {
    "float_type": "a number",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "string_type": "text",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "a finite number",
}


def _complaint(model: type[BaseModel], item: Mapping[str, Any], key: str) -> str:
    kind, given, context = item["type"], shorten(item["input"]), item.get("ctx", {})
    if kind == "missing":
        return f"{key} is missing"
    if kind == "extra_forbidden":
        known = _known_keys(model, item["loc"])
        return f"unknown key '{key}'{suggest(item['loc'][-1], known) or _list(known)}"
    if kind == "union_tag_not_found":
        return f"{_tag_name(context)} is missing"
    if kind == "union_tag_invalid":
        tags = [tag.strip(" '") for tag in context["expected_tags"].split(",")]
        wanted = f"{_tag_name(context)} must be one of {', '.join(tags)}"
        return f"{wanted}, got '{context['tag']}'" + suggest(context["tag"], tags)
    if kind in _COMPARISONS:
        text, bound = _COMPARISONS[kind]
        limit = context[bound]
        limit = f"{limit:g}" if isinstance(limit, float) else limit
        return f"{key} {text.format(limit)}, got {given}"
    if kind in ("too_short", "too_long", "string_too_short"):
        return f"{key} {_length(context)}"
    if kind in _TYPES:
        return f"{key or 'it'} must be {_TYPES[kind]}, got {given}"
    return f"{key}: {item['msg']}, got {given}"


def _tag_name(context: Mapping[str, Any]) -> str:
    return str(context["discriminator"]).strip("'")


def _length(context: Mapping[str, Any]) -> str:
    if context.get("min_length") == 1:
        return "must not be empty"
    bound = f"at most {context['max_length']}" if "max_length" in context else context["min_length"]
    return f"must hold {bound} entries, got {context['actual_length']}"


def _list(known: Iterable[str]) -> str:
    return f"; known here: {', '.join(known)}"


def shorten(value: object, width: int = 60) -> str:
    """`repr` of a value from a file, cut to what fits a message."""
    text = repr(value)
    return text if len(text) <= width else text[: width - 3] + "..."


def clip(message: object) -> str:
    """A message that quotes a file, cut to what can be read."""
    text = str(message)
    return text if len(text) <= LONGEST_LINE else text[: LONGEST_LINE - 3] + "..."


def _known_keys(model: type[BaseModel], location: Location) -> list[str]:
    """Keys that the table around an unknown key may have."""
    tables = [model]
    for part in location[:-1]:
        fields = [table.model_fields[part] for table in tables if part in table.model_fields]
        if fields:
            tables = [table for field in fields for table in _tables_in(field.annotation)] or tables
        else:  # an index, the name in a mapping, or the tag of a union
            tables = [table for table in tables if part in _tags(table)] or tables
    return list(dict.fromkeys(key for table in tables for key in table.model_fields))


def _tags(table: type[BaseModel]) -> list[Any]:
    """Values of the key that tells a table's kind."""
    found = [table.model_fields[key] for key in _KINDS.values() if key in table.model_fields]
    return [tag for field in found for tag in get_args(field.annotation)]


def _tables_in(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for argument in get_args(annotation) for table in _tables_in(argument)]
