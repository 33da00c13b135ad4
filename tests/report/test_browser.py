"""Pages in a real browser: what it draws, says and asks for, and how the view is moved."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.report.blocks import CloudView, Page, Section, Table, Text
from fringeworks.report.page import write_page
from tests.browser import Browser, Visit
from tests.report.surfaces import cylinder_before_wall

MAGENTA = (255, 0, 255)
STYLE = f"<style>.frame {{ outline: 3px solid rgb{MAGENTA}; }}</style>"
FRAME = f"document.head.insertAdjacentHTML('beforeend', `{STYLE}`);"
"""Outlines each view in a colour that no page has, so that it is found in a picture."""

HELPERS = """
// Frames come by the virtual clock, which would else run out before many of them are drawn.
window.requestAnimationFrame = (work) => setTimeout(work, 5);
const settled = () => new Promise((done) => setTimeout(done, 20));
const loaded = (work) => addEventListener("load", async () => { await settled(); await work(); });
const views = () => [...document.querySelectorAll(".frame canvas:first-child")];
const pointer = (view, name, x, y, more = {}) => {
  view.setPointerCapture = () => {};  // which refuses a pointer that is none
  const box = view.getBoundingClientRect();
  view.dispatchEvent(new PointerEvent(name, { pointerId: 1, buttons: 1, clientX: box.left + x,
    clientY: box.top + y, ...more }));
};
const drag = (view, from, to, more = {}) => {
  pointer(view, "pointerdown", ...from, more);
  pointer(view, "pointermove", ...to, more);
  pointer(view, "pointerup", ...to, more);
};
const press = (view, key, more = {}) =>
  view.dispatchEvent(new KeyboardEvent("keydown", { key, ...more }));
// Rows and columns of the view where the cloud is drawn: [left, top, right, bottom], px.
const extent = (view) => {
  const { width, height } = view;
  const flat = Object.assign(document.createElement("canvas"), { width, height });
  const pen = flat.getContext("2d");
  pen.drawImage(view, 0, 0);
  const { data } = pen.getImageData(0, 0, flat.width, flat.height);
  const box = [1e9, 1e9, -1, -1];
  for (let i = 3; i < data.length; i += 4) if (data[i] > 127) {
    const node = (i - 3) / 4, x = node % flat.width, y = Math.floor(node / flat.width);
    box[0] = Math.min(box[0], x); box[1] = Math.min(box[1], y);
    box[2] = Math.max(box[2], x); box[3] = Math.max(box[3], y);
  }
  return box;
};
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cloud, _ = cylinder_before_wall()
    table = Table([f"column {i} of a table" for i in range(12)], [["1.234"] * 12], range(1, 12))
    blocks = (CloudView(cloud, "A cylinder."), Text("Words."), CloudView(cloud, "Again."), table)
    path = tmp_path_factory.mktemp("page") / "report.html"
    return write_page(path, Page("A report", "What it says.", [Section("Found", blocks)]))


def first_view(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The inside of the uppermost outline, without axes and scale bar at its lower rim."""
    outline = (np.abs(picture.astype(int) - MAGENTA) < 60).all(axis=-1)  # its rim is blended
    rows = np.flatnonzero(outline.sum(axis=1) > 100)
    columns = np.flatnonzero(outline.any(axis=0))
    gap = int(np.argmax(np.diff(rows) > 10))
    top, bottom = rows[gap] + 2, rows[gap + 1] - 90
    return picture[top:bottom, columns[0] + 6 : columns[-1] - 5]


def said(visit: Visit) -> Any:
    """The one line that the test's script wrote to the console."""
    assert len(visit.console) == 1, visit.console
    return json.loads(visit.console[0])


@pytest.fixture(scope="module")
def seen(browser: Browser, page: Path) -> Visit:
    return browser.visit(page, script=FRAME)


def test_a_page_is_silent_and_asks_for_nothing(seen: Visit) -> None:
    assert seen.console == []
    assert seen.requests == set()


def test_the_view_is_drawn(seen: Visit) -> None:
    view = first_view(seen.picture)
    assert min(view.shape[:2]) > 200
    assert len(np.unique(view.reshape(-1, 3), axis=0)) > 1000
    ground = view[2, 2]
    covered = (np.abs(view.astype(int) - ground).max(axis=-1) > 8).mean()
    assert 0.2 < covered < 0.95


def test_the_camera_looks_first(browser: Browser, page: Path) -> None:
    # The camera image of this cloud is brighter from top to bottom; near is yellow.
    choose = "loaded(() => document.querySelectorAll('.modes button')[1].click());"
    bright = first_view(browser.visit(page, script=FRAME + HELPERS + choose).picture)
    middle = bright[:, bright.shape[1] // 2].mean(axis=-1)
    cut = len(middle) // 4
    assert middle[cut] < middle[2 * cut] < middle[3 * cut]


def test_near_is_light_and_stands_right_of_the_middle(seen: Visit) -> None:
    # The cylinder's axis is at x = +8 mm of the wall's 292 mm, right of the middle.
    view = first_view(seen.picture).astype(int)
    yellow = (view[..., 0] > 120) & (view[..., 1] > 120) & (view[..., 2] < 80)
    columns = np.flatnonzero(yellow.any(axis=0))
    assert columns.size > 50
    assert columns.mean() > view.shape[1] / 2


def test_an_error_or_a_request_would_be_noticed(browser: Browser, tmp_path: Path) -> None:
    bad = tmp_path / "bad.html"
    bad.write_text(
        "<html><head></head><body><script>console.error('said'); nothing();</script>"
        "<img src='http://127.0.0.1:9/x.png'></body></html>"
    )
    visit = browser.visit(bad)
    assert visit.console[0] == "said"
    assert "nothing is not defined" in visit.console[1]
    assert visit.requests == {"http://127.0.0.1:9/x.png"}


def test_the_policy_holds(browser: Browser, page: Path) -> None:
    visit = browser.visit(page, script="fetch('http://127.0.0.1:9/x');")
    assert visit.requests == set()
    assert any("Content Security Policy" in line for line in visit.console)


MOVES = """loaded(async () => {
  const [view, other] = views(), shots = {};
  const still = other.toDataURL();
  const take = async (name) => { await settled(); shots[name] = view.toDataURL(); };
  const back = () => view.dispatchEvent(new MouseEvent("dblclick"));
  await take("first");
  drag(view, [300, 100], [360, 140]); await take("turned"); back();
  drag(view, [300, 100], [360, 140], { shiftKey: true }); await take("shifted"); back();
  drag(view, [300, 100], [360, 140], { buttons: 2 }); await take("right button"); back();
  view.focus();
  view.dispatchEvent(new WheelEvent("wheel", { deltaY: -200 })); await take("wheel"); back();
  pointer(view, "pointerdown", 200, 100); pointer(view, "pointerdown", 300, 100, { pointerId: 2 });
  pointer(view, "pointermove", 380, 100, { pointerId: 2 }); await take("pinch");
  pointer(view, "pointerup", 200, 100);
  pointer(view, "pointerup", 380, 100, { pointerId: 2 }); back();
  for (const key of ["ArrowLeft", "ArrowDown", "+", "-"]) {
    press(view, key); await take(key); back();
  }
  press(view, "ArrowUp", { shiftKey: true }); await take("shift and arrow");
  press(view, "0"); await take("last");
  const names = Object.keys(shots);
  const twin = (name) => names.find((one) => shots[one] === shots[name]);
  console.log(JSON.stringify([names.map(twin), still === other.toDataURL()]));
});"""


def test_every_move_changes_the_view_and_can_be_undone(browser: Browser, page: Path) -> None:
    twins, others_still = said(browser.visit(page, script=HELPERS + MOVES))
    # Each picture is unlike all before it, but both drags that shift are one picture, and
    # resetting leads back to the first.
    assert twins == [
        *("first", "turned", "shifted", "shifted", "wheel", "pinch"),
        *("ArrowLeft", "ArrowDown", "+", "-", "shift and arrow", "first"),
    ]
    assert others_still


SCROLL = """loaded(async () => {
  const [view] = views(), before = view.toDataURL();
  const wheel = new WheelEvent("wheel", { deltaY: -200, cancelable: true });
  view.dispatchEvent(wheel);
  await settled();
  console.log(JSON.stringify([wheel.defaultPrevented, before === view.toDataURL()]));
});"""


def test_who_scrolls_past_is_not_held_up(browser: Browser, page: Path) -> None:
    assert said(browser.visit(page, script=HELPERS + SCROLL)) == [False, True]


TURN = """loaded(async () => {
  const [view] = views(), found = [];
  for (const key of "--") press(view, key);  // so that all of it stays in view
  await settled();
  found.push(extent(view));
  drag(view, [300, 100], [362.5, 50]);  // 0.5 rad to the right, 0.4 rad up
  await settled();
  console.log(JSON.stringify([...found, extent(view), [view.width, view.height]]));
});"""


def test_a_drag_turns_by_so_much(browser: Browser, page: Path) -> None:
    cloud, _ = cylinder_before_wall()
    points = cloud.points()
    points -= (points.min(axis=0) + points.max(axis=0)) / 2
    first, turned, size = map(np.array, said(browser.visit(page, script=HELPERS + TURN)))
    px_per_mm = (first[2] - first[0] + 1) / np.ptp(points[:, 0])
    # What is near, z < 0, goes with the pointer: to the right, then up.
    c, s, d, t = np.cos(0.5), np.sin(0.5), np.cos(0.4), np.sin(0.4)
    x, z = c * points[:, 0] - s * points[:, 2], s * points[:, 0] + c * points[:, 2]
    seen = np.stack([x, d * points[:, 1] + t * z], axis=1) * px_per_mm
    expected = [*(size / 2 + seen.min(axis=0)), *(size / 2 + seen.max(axis=0))]
    # A pixel of the rim, and as much of the scale over half the view.
    assert turned == pytest.approx(np.array(expected), abs=2)


BAR = """
const bars = [], pen = CanvasRenderingContext2D.prototype, { beginPath, lineTo, fillText } = pen;
let xs = [];
pen.beginPath = function () { xs = []; return beginPath.call(this); };
pen.lineTo = function (x, y) { xs.push(x); return lineTo.call(this, x, y); };
pen.fillText = function (text, ...place) {
  if (text.endsWith("mm")) bars.push([parseFloat(text), Math.max(...xs) - Math.min(...xs)]);
  return fillText.call(this, text, ...place);
};
loaded(async () => {
  const [view] = views();
  for (let i = 0; i < 3; i++) { press(view, "-"); await settled(); }
  console.log(JSON.stringify([bars.at(-1), extent(view)]));
});"""


def test_the_scale_bar_is_true(browser: Browser, page: Path) -> None:
    cloud, _ = cylinder_before_wall()
    width_mm = np.ptp(cloud.points()[:, 0])
    (mm, px), (left, _, right, _) = said(browser.visit(page, script=HELPERS + BAR))
    assert mm in (20, 50, 100, 200)
    # The cloud's rim is right to a pixel on either side.
    assert px / mm == pytest.approx((right - left + 1) / width_mm, rel=2 / (right - left))


WIDTH = """
// The browser opens wider than a telephone and narrows its window afterwards.
const tell = () => console.log(JSON.stringify([document.documentElement.scrollWidth, innerWidth]));
addEventListener("load", tell);
addEventListener("resize", tell);
"""


@pytest.mark.parametrize("width", [390, 1280])
def test_a_page_is_no_wider_than_the_screen(browser: Browser, page: Path, width: int) -> None:
    visit = browser.visit(page, width=width, height=844, script=WIDTH)
    assert json.loads(visit.console[-1]) == [width, width]


def test_the_night_is_dark(browser: Browser, page: Path) -> None:
    dark = browser.visit(page, "--blink-settings=preferredColorScheme=0", script=FRAME)
    assert dark.console == []
    assert dark.picture[5, 5].max() < 60
    assert first_view(dark.picture)[2, 2].max() < 90


STILL = """loaded(() => {
  const figures = [...document.querySelectorAll("figure.cloud-view")];
  console.log(JSON.stringify(figures.map((figure) =>
    [figure.querySelector(".still").offsetHeight > 100, figure.querySelector(".frame") === null])));
});"""


def test_without_webgl_a_still_picture_remains(browser: Browser, page: Path) -> None:
    visit = browser.visit(page, "--disable-3d-apis", script=HELPERS + STILL)
    assert said(visit) == [[True, True], [True, True]]
    assert visit.requests == set()
