"""Metrics of frames to cloud come about; times depend on the machine and are not judged."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.bench import folder, scan, stream
from fringeworks.bench.loops import read_and_write_maps
from fringeworks.pipeline import scan as whole_scan
from fringeworks.reconstruct.fused import empty_points
from fringeworks.twin.scenes import paper_rig

SMALL = (376, 240)


@pytest.fixture
def course() -> scan.Course:
    return scan.Course.of(SMALL, "three_steps_gray")


def test_the_course_is_what_the_bar_says(course: scan.Course) -> None:
    """Three steps and eight bits; every pixel has a point, on the wall."""
    assert [len(stack) for stack in course.capture.frames] == [3, 8]
    assert sum(map(len, scan.Course.of(SMALL, "multi_frequency").capture.frames)) == 12
    course.run()
    assert np.isfinite(course.points.xyz).mean() > 0.99
    assert np.nanmedian(course.points.xyz[2]) == pytest.approx(scan.WALL_MM, abs=0.1)


def test_the_memorys_pace_reads_every_frame_and_writes_every_map() -> None:
    """The sum without carry of all frames, in every map."""
    rng = np.random.default_rng(0)
    stacks = tuple(rng.integers(0, 256, (n, 5, 7), np.uint8) for n in (3, 2))
    points = empty_points((5, 7))
    read_and_write_maps(stacks, np.empty(7, np.uint8), points)
    expected = np.bitwise_xor.reduce(np.concatenate(stacks), axis=0)
    for written in (*points.xyz, *points[1:]):
        np.testing.assert_array_equal(written, expected)


def test_a_scan_allocates_little_beyond_its_frames_and_cloud(course: scan.Course) -> None:
    """The issue's bar; the table and its like, 50 kB, count for more in a small image."""
    course.run_anew()
    metric = scan._memory_metric("bytes", course)
    assert metric.value is not None
    assert 0 < metric.value <= 16


def test_streams_are_of_few_frames() -> None:
    """Three steps and one code frame; the orders are told."""
    rig = paper_rig()
    capture = stream.stream_capture(rig, "code_frame")
    assert [len(stack) for stack in capture.frames] == [3, 1]
    assert np.mean(whole_scan(capture, rig).valid) > 0.1
    metrics = stream._metrics_of("code_frame", capture, [0.01, 0.02, 0.03])
    assert [item.value for item in metrics] == pytest.approx([50.0, 20.0, 29.8])


def test_a_folder_becomes_a_cloud() -> None:
    (metric,) = folder.measure_folder(quick=True)
    assert metric.key == "process.scan_folder_376x240_vs_codecs"
    assert metric.value is not None
    assert metric.value > 0
