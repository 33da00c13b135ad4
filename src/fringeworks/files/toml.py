"""TOML that is certain to be read back."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from typing import Any

import tomlkit

from fringeworks.errors import FormatError, UsageError


def lay_out_toml(
    document: Mapping[str, Any], parse: Callable[[dict[str, Any]], object], *, what: str
) -> str:
    """Text of a document, which `parse` has taken again.

    Raises
    ------
    UsageError
        TOML cannot hold the document, or `parse` refuses it with a FormatError; `what` names
        the thing in the message.
    """
    try:
        text = tomlkit.dumps(document)
        parse(tomllib.loads(text))
    except FormatError as error:
        raise UsageError(f"this {what} could not be read back: {error}") from None
    except (TypeError, ValueError) as error:  # tomlkit's own errors are ValueErrors
        raise UsageError(f"this {what} cannot be written as TOML: {error}") from error
    return text
