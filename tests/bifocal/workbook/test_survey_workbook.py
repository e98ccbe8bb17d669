"""The survey workbook: layout, live formulas that equal the library, committed templates."""

from __future__ import annotations

import functools
import io
import re
import tempfile
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import canonicalize

import numpy as np
import openpyxl
import pytest

from bifocal import (
    KnownPoints,
    Lens,
    Measuring,
    Pair,
    Photo,
    PointObservations,
    SurveySetup,
    Taking,
    georeference,
)
from bifocal.survey.point_survey import solve_points
from bifocal.workbook.content import SurveyContent
from bifocal.workbook.formulas.columns import (
    compare_columns,
    georeference_columns,
    ideal_points,
    pair_points,
    results_columns,
)
from bifocal.workbook.formulas.space_block import LEFT
from bifocal.workbook.making.book import write_book
from bifocal.workbook.template_workflow import write_template
from multimedia import InputError
from tests.bare_workbook import parts
from tests.bifocal.workbook.filled_forms import fill, named
from tests.recalculate import recalculated, rows_of
from tests.workbook_lint import lint

TEMPLATES = Path(__file__).parents[3] / "templates"
SHEETS = ["Readme", "Setup", "Points", "Results", "Check", "Georeference", "Planning", "Charts",
          "Log"]  # fmt: skip
#: Columns of the control points that are differences of what the turns of the fit lead to.
LEFT_OUT = {"own", "gain", "s0", *(f"d_{pair}" for pair in ("EE", "EN", "NN", "EH", "NH", "HH"))}
NAMED = [
    *("c_1", "c_2", "d_1", "d_2", "delta_d", "pitch", "sigma_s", "input_unit"),
    *("nadir_1_col", "nadir_1_row", "nadir_2_col", "nadir_2_row"),
]


def said(part):
    return canonicalize(part, rewrite_prefixes=True)


@pytest.mark.parametrize("language", ["en", "it", "de"])
def test_committed_template_is_what_the_program_writes(language, tmp_path):
    write_template(tmp_path / "new.xlsx", language=language)
    new, committed = parts(tmp_path / "new.xlsx"), parts(TEMPLATES / f"survey-{language}.xlsx")
    assert [*new] == [*committed]
    for name, part in new.items():
        # What their XML says, however openpyxl (or its lxml) writes that.
        alike = part == committed[name] or said(part) == said(committed[name])
        assert alike, f"{name}: rebuild it with `write_template`"


def test_same_content_makes_the_same_bytes(tmp_path):
    write_book(tmp_path / "r.xlsx", ideal_content())
    assert (tmp_path / "r.xlsx").read_bytes() == written()


def test_sheets_names_and_keys_are_those_of_the_contract():
    book = openpyxl.load_workbook(TEMPLATES / "survey-en.xlsx")
    assert book.sheetnames == SHEETS
    for name in NAMED:
        assert book.defined_names[name].attr_text.startswith("'Setup'!$C$")
    keys = [cell.value for cell in book["Points"][4]]
    assert keys[:11] == "id x1 y1 x2 y2 s1 s2 theta use code note".split()  # noqa: SIM905
    computed = "ds den r e1 e2 s_c X Y Z q sigma_X sigma_Y sigma_r flag".split()  # noqa: SIM905
    assert [key for key in keys if key in computed] == computed
    results = [cell.value for cell in book["Results"][4]]
    assert results == (
        "id X Y Z E N H sigma_X sigma_Y sigma_r sigma_E sigma_N sigma_H flag note".split()  # noqa: SIM905
    )


def test_only_functions_of_excel_2007_are_used():
    text = (
        "IF COUNT SQRT AND OR SIN COS RADIANS DEGREES ATAN2 ABS N NA ISERROR ISNUMBER INDEX MATCH "
        "ROW ROWS IFERROR SUM SUMSQ SUMIF SUMPRODUCT AVERAGE MAX MIN ROUND LEFT TRIM UPPER FDIST "
        "CHIDIST NOT"
    )
    allowed = set(text.split())
    used = set()
    columns = [*ideal_points(), *pair_points(undistorted=True)]
    columns += [*ideal_points(others=4), *compare_columns(4)]
    for is_pair in (False, True):
        columns += [*results_columns(is_pair=is_pair), *georeference_columns(is_pair=is_pair)]
    for column in columns:
        used |= set(re.findall(r"([A-Z][A-Z0-9.]*)\(", column.formula))
    assert used <= allowed


def ideal_content(rows=40, model="levelled", **more):
    rng = np.random.default_rng(7)
    nadir1, nadir2 = (1536.25, 1023.75), (1530.0, 1020.5)
    taking = Taking(d1=17.5, d2=9.5, c1=35.0, c2=19.01, pitch=0.00739, nadir1=nadir1, nadir2=nadir2)
    setup = SurveySetup(taking=taking, measuring=Measuring(unit="px"), **more)
    xyz = np.column_stack(
        [rng.uniform(-5, 5, rows), rng.uniform(-3, 3, rows), rng.uniform(-1, 1, rows)]
    )

    def pixels(c, d, nadir):
        mm = c * xyz[:, :2] / (d - xyz[:, 2:])
        return mm / [0.00739, -0.00739] + nadir + rng.normal(0, 0.5, (rows, 2))

    xy1, xy2 = pixels(35.0, 17.5, nadir1), pixels(19.01, 9.5, nadir2)
    polar = np.full((rows, 3), np.nan)
    xy2[3] += [15, -20]
    xy1[5], xy2[5] = nadir1, nadir2
    xy1[6] = np.nan
    xy1[10:13] = xy2[10:13] = np.nan
    polar[10:13] = [[13, 13.05, 200], [4, 6, 340], [14, 7, np.nan]]
    ids = [f"P{i}" for i in range(rows)]
    ids[:3] = ["7", "007", '=HYPERLINK("http://x")']
    code = [""] * rows
    code[14:17] = ["DOUBTFUL 2", " dubbio 1", "doubtless"]  # the first two were accepted in doubt
    points = PointObservations(
        ids=tuple(ids), xy1=xy1, xy2=xy2, polar=polar, code=code, note=("café\nline <&>",) * rows
    )
    table = solve_points(setup.pair(), setup.in_millimetres(points))
    nothing = np.nan
    known = KnownPoints(
        ids=("7", "007", "P4", "P8", "nowhere"),
        xyz=[[*xyz[0]], [nothing, nothing, xyz[1, 2]], [*xyz[4]], [*xyz[8]], [0, 0, 0]],
        use=[True, True, True, False, True],
    )
    chosen = [0, 4, 8, 15, 20, 25]
    turn = np.array([[np.cos(0.3), 0, np.sin(0.3)], [np.sin(0.3), 0, -np.cos(0.3)], [0, 1, 0]])
    if model == "3D":
        turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    world = xyz[chosen] @ turn.T * 1.0001 + [351234.0, 4123456.0, 33.0]
    world += rng.normal(0, 0.01, world.shape)
    world[3, 0] += 0.5
    if model == "2D":
        world[:, 2] = np.nan
    control = KnownPoints(ids=tuple(ids[i] for i in chosen), xyz=world)
    return SurveyContent(
        setup=setup,
        pair=setup.pair(),
        points=points,
        table=table,
        known=known,
        control=control,
        georeference=georeference(table, control),
        sensor=(22.7, 15.1),
    )


def pair_content(rows=60, principal_distance=None, lens=None, placed=False):
    rng = np.random.default_rng(9)
    first = np.array([[4e-3, 2e-4, -6.0], [1e-4, -4e-3, 4.0], [5e-6, 2e-6, 1.0]])
    second = np.array([[4e-3, -1e-4, -6.0], [3e-4, -4e-3, 4.0], [-3e-6, 2e-6, 1.0]])
    pair = Pair(
        image1=Photo(
            plane_from_pixel=first,
            nadir=np.array([0.4, -0.3]),
            distance=18.0,
            principal_distance=principal_distance,
        ),
        image2=Photo(plane_from_pixel=second, nadir=np.array([-0.2, 0.5]), distance=9.0, lens=lens),
    )
    xyz = np.column_stack(
        [rng.uniform(-5, 5, rows), rng.uniform(-3, 3, rows), rng.uniform(-1, 1, rows)]
    )
    pixels = [p + rng.normal(0, 0.4, p.shape) for p in pair.project(xyz)]
    pixels[0][7] += [30, 5]
    pixels[1][9] = np.nan
    points = PointObservations(
        ids=tuple(map(str, range(rows))), pixels1=pixels[0], pixels2=pixels[1]
    )
    if not placed:
        table = solve_points(pair, points, sigma_px=0.4)
        return SurveyContent(pair=pair, points=points, table=table, sigma_px=0.4)
    sigma = [1e-3, 1e-4, 3, 3, 1e-4, 1e-4, 1e-4, 0.01, 0.01, 0.02, 2e-3, 1e-3] * 2
    pair = replace(pair, orientation=np.diag(np.square(sigma)))
    table = solve_points(pair, points, sigma_px=0.4)
    rows = [0, 3, 12, 20, 33, 41, 55]
    control = KnownPoints(ids=tuple(map(str, rows)), xyz=xyz[rows] + [351234.0, 4123456.0, 33.0])
    world = georeference(table, control, model="3D")
    return SurveyContent(
        pair=pair, points=points, table=table, sigma_px=0.4, control=control, georeference=world,
        model="3D",
    )  # fmt: skip


@functools.cache
def written(make=ideal_content, *arguments):
    """Return the bytes of a new workbook: several tests look at the same one."""
    with tempfile.TemporaryDirectory() as folder:
        write_book(Path(folder, "r.xlsx"), make(*arguments))
        return Path(folder, "r.xlsx").read_bytes()


def of_turns(sheet, cell, cached):
    """Return relative and absolute tolerance: turns that solve the model 3D are worth 1e-9."""
    if sheet.title == "Points" and sheet.cell(4, cell.column).value in ("dx", "dy"):
        return 1e-12, 1e-11  # a difference of two places on the wall, in pixels
    if sheet.title == "Georeference" and sheet.cell(12, cell.column).value in LEFT_OUT:
        return 1e-9, 1e-12
    if sheet.title != "Georeference" or cell.column < LEFT or cell.row > 11:
        return 1e-12, 1e-12
    # Columns headed n: a difference of two sums that grow equal turn by turn.
    if not 3 <= cell.row <= 6 or sheet.cell(2, cell.column).value != "n":
        return 1e-9, 1e-12
    normal = [cached[sheet.title].cell(3 + i, cell.column - 8 + i).value for i in range(4)]
    return 1e-9, 1e-9 * max((value for value in normal if value), default=0.0)


def assert_recalculated_equals_cached(path, folder, worth=1e-12):
    """Compare all formulas with what LibreOffice calculates; return how many there are."""
    formulas = openpyxl.load_workbook(path)
    cached, fresh = openpyxl.load_workbook(path, data_only=True), recalculated(path, folder)
    count = 0
    for sheet in formulas:
        for row in sheet.iter_rows():
            for cell in row:
                if cell.data_type != "f":
                    continue
                count += 1
                ours = cached[sheet.title][cell.coordinate].value
                theirs = fresh[sheet.title][cell.coordinate].value
                where = f"{sheet.title}!{cell.coordinate} {cell.value}"
                if isinstance(ours, int | float) and isinstance(theirs, int | float):
                    limits = (max(worth, limit) for limit in of_turns(sheet, cell, cached))
                    rel, noise = limits
                    assert theirs == pytest.approx(ours, rel=rel, abs=noise), where
                else:
                    assert (theirs or None) == (ours or None), where
    return count


@pytest.mark.office
@pytest.mark.acceptance
@pytest.mark.parametrize("model", ["levelled", "3D", "2D"])
def test_every_formula_recalculated_by_libreoffice_equals_the_library(model, tmp_path):
    write_book(tmp_path / "ideal.xlsx", ideal_content(model=model))
    assert assert_recalculated_equals_cached(tmp_path / "ideal.xlsx", tmp_path) > 1500
    shown = rows_of(recalculated(tmp_path / "ideal.xlsx", tmp_path), "Points", 4)
    assert [row["flag"] == "UNCERTAIN" for row in shown[14:17]] == [True, True, False]
    assert all(row["sigma_r"] > 0.25 * 9.5 for row in shown[14:16])


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize(
    "principal_distance", [pytest.param(None, marks=pytest.mark.acceptance), 35.0]
)
def test_formulas_of_a_general_pair_equal_the_library(principal_distance, tmp_path):
    write_book(tmp_path / "pair.xlsx", pair_content(principal_distance=principal_distance))
    assert assert_recalculated_equals_cached(tmp_path / "pair.xlsx", tmp_path) > 2000


@pytest.mark.acceptance
@pytest.mark.office
def test_sigmas_in_the_world_of_an_uncertain_pair_equal_the_library(tmp_path):
    content = pair_content(placed=True)
    write_book(tmp_path / "pair.xlsx", content)
    assert assert_recalculated_equals_cached(tmp_path / "pair.xlsx", tmp_path) > 2000
    shown = recalculated(tmp_path / "pair.xlsx", tmp_path)["Results"]
    keys = [cell.value for cell in shown[4]]
    column = keys.index("sigma_H") + 1
    found = [shown.cell(5 + i, column).value for i in range(len(content.table))]
    known = np.array([np.nan if value in (None, "") else value for value in found])
    np.testing.assert_allclose(known, content.placed.sigma[:, 2], rtol=1e-9)


@pytest.mark.acceptance
@pytest.mark.office
def test_formulas_follow_pixels_freed_of_lens_distortion(tmp_path):
    lens = Lens(
        camera_matrix=np.array([[3000.0, 0, 1536], [0, 3000, 1024], [0, 0, 1]]),
        coefficients=np.array([-0.1, 0.02, 0, 0]),
        image_size=(3072, 2048),
    )
    write_book(tmp_path / "lens.xlsx", pair_content(lens=lens))
    assert assert_recalculated_equals_cached(tmp_path / "lens.xlsx", tmp_path) > 2000


@pytest.mark.acceptance
@pytest.mark.office
def test_long_tables_written_with_short_references_calculate_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr("bifocal.workbook.making.book.STRUCTURED_ROWS", 10)
    write_book(tmp_path / "long.xlsx", ideal_content())
    text = parts(tmp_path / "long.xlsx")["xl/worksheets/sheet3.xml"].decode()
    assert "#This Row" not in text
    # Each formula stands once, but not those that name other sheets: Excel shifts them wrongly.
    shared = re.findall(r'<f t="shared" si="\d+" ref="[A-Z]+6:[A-Z]+54">([^<]*)<', text)
    assert len(shared) > 20
    assert not any("!" in formula or "[" in formula for formula in shared)
    assert assert_recalculated_equals_cached(tmp_path / "long.xlsx", tmp_path) > 1500


@pytest.mark.acceptance
@pytest.mark.office
def test_an_empty_template_shows_no_error_anywhere(tmp_path):
    write_template(tmp_path / "empty.xlsx", rows=15)
    book = recalculated(tmp_path / "empty.xlsx", tmp_path)
    for sheet in book:
        if sheet.title == "Charts":
            continue  # blanks are #N/A there, so that charts leave them out
        for row in sheet.iter_rows():
            for cell in row:
                assert not str(cell.value).startswith(("#", "Err:")), f"{sheet.title} {cell}"


@pytest.mark.acceptance
@pytest.mark.office
def test_changing_an_input_changes_relief_in_libreoffice(tmp_path):
    fresh = recalculated(fill(tmp_path / "filled.xlsx"), tmp_path)
    row = rows_of(fresh, "Points", 4)[0]
    assert row["r"] == pytest.approx(1.0, abs=1e-12)
    assert row["X"] == pytest.approx(2.0, abs=1e-12)
    assert row["flag"] == "OK"
    assert fresh["Results"]["D5"].value == pytest.approx(1.0, abs=1e-12)


def test_cached_values_are_numbers_for_any_viewer():
    shown = rows_of(openpyxl.load_workbook(io.BytesIO(written()), data_only=True), "Points", 4)
    assert shown[0]["r"] == ideal_content().table["r"][0]


def test_a_formula_as_point_name_comes_out_as_text():
    cell = openpyxl.load_workbook(io.BytesIO(written()))["Points"]["A7"]
    assert cell.data_type == "s"
    assert cell.value == '=HYPERLINK("http://x")'


@pytest.mark.parametrize("make", [ideal_content, pair_content])
def test_results_have_no_fault_that_makes_excel_repair_them(make, tmp_path):
    (tmp_path / "r.xlsx").write_bytes(written(make))
    assert lint(tmp_path / "r.xlsx") == []


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"must end in \.xlsx"):
        write_template(tmp_path / "survey.ods")


def test_rows_are_prepared_as_many_as_wanted(tmp_path):
    write_template(tmp_path / "t.xlsx", rows=50)
    sheet = openpyxl.load_workbook(tmp_path / "t.xlsx")["Points"]
    assert sheet.tables["tblPoints"].ref.endswith("54")
    assert sheet["L54"].data_type == "f"
    with pytest.raises(InputError, match="rows"):
        write_template(tmp_path / "u.xlsx", rows=0)


def test_unknown_language_is_refused(tmp_path):
    with pytest.raises(InputError, match="fr"):
        write_template(tmp_path / "survey.xlsx", language="fr")


@pytest.mark.acceptance
@pytest.mark.office
def test_planning_of_a_pair_without_focal_lengths_follows_when_they_are_typed(tmp_path):
    write_book(tmp_path / "pair.xlsx", pair_content())
    book = openpyxl.load_workbook(tmp_path / "pair.xlsx")
    named(book, "sensor_w").value, named(book, "sensor_h").value = 22.7, 15.1
    book.save(tmp_path / "sensor.xlsx")
    before = recalculated(tmp_path / "sensor.xlsx", tmp_path)
    assert named(before, "covered_w").value in (None, "")
    # The homographies of `pair_content` have 4 mm per pixel, more or less.
    assert named(before, "gsd_mm").value == pytest.approx(4.0, abs=0.3)
    named(book, "c_1").value, named(book, "c_2").value = 36.0, 18.0
    book.save(tmp_path / "typed.xlsx")
    after = recalculated(tmp_path / "typed.xlsx", tmp_path)
    assert named(after, "covered_w").value == pytest.approx(22.7 * 18 / 36)
    radii = [
        [book["Planning"][f"C{row}"].value for row in range(12, 19)] for book in (before, after)
    ]
    assert radii[1] == pytest.approx(radii[0], rel=1e-9)
    assert radii[0][0] > 0
    # Nothing about the points has changed, although they are now counted at another image scale.
    keys = [cell.value for cell in before["Points"][4]]
    for key in ("flag", "r", "sigma_r", "X"):
        shown = [
            [book["Points"].cell(row, keys.index(key) + 1).value for row in range(5, 65)]
            for book in (before, after)
        ]
        if key == "flag":
            assert shown[1] == shown[0]
            assert {"OK", "OFF-RADIAL"} <= set(shown[0])
        else:
            number = [[v for v in column if isinstance(v, float)] for column in shown]
            assert number[1] == pytest.approx(number[0], rel=1e-9)
