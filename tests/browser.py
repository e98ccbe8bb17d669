"""The page in a real browser: a survey served by its own process, driven in headless Chromium."""

from __future__ import annotations

import contextlib
import json
import shutil
import signal
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests import equipment

SAMPLE = Path(__file__).parents[1] / "bifocal" / "demo" / "sample"
#: Of the sample: metres a pixel on the wall, principal point, distances. (tests/scenes/make_sample)
GSD, CENTRE, DISTANCE = 0.00738, (767.5, 511.5), {1: 17.5, 2: 9.5}
#: Where targets of the sample are: X, Y, r. [m] (tests/scenes/facade)
TARGETS = {
    "T01": (-4.15, -2.15, 0.0), "T04": (4.15, -2.15, 0.0), "T08": (-4.40, 0.42, 0.0),
    "T09": (4.40, 0.42, 0.0), "T15": (4.30, 2.25, 0.0), "T19": (5.0, 1.6, 0.08684),
    "T20": (-4.6, -3.2, 0.1442), "T28": (-0.80, 1.45, -0.11908), "T30": (-2.65, 2.84, 0.22),
}  # fmt: skip
#: Milliseconds until a missing thing is missing; the machine may be busy.
PATIENCE = 30_000


def true_pixel(image: int, place: tuple[float, float, float]) -> tuple[float, float]:
    """Return where (X, Y, r) is in a photo of the sample, by Eqs. (1) and (7) on paper. [px]"""
    stretched = DISTANCE[image] / (DISTANCE[image] - place[2]) / GSD
    return CENTRE[0] + place[0] * stretched, CENTRE[1] - place[1] * stretched


#: The Playwright of this process, while a browser is open.
_running: list[Any] = []

#: Note in the page how long each frame takes. [ms]
WATCH = """() => {
  window.frames_seen = [];
  let last = performance.now();
  const next = (now) => { frames_seen.push(now - last); last = now; requestAnimationFrame(next); };
  requestAnimationFrame(next);
}"""
#: Send a command; return whether it was taken, and the answer.
SEND = """async (body) => {
  const headers = { "Content-Type": "application/json" };
  const sent = { method: "POST", headers, body: JSON.stringify(body) };
  const answer = await fetch("api/command", sent);
  return [answer.ok, await answer.text()];
}"""


@dataclass
class Served:
    """`bifocal pick` as a process of its own."""

    folder: Path
    arguments: tuple[str, ...]
    port: int = 0
    process: subprocess.Popen[str] | None = field(default=None, repr=False)
    url: str = ""
    token: str = ""

    def start(self) -> Served:
        command = [sys.executable, "-m", "bifocal", "pick", *self.arguments]
        command += ["--no-browser", "--json", "--port", str(self.port)]
        self.process = subprocess.Popen(
            command, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert self.process.stdout is not None
        told = json.loads(self.process.stdout.readline())
        self.url, self.token = told["url"], told["token"]
        self.port = int(self.url.split(":")[2].split("/")[0])
        return self

    @property
    def origin(self) -> str:
        return self.url.split("/?")[0]

    def kill(self) -> None:
        """End it as a power failure does."""
        if self.process is None:
            return
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        self.process = None


@contextlib.contextmanager
def sample_survey(folder: Path, *arguments: str) -> Iterator[Served]:
    """Serve a copy of the sample pair."""
    for name in ("facade.pair.json", "far.jpg", "near.jpg"):
        shutil.copy(SAMPLE / name, folder)
    with served(folder, *(arguments or ("facade.pair.json",))) as server:
        yield server


@contextlib.contextmanager
def served(folder: Path, *arguments: str) -> Iterator[Served]:
    """Serve the survey that `bifocal pick ARGUMENTS` opens in a folder."""
    server = Served(folder, arguments).start()
    try:
        yield server
    finally:
        server.kill()


@contextlib.contextmanager
def _driver() -> Iterator[Any]:
    """Return Playwright: the one that runs, as a thread can hold no second one."""
    from playwright.sync_api import sync_playwright

    if _running:
        yield _running[0]
        return
    with sync_playwright() as playwright:
        _running.append(playwright)
        try:
            yield playwright
        finally:
            _running.clear()


@contextlib.contextmanager
def launched(*more: str) -> Iterator[Any]:
    """Return a headless browser, with more arguments; another one may be open."""
    program = equipment.place("browser")
    with _driver() as playwright:
        arguments = ["--no-sandbox", *(more or ("--disable-gpu",))]
        browser = playwright.chromium.launch(executable_path=program, args=arguments)
        try:
            yield browser
        finally:
            browser.close()


class Driver:
    """A tab on the page, and what a hand does in it."""

    def __init__(self, browser: Any, server: Served, **context: Any) -> None:
        size = {"width": 1280, "height": 720}
        # No frames for transitions; Chromium's own choice were light.
        calm = {"viewport": size, "reduced_motion": "reduce", "color_scheme": "dark"}
        self.server = server
        self.context = browser.new_context(**(calm | context))
        self.requests: list[str] = []
        self.faults: list[str] = []
        self.open(self.context.new_page(), server)

    def open(self, tab: Any, server: Served) -> None:
        """Open the page in a tab and wait until it is there."""
        self.tab = tab
        tab.set_default_timeout(PATIENCE)
        tab.on("request", lambda request: self.requests.append(request.url))
        tab.on("pageerror", lambda error: self.faults.append(str(error)))
        tab.goto(server.url)
        self.wait("() => window.bifocal")

    def close(self) -> None:
        self.context.close()
        assert not self.faults, self.faults

    def wait(self, condition: str, argument: Any = None) -> Any:
        """Wait until a function of the page returns something true; return it."""
        return self.tab.wait_for_function(condition, arg=argument).json_value()

    def click(self, testid: str) -> None:
        self.tab.get_by_test_id(testid).click()

    def unfold(self, testid: str) -> None:
        """Open a fold of the page where it is closed."""
        fold = self.tab.get_by_test_id(testid)
        if fold.get_attribute("open") is None:
            fold.locator("summary").click()

    def keys(self, *keys: str) -> None:
        for key in keys:
            self.tab.keyboard.press(key)

    @property
    def pane(self) -> Any:
        """The first pane of the stage that is shown."""
        return self.tab.locator(".pane:visible").first

    @property
    def state(self) -> dict[str, Any]:
        return dict(self.tab.evaluate("() => bifocal.state()"))

    def point(self, name: str) -> dict[str, Any]:
        return next(point for point in self.state["points"] if point["name"] == name)

    def screen(self, image: int, pixel: tuple[float, float]) -> tuple[float, float]:
        """Return where on the screen a pixel of a photo is. [CSS px]"""
        x, y = self.tab.evaluate("([i, c, r]) => bifocal.screenFromPhoto(i, c, r)", [image, *pixel])
        return x, y

    def photo(self, image: int, place: tuple[float, float]) -> tuple[float, float]:
        """Return the pixel of a photo that is at a place on the screen. [px]"""
        c, r = self.tab.evaluate("([i, x, y]) => bifocal.photoFromScreen(i, x, y)", [image, *place])
        return c, r

    def pick(self, image: int, pixel: tuple[float, float]) -> None:
        """Click on a pixel of a photo; the mouse has whole pixels only."""
        x, y = self.screen(image, pixel)
        self.tab.mouse.click(round(x), round(y))

    def settled(self, condition: str, argument: Any = None) -> dict[str, Any]:
        """Wait until nothing is unsent and the state satisfies a condition; return the state."""
        self.wait(
            "(argument) =>"
            " !Object.keys(localStorage).some((key) => key.startsWith('bifocal-unsent'))"
            f" && ((state) => {condition})(bifocal.state())",
            argument,
        )
        return self.state

    def command(self, op: str, **fields: Any) -> Any:
        """Send a command past the page, as another tab would."""
        body = {"id": uuid.uuid4().hex, "op": op, **fields}
        # By the page's own fetch: Chromium sends again what met a connection closed for idleness.
        well, answer = self.tab.evaluate(SEND, body)
        assert well, answer
        return json.loads(answer)["result"]

    def empty(self) -> None:
        """Delete all points, control and shapes and let go of everything: a test begins afresh."""
        listings = {"point": "points", "control": "control", "shape": "shapes"}
        for kind, listed in listings.items():
            for one in self.state[listed]:
                self.command(f"{kind}.delete", name=one["name"])
        empty = (f"state.{listed}.length === 0" for listed in listings.values())
        self.settled(" && ".join(empty))
        self.click("mode-points")
        self.pane.focus()
        self.keys("Escape", "Escape", "n", "v", "0")
        self.tab.get_by_test_id("layer-opacity").fill("50")
        self.pane.focus()

    def pick_control(self, points: dict[str, tuple[float, float, float]]) -> None:
        """Hand control points over as Excel does, then pick and snap each in both photos."""
        rows = [f"{name}\t{x}\t{y}\t{r}" for name, (x, y, r) in points.items()]
        self.click("control-paste")
        self.tab.get_by_test_id("paste-area").fill("\n".join(rows))
        self.click("dialog-yes")
        self.settled(f"state.control.length === {len(points)}")
        for name, place in points.items():
            for image in (1, 2):
                label = f"{name}: pick in photo {image}"
                self.tab.get_by_role("button", name=label, exact=True).click()
                self.pick(image, true_pixel(image, place))
                self.settled(f"state.control.find((one) => one.name === '{name}').picks[{image}]")
                self.click("control-snap")
                self.wait(
                    "() => document.querySelector('[data-testid=toast]').textContent.includes('±')"
                )
                self.settled("true")

    def finished(self, kind: str) -> dict[str, Any]:
        """Wait until a job that a hand began has ended; return it."""
        self.tab.wait_for_function(
            "(kind) => !['running', undefined].includes(bifocal.state().jobs"
            ".filter((job) => job.kind === kind && !job.quiet).at(-1)?.state)",
            arg=kind,
            timeout=8 * PATIENCE,
        )
        jobs = [job for job in self.state["jobs"] if job["kind"] == kind and not job["quiet"]]
        return dict(jobs[-1])

    def frames(self) -> list[float]:
        """Return how long the frames take while the photos are dragged and zoomed. [ms]"""
        box = self.pane.bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        self.tab.mouse.move(x, y)
        self.tab.evaluate(WATCH)
        for k in range(6):
            self.tab.mouse.down()
            self.tab.mouse.move(x + 180 * (-1) ** k, y + 90 * (k % 3 - 1), steps=25)
            self.tab.mouse.up()
            self.tab.mouse.wheel(0, -240 if k < 3 else 240)
        return list(self.tab.evaluate("() => frames_seen"))

    def suggested(self) -> None:
        """Wait for the proposed partner of the point in hand."""
        self.wait("() => document.querySelector('[data-testid=quality]').dataset.level")

    def still(self, image: int, pixel: tuple[float, float]) -> tuple[float, float]:
        """Return where a pixel of a photo is once the view has come to rest. [CSS px]"""
        seen = None
        while (place := self.screen(image, pixel)) != seen:
            seen = place
            self.tab.wait_for_timeout(120)
        return place

    def zoom_to(self, image: int, pixel: tuple[float, float], zoom: float) -> None:
        """Bring a pixel of a photo to the middle of the pane, at screen pixels a wall pixel."""
        for _ in range(12):
            x, y = self.still(image, pixel)
            width = self.screen(image, (pixel[0] + 1, pixel[1]))[0] - x
            if abs(width / zoom - 1) < 0.3:
                break
            self.tab.mouse.move(x, y)
            self.tab.mouse.wheel(0, -120 if width < zoom else 120)


def tab_of(browser: Any, server: Served, **context: Any) -> contextlib.closing[Driver]:
    """Return a tab on the page, closed at the end of its block."""
    return contextlib.closing(Driver(browser, server, **context))


Opened = Callable[..., Driver]
