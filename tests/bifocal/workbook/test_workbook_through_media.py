"""The survey workbook of photos that look through glass and water: formulas against shot rays."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from itertools import zip_longest

import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner

from bifocal import (
    Measuring,
    Pair,
    PointObservations,
    SurveyMedia,
    SurveySetup,
    Taking,
    georeference,
    solve,
)
from bifocal.survey.point_survey import solve_points
from bifocal.workbook.making.book import write_book
from bifocal.workbook.output import write_result
from bifocal.workbook.pair_workflow import read_pair
from bifocal.workbook.template_workflow import write_survey, write_template
from multimedia import GeometryError, InputError, WorkbookError
from tests.bifocal.model.test_pair_through_media import AQUARIUM, POINTS, SURFACE, content
from tests.bifocal.workbook.filled_forms import fill as fill_form
from tests.bifocal.workbook.filled_forms import named
from tests.bifocal.workbook.test_solve_through_media import measured
from tests.bifocal.workbook.test_survey_workbook import (
    assert_recalculated_equals_cached,
    ideal_content,
)
from tests.builders.commands import bifocal_command as main
from tests.cases import few_by_default
from tests.recalculate import recalculated, rows_of
from tests.scenes.refracted import seen_at
from tests.workbook_lint import lint

#: Two lenses of equal scale near the axis, 0.9 m of water behind the glass of a tank.
TANK = {"c": (35.0, 19.0), "d": (3.733, 2.131), "depth": 0.9}
PICKS = Measuring(sigma_px=0.3)


def tank_points(points=POINTS):
    """Return image coordinates in mm of both photos of the tank, by rays shot in 50 digits."""
    both = []
    for c, d in zip(TANK["c"], TANK["d"], strict=True):
        z0 = d - TANK["depth"] - 0.01
        seen = [seen_at(p, nadir=(0, 0), distance=d, z0=z0, **AQUARIUM) for p in points]
        both.append(np.array(seen) * c / d)
    return both


def tank_cells(**more):
    """Return what is typed into `Setup`, by the names of its cells."""
    (c1, c2), (d1, d2) = TANK["c"], TANK["d"]
    z01, z02 = (d - TANK["depth"] - 0.01 for d in (d1, d2))
    media = {"index_1": 1.0, "index_2": 1.49, "index_3": 1.337, "thick_2": 0.01}
    cells = {"c_1": c1, "c_2": c2, "d_2": d2, "delta_d": d1 - d2, "z0_1": z01, "z0_2": z02}
    return cells | media | more


def media_of_tank():
    return SurveyMedia.of_cells(tank_cells(), 3)


def fill(path, out, cells, xy, code=()):
    """Type a set-up and points into a template."""
    picks = zip_longest(np.hstack(xy).tolist(), code)
    points = [
        {"id": f"P{i}", **dict(zip(("x1", "y1", "x2", "y2"), row, strict=True)), "code": word}
        for i, (row, word) in enumerate(picks)
    ]
    fill_form(out, points, cells, path)


@pytest.fixture(scope="module")
def form(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tank")
    write_template(folder / "tank.xlsx", rows=7, media=3)
    fill(folder / "tank.xlsx", folder / "filled.xlsx", tank_cells(), tank_points())
    return folder / "filled.xlsx"


@pytest.fixture
def tank(form, tmp_path):
    return shutil.copyfile(form, tmp_path / "filled.xlsx")


@pytest.mark.acceptance
@pytest.mark.office
def test_a_form_filled_in_by_hand_shows_where_shot_rays_meet(tank, tmp_path):
    book = recalculated(tank, tmp_path)
    rows = rows_of(book, "Points", 4)[: len(POINTS)]
    found = [[row["X"], row["Y"], row["r"]] for row in rows]
    np.testing.assert_allclose(found, POINTS, atol=1e-9)
    table = solve(tank).table
    np.testing.assert_allclose(table.xyz, POINTS, atol=1e-9)
    for key in ("s1_used", "ds", "den", "e1", "e2", "s_c", "sigma_r", "sigma_X", "sigma_Y"):
        np.testing.assert_allclose([row[key] for row in rows], table[key], rtol=1e-9, atol=1e-12)
    assert tuple(row["flag"] for row in rows) == table.flags
    assert named(book, "check_scale").value == "OK"
    assert book["Setup"]["A3"].value == "The set-up is complete."
    for image, d in enumerate(TANK["d"], 1):
        seen = d - TANK["depth"] - 0.01 + 0.01 / 1.49 + TANK["depth"] / 1.337
        assert named(book, f"seen_{image}").value == pytest.approx(seen, rel=1e-12)
        assert named(book, f"reach_{image}").value == pytest.approx(1.337 * seen, rel=1e-12)


@pytest.mark.acceptance
def test_unequal_scales_are_told_as_seen_through_the_media(form):
    """The sentence names what is compared: not c/d, which is never equal through media."""
    for language, told in (("en", "c_1/seen_1"), ("it", "mezzi"), ("de", "Medien")):
        path = form.parent / f"{language}.xlsx"
        write_template(path, rows=3, media=3, language=language)
        formula = openpyxl.load_workbook(path)["Setup"]["A3"].value
        assert told in formula
        assert "c_1/d_1" not in formula


def test_what_comes_out_of_the_form_is_written_into_it(tank, tmp_path):
    out = tmp_path / "solved.xlsx"
    done = CliRunner().invoke(main, ["solve", str(tank), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "refraction in 3 media" in done.output
    assert lint(out) == []
    again = solve(out)
    np.testing.assert_allclose(again.table.xyz, POINTS, atol=1e-9)
    formulas = openpyxl.load_workbook(tank)["Points"]["T5"].value
    assert openpyxl.load_workbook(out)["Points"]["T5"].value == formulas


@pytest.mark.acceptance
@pytest.mark.office
def test_every_formula_through_media_equals_the_library(tmp_path):
    """Points given by x y and by s theta, at the nadir, off the radius, and missing ones."""
    air = ideal_content()
    given = {"index_1": 1.0, "index_2": 1.49, "index_3": 1.337, "thick_2": 0.01}
    media = SurveyMedia.of_cells(given | {"z0_1": 12.0, "z0_2": 4.0}, 3)
    for cells in (media, SurveyMedia.blank(3)):
        setup = replace(air.setup, media=cells)
        table = solve_points(setup.pair(), setup.in_millimetres(air.points))
        path = tmp_path / f"ideal-{cells.layers is None}.xlsx"
        made = replace(air, setup=setup, pair=setup.pair(), table=table)
        world = georeference(table, air.control)
        write_book(path, replace(made, georeference=world))
        assert assert_recalculated_equals_cached(path, tmp_path) > 1500
        if cells.layers is None:  # blank cells are air
            np.testing.assert_allclose(table.xyz, air.table.xyz, rtol=1e-12, atol=1e-14)
            np.testing.assert_allclose(table["sigma_r"], air.table["sigma_r"], rtol=1e-11)
            np.testing.assert_allclose(
                table.covariance, air.table.covariance, rtol=1e-10, atol=1e-20
            )
            assert table.flags == air.table.flags


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("name", ["tank", "oblique"])
def test_a_workbook_of_raw_pixels_equals_the_library(name, tmp_path):
    pair, rng = Pair.from_dict(content(name)), np.random.default_rng(4)
    xyz = np.column_stack([rng.uniform(-1, 1, (12, 2)), rng.uniform(-0.3, 0.4, 12)])
    pixels = [p + rng.normal(0, 0.3, p.shape) for p in pair.project(xyz)]
    pixels[1][3] = np.nan
    pixels[0][5] += [8, -6]
    ids = tuple(map(str, range(12)))
    points = PointObservations(ids=ids, pixels1=pixels[0], pixels2=pixels[1])
    write_survey(tmp_path / "p.xlsx", points, pair=pair, sigma_px=0.3)
    assert lint(tmp_path / "p.xlsx") == []
    assert assert_recalculated_equals_cached(tmp_path / "p.xlsx", tmp_path) > 800
    rows = rows_of(openpyxl.load_workbook(tmp_path / "p.xlsx", data_only=True), "Points", 4)[:12]
    used = [i for i in range(12) if i != 3]
    found = [[float(rows[i][key]) for key in ("X", "Y", "r")] for i in used]
    np.testing.assert_allclose(found, pair.intersect(*pixels).xyz[used], atol=1e-12)


@pytest.mark.parametrize(
    "name",
    few_by_default(["oblique", "leaning port", "port", "surface", "diver"], "leaning port"),
)
def test_the_set_up_of_a_pair_comes_back_from_its_workbook(name, tmp_path):
    """Written beside its pair file and without it: media stand in the cells of `Setup`."""
    points = POINTS * ([0.3, 0.3, 0.2] if name == "diver" else 1.0)
    pair, picks = Pair.from_dict(content(name)), measured(name, points)
    write_result(tmp_path / "p.xlsx", solve(picks, pair=pair, measuring=PICKS))
    again = solve(tmp_path / "p.xlsx")
    np.testing.assert_allclose(again.table.xyz, points, atol=1e-9)
    assert again.pair.layers == pair.layers
    assert (again.pair.image1.z0, again.pair.image2.z0) == (pair.image1.z0, pair.image2.z0)
    write_result(tmp_path / "p.xlsx", again, overwrite=True)
    np.testing.assert_allclose(solve(tmp_path / "p.xlsx").table.xyz, points, atol=1e-9)


def test_sigmas_of_an_ideal_pair_are_the_slopes_of_its_formulas():
    """By the derivatives of the solution with respect to each coordinate, numerically."""
    media = media_of_tank()
    (c1, c2), (d1, d2) = TANK["c"], TANK["d"]
    taking, measuring = Taking(c1=c1, c2=c2, d1=d1, d2=d2), Measuring(sigma_s=0.002)
    setup = SurveySetup(taking=taking, measuring=measuring, media=media)
    xy = tank_points()
    ids = tuple(map(str, range(len(POINTS))))

    def solved(xy1, xy2):
        points = PointObservations(ids=ids, xy1=xy1, xy2=xy2)
        return solve_points(setup.pair(), points)

    table, step = solved(*xy), 1e-5
    by_pick = []
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        moved = [[p + (k == i) * sign * step * np.eye(2)[j] for k, p in enumerate(xy)]
                 for sign in (1, -1)]  # fmt: skip
        by_pick.append((solved(*moved[0]).xyz - solved(*moved[1]).xyz) / (2 * step))
    effect = np.stack(by_pick, axis=-1) * 0.002
    numeric = effect @ effect.transpose(0, 2, 1)
    # As in air the direction is that of photo 1: picks across the radius of photo 2 move nothing.
    np.testing.assert_allclose(table.covariance, numeric, rtol=2e-6, atol=1e-14)
    np.testing.assert_allclose(table["sigma_r"] ** 2, table.covariance[:, 2, 2], rtol=1e-12)


def test_media_cells_that_cannot_be_meant_are_named(tank, tmp_path):
    book = openpyxl.load_workbook(tank)
    for name, value in {"index_3": 13.37, "z0_1": None, "index_2": None, "z0_2": -1}.items():
        named(book, name).value = value
    book.save(tmp_path / "bad.xlsx")
    with pytest.raises(WorkbookError) as caught:
        solve(tmp_path / "bad.xlsx")
    for said in ("13.37", "z0_1", "index_2", "-1 m"):
        assert said in str(caught.value)
    fill_form(tmp_path / "unit.xlsx", (), {"thick_2": "10 mm"}, tank)
    with pytest.raises(WorkbookError, match=r'found "10 mm", .* Write 0.01') as caught:
        solve(tmp_path / "unit.xlsx")
    assert len(caught.value.errors) == 1
    with pytest.raises(InputError, match="c_1 and c_2"):
        SurveySetup(taking=Taking(d1=3.7, d2=2.1), media=media_of_tank()).pair()
    with pytest.raises(GeometryError, match="scale-tolerance"):
        solve(tank, taking=Taking(c1=40.0))


@pytest.mark.acceptance
def test_a_medium_without_a_cell_filled_in_is_left_out(tmp_path):
    """A bare surface of water typed into a form for three media."""
    (c1, c2), (d1, d2) = TANK["c"], TANK["d"]
    write_template(tmp_path / "form.xlsx", rows=15, media=3)
    seen = [
        [seen_at(p, nadir=(0, 0), distance=d, z0=d - 0.9, **SURFACE) * c / d for p in POINTS]
        for c, d in zip(TANK["c"], TANK["d"], strict=True)
    ]
    cells = {"c_1": c1, "c_2": c2, "d_2": d2, "delta_d": d1 - d2, "index_3": 1.337}
    cells |= {"z0_1": d1 - 0.9, "z0_2": d2 - 0.9}
    fill(tmp_path / "form.xlsx", tmp_path / "s.xlsx", cells, [np.array(one) for one in seen])
    found = solve(tmp_path / "s.xlsx")
    assert found.pair.layers.indices == (1.0, 1.337)
    np.testing.assert_allclose(found.table.xyz, POINTS, atol=1e-9)


@pytest.mark.acceptance
def test_plane_points_check_and_correct_a_set_up_through_media(tmp_path):
    """Image 2 turned by 0.1 deg, stretched by 0.3 % and shifted: points of the plane tell."""
    rng = np.random.default_rng(3)
    plane = np.column_stack([rng.uniform(-1, 1, (10, 2)), np.zeros(10)])
    points = np.vstack([plane, POINTS[1:]])
    first, second = tank_points(points)
    angle = np.radians(0.1)
    turn = 1.003 * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved = second @ turn.T + [0.01, -0.02]
    write_template(tmp_path / "form.xlsx", rows=20, media=3)
    code = ["PLANE"] * 10 + [None] * 4
    fill(tmp_path / "form.xlsx", tmp_path / "f.xlsx", tank_cells(), [first, moved], code)
    plain, found = solve(tmp_path / "f.xlsx"), solve(tmp_path / "f.xlsx", adjust_setup=True)
    assert np.abs(plain.table.xyz - points).max() > 0.01
    np.testing.assert_allclose(found.table.xyz, points, atol=2e-8)
    by_name = {p.name: p for p in found.orientation_check.parameters}
    assert by_name["scale"].value == pytest.approx(0.3, abs=1e-4)
    write_result(tmp_path / "out.xlsx", found)
    np.testing.assert_allclose(solve(tmp_path / "out.xlsx").table.xyz, points, atol=2e-8)


def test_plane_points_of_a_true_pair_find_nothing_to_correct():
    picks = measured("oblique", np.column_stack([POINTS[:, :2] * [1, 1.3], np.zeros(5)]))
    pair = Pair.from_dict(content("oblique"))
    check = solve(picks | {"code": ["PLANE"] * 5}, pair=pair, measuring=PICKS).orientation_check
    assert check.points == 5
    np.testing.assert_allclose(check.residuals, 0, atol=1e-9)
    assert not any(p.is_significant for p in check.parameters)


@pytest.mark.acceptance
def test_workbooks_of_air_and_media_are_not_changed_into_each_other(tmp_path):
    air, wet = tmp_path / "air.xlsx", tmp_path / "tank.pair.json"
    picks, pair = measured("tank"), Pair.from_dict(content("tank"))
    write_result(air, solve(picks, pair=pair.in_air(), measuring=PICKS))
    wet.write_text(json.dumps(content("tank")))
    solution = solve(air, pair=wet)
    np.testing.assert_allclose(solution.table.xyz, POINTS, atol=1e-9)
    with pytest.raises(InputError, match="photos in air"):
        write_result(air, solution, overwrite=True)
    write_result(tmp_path / "new.xlsx", solution)
    assert solve(tmp_path / "new.xlsx").pair.layers is not None


#: Ports off the wall by 6 to 27 degrees, one of them not; surface: feet seen at 71 degrees.
LEANING = {
    "port": (AQUARIUM, {}, {}),
    "one": (AQUARIUM, {}, {"interface_normal": None}),
    "surface": (SURFACE, {"z0": 0.4}, {"z0": 0.3}),
    "gap": (
        {"indices": [1.0, 1.5, 1.0, 1.5, 1.337], "thicknesses": [0.01, 0.02, 0.01]},
        {"interface_normal": [-0.4, 0.3, 1.0]}, {},
    ),
}  # fmt: skip


def leaning_pair(name):
    layers, *more = LEANING[name]
    data = content("leaning port")
    sides = {f"image{k}": {**data[f"image{k}"], **own} for k, own in enumerate(more, start=1)}
    return Pair.from_dict(data | sides | {"layers": layers})


def leaning_book(name, path, language="en"):
    """Write points with noise, one not measured, one off, one beyond the glass; return both."""
    pair, rng = leaning_pair(name), np.random.default_rng(4)
    xyz = np.column_stack([rng.uniform(-1, 1, (10, 2)), rng.uniform(-0.3, 0.4, 10)])
    xyz[:4, :2] *= 1.0 if name != "surface" else 2.5
    pixels = [p + rng.normal(0, 0.3, p.shape) for p in pair.project(xyz)]
    pixels[1][3] = np.nan
    pixels[0][5] += [8, -6]
    pixels[1][7] += (pixels[1][7] - pixels[0][7]) * 60
    ids = tuple(map(str, range(10)))
    points = PointObservations(ids=ids, pixels1=pixels[0], pixels2=pixels[1])
    write_survey(path, points, pair=pair, sigma_px=0.3, language=language)
    return pair, pixels


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize(
    ("name", "language"),
    [("port", "en"), ("one", "it"), ("surface", "de"), ("gap", "en")],
)
def test_the_formulas_of_ports_that_lean_equal_the_library(name, language, tmp_path):
    path = tmp_path / "p.xlsx"
    pair, pixels = leaning_book(name, path, language)
    assert lint(path) == []
    assert assert_recalculated_equals_cached(path, tmp_path) > 4000
    rows = rows_of(openpyxl.load_workbook(path, data_only=True), "Points", 4)[:10]
    truth = pair.intersect(*pixels).xyz
    found = [[row[key] if row[key] else np.nan for key in ("X", "Y", "r")] for row in rows]
    np.testing.assert_allclose(np.array(found, float), truth, atol=1e-12)
    assert [row["x_c"] for row in rows[:2]] == pytest.approx(
        pair.image1.pixels_from_plane(truth[:2, :2])[:, 0], abs=1e-9
    )


def test_a_normal_that_cannot_be_meant_is_named_and_blank_ones_are_level(tmp_path):
    path, pair = tmp_path / "p.xlsx", Pair.from_dict(content("port"))
    tilted = [replace(photo, interface_normal=[0.1, 0, 1]) for photo in (pair.image1, pair.image2)]
    picks = PointObservations.from_columns(measured("port"))
    write_survey(path, picks, pair=Pair(image1=tilted[0], image2=tilted[1]))
    book = openpyxl.load_workbook(path)
    for bad, said in (
        ({"normal_x_1": 0, "normal_r_1": 0, "normal_y_2": "a bit"}, "[0.0, 0.0, 0.0] does not"),
        ({"normal_r_1": -1, "normal_y_2": None, "normal_r_2": None}, "[0.1, 0.0, 0.0] does not"),
    ):
        for name, value in bad.items():
            named(book, name).value = value
        book.save(tmp_path / "bad.xlsx")
        with pytest.raises(WorkbookError) as caught:
            solve(tmp_path / "bad.xlsx")
        assert len(caught.value.errors) == 2
        assert said in str(caught.value)
        for name in ("normal_r_1", list(bad)[-1]):
            assert f"Setup!{named(book, name).coordinate} ({name})" in str(caught.value)
    for name in ("normal_x_1", "normal_y_1", "normal_r_1", "normal_x_2"):
        named(book, name).value = None
    book.save(path)
    found = solve(path)
    np.testing.assert_allclose(found.table.xyz, POINTS, atol=1e-9)
    write_result(path, found, overwrite=True)
    assert openpyxl.load_workbook(path, data_only=True)["Points"]["X5"].value is not None


def test_a_workbook_of_level_ports_takes_no_pair_whose_ports_lean(tmp_path):
    path, pair_file = tmp_path / "p.xlsx", tmp_path / "lean.pair.json"
    write_result(path, solve(measured("port"), pair=Pair.from_dict(content("port"))))
    pair_file.write_text(json.dumps(content("leaning port")))
    solution = solve(path, pair=pair_file)
    with pytest.raises(InputError, match="ports parallel to the wall"):
        write_result(path, solution, overwrite=True)
    write_result(tmp_path / "new.xlsx", solution)
    again = solve(tmp_path / "new.xlsx")
    assert again.pair.image2.interface_normal.tolist() == [-0.07, 0.05, 1.0]
    np.testing.assert_allclose(again.table.xyz, solution.table.xyz, atol=1e-12)


@pytest.mark.parametrize("media", [1, 7])
def test_a_form_is_made_for_two_to_six_media(media, tmp_path):
    with pytest.raises(InputError, match="media"):
        write_template(tmp_path / "t.xlsx", media=media)


@pytest.mark.acceptance
@pytest.mark.parametrize("language", ["en", "it", "de"])
def test_media_have_their_words_in_every_language(language, tmp_path):
    write_template(tmp_path / "t.xlsx", media=4, rows=3, language=language)
    book = openpyxl.load_workbook(tmp_path / "t.xlsx")
    told = {row[0].value: row[1].value for row in book["Setup"].iter_rows(min_row=5)}
    for name in ("index_1", "index_4", "thick_3", "z0_2", "behind_1", "r_top", "n_used_3"):
        assert len(told[name]) > 10, name
    assert "3" in told["thick_3"]
    assert lint(tmp_path / "t.xlsx") == []


@pytest.mark.acceptance
def test_a_workbook_with_media_is_taken_as_a_pair(tank, tmp_path):
    from PIL import Image

    book = openpyxl.load_workbook(tank)
    for n in "12":
        Image.new("L", (300, 200)).save(tmp_path / f"{n}.png")
        named(book, f"photo_{n}").value = f"{n}.png"
    named(book, "pitch").value = 0.1
    book.save(tank)
    pair = read_pair(tank)
    assert pair.layers.indices == (1.0, 1.49, 1.337)
    pixels = pair.project(POINTS)
    xy = [(p - [149.5, 99.5]) * [0.1, -0.1] for p in pixels]
    np.testing.assert_allclose(xy, tank_points(), atol=1e-10)


@pytest.mark.acceptance
@pytest.mark.office
def test_results_beside_a_table_of_ones_own_follow_the_bent_rays(tmp_path):
    """New columns and a sheet Setup with the cells of media, in the user's own workbook."""
    picks, book = measured("oblique"), openpyxl.Workbook()
    sheet = book.active
    sheet.append(["my points"])
    sheet.append(["id", "col1", "row1", "col2", "row2"])
    for row in zip(*picks.values(), strict=True):
        sheet.append([value if isinstance(value, str) else float(value) for value in row])
    own, pair_file = tmp_path / "own.xlsx", tmp_path / "oblique.pair.json"
    book.save(own)
    pair_file.write_text(json.dumps(content("oblique")))
    words = ["solve", str(own), "--pair", str(pair_file), "--out", str(own), "--overwrite"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert lint(own) == []
    fresh = recalculated(own, tmp_path)
    assert named(fresh, "index_2").value == 1.49
    rows = list(fresh[sheet.title].iter_rows(min_row=2, values_only=True))
    keys = [str(key).split(" ")[0] for key in rows[0]]
    found = [[row[keys.index(key)] for key in ("X", "Y", "r")] for row in rows[1 : 1 + len(POINTS)]]
    np.testing.assert_allclose(np.array(found, float), POINTS, atol=1e-9)


@pytest.mark.acceptance
def test_options_and_languages_are_written_into_a_form_with_media(tank, tmp_path):
    out = tmp_path / "out.xlsx"
    words = ["solve", str(tank), "--d2", "2.1", "--lang", "de", "--out", str(out)]
    done = CliRunner().invoke(main, [*words, "--scale-tolerance", "0.1"])
    assert done.exit_code == 0, done.output
    book = openpyxl.load_workbook(out)
    told = {row[0].value: row[1].value for row in book["Setup"].iter_rows(min_row=5)}
    assert "Medium 3" in told["index_3"]
    assert named(book, "index_3").value == 1.337
    assert named(book, "d_2").value == 2.1
    again = solve(out, scale_tolerance=0.1)
    assert again.setup.taking.d2 == 2.1
    assert again.pair.layers.indices == (1.0, 1.49, 1.337)


@pytest.mark.acceptance
def test_the_heading_of_the_slopes_says_what_they_are(tmp_path):
    write_template(tmp_path / "t.xlsx", media=2, rows=3)
    sheet = openpyxl.load_workbook(tmp_path / "t.xlsx")["Points"]
    labels = {cell.value: sheet.cell(3, cell.column).value for cell in sheet[4]}
    assert labels["den"] == "T2 - T1 of the rays [mm/m]"
    assert "image 2" in labels["tan2"]


def test_coordinates_corrected_by_the_plane_stay_at_the_scale_of_image_2(form, tmp_path):
    """What the wall seems through media is not c / d: in air they take the scale of image 1."""
    plane = np.column_stack([POINTS[:, :2] * [1, 1.3], np.zeros(5)])
    fill(form, tmp_path / "s.xlsx", {}, tank_points(plane), ["PLANE"] * 5)
    remarks = solve(tmp_path / "s.xlsx", adjust_setup=True).remarks
    assert any("now in mm at the scale of image 2." in remark for remark in map(str, remarks))
