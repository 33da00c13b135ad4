"""The reproduction's parts that need no minutes: draws, the route, the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from fringeworks.experiments.paper import many
from fringeworks.experiments.paper.chapter import Chapter, Grid, Row, Shown
from fringeworks.experiments.paper.code import read_codes
from fringeworks.experiments.paper.draws import MODELS, draw_rig, sharpen, shift_phase
from fringeworks.experiments.paper.lab import Lab
from fringeworks.experiments.paper.many import CLAIMS, SHARPER, run_draws, sizes_of
from fringeworks.experiments.paper.page import compare_to_paper, make_page, write_markdown
from fringeworks.experiments.paper.poor_board import POOR, Priors
from fringeworks.experiments.paper.route import only_fringes
from fringeworks.experiments.paper.sampling import mean_over_squares
from fringeworks.files import read_capture
from fringeworks.geometry.lens import project
from fringeworks.model import Fringe, Uniform
from fringeworks.report.page import render_page
from fringeworks.twin.scenes import paper_rig, wall_scene

PERFECT = Priors((0.0, 0.0), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0))


class TestDraws:
    def test_a_perfect_calibration_leaves_the_full_model_without_error(self) -> None:
        """What is left is where OpenCV's own solver stops, on corners in float32.

        The paper's models keep what a pinhole cannot do of the projector's distortion.
        """
        drawn = draw_rig(PERFECT, 0)
        assert abs(drawn.errors["full"].cylinder_radius_mm) < 2e-3
        assert drawn.errors["full"].plane_form_mm < 2e-3
        assert drawn.errors["equations 1 to 3"].plane_form_mm > 0.02

    def test_reprojection_is_the_paper_s(self) -> None:
        """88 corners in 14 views tell a deviation to 2 %; the cut at 0.25 px takes 8 % of it."""
        drawn = draw_rig(POOR, 1)
        assert drawn.camera_std_px == pytest.approx((0.0987, 0.0905), rel=0.15)
        assert drawn.projector_std_px == pytest.approx((0.77058, 0.48506), rel=0.1)

    def test_the_same_seed_draws_the_same_rig(self) -> None:
        """To where OpenCV's solver stops, whose threads add up in no fixed order."""
        first, second, other = (
            draw_rig(POOR, seed).errors["full"].cylinder_radius_mm for seed in (2, 2, 3)
        )
        assert first == pytest.approx(second, abs=1e-4)
        assert abs(other - first) > 1e-3

    def test_an_origin_of_phase_that_is_off_is_found_again(self) -> None:
        """The extended fit has K_phi free: what phi_0 is off by costs it nothing."""
        right, off = draw_rig(POOR, 1), draw_rig(replace(POOR, phase_rad=2.7), 1)
        first = [abs(one.chord_mm[MODELS[0]]) for one in (right, off)]
        assert first[1] > 1.0 > 10 * first[0]
        extended = [one.errors["extended, paper"].cylinder_radius_mm for one in (right, off)]
        assert extended[1] == pytest.approx(extended[0], abs=1e-4)

    def test_twice_the_resolution_sees_the_same_places(self) -> None:
        rig, point = paper_rig(), np.array([[12.0, -7.0, 640.0]])
        finer = sharpen(rig, 2)
        assert (finer.camera.width, finer.camera.height) == (1504, 960)
        coarse, fine = (project(point, one.camera.lens.vector) for one in (rig, finer))
        assert fine + 0.5 == pytest.approx(2 * (coarse + 0.5))

    def test_phase_of_a_turn_is_a_period(self) -> None:
        moved = shift_phase(paper_rig(), 2 * np.pi)
        assert moved.projector.lens.cx - paper_rig().projector.lens.cx == pytest.approx(32.0)

    def test_kept_draws_are_not_drawn_again(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        lab = Lab(tmp_path)
        first = run_draws(lab, "a name", PERFECT, 1)
        monkeypatch.setattr(many, "draw_rig", lambda *_: pytest.fail("drawn again"))
        assert run_draws(lab, "a name", PERFECT, 1) == first
        assert sizes_of(first, "full", "radius_mm").shape == (1,)

    def test_other_priors_are_drawn_anew(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        lab = Lab(tmp_path)
        run_draws(lab, "a name", PERFECT, 1)

        def refuse(*_: object) -> None:
            raise RuntimeError("drawn anew")

        monkeypatch.setattr(many, "draw_rig", refuse)
        with pytest.raises(RuntimeError, match="drawn anew"):
            run_draws(lab, "a name", POOR, 1)

    def test_each_claim_changes_what_it_says(self) -> None:
        assert CLAIMS["a better board"].corner_px == POOR.corner_px
        assert CLAIMS["better corners"].print_mm == POOR.print_mm
        assert CLAIMS[SHARPER].resolution == 2


def test_table_1(tmp_path: Path) -> None:
    """Captured frequencies within the paper's tolerances but for 5 px, and said so."""
    chapter = read_codes(Lab(tmp_path))
    ideal = chapter.numbers["ideal_hz"]
    printed = {"2": 80.5, "3": 53.7, "4": 40.5, "5": 32.6, "6": 27.3, "8": 20.5}
    assert {word: round(value, 1) for word, value in ideal.items()} == printed
    assert chapter.numbers["outside_tolerance_px"] == [5.0]
    assert "5 px stands" in chapter.words
    said = {row.quantity: row.ours for row in chapter.rows}
    assert said["codewords of cylinder and cone"] == "p2, p1"
    assert said["difference of their orders"] == "5"
    kept = (tmp_path / "wall" / "capture.toml").stat().st_mtime_ns
    Lab(tmp_path).still(wall_scene())
    assert (tmp_path / "wall" / "capture.toml").stat().st_mtime_ns == kept
    capture = only_fringes(read_capture(tmp_path / "wall"))
    kinds = {type(item.pattern) for item in capture.sequence.sets}
    assert kinds == {Fringe, Uniform}


def test_means_over_squares_keep_void_pixels_to_themselves() -> None:
    values = np.arange(100, dtype=np.float32).reshape(10, 10)
    values[0, 0] = np.nan
    mean = mean_over_squares(values, 3)
    assert np.isnan(mean[:2, :2]).all()
    assert np.isfinite(mean[2:, 2:]).all()
    assert mean[5, 5] == pytest.approx(55.0)


class TestPage:
    @pytest.fixture
    def chapters(self) -> dict[str, Chapter]:
        figure = Figure()
        figure.add_subplot().plot([0, 1])
        chapter = Chapter(
            heading="A heading",
            words="Some words.",
            rows=(Row("with a number", "1.0", "1.1", "why | so"), Row("without", "", "2")),
            grids=(Grid("A caption", ("", "a"), [("row", "3")]),),
            pictures=(Shown("figure_01_it", figure, "Figure 1: it."),),
            numbers={"value": 1.1},
        )
        return {"one": chapter}

    def test_the_page_has_words_rows_and_figures(
        self, chapters: dict[str, Chapter], tmp_path: Path
    ) -> None:
        page = render_page(make_page(chapters, figures=tmp_path))
        for word in ("A heading", "Some words.", "with a number", "A caption", "Figure 1: it."):
            assert word in page
        assert (tmp_path / "figure_01_it.png").stat().st_size > 1000

    def test_markdown(self, chapters: dict[str, Chapter]) -> None:
        text = write_markdown(chapters)
        assert "| with a number | 1.0 | 1.1 | why / so |" in text
        assert "## A heading" in text
        assert "| row | 3 |" in text

    def test_the_comparison_has_the_paper_s_numbers_alone(
        self, chapters: dict[str, Chapter]
    ) -> None:
        assert "without" not in compare_to_paper(chapters)
