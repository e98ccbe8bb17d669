"""Results put into the surveyor's own workbook: formulas fresh, everything else untouched."""

from __future__ import annotations

from functools import partial

import openpyxl
import pytest
from openpyxl.drawing.image import Image
from PIL import Image as Picture

from bifocal import solve
from bifocal.workbook.formulas.columns import FORMULAS, results_columns
from bifocal.workbook.making import book as making
from bifocal.workbook.template_workflow import write_template
from tests.bare_workbook import parts, with_parts
from tests.bifocal.workbook.filled_forms import POINTS, SETUP, fill, put, rows, run, write_csv
from tests.bifocal.workbook.test_survey_workbook import (
    assert_recalculated_equals_cached,
    named,
)

#: Heights a millimetre off: the residuals of exact points are rounding, which has no equal.
WORLD = [
    (name, 1000 + x, 2000 - r, 50 + y + (-1) ** i / 1000)
    for i, (name, x, y, r) in enumerate(POINTS)
]
CHECKS = [("P1", 2.012, None, 1.005), ("P2", None, None, 0.497), ("P8", 1, 1, 1)]


def survey(path, **more):
    return fill(path, Check=CHECKS, Georeference=WORLD, **more)


@pytest.mark.acceptance
@pytest.mark.office
def test_results_in_the_users_workbook_equal_its_formulas(tmp_path):
    out = tmp_path / "out.xlsx"
    result = run("solve", survey(tmp_path / "s.xlsx"), "--out", out)
    assert result.exit_code == 0, result.stderr
    assert_recalculated_equals_cached(out, tmp_path)
    sheet = openpyxl.load_workbook(out, data_only=True)["Results"]
    assert sheet["D5"].value == pytest.approx(1.0)
    assert sheet["E5"].value == pytest.approx(1002.0)


@pytest.mark.acceptance
@pytest.mark.office
def test_numbers_typed_as_text_become_numbers_so_that_formulas_see_them(tmp_path):
    path = survey(tmp_path / "s.xlsx")
    book = openpyxl.load_workbook(path)
    book["Points"]["B5"], book["Check"]["D13"] = "4,2424", "1,0052"
    put(book, "d_2", "9,5")
    book.save(path)
    out = tmp_path / "out.xlsx"
    result = run("solve", path, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert_recalculated_equals_cached(out, tmp_path)
    fresh = openpyxl.load_workbook(out)
    assert [fresh["Points"]["B5"].value, fresh["Check"]["D13"].value] == [4.2424, 1.0052]
    assert fresh["Setup"]["C7"].value == 9.5
    assert "Points!B5, Setup!C7, Check!D13: numbers typed as text" in result.stderr


@pytest.mark.acceptance
@pytest.mark.office
def test_swapped_images_keep_the_columns_the_user_typed(tmp_path):
    swapped = [(name, x2, y2, x1, y1) for name, x1, y1, x2, y2 in rows(POINTS)]
    setup = {"c_1": 19, "c_2": 35, "d_1": 9.5, "d_2": 17.5}
    out = tmp_path / "out.xlsx"
    path = survey(tmp_path / "s.xlsx", table=swapped, setup=setup)
    assert run("solve", path, "--out", out).exit_code == 0
    assert_recalculated_equals_cached(out, tmp_path)
    assert openpyxl.load_workbook(out)["Points"]["B5"].value == swapped[0][1]


@pytest.mark.acceptance
@pytest.mark.office
def test_a_survey_in_pixels_of_a_pair_is_updated_too(tmp_path):
    from tests.bifocal.workbook.test_cli_solve import pixel_rows, write_pair

    pair, first = write_pair(tmp_path / "w.pair.json"), tmp_path / "first.xlsx"
    points = write_csv(tmp_path / "p.csv", pixel_rows())
    assert run("solve", points, "--pair", pair, "--out", first, "--sigma-px", 0.4).exit_code == 0
    book = openpyxl.load_workbook(first)
    book["Points"]["B5"] = book["Points"]["B5"].value + 3.0
    book["Points"]["C5"] = book["Points"]["C5"].value + 1.0
    book.save(first)
    out = tmp_path / "out.xlsx"
    result = run("solve", first, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert "new workbook" not in result.stderr
    assert_recalculated_equals_cached(out, tmp_path)


@pytest.mark.acceptance
def test_what_the_user_added_stays_byte_for_byte(tmp_path):
    path = survey(tmp_path / "s.xlsx")
    book = openpyxl.load_workbook(path)
    Picture.new("RGB", (40, 30), "red").save(tmp_path / "red.png")
    mine = book.create_sheet("My notes")
    mine["A1"], mine["A2"] = "north side", "=1+1"
    mine.add_image(Image(str(tmp_path / "red.png")), "C3")
    book["Points"]["AF5"] = "my own column"
    book.save(path)
    out = tmp_path / "out.xlsx"
    assert run("solve", path, "--out", out).exit_code == 0
    before, after = parts(path), parts(out)
    assert list(before) == list(after)
    changed = {name for name in before if before[name] != after[name]}
    sheets = {f"xl/worksheets/sheet{i}.xml" for i in range(1, 10)}  # Readme to Log
    # The title of our own chart of arrows says how often they are enlarged.
    ours = {"xl/charts/chart5.xml", "xl/tables/table10.xml", "xl/workbook.xml"}
    assert changed <= sheets | ours
    assert openpyxl.load_workbook(out)["Points"]["AF5"].value == "my own column"


@pytest.mark.acceptance
def test_macros_stay_in_a_macro_workbook(tmp_path):
    path, macro = survey(tmp_path / "s.xlsx"), tmp_path / "s.xlsm"
    kinds = parts(path)["[Content_Types].xml"].replace(
        b"openxmlformats-officedocument.spreadsheetml.sheet.main+xml",
        b"ms-excel.sheet.macroEnabled.main+xml",
    )
    own = {"[Content_Types].xml": kinds, "xl/vbaProject.bin": b"MACROS" * 50}
    with_parts(path, own, macro)
    out = tmp_path / "out.xlsm"
    result = run("solve", macro, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert parts(out)["xl/vbaProject.bin"] == b"MACROS" * 50


def test_solving_again_changes_nothing_but_the_log(tmp_path):
    first, second = tmp_path / "1.xlsx", tmp_path / "2.xlsx"
    assert run("solve", survey(tmp_path / "s.xlsx"), "--out", first).exit_code == 0
    assert run("solve", first, "--out", second).exit_code == 0
    a, b = parts(first), parts(second)
    log = {"xl/worksheets/sheet9.xml", "xl/tables/table10.xml"}
    assert {name for name in a if a[name] != b[name]} <= log


def test_a_workbook_open_in_a_spreadsheet_program_is_not_touched(tmp_path):
    path = survey(tmp_path / "s.xlsx")
    (tmp_path / "~$s.xlsx").write_bytes(b"")
    result = run("solve", path, "--out", path, "--overwrite")
    assert result.exit_code == 1
    assert "open in Excel" in result.stderr


@pytest.mark.acceptance
def test_limits_typed_in_setup_decide_the_flags(tmp_path):
    path = survey(tmp_path / "s.xlsx")
    book = openpyxl.load_workbook(path)
    put(book, "k_plane", 500)
    book.save(path)
    out = tmp_path / "out.xlsx"
    assert run("solve", path, "--out", out).exit_code == 0
    flags = openpyxl.load_workbook(out, data_only=True)["Results"]
    assert flags["N5"].value == "ON-PLANE"
    assert SETUP["c_1"] == 35


def test_sentences_that_an_older_version_wrote_are_no_changes_by_hand(tmp_path):
    path = fill(tmp_path / "s.xlsx")
    book = openpyxl.load_workbook(path)
    named(book, "title_world").value = "=world_state"
    for name in ("site_state", "tape_from", "tape_typed", "check_state", "points_state"):
        del book.defined_names[name]
    book.save(path)
    found = run("solve", path, "--out", path, "--overwrite")
    assert "changed by hand" not in found.stderr
    shown = openpyxl.load_workbook(path, data_only=True)
    assert not named(shown, "title_world").value


def test_a_workbook_whose_points_lack_sigmas_of_the_world_keeps_its_own_formulas(
    tmp_path, monkeypatch
):
    path = tmp_path / "s.xlsx"
    with monkeypatch.context() as older:
        listed = FORMULAS.content["rows"]
        older.setitem(listed, "near", listed["near"][:2])
        older.setattr(making, "results_columns", partial(results_columns, older=True))
        write_template(path, rows=2)
    fill(path, template=path, Georeference=WORLD)
    found = run("solve", path, "--out", path, "--overwrite")
    assert "changed by hand" not in found.stderr
    formulas = openpyxl.load_workbook(path)["Results"]
    shown, solved = openpyxl.load_workbook(path, data_only=True)["Results"], solve(path)
    for row in (5, 8):
        assert "g_z_E" in str(formulas.cell(row, 11).value)
        sigmas = [shown.cell(row, column).value for column in (11, 12, 13)]
        assert sigmas == pytest.approx(solved.world_sigma[row - 5], rel=1e-9)


def test_a_number_typed_as_text_becomes_one_and_a_name_of_digits_stays_text(tmp_path):
    path = fill(tmp_path / "s.xlsx", [("007", 4.2424, 0, 4.4706, 0), ("B", 3.0, 1, 3.1, 1)])
    book = openpyxl.load_workbook(path)
    book["Points"]["B5"], book["Points"]["E5"] = "4,2424", "0,5"
    book.save(path)
    result = run("solve", path, "--out", path, "--overwrite")
    assert result.exit_code == 0, result.stderr
    sheet = openpyxl.load_workbook(path)["Points"]
    assert [sheet[cell].value for cell in ("A5", "B5", "E5", "A6")] == ["007", 4.2424, 0.5, "B"]
