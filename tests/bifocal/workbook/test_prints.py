"""Measured on prints: each image has its enlargement, the ruler its own precision."""

import json
from dataclasses import replace

import numpy as np
import openpyxl
import pytest

from bifocal import (
    Measuring,
    Pair,
    PointObservations,
    SurveyInput,
    SurveyMedia,
    SurveySetup,
    Taking,
    solve,
)
from bifocal.collimation.workbook.setup import completed, typed_setup
from bifocal.workbook.reading.reader import read_survey
from tests.bifocal.workbook.filled_forms import POINTS, fill, refused, rows, run, write_csv
from tests.bifocal.workbook.kept_workbook import DISTANCES
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached
from tests.cases import few_by_default

CAMERAS = {"d1": 17.5, "d2": 9.5, "c1": 35, "c2": 19}
SIZES = {"enlargement1": 10, "enlargement2": 12}
#: What is typed into `Setup`.
CELLS = {f"{name[:-1]}_{name[-1]}": value for name, value in {**CAMERAS, **SIZES}.items()}
OPTIONS = (*DISTANCES, "--enlargement1", 10, "--enlargement2", 12)
TRUTH = np.array([point[1:] for point in POINTS], dtype=float)


def on_prints(first=10, second=12):
    """Rows id, x1, y1, x2, y2 as measured on prints. [mm]"""
    return [(n, first * a, first * b, second * c, second * d) for n, a, b, c, d in rows(POINTS)]


def columns(table):
    return dict(zip(("id", "x1", "y1", "x2", "y2"), zip(*table, strict=True), strict=True))


def own_book(path, **cells):
    book = openpyxl.Workbook()
    for row in [("id", "x1 [mm]", "y1 [mm]", "x2 [mm]", "y2 [mm]"), *on_prints()]:
        book.active.append(row)
    notes = book.create_sheet("Rilievo")
    for name, value in cells.items():
        notes.append([name.replace("_", " "), value])
    book.save(path)
    return path


def xyz_of(path, *options):
    result = run("solve", path, "--json", *options)
    assert result.exit_code == 0, result.stderr
    return np.array([[p["X"], p["Y"], p["r"]] for p in json.loads(result.stdout)["points"]])


def test_prints_give_what_the_sensors_give_as_precisely_as_the_ruler_reads():
    on_sensor = solve(
        columns(rows(POINTS)), taking=Taking(**CAMERAS), measuring=Measuring(sigma_s=0.02)
    ).table
    taking = Taking(**CAMERAS, enlargement1=10, enlargement2=10)
    found = solve(columns(on_prints(10, 10)), taking=taking)
    np.testing.assert_allclose(found.table.xyz, TRUTH, atol=1e-12)
    for key in ("sigma_X", "sigma_Y", "sigma_r"):
        np.testing.assert_allclose(found.table[key], on_sensor[key], rtol=1e-12)
    assert found.setup.precision == 0.2
    assert found.table.flags == on_sensor.flags
    assert found.remarks == ()
    # The larger print is read the better: 0.2 mm are 1/60 mm on its sensor.
    larger = solve(columns(on_prints()), taking=Taking(**CAMERAS, **SIZES))
    np.testing.assert_allclose(larger.table.xyz, TRUTH, atol=1e-12)
    assert (larger.table["sigma_r"] < on_sensor["sigma_r"]).all()


def test_the_photos_themselves_must_have_one_scale_not_their_prints():
    said = solve(columns(on_prints()), taking=Taking(**CAMERAS, **SIZES)).remarks
    assert any("-16.67%" in text and "enlargement" in text for text in said)
    with pytest.raises(Exception, match="differ by 10"):
        solve(columns(on_prints()), taking=Taking(**CAMERAS | SIZES | {"c2": 19 / 1.1}))


def test_an_angle_no_lens_sees_is_named_with_the_way_out(tmp_path):
    prints = write_csv(
        tmp_path / "p.csv", "id,s1,s2,theta\nP0,4,4,0\nP1,42.42424,44.70588,90\nP2,,,\n"
    )
    result = run("solve", prints, *DISTANCES)
    assert "P1 lies 67 deg off the axis of image 2" in result.stderr
    assert "--enlargement1" in result.stderr
    given = ("--enlargement1", 10, "--enlargement2", 10)
    result = run("solve", prints, *DISTANCES, *given, "--json")
    assert "deg off the axis" not in result.stderr
    point = json.loads(result.stdout)["points"][1]
    assert [point["X"], point["r"]] == pytest.approx([2, 1], abs=1e-5)


def test_pixels_and_enlargements_exclude_each_other(tmp_path):
    path = fill(tmp_path / "s.xlsx", setup={"c_1": 35, "c_2": 19, "d_2": 9.5, "d_1": 17.5})
    options = ("--unit", "px", "--pitch", 0.004, "--enlargement1", 10)
    refused(path, "enlargement_1", "Type 1 for pixels", options=options)


def test_the_page_picks_on_the_photos_whatever_was_measured_on_prints():
    pair = Pair.ideal(d1=17.5, d2=9.5, c1=35, c2=19, pixel_size=0.005)
    lenses = SurveySetup(taking=Taking(**CAMERAS, pitch=0.005))
    prints = lenses.but(**SIZES)
    assert completed(prints, pair).taking.c_used == (35, 19)
    assert typed_setup(prints, pair).items() - typed_setup(lenses, pair).items() == {
        ("enlargement_1", 1),
        ("enlargement_2", 1),
    }


@pytest.mark.parametrize("language", few_by_default(["en", "it", "de"], "it"))
def test_the_template_has_cells_for_prints(tmp_path, language):
    path = tmp_path / "t.xlsx"
    fill(path, on_prints(), CELLS, ("--lang", language, "--rows", 6))
    np.testing.assert_allclose(xyz_of(tmp_path / "t.xlsx"), TRUTH, atol=1e-9)


def test_labels_and_options_of_an_own_table_are_honoured(tmp_path):
    cells = {"c_1": 35, "c_2": 19, "d_1": 17.5, "d_2": 9.5}
    labelled = own_book(tmp_path / "a.xlsx", **cells, ingrandimento_1=10, Vergrößerung_2=12)
    np.testing.assert_allclose(xyz_of(labelled), TRUTH, atol=1e-9)
    path = own_book(tmp_path / "b.xlsx")
    assert run("solve", path, *OPTIONS, "--out", path, "--overwrite").exit_code == 0
    setup = read_survey(path).setup
    assert (*setup.taking.enlargements, setup.measuring.sigma_s) == (10, 12, None)
    np.testing.assert_allclose(xyz_of(path), TRUTH, atol=1e-9)


def test_prints_through_water_are_bent_like_the_sensors():
    media = {"index_1": 1, "index_2": 1.5, "index_3": 1.337, "thick_2": 0.01}
    media = SurveyMedia.of_cells({**media, "z0_1": 0.3, "z0_2": 0.3}, 3)

    def through(table, **more):
        survey = SurveyInput.of_points(PointObservations.from_columns(columns(table)))
        setup = replace(survey.setup, media=media)
        survey = replace(survey, setup=setup)
        return solve(survey, taking=Taking(**CAMERAS, **more), scale_tolerance=0.1).table

    found = through(on_prints(), **SIZES)
    np.testing.assert_allclose(found.xyz, through(rows(POINTS)).xyz, atol=1e-9)


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("kind", ["new", "own", "water"])
def test_formulas_of_prints_equal_the_library(tmp_path, kind):
    path, out = own_book(tmp_path / "m.xlsx"), tmp_path / "out.xlsx"
    if kind == "own":
        assert run("solve", path, *OPTIONS, "--out", out).exit_code == 0
    else:
        media = ("--media", 3) if kind == "water" else ()
        cells = {**CELLS, "sensor_w": 36, "sensor_h": 24}
        if media:
            cells |= {"index_1": 1, "index_2": 1.5, "index_3": 1.337, "thick_2": 0.01}
            cells |= {"z0_1": 0.3, "z0_2": 0.3, "c_2": 19.6}
        fill(out, on_prints(), cells, ("--rows", 6, *media))
        line = ("solve", out, "--scale-tolerance", 0.2, "--out", out, "--overwrite")
        result = run(*line)
        assert result.exit_code == 0, result.stderr
    assert assert_recalculated_equals_cached(out, tmp_path) > 20
    if kind == "new":
        shown = openpyxl.load_workbook(out, data_only=True)["Planning"]
        assert any(c.value == pytest.approx(10 * np.hypot(36, 24) / 2) for c in shown["B"])


@pytest.mark.acceptance
def test_correcting_the_set_up_by_the_plane_keeps_prints_prints(tmp_path):
    table = [
        *on_prints(),
        *(("Q1", 80, 60, 96, 72), ("Q2", -80, 60, -96, 72), ("Q3", 0, 90, 0, 108)),
    ]
    path = fill(tmp_path / "s.xlsx", table, CELLS)
    book = openpyxl.load_workbook(path)
    head = [cell.value for cell in book["Points"][4]]
    for row in (9, 10, 11):
        book["Points"].cell(row, head.index("code") + 1, "PLANE")
    book.save(path)
    assert xyz_of(path, "--adjust-setup")[:3] == pytest.approx(TRUTH[:3], abs=0.01)
    result = run("solve", path, "--adjust-setup", "--out", path, "--overwrite")
    assert result.exit_code == 0, result.stderr
    assert xyz_of(path)[:3] == pytest.approx(TRUTH[:3], abs=0.01)
