"""Read ``targets.toml``: where each view of a thing has its targets, for `merge --by targets`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fringeworks.errors import FormatError
from fringeworks.files.validation import (
    Table,
    check_format,
    clip,
    first_twice,
    read_toml,
    validated,
)

TARGETS_FORMAT = "fringeworks-targets/1"

Place = Annotated[list[float], Field(min_length=3, max_length=3)]


class ViewTable(Table):
    """A cloud by its file's name, and its targets by theirs."""

    cloud: str
    targets: dict[str, Place]


class TargetsFile(Table):
    """The whole ``targets.toml``."""

    format: Literal["fringeworks-targets/1"]
    view: list[ViewTable]


def read_targets(path: str | Path, clouds: list[Path]) -> list[dict[str, NDArray[np.float64]]]:
    """Targets by name, ``(3,)`` mm in the cloud's frame, of each of `clouds`.

    Raises
    ------
    FormatError
        Not TOML, a key missing or unknown, a view that stands twice, or a cloud that has none or
        that is called as another.
    """
    path = Path(path)
    document = read_toml(path)
    check_format(document, TARGETS_FORMAT, path)
    listed = validated(TargetsFile, document, path).view
    for names, what in (
        ([view.cloud for view in listed], "[[view]]s"),
        ([cloud.name for cloud in clouds], "of the clouds to merge"),
    ):
        twice = first_twice(names)
        if twice is not None:
            raise FormatError(
                f"{path}: two {what} are called '{clip(twice)}'; give each its own name"
            )
    views = {view.cloud: view.targets for view in listed}
    missing = [cloud.name for cloud in clouds if cloud.name not in views]
    if missing:
        raise FormatError(f"{path}: has no [[view]] with cloud = '{missing[0]}'")
    return [
        {name: np.array(place, dtype=np.float64) for name, place in views[cloud.name].items()}
        for cloud in clouds
    ]
