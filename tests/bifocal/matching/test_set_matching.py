"""`match` with a set: details of the best pair, found where every other photo shows them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from bifocal import SAMPLE, GeometryError, MatchSettings, Pair, PhotoSet, read_image, solve
from bifocal.cli.main import main
from bifocal.matching.set_matching import match_set
from bifocal.model.homography import apply_homography
from bifocal.model.image import as_grey


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """Return the folder of a set: the sample, halved, and its far photo turned by 3 degrees.

    What stands in the turned photo where is known exactly: it was taken from the same place.
    """
    folder = tmp_path_factory.mktemp("set")
    pair = Pair.read(SAMPLE / "facade.pair.json")
    half = np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1.0]])
    photos = []
    for name, photo in (("far", pair.image1), ("near", pair.image2)):
        with Image.open(photo.path) as image:
            size = (image.width // 2, image.height // 2)
            image.resize(size, Image.Resampling.BOX).save(folder / f"{name}.png")
        photos.append(
            replace(
                photo, name=name, file=f"{name}.png", image_size=size,
                plane_from_pixel=photo.plane_from_pixel @ half,
            )
        )  # fmt: skip
    turn = np.radians(3.0)
    c, s, (x, y) = np.cos(turn), np.sin(turn), (size[0] / 2, size[1] / 2)
    far_from_turned = np.array([[c, -s, x - c * x + s * y], [s, c, y - s * x - c * y], [0, 0, 1]])
    with Image.open(folder / "far.png") as image:
        # Pillow counts from corners of pixels, half a pixel away.
        corner = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
        moved = corner @ far_from_turned @ np.linalg.inv(corner)
        transform = Image.Transform.AFFINE
        image.transform(size, transform, moved[:2].ravel(), Image.Resampling.BICUBIC).save(
            folder / "turned.png"
        )
    matrix = photos[0].plane_from_pixel @ far_from_turned
    photos.insert(1, replace(photos[0], name="turned", file="turned.png", plane_from_pixel=matrix))
    PhotoSet(photos=tuple(photos)).write(folder / "wall.photos.json")
    return folder, far_from_turned


def greys_of(photos):
    images = [as_grey(read_image(photo.path), photo.name) for photo in photos.photos]
    return lambda first, second: (images[first], images[second])


@pytest.mark.acceptance
def test_points_are_found_in_every_photo_to_a_tenth_of_a_pixel(wall):
    folder, far_from_turned = wall
    photos = PhotoSet.read(folder / "wall.photos.json")
    found = match_set(photos, greys_of(photos), MatchSettings(count=300))
    assert found.pixels.shape == (3, len(found.ids), 2)
    there = np.isfinite(found.pixels[1]).all(axis=1)
    assert there.mean() > 0.8
    away = apply_homography(far_from_turned, found.pixels[1]) - found.pixels[0]
    assert np.median(np.hypot(*away[there].T)) < 0.1
    assert np.quantile(np.hypot(*away[there].T), 0.95) < 0.3
    assert not found.points.suspects.any()
    assert np.isfinite(found.pixels[0]).all()


@pytest.mark.acceptance
def test_the_command_writes_what_solve_takes(wall):
    folder, _ = wall
    out = folder / "picks.csv"
    line = [
        "match",
        str(folder / "wall.photos.json"),
        "--count",
        "200",
        "--out",
        str(out),
        "--json",
    ]
    result = CliRunner().invoke(main, line, catch_exceptions=False)
    assert result.exit_code == 0, result.stderr
    told = json.loads(result.stdout)
    assert told["photos"]["far"] == told["count"] > 100
    assert told["in_three"] > 80
    solved = solve(out, pair=folder / "wall.photos.json")
    assert len(solved.table) == told["count"]
    assert np.mean(np.array(solved.table.flags) == "OFF-RADIAL") < 0.03
    low, high = np.nanpercentile(solved.table["r"], [1, 99])
    assert (low, high) == pytest.approx(tuple(told["relief_range"]), abs=0.02)


def test_what_cannot_be_matched_is_refused(wall):
    folder, _ = wall
    line = ["match", str(folder / "wall.photos.json"), "--out", str(folder / "o.xlsx")]
    result = CliRunner().invoke(main, line)
    assert (result.exit_code, (folder / "o.xlsx").exists()) == (1, False)
    assert "written as a table: --out o.csv" in result.stderr
    photos = PhotoSet.read(folder / "wall.photos.json")
    flat = PhotoSet(photos=photos.photos[:2], folder=folder)
    with pytest.raises(GeometryError, match="no two photos of the set promise relief"):
        match_set(flat, greys_of(flat))
