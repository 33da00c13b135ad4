"""The real captures: gamma where their READMEs say so, and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.diagnose import check_capture
from fringeworks.files import read_capture
from fringeworks.model import Capture

Real = Callable[[str], Path]


def halved(capture: Capture) -> Capture:
    """Every other row and column: a fourth of the time, the same light."""
    stacks: list[Any] = [np.ascontiguousarray(stack[:, ::2, ::2]) for stack in capture.frames]
    return replace(capture, frames=tuple(stacks), colour=None, dark_colour=None)


@pytest.mark.parametrize(
    ("name", "group"),
    [("psp3-gray-mugs", None), ("gamma-plane", "exponent-1.25")],
)
def test_gamma_is_found_and_nothing_else(real: Real, name: str, group: str | None) -> None:
    found = check_capture(halved(read_capture(real(name), group=group)), group=group)

    assert [finding.name for finding in found.findings] == ["gamma"]


@pytest.mark.slow
def test_gamma_is_found_in_whole_images(real: Real) -> None:
    found = check_capture(read_capture(real("gamma-plane")))

    assert [finding.name for finding in found.findings] == ["gamma"]


@pytest.mark.parametrize("name", ["fourstep-dome", "procam-graycode"])
def test_nothing_is_found(real: Real, name: str) -> None:
    folder = real(name)
    captures = sorted(folder.glob("capture_*")) or [folder]
    assert check_capture(halved(read_capture(captures[0]))).findings == ()
