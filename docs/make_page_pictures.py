"""Write the pictures of docs/picking.md from the page itself: `python docs/make_page_pictures.py`.

Wants Chromium. The sample pair is taken from two photos to the relief, by clicks.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from tests.browser import (  # noqa: E402
    SAMPLE,
    TARGETS,
    Driver,
    launched,
    served,
    tab_of,
    true_pixel,
)

VIEW = {"width": 1360, "height": 800}
WIDTH, QUALITY = 1000, 70


def picture(page: Driver, name: str) -> None:
    """Write docs/images/page-NAME.jpg, and the same in light colours."""
    for ending in ("", "-light"):
        page.tab.wait_for_timeout(1200)
        shot = Image.open(io.BytesIO(page.tab.screenshot())).convert("RGB")
        shot = shot.resize((WIDTH, round(shot.height * WIDTH / shot.width)), Image.LANCZOS)
        path = HERE / "images" / f"page-{name}{ending}.jpg"
        shot.save(path, quality=QUALITY, optimize=True)
        page.click("theme")


def orient(page: Driver, photos: list[str]) -> None:
    """Photos and their lenses; the wall found by itself, one length, accepted."""
    picture(page, "start")
    page.tab.get_by_test_id("photo-files").set_input_files(photos)
    page.settled("state.photos.length === 2")
    # The sample's photos have no EXIF data.
    for image, focal in ((1, 35), (2, 19)):
        page.command("photo.set", image=image, focal_mm=focal, sensor_width_mm=22.7)
    page.settled("state.photos.every((photo) => photo.focal_mm)")
    picture(page, "photos")
    page.click("next")
    page.tab.wait_for_function(
        "() => bifocal.state().pair && !bifocal.state().looking", timeout=4e5
    )
    page.tab.wait_for_timeout(800)
    for name in ("T08", "T09"):
        page.pick(1, true_pixel(1, TARGETS[name]))
        page.tab.wait_for_timeout(800)
    picture(page, "orientation")
    page.tab.get_by_test_id("length-value").fill("8.80")
    page.keys("Enter")
    page.settled("state.pair.scaled")
    page.click("next")
    page.settled("state.pair.accepted")


def collimate(page: Driver) -> None:
    """Points, the last one with its suggestion still open."""
    page.tab.wait_for_timeout(1500)
    for name in ("T08", "T20", "T15", "T28", "T19"):
        page.keys("n")
        page.pick(1, true_pixel(1, TARGETS[name]))
        page.suggested()
        if name != "T19":
            page.keys("a")
            page.settled("state.points.at(-1)?.result")
    page.zoom_to(1, true_pixel(1, TARGETS["T19"]), 3.0)
    picture(page, "points")
    page.keys("a")


def make_relief(page: Driver) -> None:
    """Relief map and a profile across the door."""
    page.click("next")
    page.click("deliver")
    page.finished("deliver")
    page.tab.wait_for_timeout(3000)
    page.click("profile")
    for x in (-5.2, 5.2):
        page.tab.mouse.click(*page.screen(1, true_pixel(1, (x, -1.2, 0.0))))
    page.tab.locator(".profile").wait_for()
    page.tab.wait_for_timeout(6500)  # until the last message has gone
    picture(page, "products")


def main() -> None:
    """Write all pictures."""
    with tempfile.TemporaryDirectory() as name, launched() as browser:
        folder = Path(name)
        photos = [folder / "photos" / photo for photo in ("far.jpg", "near.jpg")]
        photos[0].parent.mkdir()
        (folder / "survey").mkdir()
        for photo in photos:
            shutil.copy(SAMPLE / photo.name, photo)
        with (
            served(folder / "survey") as server,
            tab_of(browser, server, viewport=VIEW) as page,
        ):
            page.tab.set_default_timeout(120_000)
            orient(page, [str(photo) for photo in photos])
            collimate(page)
            make_relief(page)


if __name__ == "__main__":
    main()
