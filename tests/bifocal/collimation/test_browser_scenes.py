"""Real façades by clicks alone, from two photos to the drawing, with picks of 0.3 px of noise."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bifocal
from tests.browser import Driver, served, tab_of

Places = dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]
#: Of each scene: far and near photo, table, its columns of both pixels, lens, sensor, d1, d2.
SCENES = {
    "semireal_church": (
        "semireal_church", ("d18.png", "d9.png"), "checkpoints.csv",
        ("x_d18_px", "y_d18_px", "x_d9_px", "y_d9_px"), (36.0, 18.0), 22.7, (18.0, 9.0),
    ),
    "church_2": (
        "facade_pairs/church_2", ("far.jpg", "near.jpg"), "points.csv",
        ("x_far_px", "y_far_px", "x_near_px", "y_near_px"), (32.34, 32.34), 36.0, (14.54, 10.54),
    ),
}  # fmt: skip
#: Control points of known place: near the corners, one that stands out, one that lies back.
CONTROL = {
    "semireal_church": ("745", "33", "174", "1264", "1390", "412"),
    "church_2": ("26541", "31061", "47353", "28142", "53065", "21331"),
}
POINTS = {"semireal_church": ("262", "1973", "1619"), "church_2": ("53060", "49228", "13329")}


def places_of(table: Path, columns: tuple[str, ...]) -> Places:
    """Return X, Y, r and the pixels of both photos by name, as the scene's own table has them."""
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        row["id"]: (
            np.array([float(row[key]) for key in ("X_m", "Y_m", "relief_m")]),
            np.array([float(row[key]) for key in columns[:2]]),
            np.array([float(row[key]) for key in columns[2:]]),
        )
        for row in rows
    }


def click(page: Driver, image: int, pixel: np.ndarray) -> None:
    """Click on a pixel of a photo at four times its size, beginning with the whole of it."""
    page.keys("0")
    page.zoom_to(image, (pixel[0], pixel[1]), 4.0)
    page.pick(image, (pixel[0], pixel[1]))


def give(page: Driver, scene: str, folder: Path) -> None:
    """Photos, lenses, distances."""
    _, names, _, _, focal, sensor, distances = SCENES[scene]
    page.tab.get_by_test_id("photo-files").set_input_files([str(folder / name) for name in names])
    page.settled("state.photos.length === 2")
    for index in (0, 1):
        for label, value in (("Focal length", focal[index]), ("Sensor width", sensor)):
            page.tab.get_by_label(label).nth(index).fill(str(value))
            page.keys("Enter")
    page.unfold("site")
    for label, value in zip(("Far distance d1", "Near distance d2"), distances, strict=True):
        page.tab.get_by_label(label).fill(str(value))
        page.keys("Enter")
    page.settled("state.setup.d1 && state.setup.d2 && state.photos[1].sensor_width_mm")


def orient(page: Driver, scene: str, places: Places, rng: np.random.Generator) -> None:
    """Control points pasted and picked, aligned, accepted."""
    page.click("mode-orientation")
    rows = ["\t".join([f"C{name}", *map(str, places[name][0])]) for name in CONTROL[scene]]
    page.click("control-paste")
    page.tab.get_by_test_id("paste-area").fill("\n".join(rows))
    page.click("dialog-yes")
    page.settled(f"state.control.length === {len(rows)}")
    for name in CONTROL[scene]:
        for image in (1, 2):
            label = f"C{name}: pick in photo {image}"
            page.tab.get_by_role("button", name=label, exact=True).click()
            click(page, image, places[name][image] + rng.normal(0, 0.3, 2))
            page.settled(f"state.control.find((one) => one.name === 'C{name}').picks[{image}]")
    page.click("align")
    assert page.finished("align")["state"] == "done"
    page.click("align-accept")
    page.settled("state.pair.accepted")


def draw(page: Driver) -> None:
    """Relief, orthophoto and drawing."""
    page.click("mode-products")
    page.tab.get_by_test_id("relief-quality").select_option("fast")
    for button, kind in (("run-relief", "relief"), ("run-ortho", "ortho"), ("deliver", "deliver")):
        page.click(button)
        assert page.finished(kind)["state"] == "done"
    assert any(one["name"].endswith(".pdf") for one in page.state["products"]["files"])


@pytest.mark.acceptance
@pytest.mark.long
@pytest.mark.parametrize("scene", SCENES)
def test_a_church_from_nothing_to_points_and_drawing(
    browser: Any, tmp_path: Path, data_dir: Path, scene: str
) -> None:
    folder, _, table, columns, *_ = SCENES[scene]
    source = data_dir / folder
    places, rng = places_of(source / table, columns), np.random.default_rng(14)
    with served(tmp_path) as server, tab_of(browser, server) as page:
        give(page, scene, source)
        orient(page, scene, places, rng)
        page.click("mode-points")
        for count, name in enumerate(POINTS[scene], start=1):
            page.keys("n")
            for image in (1, 2):
                click(page, image, places[name][image] + rng.normal(0, 0.3, 2))
                page.settled(f"state.points.at({count - 1})?.picks[{image}]")
        state = page.settled("state.points.every((point) => point.result)")
        shown = {point["name"]: point["result"] for point in state["points"]}
        for name, result in zip(POINTS[scene], shown.values(), strict=True):
            error = result["r"] - places[name][0][2]
            assert abs(error) < 4 * result["sigma_r"] + 0.02, name
        book = tmp_path / state["workbook"]
        for _ in range(100):
            # The workbook follows pick by pick: the last row may still wait for its second.
            written = bifocal.solve(book).table if book.exists() else None
            if written and len(written.ids) == len(shown) and np.isfinite(written["r"]).all():
                break
            page.tab.wait_for_timeout(300)
        table_solved = bifocal.solve(book).table
        solved = dict(zip(table_solved.ids, table_solved["r"].tolist(), strict=True))
        expected = {name: result["r"] for name, result in shown.items()}
        assert solved == pytest.approx(expected, rel=1e-9, abs=1e-9)
        if scene == "semireal_church":  # the other takes a minute for it
            draw(page)
