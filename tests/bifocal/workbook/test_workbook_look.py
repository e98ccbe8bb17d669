"""The survey workbook as its user sees it: on the screen, on paper, in three languages."""

from __future__ import annotations

import functools
import io
import re

import openpyxl
import pytest
from openpyxl.utils import range_boundaries

from bifocal import SurveySetup, Taking
from bifocal.workbook.content import SurveyContent
from bifocal.workbook.making.book import build
from bifocal.workbook.template_workflow import write_template
from bifocal.workbook.words import WORDS
from tests.bifocal.workbook.filled_forms import fill, form, named, rows, run
from tests.bifocal.workbook.test_cli_solve import DISTANCES, as_file
from tests.bifocal.workbook.test_survey_workbook import ideal_content, pair_content, parts, written
from tests.cases import few_by_default
from tests.recalculate import recalculated
from tests.workbook_page import dimension, printed_columns, scale_of, sizes_of

LANGUAGES = ("en", "it", "de")


@functools.cache
def opened(name, **how):
    """Return a workbook: a form in a language, a survey, a pair."""
    make = {"ideal": (ideal_content, 26), "pair": (pair_content, 20)}.get(name)
    data = written(*make) if make else form("--rows", 30, "--lang", name)
    return openpyxl.load_workbook(io.BytesIO(data), **how)


NAMES = few_by_default([*LANGUAGES, "ideal", "pair"], "en", "ideal", "pair")


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_under_8_pt_on_paper(name):
    for sheet in opened(name):
        assert min(sizes_of(sheet)) >= 8, (sheet.title, scale_of(sheet))
        assert sheet.page_setup.paperSize == 9
        assert sheet.oddFooter.center.text == "&D"
        assert sheet.oddFooter.right.text.endswith("&P / &N")


@pytest.mark.parametrize("name", NAMES)
def test_all_sheets_have_one_face_and_one_scale_of_sizes(name):
    cells = [cell for sheet in opened(name) for row in sheet.iter_rows() for cell in row]
    assert {cell.font.name for cell in cells} == {"Arial"}
    assert {cell.font.sz for cell in cells} == {9, 10, 14}


@pytest.mark.parametrize("language", few_by_default(LANGUAGES, "de"))
def test_no_word_of_a_heading_is_broken_and_no_description_is_cut(language):
    book = openpyxl.load_workbook(io.BytesIO(form("--rows", 30, "--lang", language)))
    tables = [(sheet, table.ref) for sheet in book for table in sheet.tables.values()]
    assert min(size for page in book for size in sizes_of(page)) >= 8
    for page, area in tables:
        first, head, last, _ = range_boundaries(area)
        for column in range(first, last + 1):
            above = page.cell(head - 1, column)
            size = page.column_dimensions[above.column_letter]
            assert size.hidden or size.width >= max(map(len, above.value.split())), above.value
            assert "|" not in above.value or "\n[" in above.value
    # Arial's letters are some 0.83 of a digit wide on average.
    room = book["Setup"].column_dimensions["B"].width
    assert max(len(cell.value or "") for cell in book["Setup"]["B"]) * 0.83 <= room


def test_results_are_one_page_for_a_client():
    sheet = opened("ideal")["Results"]
    assert sheet.print_area == "'Results'!$A$1:$O$30"
    assert sheet.print_title_rows == "$3:$4"
    assert sheet.page_setup.orientation == "landscape"
    rows = [sheet.row_dimensions[r].height or 13.5 for r in range(1, 31)]
    paper = 595.3 - 72 * (sheet.page_margins.top + sheet.page_margins.bottom)
    assert sum(rows) * scale_of(sheet) < paper
    values = opened("ideal", data_only=True)["Results"]
    for words in ("Project:", "Client:"):
        assert words in values["A2"].value
    assert "Date:" in values["E2"].value
    assert "metres" in values["J2"].value


@pytest.mark.parametrize("name", NAMES)
def test_no_chart_is_cut_by_the_end_of_a_page(name):
    sheet = opened(name)["Charts"]
    assert not sheet.sheet_properties.pageSetUpPr.fitToPage  # programs then go by no break
    (end,) = (line.id for line in sheet.row_breaks.brk)
    height = {row: sheet.row_dimensions[row].height or 13.5 for row in range(1, 116)}
    paper = 841.9 - 72 * (sheet.page_margins.top + sheet.page_margins.bottom)
    for printed in (range(1, end + 1), range(end + 1, 116)):
        assert sum(height[row] for row in printed) * scale_of(sheet) < paper
    above = 0.0
    for chart in sorted(sheet._charts, key=lambda chart: chart.anchor._from.row):
        first = chart.anchor._from.row
        assert sum(height[row] for row in range(1, first + 1)) - above > 9  # a gap between charts
        bottom = sum(height[row] for row in range(1, first + 1)) + chart.anchor.ext.height / 12700
        on_first = first < end
        above = bottom
        assert (bottom < sum(height[row] for row in range(1, end + 1))) == on_first
        assert first > end or on_first  # not on the break itself, where its edge would show


def test_forms_print_no_page_after_page_of_headings(tmp_path):
    write_template(tmp_path / "t.xlsx", photos=3, what_if=True, rows=28)
    book = openpyxl.load_workbook(tmp_path / "t.xlsx")
    assert book["Compare"].page_setup.fitToHeight == 1
    assert book["WhatIf"].print_area == "'WhatIf'!$A$1:$V$58"


def test_the_title_block_says_what_is_typed_on_setup():
    block = {"project": "Palazzo Nuovo", "surveyor": "Ada", "survey_date": "3 May 2026"}
    built = build(ideal_content(26, title_block=block))
    assert built.value_of("title_project").startswith("Project: Palazzo Nuovo\nClient: \n")
    assert built.value_of("title_survey").startswith("Surveyed by: Ada\nDate: 3 May 2026\n")


@pytest.mark.parametrize("name", NAMES)
def test_points_break_between_columns_that_fit_the_page(name):
    sheet = opened(name)["Points"]
    ends = [brk.id for brk in sheet.col_breaks.brk] + [printed_columns(sheet)[-1]]
    paper = (841.9 - 72 * 0.8) / scale_of(sheet)
    before = 1
    for end in ends:
        columns = [1, *(c for c in printed_columns(sheet) if before < c <= end)]
        assert sum(dimension(sheet, c).width * 5.56 for c in columns) <= paper
        before = end
    assert sheet.print_title_cols == "$A:$A"


@pytest.mark.parametrize("name", NAMES)
def test_the_rows_to_fill_in_are_reachable_on_a_laptop(name):
    for sheet in opened(name):
        if sheet.freeze_panes is None:
            continue
        frozen = openpyxl.utils.cell.coordinate_from_string(sheet.freeze_panes)[1] - 1
        heights = [sheet.row_dimensions[r].height or 13.5 for r in range(1, frozen + 1)]
        # A laptop of 768 lines shows about 360 pt of a sheet.
        assert sum(heights) < 200, sheet.title


@pytest.mark.parametrize("name", NAMES)
def test_steps_of_the_fit_are_folded_away_and_no_yellow_cell_is_without_a_word(name):
    book = opened(name)
    sheet = book["Georeference"]
    shown = {"g_model", "g_auto", "g_used", "g_n", "g_k", "g_sigma0", "g_alpha"}
    shown |= {f"g_{axis}0" for axis in "XYZENH"} | {f"g_{i}{j}" for i in "123" for j in "123"}
    steps = [key for key in book.defined_names if key[:2] in ("g_", "s3") and key not in shown]
    assert len(steps) > 100
    for key in steps:
        left, top, right, bottom = named_area(book, key)
        for column in range(left, right + 1):
            assert dimension(sheet, column).hidden, key
            for row in range(top, bottom + 1):
                fill = sheet.cell(row, column).fill
                assert not fill.fgColor.rgb.endswith("FFF9DB"), key
    for key in shown:
        assert not dimension(sheet, named(book, key).column).hidden, key


def test_steps_of_the_fit_fit_their_columns_once_unfolded():
    book, values = opened("ideal"), opened("ideal", data_only=True)
    sheet = book["Georeference"]
    seen = 0
    for row in sheet.iter_rows(max_row=11):
        for cell in row:
            if not sheet.column_dimensions[cell.column_letter].hidden or cell.data_type != "f":
                continue
            assert cell.number_format == "0.00E+00", cell.coordinate
            value = values["Georeference"][cell.coordinate].value
            if isinstance(value, int | float):
                seen += 1
                assert len(f"{value:.2E}") < sheet.column_dimensions[cell.column_letter].width
    assert seen > 20


def test_units_stand_apart_from_their_values():
    sheet = opened("en")["Setup"]
    units = [cell for row in sheet.iter_rows(min_col=4, max_col=4) for cell in row if cell.value]
    assert len(units) > 5
    assert {(c.alignment.horizontal, c.alignment.indent) for c in units} == {("left", 1)}


def inputs(sheet):
    """Return the cells that may be typed into and where what they say is defined."""
    said = {}
    for rule in sheet.data_validations.dataValidation:
        for area in rule.sqref.ranges:
            left, top, right, bottom = range_boundaries(str(area))
            for row in range(top, bottom + 1):
                for column in range(left, right + 1):
                    assert (row, column) not in said, "two rules for one cell"
                    said[row, column] = rule
    cells = [c for row in sheet.iter_rows() for c in row if not c.protection.locked]
    return cells, said


@pytest.mark.parametrize("name", NAMES)
def test_every_input_cell_says_what_it_wants(name):
    count = 0
    for sheet in opened(name):
        cells, said = inputs(sheet)
        for cell in cells:
            rule = said.get((cell.row, cell.column))
            assert rule is not None, (sheet.title, cell.coordinate)
            assert rule.showInputMessage, (sheet.title, cell.coordinate)
            assert 3 < len(rule.prompt) <= 255, (sheet.title, cell.coordinate)
            assert rule.type is None or rule.error, (sheet.title, cell.coordinate)
            count += 1
    assert count > 200


def test_prompts_are_in_the_language_of_the_workbook():
    prompts = {}
    for code in LANGUAGES:
        book = opened(code)
        prompts[code] = {r.prompt for s in book for r in s.data_validations.dataValidation}
    assert any("numero" in p or "punto" in p.lower() for p in prompts["it"])
    assert len(prompts["en"] & prompts["de"]) < 8
    assert len(prompts["en"] & prompts["it"]) < 8


STATES = [
    ({}, "Still missing: d_2, delta_d, c_1, c_2"),
    ({"d1": 17.5, "d2": 9.5}, "Still missing: c_1, c_2"),
    ({"d1": 17.5, "d2": 9.5, "c1": 35.0, "c2": 19.0}, "The set-up is complete."),
    ({"d1": 17.5, "d2": 9.5, "c1": 35.0, "c2": 20.0}, "The scales c_1/d_1 and c_2/d_2 differ"),
]


@pytest.mark.parametrize(("given", "told"), STATES)
def test_setup_says_in_one_line_what_is_missing_or_wrong(given, told):
    setup = SurveySetup(taking=Taking(**given)) if given else None
    content = SurveyContent(setup=setup, pair=setup and setup.pair(), rows=3)
    built = build(content)
    assert built.book.defined_names["setup_state"].attr_text == "'Setup'!$A$3"
    assert built.value_of("setup_state").startswith(told)


@pytest.mark.acceptance
@pytest.mark.office
def test_the_sheet_itself_finds_swapped_distances_and_unequal_scales(tmp_path):
    write_template(tmp_path / "form.xlsx", rows=3)
    book = openpyxl.load_workbook(tmp_path / "form.xlsx")
    typed = {"c_1": 35, "c_2": 21, "d_2": 17.5, "d_1": 9.5, "input_unit": "px"}
    for name, value in typed.items():
        named(book, name).value = value
    book.save(tmp_path / "typed.xlsx")
    fresh = recalculated(tmp_path / "typed.xlsx", tmp_path)
    missing = "pitch, nadir_1_col ... nadir_2_row"
    assert named(fresh, "setup_missing").value == missing
    assert named(fresh, "setup_state").value == f"Still missing: {missing}"
    assert named(fresh, "check_order").value == "CHECK"
    assert named(fresh, "check_scale").value == "CHECK"


@pytest.mark.parametrize("name", ["ideal", "pair"])
def test_a_point_that_is_not_used_keeps_no_green_ok(name):
    book = opened(name)
    area = named_area(book, "points_use")
    for title in ("Points", "Results"):
        sheet = book[title]
        flag = [cell.value for cell in sheet[4]].index("flag") + 1
        letter = openpyxl.utils.get_column_letter(flag)
        rules = [
            (rule.priority, rule, str(cells.sqref))
            for cells in sheet.conditional_formatting
            for rule in cells.rules
        ]
        first = min(rules, key=lambda found: found[0])
        assert f":{letter}" in first[2] or title == "Results"
        assert first[2].startswith("A5:")
        assert first[1].stopIfTrue
        assert first[1].dxf.font.strike
        assert first[1].dxf.fill.bgColor.rgb.endswith("FFFFFF")
        assert "=0" in first[1].formula[0]
    keys = [cell.value for cell in book["Points"][4]]
    assert area[0] == keys.index("use") + 1
    assert area[1] == 5


def named_area(book, name):
    """Return the bounds of a named area."""
    return range_boundaries(book.defined_names[name].attr_text.partition("!")[2].replace("$", ""))


@pytest.fixture
def solved(tmp_path):
    """Return a survey workbook of 12 points made from a text table."""
    points = [(f"P{i}", 0.7 * (i % 8) - 2.4, 0.9 * (i % 5) - 1.7, 0.2 * (i % 3)) for i in range(12)]
    table, path = [("id", "x1", "y1", "x2", "y2"), *rows(points)], tmp_path / "s.xlsx"
    result = run("solve", as_file(table, tmp_path / "points.csv"), "--out", path, *DISTANCES)
    assert result.exit_code == 0, result.stderr
    return path


def test_the_sketch_is_small_and_stays_when_the_workbook_is_solved_in_place(solved):
    before = parts(solved)
    name = next(part for part in before if "sketch" in part)
    text = before[name].decode()
    assert len(text) < 40_000
    symbols = "".join(re.findall(r"<a:t>([^<]*)</a:t>", text))
    for symbol in ("c1", "c2", "d1", "d2", "s1", "s2", "e1", "r", "nadir", "Δd"):
        assert symbol in symbols
    colours = set(re.findall(r'srgbClr val="(\w+)"', text))
    assert {"0072B2", "D55E00", "009E73"} <= colours  # Okabe and Ito
    rels = before["xl/worksheets/_rels/sheet1.xml.rels"].decode()
    assert f'Target="/{name}"' in rels
    solve(solved, "--d1", "17.6")
    after = parts(solved)
    for part in (name, "xl/worksheets/sheet1.xml", "xl/worksheets/_rels/sheet1.xml.rels"):
        assert after[part] == before[part]


@pytest.fixture
def filled(tmp_path):
    """Return a template of 20 rows with 40 typed points."""
    points = [(f"P{i}", 0.7 * (i % 8) - 2.4, 0.9 * (i % 5) - 1.7, 0.3) for i in range(40)]
    return fill(tmp_path / "filled.xlsx", rows(points))


def solve(path, *options):
    result = run("solve", path, "--out", path, "--overwrite", "-q", *options)
    assert result.exit_code == 0, result.stderr


def test_the_printed_rows_follow_the_points_and_all_rows_are_seen(filled):
    solve(filled, "--lang", "it")
    book = openpyxl.load_workbook(filled)
    assert book["Results"].print_area == "'Results'!$A$1:$O$44"
    assert book["Points"].print_area == "'Points'!$A$3:$AY$44"
    assert book["Points"]["E1"].value.startswith('=IF(COUNTA(tblPoints[id])>40,"Altri punti')
    assert "Mancano ancora" in book["Setup"]["A3"].value
    light = openpyxl.load_workbook(filled, read_only=True, data_only=True)
    rows = list(light["Points"].iter_rows(min_row=5, values_only=True))
    assert [row[0] for row in rows[:40]] == [f"P{i}" for i in range(40)]
    assert len(list(light["Results"].iter_rows(min_row=5, max_row=44))) == 40


def test_a_print_area_of_the_users_own_stays(filled):
    book = openpyxl.load_workbook(filled)
    book["Results"].print_area = "A1:G12"
    book.save(filled)
    solve(filled)
    book = openpyxl.load_workbook(filled)
    assert book["Results"].print_area == "'Results'!$A$1:$G$12"


@pytest.mark.parametrize("name", NAMES)
def test_every_sheet_says_how_far_it_reaches(name):
    book, light = opened(name), opened(name, read_only=True)
    for sheet in book:
        assert light[sheet.title].max_row == sheet.max_row, sheet.title
        assert light[sheet.title].max_column == sheet.max_column, sheet.title


def test_rows_added_in_place_widen_what_the_sheet_says(solved):
    book = openpyxl.load_workbook(solved)
    sheet = book["Points"]
    for row in range(17, 45):
        sheet.cell(row, 1).value = f"Q{row}"
        for column in range(2, 6):
            sheet.cell(row, column).value = sheet.cell(5, column).value
    book.save(solved)
    solve(solved)
    light = openpyxl.load_workbook(solved, read_only=True, data_only=True)
    for title in ("Points", "Results"):
        assert light[title].max_row >= 44
        assert light[title].cell(44, 1).value == "Q44"


def test_the_first_sheet_says_the_same_line_by_line_in_every_language():
    """Another language takes the place of each line where it stands."""
    for section in ("readme", "readme_hand", "readme_media"):
        texts = [str(text).splitlines() for text in WORDS.content[section].values()]
        kinds = [[line[:1] if line[:1] in ("#", "{") else "" for line in lines] for lines in texts]
        assert len(texts) == 3
        assert kinds[0] == kinds[1] == kinds[2]
