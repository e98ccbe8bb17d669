"""A façade under water by clicks: media typed, orientation, guide, points, against cast rays."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bifocal import WATER_SAMPLE
from tests.browser import TARGETS, Driver, served, tab_of
from tests.scenes.wet import WetCamera
from tests.workbook_lint import lint

#: Of the sample under water: the façade of `TARGETS` at a fifth. (tests/scenes/make_sample)
SHRUNK, SIZE, GSD = 0.2, (960, 640), 0.00236
INDICES, GLASS, PORT = (1.0, 1.49, 1.337), 0.01, 0.05
DISTANCES = {1: 3.5, 2: 1.9}
#: Typed as it would be read off lens and body, of a sensor 36 mm wide.
SENSOR = 36.0
MEASURED = {"T18": (1.62, 1.6, 0.08282), "T23": (2.6, -3.2, 0.1442)}


def focal(distance: float) -> float:
    """Return c of a photo whose pixel is `GSD` where the wall seems to lie. [px]"""
    _, glass, water = INDICES
    return (PORT + GLASS / glass + (distance - PORT - GLASS) / water) / GSD


def camera(image: int) -> WetCamera:
    """Return a camera as the ray caster had it."""
    distance = DISTANCES[image]
    c = focal(distance)
    return WetCamera(
        matrix=np.array([[c, 0, (SIZE[0] - 1) / 2], [0, c, (SIZE[1] - 1) / 2], [0, 0, 1.0]]),
        rotation=np.diag([1.0, -1.0, -1.0]), centre=np.array([0.0, 0.0, distance]), size=SIZE,
        indices=INDICES, thicknesses=(GLASS,), z0=PORT,
    )  # fmt: skip


def seen(image: int, place: tuple[float, float, float]) -> tuple[float, float]:
    """Return where a place of `TARGETS` is in a photo, by bisection of the ray. [px]"""
    column, row = camera(image).view_of(SHRUNK * np.array([place]))[0]
    return float(column), float(row)


def snapped(page: Driver) -> None:
    """Centre the pick in hand on its target, and wait for it."""
    page.tab.evaluate("() => { document.querySelector('[data-testid=toast]').textContent = ''; }")
    page.keys("c")
    page.wait("() => document.querySelector('[data-testid=toast]').textContent.includes('±')")
    page.settled("true")


def oriented(page: Driver) -> dict[str, Any]:
    """Type lenses, media and control points; align and accept."""
    for image, card in ((1, ".card.photo >> nth=0"), (2, ".card.photo >> nth=1")):
        typed = (focal(DISTANCES[image]) * SENSOR / SIZE[0], SENSOR)
        for label, value in zip(("Focal length", "Sensor width"), typed, strict=True):
            page.tab.locator(card).get_by_label(label).fill(f"{value:.4f}")
            page.keys("Enter")
    page.tab.get_by_test_id("media").locator("summary").click()
    page.tab.get_by_label("Index of the water").fill("13,37")
    page.keys("Enter")
    page.wait("() => document.querySelector('[data-testid=toast]').textContent.includes('1.34')")
    for label, value in (
        ("Index of the water", "1,337"), ("Index of the glass", "1.49"),
        ("Thickness of the glass", "0,01"), ("Camera to the port", "0.05"),
    ):  # fmt: skip
        page.tab.get_by_label(label).fill(value)
        page.keys("Enter")
    page.settled("state.setup.port === 0.05 && state.setup.water_index === 1.337")
    page.tab.get_by_role("button", name="Next: orientation").click()
    rows = []
    for name, place in TARGETS.items():
        pixels = [value for image in (1, 2) for value in seen(image, place)]
        if not (
            2 < pixels[2] < SIZE[0] - 2 and 2 < pixels[3] < SIZE[1] - 2
        ):  # not in the near photo
            continue
        numbers = [f"{v:.5f}" for v in SHRUNK * np.array(place)] + [f"{v:.2f}" for v in pixels]
        rows.append("\t".join((name, *numbers)))
    page.click("control-paste")
    page.tab.get_by_test_id("paste-area").fill("\n".join(rows))
    page.click("dialog-yes")
    # What the control points tell before anything is aligned is told of bent rays.
    live = page.settled(f"state.live?.distances?.length && state.control.length === {len(rows)}")
    assert live["live"]["distances"] == pytest.approx([3.5, 1.9], abs=0.02)
    page.click("align")
    job = page.finished("align")
    assert job["state"] == "done", job["message"]
    page.click("align-accept")
    return page.settled("state.pair?.accepted")


@pytest.mark.acceptance
def test_a_facade_under_water_is_oriented_and_measured_by_clicks(
    browser: Any, tmp_path: Path
) -> None:
    for name in ("far.jpg", "near.jpg"):
        shutil.copy(WATER_SAMPLE / name, tmp_path)
    with served(tmp_path, "far.jpg", "near.jpg") as server, tab_of(browser, server) as page:
        page.click("mode-photos")
        pair = oriented(page)["pair"]
        for shown, distance in zip(pair["images"], DISTANCES.values(), strict=True):
            assert shown["distance"] == pytest.approx(distance, abs=0.02)
            assert shown["media"]["indices"] == list(INDICES)
            assert shown["media"]["z0"] == PORT
        told = page.tab.get_by_test_id("orientation-values")
        page.click("mode-orientation")  # after *Accept* the page goes on to the points
        told.get_by_text("1.4900 (10.0 mm)").wait_for()
        page.click("mode-points")
        for count, place in enumerate(MEASURED.values(), start=1):
            page.click("pick")
            page.pick(1, seen(1, place))
            page.suggested()
            page.keys("1")
            snapped(page)
            picked = page.state["points"][-1]["picks"]["1"]
            assert np.hypot(*np.subtract(picked, seen(1, place))) < 0.15
            page.suggested()
            page.click("accept")
            point = page.settled(f"state.points[{count - 1}]?.result")["points"][-1]
            page.keys("2")
            snapped(page)
            result = page.settled("state.points.at(-1).result")["points"][-1]["result"]
            off = result["r"] - SHRUNK * place[2]
            # In air it would be 80 mm off.
            assert abs(off) < min(3 * result["sigma_r"], 0.012), point
            assert [result["X"], result["Y"]] == pytest.approx(
                [SHRUNK * v for v in place[:2]], abs=0.004
            )
            ask = {"image": 1, "column": picked[0], "row": picked[1]}
            answer = page.context.request.post(server.origin + "/api/line", data=ask)
            line = np.array(answer.json()["line"])
            assert _from_line(line, seen(2, place)) < 0.3
        page.wait("() => bifocal.state().workbook_waiting === null")
        book = tmp_path / page.state["workbook"]
        for _ in range(100):
            if book.exists():
                break
            page.tab.wait_for_timeout(100)
        assert lint(book) == []


def _from_line(line: Any, place: tuple[float, float]) -> float:
    """Return how far a place is from a polyline. [px]"""
    start, along = line[:-1], np.diff(line, axis=0)
    away = np.array(place) - start
    share = np.clip((away * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
    return float(np.linalg.norm(away - share[:, None] * along, axis=1).min())
