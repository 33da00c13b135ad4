"""How long work reports where it is: by an iterable wrapper that the caller injects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar

Item = TypeVar("Item")


class Progress(Protocol):
    """Wraps items and shows how many are done, as `rich.progress.track` does."""

    def __call__(self, items: Sequence[Item], description: str) -> Iterable[Item]:
        """The same items, one by one."""


def no_progress(items: Sequence[Item], description: str) -> Iterable[Item]:
    """Show nothing."""
    return items
