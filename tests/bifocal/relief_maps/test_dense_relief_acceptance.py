"""Dense relief at full size: rendered scenes with exact truth, and the church."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from bifocal import Pair, Quality, dense_relief, read_image
from tests.scenes import POOR, RICH, Exposure, bifocal_cameras, facade, render

pytestmark = pytest.mark.acceptance

DIM = Exposure(gain=0.8, gamma=1.15, vignetting=0.3, noise=2.0)
#: Name: seed, d2, palette, exposure of photo 2, then the limits: median [mm], share beyond 3 cm,
#: RMSE away from edges [mm] of all pixels seen by both cameras, orthophoto beyond 1 px.
SCENES = {
    "35/19": (41, 9.5, RICH, Exposure(), 0.7, 0.0125, 11.0, 0.0145),
    "35/28": (42, 14.0, RICH, Exposure(), 1.8, 0.030, 12.0, 0.035),
    "plain plaster": (43, 9.5, POOR, Exposure(), 5.5, 0.11, 36.0, 0.14),
    "radiometry": (44, 9.5, RICH, DIM, 0.9, 0.031, 16.0, 0.035),
}

#: The most times the errors of standard that `fast` may have; it is never better.
FAST_MOST = {"median": 2.0, "beyond": 2.5, "rmse": 2.0, "ortho": 2.7}


def edge_distance(truth: np.ndarray) -> np.ndarray:
    import cv2

    kernel = np.ones((3, 3), dtype=np.uint8)
    steps = cv2.dilate(truth, kernel) - cv2.erode(truth, kernel) > 0.03
    return cv2.distanceTransform((~steps).astype(np.uint8), cv2.DIST_L2, 3)


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
def test_rendered_facades_are_measured_as_well_as_promised(name):
    seed, d2, palette, exposure, median, beyond, rmse, ortho = SCENES[name]
    cameras = bifocal_cameras(d2=d2)
    scene = facade(seed=seed, palette=palette, texel=0.0025)
    shot = render(scene, cameras, rng=np.random.default_rng(seed), exposures=(Exposure(), exposure))
    found = dense_relief(shot.pair, shot.image1, shot.image2)
    truth, both = shot.truth.r, shot.visible1 & shot.visible2
    error = np.where(np.isfinite(found.r), np.abs(found.r - truth), 1.0)
    away = both & (edge_distance(truth) > 15)
    assert 1e3 * np.median(error[both]) < median
    assert (error[both] > 0.03).mean() < beyond
    assert 1e3 * np.sqrt(np.mean(error[away] ** 2)) < rmse
    x, y = np.moveaxis(shot.truth.plane_positions(), -1, 0)
    off = error * np.hypot(x, y) / 17.5 / 0.00369
    assert (off[both] > 1).mean() < ortho
    measured = both & (found.quality == Quality.MEASURED)
    held = (np.abs(found.r - truth) < 2 * found.sigma)[measured & away]
    assert held.mean() > 0.85
    if palette is RICH and exposure is not DIM:
        fast = dense_relief(shot.pair, shot.image1, shot.image2, quality="fast")
        away_fast = np.where(np.isfinite(fast.r), np.abs(fast.r - truth), 1.0)
        pixels = np.hypot(x, y) / 17.5 / 0.00369
        ratios = {
            "median": np.median(away_fast[both]) / np.median(error[both]),
            "beyond": (away_fast[both] > 0.03).mean() / (error[both] > 0.03).mean(),
            "rmse": np.sqrt(np.mean(away_fast[away] ** 2) / np.mean(error[away] ** 2)),
            "ortho": ((away_fast * pixels)[both] > 1).mean() / (off[both] > 1).mean(),
        }
        assert all(1 < ratio < FAST_MOST[kind] for kind, ratio in ratios.items()), ratios
    if name == "35/19":
        assert measured.sum() >= 0.945 * both.sum()
        assert 1e3 * np.median(error[measured]) < 0.65
        assert (error[measured] > 0.03).mean() < 0.0075
        assert 1e3 * np.sqrt(np.mean(error[measured & away] ** 2)) < 5.5


def church(folder: Path) -> Pair:
    geometry = json.loads((folder / "geometry.json").read_text())
    photos = {
        key: {
            "file": f"{name}.jpg",
            "plane_from_pixel": np.linalg.inv(np.array(geometry[name]["H_wall_to_pixel"])),
            "nadir": geometry[name]["nadir_wall_m"],
            "distance": geometry[name]["height_over_plane_m"],
        }
        for key, name in (("image1", "far"), ("image2", "near"))
    }
    return Pair.from_dict({"format": "bifocal-pair/1", **photos}, folder=folder)


@pytest.mark.parametrize(
    ("name", "median"),
    [pytest.param("church_1", 10.0, marks=pytest.mark.long), ("church_2", 15.0)],
)
def test_real_oblique_photos_of_a_church_agree_with_the_reference(data_dir, name, median):
    folder = data_dir / "facade_pairs" / name
    pair = church(folder)
    found = dense_relief(pair, read_image(folder / "far.jpg"), read_image(folder / "near.jpg"))
    with (folder / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    xyz = np.array([[float(row[key]) for key in ("X_m", "Y_m", "relief_m")] for row in rows])
    xyz = xyz[np.hypot(*(xyz[:, :2] - pair.image2.nadir).T) > 4]
    error = np.abs(found.sample(xyz[:, :2]) - xyz[:, 2])
    assert np.isfinite(error).mean() > 0.98
    assert 1e3 * np.nanmedian(error) < median
    assert (~(error < 0.1)).mean() < 0.20
    measured = found.sample_quality(xyz[:, :2]) == Quality.MEASURED
    assert measured.mean() > 0.5
    assert (error[measured] > 0.1).mean() < 0.15


def test_the_semireal_church_is_measured_better_than_by_plain_flow(data_dir):
    folder = data_dir / "semireal_church"
    views = json.loads((folder / "truth.json").read_text())["views"]

    def photo(view: dict) -> dict:
        step, nadir, middle = (
            view["m_per_px_on_plane"], view["nadir_wall_m"], view["principal_point_px"]
        )  # fmt: skip
        corner = (nadir[0] - step * middle[0], nadir[1] + step * middle[1])
        matrix = [[step, 0, corner[0]], [0, -step, corner[1]], [0, 0, 1]]
        return {"plane_from_pixel": matrix, "nadir": nadir, "distance": view["distance_m"]}

    far = max(views, key=lambda view: view["distance_m"])
    pair = Pair.from_dict(
        {"format": "bifocal-pair/1", "image1": photo(far), "image2": photo(views[0])}
    )
    found = dense_relief(pair, read_image(folder / "d18.png"), read_image(folder / "d9.png"))
    truth = read_image(folder / far["relief"]).astype(float) / 10000 - 3
    row, column = np.nonzero(read_image(folder / far["mask"]) == 255)
    relief = truth[row, column]
    q = pair.image1.plane_from_pixels(np.stack([column, row], axis=-1).astype(float))
    share = (relief / pair.image1.distance)[:, None]
    error = np.abs(found.sample(q + (pair.image1.nadir - q) * share) - relief)
    error = error[np.isfinite(error)]
    assert len(error) > 0.95 * len(row)
    assert 1e3 * np.median(error) < 3.3
    assert (error > 0.03).mean() < 0.045
