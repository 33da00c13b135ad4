"""One pass over the frames gives the cloud that decoding and triangulating one by one do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks import pipeline
from fringeworks.errors import DecodeError
from fringeworks.kernels.tile import TILE
from fringeworks.model import (
    Axis,
    Camera,
    Capture,
    Cloud,
    Frames,
    Fringe,
    GrayCode,
    Reason,
    Sensor,
)
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.demodulate import MaskRules
from fringeworks.phase.methods import OrdersName
from fringeworks.pipeline import scan
from fringeworks.reconstruct.full import CloudRules, triangulate
from fringeworks.reconstruct.fused import scan_fused
from fringeworks.reconstruct.fused_plan import prepare_scan
from tests.reconstruct.fused_scenes import RIG, deepened, only, seen, with_frames

ROUNDING_MM = 1e-3
"""The issue's bar. Single precision leaves 6e-5 px of a coordinate, at 1 mm / px 0.06 um."""

NO_EDGES = CloudRules(edges=None)


def one_by_one(
    capture: Capture,
    *,
    orders: OrdersName = "auto",
    masks: MaskRules | None = None,
    rules: CloudRules = NO_EDGES,
) -> Cloud:
    projector_map = decode_capture(capture, rules=masks, orders=orders)
    return triangulate(
        projector_map, RIG, intensity=capture.white(), colour=capture.colour, rules=rules
    )


def at_once(
    capture: Capture,
    *,
    orders: OrdersName = "auto",
    masks: MaskRules | None = None,
    rules: CloudRules = NO_EDGES,
    threads: int | None = None,
) -> Cloud:
    plan = prepare_scan(capture, RIG, orders=orders, mask_rules=masks, cloud_rules=rules)
    assert plan is not None
    cloud = scan_fused(plan, capture, RIG, threads=threads)
    assert cloud is not None
    return cloud


def assert_same(found: Cloud, expected: Cloud, *, share: float = 0.2) -> None:
    """Points, sigma, reasons, intensity and findings; a share of the pixels has a point."""
    np.testing.assert_array_equal(found.valid, expected.valid)
    np.testing.assert_array_equal(found.reason, expected.reason)
    assert expected.valid.mean() > share
    np.testing.assert_allclose(found.xyz, expected.xyz, rtol=0, atol=ROUNDING_MM)
    np.testing.assert_allclose(found.sigma_mm, expected.sigma_mm, rtol=1e-4)
    np.testing.assert_allclose(found.intensity, expected.intensity, rtol=1e-6)
    assert np.isnan(found.epipolar_px).all()
    assert (found.findings, found.scale_sigma) == (expected.findings, expected.scale_sigma)


@pytest.mark.parametrize(
    ("kind", "axis"),
    [
        ("three steps", "x"),
        ("three steps", "y"),
        ("eight steps", "x"),
        ("plain code", "x"),
        ("frequencies", "x"),
        ("frequencies", "y"),
    ],
)
def test_the_same_cloud(kind: str, axis: Axis) -> None:
    capture = seen(kind, axis)
    assert_same(at_once(capture), one_by_one(capture))


@pytest.mark.parametrize("kind", ["three steps", "eight steps"])
def test_noise_from_the_images(kind: str) -> None:
    """By high pass for three steps, by the residual for eight; without white and black frames the
    fringes' offset tells light from dark."""
    capture = replace(only(seen(kind), Fringe, GrayCode), sensor=Sensor(255.0))
    assert not capture.sensor.noise_is_known
    assert_same(at_once(capture), one_by_one(capture))


def test_saturated_frames_are_left_out() -> None:
    """Of eight frames as many as reach the limit; of three none may."""
    deep = replace(seen("eight steps"), sensor=Sensor(65535.0))
    deep = replace(deep, frames=tuple(map(deepened, deep.frames)))
    for capture in (seen("three steps"), deep):
        level = float(np.percentile(capture.frames[0].max(axis=0), 70))
        dim = replace(capture, sensor=replace(capture.sensor, full_scale=level))
        assert_same(at_once(dim), one_by_one(dim), share=0.05)


def test_stricter_rules_and_a_depth_range() -> None:
    masks = MaskRules(modulation_sigmas=20.0, modulation_share=0.1, residual_sigmas=1.5)
    rules = CloudRules(axis="x", z_range_mm=(690.0, 750.0), edges=None)  # of 680 and 720 mm
    for kind in ("three steps", "eight steps"):
        found = at_once(seen(kind), masks=masks, rules=rules)
        assert_same(found, one_by_one(seen(kind), masks=masks, rules=rules), share=0.02)
        assert found.reason is not None
        assert Reason.OUTSIDE in found.reason


def test_misfits_are_told_the_same() -> None:
    """Rippled frames fit no sinusoid: a warning, word for word."""
    capture = seen("eight steps")
    stack = capture.frames[0].copy()
    stack[0, :, ::2] //= 2
    spoilt = replace(capture, frames=(stack, *capture.frames[1:]))
    found, expected = at_once(spoilt), one_by_one(spoilt)
    assert "do not fit a sinusoid" in str(found.findings)
    assert_same(found, expected, share=0.05)


def test_frequencies_beside_a_code() -> None:
    """What is asked for counts, not what there is."""
    capture, code = seen("frequencies"), seen("eight steps")
    both = replace(
        capture,
        sequence=replace(capture.sequence, sets=(*capture.sequence.sets, code.sequence.sets[1])),
        frames=(*capture.frames, code.frames[1][::-1].copy()),
    )
    orders: OrdersName = "frequencies"
    assert_same(at_once(both, orders=orders), one_by_one(capture))


def test_rows_may_be_shared() -> None:
    """Any number of threads, uneven shares: the same bits."""
    alone, shared = (at_once(seen("three steps"), threads=n) for n in (1, 7))
    np.testing.assert_array_equal(alone.xyz, shared.xyz)
    np.testing.assert_array_equal(alone.sigma_mm, shared.sigma_mm)
    np.testing.assert_array_equal(alone.reason, shared.reason)


def test_images_wider_than_a_tile() -> None:
    """They are worked in strips. Here every pixel is seven in a row."""
    capture, lens = seen("three steps"), RIG.camera.lens
    frames: list[Frames] = [stack.repeat(7, axis=2) for stack in capture.frames]
    wide = replace(capture, frames=tuple(frames))
    assert wide.shape[1] > TILE
    lens = replace(lens, fx=7 * lens.fx, cx=7 * lens.cx + 3)
    rig = replace(RIG, camera=Camera(wide.shape[1], wide.shape[0], lens))
    plan = prepare_scan(wide, rig, cloud_rules=NO_EDGES)
    assert plan is not None
    cloud = scan_fused(plan, wide, rig)
    assert cloud is not None
    assert_same(
        cloud, triangulate(decode_capture(wide), rig, intensity=wide.white(), rules=NO_EDGES)
    )


def test_scan_takes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """With edges masked, the way that `scan` goes and the other give one cloud."""
    capture = seen("three steps")
    found = scan(capture, RIG)
    exact = scan(capture, RIG, cloud_rules=CloudRules(exact=True))
    monkeypatch.setattr(pipeline, "prepare_scan", lambda *_, **__: None)
    assert_same(found, scan(capture, RIG))
    assert_same(exact, scan(capture, RIG))
    assert found.reason is not None
    assert Reason.MIXED in found.reason


def test_where_nothing_is_seen_the_other_way_says_why() -> None:
    dark = with_frames(seen("three steps"), Fringe, np.zeros_like)
    plan = prepare_scan(dark, RIG)
    assert plan is not None
    assert scan_fused(plan, dark, RIG) is None
    with pytest.raises(DecodeError, match="too little modulation"):
        scan(dark, RIG)
