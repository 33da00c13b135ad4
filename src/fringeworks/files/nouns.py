"""Tables of a file whose keys are the fields of a noun: either made from the other.

Names are the same on both sides; a list in the file is a tuple in the noun.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, Field, fields, is_dataclass
from types import GenericAlias
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import pydantic

from fringeworks.files.validation import Table

Noun = TypeVar("Noun")


def table_of(noun: type[Any], **further: Any) -> type[Table]:
    """A table with the fields of a dataclass under their names, types, bounds and defaults.

    Fields that are dataclasses become tables in it. `further` are more keys, each a type and a
    default as pydantic's `create_model` takes them.
    """
    hints = get_type_hints(noun, include_extras=True)
    keys: dict[str, Any] = {item.name: _key(item, hints[item.name]) for item in fields(noun)}
    return pydantic.create_model(f"{noun.__name__}Table", __base__=Table, **{**further, **keys})


def make_noun(noun: type[Noun], table: Table, **further: Any) -> Noun:
    """`noun` with the keys that a table has of it; those not given take the noun's defaults.

    `further` are fields that the table does not have, or not as the noun needs them.
    """
    hints = get_type_hints(noun)
    given = {key: getattr(table, key) for key in type(table).model_fields if key in hints}
    values = {key: _value(hints[key], value) for key, value in given.items() if value is not None}
    return noun(**{**values, **further})


def describe_noun(noun: Any) -> dict[str, Any]:
    """Keys of a noun for TOML; None and infinity, which mean not given, are left out."""
    values = {item.name: getattr(noun, item.name) for item in fields(noun)}
    return {
        key: _plain(value)
        for key, value in values.items()
        if value is not None and value != math.inf
    }


def _key(item: Field[Any], hint: Any) -> tuple[Any, Any]:
    kind = _file_type(hint)
    if is_dataclass(hint):
        return kind, pydantic.Field(default_factory=kind)
    if item.default_factory is not MISSING:
        return kind, pydantic.Field(default_factory=item.default_factory)
    return kind, ... if item.default is MISSING else item.default


def _file_type(hint: Any) -> Any:
    """What stands in a file for a field of this type."""
    if isinstance(hint, type) and is_dataclass(hint):
        return table_of(hint)
    if get_origin(hint) is not tuple:
        return hint
    kinds = get_args(hint)
    items = GenericAlias(list, (_file_type(kinds[0]),))
    if kinds[-1] is Ellipsis:
        return items
    return Annotated[items, pydantic.Field(min_length=len(kinds), max_length=len(kinds))]


def _value(hint: Any, value: Any) -> Any:
    """What a field of this type is for what stands in the file."""
    if isinstance(value, Table):
        return make_noun(hint, value)
    return _tuples(value)


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _plain(value: Any) -> Any:
    """The same with nouns as tables and tuples as lists."""
    if is_dataclass(value):
        return describe_noun(value)
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
