"""``bifocal ortho`` from the command line: files, deliveries, refusals."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import rasterio
from click.testing import CliRunner
from PIL import Image

from bifocal import Grid, ReliefMap, write_image
from bifocal.campaigns.verification import verify
from bifocal.model.geotiff import create_raster
from tests.bifocal.orthophotos.ortho_command import GSD, page_of, relief_of, run
from tests.builders.commands import bifocal_command as main


def test_a_relief_map_survives_its_file(wall: Path) -> None:
    relief = ReliefMap.read(wall / "relief.tif")
    np.testing.assert_array_equal(relief.r, relief_of(relief.grid))
    assert relief.grid.bounds == pytest.approx((-2.1, -1.5, 2.1, 1.5))
    assert (relief.quality == 1).all()


def test_the_orthophoto_has_colours_source_band_mask_and_place(wall: Path) -> None:
    measured = ("--relief", "relief.tif", "--measured-only")
    done = run(wall, *measured, "--out", "o.tif", "--tfw", "--json")
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert result["shares"]["hidden"] > 0.001
    assert (wall / "o.tfw").exists()
    with rasterio.open(wall / "o.tif") as file:
        assert file.count == 4
        assert file.descriptions == ("red", "green", "blue", "source")
        source, mask = file.read(4), file.dataset_mask()
        assert ((source > 0) == (mask > 0)).all()
        assert set(np.unique(source)) == {0, 1}
        assert file.bounds == pytest.approx((-2.1, -1.5, 2.1, 1.5))


def test_a_flat_wall_gives_back_the_photo(wall: Path) -> None:
    assert run(wall, "--plane", "--out", "o.tif").exit_code == 0
    with rasterio.open(wall / "o.tif") as file:
        found = file.read([1, 2, 3]).transpose(1, 2, 0)
    with Image.open(wall / "far.png") as photo:
        np.testing.assert_array_equal(found, np.asarray(photo))


def test_relief_from_points_with_a_breakline(wall: Path) -> None:
    rows = ["id,X,Y,Z,flag", "A,-1,-1,0,OK", "B,1,-1,0,OK", "C,1,1,0.2,OK", "D,-1,1,0.2,OK"]
    rows += ["E,0,-1,0.1,OK", "F,0,1,0.3,OK", "G,0,0,9,UNCERTAIN"]
    (wall / "p.csv").write_text("\n".join(rows) + "\n")
    done = run(wall, "--points", "p.csv", "--breakline", "E,F", "--out", "o.tif", "--json")
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert result["bounds"] == pytest.approx([-1, -1, 1, 1])
    assert "1 of 7 points left out" in done.stderr
    missing = run(wall, "--points", "p.csv", "--breakline", "E,X9", "--out", "q.tif")
    assert missing.exit_code == 1
    assert "no usable point X9" in missing.stderr


def test_sigma_and_quality_lie_beside_the_delivered_relief(wall: Path) -> None:
    relief = ReliefMap.read(wall / "relief.tif")
    quality, sigma = relief.quality.copy(), np.full(relief.shape, 0.004, np.float32)
    quality[:, :84], sigma[:, :84] = 3, 0.02
    replace(relief, quality=quality, sigma=sigma).write(wall / "relief.tif", overwrite=True)
    done = run(
        wall, "--relief", "relief.tif", "--deliver", "d", "--out", "o.tif", "--scale", "1:50",
        "--dpi", "127", "--bounds", "-3,-1,2,1", "--json",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["file"] == "o.tif"
    assert (wall / "o.tif").read_bytes() == (wall / "d" / "Torre_est.tif").read_bytes()
    found = ReliefMap.read(wall / "d" / "Torre_est_relief_values.tif")
    x = found.grid.columns_x
    assert np.isnan(found.r[:, x < -2.1]).all()
    assert np.isnan(found.sigma[:, x < -2.1]).all()
    assert (found.quality[:, x < -2.1] == 0).all()
    hidden = (x > -2.1) & (x < -2.1 + 84 * GSD)
    assert (found.quality[:, hidden] == 3).all()
    assert (found.quality[:, x > -1.25] == 1).all()
    np.testing.assert_allclose(found.sigma[:, hidden], 0.02)


def test_a_delivered_folder_is_verified_and_keeps_the_hashes_of_others(wall: Path) -> None:
    (wall / "d").mkdir()
    (wall / "d" / "letter.txt").write_text("Dear Sir")
    digest = hashlib.sha256(b"Dear Sir").hexdigest()
    (wall / "d" / "SHA256SUMS").write_text(f"{digest}  letter.txt\n{digest}  lost.txt\n")
    done = run(wall, "--plane", "--deliver", "d", "--scale", "1:50", "--dpi", "25", "--json")
    assert done.exit_code == 0, done.output
    assert "SHA256SUMS" in json.loads(done.stdout)["files"]
    found = verify(wall / "d")
    assert found.same
    assert {one.file for one in found.files} == {path.name for path in (wall / "d").iterdir()}
    with (wall / "d" / "Torre_est.dxf").open("a") as file:
        file.write(" ")
    wrong = [one.file for one in verify(wall / "d").files if one.state != "unchanged"]
    assert wrong == ["Torre_est.dxf"]
    (wall / "e" / "SHA256SUMS").mkdir(parents=True)
    done = run(wall, "--plane", "--deliver", "e", "--scale", "1:50", "--dpi", "25")
    assert (done.exit_code, [*(wall / "e").iterdir()]) == (1, [wall / "e" / "SHA256SUMS"])
    assert "SHA256SUMS: cannot be read" in done.stderr


@pytest.mark.acceptance
def test_a_nameless_pair_is_called_as_its_folder_where_its_file_has_no_name(wall: Path) -> None:
    data = json.loads((wall / "wall.pair.json").read_text())
    del data["name"]
    folder = wall / "Via Roma 7"
    folder.mkdir()
    for name in ("far.png", "near.png"):
        (wall / name).rename(folder / name)
    for name, title in (("w", "Via_Roma_7"), ("north", "north"), ("S. Maria", "S_Maria")):
        (folder / f"{name}.pair.json").write_text(json.dumps(data))
        words = [str(folder / f"{name}.pair.json"), "--plane", "--deliver", str(wall / name)]
        done = CliRunner().invoke(main, ["ortho", *words, "--scale", "1:50"])
        assert done.exit_code == 0, done.output
        assert (wall / name / f"{title}.pdf").exists()


@pytest.mark.acceptance
def test_a_phantom_does_not_take_the_colours_from_the_wall(wall: Path) -> None:
    relief = ReliefMap.read(wall / "relief.tif")
    r = np.where(relief.r > 0.1, relief.r, np.float32(0))
    r[40:44, 40:44] = 1.9
    replace(relief, r=r).write(wall / "relief.tif", overwrite=True)
    done = run(wall, "--relief", "relief.tif", "--deliver", "d", "--scale", "1:50")
    assert done.exit_code == 0, done.output
    page = page_of(wall / "d" / "Torre_est_relief.pdf")
    assert "(> +0.30 m)" in page
    assert "(0.00 wall)" in page
    with Image.open(wall / "d" / "Torre_est_relief.png") as picture:
        pixels = np.asarray(picture)[:, :, :3].astype(int)
    assert np.ptp(pixels[300, 100]) < 12  # the wall is nearly white, whatever lies before it
    assert pixels[300, 580, 0] > pixels[300, 580, 2] + 60  # what stands before it is brown


@pytest.mark.acceptance
def test_a_phantom_before_a_flat_wall_does_not_refuse_the_delivery(wall: Path) -> None:
    relief = ReliefMap.read(wall / "relief.tif")
    r = np.zeros_like(relief.r)
    r[40:52, 40:52] = 2.5  # 2500 levels of the least interval, a millimetre
    replace(relief, r=r).write(wall / "relief.tif", overwrite=True)
    done = run(wall, "--relief", "relief.tif", "--deliver", "d", "--scale", "1:50")
    assert done.exit_code == 0, done.output
    assert "contour lines every 0.005 m" in page_of(wall / "d" / "Torre_est_relief.pdf")


def test_the_png_is_the_geotiff(wall: Path) -> None:
    run(wall, "--relief", "relief.tif", "--deliver", "d", "--scale", "1:50", "--dpi", "127")
    with Image.open(wall / "d" / "Torre_est.png") as png:
        pixels = np.asarray(png)
    with rasterio.open(wall / "d" / "Torre_est.tif") as file:
        # What no photo sees bears outline and lines on the picture for paper only.
        plain = file.read(4) != 7
        colours = file.read([1, 2, 3]).transpose(1, 2, 0)
        np.testing.assert_array_equal(pixels[plain, :3], colours[plain])
        np.testing.assert_array_equal(pixels[plain, 3], file.dataset_mask()[plain])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--plane", "--gsd", "1"), "--any-size"),
        (("--plane", "--gsd", "0.00001"), "420,000 x 300,000 px (378 GB)"),
        (("--plane", "--gsd", "1", "--bounds", "0,0,2,3"), "2 x 3 px (18 bytes)"),
        (("--plane", "--bounds", "500,500,501,501"), "another wall"),
        (("--relief", "absent.tif"), "no such raster"),
        (("--relief", "nan.tif"), "every pixel is unknown"),
        (("--relief", "mm.tif"), "must be in metres"),
        (("--relief", "elsewhere.tif"), "another wall"),
        (("--relief", "picture.tif"), "picture rather than relief"),
        (("--points", "far.png"), "far.png"),
    ],
)
def test_what_cannot_be_meant_is_asked_back(
    wall: Path, arguments: tuple[str, ...], message: str
) -> None:
    grid = Grid.from_bounds((-2.1, -1.5, 2.1, 1.5), gsd=GSD)
    far = Grid.from_bounds((90.0, 90.0, 91.0, 91.0), gsd=GSD)
    for name, place, value in (
        ("nan.tif", grid, np.nan),
        ("mm.tif", grid, 300.0),
        ("elsewhere.tif", far, 0.0),
    ):
        with create_raster(wall / name, place, bands=1, dtype=np.float32) as writer:
            writer.write(np.full(place.shape, value, np.float32))
    with create_raster(wall / "picture.tif", grid, bands=1, dtype=np.uint8) as writer:
        writer.write(np.zeros(grid.shape, np.uint8))
    before = set(wall.iterdir())
    done = run(wall, *arguments, "--out", "o.tif")
    assert done.exit_code == 1
    assert message in done.stderr
    assert "Traceback" not in done.output
    assert set(wall.iterdir()) == before


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--bounds", "0,0,0,1", "xmin < xmax"),
        ("--vignetting", "much", "cos4"),
        ("--vignetting", "nan,0,0", "cos4"),
        *(("--section", place, "x=1.5") for place in ("x=nan", "y=", "1,2", "0,0 inf,1")),
    ],
)
def test_a_value_that_no_wall_has_is_wrong_usage(
    wall: Path, option: str, value: str, message: str
) -> None:
    before = set(wall.iterdir())
    done = run(wall, "--plane", option, value, "--out", "o.tif")
    assert (done.exit_code, message in done.stderr) == (2, True)
    assert set(wall.iterdir()) == before


@pytest.mark.parametrize(("title", "name"), [("far", "far.png"), ("wall", "wall_relief.tif")])
def test_a_delivery_does_not_take_the_place_of_what_it_is_made_from(
    wall: Path, title: str, name: str
) -> None:
    (wall / "relief.tif").rename(wall / "wall_relief.tif")
    before = {path.name: path.read_bytes() for path in wall.iterdir()}
    words = ("--relief", "wall_relief.tif", "--deliver", ".", "--scale", "1:50", "--title", title)
    for more in ((), ("--overwrite",)):
        done = run(wall, *words, *more)
        assert done.exit_code == 1
        assert f"{name}: is one of the files that are read" in done.stderr
    assert {path.name: path.read_bytes() for path in wall.iterdir()} == before


def test_a_photo_is_no_place_for_the_orthophoto(wall: Path) -> None:
    data = json.loads((wall / "wall.pair.json").read_text())
    with Image.open(wall / "near.png") as photo:
        photo.save(wall / "near.tif")
    data["image2"]["file"] = "near.tif"
    (wall / "wall.pair.json").write_text(json.dumps(data))
    before = (wall / "near.tif").read_bytes()
    done = run(wall, "--plane", "--out", "near.tif", "--overwrite")
    assert done.exit_code == 1
    assert "near.tif: is one of the files that are read" in done.stderr
    assert (wall / "near.tif").read_bytes() == before


@pytest.mark.acceptance
def test_any_file_of_an_earlier_delivery_is_refused_before_the_work(
    wall: Path, monkeypatch
) -> None:
    words = ("--relief", "relief.tif", "--deliver", "d", "--scale", "1:50", "--section", "x=0.8")
    assert run(wall, *words).exit_code == 0
    names = sorted(path.name for path in (wall / "d").iterdir())
    (wall / "kept").mkdir()
    for name in names:
        (wall / "d" / name).rename(wall / "kept" / name)
    monkeypatch.setattr("bifocal.orthophotos.deliver_workflow.make_ortho", None)
    for name in names:
        (wall / "d" / name).write_text("mine")
        done = run(wall, *words)
        assert done.exit_code == 1
        listed = name == "SHA256SUMS"  # lines of others would stay, but these are none
        why = "is no list of hashes" if listed else "exists already; add --overwrite"
        assert f"{name}: {why}" in done.stderr
        assert (wall / "d" / name).read_text() == "mine"
        (wall / "d" / name).unlink()


def test_a_one_pixel_photo_is_refused(wall: Path) -> None:
    write_image(wall / "far.png", np.zeros((1, 1, 3), np.uint8), overwrite=True)
    done = run(wall, "--plane", "--out", "o.tif", "--changed-photos")
    assert done.exit_code == 1
    assert "1 x 1 px is not a photo" in done.stderr


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder_is_refused(wall: Path) -> None:
    (wall / "locked").mkdir(mode=0o500)
    done = run(wall, "--plane", "--out", "locked/o.tif")
    assert done.exit_code == 1
    assert "read-only" in done.stderr


def test_wrong_usage_is_exit_2(wall: Path) -> None:
    assert run(wall).exit_code == 2
    assert run(wall, "--deliver", "d").exit_code == 2
    assert run(wall, "--deliver", "d", "--out", "o.tif").exit_code == 2
    assert run(wall, "--out", "o.tif", "--plane", "--relief", "relief.tif").exit_code == 2


def test_both_photos_are_blended_and_matched(wall: Path) -> None:
    done = run(wall, "--relief", "relief.tif", "--image", "both", "--out", "o.tif")
    assert done.exit_code == 0, done.output
    assert "image 2" in done.stderr


def test_wider_than_32767_pixels_works(wall: Path) -> None:
    done = run(
        wall, "--plane", "--gsd", "0.001", "--bounds", "-2.1,-0.004,37.9,0.004", "--out", "o.tif"
    )
    assert done.exit_code == 0, done.output
    with rasterio.open(wall / "o.tif") as file:
        assert (file.width, file.height) == (40000, 8)
        row = file.read(1, window=rasterio.windows.Window(0, 4, 4200, 1))
    assert row.any()


def test_a_large_orthophoto_much_finer_than_the_photo_is_asked_back(wall: Path) -> None:
    box = ("--bounds", "-2.1,-1.5,4.2,3")
    done = run(wall, "--plane", "--gsd", "1mm", "--out", "o.tif", *box)  # 28 megapixels
    assert done.exit_code == 1
    assert "--any-size" in done.stderr
    small = ("--bounds", "0,0,0.5,0.5")
    assert run(wall, "--plane", "--gsd", "1mm", "--out", "o.tif", *small).exit_code == 0


def test_a_folder_given_as_relief_is_called_a_folder(wall: Path) -> None:
    (wall / "maps").mkdir()
    done = run(wall, "--relief", "maps", "--out", "o.tif")
    assert done.exit_code == 1
    assert "maps: is a folder" in done.stderr


def test_control_points_without_relief_are_drawn_on_the_wall(wall: Path) -> None:
    (wall / "c.csv").write_text("id,X,Y,Z\nK1,-1.5,-1,\nK2,1.5,1,0.1\n")
    done = run(wall, "--plane", "--deliver", "d", "--scale", "1:50", "--control", "c.csv")
    assert done.exit_code == 0, done.output
    model = ezdxf.readfile(wall / "d" / "Torre_est.dxf").modelspace()
    points = model.query('POINT[layer=="BIFOCAL_CONTROL"]')
    assert [tuple(point.dxf.location) for point in points] == [(-1.5, -1, 0), (1.5, 1, 0.1)]
    names = {text.dxf.text for text in model.query('TEXT[layer=="BIFOCAL_CONTROL"]')}
    assert names == {"K1", "K2"}
