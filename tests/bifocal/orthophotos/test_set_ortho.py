"""The orthophoto of a set: each pixel from the photo that sees it best."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner

from bifocal import InputError, OrthoOptions, PhotoSet, orthophoto, write_image
from bifocal.orthophotos.ortho_image import OF_SET
from tests.builders.commands import bifocal_command as main
from tests.scenes import Exposure, bifocal_cameras, facade
from tests.scenes.sets import SetRendering, aside, render_set


@cache
def shot() -> SetRendering:
    cameras = bifocal_cameras(size=(384, 256), pixel=0.0296)
    three = (cameras.far, cameras.near, aside(cameras.near, 1.5))
    exposures = (Exposure(), Exposure(), Exposure(gain=0.7))
    return render_set(
        facade(seed=5, texel=0.02), three, rng=np.random.default_rng(5), exposures=exposures
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("set")
    taken = shot()
    for photo, image in zip(taken.photos.photos, taken.images, strict=True):
        write_image(place / photo.file, image)
    replace(taken.photos, folder=place).write(place / "wall.photos.json")
    taken.truth.write(place / "relief.tif")
    return place


MEASURED = OrthoOptions(measured_only=True)


def run(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(main, ["ortho", *(str(a) for a in arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, result.stdout, result.stderr


def test_each_pixel_is_of_a_photo_that_sees_it_and_hidden_is_seen_by_none():
    taken = shot()
    picture = orthophoto(taken.photos, taken.images, taken.truth, options=MEASURED)
    used = np.unique(picture.source)
    # The near photo sees nothing that the far one, whose rays are steeper, does not see better.
    assert set(used.tolist()) == {0, 3, OF_SET + 1, OF_SET + 3}
    for number in (OF_SET + 1, OF_SET + 3):
        visible = taken.visible[number - OF_SET - 1]
        assert visible[picture.source == number].mean() > 0.97
    of_pair = orthophoto(taken.photos.pair(0, 1), taken.images[:2], taken.truth, options=MEASURED)
    assert not (picture.hidden & of_pair.valid).any()
    assert picture.hidden.sum() < of_pair.hidden.sum()
    assert picture.valid.mean() > of_pair.valid.mean()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_set_of_two_is_rendered_as_its_pair(order):
    taken = shot()
    two = PhotoSet(photos=tuple(taken.photos.photos[number] for number in order))
    picture = orthophoto(two, [taken.images[number] for number in order], taken.truth)
    of_pair = orthophoto(taken.photos.pair(0, 1), taken.images[:2], taken.truth)
    np.testing.assert_array_equal(picture.image, of_pair.image)
    np.testing.assert_array_equal(picture.source, of_pair.source)


def test_every_photo_of_the_set_is_asked_for():
    with pytest.raises(InputError, match="expected 3 photos, got 2"):
        orthophoto(shot().photos, shot().images[:2], shot().truth)


def test_the_command_matches_exposures_and_tells_each_photos_share(folder, tmp_path):
    out = tmp_path / "ortho.tif"
    relief = ("--relief", folder / "relief.tif")
    code, text, _ = run(folder / "wall.photos.json", *relief, "--out", out, "--json")
    assert code == 0
    shares = json.loads(text)["shares"]
    assert min(shares["1"], shares["3"]) > 0.02
    with rasterio.open(out) as file:
        image, source = np.moveaxis(file.read([1, 2, 3]), 0, -1).astype(float), file.read(4)
    assert set(np.unique(source)) <= {0, 3, 4, 7, 11, 12, 13}
    assert shares["3"] == pytest.approx((source == 13).mean())
    # The dark third photo shows the wall as bright as the first where both see it.
    taken = shot()
    first = orthophoto(taken.photos.pair(0, 1), taken.images[0], taken.truth)
    both = (source == 13) & (first.source == 1)
    ratio = image[both].mean() / first.image[both].astype(float).mean()
    assert 0.97 < ratio < 1.03


def test_what_a_set_cannot_is_refused(folder, tmp_path):
    whole = (folder / "wall.photos.json", "--plane", "--out", tmp_path / "o.tif")
    assert "leave it out" in run(*whole, "--image", "2")[2]
    assert not list(tmp_path.iterdir())


@pytest.mark.acceptance
def test_a_set_is_drawn_to_scale_and_reported(folder, tmp_path):
    relief = ("--relief", folder / "relief.tif")
    deliver = ("--deliver", tmp_path, "--scale", "1:200", "--dpi", "100", "--title", "porch")
    code, text, _ = run(folder / "wall.photos.json", *relief, *deliver)
    assert code == 0, text
    drawn = (tmp_path / "porch_relief.dxf").read_text()
    assert "3 photos, camera distances 17.500 m, 9.500 m, 9.500 m" in drawn
    taken = shot()
    xyz = np.array([[x, y, 0.0] for x in (-4.0, 0.2, 4.2) for y in (-2.0, 0.8, 2.4)])
    pixels = np.hstack([photo.project(xyz) for photo in taken.photos.photos])
    pixels[0, :2] = np.nan  # seen by two photos, which no far one is of
    heads = [f"{axis}{k} [px]" for k in (1, 2, 3) for axis in ("col", "row")]
    rows = [
        ",".join([f"P{k}", *map(str, place), *("" if np.isnan(v) else f"{v:.3f}" for v in own)])
        for k, (place, own) in enumerate(zip(xyz.tolist(), pixels.tolist(), strict=True))
    ]
    table = tmp_path / "check.csv"
    table.write_text("\n".join([",".join(["id", "X [m]", "Y [m]", "r [m]", *heads]), *rows]))
    page = tmp_path / "report.html"
    asked = (folder / "wall.photos.json", "--check", table, "--out", page)
    told = CliRunner().invoke(main, ["report", *map(str, asked)])
    assert told.exit_code == 0, told.output
    html = page.read_text(encoding="utf-8")
    assert "9 independent check points" in html
    assert all(f"<td>{file}</td>" in html for file in ("1.png", "2.png", "3.png"))
