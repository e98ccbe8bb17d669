"""A whole façade by clicks alone, from two photos to the drawing; and how smooth it all is."""

from __future__ import annotations

import base64
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest

from tests.browser import (
    PATIENCE,
    SAMPLE,
    TARGETS,
    Driver,
    sample_survey,
    served,
    tab_of,
    true_pixel,
)
from tests.page_session import opened

CHECKED = {"T17": (-1.62, 1.6, 0.08332), "T18": (1.62, 1.6, 0.08282)}


DROP = """(files) => {
  const transfer = new DataTransfer();
  for (const [name, data] of files) {
    const bytes = Uint8Array.from(atob(data), (one) => one.charCodeAt(0));
    transfer.items.add(new File([bytes], name, { type: "image/jpeg" }));
  }
  window.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, cancelable: true }));
}"""


def dropped(page: Driver, photos: list[Path]) -> None:
    """Drop files on the page, as a file manager does."""
    files = [[photo.name, base64.b64encode(photo.read_bytes()).decode()] for photo in photos]
    page.tab.evaluate(DROP, files)


@pytest.mark.acceptance
@pytest.mark.long
def test_a_facade_from_two_photos_to_the_drawing_by_clicks_alone(
    browser: Any, tmp_path: Path
) -> None:
    with served(tmp_path) as server, tab_of(browser, server) as page:
        dropped(page, [SAMPLE / name for name in ("near.jpg", "far.jpg")])
        page.settled("state.photos.length === 2")
        page.unfold("site")
        page.tab.get_by_label("Far distance d1").fill("17.50")
        page.tab.get_by_label("Sigma of d1").fill("0,01")
        page.tab.get_by_label("Near distance d2").fill("9.5")
        page.keys("Enter")
        page.settled("state.setup.d2 === 9.5 && state.setup.sigma_d1 === 0.01")
        page.click("next")
        page.pick_control(TARGETS)
        page.click("align")
        assert page.finished("align")["state"] == "done"
        page.click("align-accept")
        page.settled("state.pair.accepted")
        page.click("mode-points")
        for count, place in enumerate(CHECKED.values(), start=1):
            page.click("pick")
            page.pick(1, true_pixel(1, place))
            page.suggested()
            page.click("accept")
            point = page.settled(f"state.points[{count - 1}]?.result")["points"][-1]
            assert point["result"]["r"] == pytest.approx(place[2], abs=0.04)
        page.click("mode-products")
        page.tab.get_by_test_id("relief-quality").select_option("fast")
        page.click("run-relief")
        page.click("cancel-relief")
        assert page.finished("relief")["state"] == "cancelled"
        page.click("run-relief")
        page.settled("state.jobs.filter((job) => job.kind === 'relief').length === 2")
        assert page.finished("relief")["state"] == "done"
        legend = "document.querySelector('[data-testid=relief-legend]')"
        page.wait(f"() => !{legend}.hidden && {legend}.textContent.endsWith(' m')")
        page.tab.mouse.move(*page.screen(1, true_pixel(1, CHECKED["T17"])))
        value = "document.querySelector('[data-testid=relief-value]')"
        page.wait(f"() => {value}.textContent.includes('r 0.0')")
        page.click("profile")
        for x in (-3.0, 3.0):
            page.tab.mouse.click(*page.screen(1, true_pixel(1, (x, 1.6, 0.0))))
        page.tab.locator(".profile .curve").wait_for()
        with page.tab.expect_download() as got:
            page.click("profile-csv")
        head, *rows = Path(got.value.path()).read_text().splitlines()
        along = [float(row.split(",")[0]) for row in rows]
        assert head == "distance [m],X [m],Y [m],r [m],sigma_r [m]"
        assert along[-1] == pytest.approx(6.0, abs=0.05)
        with page.tab.expect_download() as got:
            page.click("profile-xlsx")
        sheet = openpyxl.load_workbook(io.BytesIO(Path(got.value.path()).read_bytes()))["Profile"]
        assert sheet.cell(sheet.max_row, 1).value == pytest.approx(along[-1], abs=1e-4)
        page.click("profile-keep")
        page.tab.get_by_test_id("ortho-swipe").fill("0")
        page.click("face")
        for x, y in ((-0.6, 0.2), (0.6, 0.2), (0.6, 1.8)):
            page.tab.mouse.click(*page.screen(1, true_pixel(1, (x, y, 0.0))))
        page.click("face-close")
        shape = page.settled("state.shapes.length === 1")["shapes"][0]
        assert shape["kind"] == "face"
        assert (tmp_path / "survey.faces.geojson").is_file()
        page.click("run-ortho")
        assert page.finished("ortho")["state"] == "done"
        page.tab.get_by_test_id("deliver-scale").select_option("1:100")
        page.tab.get_by_test_id("deliver-title").fill("North front")
        page.click("deliver")
        told = page.finished("deliver")
        assert told["state"] == "done"
        assert "--" not in told["message"]  # the page has no options of the command line
        with page.tab.expect_download() as got:
            page.click("download")
        archive = Path(got.value.path()).read_bytes()
    with zipfile.ZipFile(io.BytesIO(archive)) as package:
        assert package.testzip() is None
        page_of_client = next(n for n in package.namelist() if n.endswith("_handover.html"))
        (tmp_path / "client.html").write_bytes(package.read(page_of_client))
        names = package.namelist()
        drawing = next(name for name in names if name.endswith(".pdf"))
        assert package.read(drawing).startswith(b"%PDF-")
    kinds = {Path(name).suffix for name in names}
    assert kinds >= {".pdf", ".dxf", ".tif", ".xlsx", ".json", ".html", ".jpg", ".geojson"}
    client_measures(browser, tmp_path / "client.html")


def client_measures(browser: Any, path: Path) -> None:
    """Measure a known width on the file that is handed over, which asks nobody for anything."""
    tab = browser.new_page(viewport={"width": 1200, "height": 800})
    asked: list[str] = []
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(path.as_uri())
    tab.wait_for_function("() => relief && images[0].complete")
    tab.click("#measure")
    left, right = (
        tab.evaluate("([X, Y]) => screen(pixel(DATA.layers[0], [X, Y]))", [x, 1.6])
        for x in (-1.62, 1.62)
    )
    box = tab.locator("canvas").bounding_box()
    for x, y in (left, right):
        tab.mouse.click(box["x"] + x, box["y"] + y)
    assert float(tab.inner_text("#value-width")[:-2]) == pytest.approx(3.24, abs=0.03)
    assert {url.partition(":")[0] for url in asked} <= {"file", "data"}
    tab.close()


@pytest.mark.acceptance
@pytest.mark.long
def test_a_thousand_points_pan_nearly_as_smoothly_as_none(browser: Any, tmp_path: Path) -> None:
    """Beside the same page without points, for machines and their load differ."""
    places = np.random.default_rng(5).uniform((20, 20), (1500, 1000), (1000, 2)).tolist()
    with sample_survey(tmp_path) as server, tab_of(browser, server) as page:
        page.tab.wait_for_timeout(800)
        empty = page.frames()
    points = [{"name": f"Q{k:04d}", "picks": [at, at]} for k, at in enumerate(places)]
    with opened(tmp_path / "facade.pair.json") as session:
        session.command({"op": "points.add", "points": points})
    with served(tmp_path, "facade.pair.json") as server, tab_of(browser, server) as page:
        page.settled("state.points.length === 1000")
        assert page.tab.get_by_test_id("point-list").locator("tbody tr").count() == 1000
        page.tab.wait_for_timeout(500)
        full = page.frames()
    # Measured: 17 ms (median) without and with a thousand points (benchmarks/bench_page.py).
    assert np.median(full) < max(2 * np.median(empty), 40)


@pytest.mark.acceptance
def test_photos_dropped_near_one_first_are_exchanged_and_an_acceptance_is_undone(
    browser: Any, tmp_path: Path
) -> None:
    """Typed by the cards; the sample hides too little to tell its order, so it is asked."""
    with served(tmp_path) as server, tab_of(browser, server) as page:
        dropped(page, [SAMPLE / name for name in ("near.jpg", "far.jpg")])
        page.settled("state.photos.length === 2")
        for image, focal in ((1, 35), (2, 19)):
            page.command("photo.set", image=image, focal_mm=focal, sensor_width_mm=22.7)
        page.command("setup.set", d1=17.5, d2=9.5)
        names = [photo["name"] for photo in page.settled("state.setup.d2 === 9.5")["photos"]]
        page.click("mode-orientation")
        # Looking for the wall gives way to everything else on the computer.
        page.tab.get_by_test_id("align").click(timeout=4 * PATIENCE)
        assert "cannot be told" in page.finished("align")["message"]
        assert "cannot be told" in page.settled("state.pair")["advice"][0]
        page.click("align-accept")
        page.settled("state.pair.accepted")
        page.click("undo")
        page.settled("state.pair.accepted === false")
        page.click("mode-orientation")
        page.click("exchange")
        after = page.settled("state.pair === null")
        assert [photo["name"] for photo in after["photos"]] == names[::-1]
        assert [photo["focal_mm"] for photo in after["photos"]] == [35, 19]
        page.click("exchange")
        # What was there before the exchange is there again.
        assert (
            page.settled("state.photos[0].name === argument", names[0])["pair"]["accepted"] is False
        )
