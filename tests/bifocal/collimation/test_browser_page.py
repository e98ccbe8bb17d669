"""The page as a whole: languages, sizes, touch, names and contrast, nothing from outside."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bifocal import Lens
from bifocal.collimation.server.assets import WEB
from tests.browser import Driver, Served, tab_of

STAGES = ("photos", "orientation", "points", "products")
#: WCAG 2.2, success criterion 1.4.3.
CONTRAST = 4.5


def words_of(language: str) -> dict[str, str]:
    text = (WEB / "js" / "words" / f"{language}.js").read_text(encoding="utf-8")
    body = text[text.index("{") : text.rindex("}")].rstrip().rstrip(",") + "}"
    return dict(json.loads(body))


def test_every_word_is_there_in_three_languages() -> None:
    english, *others = (words_of(language) for language in ("en", "it", "de"))
    for other in others:
        assert list(other) == list(english)
        for key, text in english.items():
            assert re.findall(r"\{\w+\}", text) == re.findall(r"\{\w+\}", text)
            assert sorted(re.findall(r"\{\w+\}", other[key])) == sorted(
                re.findall(r"\{\w+\}", text)
            ), key
    code = "\n".join(path.read_text() for path in (WEB / "js").glob("*.js"))
    said = set(re.findall(r"""(?:\bt\(|\bsay\()(["'])([\w.-]+)\1""", code))
    assert {key for _, key in said} <= set(english)


@pytest.fixture
def page(browser: Any, server: Served) -> Iterator[Driver]:
    with tab_of(browser, server) as driver:
        driver.empty()
        yield driver


#: As Excel hands them over; a name longer than its field.
CONTROL = "A\t0.5\t1.25\t0\nnorth pilaster, capital\t13.512\t-1.251\t0.2345\nC\t-3.5\t1.25\t"


@pytest.fixture
def full(page: Driver) -> Driver:
    """Return the page with control and with points, one of them picked in one photo only."""
    page.command("control.paste", text=CONTROL)
    for image in (1, 2):
        page.command("control.pick", name="A", image=image, column=800.5, row=300.25)
        page.command("point.pick", name="P1", image=image, column=700.0, row=400.0)
    page.command("point.pick", name="a long name of a point", image=1, column=300.0, row=400.0)
    page.settled("state.control.length === 3 && state.points.length === 2")
    return page


LENSES = {
    "opencv": (-0.11, 0.04, 0.0007, -0.0004, 0.01),
    "rational": (-0.1, 0.04, 0.0007, -0.0004, 0.01, 0.02, -0.01, 0.003),
    "tilted": (
        -0.1, 0.04, 0.0007, -0.0004, 0.01, 0.02, -0.01, 0.003, 1e-3, 2e-4, -1e-3, 1e-4, 0.02, -0.03,
    ),
    "fisheye": (0.02, -0.01, 0.003, -0.0005),
    "radial": (0.0, 1.0, 600.0, 0.998, 1300.0, 0.989, 2100.0, 0.975, 3200.0, 0.95, 4200.0, 0.93),
}  # fmt: skip


def test_the_page_bends_pixels_as_the_library_does(page: Driver) -> None:
    matrix = [[4100.0, 0, 2990.0], [0, 4090.0, 2010.0], [0, 0, 1]]
    pixels = [[2990.0, 2010.0], [10.0, 20.0], [5900.0, 3900.0], [3000.5, 100.25], [700.0, 2600.0]]
    script = """async ([description, pixels]) => {
        const { Lens } = await import(new URL("js/lens.js", document.baseURI));
        const lens = new Lens(description);
        return [pixels.map((one) => lens.distort(one)), pixels.map((one) => lens.undistort(one))];
    }"""
    for name, coefficients in LENSES.items():
        described = {
            "camera_matrix": matrix, "coefficients": list(coefficients),
            "model": name if name in ("fisheye", "radial") else "opencv",
        }  # fmt: skip
        lens = Lens(**described, image_size=(6000, 4000))
        bent, straight = page.tab.evaluate(script, [described, pixels])
        np.testing.assert_allclose(bent, lens.distort(pixels), rtol=0, atol=1e-8, err_msg=name)
        # OpenCV stops its own iteration at about 1e-6 px; the way back is the sharper check.
        back = lens.distort(straight)
        np.testing.assert_allclose(back, pixels, rtol=0, atol=1e-7, err_msg=name)


def test_the_page_bends_rays_into_water_and_out_of_it(page: Driver) -> None:
    z0, glass, distance = 0.05, 0.01, 2.0
    # Out of water rays are reflected from 48.4 degrees on; the last is 0.1 degrees short of that.
    angles = np.radians([0.0, 5.0, 30.0, 45.0, 48.3])
    heights = np.array([z0, glass, distance - z0 - glass])
    script = """async ([media, places]) => {
        const { Media } = await import(new URL("js/media.js", document.baseURI));
        const through = new Media(media);
        const apparent = places.map((one) => through.apparent(one));
        return [apparent, apparent.map((one) => through.onPlane(one))];
    }"""
    for indices in ((1.0, 1.49, 1.337), (1.337, 1.49, 1.0)):
        bent = np.arcsin(np.sin(angles)[:, None] * indices[0] / np.array(indices))
        radius = np.tan(bent) @ heights
        media = {"indices": indices, "thicknesses": [glass], "z0": z0, "distance": distance}
        places = np.stack([radius * 0.6 + 0.1, radius * 0.8 - 0.2], axis=-1)
        shown, back = page.tab.evaluate(script, [media | {"nadir": [0.1, -0.2]}, places.tolist()])
        seen = np.hypot(*(np.array(shown) - [0.1, -0.2]).T)
        np.testing.assert_allclose(seen, distance * np.tan(angles), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(back, places, rtol=1e-9, atol=1e-12)


def test_nothing_is_asked_of_anybody_else(page: Driver) -> None:
    for stage in STAGES:
        page.click(f"mode-{stage}")
        page.tab.wait_for_timeout(150)
    assert page.requests
    assert all(url.startswith(page.server.origin) for url in page.requests)


NAMELESS = """() => [...document.querySelectorAll(
    "button, a[href], input, select, textarea, [role=slider], [role=application], [role=img]")]
  .filter((node) => node.checkVisibility())
  .filter((node) => !(node.getAttribute("aria-label") || node.textContent.trim() || node.title
    || (node.labels && node.labels.length)))
  .map((node) => node.outerHTML)"""

PALE = """() => {
  const channels = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (node) => {
    for (let one = node; one; one = one.parentElement) {
      const c = channels(getComputedStyle(one).backgroundColor);
      if (c.length < 4 || c[3] > 0.8) return c;
    }
    return [0, 0, 0];
  };
  const found = [];
  for (const node of document.querySelectorAll("body *")) {
    const own = [...node.childNodes].some((one) => one.nodeType === 3 && one.data.trim());
    const seen = { visibilityProperty: true, opacityProperty: true };
    if (!own || !node.checkVisibility(seen)) continue;
    const [a, b] = [light(channels(getComputedStyle(node).color)), light(ground(node))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < %s) found.push(`${ratio.toFixed(2)} ${node.outerHTML.slice(0, 120)}`);
  }
  return found;
}"""


def test_everything_has_a_name_and_can_be_read(full: Driver) -> None:
    page = full
    for theme in ("dark", "light"):
        assert page.tab.evaluate("document.documentElement.dataset.theme") == theme
        for stage in STAGES:
            page.click(f"mode-{stage}")
            assert page.tab.evaluate(NAMELESS) == [], stage
            assert page.tab.evaluate(PALE % CONTRAST) == [], (theme, stage)
            assert page.tab.locator("main").count() == 1
            assert page.tab.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
        page.keys("F1")
        assert page.tab.get_by_role("dialog").is_visible()
        assert page.tab.evaluate(PALE % CONTRAST) == []
        page.keys("Escape")
        page.click("theme")


def test_back_and_forward_move_between_stages(page: Driver) -> None:
    for stage in ("photos", "points", "products"):
        page.click(f"mode-{stage}")
    page.tab.go_back()
    assert page.settled("state.stage === 'points'")["stage"] == "points"
    page.click("next")
    page.settled("state.stage === 'products'")
    page.tab.go_back()
    page.tab.go_forward()
    page.settled("state.stage === 'products'")
    page.keys("Escape")
    assert page.tab.get_by_role("dialog").count() == 0


def test_what_comes_next_covers_nothing_of_the_panel(page: Driver) -> None:
    page.tab.set_viewport_size({"width": 1024, "height": 768})
    page.click("mode-orientation")
    panel = page.tab.locator("#stage-orientation .panel").bounding_box()
    card = page.tab.locator("#stage-orientation .card.next").bounding_box()
    page.tab.set_viewport_size({"width": 1280, "height": 720})
    assert panel["y"] + panel["height"] <= card["y"] + 0.5
    assert card["y"] + card["height"] <= 768.5


def test_the_stages_are_tabs_that_say_what_is_missing(page: Driver) -> None:
    page.click("mode-points")
    tab = page.tab.get_by_role("tab", selected=True)
    assert "pick the first point" in str(tab.text_content())
    page.keys("PageDown")
    assert "make the package" in str(page.tab.get_by_role("tab", selected=True).text_content())
    page.tab.get_by_role("tab", selected=True).focus()
    page.keys("ArrowLeft")
    assert page.tab.get_by_role("tabpanel").get_attribute("id") == "stage-points"


OUTSIDE = """() => [...document.querySelectorAll("header *, .layer-bar *, .hand *, .card *")]
  .filter((node) => node.checkVisibility() && node.matches("button, input, select, label, td, dd"))
  .filter((node) => !node.classList.contains("unseen"))
  .filter((node) => { const box = node.getBoundingClientRect();
    return box.left < -0.5 || box.right > innerWidth + 0.5; })
  .map((node) => node.outerHTML.slice(0, 120))"""


def test_it_fits_small_screens_and_large(full: Driver) -> None:
    page = full
    for size in ((390, 844), (640, 400), (1024, 768), (1280, 720), (3840, 2160)):
        page.tab.set_viewport_size({"width": size[0], "height": size[1]})
        for stage in STAGES:
            page.click(f"mode-{stage}")
            assert page.tab.evaluate(OUTSIDE) == [], (size, stage)
            assert page.tab.evaluate("() => document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.acceptance
def test_it_speaks_italian_and_german(page: Driver) -> None:
    for language, word in (("it", "Orientamento"), ("de", "Orientierung"), ("en", "Orientation")):
        page.tab.get_by_test_id("language").select_option(language)
        page.wait(f"() => document.documentElement.lang === '{language}' && window.bifocal")
        assert word in str(page.tab.get_by_test_id("mode-orientation").text_content())
        for stage in STAGES:
            page.click(f"mode-{stage}")
            assert page.tab.evaluate(OUTSIDE) == [], (language, stage)


@pytest.mark.acceptance
def test_a_finger_picks_and_two_fingers_zoom(browser: Any, server: Served) -> None:
    with tab_of(browser, server, has_touch=True) as touch:
        touch.empty()
        x, y = touch.screen(1, (900.0, 400.0))
        touch.tab.touchscreen.tap(x, y)
        state = touch.settled("state.points.length === 1")
        column, row = state["points"][0]["picks"]["1"]
        assert np.hypot(column - 900, row - 400) < 1.5
        before = touch.screen(1, (901.0, 400.0))[0] - x
        session = touch.context.new_cdp_session(touch.tab)
        pinch = {"x": x, "y": y, "scaleFactor": 2, "gestureSourceType": "touch"}
        session.send("Input.synthesizePinchGesture", pinch)
        x, _ = touch.still(1, (900.0, 400.0))
        assert (touch.screen(1, (901.0, 400.0))[0] - x) / before > 1.5
        touch.empty()


def test_control_points_and_tapes_are_typed_and_mended(page: Driver) -> None:
    page.click("mode-orientation")
    page.click("control-paste")
    page.tab.get_by_test_id("paste-area").fill("A\t0,5\t1,25\t\nB\t3,5\t1,25\t0,2")
    page.click("dialog-yes")
    state = page.settled("state.control.length === 2")
    assert [state["control"][0][key] for key in ("X", "Y", "r")] == [0.5, 1.25, None]
    page.tab.get_by_label("r A", exact=True).fill("0,1")
    page.keys("Enter")
    page.settled("state.control[0].r === 0.1")
    for index, text in enumerate(("A", "B", "3,002", "0.005")):
        page.tab.get_by_test_id(f"tape-{index}").fill(text)
    page.click("tape-add")
    tape = page.settled("state.tapes.length === 1")["tapes"][0]
    assert (tape["length"], tape["sigma"]) == (3.002, 0.005)
    page.tab.get_by_label("r A", exact=True).fill("ten")
    page.keys("Enter")
    # No number: said at the field, and nothing sent.
    assert page.tab.get_by_label("r A", exact=True).evaluate("(field) => !field.validity.valid")
    assert page.state["control"][0]["r"] == 0.1
    page.tab.get_by_role("button", name="Delete A", exact=True).click()
    page.settled("state.control.length === 1 && state.tapes.length === 0")
    page.click("undo")
    page.settled("state.control.length === 2 && state.tapes.length === 1")


#: The next command waits on its way to the server until it is let go.
SLOW_COMMAND = """() => {
  const real = window.fetch;
  window.held = {};
  const gate = new Promise((done) => { held.release = done; });
  window.fetch = async (path, ...rest) => {
    if (path === "api/command") {
      await gate;
      window.fetch = real;
    }
    return real(path, ...rest);
  };
}"""


@pytest.mark.acceptance
def test_what_is_refused_stays_as_it_was_typed(page: Driver) -> None:
    """Tape, table and fields keep what the survey does not take, until it is mended."""
    page.click("mode-orientation")
    page.click("control-paste")
    paste = page.tab.get_by_test_id("paste-area")
    paste.fill("G\t0,5\t1,25\nH\t3,5\tupwards")
    page.click("dialog-yes")
    page.tab.get_by_test_id("dialog-fault").wait_for(state="visible")
    assert paste.input_value() == "G\t0,5\t1,25\nH\t3,5\tupwards"
    paste.fill("G\t0,5\t1,25\nH\t3,5\t1,25")
    page.click("dialog-yes")
    page.settled("state.control.some(({ name }) => name === 'H')")
    fields = [page.tab.get_by_test_id(f"tape-{index}") for index in range(4)]
    toast = "() => document.querySelector('[data-testid=toast]').textContent"
    # A sigma with its unit and an unknown point are refused, a decimal comma is none of both.
    for name, sigma, told in (("H", "5 mm", "above zero"), ("Z", "0,005", "no control point Z")):
        typed = ["G", name, "3,002", sigma]
        for field, text in zip(fields, typed, strict=True):
            field.fill(text)
        page.click("tape-add")
        page.wait(f"{toast}.includes('{told}')")
        assert [field.input_value() for field in fields] == typed
        assert not any(tape["from"] == "G" for tape in page.state["tapes"])
    fields[1].fill("H")
    page.click("tape-add")
    tape = page.settled("state.tapes.find((one) => one.from === 'G')")["tapes"][-1]
    assert (tape["length"], tape["sigma"]) == (3.002, 0.005)
    page.wait("() => document.querySelector('[data-testid=tape-0]').value === ''")
    # A name that is taken: refused, and still there when another row is taken in hand.
    label = page.tab.locator("tr[data-key=G]").get_by_label("Name")
    label.fill("H")
    page.keys("Enter")
    page.wait("() => document.querySelector('tr[data-key=G] input:invalid')")
    page.tab.get_by_label("X H").focus()
    page.settled("true")
    assert label.input_value() == "H"
    label.fill("K")
    page.keys("Enter")
    page.settled("state.control.some(({ name }) => name === 'K')")
    page.click("mode-photos")
    page.unfold("site")
    site = page.tab.get_by_label("Far distance d1")
    # The page drawn anew while the answer is on its way takes nothing away either.
    page.tab.evaluate(SLOW_COMMAND)
    site.fill("-17,5")
    page.keys("Enter")
    page.click("mode-orientation")
    page.click("mode-photos")
    assert site.input_value() == "-17,5"
    page.tab.evaluate("() => held.release()")
    page.wait(f"{toast}.includes('above zero')")
    page.command("control.delete", name="K")
    page.settled("!state.control.some(({ name }) => name === 'K')")
    assert site.input_value() == "-17,5"
    site.fill("17,5")
    page.keys("Enter")
    page.settled("state.setup.d1 === 17.5")
    page.command("control.delete", name="H")
    page.command("setup.set", d1=None)


def test_coordinates_typed_one_after_the_other_are_all_kept(page: Driver) -> None:
    """Tab leads to the next field of the row before the answer to the first is here."""
    page.click("mode-orientation")
    page.command("control.set", name="K", X=None, Y=None, r=None)
    page.settled("state.control.some(({ name }) => name === 'K')")
    page.tab.get_by_label("X K").click()
    for text in ("5", "6,5", "0.25"):
        page.tab.keyboard.type(text)
        page.keys("Tab")
        page.settled("true")
    known = next(item for item in page.state["control"] if item["name"] == "K")
    assert [known[key] for key in ("X", "Y", "r")] == [5.0, 6.5, 0.25]
    page.tab.get_by_label("X K").fill("1e999")
    page.keys("Enter")
    assert page.tab.get_by_label("X K").evaluate("(field) => !field.validity.valid")
    page.command("control.delete", name="K")


def test_the_page_is_as_light_as_the_system_until_somebody_chooses(
    browser: Any, server: Served
) -> None:
    theme = "() => document.documentElement.dataset.theme"
    with tab_of(browser, server, color_scheme="light") as page:
        assert page.tab.evaluate(theme) == "light"
        page.tab.emulate_media(color_scheme="dark")
        page.wait(f"{theme} === 'dark'")
        page.click("theme")
        page.tab.reload()
        assert page.tab.evaluate(theme) == "light"


def test_a_token_is_needed(browser: Any, server: Served) -> None:
    context = browser.new_context()
    tab = context.new_page()
    answer = tab.goto(server.origin + "/")
    assert answer is not None
    assert answer.status == 403
    context.close()


def test_the_page_ships_with_the_package() -> None:
    wanted = ("index.html", "style.css", "js/main.js", "js/words/de.js")
    assert all((WEB / name).is_file() for name in wanted)
    ignored = Path(".gitignore").read_text().split()
    assert not any(f"/{name}/" in str(path) for path in WEB.rglob("*") for name in ignored)


def test_a_late_answer_does_not_bring_back_an_older_state(page: Driver) -> None:
    """Asked for when the stream of news opened, answered after a command had changed the state."""
    seen = page.tab.evaluate("""async () => {
        const { Connection } = await import(new URL("js/connection.js", document.baseURI));
        const kept = [window.fetch, window.EventSource];
        let stream, answer;
        window.EventSource = class { constructor() { stream = this; } close() {} };
        const connection = new Connection();
        await connection.start();
        const first = connection.state;
        const later = (n, serving = first.serving) =>
            new Response(JSON.stringify({ ...first, serving, revision: first.revision + n }));
        window.fetch = async (path) => path === "api/state"
            ? new Promise((resolve) => { answer = resolve; })
            : Response.json({ result: null, state: await later(2).json() });
        const shown = [];
        const refreshed = stream.onopen();
        await connection.send("undo");
        shown.push(connection.state.revision - first.revision);
        answer(later(1));
        await refreshed;
        shown.push(connection.state.revision - first.revision);
        const restarted = stream.onopen();
        answer(later(-1, "another run of the server"));
        await restarted;
        shown.push(connection.state.revision - first.revision);
        [window.fetch, window.EventSource] = kept;
        return shown;
    }""")
    assert seen == [2, 2, -1]
