"""The page about a calibration: what it says first, what it leaves out, how a browser shows it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.calibrate import ImageSize, calibrate_rig
from fringeworks.calibrate.adjust.covariance import KEY as COVARIANCE_KEY
from fringeworks.calibrate.adjust.covariance import Covariance, read_covariance
from fringeworks.calibrate.extended.words import FIT_KEY
from fringeworks.calibrate.judge.halves import Halves
from fringeworks.calibrate.judge.uncertainty import lay_field, pixel_sigma, point_sigma
from fringeworks.errors import FormatError
from fringeworks.model import Extended, Rig
from fringeworks.report.blocks import Details, Numbers, Page, Picture, Table, Text
from fringeworks.report.calibration_page import make_calibration_page
from fringeworks.report.judgement import Judged, judge_calibration, summarise_judged
from fringeworks.report.page import write_page
from fringeworks.report.parameters import baseline_sigma, with_sigma
from fringeworks.report.uncertainty import draw_halves, draw_pixels, draw_points
from tests.browser import Browser
from tests.calibrate.synthetic import BOARD, board_poses, dense_sites, rig_state, views_of

FAILED = (("pose_9", "the board was not found"),)


def calibrated(count: int) -> Rig:
    truth = rig_state(board_poses(count, rng=np.random.default_rng(4)))
    rng = np.random.default_rng(5)
    views = views_of(truth, sigma=0.03, site_sigma=0.012, rng=rng)
    dense = dense_sites(truth, sigma=0.012, rng=rng)
    return calibrate_rig(
        [replace(view, dense=sites) for view, sites in zip(views, dense, strict=True)],
        BOARD,
        camera_size=ImageSize(752, 480),
        projector_size=ImageSize(608, 684),
        failed=FAILED,
    )


@pytest.fixture(scope="module")
def rig() -> Rig:
    return calibrated(6)


@pytest.fixture(scope="module")
def judged(rig: Rig) -> Judged:
    return judge_calibration(rig)


@pytest.fixture(scope="module")
def page(judged: Judged) -> Page:
    return make_calibration_page(judged)


def blocks_under(page: Page, heading: str) -> list[object]:
    (section,) = [section for section in page.sections if section.heading == heading]
    return list(section.blocks)


def words_under(page: Page, heading: str) -> str:
    return " ".join(block.words for block in blocks_under(page, heading) if isinstance(block, Text))


def test_findings_come_first(page: Page) -> None:
    assert page.sections[0].heading == "What to look at"
    (table,) = page.sections[0].blocks
    assert isinstance(table, Table)
    assert table.rows[0][0] == "pose_9 was not used: the board was not found"
    assert [verdict.words for verdict in table.verdicts if verdict] == ["warning"]


def test_no_finding_is_said(judged: Judged) -> None:
    clean = replace(judged, record=replace(judged.record, findings=(), failed_captures=()))
    words = words_under(make_calibration_page(clean), "What to look at")
    assert "No finding" in words
    assert "two halves of the views agree" in words


def test_numbers_stand_beside_their_deviations(judged: Judged, page: Page) -> None:
    (numbers,) = blocks_under(page, "How well it fits")
    assert isinstance(numbers, Numbers)
    shown = {number.name: number for number in numbers.items}
    assert shown["views used"].value == "6 of 7"
    assert shown["corners kept"].value == "528 of 616"  # those of the failed one count as offered
    assert judged.covariance is not None
    known = baseline_sigma(judged.rig, judged.covariance)
    value, sigma = with_sigma(judged.rig.baseline_mm, known)
    assert shown["baseline"].value == f"{value} mm"
    assert shown["baseline"].beside == f"1 sd {sigma} mm"
    assert shown["camera fx"].value.startswith("197")
    assert shown["two halves differ by"].verdict is not None
    assert shown["depth known to"].value.endswith("µm")


def test_a_baseline_along_x_is_known_as_well_as_its_x(rig: Rig) -> None:
    pose = replace(rig.projector_from_camera, translation_mm=np.array([-180.0, 0.0, 0.0]))
    names = tuple(f"projector_from_camera.t{axis}_mm" for axis in "xyz")
    covariance = Covariance(names, np.diag([0.04, 9.0, 9.0]), 1, 1.0)
    found = baseline_sigma(replace(rig, projector_from_camera=pose), covariance)
    assert found == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("value", "sigma", "shown"),
    [
        (1974.0483, 0.0521, ("1974.048", "0.052")),
        (0.000204, 0.0000118, ("0.000204", "0.000012")),
        (1974.0, 35.2, ("1974", "35")),
        (1.5, 0.0, ("1.5", "0")),
    ],
)
def test_digits_that_a_deviation_leaves(value: float, sigma: float, shown: tuple[str, str]) -> None:
    assert with_sigma(value, sigma) == shown


def test_parameters_and_correlations(rig: Rig, page: Page) -> None:
    parameters, correlations = blocks_under(page, "Parameters")
    assert isinstance(parameters, Table)
    assert isinstance(correlations, Table)
    rows = {row[0]: row[1:] for row in parameters.rows}
    assert len(rows) == 8 + 8 + 6
    assert float(rows["`camera.fx`"][0]) == pytest.approx(rig.camera.lens.fx, abs=0.1)
    assert [rows[f"`{name}`"][2] for name in ("projector.cy", "camera.k1")] == ["px", ""]
    assert rows["`projector_from_camera.rx_rad`"][2] == "rad"
    strongest = [abs(float(row[2])) for row in correlations.rows]
    assert strongest == sorted(strongest, reverse=True)


def test_views_with_their_reasons(page: Page) -> None:
    table = blocks_under(page, "View by view")[0]
    assert isinstance(table, Table)
    assert [row[0] for row in table.rows] == [f"pose_{index}" for index in range(6)] + ["pose_9"]
    assert table.rows[-1][-1] == "the board was not found"
    assert all(int(row[4]) > 100 for row in table.rows[:-1])


def test_the_rest_is_there_too(page: Page, judged: Judged) -> None:
    maps = blocks_under(page, "How well points and pixels are known")
    assert sum(isinstance(block, Picture) for block in maps) == 3
    assert any(
        isinstance(block, Picture) for block in blocks_under(page, "Two halves of the views")
    )
    (details,) = blocks_under(page, "All numbers")
    assert isinstance(details, Details)
    plain = json.loads(json.dumps(details.values, allow_nan=False))
    assert judged.halves is not None
    assert plain["halves"]["ratio"] == judged.halves.ratio
    assert plain["sigma"]["camera.fx"] > 0
    assert len(plain["systematic"]["aligned"]["depth_mm"]) == 3


def test_figures_show_the_maps_over_the_whole_image(rig: Rig, judged: Judged) -> None:
    assert judged.covariance is not None
    assert judged.halves is not None
    field = lay_field(rig)
    sigma = point_sigma(rig, judged.covariance, field)
    pixels = pixel_sigma(rig, judged.covariance, field)
    figures = (
        draw_points(sigma, field.depths_mm, rig.camera),
        draw_pixels(pixels, pixels, rig.camera),
        draw_halves(judged.halves, rig.camera),
    )
    for figure, count in zip(figures, (6, 4, 2), strict=True):
        images = [axes.images[0] for axes in figure.axes if axes.images]
        assert len(images) == count
        assert all([*image.get_extent()] == [-0.5, 751.5, 479.5, -0.5] for image in images)
    shown = figures[0].axes[0].images[0].get_array()
    np.testing.assert_allclose(np.asarray(shown), 1e3 * sigma.depth_mm[0])


def with_halves(judged: Judged, halves: Halves) -> Judged:
    """The same with other halves and what is found of them, as a calibration keeps both."""
    found = () if halves.finding is None else (halves.finding,)
    record = replace(judged.record, halves=halves, findings=(*judged.record.findings, *found))
    return replace(judged, record=record)


def test_large_lengths_are_shown_in_mm(judged: Judged) -> None:
    assert judged.halves is not None
    far = Halves(np.full((3, 16, 24), 7.5), np.full((3, 16, 24), 2.5))
    figure = draw_halves(far, judged.rig.camera)
    assert np.asarray(figure.axes[0].images[0].get_array()).max() == 7.5
    (numbers,) = blocks_under(make_calibration_page(with_halves(judged, far)), "How well it fits")
    assert isinstance(numbers, Numbers)
    assert numbers.items[-1].value == "7.50 mm"


def test_a_contradiction_of_the_halves_is_a_finding(judged: Judged) -> None:
    assert judged.halves is not None
    worse = replace(judged.halves, difference_mm=10 * judged.halves.predicted_mm)
    page = make_calibration_page(with_halves(judged, worse))
    (table,) = page.sections[0].blocks
    assert isinstance(table, Table)
    assert "10.0 times what their scatter predicts" in table.rows[-1][0]
    (numbers,) = blocks_under(page, "How well it fits")
    assert isinstance(numbers, Numbers)
    assert numbers.items[-1].verdict is not None
    assert numbers.items[-1].verdict.grade == "bad"


def test_the_scale_stands_where_it_is_known(rig: Rig, page: Page) -> None:
    (numbers,) = blocks_under(page, "How well it fits")
    assert isinstance(numbers, Numbers)
    assert "scale known to" not in {number.name for number in numbers.items}
    assert "does not say" in words_under(page, "How well points and pixels are known")
    known = make_calibration_page(judge_calibration(replace(rig, scale_sigma=1.5e-4)))
    (numbers,) = blocks_under(known, "How well it fits")
    assert isinstance(numbers, Numbers)
    assert {number.name: number for number in numbers.items}["scale known to"].value == "1.5e-04"
    assert "a share of 1.5e-04" in words_under(known, "How well points and pixels are known")


def test_few_views_leave_the_halves_out_with_a_sentence() -> None:
    page = make_calibration_page(judge_calibration(calibrated(4)))
    words = words_under(page, "Two halves of the views")
    assert words == "Left out: two halves of the views need at least 6 views, got 4."


def test_no_covariance_leaves_the_uncertainty_out_with_a_sentence(rig: Rig) -> None:
    bare = {key: value for key, value in rig.further.items() if key != COVARIANCE_KEY}
    assert read_covariance(bare) is None
    judged = judge_calibration(replace(rig, further=bare))
    page = make_calibration_page(judged)
    assert "no covariance" in words_under(page, "How well points and pixels are known")
    assert "no covariance" in words_under(page, "Parameters")
    assert summarise_judged(judged)["sigma"] is None


def test_a_rig_without_a_record_has_no_page(rig: Rig) -> None:
    with pytest.raises(FormatError, match="no record of its calibration"):
        judge_calibration(replace(rig, further={}))


def test_a_browser_shows_it_without_asking_for_anything(
    page: Page, browser: Browser, tmp_path: Path
) -> None:
    visit = browser.visit(write_page(tmp_path / "report.html", page), height=3000)
    assert visit.console == []
    assert visit.requests == set()
    lower = visit.picture[1500:]
    assert lower.std() > 10, "below the first screen there is something to see"


def test_the_ten_parameters_have_a_section_where_they_were_fitted(rig: Rig, page: Page) -> None:
    heading = "The paper's ten parameters"
    assert heading not in [section.heading for section in page.sections]
    fit = {
        "parameters": dict.fromkeys(Extended.NAMES, 0.0) | {"C1": 0.125},
        "sigma": {"C1": 0.02},
        "words": ["no plane tells Ku0", "rank 7 of 10"],
    }
    kept = replace(rig, further={**rig.further, FIT_KEY: fit})
    text, table = blocks_under(make_calibration_page(judge_calibration(kept)), heading)
    assert isinstance(text, Text)
    assert text.words == "No plane tells Ku0.\n\nRank 7 of 10."
    assert isinstance(table, Table)
    assert list(table.rows[0]) == ["C1", "mm", "0.125", "0.02"]
    assert table.rows[1][3] == "held at 0"
