"""Points picked in the page, by mouse and by keys, in headless Chromium."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.browser import TARGETS, Driver, Served, tab_of, true_pixel

#: On the rim of a shadow; not among the control points for that.
SHADED = (2.10, 2.25, 0.0)
TENTHS = 0.05
#: How many pixels are drawn above the photos in the red of what does not fit.
REDS = """() => [...document.querySelectorAll("canvas")].map((canvas) => {
  if (!canvas.width) return 0;
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    count += data[i] === 255 && data[i + 1] === 107 && data[i + 2] === 107 && data[i + 3] === 255;
  }
  return count;
}).reduce((a, b) => a + b, 0)"""


@pytest.fixture
def page(browser: Any, server: Served) -> Iterator[Driver]:
    """Yield the page with no points, both photos whole and superimposed."""
    with tab_of(browser, server) as driver:
        driver.empty()
        yield driver


def distance(a: Any, b: Any) -> float:
    return float(np.hypot(a[0] - b[0], a[1] - b[1]))


def pixel_of(image: int, place: tuple[float, float, float]) -> dict[str, float]:
    """Return where a place is in a photo, as a command wants it."""
    return dict(zip(("column", "row"), true_pixel(image, place), strict=True))


def nudged(page: Driver, name: str, image: int, goal: tuple[float, float]) -> Any:
    """Move the pick in hand to a pixel by the arrow keys and return where it is."""
    page.keys(str(image))
    for shift, axis in ((0, ("ArrowRight", "ArrowLeft")), (1, ("ArrowDown", "ArrowUp"))):
        picks = page.point(name)["picks"]
        gap = goal[shift] - picks[str(image)][shift]
        whole, tenths = divmod(round(abs(gap) / 0.1), 10)
        page.keys(*[f"Shift+{axis[gap < 0]}"] * whole, *[axis[gap < 0]] * tenths)
        page.settled("true")
    return page.point(name)["picks"][str(image)]


@pytest.mark.acceptance
def test_a_pick_is_nudged_to_a_known_centre_at_every_zoom(page: Driver) -> None:
    truth = true_pixel(1, SHADED)
    for index, zoom in enumerate((0.6, 2.0, 8.0), start=1):
        page.zoom_to(1, truth, zoom)
        page.keys("n")
        with page.tab.expect_response("**/api/command") as answered:
            page.pick(1, truth)
        assert "since" in answered.value.json()["state"], "what changed, not all"
        name = f"P{index:02d}"
        page.settled(f"state.points.some(({{ name }}) => name === '{name}')")
        clicked = page.point(name)["picks"]["1"]
        assert distance(clicked, truth) < 1.2 / zoom
        # Each axis stops within half a step of 0.1 px.
        found = nudged(page, name, 1, truth)
        assert max(abs(np.subtract(found, truth))) <= TENTHS + 1e-9


@pytest.mark.acceptance
def test_snap_centres_a_pick_on_the_target_at_every_zoom(page: Driver) -> None:
    """A click is good to a pixel or two of the screen: some ten of the photo where it is small."""
    for index, (name, zoom) in enumerate((("T08", 0.25), ("T19", 1.0), ("T30", 8.0)), start=1):
        truth = true_pixel(1, TARGETS[name])
        page.keys("0", "n")
        page.zoom_to(1, truth, zoom)
        page.pick(1, (truth[0] + 1.7 / zoom, truth[1] - 1.3 / zoom))
        page.settled(f"state.points.length === {index}")
        before = page.point(f"P{index:02d}")["picks"]["1"]
        page.keys("c")
        page.wait(
            "([name, column]) => bifocal.state().points.find((one) => one.name === name)"
            ".picks[1][0] !== column",
            [f"P{index:02d}", before[0]],
        )
        assert distance(page.point(f"P{index:02d}")["picks"]["1"], truth) < 0.05, name


def test_what_the_screen_shows_at_a_pixel_is_that_pixel_of_the_photo(page: Driver) -> None:
    """The dark disc of a target on a screenshot, against the target's own coordinates."""
    truth = true_pixel(1, TARGETS["T08"])
    page.zoom_to(1, truth, 8.0)
    page.tab.get_by_test_id("layer-opacity").fill("0")
    page.tab.wait_for_timeout(400)
    x, y = page.screen(1, truth)
    side = 56
    clip = {"x": round(x) - side / 2, "y": round(y) - side / 2, "width": side, "height": side}
    shot = Image.open(io.BytesIO(page.tab.screenshot(clip=clip))).convert("L")
    dark = 255.0 - np.asarray(shot, dtype=float)
    dark[dark < 160] = 0
    rows, columns = np.mgrid[:side, :side] + 0.5
    centre = (
        round(x) - side / 2 + float((columns * dark).sum() / dark.sum()),
        round(y) - side / 2 + float((rows * dark).sum() / dark.sum()),
    )
    zoom = page.screen(1, (truth[0] + 1, truth[1]))[0] - x
    # A convention of half a pixel would be off by 0.5.
    assert distance(centre, (x, y)) / zoom < 0.12


def test_screen_and_photo_are_each_others_inverse(page: Driver) -> None:
    for image in (1, 2):
        for pixel in ((10.25, 20.5), (1400.0, 900.75)):
            assert distance(page.photo(image, page.screen(image, pixel)), pixel) < 1e-9


def test_a_point_is_picked_suggested_and_accepted_by_clicks(page: Driver) -> None:
    page.click("mode-points")
    page.click("pick")
    page.pick(1, true_pixel(1, TARGETS["T19"]))
    page.wait("() => document.querySelector('[data-testid=quality]').dataset.level === 'good'")
    # Proposed is not picked.
    assert page.point("P01")["picks"]["2"] is None
    page.click("accept")
    state = page.settled("state.points[0]?.result")
    # The click was as good as a whole pixel of the screen, and its partner follows it.
    assert distance(state["points"][0]["picks"]["2"], true_pixel(2, TARGETS["T19"])) < 1.5
    r, sigma = (state["points"][0]["result"][key] for key in ("r", "sigma_r"))
    digits = 3 if sigma > 0.003 else 4
    assert page.tab.get_by_test_id("value-r").text_content() == (
        f"{r:.{digits}f} ± {sigma:.{digits}f} m"
    )


@pytest.mark.acceptance
def test_a_doubtful_suggestion_offers_the_other_place_too(page: Driver) -> None:
    """Above the pediment, beside a step: the second place is the true one (ray caster)."""
    page.zoom_to(1, (383.0, 320.0), 3.0)
    page.keys("n")
    page.pick(1, (383.0, 320.0))
    page.suggested()
    quality = page.tab.get_by_test_id("quality")
    assert quality.get_attribute("data-level") != "good"
    assert "S shows the next" in str(quality.text_content())
    # Once the pick has moved, S asks anew along its new line.
    asked = "performance.getEntriesByType('resource').map(({ name }) => name)"
    asked = f"{asked}.filter((name) => name.endsWith('/api/suggest')).length"
    count = page.tab.evaluate(asked)
    for number, key in enumerate(("ArrowRight", "ArrowLeft"), start=1):
        page.keys("1", key)
        page.settled("true")
        page.keys("s")
        page.wait(f"() => {asked} === {count + number}")
        page.suggested()
    page.keys("s")
    assert page.tab.evaluate(asked) == count + 2
    assert "%" not in str(quality.text_content())  # how sure the other place is, nobody knows
    page.keys("a")
    picks = page.settled("state.points[0].picks[2]")["points"][0]["picks"]
    # Its partner moves as the click fell: half a screen pixel.
    assert distance(np.subtract(picks["2"], picks["1"]), (-6.2, -3.09)) < 0.5


def test_a_poor_suggestion_is_not_urged_on_anybody(page: Driver) -> None:
    """Neither the standing words nor the passing ones tell to accept it."""
    poor = {
        "column": 900.0, "row": 400.0, "quality": 0.2, "kept": False, "sigma_px": 0.8, "others": [],
        "line": [[880.0, 400.0], [920.0, 400.0]],
    }  # fmt: skip
    page.tab.route("**/api/suggest", lambda route: route.fulfill(json=poor))
    page.pick(1, (900.0, 410.0))
    page.suggested()
    page.tab.unroute("**/api/suggest")
    for place in ("quality", "toast"):
        text = str(page.tab.get_by_test_id(place).text_content())
        assert "20 % sure. Better pick by hand." in text
        assert "accepts" not in text


def test_of_two_measures_the_last_asked_for_is_shown(page: Driver) -> None:
    held: list[Any] = []

    def answer(route: Any) -> None:
        held.append(route)
        if len(held) == 2:  # the second question is answered first
            for number, one in ((2, held[1]), (1, held[0])):
                one.fulfill(json={"distance": float(number)})

    for number, place in enumerate((SHADED, TARGETS["T08"]), start=1):
        name = f"M{number}"
        page.command("point.pick", name=name, image=1, **pixel_of(1, place))
        page.command("point.pick", name=name, image=2, **pixel_of(2, place))
    page.settled("state.points.length === 2")
    page.tab.route("**/api/measure", answer)
    for name in ("M1", "M2", "M1"):
        page.tab.get_by_role("button", name=f"Fly to {name}").click()
        page.click("measure-add")
    page.wait("() => document.querySelector('[data-testid=measures]').textContent")
    page.tab.wait_for_timeout(200)
    page.tab.unroute("**/api/measure")
    assert "2.0000 m" in str(page.tab.get_by_test_id("measures").text_content())


def test_panes_of_an_earlier_orientation_are_given_back(page: Driver) -> None:
    """The same pair, its distance a little other: both panes are made anew."""
    page.tab.evaluate(
        """async () => {
          window.given_back = 0;
          const { Pane } = await import(new URL("js/viewer.js", document.baseURI));
          const before = Pane.prototype.dispose;
          Pane.prototype.dispose = function () {
            window.given_back += 1;
            before.call(this);
          };
        }"""
    )

    def other(route: Any) -> None:
        headers = {key: v for key, v in route.request.headers.items() if key != "x-edition"}
        state = route.fetch(headers=headers).json()  # all of it, not what changed
        state["pair"]["images"][0]["distance"] += 0.5
        route.fulfill(json=state)

    page.keys("k")  # the cursor stands in a pane that goes
    page.tab.route("**/api/state", other)
    page.command("point.pick", name="A", image=1, **pixel_of(1, SHADED))
    page.wait("() => window.given_back === 2")
    page.tab.unroute("**/api/state")
    page.command("point.pick", name="B", image=1, **pixel_of(1, SHADED))
    page.settled("state.points.length === 2")
    page.wait("() => window.given_back === 4")
    assert page.tab.locator(".viewer:visible .ground").count() == 2


def test_a_pick_off_the_line_is_taken_and_its_misfit_shown(page: Driver) -> None:
    page.pick(1, true_pixel(1, SHADED))
    page.settled("state.points.length === 1")
    column, row = true_pixel(2, SHADED)
    page.pick(2, (column + 20, row + 25))
    result = page.settled("state.points[0].result")["points"][0]["result"]
    assert abs(result["misfit_px"]) > 10
    assert result["flag"] == "OFF-RADIAL"
    assert "OFF-RADIAL" in str(page.tab.get_by_test_id("value-flag").text_content())
    shown = str(page.tab.get_by_test_id("value-misfit_px").text_content())
    assert shown == f"{result['misfit_px']:.2f} px"
    # Drawn red in the picture, and led to from anywhere.
    page.command("point.pick", name="good", image=1, **pixel_of(1, SHADED))
    page.tab.get_by_label("Fly to good").click()
    assert page.tab.get_by_test_id("next-doubtful").text_content() == "1 doubtful"
    page.keys("y")
    assert page.tab.get_by_test_id("point-name").input_value() == "P01"
    page.wait(f"() => ({REDS})() > 20")
    page.command("point.delete", name="P01")
    page.wait(f"() => ({REDS})() === 0")
    assert not page.tab.get_by_test_id("next-doubtful").is_visible()


def test_a_point_is_picked_by_keys_alone(page: Driver) -> None:
    """From the stage's own key to the accepted partner, and no mouse."""
    page.keys("n", "k")
    goal = true_pixel(1, TARGETS["T08"])
    x, y = page.screen(1, goal)
    box = page.pane.bounding_box()
    dx, dy = x - box["x"] - box["width"] / 2, y - box["y"] - box["height"] / 2
    for gap, ahead, back in ((dx, "ArrowRight", "ArrowLeft"), (dy, "ArrowDown", "ArrowUp")):
        key, steps = (ahead if gap > 0 else back), round(abs(gap))
        page.keys(*[f"Shift+{key}"] * (steps // 50), *[key] * (steps % 50 // 10))
        page.keys(*[f"Alt+{key}"] * (steps % 10))
    page.keys("Enter")
    page.suggested()
    page.keys("c", "s", "a")
    state = page.settled("state.points[0]?.result")
    picks = state["points"][0]["picks"]
    assert distance(picks["1"], goal) < 0.05
    assert distance(picks["2"], true_pixel(2, TARGETS["T08"])) < 1.0


def test_points_are_named_typed_joined_deleted_and_brought_back(page: Driver) -> None:
    for place in (SHADED, TARGETS["T08"]):
        page.keys("n")
        page.pick(1, true_pixel(1, place))
        page.suggested()
        page.keys("a")
        page.settled("state.points.at(-1)?.result")
    page.tab.get_by_test_id("point-name").fill("corner")
    page.keys("Enter")
    page.settled("state.points[1].name === 'corner'")
    page.keys("t")
    assert page.settled("state.points[1].type === 'wall'")
    page.keys("e", "j", "e")
    line = page.settled("state.lines.length === 1")["lines"][0]
    assert line["points"] == ["corner", "P01"]
    page.keys("m", "j", "m")
    page.wait("() => document.querySelector('[data-testid=measures]').textContent.includes('m')")
    # Both on the wall: 2.10 + 4.40 m apart, and 1.83 m in height: 6.753 m.
    assert "6.7" in str(page.tab.get_by_test_id("measures").text_content())
    page.keys("Delete")
    page.settled("state.points.filter(({ deleted }) => !deleted).length === 1")
    page.keys("Control+z")
    page.settled("state.points.filter(({ deleted }) => !deleted).length === 2")
    page.keys("Control+y")
    page.settled("state.points.filter(({ deleted }) => !deleted).length === 1")


@pytest.mark.acceptance
def test_the_list_is_sorted_by_a_column_and_flies_to_a_point(page: Driver) -> None:
    for place in (TARGETS["T08"], SHADED):
        page.keys("n")
        page.pick(1, true_pixel(1, place))
        page.suggested()
        page.keys("a")
        page.settled("state.points.at(-1)?.result")
    page.keys("n")
    page.pick(1, true_pixel(1, TARGETS["T15"]))
    page.settled("state.points.length === 3")
    table = page.tab.get_by_test_id("point-list")

    def order() -> list[str]:
        return [one.split("\t")[0][:3] for one in table.locator("tbody tr").all_inner_texts()]

    for expected in (["P01", "P02", "P03"], ["P03", "P02", "P01"]):
        table.get_by_role("button", name="Name").click()
        assert order() == expected
    known = {point["name"]: point["result"] for point in page.state["points"]}
    assert known["P03"] is None
    risen = sorted(("P01", "P02"), key=lambda name: known[name]["r"])
    for expected in (risen, risen[::-1]):
        table.locator("thead button").nth(2).click()  # r
        assert order() == [*expected, "P03"]  # what is not measured yet comes last
    assert page.tab.evaluate("() => bifocal.flyTo('P01')") is True
    box = page.pane.bounding_box()
    x, y = page.screen(1, true_pixel(1, TARGETS["T08"]))
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert distance((x, y), middle) < 3
    assert page.tab.evaluate("() => bifocal.flyTo('nobody')") is False
    page.click("fit")
    corners = [page.screen(1, pixel) for pixel in ((0, 0), (1535, 1023))]
    assert corners[0][0] > box["x"]
    assert corners[1][1] < box["y"] + box["height"]
    page.click("uncertainty")
    asked = "performance.getEntriesByType('resource').map(({ name }) => name)"
    page.wait(f"() => {asked}.some((name) => name.endsWith('/uncertainty.json'))")
    page.click("uncertainty")


def test_both_photos_side_by_side_move_together(page: Driver) -> None:
    page.keys("d")
    page.tab.wait_for_timeout(200)
    panes = page.tab.locator(".viewer .pane:visible")
    boxes = [pane.bounding_box() for pane in panes.all()[:2]]
    assert boxes[1]["x"] >= boxes[0]["x"] + boxes[0]["width"]
    pixel = true_pixel(1, SHADED)
    inside = [page.screen(image, true_pixel(image, SHADED)) for image in (1, 2)]
    offsets = [np.subtract(inside[k], (boxes[k]["x"], boxes[k]["y"])) for k in (0, 1)]
    # On the wall itself both photos coincide.
    assert distance(*offsets) < 0.1
    page.pick(1, pixel)
    page.settled("state.points.length === 1")
    page.pick(2, true_pixel(2, SHADED))
    state = page.settled("state.points[0].result")
    assert abs(state["points"][0]["result"]["r"]) < 0.2


def seen(page: Driver) -> Any:
    """Return what the pane shows within its frame, as grey values."""
    page.wait("() => !document.querySelector('.toast').classList.contains('on')")
    page.tab.wait_for_timeout(350)
    shot = page.pane.screenshot()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("L"), dtype=float)[6:-6, 6:-6]


@pytest.mark.acceptance
def test_opacity_swipe_blink_and_contrast_show_what_they_say(page: Driver) -> None:
    slider = page.tab.get_by_test_id("layer-opacity")
    shots = {}
    for percent in ("0", "50", "100"):
        slider.fill(percent)
        shots[percent] = seen(page)
    far, near = shots["0"], shots["100"]
    # The photos differ where something stands out, and only there.
    assert np.abs(far - near).max() > 60
    assert np.median(np.abs(far - near)) < 10
    # Half and half leans by 28 % towards the photo that is picked next.
    assert np.median(np.abs(shots["50"] - (0.78 * far + 0.22 * near))) < 1
    page.keys("x")
    swept, middle = seen(page), far.shape[1] // 2
    assert np.abs(swept - far)[:, : middle - 20].mean() < 0.5
    assert np.abs(swept - near)[:, middle + 20 :].mean() < 0.5
    page.keys("b")
    shown = set()
    for look in range(60):
        page.tab.wait_for_timeout(130 * (look % 4))  # not in step with the blinking
        one = seen(page)
        assert min(np.abs(one - photo).mean() for photo in (far, near)) < 0.5
        shown.add(bool(np.abs(one - far).mean() < 0.5))
        if len(shown) == 2:
            break
    assert shown == {True, False}
    page.keys("v")
    slider.fill("0")
    page.tab.get_by_test_id("contrast-1").fill("200")
    # A loaded machine draws the new contrast some frames later.
    assert any(seen(page).std() > 1.3 * far.std() for _ in range(20))
    page.tab.get_by_test_id("contrast-1").fill("100")


#: Where the layout leaves fractions of a CSS pixel; and the browser's own zoom.
_CANVAS = """() => { const canvas = document.querySelector('#stage-points canvas.drawing');
  const { width, left } = canvas.getBoundingClientRect(), ratio = devicePixelRatio;
  return [canvas.width / ratio - width, Math.abs(left * ratio - Math.round(left * ratio))]; }"""


@pytest.mark.parametrize(
    ("width", "height", "ratio"),
    [
        (1280, 720, 1.1),
        pytest.param(1001, 653, 1.0, marks=pytest.mark.acceptance),
        pytest.param(1283, 701, 1.5, marks=pytest.mark.acceptance),
    ],
)
def test_a_pick_is_where_the_pointer_was_in_panes_of_broken_pixels(
    browser: Any, server: Served, width: int, height: int, ratio: float
) -> None:
    size = {"width": width, "height": height}
    with tab_of(browser, server, viewport=size, device_scale_factor=ratio) as page:
        for mode in ("v", "d"):
            page.empty()
            page.keys(mode)
            page.wait("() => document.querySelector('#stage-points .pane').offsetWidth > 99")
            box = page.pane.bounding_box()
            page.keys("0", *["+"] * 4)
            stretched, off_grid = page.tab.evaluate(_CANVAS)
            assert abs(stretched) < 0.02
            assert off_grid < 0.02
            for number, (right, down) in enumerate([(0.97, 0.52), (0.03, 0.55)], start=1):
                place = box["x"] + right * box["width"], box["y"] + down * box["height"]
                shown = page.photo(1, place)
                page.pane.focus()
                page.keys("n")
                page.tab.mouse.click(*place)
                picked = page.settled("state.points.length === argument", number)
                pick = picked["points"][-1]["picks"]["1"]
                assert distance(pick, shown) < 0.05
                marked, beside = (page.screen(1, (pick[0] + by, pick[1])) for by in (0, 1))
                assert distance(marked, place) < 0.05 * distance(marked, beside)


def test_a_suggestion_accepted_in_doubt_is_shown_as_doubtful_until_it_is_picked(
    page: Driver,
) -> None:
    near = pixel_of(2, TARGETS["T08"])
    hardly = {**near, "quality": 0.04, "score": 0.6, "sigma_px": 0.3, "misfit_px": 0.0,
              "kept": False, "others": [], "line": []}  # fmt: skip
    page.tab.route("**/api/suggest", lambda route: route.fulfill(json=hardly))
    page.pick(1, true_pixel(1, TARGETS["T08"]))
    page.settled("state.points.length === 1")
    page.tab.get_by_text("Hardly: 4 % sure").first.wait_for()
    page.keys("a", "ArrowLeft")
    point = page.settled("state.points[0].result")["points"][0]
    assert (point["type"], point["code"]) == ("doubtful", "DOUBTFUL 2")
    assert point["result"]["flag"] == "UNCERTAIN"
    assert page.tab.get_by_test_id("value-flag").text_content() != ""
    page.tab.unroute("**/api/suggest")
    page.keys("2")
    page.pick(2, true_pixel(2, TARGETS["T08"]))
    point = page.settled("state.points[0].type === 'plain'")["points"][0]
    assert point["result"]["flag"] in ("OK", "ON-PLANE")
