"""``bifocal relief`` from the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner

from bifocal import Pair, PhotoSet, ReliefMap, write_image
from tests.builders.commands import bifocal_command as main
from tests.scenes import bifocal_cameras, facade, render


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a small pair: photos, pair file and its truth."""
    place = tmp_path_factory.mktemp("pair")
    cameras = bifocal_cameras(size=(384, 256), pixel=0.0296)
    shot = render(facade(seed=5, texel=0.02), cameras, rng=np.random.default_rng(5))
    write_image(place / "far.png", shot.image1)
    write_image(place / "near.png", shot.image2)
    shot.pair.write(place / "wall.pair.json")
    np.save(place / "truth.npy", shot.truth.r)
    return place


def run(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(main, ["relief", *(str(a) for a in arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, result.stdout, result.stderr


def test_relief_writes_three_bands_and_says_what_guarantees_the_scale(folder, tmp_path):
    out = tmp_path / "relief.tif"
    code, text, told = run(folder / "wall.pair.json", "--out", out)
    assert code == 0
    assert "measured" in text
    assert "relative scale" in told
    d1, d2 = Pair.read(folder / "wall.pair.json").straight_distances
    slip = 0.01 / (1 / d2 - 1 / d1)  # B of the paper times the slip
    said = text.split("(median of the measured)\n")[1].splitlines()[0]
    assert said == (
        "Sigmas rest on: the photos' own misfit across the radius, measured; the pair as given, "
        f"of which 1 % of scale is {slip:.2f} m of relief and in no sigma."
    )
    with rasterio.open(out) as file:
        assert file.count == 3
        assert file.tags()["BIFOCAL_PAIR"] == "wall.pair.json"  # by which others find the photos
        assert file.dtypes == ("float32",) * 3
        assert file.shape == (256, 384)
        # Corner of the corner pixel: half a frame of 384 x 256 px of 29.6 mm.
        assert (file.transform.c, file.transform.f) == pytest.approx((-5.6832, 3.7888))
        relief, quality = file.read(1), file.read(3)
    truth = np.load(folder / "truth.npy")
    assert np.nanmedian(np.abs(relief - truth)) < 0.04  # 30 mm pixels: nearly all are edges
    np.testing.assert_array_equal(np.isnan(relief), quality == 0)
    assert ReliefMap.read(out).gsd == pytest.approx(0.0296)


def test_json_preview_and_clouds(folder, tmp_path):
    import laspy
    from PIL import Image

    out, ply, png = (tmp_path / name for name in ("r.tif", "r.ply", "r.png"))
    pair = folder / "known.pair.json"
    replace(Pair.read(folder / "wall.pair.json"), orientation=1e-12 * np.eye(24)).write(pair)
    code, text, _ = run(
        pair, "--out", out, "--json", "--cloud", ply, "--preview", png,
        "--gsd", "0.05", "--bounds", "-3,-2,3,2", "--quality", "fast",
    )  # fmt: skip
    assert code == 0
    summary = json.loads(text)
    assert summary["size"] == [120, 80]
    assert sum(summary["shares"].values()) == pytest.approx(1.0)
    assert len(summary["written"]) == 3
    assert summary["rests_on"].endswith(
        "the pair as given, with the covariance of its orientation."
    )
    with Image.open(png) as picture:
        assert picture.size[0] > 800
    header, body = ply.read_bytes().split(b"end_header\n")
    count = int(header.split(b"vertex ")[1].split()[0])
    assert len(body) == count * (24 + 3 + 4 + 1)
    laz = tmp_path / "r.laz"
    few = ("--gsd", "0.05", "--bounds", "-3,-2,3,2", "--quality", "fast")
    assert run(folder / "wall.pair.json", "--out", out, "--overwrite", "--cloud", laz, *few)[0] == 0
    cloud = laspy.read(laz)
    assert np.abs(cloud.z).max() < 2
    assert cloud.red.max() > 30000


def test_existing_files_stay_unless_told(folder, tmp_path):
    out = tmp_path / "relief.tif"
    out.write_bytes(b"mine")
    code, _, told = run(folder / "wall.pair.json", "--out", out)
    assert code == 1
    assert "--overwrite" in told
    assert out.read_bytes() == b"mine"


def test_a_photo_is_no_place_for_the_preview(folder, tmp_path):
    before = (folder / "far.png").read_bytes()
    words = ("--out", tmp_path / "r.tif", "--preview", folder / "far.png", "--overwrite")
    code, _, told = run(folder / "wall.pair.json", *words)
    assert code == 1
    assert "far.png: is one of the files that are read" in told
    assert (folder / "far.png").read_bytes() == before
    assert list(tmp_path.iterdir()) == []


def test_wrong_endings_are_refused_before_any_work(folder, tmp_path):
    pair = folder / "wall.pair.json"
    for arguments, said in (
        (["--out", tmp_path / "r.jpg"], "written as .tif"),
        (["--out", tmp_path / "r.tif", "--preview", tmp_path / "p.gif"], "written as .png"),
        (["--out", tmp_path / "r.tif", "--cloud", tmp_path / "c.xyz"], ".ply, .las or .laz"),
        (["--out", tmp_path / "no" / "r.tif"], "does not exist"),
    ):
        code, _, told = run(pair, *arguments)
        assert code == 1
        assert said in told
    assert list(tmp_path.iterdir()) == []


def test_a_mistaken_gsd_is_asked_back(folder, tmp_path):
    code, _, told = run(folder / "wall.pair.json", "--out", tmp_path / "r.tif", "--gsd", "1e-5")
    assert code == 1
    assert "Is the unit right?" in told
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("gsd", ["5", "1", "0.25", "0.15", "150mm"])
def test_a_gsd_too_coarse_to_match_at_is_asked_back(folder, tmp_path, gsd):
    code, _, told = run(folder / "wall.pair.json", "--out", tmp_path / "r.tif", "--gsd", gsd)
    assert code == 1
    assert "Is the unit right?" in told
    assert "half the GSD" in told
    assert list(tmp_path.iterdir()) == []


def test_bounds_too_small_for_a_quick_look_are_refused(folder, tmp_path):
    code, _, told = run(
        folder / "wall.pair.json", "--out", tmp_path / "r.tif", "--quality", "fast",
        "--bounds", "-0.3,-0.3,0.3,0.3", "--relief-range", "-0.1,0.1",
    )  # fmt: skip
    assert code == 1
    assert "at least 24 a side" in told


def test_usage_errors_are_status_2(folder, tmp_path):
    code, _, told = run(folder / "wall.pair.json", "--out", tmp_path / "r.tif", "--bounds", "1,2")
    assert code == 2
    assert "4 numbers" in told


def test_a_photo_that_is_missing_or_no_photo_is_named(folder, tmp_path):
    pair = Pair.read(folder / "wall.pair.json")
    replace(pair, image1=replace(pair.image1, file="gone.png")).write(tmp_path / "a.pair.json")
    code, _, told = run(tmp_path / "a.pair.json", "--out", tmp_path / "r.tif")
    assert code == 1
    assert "gone.png" in told
    replace(pair, image1=replace(pair.image1, file="")).write(tmp_path / "b.pair.json")
    code, _, told = run(tmp_path / "b.pair.json", "--out", tmp_path / "r.tif")
    assert code == 1
    assert 'names no photo for "image1"' in told


def test_swapped_photos_are_set_right_with_a_remark(folder, tmp_path):
    data = json.loads((folder / "wall.pair.json").read_text())
    data["image1"], data["image2"] = data["image2"], data["image1"]
    swapped = folder / "swapped.pair.json"
    swapped.write_text(json.dumps(data))
    code, _, told = run(swapped, "--out", tmp_path / "r.tif")
    assert code == 0
    assert "exchanged" in told


@pytest.mark.acceptance
def test_a_set_of_photos_is_taken_wherever_a_pair_is(folder, tmp_path):
    pair = Pair.read(folder / "wall.pair.json")
    two = PhotoSet(photos=(pair.image2, pair.image1), folder=folder)
    aside = replace(pair.image2, name="again")
    two.write(folder / "two.photos.json")
    replace(two, photos=(*two.photos, aside)).write(folder / "three.photos.json")
    maps = {}
    for name in ("wall.pair.json", "two.photos.json", "three.photos.json"):
        out = tmp_path / f"{name}.tif"
        code, text, _ = run(folder / name, "--out", out, "--json", "--cloud", f"{out}.ply")
        assert code == 0
        maps[name] = ReliefMap.read(out), json.loads(text)
    (whole, said), (same, _), (three, told) = maps.values()
    np.testing.assert_array_equal(whole.r, same.r)
    np.testing.assert_array_equal(whole.sigma, same.sigma)
    assert "pairs" not in said
    assert told["pairs"] == [["far", "near"], ["far", "again"]]
    assert np.nanmedian(np.abs(three.r - whole.r)) < 0.01
