"""Suggestion, snap, tiles, conversion and measures against what is true of the sample pair."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image

from bifocal import SAMPLE, InputError, Lens, Pair, PointObservations, read_image
from bifocal.collimation.measures import measure
from bifocal.collimation.pyramids import TILE, level_size, max_level
from bifocal.matching.snapping import snap
from bifocal.matching.suggestions import radial_line, suggest
from bifocal.model.orientation_precision import NAMES
from bifocal.survey.point_survey import solve_points
from bifocal.survey.relief_table import ReliefTable
from tests.bifocal.collimation.page_truth import SPOILT, true_pixels
from tests.cases import few_by_default
from tests.page_session import client_of, opened, sample_folder
from tests.scenes import bifocal_cameras, demo_scene
from tests.scenes.make_sample import PIXEL, SIZE
from tests.scenes.tracing import Tracer


@pytest.fixture(scope="module")
def sample():
    pair = Pair.read(SAMPLE / "facade.pair.json")
    return pair, (read_image(SAMPLE / "far.jpg"), read_image(SAMPLE / "near.jpg"))


@pytest.mark.parametrize("image", [1, 2])
def test_the_homologous_point_is_found_along_its_line(sample, image: int) -> None:
    pair, photos = sample
    errors, kept = [], []
    for name, pixels in true_pixels().items():
        if name in SPOILT:
            continue
        own, other = pixels[image - 1], pixels[2 - image]
        found = suggest(pair, photos, image, own)
        errors.append(np.linalg.norm(found.pixel - other))
        kept.append(found.kept)
        assert 0 <= found.quality <= 1
        assert found.sigma_px < 0.2
    # The sample's targets were rendered with three rays a pixel: 0.05 px is what they allow.
    assert np.median(errors) < 0.06
    assert np.mean(kept) > 0.9
    assert max(error for error, good in zip(errors, kept, strict=True) if good) < 0.3


#: Picks of the far photo beside steps, whose window shows the other surface too.
BESIDE_STEPS = [
    (1226.5, 771.4), (1230.8, 370.6), (366.3, 374.3), (1249.2, 493.3), (291.1, 771.7),
    (1011.7, 61.7), (1128.2, 369.7), (659.3, 664.4), (849.7, 58.9), (125.9, 507.6),
]  # fmt: skip


#: Picks whose window takes two places for as good, the wrong one first; another draw.
DOUBTFUL = [(383.0, 320.0), (221.0, 377.0), (424.0, 647.0), (1039.0, 848.0)]


def partners(own) -> np.ndarray:
    """Return where the near camera sees picks of the far photo, by the ray caster."""
    cameras, tracer = bifocal_cameras(size=SIZE, pixel=PIXEL), Tracer(demo_scene())
    rays = cameras.far.rays(own)
    along, _ = tracer.cast(cameras.far.centre, rays, own, tracer.bounds(cameras.far))
    return np.asarray(cameras.near.view_of(cameras.far.centre + along[:, None] * rays))


def test_where_a_suggestion_is_in_doubt_the_other_places_are_offered(sample) -> None:
    pair, photos = sample
    for own, seen in zip(np.array(DOUBTFUL), partners(np.array(DOUBTFUL)), strict=True):
        found = suggest(pair, photos, 1, own)
        assert not found.kept
        assert np.linalg.norm(found.pixel - seen) > 2.0
        assert min(np.linalg.norm(place - seen) for place in found.others) < 0.7
    # One that is sure of itself offers nothing else.
    assert suggest(pair, photos, 1, true_pixels()["T08"][0]).others == ()


def test_what_half_the_window_denies_is_not_taken_unasked(sample) -> None:
    pair, photos = sample
    own = np.array(BESIDE_STEPS)
    seen = partners(own)
    found = [suggest(pair, photos, 1, pixel) for pixel in own]
    away = [np.linalg.norm(one.pixel - true) for one, true in zip(found, seen, strict=True)]
    assert min(away) > 2.0  # correlation alone is sure of a wrong place
    assert min(one.score for one in found) > 0.7
    assert not any(one.kept for one in found)


def test_the_line_runs_through_the_point_and_the_zoom_centre(sample) -> None:
    pair, _ = sample
    for image in (1, 2):
        for name in ("T16", "T20", "T28"):
            pixels = true_pixels()[name]
            line = radial_line(pair, image, pixels[image - 1], (1536, 1024))
            for place in (pixels[2 - image], pair.photo(3 - image).pixels_from_plane([0.0, 0.0])):
                along = line[-1] - line[0]
                away = place - line[0]
                off = (along[0] * away[1] - along[1] * away[0]) / np.linalg.norm(along)
                assert abs(off) < 0.02


def test_a_pick_that_the_other_photo_cannot_show_says_so(sample) -> None:
    pair, photos = sample
    with pytest.raises(InputError, match=r"rim|does not show|outside"):
        suggest(pair, photos, 1, np.array([0.0, 0.0]), relief_range=(3.0, 3.5))


@pytest.mark.acceptance
def test_snap_finds_the_centres_of_the_samples_targets(sample) -> None:
    rng = np.random.default_rng(4)
    errors = []
    for name, pixels in true_pixels().items():
        if name in SPOILT:
            continue
        for photo, true in zip(sample[1], pixels, strict=True):
            found = snap(photo, tuple(true + rng.uniform(-3, 3, 2)), 6.0)
            assert found.kind == "target", name
            errors.append(np.hypot(found.column - true[0], found.row - true[1]))
    assert np.mean(np.array(errors) < 0.05) > 0.9
    assert max(errors) < 0.06


def _drawn(kind: str, centre: tuple[float, float], size: float, rng) -> np.ndarray:
    """Return a target drawn with 8 x 8 samples a pixel and blurred as by a lens, with noise."""
    fine, side = 8, 64
    at = (np.arange(side * fine) + 0.5) / fine - 0.5
    x, y = np.meshgrid(at - centre[0], at - centre[1])
    turn = 0.3
    u, v = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    inside = np.hypot(x, y) < size / 2
    if kind == "chequer":
        inside &= u * v > 0
    if kind == "cross":
        inside = (np.abs(u) < size / 8) | (np.abs(v) < size / 8)
    plate = np.hypot(x, y) < 0.9 * size
    grey = np.where(inside, 30.0, np.where(plate, 220.0, 130.0))
    grey = grey.reshape(side, fine, side, fine).mean(axis=(1, 3))
    grey = cv2.GaussianBlur(grey, (0, 0), 0.6) + rng.normal(0, 2.0, (side, side))
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("kind", ["disc", "chequer", "cross"])
@pytest.mark.parametrize("size", [8.0, 13.0, 24.0])
def test_snap_is_good_to_a_twentieth_of_a_pixel(kind: str, size: float) -> None:
    rng = np.random.default_rng(int(size))
    for _ in range(4):
        true = 31.5 + rng.uniform(-2, 2, 2)
        found = snap(_drawn(kind, tuple(true), size, rng), tuple(true + rng.uniform(-2, 2, 2)), 5.0)
        assert found.kind == "target"
        assert np.hypot(found.column - true[0], found.row - true[1]) < 0.05


def test_snap_finds_a_corner_and_leaves_plaster_alone() -> None:
    rng = np.random.default_rng(8)
    grey = np.full((64, 64), 90.0)
    grey[30:, 25:] = 200.0  # the edge lies between pixels 29 and 30, 24 and 25
    noisy = np.clip(cv2.GaussianBlur(grey, (0, 0), 0.7) + rng.normal(0, 1.5, grey.shape), 0, 255)
    found = snap(noisy.astype(np.uint8), (26.0, 28.0), 6.0)
    assert found.kind == "corner"
    assert np.hypot(found.column - 24.5, found.row - 29.5) < 0.15
    plaster = np.clip(128 + rng.normal(0, 2, (64, 64)), 0, 255).astype(np.uint8)
    assert snap(plaster, (30.0, 31.0), 6.0) == (30.0, 31.0, "none", None)


def _corner_drawn(centre: np.ndarray, opening: float, turn: float, blur: float, rng) -> np.ndarray:
    """Return a dark corner of an opening [degrees], blurred, with noise."""
    fine, side = 8, 72
    at = (np.arange(side * fine) + 0.5) / fine - 0.5
    x, y = np.meshgrid(at - centre[0], at - centre[1])
    inside = (np.degrees(np.arctan2(y, x)) - turn) % 360 < opening
    grey = np.where(inside, 70.0, 170.0).reshape(side, fine, side, fine).mean(axis=(1, 3))
    grey = cv2.GaussianBlur(grey, (0, 0), blur) + rng.normal(0, 2.0, (side, side))
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("opening", few_by_default([60.0, 90.0, 120.0, 270.0], 60.0, 270.0))
@pytest.mark.parametrize("blur", few_by_default([0.6, 1.2], 1.2))
def test_blur_does_not_draw_a_corner_away_from_where_its_edges_cross(
    opening: float, blur: float
) -> None:
    rng = np.random.default_rng(int(opening))
    errors, sigmas = [], []
    for turn in range(0, 360, 30):
        true = 35.5 + rng.uniform(-1, 1, 2)
        grey = _corner_drawn(true, opening, turn + rng.uniform(0, 30), blur, rng)
        found = snap(grey, tuple(true + rng.normal(0, 1, 2)), 6.0)
        if found.kind == "corner":
            errors.append(np.hypot(found.column - true[0], found.row - true[1]))
            sigmas.append(found.sigma_px)
    assert len(errors) >= 10
    assert np.median(errors) < (0.25 if opening == 60.0 else 0.12)
    assert np.sqrt(np.mean(np.square(errors) / np.square(sigmas))) < 2.5


@pytest.mark.parametrize("size", [3.0, 4.0, 5.0, 6.0, 8.0])
def test_the_rim_of_a_small_disc_is_no_corner(size: float) -> None:
    rng = np.random.default_rng(int(size))
    for _ in range(10):
        true = 31.5 + rng.uniform(-2, 2, 2)
        found = snap(_drawn("disc", tuple(true), size, rng), tuple(true + rng.normal(0, 1, 2)), 6.0)
        assert found.kind != "corner"
        if found.kind == "target":
            assert np.hypot(found.column - true[0], found.row - true[1]) < 0.15


def tile_of(client, space: str, image: int, level: int, column: int, row: int) -> np.ndarray:
    answer = client.get(f"/tiles/{space}/{image}/{level}/{column}_{row}.jpg")
    assert answer.status_code == 200
    return np.asarray(Image.open(io.BytesIO(answer.content)))


def test_tiles_show_the_photo_pixel_by_pixel(tmp_path, sample) -> None:
    with opened(sample_folder(tmp_path)) as session:
        client = client_of(session)
        info = client.get("/tiles/photo/2/info").json()
        assert (info["width"], info["height"], info["tile"]) == (1536, 1024, TILE)
        tile = tile_of(client, "photo", 2, info["max_level"], 1, 1)
        assert np.abs(tile.astype(int) - sample[1][1][512:1024, 512:1024]).mean() < 1.5
        for level in range(info["max_level"] + 1):
            width, height = level_size((1536, 1024), level)
            assert tile_of(client, "photo", 1, level, 0, 0).shape[:2] == (
                min(height, TILE), min(width, TILE),
            )  # fmt: skip
        assert client.get(f"/tiles/photo/1/{info['max_level']}/3_0.jpg").status_code == 404
        assert client.get("/tiles/photo/3/info").status_code == 404
        assert client.get("/tiles/ortho/0/info").status_code == 404


def test_tiles_are_kept_on_the_disk_and_named_by_their_version(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        client = client_of(session)
        version = client.get("/tiles/wall/1/info").json()["version"]
        first = client.get("/tiles/wall/1/9/0_0.jpg", params={"v": version})
        assert "immutable" in first.headers["cache-control"]
        tag = first.headers["etag"]
        again = client.get("/tiles/wall/1/9/0_0.jpg", headers={"if-none-match": tag})
        assert again.status_code == 304
    with opened(folder) as session:
        session.pictures.pyramids[0].load = None  # the photo is not needed any more
        kept = client_of(session).get("/tiles/wall/1/9/0_0.jpg")
        assert kept.content == first.content


def _bent(folder) -> None:
    """Give both photos of the sample a lens and a turned wall, in the pair file alone."""
    lens = Lens(
        camera_matrix=[[2400.0, 0, 760.0], [0, 2400.0, 520.0], [0, 0, 1]],
        coefficients=[-0.12, 0.03, 0.0004, -0.0003, 0.0], image_size=(1536, 1024),
    )  # fmt: skip
    lens.write(folder / "lens.json")
    path = folder / "facade.pair.json"
    data = json.loads(path.read_text())
    turn = np.array([[1.0, 0.02, 3.0], [-0.015, 1.01, -5.0], [6e-6, -4e-6, 1.0]])
    for key in ("image1", "image2"):
        data[key]["lens"] = "lens.json"
        matrix = np.array(data[key]["plane_from_pixel"]) @ turn
        data[key]["plane_from_pixel"] = (matrix / matrix[2, 2]).tolist()
    path.write_text(json.dumps(data))


def test_wall_and_photo_pixels_are_exact_through_lens_and_tilt(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    _bent(folder)
    places = np.array([[10.0, 20.0], [700.25, 500.5], [1500.0, 1000.0], [40.0, 980.0]])
    with opened(folder) as session:
        client = client_of(session)
        state = client.get("/api/state").json()
        bounds, gsd = state["pair"]["plane_bounds"], state["pair"]["gsd"]
        for image in (1, 2):
            ask = {"image": image, "pixels": places.tolist(), "from": "photo"}
            wall = np.array(client.post("/api/convert", json=ask).json()["pixels"])
            # The same by the pair file's definition, step by step with OpenCV.
            shown = state["pair"]["images"][image - 1]
            lens = shown["lens"]
            inner, bend = np.array(lens["camera_matrix"]), np.array(lens["coefficients"])
            criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-14)
            ideal = cv2.undistortPoints(
                places[:, None], inner, bend, None, None, inner, criteria=criteria
            )[:, 0]  # fmt: skip
            matrix = np.array(json.loads((folder / "facade.pair.json").read_text())[
                f"image{image}"]["plane_from_pixel"])  # fmt: skip
            plane = cv2.perspectiveTransform(ideal[None], matrix)[0]
            expected = np.column_stack(
                [(plane[:, 0] - bounds[0]) / gsd - 0.5, (bounds[3] - plane[:, 1]) / gsd - 0.5]
            )
            np.testing.assert_allclose(wall, expected, rtol=0, atol=1e-6)
            homography = np.array(shown["photo_from_wall"])
            back = cv2.perspectiveTransform(wall[None], homography)[0]
            np.testing.assert_allclose(back, ideal, rtol=0, atol=1e-6)
            ask = {"image": image, "pixels": wall.tolist(), "from": "wall"}
            again = np.array(client.post("/api/convert", json=ask).json()["pixels"])
            np.testing.assert_allclose(again, places, rtol=0, atol=1e-6)


def test_both_photos_superimpose_on_the_wall(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        client = client_of(session)
        info = client.get("/tiles/wall/1/info").json()
        assert client.get("/tiles/wall/2/info").json()["width"] == info["width"]
        grid = session.pictures.grid
        # Targets on the wall lie at one place in both; one that stands out is moved outwards.
        for name, spread in (("T01", 0.05), ("T14", 0.06), ("T20", 3.0)):
            places = []
            for image in (1, 2):
                plane = session.pictures.pair.photo(image).plane_from_pixels(
                    true_pixels()[name][image - 1]
                )
                column, row = grid.pixel_of(plane)
                tile = tile_of(client, "wall", image, info["max_level"], int(column // TILE),
                               int(row // TILE))  # fmt: skip
                found = snap(tile, (column % TILE, row % TILE), 6.0)
                assert found.kind == "target"
                assert np.hypot(found.column - column % TILE, found.row - row % TILE) < 0.1
                places.append((found.column, found.row))
            apart = np.hypot(*np.subtract(*places))
            assert (apart < 0.1) == (spread < 1.0), (name, apart)


def test_levels_halve_without_a_shift() -> None:
    assert max_level((1536, 1024)) == 11
    assert level_size((1535, 1023), 10) == (768, 512)
    assert level_size((1535, 1023), 0) == (1, 1)


def test_measures_of_a_right_triangle() -> None:
    # (0, 0, 0), (3, 0, 0), (3, 4, 0): hypotenuse 5, right angle; 1 mm in every coordinate.
    found = measure(np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]]), 1e-6 * np.eye(9))
    assert found["distance"] == pytest.approx(5.0, abs=1e-12)
    assert found["sigma_distance"] == pytest.approx(0.001 * np.sqrt(2), rel=1e-6)
    assert (found["horizontal"], found["vertical"]) == pytest.approx((3.0, 4.0), abs=1e-12)
    assert found["length"] == pytest.approx(7.0, abs=1e-12)
    assert found["angle"] == pytest.approx(90.0, abs=1e-9)
    # Each arm turns by sqrt(2) mm / length; the middle point is in both: 1/9 + 1/16 + (1/9 + 1/16).
    expected = np.degrees(0.001 * np.sqrt(2 * (1 / 9 + 1 / 16)))
    assert found["sigma_angle"] == pytest.approx(expected, rel=1e-5)
    assert found["inclination"] == pytest.approx(np.degrees(np.arctan2(4, 3)), abs=1e-9)


def test_what_moves_all_points_alike_is_not_in_their_distance(sample) -> None:
    pair, _ = sample
    pixels = np.array([true_pixels()[name] for name in ("T01", "T14", "T20")])

    def found(moved: float) -> tuple[ReliefTable, dict[str, float | None]]:
        """Both cameras may lie aside by so many metres, together."""
        row = np.array([float(name.startswith("X ")) for name in NAMES]) * moved
        other = replace(pair, orientation=np.outer(row, row))
        seen = PointObservations(ids=("a", "b", "c"), pixels1=pixels[:, 0], pixels2=pixels[:, 1])
        table = solve_points(other, seen)
        return table, measure(table.xyz, table.joint_covariance([0, 1, 2]))

    (exact, still), (loose, moving) = found(1e-9), found(0.5)
    np.testing.assert_allclose(loose["sigma_X"], 0.5, rtol=0.01)
    assert exact["sigma_X"].max() < 0.01
    assert moving["sigma_distance"] == pytest.approx(still["sigma_distance"], rel=1e-6)
    assert moving["sigma_angle"] == pytest.approx(still["sigma_angle"], rel=1e-6)
