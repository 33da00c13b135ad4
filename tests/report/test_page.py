"""Pages: one file that asks for nothing, says what it was given, and can be read by everyone."""

from __future__ import annotations

import re
from base64 import b64decode
from dataclasses import dataclass, field
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from fringeworks.errors import FormatError, ShapeError
from fringeworks.report.blocks import (
    Block,
    CloudView,
    Details,
    Gallery,
    Number,
    Numbers,
    Page,
    Picture,
    Section,
    Table,
    Text,
    Verdict,
)
from fringeworks.report.canvas import Shade, map_figure, new_figure, save_figure
from fringeworks.report.page import render_page, write_page
from tests.report.surfaces import cylinder_before_wall

GOOD = Verdict("good", "within 2 sigma")
VOID = {"meta", "link", "img", "br", "hr", "input"}
"""Elements that HTML never closes."""


@pytest.fixture(scope="module")
def noise_map(tmp_path_factory: pytest.TempPathFactory) -> Picture:
    """Nothing but noise, which no packing makes small."""
    values = np.random.default_rng(0).normal(size=(480, 752))
    figure = map_figure(values, Shade("residual, px", "RdBu_r"), "residual")
    path = save_figure(figure, tmp_path_factory.mktemp("figures") / "noise.png")
    return Picture(path, "What is left.", "map of the residual")


def small_figure() -> Figure:
    figure = new_figure(1.0, width_in=1.0)
    figure.add_subplot().plot([0, 1])
    return figure


def page_of(*blocks: Block, title: str = "A report") -> Page:
    return Page(title, "What it says.", [Section("Found", blocks)])


@dataclass
class Parsed(HTMLParser):
    """Elements with their attributes, and all words outside scripts and style."""

    elements: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    open_tags: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open_tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open_tags.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open_tags and self.open_tags[-1] not in ("script", "style"):
            self.words.append(data)

    def named(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def text(self) -> str:
        return "".join(self.words)


def parse(html: str) -> Parsed:
    parsed = Parsed()
    parsed.feed(html)
    parsed.close()
    assert parsed.open_tags == []
    return parsed


@pytest.fixture(scope="module")
def full(noise_map: Picture) -> str:
    cloud, _ = cylinder_before_wall()
    table = Table(
        ["view", "rms, px"], [["one", "0.1"], ["two", "0.2"]], (1,), [GOOD, None], "Views"
    )
    number = Number("radius", "52.498 mm", "truth 52.500 mm", GOOD)
    blocks: list[list[Block]] = [
        [Numbers([number]), CloudView(cloud, "A cylinder."), CloudView(cloud, "Again.")],
        [table, Gallery([noise_map, Picture(small_figure(), "A line.", "a line")])],
        [Text("One.\n\nTwo: `make demo`."), Details("Every number", {"a": [1, None]})],
    ]
    sections = [Section(f"Part {i}", part) for i, part in enumerate(blocks)]
    return render_page(Page("A report", "What it says.", sections))


def test_nothing_is_asked_for(full: str) -> None:
    assert "http://" not in full
    assert "https://" not in full
    assert "@import" not in full
    assert not re.search(r"url\((?!data:)", full)
    for _, attributes in parse(full).elements:
        for name in ("src", "href", "srcset", "poster", "action", "data"):
            assert (attributes.get(name) or "#").startswith(("#", "data:"))


def test_the_policy_forbids_the_network(full: str) -> None:
    policies = [item for item in parse(full).named("meta") if "http-equiv" in item]
    assert policies[0]["http-equiv"] == "Content-Security-Policy"
    assert (policies[0]["content"] or "").startswith("default-src 'none'; img-src data:;")


def test_the_page_is_well_formed(full: str) -> None:
    parsed = parse(full)
    assert full.startswith("<!DOCTYPE html>\n")
    assert parsed.named("html") == [{"lang": "en"}]
    for tag in ("head", "title", "body", "header", "nav", "main", "footer", "h1"):
        assert len(parsed.named(tag)) == 1, tag
    ids = [item["id"] for _, item in parsed.elements if "id" in item]
    assert len(ids) == len(set(ids))
    targets = {item["href"] for item in parsed.named("a")}
    assert targets == {"#s1", "#s2", "#s3"}
    assert {f"#{name}" for name in ids} >= targets


def test_everyone_can_read_it(full: str) -> None:
    parsed = parse(full)
    assert all(image["alt"] for image in parsed.named("img"))
    assert {cell.get("scope") for cell in parsed.named("th")} == {"col", "row"}
    assert "✓ within 2 sigma" in parsed.text  # a sign and words, not a colour alone
    assert all(item["width"] and item["height"] for item in parsed.named("img"))


def luminance(colour: str) -> float:
    """Relative luminance of ``#rrggbb`` (WCAG 2.2)."""
    share = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_contrast_is_enough(full: str, theme: int) -> None:
    variables = re.findall(r":root \{(.*?)\}", full, re.DOTALL)[theme]
    colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", variables))
    grounds = [luminance(colours[name]) for name in ("ground", "card", "stage")]
    for name in ("ink", "soft", "accent", "good", "doubtful", "bad"):
        ink = luminance(colours[name])
        ratios = [(max(ink, ground) + 0.05) / (min(ink, ground) + 0.05) for ground in grounds]
        assert min(ratios) >= 4.5, (name, ratios)  # level AA


HOSTILE = "<script>alert(1)</script><b>&amp;\"'</b>"


def test_words_stay_words() -> None:
    word = HOSTILE
    judged = Verdict("bad", word)
    picture = Picture(small_figure(), word, word)
    page = Page(
        word,
        word,
        [
            Section(word, [Text(word), Numbers([Number(word, word, word, judged)])]),
            Section(word, [Table([word], [[word]], (), [judged], word), picture]),
            Section(word, [Details(word, {word: word})]),
        ],
    )
    parsed = parse(render_page(page))
    assert parsed.named("script") == parsed.named("b") == []
    # title, h1, lead; 3 headings twice; text, 4 of a number; 4 of a table; caption; title, and
    # JSON twice where it has no quotes to mark
    assert parsed.text.count("<script>alert(1)</script><b>") == 3 + 6 + 5 + 4 + 1 + 3
    assert parsed.named("img")[0]["alt"] == word
    assert {item.get("aria-label") for item in parsed.named("div")} >= {word}


def test_back_quotes_are_code() -> None:
    html = render_page(page_of(Text("Run `make <demo>` now.\n\nThen look.")))
    assert "<p>Run <code>make &lt;demo&gt;</code> now.</p><p>Then look.</p>" in html


def test_a_page_without_cloud_has_no_script() -> None:
    assert parse(render_page(page_of(Text("x")))).named("script") == []


def test_uneven_rows_are_refused() -> None:
    with pytest.raises(ShapeError, match="row 1 must be 2 cells, got 1"):
        Table(["a", "b"], [["1", "2"], ["3"]])
    with pytest.raises(ShapeError, match="verdicts must be one per row, 1, got 2"):
        Table(["a"], [["1"]], verdicts=[GOOD, GOOD])


def test_nan_is_no_detail() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        render_page(page_of(Details("x", {"a": float("nan")})))


def test_a_picture_file_is_inlined(tmp_path: Path) -> None:
    path = save_figure(small_figure(), tmp_path / "x.png")
    image = parse(render_page(page_of(Picture(path, "x", "x")))).named("img")[0]
    assert (image["src"] or "").startswith("data:image/png;base64,iVBOR")


def test_pictures_that_are_none_are_named(tmp_path: Path) -> None:
    absent = Picture(tmp_path / "absent.png", "x", "x")
    with pytest.raises(FormatError, match=r"absent\.png: cannot be read"):
        render_page(page_of(absent))
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(FormatError, match=r"text\.png: must be a PNG picture"):
        render_page(page_of(Picture(tmp_path / "text.png", "x", "x")))


def test_half_a_page_is_never_left(tmp_path: Path) -> None:
    path = write_page(tmp_path / "out" / "report.html", page_of(Text("µ")))
    before = path.read_bytes()
    assert "µ".encode() in before
    with pytest.raises(FormatError):
        write_page(path, page_of(Picture(tmp_path / "absent.png", "x", "x")))
    assert path.read_bytes() == before
    assert [item.name for item in path.parent.iterdir()] == ["report.html"]


def test_heavy_pictures_are_packed(noise_map: Picture) -> None:
    assert isinstance(noise_map.source, Path)
    image = parse(render_page(page_of(noise_map))).named("img")[0]
    kind, data = (image["src"] or "").split(",")
    assert kind == "data:image/webp;base64"
    assert len(data) < noise_map.source.stat().st_size / 2
    with Image.open(noise_map.source) as exact, Image.open(BytesIO(b64decode(data))) as packed:
        assert packed.size == exact.size == (int(image["width"] or 0), int(image["height"] or 0))


def test_a_demo_stays_below_five_megabytes(noise_map: Picture) -> None:
    cloud, _ = cylinder_before_wall(200, 300)  # 60,000 points
    blocks: list[Block] = [CloudView(cloud, "x"), *[noise_map] * 8]
    assert len(render_page(page_of(*blocks)).encode()) < 5e6
