"""The page with a pair that looks through glass and water, and through ports that lean."""

from __future__ import annotations

import json
import pickle
import shutil
import subprocess
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from bifocal import Pair, solve
from bifocal.collimation.job_tasks import task_of
from bifocal.collimation.pyramids import RectifiedPhoto, max_level
from bifocal.collimation.stated_media import media_of
from bifocal.matching.suggestions import radial_line, seen_in_other, suggest
from tests.bifocal.model.test_pair_through_media import PAIRS, content
from tests.bifocal.model.test_pair_through_media import POINTS as WIDE
from tests.page_session import client_of, opened, pick_both, sample_folder
from tests.scenes.refracted import pixels_of
from tests.workbook_lint import lint

#: Well inside both photos.
POINTS = WIDE * [0.7, 0.7, 1.0]
NAMES = ("tank", "oblique", "leaning port")


def shot(name, points=POINTS):
    layers, *photos = PAIRS[name]
    return [pixels_of(photo, points, layers) for photo in photos]


def folder_of(name, folder):
    """Write a pair file and two pictures into a folder."""
    data, rng = content(name), np.random.default_rng(5)
    for number in (1, 2):
        picture = rng.integers(40, 220, (1200, 1600), dtype=np.uint8)
        cv2.imwrite(str(folder / f"{number}.png"), picture)
        data[f"image{number}"] = data[f"image{number}"] | {"file": f"{number}.png"}
    (folder / "wall.pair.json").write_text(json.dumps(data))
    return folder


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("image", [1, 2])
def test_the_line_of_a_pick_passes_where_the_other_photo_shows_it(name, image):
    """Shot rays: for its true relief, and as a line that comes as near as its steps."""
    pair, seen = Pair.from_dict(content(name)), shot(name)
    for row, point in enumerate(POINTS):
        own, other = seen[image - 1][row], seen[2 - image][row]
        found = seen_in_other(pair, image, own, point[2:])
        np.testing.assert_allclose(found[0], other, atol=1e-6)
        line = radial_line(pair, image, own, (1600, 1200), count=2001)
        assert np.linalg.norm(line - other, axis=1).min() < 1.0


def rendered(pair, relief):
    """Return both photos of a flat wall at a relief, its texture sampled along bent rays."""
    rng = np.random.default_rng(11)
    texture = cv2.GaussianBlur(rng.uniform(0, 255, (1500, 2000)).astype(np.float32), (0, 0), 2.0)
    texture = np.clip(128 + 6 * (texture - 127), 0, 255)
    photos = []
    for photo in (pair.image1, pair.image2):
        rows, columns = np.mgrid[400:800, 500:1100]
        pixels = np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)
        q = photo.apparent_from_pixels(pixels)
        ray, slope = photo.media.trace(q - photo.nadir)
        place = photo.nadir + ray + relief * slope
        at = ((place + np.array([1.5, 1.1])) / 0.0015).astype(np.float32)
        at = at.reshape(400, 600, 2)
        values = cv2.remap(texture, at[..., 0], at[..., 1], cv2.INTER_CUBIC)
        picture = np.zeros((1200, 1600), np.uint8)
        picture[400:800, 500:1100] = np.clip(values, 0, 255)
        photos.append(picture)
    return photos[0], photos[1]


@pytest.mark.parametrize("image", [1, 2])
def test_a_suggestion_is_found_along_the_bent_line(image):
    """The place where shot rays show the point, in pictures of its surface."""
    pair, point = Pair.from_dict(content("tank")), np.array([[0.22, 0.1, 0.1]])
    seen = [one[0] for one in shot("tank", point)]
    found = suggest(pair, rendered(pair, 0.1), image, seen[image - 1])
    assert found.kept
    assert np.linalg.norm(found.pixel - seen[2 - image]) < 0.1


@pytest.mark.parametrize(
    "name",
    ["leaning port", *(pytest.param(n, marks=pytest.mark.acceptance) for n in NAMES[:2])],
)
def test_points_measured_on_the_page_are_where_shot_rays_put_them(name, tmp_path):
    """Picks, results with sigmas, conversion of pixels; the browser's own conversion too."""
    folder, seen = folder_of(name, tmp_path), shot(name)
    pair = Pair.read(folder / "wall.pair.json")
    with opened(folder / "wall.pair.json") as session:
        client = client_of(session)
        for row, (one, two) in enumerate(zip(*seen, strict=True)):
            pick_both(session, f"P{row}", (tuple(one), tuple(two)))
        state = client.get("/api/state").json()
        found = {p["name"]: p["result"] for p in state["points"]}
        xyz = [[found[f"P{i}"][key] for key in ("X", "Y", "r")] for i in range(len(POINTS))]
        np.testing.assert_allclose(xyz, POINTS, atol=1e-9)
        sigma = pair.intersect(*seen).sigma[:, 2]
        shown = [found[f"P{i}"]["sigma_r"] for i in range(len(POINTS))]
        np.testing.assert_allclose(shown, sigma, rtol=1e-9)
        bounds, gsd = state["pair"]["plane_bounds"], state["pair"]["gsd"]
        flat = POINTS * [1, 1, 0]
        expected = np.column_stack(
            [(flat[:, 0] - bounds[0]) / gsd - 0.5, (bounds[3] - flat[:, 1]) / gsd - 0.5]
        )
        for image, pixels in enumerate(shot(name, flat), start=1):
            ask = {"image": image, "pixels": pixels.tolist(), "from": "photo"}
            wall = client.post("/api/convert", json=ask).json()["pixels"]
            np.testing.assert_allclose(wall, expected, atol=1e-6)
        _same_in_the_browser(state["pair"], [expected, *shot(name, flat)])


def _same_in_the_browser(shown, places):
    """Run the page's own module: wall to photo and back, against the same shot rays."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    module = "bifocal/collimation/web/js/geometry.js"
    script = f"""
import {{ Wall }} from "./{module}";
const shown = {json.dumps(shown)};
const [wall, ...photos] = {json.dumps([one.tolist() for one in places])};
const there = new Wall(shown);
console.log(JSON.stringify([1, 2].map((image) => [
  wall.map((pixel) => there.toPhoto(image, pixel)),
  photos[image - 1].map((pixel) => there.fromPhoto(image, pixel)),
])));
"""
    run = subprocess.run(
        [node, "--input-type=module", "-"], input=script, capture_output=True, text=True,
        check=True, timeout=60,
    )  # fmt: skip
    for image, (there, back) in enumerate(json.loads(run.stdout), start=1):
        np.testing.assert_allclose(there, places[image], atol=1e-6)
        np.testing.assert_allclose(back, places[0], atol=1e-6)


@pytest.mark.parametrize("name", [pytest.param("tank", marks=pytest.mark.acceptance), NAMES[2]])
def test_the_workbook_of_the_page_follows_the_bent_rays(name, tmp_path):
    """Written new, then changed in place by the page's own way."""
    folder, seen = folder_of(name, tmp_path), shot(name)
    with opened(folder) as session:
        for rows in (range(3), range(3, 5)):
            for row in rows:
                pick_both(session, f"P{row}", (tuple(seen[0][row]), tuple(seen[1][row])))
            session.sync.step()
            assert session.sync.waiting is None
            found = solve(tmp_path / "wall.xlsx").table
            np.testing.assert_allclose(found.xyz, POINTS[: len(found)], atol=1e-9)
    assert len(found) == 5
    assert lint(tmp_path / "wall.xlsx") == []


def test_the_wall_is_shown_by_bent_rays(tmp_path):
    """A disc on the wall, drawn where shot rays show it, stands at its place on the tiles."""
    folder = folder_of("tank", tmp_path)
    centre = np.array([[0.4, -0.2, 0.0]])
    for number, pixel in enumerate(shot("tank", centre), start=1):
        picture = np.zeros((1200, 1600), np.uint8)
        cv2.circle(picture, tuple(round(v * 16) for v in pixel[0]), 160, 255, -1, 16, 4)
        cv2.imwrite(str(folder / f"{number}.png"), picture)
    with opened(folder / "wall.pair.json") as session:
        grid = session.pictures.grid
        at = grid.pixel_of(centre[:, :2])[0]
        for number in (1, 2):
            source = RectifiedPhoto.of(
                session.pictures.pair.photo(number), number, session.pictures.pyramids[number - 1],
                grid,
            )  # fmt: skip
            level = 0
            while max(source.size) > 512 * 2**level:
                level += 1
            tile = source.tile(max_level(source.size) - level, 0, 0)
            grey = tile if tile.ndim == 2 else tile[..., 0]
            rows, columns = np.nonzero(grey > 100)
            shown = (np.array([columns.mean(), rows.mean()]) + 0.5) * 2**level - 0.5
            assert np.linalg.norm(shown - at) < 1.5 * 2**level


def test_media_are_typed_on_the_page_and_what_lacks_is_said(tmp_path):
    """One field after the other: the advice, and the refusal of the job, name what is missing."""
    sample_folder(tmp_path)
    (tmp_path / "facade.pair.json").unlink()
    with opened(tmp_path / "far.jpg", tmp_path / "near.jpg") as session:
        client = client_of(session)

        def typed(**fields):
            body = {"id": str(fields), "op": "setup.set", **fields}
            return client.post("/api/command", json=body)

        for fields, missing in (
            ({"glass_index": "1,49"}, "index of the water"),
            ({"water_index": 1.337}, "thickness"),
            ({"glass_thickness": "0,01"}, "one of the two"),
            ({"port": 0.05, "depth": 0.6}, "one of the two"),
            ({"depth": None}, "four control points"),
        ):
            state = typed(**fields).json()["state"]
            refused = client.post("/api/jobs", json={"kind": "align", "options": {}})
            assert refused.status_code == 422
            assert missing in refused.json()["error"]
            assert missing in state["advice"][0] or missing == "four control points"
        for value in (0.8, 13.37, "water"):
            answer = typed(water_index=value)
            assert answer.status_code == 400
            assert "water_index" in answer.json()["error"]
        state = typed(d1=3.5, d2=1.9).json()["state"]
        assert (state["setup"]["water_index"], state["setup"]["port"]) == (1.337, 0.05)
        task = task_of(session, "align", {})
        assert (task.options.as_set_up, task.options.auto) == (True, False)
        media = pickle.loads(pickle.dumps(task)).options.media
        assert media.layers.indices == (1.0, 1.49, 1.337)
        assert (media.layers.thicknesses, media.port, media.sigmas) == ((0.01,), (0.05, 0.05), {})
        typed(sigma_water_index=0.003)
        assert media_of(session.state.setup).sigmas == {"index3": 0.003}


@pytest.mark.parametrize("name", NAMES)
def test_a_pair_that_came_with_media_is_oriented_through_them_again(name, tmp_path):
    """Nothing typed: its own ports or glass. Typed, then emptied: air."""
    folder, seen = folder_of(name, tmp_path), shot(name)
    pair = Pair.read(folder / "wall.pair.json")
    with opened(folder / "wall.pair.json") as session:
        for row, (xyz, one, two) in enumerate(zip(POINTS, *seen, strict=True)):
            known = dict(zip("XYr", xyz.tolist(), strict=True))
            session.command({"op": "control.set", "name": f"C{row}", **known})
            for image, pixel in enumerate((one, two), start=1):
                pick = {"image": image, "column": pixel[0], "row": pixel[1]}
                session.command({"op": "control.pick", "name": f"C{row}", **pick})
        media = pickle.loads(pickle.dumps(task_of(session, "align", {}))).options.media
        assert media.layers == pair.layers
        for number, photo in enumerate((pair.image1, pair.image2)):
            camera = SimpleNamespace(centre=[*photo.nadir, photo.distance])
            assert media.z0(number, camera) == pytest.approx(photo.z0, abs=1e-12)
            found = media.normal(number, camera)
            assert (found is None) == (photo.interface_normal is None)
            if found is not None:
                own = np.array(photo.interface_normal)
                np.testing.assert_allclose(found, own / np.linalg.norm(own), atol=1e-15)
        session.command({"op": "setup.set", "water_index": 1.337})
        session.command({"op": "setup.set", "water_index": None})
        assert not task_of(session, "align", {}).options.media
