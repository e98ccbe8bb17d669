"""A workbook of the user's own whose names, far cells and headings say something else."""

from __future__ import annotations

import zipfile
from pathlib import Path

import openpyxl
import pytest
from openpyxl.workbook.defined_name import DefinedName

from bifocal.workbook.making import book as making
from tests.bifocal.workbook.filled_forms import form, run
from tests.bifocal.workbook.filled_forms import solved as answered
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached

GIVEN = ("--d1", "17.5", "--d2", "9.5", "--c1", "35", "--c2", "19")
HEADS = ("Point", "x1 [mm]", "y1 [mm]", "x2 [mm]", "y2 [mm]")
#: A point 2 m right of the nadir and 1 m before the wall: s = 35 * 2 / 16.5 and 19 * 2 / 8.5.
FAR, NEAR = (35 * 2 / 16.5, 0), (19 * 2 / 8.5, 0)


@pytest.fixture(scope="module")
def names_of_ours(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """Return every name that a template has, of whatever kind."""
    names: set[str] = set()
    folder = tmp_path_factory.mktemp("templates")
    with pytest.MonkeyPatch.context() as long:
        long.setattr(making, "STRUCTURED_ROWS", 10)
        for number, options in enumerate(((), ("--media", "3"), ("--photos", "3"))):
            path = folder / f"template{number}.xlsx"
            assert run("template", path, "--rows", 12, *options).exit_code == 0
            names |= set(openpyxl.load_workbook(path, read_only=True).defined_names)
    return tuple(sorted(names))


def own_book(path: Path, *above: tuple[str | None, ...], heads=HEADS, picks=(*FAR, *NEAR)):
    """Write a table of one point, 1 m before the wall, below rows of the user's own."""
    book = openpyxl.Workbook()
    for row in (*above, heads, ("P0", *picks)):
        book.active.append(row)
    book.save(path)
    return path


def solved(path: Path, *given: str) -> str:
    result = run("solve", path, *given, "--out", path, "--overwrite")
    assert result.exit_code == 0, result.stderr
    return result.stderr


def part(path: Path, name: str) -> bytes:
    with zipfile.ZipFile(path) as package:
        return package.read(name)


@pytest.fixture
def planted(tmp_path: Path, names_of_ours: tuple[str, ...]) -> Path:
    """Return a workbook in which every name of ours means something else."""
    book = openpyxl.Workbook()
    data = book.active
    data.title = "Data"
    assert {"m_1", "k_12", "pitch", "sigma_s", "points_X", "setup_missing"} <= {*names_of_ours}
    for row, name in enumerate(names_of_ours, start=1):
        data.cell(row, 1, f"thing {row}")
        data.cell(row, 2, row + 0.5 if row % 7 else f"text {row}")
        book.defined_names[name] = DefinedName(name, attr_text=f"'Data'!$B${row}")
    picks = book.create_sheet("Picks")
    picks.append(HEADS)
    picks.append(("P0", *FAR, *NEAR))
    book.save(tmp_path / "own.xlsx")
    return tmp_path / "own.xlsx"


def test_names_that_mean_something_else_keep_their_cells_and_do_not_enter(planted: Path) -> None:
    before, names = part(planted, "xl/worksheets/sheet1.xml"), openpyxl.load_workbook(planted)
    for given in (GIVEN, ("--pitch", "0.0074")):  # the second time with the sheet Setup there
        solved(planted, *given)
        assert part(planted, "xl/worksheets/sheet1.xml") == before
    book = openpyxl.load_workbook(planted)
    for name, defined in names.defined_names.items():
        assert book.defined_names[name].attr_text == defined.attr_text
    assert book.sheetnames == ["Data", "Picks", "Setup"]
    assert book["Setup"].defined_names["m_1"].attr_text.startswith("'Setup'!$C$")
    formulas = [cell.value for cell in book["Picks"][2] if str(cell.value).startswith("=")]
    assert formulas
    assert not any("d_1" in text or "m_1" in text or "k_12" in text for text in formulas)
    assert openpyxl.load_workbook(planted, data_only=True)["Picks"]["F2"].value == pytest.approx(1)


@pytest.mark.acceptance
@pytest.mark.office
def test_names_that_mean_something_else_recalculate_to_what_is_stored(
    planted: Path, tmp_path: Path
) -> None:
    solved(planted, *GIVEN)
    assert assert_recalculated_equals_cached(planted, tmp_path) > 20
    assert openpyxl.load_workbook(planted, data_only=True)["Picks"]["F2"].value == pytest.approx(1)


def test_a_set_up_in_named_cells_is_read_and_said_and_options_leave_it(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    data = book.active
    values = {"d_1": 17.5, "d_2": 9.5, "c_1": 35, "c_2": 19}
    for row, (name, value) in enumerate(values.items(), start=1):
        data.cell(row, 2, value)
        book.defined_names[name] = DefinedName(name, attr_text=f"'Sheet'!$B${row}")
    picks = book.create_sheet("Picks")
    picks.append(HEADS)
    picks.append(("P0", *FAR, *NEAR))
    path = tmp_path / "own.xlsx"
    book.save(path)
    before = part(path, "xl/worksheets/sheet1.xml")
    said = "by their names: d_1 = 17.5 (Sheet!B1), d_2 = 9.5 (Sheet!B2), c_1 = 35"
    assert said in solved(path).replace("\n", " ")
    setup = openpyxl.load_workbook(path)["Setup"]
    assert "='Sheet'!$B$1" in [cell.value for cell in setup["C"]]
    solved(path, "--d1", "17.6")
    assert part(path, "xl/worksheets/sheet1.xml") == before
    assert 17.6 in [cell.value for cell in openpyxl.load_workbook(path)["Setup"]["C"]]


@pytest.mark.parametrize(("cell", "first"), [("XFD1", "F2"), ("CZ9", "F2"), ("K1", "L2")])
def test_results_stand_beside_the_table_whatever_stands_further_right(
    tmp_path: Path, cell: str, first: str
) -> None:
    book = openpyxl.load_workbook(path := own_book(tmp_path / "own.xlsx"))
    book.active[cell] = "edge"
    book.save(path)
    solved(path, *GIVEN)
    sheet = openpyxl.load_workbook(path, data_only=True).active
    assert sheet[first].value == pytest.approx(1)
    assert sheet[cell].value == "edge"


def test_a_sheet_without_free_columns_is_refused_and_stays(tmp_path: Path) -> None:
    book = openpyxl.load_workbook(path := own_book(tmp_path / "own.xlsx"))
    for column in range(20, 16385, 20):
        book.active.cell(9, column, "x")
    book.save(path)
    before = path.read_bytes()
    result = run("solve", path, *GIVEN, "--out", path, "--overwrite")
    assert result.exit_code == 1
    assert "free columns beside the table" in result.stderr
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("above", "is_far"),
    [
        (("near camera", "far camera"), False),
        (("19 mm", "35 mm"), False),
        (("camera vicina", "camera lontana"), False),
        (("nah", "fern"), False),
        (("Foto 2 (19 mm)", "Foto 1 (35 mm)"), False),
        (("far photo", "near photo"), True),
        (("35 mm", "19 mm"), True),
        (("A", "B"), True),
        (("Anna", "Berta"), True),
    ],
)
def test_what_stands_above_the_coordinates_tells_the_far_photo(
    tmp_path: Path, above: tuple[str, str], is_far: bool
) -> None:
    heads, picks = ("Point", *("x [mm]", "y [mm]") * 2), FAR + NEAR if is_far else NEAR + FAR
    words = (None, above[0], None, above[1], None)
    path = own_book(tmp_path / "own.xlsx", words, heads=heads, picks=picks)
    answer, told = answered(path, *GIVEN)
    assert answer["points"][0]["r"] == pytest.approx(1)
    assert ('"Anna" is taken for the far photo' in told) == (above[0] == "Anna")
    assert ("far photo (long lens)" in told) == (above[0] == "Anna")


def test_the_empty_template_of_three_photos_says_what_to_fill_in(tmp_path: Path) -> None:
    path = tmp_path / "three.xlsx"
    path.write_bytes(form("--photos", 3, "--rows", 3))
    for line in (("solve", path), ("match", path, "--out", tmp_path / "m.xlsx")):
        result = run(*line)
        assert result.exit_code == 1
        assert "ill in the" in result.stderr


def test_our_own_workbooks_and_keys_below_labels_are_not_asked_for_the_far_photo(
    tmp_path: Path,
) -> None:
    words, heads = ("Name", "first photo", "", "second photo", ""), ("id", "x1", "y1", "x2", "y2")
    path = own_book(tmp_path / "own.xlsx", words, heads=heads)
    assert "is taken for" not in solved(path, *GIVEN)
    new = tmp_path / "new.xlsx"
    assert run("solve", path, "--out", new).exit_code == 0
    assert "is taken for" not in solved(new)
