"""Survey workbooks of many rows: short formulas, few seconds, never more than is read again."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile

import numpy as np
import openpyxl
import pytest
from openpyxl.workbook.defined_name import DefinedName

from bifocal import Pair, PointObservations
from bifocal.workbook import workflow
from bifocal.workbook.changing import update
from bifocal.workbook.content import SPARE_ROWS
from bifocal.workbook.making import book
from bifocal.workbook.template_workflow import MOST_ROWS, write_survey, write_template
from photocore.workbook.reading import package
from tests.bifocal.workbook.filled_forms import POINTS, fill, rows, run
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached


def test_the_largest_workbook_that_is_written_is_read_again(tmp_path, monkeypatch):
    monkeypatch.setattr(book, "STRUCTURED_ROWS", 10)
    path, count = tmp_path / "s.xlsx", 200
    write_many(path, count)
    with zipfile.ZipFile(path) as written:
        sizes = [info.file_size for info in written.infolist()]
    # Half of what is allowed is left for longer names and notes, and for lenses.
    assert max(sizes) / count * MOST_ROWS < package.LARGEST_PART
    assert sum(sizes) / count * MOST_ROWS < package.LARGEST_TOTAL


def test_formulas_of_long_books_stand_once_in_the_file(tmp_path, monkeypatch):
    monkeypatch.setattr(book, "STRUCTURED_ROWS", 10)
    write_many(tmp_path / "s.xlsx", 12)
    written = openpyxl.load_workbook(tmp_path / "s.xlsx")
    with zipfile.ZipFile(tmp_path / "s.xlsx") as package:
        results = package.read("xl/worksheets/sheet4.xml").decode()
    texts = re.findall(r"<f[^>]*>([^<]+)</f>", results)
    columns, last = len(written["Results"].tables["tblResults"].tableColumns), 4 + 12 + SPARE_ROWS
    # The first row's, the second's for all below it, and the title block.
    assert len(texts) < 2 * columns + 5
    assert results.count('<f t="shared"') == (last - 5) * columns
    # Upper and lower case are alike in names.
    names = [name.casefold() for name in written.defined_names]
    assert len({*names}) == len(names)
    column = next(cell.column_letter for cell in written["Points"][4] if cell.value == "X")
    place = f"'Points'!${column}$5:${column}${last}"
    assert written.defined_names["points_X"].attr_text == place


def with_rows_below(path, *, own_name=""):
    """Write a form of three rows with more points below its table."""
    write_template(path, rows=3)
    filled = openpyxl.load_workbook(fill(path, template=path))
    if own_name:
        filled.defined_names[own_name] = DefinedName(own_name, attr_text="'Readme'!$A$1")
    filled.save(path)
    result = run("solve", path, "--out", path, "--overwrite")
    assert result.exit_code == 0, result.stderr
    return openpyxl.load_workbook(path)


@pytest.mark.parametrize("own_name", ["", "points_X"])
def test_names_of_columns_grow_with_their_table_and_are_no_others(tmp_path, monkeypatch, own_name):
    monkeypatch.setattr(update, "STRUCTURED_ROWS", 3)
    if not own_name:
        monkeypatch.setattr(book, "STRUCTURED_ROWS", 2)
    cells = with_rows_below(tmp_path / "s.xlsx", own_name=own_name)
    place = cells.defined_names["points_X"].attr_text.replace("'", "")
    last = 4 + len(rows(POINTS))
    x = next(
        c.value for c in cells["Results"][last] if "_X" in str(c.value) or "[X]" in str(c.value)
    )
    if own_name:
        assert place == "Readme!$A$1"
        assert "tblPoints[X]" in x
    else:
        assert place.startswith("Points!$")
        assert place.endswith(f"${last}")
        assert "points_X" in x


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("named", [True, False])
def test_rows_added_to_a_large_table_get_short_formulas(tmp_path, monkeypatch, named):
    monkeypatch.setattr(update, "STRUCTURED_ROWS", 3)
    if named:  # not in a book of an older version
        monkeypatch.setattr(book, "STRUCTURED_ROWS", 2)
    path = tmp_path / "s.xlsx"
    written = with_rows_below(path)
    last = 4 + len(rows(POINTS))
    for sheet in ("Points", "Results"):
        cells = written[sheet]
        texts = [str(cell.value) for cell in cells[last] if str(cell.value).startswith("=")]
        assert texts
        assert not any("[#" in text for text in texts)
    assert_recalculated_equals_cached(path, tmp_path)


def write_many(path, count):
    """Write a survey of random points in raw pixels."""
    pair = Pair.ideal(d1=17.5, d2=9.5, c1=35.0, c2=19.0, pixel_size=0.004)
    xyz = np.random.default_rng(7).uniform((-5, -3, -1), (5, 3, 1), (count, 3))
    pixels1, pixels2 = pair.project(xyz)
    ids = tuple(f"P{i}" for i in range(count))
    points = PointObservations(ids=ids, pixels1=pixels1, pixels2=pixels2)
    write_survey(path, points, pair=pair, overwrite=True)
    return xyz


#: Solves points into a workbook, then says what memory that took. [kB] What `resource` says
#: includes that of the process that began this one.
_BOOK = """
import re, sys
from bifocal import Measuring, Taking
from bifocal.workbook import workflow
from bifocal.workbook.output import write_result
picks, book, *sigma_px = sys.argv[1:]
if picks == book:
    survey = workflow.solve(picks, measuring=Measuring(sigma_px=float(*sigma_px)))
else:
    survey = workflow.solve(picks, taking=Taking(d1=17.5, d2=9.5, c1=35, c2=19))
write_result(book, survey, overwrite=True)
print(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
"""


def memory(picks, book, *sigma_px):
    """Return the memory that it took to solve picks into a workbook. [kB]"""
    command = [sys.executable, "-c", _BOOK, *map(str, (picks, book, *sigma_px))]
    return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


@pytest.mark.acceptance
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for its memory")
def test_a_new_book_of_twenty_thousand_rows_takes_little_memory(tmp_path):
    x, y, r = np.random.default_rng(1).uniform((-5, -3, -0.5), (5, 3, 0.5), (20_000, 3)).T
    seen = [35 * x / (17.5 - r), 35 * y / (17.5 - r), 19 * x / (9.5 - r), 19 * y / (9.5 - r)]
    picks, path = tmp_path / "picks.csv", tmp_path / "new.xlsx"
    lines = [
        f"P{i}," + ",".join(map("{:.4f}".format, row)) for i, row in enumerate(np.array(seen).T)
    ]
    picks.write_text("\n".join(["id,x1,y1,x2,y2", *lines]))
    assert memory(picks, path) < 280_000
    assert path.stat().st_size < 16e6


@pytest.mark.acceptance
@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for its memory")
def test_twenty_thousand_rows_are_changed_in_place_in_little_memory(tmp_path):
    path = tmp_path / "s.xlsx"
    xyz = write_many(path, 20_000)
    # Another precision changes every sigma of every row; the same once more, nothing.
    for sigma_px in (0.7, 0.7):
        assert memory(path, path, sigma_px) < 400_000
    assert np.abs(workflow.solve(path).table.xyz - xyz).max() < 1e-6
    with zipfile.ZipFile(path) as written:
        points = written.read("xl/worksheets/sheet3.xml")
    assert len(re.findall(rb"<row ", points)) > 20_000
