"""Metrics of spatial unwrapping come about, with the peer or with the reason for its absence."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.bench import spatial
from fringeworks.errors import DecodeError, MissingExtraError
from fringeworks.model import WrappedPhase
from fringeworks.phase.spatial import unwrap_spatial

SIZE = (96, 64)


def test_keys_and_values() -> None:
    metrics = spatial.measure_size(SIZE, seconds=0.01)
    assert [metric.key.removeprefix("speed.spatial.96x64.") for metric in metrics] == [
        "clean_ms",
        "regions_ms",
        "clean_vs_scikit_image",
        "residues_vs_scikit_image",
    ]
    for metric in metrics:
        assert metric.value is None or metric.value > 0
        assert metric.value is not None or metric.note.startswith("skipped: ")


def test_the_surfaces_are_what_they_claim() -> None:
    clean, noisy = (spatial.surface(SIZE, rad) for rad in (spatial.CLEAN_RAD, spatial.NOISY_RAD))
    assert unwrap_spatial(clean.wrapped).residues == 0
    assert clean.count_wrong(unwrap_spatial(clean.wrapped).phase) == 0
    assert unwrap_spatial(noisy.wrapped).residues > 0


def test_an_installed_peer_unwraps_the_clean_one() -> None:
    clean = spatial.surface(SIZE, spatial.CLEAN_RAD)
    try:
        theirs = spatial.scikit_image(clean.wrapped)()
    except MissingExtraError as error:
        pytest.skip(str(error))
    assert clean.count_wrong(theirs) == 0


def test_ours_may_not_be_worse(monkeypatch: pytest.MonkeyPatch) -> None:
    clean = spatial.surface(SIZE, spatial.CLEAN_RAD)
    truth = clean.wrapped.phase + 2 * np.pi * clean.orders

    def perfect(wrapped: WrappedPhase) -> spatial.Unwrap:
        return lambda: np.asarray(truth, np.float64)

    def spoil(phase: NDArray[np.floating]) -> NDArray[np.floating]:
        return np.where(np.arange(SIZE[0]) < 30, phase + 2 * np.pi, phase)

    assert clean.count_wrong(spoil(truth)) > 0
    monkeypatch.setattr(spatial, "scikit_image", perfect)
    assert spatial._beside("key", clean, 0.01).value is not None
    monkeypatch.setattr(
        spatial.Surface, "count_wrong", lambda self, phase: int(phase.dtype == np.float32)
    )
    with pytest.raises(DecodeError, match="1 orders of ours are wrong, 0 of scikit-image's"):
        spatial._beside("key", clean, 0.01)
