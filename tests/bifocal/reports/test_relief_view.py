"""The relief in three dimensions: what the page holds is the map, and a browser draws it."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import bifocal
from bifocal import SAMPLE, Grid, InputError, ReliefMap
from tests.browser import launched
from tests.builders.commands import bifocal_command as main
from tests.web_page import Page


def data_of(page: str) -> dict:
    return json.loads(re.search(r"const DATA = (.*);\n", page)[1])


def heights_of(data: dict) -> np.ndarray:
    raw = np.frombuffer(base64.b64decode(data["heights"]), "<u2").astype(float)
    heights = np.where(raw > 0, data["least"] + (raw - 1) * data["unit"], np.nan)
    return heights.reshape(data["height"], data["width"])


def wall() -> bifocal.ReliefMap:
    """A slope of 0.1 along X with a step of half a metre, a hole and one mad pixel."""
    grid = Grid.from_bounds((-3.0, -2.0, 3.0, 2.0), gsd=0.01)
    x = -3.0 + 0.01 * (np.arange(600) + 0.5)
    r = np.tile(0.1 * x, (400, 1)).astype(np.float32)
    r[:200] += 0.5
    r[300:360, 100:200] = np.nan
    r[100, 100] = 40.0
    return bifocal.ReliefMap.from_relief(r, plane_from_pixel=grid.plane_from_pixel)


def test_the_mesh_is_the_map_in_its_place_with_its_holes():
    page = bifocal.relief_view(wall(), title="W")
    Page(page)
    data = data_of(page)
    heights = heights_of(data)
    # 240 000 pixels in blocks of 2 x 2.
    assert heights.shape == (200, 300)
    x = data["left"] + data["step"] * np.arange(300)
    y = data["top"] - data["step"] * np.arange(200)
    expected = 0.1 * x[None, :] + np.where(y[:, None] > 0, 0.5, 0.0)
    known = np.isfinite(heights)
    # A block's median is that of its left or right column: half a pixel of 1 cm at 0.1.
    np.testing.assert_allclose(heights[known], np.broadcast_to(expected, (200, 300))[known],
                               atol=6e-4)  # fmt: skip
    hole = np.zeros((200, 300), bool)
    hole[150:180, 50:100] = True
    np.testing.assert_array_equal(~known, hole)
    assert data["reach"] < 1.0


def test_a_small_map_is_kept_pixel_by_pixel_and_a_flat_one_is_drawn():
    grid = Grid.from_bounds((0.0, 0.0, 0.6, 0.4), gsd=0.1)
    flat = bifocal.ReliefMap.from_relief(np.zeros((4, 6)), plane_from_pixel=grid.plane_from_pixel)
    data = data_of(bifocal.relief_view(flat))
    np.testing.assert_allclose(heights_of(data), 0.0)
    assert (data["left"], data["top"]) == pytest.approx((0.05, 0.35))


def test_a_map_of_nothing_is_refused():
    nothing = replace(wall(), r=np.full((400, 600), np.nan, np.float32))
    with pytest.raises(InputError, match="no pixel is known"):
        bifocal.relief_view(nothing)


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """The sample's relief with the orthophoto of a part of it, and without."""
    folder = tmp_path_factory.mktemp("view")
    lines = [
        ["ortho", SAMPLE / "facade.pair.json", "--relief", SAMPLE / "truth.tif", "--gsd", 0.025,
         "--bounds=-4,-3,4,3", "--out", folder / "ortho.tif"],
        ["view", SAMPLE / "truth.tif", "--ortho", folder / "ortho.tif", "--language", "it",
         "--title", "Via <Roma> $1", "--out", folder / "photo.html"],
        ["view", SAMPLE / "truth.tif", "--out", folder / "plain.html"],
    ]  # fmt: skip
    for words in lines:
        result = CliRunner().invoke(main, list(map(str, words)))
        assert result.exit_code == 0, result.stderr
    return folder


def test_the_page_stands_alone_and_is_small(pages):
    text = (pages / "photo.html").read_text("utf-8")
    page = Page(text)
    assert not page.sources
    assert "http" not in text
    assert "Via <Roma> $1" in page.text
    assert "Rilievo amplificato" in page.text
    assert (pages / "photo.html").stat().st_size < 1e6
    data = data_of(text)
    assert data["bounds"] == pytest.approx([-4, -3, 4, 3])
    assert data["photo"].startswith("data:image/jpeg;base64,")
    relief = ReliefMap.read(SAMPLE / "truth.tif")
    away = heights_of(data) - relief.sample(
        np.stack(np.meshgrid(
            data["left"] + data["step"] * np.arange(data["width"]),
            data["top"] - data["step"] * np.arange(data["height"]),
        ), axis=-1)
    )  # fmt: skip
    assert np.nanmedian(np.abs(away)) < 0.002


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--out", "v.pdf"], "written as .html"),
        (["--out", "v.html", "--ortho", "absent.tif"], "absent.tif"),
        (["--out", "v.html", "--ortho", str(SAMPLE / "facade.pair.json")], "facade.pair.json"),
    ],
)
def test_what_cannot_be_shown_is_refused(tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, ["view", str(SAMPLE / "truth.tif"), *options])
    assert result.exit_code == 1
    assert said in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.acceptance
@pytest.mark.browser
def test_a_browser_draws_it_and_turns_it(pages):
    with launched(
        "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"
    ) as browser:
        tab = browser.new_page(viewport={"width": 800, "height": 600})
        faults: list[str] = []
        tab.on("pageerror", lambda error: faults.append(str(error)))
        asked: list[str] = []
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto((pages / "plain.html").as_uri())
        tab.wait_for_function("() => document.body.dataset.drawn > 50000")
        assert tab.evaluate("() => gl.getError()") == 0
        shown = "() => { draw(); return canvas.toDataURL(); }"
        first = tab.evaluate(shown)
        tab.locator("canvas").focus()
        for _ in range(6):
            tab.keyboard.press("ArrowRight")
        assert tab.evaluate(shown) != first
        tab.get_by_role("button").click()
        assert tab.evaluate(shown) == first
        assert faults == []
        assert len(asked) == 1
