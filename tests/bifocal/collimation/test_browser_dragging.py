"""Marks and corners are dragged on the page, with and without snapping, in Chromium."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.browser import TARGETS, Driver, Served, sample_survey, tab_of, true_pixel

pytestmark = pytest.mark.browser

WINDOW = [(-3.2, -0.6), (-2.2, -0.6), (-2.2, 0.6), (-3.2, 0.6)]


@pytest.fixture(scope="module")
def served_sample(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with sample_survey(tmp_path_factory.mktemp("dragging")) as server:
        yield server


@pytest.fixture
def page(browser: Any, served_sample: Served) -> Iterator[Driver]:
    with tab_of(browser, served_sample) as driver:
        driver.empty()
        yield driver


def drag(page: Driver, start: tuple[float, float], end: tuple[float, float]) -> None:
    mouse = page.tab.mouse
    mouse.move(*map(round, start))
    mouse.down()
    mouse.move(*map(round, end), steps=4)
    mouse.up()


def test_a_mark_in_hand_is_dragged_and_the_photo_stays(page: Driver) -> None:
    page.click("mode-points")
    page.keys("n")
    page.pick(1, true_pixel(1, TARGETS["T08"]))
    point = page.settled("state.points.length === 1")["points"][0]["name"]
    before = page.still(1, (0.0, 0.0))
    target = true_pixel(1, TARGETS["T09"])
    drag(page, page.screen(1, true_pixel(1, TARGETS["T08"])), page.screen(1, target))
    moved = page.settled(f"Math.abs(state.points[0].picks[1][0] - {target[0]}) < 3")
    assert moved["points"][0]["name"] == point
    assert page.still(1, (0.0, 0.0)) == pytest.approx(before)
    page.keys("Control+z")
    page.settled("state.points[0].picks[1][0] < 500")


def outline(page: Driver) -> list[list[float]]:
    return page.settled("state.shapes.length === 1")["shapes"][0]["corners"]


def test_corners_are_typed_by_their_coordinates(page: Driver) -> None:
    page.click("mode-products")
    page.tab.get_by_test_id("face-kind").select_option("outline")
    page.click("face")
    field = page.tab.get_by_test_id("face-typed")
    field.fill("here")
    field.press("Enter")
    page.wait("() => document.body.textContent.includes('Type X; Y of a corner in metres')")
    for count, text in enumerate(("-2; 1", "1,5; 1", "1.5 -1.25"), start=1):
        field.fill(text)
        field.press("Enter")
        page.wait(f"() => document.body.textContent.includes('Corners: {count}.')")
    page.click("face-close")
    (shape,) = page.settled("state.shapes.length === 1")["shapes"]
    typed = [true_pixel(1, (x, y, 0.0)) for x, y in ((-2, 1), (1.5, 1), (1.5, -1.25))]
    assert np.abs(np.array(shape["corners"])[:, :2] - typed).max() < 0.01
    assert shape["width"] == pytest.approx(3.5, abs=1e-4)


def test_corners_are_dragged_taken_back_and_kept_from_snapping(page: Driver) -> None:
    page.click("mode-products")
    page.tab.get_by_test_id("face-kind").select_option("outline")
    page.click("face-snap")
    page.click("face")
    places = [true_pixel(1, (x, y, 0.0)) for x, y in WINDOW]
    for place in [*places[:3], (700.0, 700.0)]:
        page.pick(1, place)
    page.wait("() => document.querySelector('#stage-products').textContent.includes('Corners: 4')")
    page.pane.focus()
    page.keys("Backspace")
    page.pick(1, places[3])
    page.click("face-close")
    corners = np.array(outline(page))
    # The mouse has whole pixels; nothing snapped.
    zoom = page.screen(1, (1.0, 0.0))[0] - page.screen(1, (0.0, 0.0))[0]
    assert np.abs(corners[:, :2] - places).max() <= 0.51 / zoom
    aside = (places[0][0] - 40.0, places[0][1] + 25.0)
    drag(page, page.screen(1, places[0]), page.screen(1, aside))
    moved = page.settled(f"Math.abs(state.shapes[0].corners[0][0] - {aside[0]}) < 2")
    assert np.abs(np.array(moved["shapes"][0]["corners"])[1:] - corners[1:]).max() == 0
    page.click("face-snap")
