"""A real façade from nothing to the package with thirty clicks, or with none: by keys alone.

Italian, at 1024 x 768: photos, orientation by one length, ten points, orthophoto, download. Photos
of half their size, for the relief's sake.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.bifocal.collimation.test_browser_scenes import SCENES, Places, places_of
from tests.browser import Driver, served, tab_of

SCREEN = {"width": 1024, "height": 768}
#: Both on the wall; how far they are apart is told by the scene's own table.
LENGTH = ("28807", "29528")
MOST_CLICKS = 30
ARROWS = (("ArrowLeft", "ArrowRight"), ("ArrowUp", "ArrowDown"))


def halved(source: Path, folder: Path, names: tuple[str, str]) -> list[str]:
    """Write both photos at half their size; return where."""
    folder.mkdir()
    for name in names:
        with Image.open(source / name) as photo:
            photo.reduce(2).save(folder / name, quality=95)
    return [str(folder / name) for name in names]


def halved_places(places: Places) -> Places:
    """Return places with the pixels of photos of half the size."""
    return {
        name: (xyz, (first + 0.5) / 2 - 0.5, (second + 0.5) / 2 - 0.5)
        for name, (xyz, first, second) in places.items()
    }


class Hand:
    """Works the page: with the mouse, counting clicks, or with keys alone."""

    def __init__(self, page: Driver, *, mouse: bool) -> None:
        self.page, self.mouse, self.clicks = page, mouse, 0

    def press(self, testid: str) -> None:
        """Press a button."""
        if self.mouse:
            self.page.click(testid)
            self.clicks += 1
            return
        self.reach(testid)
        self.page.keys("Enter")

    def reach(self, testid: str) -> None:
        """Go to a control by Tab."""
        for _ in range(120):
            if self.page.tab.evaluate("() => document.activeElement.dataset?.testid") == testid:
                return
            self.page.keys("Tab")
        raise AssertionError(f"Tab never comes to {testid}")

    def point_at(self, image: int, pixel: np.ndarray) -> None:
        """Click a place of a photo, or move the cross there and press Enter."""
        if self.mouse:
            self.page.pick(image, (pixel[0], pixel[1]))
            self.clicks += 1
            return
        self.page.tab.evaluate("() => document.activeElement.blur()")
        self.page.keys("k")
        box = self.page.tab.locator(".pane:visible").nth(self.pane_of(image)).bounding_box()
        here = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        off = np.array(self.page.screen(image, (pixel[0], pixel[1]))) - here
        for way, keys in zip(off.round().astype(int), ARROWS, strict=True):
            key, left = keys[int(way > 0)], abs(int(way))
            for name, step in (("Shift+", 50), ("", 10), ("Alt+", 1)):
                for _ in range(left // step):
                    self.page.keys(name + key)
                left %= step
        self.page.keys("Enter")

    def pane_of(self, image: int) -> int:
        """Return which of the panes in sight a cross appears in."""
        return image - 1 if self.page.tab.locator(".pane:visible").count() > 1 else 0


def give(page: Driver, hand: Hand, photos: list[str]) -> None:
    """Choose both photos in the dialog that the file field opens."""
    with page.tab.expect_file_chooser() as asked:
        if hand.mouse:
            page.tab.locator("label[for=photo-files]").click()
            hand.clicks += 1
        else:
            hand.reach("photo-files")
            page.keys("Enter")
    asked.value.set_files(photos)
    page.settled("state.photos.length === 2")
    hand.press("next")


def orient(page: Driver, hand: Hand, places: Places) -> None:
    """Wait for the wall, give one length, accept."""
    page.tab.wait_for_function(
        "() => bifocal.state().pair && !bifocal.state().looking", timeout=400_000
    )
    page.tab.wait_for_timeout(500)
    ends = [places[name] for name in LENGTH]
    for end in ends:
        hand.point_at(1, end[1])
        page.tab.wait_for_timeout(800)
    length = np.linalg.norm(ends[0][0][:2] - ends[1][0][:2])
    page.tab.keyboard.type(f"{length:.3f}".replace(".", ","))
    page.keys("Enter")
    page.settled("state.pair.scaled")
    hand.press("next")
    page.settled("state.pair.accepted && state.stage === 'points'")


def measure(page: Driver, hand: Hand, places: Places, names: list[str]) -> None:
    """Pick points in the far photo and accept what is suggested in the near one."""
    page.tab.wait_for_timeout(1500)
    for count, name in enumerate(names, start=1):
        hand.point_at(1, places[name][1])
        page.wait(f"() => bifocal.state().points.length === {count}")
        page.suggested()
        if hand.mouse:
            hand.press("accept")
        else:
            page.keys("a")
        page.settled(f"state.points[{count - 1}]?.result")


@pytest.mark.acceptance
@pytest.mark.long
@pytest.mark.parametrize("way", ["mouse", "keys"])
def test_photos_to_package_in_thirty_clicks(
    browser: Any, tmp_path: Path, data_dir: Path, way: str
) -> None:
    folder, photos, table, columns, *_ = SCENES["church_2"]
    source = data_dir / folder
    places = halved_places(places_of(source / table, columns))
    given = halved(source, tmp_path / "from site", photos)
    (tmp_path / "survey").mkdir()
    with (
        served(tmp_path / "survey", "--lang", "it") as server,
        tab_of(browser, server, viewport=SCREEN) as page,
    ):
        hand = Hand(page, mouse=way == "mouse")
        give(page, hand, given)
        orient(page, hand, places)
        far = page.state["pair"]["images"][0]["distance"]
        assert far == pytest.approx(14.537, rel=0.02)
        names = in_sight(page, places)
        measure(page, hand, places, names)
        points = page.state["points"]
        off = [
            point["result"]["r"] - places[name][0][2]
            for point, name in zip(points, names, strict=True)
        ]
        assert np.median(np.abs(off)) < 0.05
        hand.press("next")
        page.tab.get_by_test_id("relief-quality").select_option("fast")
        hand.press("deliver")
        page.tab.wait_for_function(
            "() => bifocal.state().jobs.at(-1).state !== 'running'", timeout=900_000
        )
        assert page.finished("deliver")["state"] == "done"
        with page.tab.expect_download() as got:
            hand.press("next")
        with zipfile.ZipFile(io.BytesIO(Path(got.value.path()).read_bytes())) as package:
            kinds = {Path(name).suffix for name in package.namelist()}
    assert kinds >= {".pdf", ".dxf", ".tif", ".xlsx", ".json", ".html", ".jpg"}
    assert hand.clicks <= MOST_CLICKS


def in_sight(page: Driver, places: Places) -> list[str]:
    """Return ten points, spread over the photo, of a relief that is no gross error of the table."""
    names = sorted(name for name, (xyz, *_) in places.items() if abs(xyz[2]) < 0.6)
    shown = {name: page.screen(1, tuple(places[name][1])) for name in names[::5]}
    box = page.pane.bounding_box()
    inside = [
        name for name, (x, y) in shown.items()
        if 30 < x - box["x"] < box["width"] - 30 and 60 < y - box["y"] < box["height"] - 30
    ]  # fmt: skip
    return inside[:: max(len(inside) // 10, 1)][:10]
