"""One list of picks per photo, and survey workbooks in the place of pair files."""

from __future__ import annotations

import json

import ezdxf
import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner

from bifocal import Pair, Taking, solve
from bifocal.workbook.pair_workflow import read_pair
from bifocal.workbook.reading.pick_lists import read_picks
from multimedia import InputError
from tests.bifocal.workbook.filled_forms import fill as fill_form
from tests.bifocal.workbook.filled_forms import put
from tests.builders.commands import bifocal_command as main
from tests.papers.test_midulla_layout import NADIR, SIZE, fill, pixels, truth

XYZ = truth(3)[[0, 5, 12, 18, 22]]
NAMES = ["K1", "K2", "K3", "K4", "K5"]
FAR, NEAR = pixels(XYZ, 35, 17.5), pixels(XYZ, 19, 9.5)


def csv(path, names, places, head="id,col,row"):
    rows = [f"{n},{c!r},{r!r}" for n, (c, r) in zip(names, places.tolist(), strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def dxf(path, names, places, *, image=None, points=True, shift=(2.0, 3.0)):
    """A drawing with points and names, on a photo attached as CAD does, or without one."""
    drawing = ezdxf.new("R2010")
    model = drawing.modelspace()
    for name, (x, y) in zip(names, places, strict=True):
        if points:
            model.add_point((x, y))
        at = (x + shift[0], y + shift[1]) if points else (x, y)
        model.add_text(name, height=5, dxfattribs={"insert": at})
    if image is not None:
        corner, size, turn = image
        definition = drawing.add_image_def("far.jpg", SIZE)
        model.add_image(definition, insert=corner, size_in_units=size, rotation=turn)
    drawing.saveas(path)
    return path


def set_up(folder):
    (folder / "photos").mkdir(exist_ok=True)
    fill(folder / "setup.xlsx", 19, 9.5, folder)
    return folder / "setup.xlsx"


@pytest.mark.acceptance
def test_two_tables_are_joined_by_the_names_of_the_points(tmp_path):
    first = csv(tmp_path / "far.csv", [*NAMES, "alone"], np.vstack([FAR, [[1.0, 1.0]]]))
    second = csv(
        tmp_path / "near.csv", NAMES[::-1], NEAR[::-1], head="Name;x [px];y [px]".replace(";", ",")
    )
    solved = solve((first, second), pair=set_up(tmp_path))
    assert solved.table.ids == tuple(NAMES)
    assert solved.table.xyz == pytest.approx(XYZ, abs=1e-9)
    assert any("alone" in remark for remark in solved.remarks)
    run = CliRunner().invoke(
        main, ["solve", str(first), str(second), "--pair", str(tmp_path / "setup.xlsx"), "--json",
               "--out", str(tmp_path / "result.xlsx")],
    )  # fmt: skip
    assert run.exit_code == 0, run.output
    said = json.loads(run.stdout)
    assert [p["r"] for p in said["points"]] == pytest.approx(XYZ[:, 2])
    assert "1 % of scale is 0.21 m" in said["rests_on"]
    again = solve(tmp_path / "result.xlsx")
    assert again.table.xyz == pytest.approx(XYZ, abs=1e-9)


@pytest.mark.parametrize("points", [True, False])
def test_picks_are_read_from_a_drawing_on_the_photo(tmp_path, points):
    # The photo lies turned by 90 degrees, 2 units per pixel, its lower left corner at 100, 50.
    up = SIZE[1] - 0.5 - FAR[:, 1]
    right = FAR[:, 0] + 0.5
    places = np.column_stack([100 - 2 * up, 50 + 2 * right])
    image = ((100, 50), (2 * SIZE[0], 2 * SIZE[1]), 90)
    found = read_picks(dxf(tmp_path / "far.dxf", NAMES, places, image=image, points=points))
    assert found.unit == "px"
    assert found.ids == tuple(NAMES)
    assert found.places == pytest.approx(FAR, abs=1e-6)


def test_a_drawing_with_the_corner_of_the_photo_at_zero_is_in_pixels(tmp_path):
    found = read_picks(dxf(tmp_path / "far.dxf", NAMES, (FAR + 0.5) * [1, -1]))
    assert found.unit == "px"
    assert found.places == pytest.approx(FAR)


def test_a_drawing_about_the_nadir_is_in_millimetres(tmp_path):
    flip = [0.00739, -0.00739]
    lists = tuple(
        dxf(tmp_path / name, NAMES, (places - NADIR) * flip, shift=(0.01, 0.02))
        for name, places in (("far.dxf", FAR), ("near.dxf", NEAR))
    )
    solved = solve(lists, taking=Taking(d1=17.5, d2=9.5, c1=35, c2=19))
    assert solved.table.xyz == pytest.approx(XYZ, abs=1e-9)


def test_lists_that_cannot_be_joined_are_refused_with_what_is_wrong(tmp_path):
    first = csv(tmp_path / "far.csv", NAMES, FAR)
    other = csv(tmp_path / "near.csv", ["1", "2", "3", "4", "5"], NEAR)
    with pytest.raises(InputError, match=r"share no point.*Give the same points the same names"):
        solve((first, other), pair=set_up(tmp_path))
    twice = csv(tmp_path / "twice.csv", ["K1", "K1", "K3", "K4", "K5"], NEAR)
    with pytest.raises(InputError, match="K1"):
        solve((first, twice), pair=tmp_path / "setup.xlsx")
    lonely = dxf(tmp_path / "x.dxf", NAMES, FAR, shift=(900, 0))
    with pytest.raises(InputError, match="has no name beside it"):
        read_picks(lonely)
    (tmp_path / "broken.dxf").write_text("nothing")
    with pytest.raises(InputError, match="no DXF drawing"):
        read_picks(tmp_path / "broken.dxf")
    three = CliRunner().invoke(main, ["solve", "a.csv", "b.csv", "c.csv"])
    assert three.exit_code == 2


@pytest.mark.acceptance
def test_a_workbook_is_the_pair_it_states(tmp_path):
    from PIL import Image

    book = set_up(tmp_path)
    with pytest.raises(InputError, match=r"far\.tif"):
        read_pair(book)
    for name in ("far.tif", "near.tif"):
        Image.new("L", SIZE).save(tmp_path / "photos" / name)
    pair = read_pair(book)
    assert pair.project(XYZ) == (pytest.approx(FAR), pytest.approx(NEAR))
    assert pair.photo_file(2).name == "near.tif"
    assert pair.remarks == ()
    assert pair.image1.precision() == pytest.approx(0.29)
    # Without nadir points the middle of each photo is taken, and said so.
    typed = openpyxl.load_workbook(book)
    for name in ("nadir_1_col", "nadir_1_row", "nadir_2_col", "nadir_2_row"):
        put(typed, name, None)
    put(typed, "input_unit", "mm")
    typed.save(book)
    assumed = read_pair(book)
    assert assumed.project(XYZ) == (pytest.approx(FAR), pytest.approx(NEAR))
    assert "assumed: the nadir point of photo 1" in assumed.remarks[0]


@pytest.mark.acceptance
def test_align_takes_the_set_up_of_a_workbook_as_it_is_typed(tmp_path):
    from PIL import Image

    book, out = set_up(tmp_path), tmp_path / "pairs" / "wall.pair.json"
    out.parent.mkdir()
    for name in ("far.tif", "near.tif"):
        Image.new("L", SIZE).save(tmp_path / "photos" / name)
    words = ["align", str(book), "--out", str(out), "--sigma-distance", "0.01"]
    run = CliRunner().invoke(main, words)
    assert run.exit_code == 0, run.output
    assert "far camera 17.5 m, near camera 9.5 m" in run.stdout
    pair = Pair.read(out)
    assert pair.project(XYZ) == (pytest.approx(FAR), pytest.approx(NEAR))
    assert pair.photo_file(1).resolve() == (tmp_path / "photos" / "far.tif").resolve()
    assert pair.image1.precision() == pytest.approx(0.29)
    # By hand, of 1 m of relief: dr/dd1 = d2 / (d1 (d1 - d2)) r (1 - r/d2), and so for d2.
    added = pair.covariance_of_orientation(np.array([[2.0, 1.0, 1.0]]))[0, 2, 2]
    by = np.array([9.5 / 17.5 * (1 - 1 / 9.5), 17.5 / 9.5 * (1 - 1 / 17.5)]) / 8.0
    assert np.sqrt(added) == pytest.approx(0.01 * np.hypot(*by), rel=0.01)
    again = CliRunner().invoke(main, words)
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr
    other = CliRunner().invoke(main, [*words, "--overwrite", "--distance1", "17.4"])
    assert other.exit_code == 2
    assert "--distance1" in other.stderr
    alone = CliRunner().invoke(main, ["align", "far.tif", "--out", str(out)])
    assert alone.exit_code == 2
    assert "FAR and NEAR" in alone.stderr


@pytest.mark.acceptance
def test_a_workbook_without_photos_says_which_cells(tmp_path):
    fill_form(tmp_path / "t.xlsx", ())
    run = CliRunner().invoke(main, ["relief", str(tmp_path / "t.xlsx"), "--out", "r.tif"])
    assert run.exit_code == 1
    assert "photo_1 and photo_2 are blank" in run.stderr
