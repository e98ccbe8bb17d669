"""A survey in the browser survives: undo, reload, two tabs, a killed server; and equals `solve`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from bifocal.cli.solve import command
from tests.browser import Driver, Served, sample_survey, tab_of

PICKS = [((300.0, 330.0), (293.0, 325.0)), ((1190.0, 700.0), (1196.0, 703.0))]


#: Note what is written on each canvas since it was cleared: text, left, right, base. [px]
TEXTS = """() => {
  window.written = new Map();
  const lettered = new Map();
  const { fillText, clearRect, drawImage } = CanvasRenderingContext2D.prototype;
  CanvasRenderingContext2D.prototype.clearRect = function (...area) {
    written.set(this.canvas, []);
    return clearRect.apply(this, area);
  };
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
    lettered.set(this.canvas, [text, x, x + this.measureText(text).width, y]);
    return fillText.call(this, text, x, y);
  };
  CanvasRenderingContext2D.prototype.drawImage = function (image, x, y, ...size) {
    const [text, left, right, base] = lettered.get(image) ?? [];
    if (text) written.get(this.canvas)?.push([text, x + left, x + right, y + base]);
    return drawImage.call(this, image, x, y, ...size);
  };
  // Texts are lettered once, and anew in a window of another size.
  window.dispatchEvent(new Event("resize"));
}"""


@pytest.fixture
def page(browser: Any, server: Served) -> Iterator[Driver]:
    """Yield the page with no points."""
    with tab_of(browser, server) as driver:
        driver.empty()
        yield driver


def pick_both(page: Driver, count: int, first: Any, second: Any) -> dict[str, Any]:
    page.keys("n")
    page.pick(1, first)
    page.settled(f"state.points.length === {count}")
    page.pick(2, second)
    return page.settled(f"state.points[{count - 1}]?.result")


def relief_of(book: Path) -> dict[str, float]:
    """Return what `bifocal solve` says of a workbook, or nothing while it is not there."""
    run = CliRunner().invoke(command, [str(book), "--json"]) if book.exists() else None
    if run is None or run.exit_code:
        return {}
    return {point["id"]: point["r"] for point in json.loads(run.stdout)["points"]}


SLOW_STATE = """() => {
  const real = window.fetch;
  window.fetch = async (path, ...rest) => {
    if (path === "api/state") await new Promise((done) => setTimeout(done, 700));
    return real(path, ...rest);
  };
}"""


@pytest.mark.acceptance
def test_a_job_that_is_done_shows_what_it_made_at_once(browser: Any, tmp_path: Path) -> None:
    """However long the state takes that tells of the new files."""
    with sample_survey(tmp_path) as server, tab_of(browser, server) as page:
        page.click("mode-products")
        size = page.tab.get_by_label("Pixel on the wall")
        size.fill("20 x")
        page.click("run-ortho")
        assert not size.evaluate("(field) => field.checkValidity()")
        assert page.state["jobs"] == []
        size.fill("20")
        page.tab.evaluate(SLOW_STATE)
        page.click("run-ortho")
        shown = page.wait(
            "() => bifocal.state().jobs.some(({ state }) => state === 'done') && bifocal.state()"
        )
        assert any(one["name"].endswith(".tif") for one in shown["products"]["files"])
        assert shown["products"]["ortho"]


@pytest.mark.acceptance
def test_noisy_picks_give_the_relief_that_solve_gives(page: Driver) -> None:
    """Clicks with 0.3 px of noise: the page's numbers against the workbook's, solved anew."""
    rng = np.random.default_rng(14)
    for count, (first, second) in enumerate(PICKS, start=1):
        noise = rng.normal(0, 0.3, (2, 2))
        pick_both(page, count, np.add(first, noise[0]), np.add(second, noise[1]))
    shown = {point["name"]: point["result"]["r"] for point in page.state["points"]}
    book = page.server.folder / page.state["workbook"]
    # The workbook is written a moment after the journal: till then with points of another test.
    for _ in range(100):
        solved = relief_of(book)
        if solved.keys() == shown.keys() and None not in solved.values():
            break
        page.tab.wait_for_timeout(600)
    assert solved == pytest.approx(shown, abs=1e-9, rel=1e-9)


def test_what_was_picked_is_there_after_a_reload_and_can_be_undone(page: Driver) -> None:
    before = pick_both(page, 1, *PICKS[0])["points"]
    page.tab.reload()
    page.wait("() => window.bifocal")
    assert page.state["points"] == before
    page.click("undo")
    page.settled("state.points[0].picks[2] === null")
    page.click("undo")
    page.settled("state.points.length === 0")
    page.click("redo")
    page.click("redo")
    assert page.settled("state.points[0]?.result")["points"] == before


def test_two_tabs_see_each_other_and_lose_nothing(
    page: Driver, browser: Any, server: Served
) -> None:
    one = page
    with tab_of(browser, server) as other:
        first = pick_both(one, 1, *PICKS[0])["points"][0]
        other.settled("state.points[0]?.result")
        pick_both(other, 2, *PICKS[1])
        state = one.settled("state.points[1]?.result")
        assert state["points"][0] == first
        # Both move the same pick: the last one wins in both tabs.
        for tab, key in ((one, "ArrowUp"), (other, "ArrowLeft")):
            tab.tab.evaluate("() => bifocal.flyTo('P01')")
            tab.keys("2", key)
            tab.settled("true")
            revision = tab.state["revision"]
            for each in (one, other):
                each.settled("state.revision >= argument", revision)
        moved = other.state["points"][0]["picks"]["2"]
        one.settled("state.points[0].picks[2][0] === argument", moved[0])
        assert one.state["points"] == other.state["points"]
        assert np.subtract(first["picks"]["2"], moved) == pytest.approx((0.1, 0.1), abs=1e-9)


@pytest.mark.acceptance
def test_a_killed_server_loses_nothing_and_the_page_goes_on(browser: Any, tmp_path: Path) -> None:
    with sample_survey(tmp_path) as server, tab_of(browser, server) as page:
        before = pick_both(page, 1, *PICKS[0])["points"][0]["picks"]["2"]
        server.kill()
        page.keys("2", "ArrowRight", "Shift+ArrowDown")
        link = "() => document.querySelector('[data-testid=link]').dataset.level"
        page.wait(f"() => ({link})() === 'warn'")
        # Typed while nobody listens: shown, kept, and sent when the server is back.
        server.start()
        page.wait(f"() => ({link})() === 'good'")
        state = page.settled("state.points.length === 1 && state.points[0].result")
        after = state["points"][0]["picks"]["2"]
        assert np.subtract(after, before) == pytest.approx((0.1, 1.0), abs=1e-9)
        pick_both(page, 2, *PICKS[1])


def test_names_of_neighbours_do_not_cover_each_other_and_long_ones_lose_their_middle(
    page: Driver,
) -> None:
    column, row = PICKS[1][0]
    for k in range(30):
        name = f"P{k:02d}" if k else "APRILTAG_36h11 north tower-0012"
        place = {"column": column + 9 * (k % 6), "row": row + 7 * (k // 6)}
        page.command("point.pick", name=name, image=1, **place)
    page.tab.evaluate(TEXTS)
    page.keys("+", "-")
    names = "[...written.values()].flat().filter(([text]) => /^P\\d\\d$|^APRIL/.test(text))"
    page.wait(f"() => {names}.length > 2")
    drawn = page.tab.evaluate(f"() => {names}")
    assert "APRILTAG_…wer-0012" in [text for text, *_ in drawn]
    assert 2 < len(drawn) < 31  # what has no room stands in the list
    for first, (_, left, right, base) in enumerate(drawn):
        for _, other, end, line in drawn[first + 1 :]:
            assert end < left or other > right or abs(line - base) >= 14
