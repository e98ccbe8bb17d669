"""What is seen is where the click counts: the picture on the screen against the photo's pixels."""

from __future__ import annotations

import io
import json
import math
import shutil
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter, map_coordinates

from tests.browser import SAMPLE, Driver, Served, launched, served, tab_of

#: Side of the window of the screen that is compared. [CSS px]
SIDE = 400
#: Photo pixels that the picture may be off.
WITHIN = 0.05
#: Along the seams of four tiles; within a tile; near the edge of the photo, off the middle.
PLACES = ((511.5, 511.5), (900.3, 380.7), (1400.0, 700.2))
#: Nothing over the photo: marks, names, what is picked next.
BARE = """() => document.querySelectorAll(".drawing, .badge")
  .forEach((node) => { node.style.visibility = "hidden"; })"""


@pytest.fixture(scope="module")
def speckled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Served, Any]]:
    """Serve the sample pair with speckles in place of its photos; yield these, too."""
    folder = tmp_path_factory.mktemp("speckled")
    shutil.copy(SAMPLE / "facade.pair.json", folder)
    width, height = json.loads((folder / "facade.pair.json").read_text())["image1"]["image_size"]
    rng = np.random.default_rng(7)
    # Fine grain for high zooms, coarse for low ones, where the screen shows nothing of the fine.
    photo = sum(
        gain * gaussian_filter(rng.standard_normal((height, width)), sigma) * sigma
        for gain, sigma in ((60.0, 1.0), (60.0, 3.0), (60.0, 9.0))
    )
    grey = np.clip(128 + photo, 0, 255).astype(np.uint8)
    for name in ("far.jpg", "near.jpg"):
        cv2.imwrite(str(folder / name), grey, [cv2.IMWRITE_JPEG_QUALITY, 98])
    with served(folder, "facade.pair.json") as server:
        yield server, np.asarray(Image.open(folder / "far.jpg").convert("L"), dtype=float)


@pytest.fixture(scope="module")
def screens(browser: Any) -> Iterator[dict[float, Any]]:
    """Yield browsers on screens of one and of one and a half pixels a CSS pixel.

    A true one: where it is but emulated, Chromium puts canvases on whole CSS pixels.
    """
    with launched(
        "--disable-gpu", "--force-device-scale-factor=1.5", "--window-size=1280,800"
    ) as fine:
        yield {1.0: browser, 1.5: fine}


def zoomed(page: Driver, pixel: tuple[float, float], zoom: float) -> None:
    """Turn the wheel over a pixel of photo 1 until it takes so many CSS pixels."""
    for _ in range(30):
        x, y = page.still(1, pixel)
        now = math.dist(page.screen(1, (pixel[0] + 100, pixel[1])), (x, y)) / 100
        if abs(now / zoom - 1) < 1e-3:
            return
        page.tab.mouse.move(x, y)
        page.tab.mouse.wheel(0, max(-240.0, min(240.0, -300 * math.log2(zoom / now))))
    raise AssertionError(now)


def displacement(page: Driver, photo: Any, pixel: tuple[float, float], ratio: float) -> Any:
    """Return how far right and below its place the picture is around a pixel. [photo px]"""
    page.tab.wait_for_load_state("networkidle")
    page.tab.wait_for_timeout(300)
    page.tab.evaluate(BARE)
    x, y = page.screen(1, pixel)
    box = page.pane.bounding_box()
    # Even, for whole pixels of the screen; the whole page, for the browser stretches a part of it.
    left = 2 * round(min(max(x - SIDE / 2, box["x"] + 4), box["x"] + box["width"] - SIDE - 4) / 2)
    top = 2 * round(min(max(y - SIDE / 2, box["y"] + 4), box["y"] + box["height"] - SIDE - 4) / 2)
    whole = np.asarray(Image.open(io.BytesIO(page.tab.screenshot())).convert("L"), dtype=float)
    from_left, from_top, side = round(left * ratio), round(top * ratio), round(SIDE * ratio)
    shown = whole[from_top : from_top + side, from_left : from_left + side]
    first = np.array(page.photo(1, (left, top)))
    per_pixel = (np.array(page.photo(1, (left + SIDE, top + SIDE))) - first) / SIDE / ratio
    rows, columns = np.mgrid[: shown.shape[0], : shown.shape[1]] + 0.5
    # Where the photo itself is smooth on the screen, how the browser smooths is of no weight.
    blur = max(1.2, 1.2 * per_pixel[0])
    smooth, screen = gaussian_filter(photo, blur), gaussian_filter(shown, blur / per_pixel[0])
    at = [first[1] + rows * per_pixel[1], first[0] + columns * per_pixel[0]]
    margin = math.ceil(4 * blur / per_pixel[0])
    expected = map_coordinates(smooth, at, order=3, mode="nearest")
    down, right = np.gradient(expected)
    inner = (slice(margin, -margin),) * 2
    inside = ((at[1] > 8 * blur) & (at[1] < photo.shape[1] - 8 * blur)
              & (at[0] > 8 * blur) & (at[0] < photo.shape[0] - 8 * blur))[inner]  # fmt: skip
    terms = [part[inner][inside] for part in (right, down, expected, np.ones_like(expected))]
    moved, *_ = np.linalg.lstsq(np.stack(terms, axis=1), screen[inner][inside], rcond=None)
    assert 0.8 < moved[2] < 1.2  # the same picture, and not another
    return -moved[:2] / moved[2] * per_pixel


@pytest.mark.parametrize(
    ("stage", "ratio", "zooms"),
    [
        ("points", 1.0, [1.37]),
        *(
            pytest.param(stage, ratio, [0.31, 0.83, 2.9, 7.3, 16.2], marks=pytest.mark.acceptance)
            for stage, ratio in (("points", 1.0), ("orientation", 1.5))
        ),
    ],
)
def test_what_is_seen_is_where_the_click_counts(
    screens: dict[float, Any], speckled: tuple[Served, Any], stage: str, ratio: float, zooms: Any
) -> None:
    server, photo = speckled
    size = {"viewport": None, "no_viewport": True} if ratio != 1.0 else {}
    with tab_of(screens[ratio], server, **size) as page:
        page.click(f"mode-{stage}")
        page.wait("() => document.querySelector('.stage:not([hidden]) .pane')?.offsetWidth > 99")
        if stage == "points":
            page.tab.get_by_test_id("layer-opacity").fill("0")
        for zoom in zooms:
            for pixel in PLACES:
                page.pane.focus()
                page.keys("0")
                zoomed(page, pixel, zoom)
                off = displacement(page, photo, pixel, ratio)
                assert np.hypot(*off) < WITHIN, (zoom, pixel)


#: Where a view has come to, in CSS pixels, thrown at 1 and 0.6 of them a millisecond.
THROWN = """async () => {
  const { View } = await import(new URL("js/view.js", document.baseURI));
  const view = new View(4000, 3000), [x, y] = view.centre;
  view.coast([1, 0.6]);
  for (let still = 0, last; still < 5; still = last === view.centre[0] ? still + 1 : 0) {
    last = view.centre[0];
    await new Promise((done) => setTimeout(done, 40));
  }
  return [(x - view.centre[0]) * view.zoom, (y - view.centre[1]) * view.zoom];
}"""


def test_the_wheel_and_the_hand_keep_what_is_under_the_pointer(
    browser: Any, server: Served
) -> None:
    with tab_of(browser, server, reduced_motion="no-preference") as page:
        page.empty()
        x, y = (round(value) for value in page.still(1, (900.0, 400.0)))
        under = page.photo(1, (x, y))
        before = page.screen(1, (1000.0, 400.0))[0] - page.screen(1, (900.0, 400.0))[0]
        page.tab.mouse.move(x, y)
        for _ in range(3):
            page.tab.mouse.wheel(0, -100)
            page.still(1, under)
        assert math.dist(page.screen(1, under), (x, y)) < 0.01
        after = page.screen(1, (1000.0, 400.0))[0] - page.screen(1, (900.0, 400.0))[0]
        assert after / before == pytest.approx(2.0, abs=1e-6)
        page.tab.mouse.down()
        page.tab.mouse.move(x + 90, y + 60, steps=6)
        assert math.dist(page.screen(1, under), (x + 90, y + 60)) < 0.01
        page.tab.mouse.up()
        assert not page.state["points"]  # a drag is no click
        # The speed halves every 139 ms and ends at 0.05 px a millisecond: 191 px in all.
        right, down = page.tab.evaluate(THROWN)
        assert right == pytest.approx(191.0, abs=9.5)
        assert down / right == pytest.approx(0.6, abs=1e-9)


#: Tiles of one pixel, of which every third does not come at first; how many are kept, and fetched.
STORE = """async () => {
  const { TileStore } = await import(new URL("js/tiles.js", document.baseURI));
  const canvas = new OffscreenCanvas(1, 1);
  canvas.getContext("2d");
  const blob = await canvas.convertToBlob(), real = [window.fetch, window.setTimeout];
  const soon = () => new Promise((done) => real[1].call(window, done, 0));
  const asked = new Map();
  window.setTimeout = (done) => real[1].call(window, done, 0);
  window.fetch = async (path, ...rest) => {
    if (!path.startsWith("made-up")) return real[0].call(window, path, ...rest);
    asked.set(path, (asked.get(path) ?? 0) + 1);
    if (asked.size % 3 === 0 && asked.get(path) === 1) throw new TypeError("away");
    return new Response(blob);
  };
  const store = new TileStore("made-up", { version: "1" }, () => {});
  let most = 0;
  for (let k = 0; k < 300; k += 6) {
    const places = [0, 1, 2, 3, 4, 5].map((j) => [0, k + j, 0]);
    while (places.some((place) => !store.get(...place))) {
      store.load(places);
      await soon();
    }
    most = Math.max(most, store.kept.size);
  }
  [window.fetch, window.setTimeout] = real;
  return [asked.size, most, Math.max(...asked.values())];
}"""


def test_the_last_tiles_are_kept_and_those_that_did_not_come_asked_for_anew(
    browser: Any, server: Served
) -> None:
    with tab_of(browser, server) as page:
        fetched, kept, tries = page.tab.evaluate(STORE)
        assert fetched == 300
        assert kept == 96
        assert tries == 2
