"""The page with a pair of 24 MP: first paint, suggestion, frames a second, a thousand points.

``python -m benchmarks.bench_page`` (wants Chromium), ``... bench_page 100`` for photos of 100 MP,
which also tells the server's memory. The photos are those of the sample, enlarged.
Baseline in the same run: the browser's own frame rate on an empty page.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tests.browser import SAMPLE, WATCH, Driver, Served, launched, served, tab_of
from tests.page_session import opened

#: Megapixels of a photo, three to two.
MEGAPIXELS = float(sys.argv[1]) if len(sys.argv) > 1 else 24.0
HEIGHT = round((MEGAPIXELS * 1e6 / 1.5) ** 0.5)
WIDTH, POINTS = round(1.5 * HEIGHT), 1000


def enlarged(folder: Path) -> None:
    """Write the sample pair at 24 MP."""
    data = json.loads((SAMPLE / "facade.pair.json").read_text())
    for name, key in (("far.jpg", "image1"), ("near.jpg", "image2")):
        photo = cv2.imread(str(SAMPLE / name))
        factors = np.array([photo.shape[1] / WIDTH, photo.shape[0] / HEIGHT])
        larger = cv2.resize(photo, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(folder / name), larger, [cv2.IMWRITE_JPEG_QUALITY, 92])
        # Pixel of the small photo from that of the large one: centres at whole numbers.
        scale = np.diag([*factors, 1.0])
        scale[:2, 2] = (factors - 1) / 2
        data[key]["image_size"] = [WIDTH, HEIGHT]
        data[key]["plane_from_pixel"] = (np.array(data[key]["plane_from_pixel"]) @ scale).tolist()
    (folder / "facade.pair.json").write_text(json.dumps(data))


def memory(server: Served) -> str:
    """Say the largest memory the server had, and its processor time."""
    assert server.process is not None
    place = Path(f"/proc/{server.process.pid}")
    if not place.is_dir():
        return "not known on this system"
    peak = next(line for line in (place / "status").read_text().splitlines() if "VmHWM" in line)
    fields = (place / "stat").read_text().rsplit(")", 1)[1].split()
    seconds = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return f"{int(peak.split()[1]) / 1e6:.2f} GB at most, {seconds:.1f} s of CPU so far"


def spread(times: Any) -> str:
    """Say the median, the 95th percentile and the largest of some times. [ms]"""
    low, high, worst = np.percentile(times, [50, 95, 100])
    return f"median {low:6.1f} ms, 95 % {high:6.1f} ms, largest {worst:6.1f} ms"


def first_paint(browser: Any, server: Served) -> float:
    """Return seconds from asking for the page to its photos standing there."""
    started = time.perf_counter()
    with tab_of(browser, server) as page:
        page.wait(
            "() => performance.getEntriesByType('resource')"
            ".filter((one) => one.name.includes('/tiles/wall/') && one.responseEnd).length >= 3"
        )
        page.tab.evaluate("() => new Promise((done) => requestAnimationFrame(done))")
        return time.perf_counter() - started


def asked(page: Driver, count: int = 20) -> Any:
    """Return the milliseconds that suggestions take."""
    script = """async ([column, row]) => { const start = performance.now();
      await (await fetch("api/suggest", { method: "POST", headers: { "Content-Type":
        "application/json" }, body: JSON.stringify({ image: 1, column, row }) })).json();
      return performance.now() - start; }"""
    rng = np.random.default_rng(3)
    places = rng.uniform((600, 600), (WIDTH - 600, HEIGHT - 600), (count, 2)).tolist()
    return np.array([page.tab.evaluate(script, place) for place in places])


def thousand(pair: Path) -> None:
    """Write points into the survey of a pair."""
    rng = np.random.default_rng(5)
    places = rng.uniform((20, 20), (WIDTH - 20, HEIGHT - 20), (POINTS, 2)).tolist()
    points = [{"name": f"Q{k:04d}", "picks": [p, p]} for k, p in enumerate(places)]
    with opened(pair) as session:
        session.command({"op": "points.add", "points": points})


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder, launched() as browser:
        enlarged(Path(folder))
        with served(Path(folder), "facade.pair.json") as server:
            print(f"first paint, not yet tiled     {first_paint(browser, server):.2f} s")
            time.sleep(8)
            print(f"server, tiled                  {memory(server)}")
            times = [first_paint(browser, server) for _ in range(5)]
            middle, worst = np.median(times), max(times)
            print(f"first paint, tiled             {middle:.2f} s, at worst {worst:.2f} s")
            with tab_of(browser, server) as page:
                page.tab.wait_for_timeout(1500)
                asked(page, 2)
                print(f"suggestion                     {spread(asked(page))}")
                page.frames()
                print(f"frames, two layers             {spread(page.frames())}")
        thousand(Path(folder) / "facade.pair.json")
        with served(Path(folder), "facade.pair.json") as server:
            with tab_of(browser, server) as page:
                started = time.perf_counter()
                page.settled(f"state.points.length === {POINTS}")
                print(f"{POINTS} points arrive            {time.perf_counter() - started:.2f} s")
                page.tab.wait_for_timeout(500)
                print(f"frames, {POINTS} points           {spread(page.frames())}")
                page.tab.evaluate("() => bifocal.flyTo('Q0001')")
                started = time.perf_counter()
                page.keys("1", *["ArrowRight"] * 10)
                page.settled("true")
                print(f"ten nudges, saved              {time.perf_counter() - started:.2f} s")
            print(f"server, at the end             {memory(server)}")
            blank = browser.new_page()
            blank.evaluate(WATCH)
            blank.wait_for_timeout(1500)
            print(f"frames, an empty page          {spread(blank.evaluate('() => frames_seen'))}")


if __name__ == "__main__":
    main()
