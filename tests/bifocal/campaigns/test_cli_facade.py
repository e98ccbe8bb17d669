"""`bifocal facade`: two photos and a table in, everything out, and only what changed anew."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
from pathlib import Path

import click
import ezdxf
import numpy as np
import openpyxl
import pytest
import rasterio
from click.testing import CliRunner

import bifocal
from bifocal import WATER_SAMPLE, Pair
from bifocal.cli.facade import command
from bifocal.options import OF_PAIR
from tests.bifocal.campaigns.sample_tables import FAR, NEAR, write_small_photos, write_tables
from tests.builders.commands import bifocal_command as main


def facade(out: Path, *options: object, photos: tuple[Path, Path] = (FAR, NEAR)) -> dict:
    words = ["facade", *map(str, photos), "--out", str(out), "--json", *map(str, options)]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


@pytest.mark.acceptance
def test_everything_is_delivered_and_a_second_run_makes_only_what_changed(tmp_path):
    photos = write_small_photos(tmp_path)
    control, check = write_tables(tmp_path, small=True)
    for table in (control, check):
        head, rest = table.read_text().split("\n", 1)
        table.write_text(f"{head.replace('id', 'mark', 1)}\n{rest}")
    out = tmp_path / "wall"
    said = ("--control", control, "--check", check, "--scale", "1:50", "--columns", "id=mark")
    done = facade(out, *said, "--cloud", "ply", photos=photos)
    assert done["done"] == ["align", "relief", "points", "drawing", "view", "report"]
    for name in (
        "align/wall.pair.json", "relief/wall_relief.tif", "points/wall_points.xlsx",
        "drawing/wall.tif", "drawing/wall.pdf", "drawing/wall.dxf", "drawing/wall_relief.pdf",
        "view/wall_view.html", "report/wall_report.html", "report/wall_report.pdf",
        "relief/wall_relief.ply",
    ):  # fmt: skip
        assert (out / name).stat().st_size > 1000, name
    page = (out / "report/wall_report.html").read_text("utf-8")
    assert "16 independent check points" in page
    assert 'href="../view/wall_view.html"' in page
    view = (out / "view/wall_view.html").read_text("utf-8")
    assert "data:image/jpeg" in view  # the orthophoto's colours
    assert "http" not in view
    assert len(view) < 1e6
    drawn = ezdxf.readfile(out / "drawing/wall.dxf").modelspace()
    layers = {entity.dxf.layer for entity in drawn.query("POINT")}
    assert {"BIFOCAL_POINTS", "BIFOCAL_CONTROL", "BIFOCAL_CHECK"} <= layers
    # Nothing changed; then one check point: what holds it, not orientation and relief.
    again = facade(out, *said, "--cloud", "ply", photos=photos)
    assert (again["done"], len(again["kept"])) == ([], 6)
    check.write_text(check.read_text().replace("T30", "T99"))
    again = facade(out, *said, "--cloud", "ply", photos=photos)
    assert again["done"] == ["points", "drawing", "view", "report"]
    report = CliRunner().invoke(main, ["report", str(out), "--out", str(tmp_path / "r.html")])
    assert report.exit_code == 0, report.stderr
    page = (tmp_path / "r.html").read_text("utf-8")
    assert "independent check points" in page
    assert 'href="wall/view/wall_view.html"' in page


@pytest.mark.parametrize("room", ["orientation", "orthophotos", "relief_maps"])
def test_every_option_that_its_steps_advise_is_one_of_its_own_and_a_key_of_survey_files(room):
    own = {name for parameter in command.params for name in parameter.opts}
    others = {
        "--georeference",
        "--json",
        "--distance",
        "--focal",
    }  # the last two have a number behind
    for path in (Path(bifocal.__file__).parent / room).glob("*.py"):
        if path.stem in (
            "one_photo",
            "joint_workflow",
            "mosaic_workflow",
            "match_workflow",
            "deliver_workflow",
        ):
            continue
        for option in set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", path.read_text("utf-8"))):
            if option not in others:
                assert option in own, (path.name, option)
                assert option[2:].replace("-", "_") in {*OF_PAIR, "overwrite", "out"}, option


@pytest.mark.acceptance
def test_it_ends_with_where_the_results_are_and_what_to_open(tmp_path):
    control, _ = write_tables(tmp_path, small=True)
    photos = write_small_photos(tmp_path)
    words = ["facade", *photos, "--control", control, "--products", "points", "--out", "wall"]
    with contextlib.chdir(tmp_path):
        done = CliRunner().invoke(main, [str(word) for word in words])
    assert done.exit_code == 0, done.stderr
    said = done.stdout.splitlines()[-1]
    assert said == (
        f"All of it is in {tmp_path / 'wall'}; open {Path('wall/points/wall_points.xlsx')} first."
    )


def test_what_is_at_fault_is_said_and_nothing_is_left(tmp_path):
    (tmp_path / "near.jpg").write_bytes(b"no photo")
    shutil.copy(FAR, tmp_path / "far.jpg")
    control, _ = write_tables(tmp_path)
    words = ["facade", "far.jpg", "near.jpg", "--control", str(control), "--out", "out"]
    words[1:3] = [str(tmp_path / name) for name in words[1:3]]
    words[-1] = str(tmp_path / "out")
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 1
    assert "near.jpg: is not an image" in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_first_step_that_fails_leaves_no_folder(tmp_path):
    control, _ = write_tables(tmp_path)
    control.write_text("\n".join(control.read_text().splitlines()[:3]) + "\n")
    words = ["facade", FAR, NEAR, "--control", control, "--out", tmp_path / "out"]
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == 1
    assert "control points" in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--products", "poster"], "'poster' is none of relief"),
        ([], "say how the pair is to be set up"),
    ],
)
def test_impossible_wishes_are_refused(tmp_path, options, said):
    words = ["facade", str(FAR), str(NEAR), "--out", str(tmp_path / "out"), *options]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 1
    assert said in result.stderr


@pytest.mark.acceptance
@pytest.mark.parametrize("leans", [pytest.param(False, marks=pytest.mark.long), True])
def test_a_facade_under_water_is_delivered_by_the_bent_rays(tmp_path, leans):
    """The sample's cameras as they stood; its points' relief is known."""
    away = ["--port-normal", "0.0001,0,1"] if leans else []  # next to nothing
    out = tmp_path / "reef"
    photos = [str(WATER_SAMPLE / name) for name in ("far.jpg", "near.jpg")]
    typed = "--as-set-up --distance1 3.5 --distance2 1.9 --sensor-width 19.2 --indices 1,1.49,1.337"
    rows = (WATER_SAMPLE / "targets.csv").read_text("utf-8").splitlines()[1:]
    numbers = np.array([[float(v) for v in row.split(",")[1:]] for row in rows])
    xyz = (
        Pair.read(WATER_SAMPLE / "facade.pair.json").intersect(numbers[:, :2], numbers[:, 2:4]).xyz
    )
    table = ["id,X [m],Y [m],r [m],col1,row1,col2,row2"]
    for name, at, seen in zip(rows, xyz, numbers, strict=True):
        values = [at[0], at[1], seen[4], *seen[:4]]
        table.append(",".join([name.split(",")[0], *map(str, values)]))
    (tmp_path / "check.csv").write_text("\n".join(table))
    pair = json.loads((WATER_SAMPLE / "facade.pair.json").read_text("utf-8"))
    focal = []
    for number in (1, 2):
        photo = pair[f"image{number}"]
        length = 19.2 / 960 * photo["distance"] / photo["plane_from_pixel"][0][0]
        focal += [f"--focal{number}", str(length)]
    words = ["facade", *photos, *typed.split(), *focal, "--thicknesses", "0.01", "--port", "0.05"]
    words += ["--scale", "1:20", "--quality", "fast", "--out", str(out), "--json", *away]
    words += ["--check", str(tmp_path / "check.csv")]
    words += ["--products", "points" if leans else "relief,points,report"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.stderr
    made = Pair.read(out / "align/reef.pair.json")
    assert made.layers.indices == (1.0, 1.49, 1.337)
    found = made.intersect(numbers[:, :2], numbers[:, 2:4]).xyz[:, 2]
    assert np.median(np.abs(found - numbers[:, 4])) < 0.004
    book = openpyxl.load_workbook(out / "points/reef_points.xlsx")
    assert ("normal_x_1" in book.defined_names) == leans
    if leans:
        return
    report = (out / "report/reef_report.html").read_text("utf-8")
    assert "Were this pair taken for one in air, relief on the wall would be wrong by" in report
    places = [(x, y) for x in np.linspace(-0.9, 0.9, 50) for y in np.linspace(-0.55, 0.55, 30)]
    with (
        rasterio.open(out / "relief/reef_relief.tif") as relief,
        rasterio.open(WATER_SAMPLE / "truth.tif") as truth,
    ):
        off = [
            a[0] - b[0] for a, b in zip(relief.sample(places), truth.sample(places), strict=True)
        ]
    assert np.isfinite(off).mean() > 0.7
    assert np.nanmedian(np.abs(off)) < 0.006  # fast; 80 mm where refraction is neglected


def test_every_command_takes_its_language_by_either_name():
    context = click.Context(main)
    commands = [main.get_command(context, name) for name in main.list_commands(context)]
    options = [param for each in commands for param in each.params if param.name == "language"]
    assert len(options) > 8
    assert all({"--lang", "--language"} == set(option.opts) for option in options)
