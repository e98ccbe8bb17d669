"""The functions with names of `bifocal template --functions`: equal to the library, everywhere."""

from __future__ import annotations

import re

import numpy as np
import openpyxl
import pytest

import bifocal
import multimedia
from bifocal.equations import plane_coordinates, relief_displacement
from bifocal.precision import sigma_relief
from bifocal.workbook.formulas.columns import FUNCTIONS
from bifocal.workbook.template_workflow import write_template
from tests.bifocal.workbook.filled_forms import fill, run
from tests.recalculate import recalculated
from tests.workbook_lint import lint

NAMES = tuple(FUNCTIONS.content["functions"])


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    path = tmp_path_factory.mktemp("functions") / "functions.xlsx"
    write_template(path, functions=True, media=3, rows=5)
    return path


def places(path):
    """Return the rows of the sheet `Functions`: by function what is given, cells and call."""
    sheet, found, given = openpyxl.load_workbook(path)["Functions"], {}, []
    for row in range(6, sheet.max_row + 1):
        text, cell = str(sheet.cell(row, 1).value), sheet.cell(row, 3)
        if text.startswith("="):
            found[text[1:]], given = (given, row - 1, row), []
        elif isinstance(cell.value, int | float):
            given.append(row)
    return found


def layers(n1, n2, n3, t):
    return multimedia.Layers(indices=(n1, n2, n3), thicknesses=(t,))


def shift(radius, z0, t, zp, *n):
    return multimedia.radial_shift(radius, z0=z0, zp=zp, layers=layers(*n, t))


#: What the library says of the same arguments.
LIBRARY = {
    "RELIEF": lambda s1, s2, d1, d2: bifocal.relief(s1, s2, d1=d1, d2=d2),
    "RELIEF_SIGMA": lambda s1, s2, d1, d2, a, b: sigma_relief(
        s1, s2, d1=d1, d2=d2, sigma_1=a, sigma_2=b
    ),
    "DISPLACEMENT": lambda s, r, d: relief_displacement(s, r, d=d),
    "PLANE_X": lambda s, e, theta: plane_coordinates(s, e, np.radians(theta))[0],
    "PLANE_Y": lambda s, e, theta: plane_coordinates(s, e, np.radians(theta))[1],
    "NINDEX": lambda nm, c, s, d: multimedia.water_refractive_index(
        wavelength_nm=nm, temperature_c=c, salinity_percent=s, depth=d
    ),
    "RADIALSHIFT": shift,
}
#: Arguments beside those of the example, near what may happen.
OTHERS = {
    "RELIEF": [(9.1, 8.7, 17.5, 9.5), (0.02, 0.0202, 40, 8), (5, 5, 17.5, 9.5)],
    "RELIEF_SIGMA": [(9.1, 8.7, 17.5, 9.5, 0.004, 0.006), (0.5, 0.51, 40, 8, 0.01, 0.01)],
    "DISPLACEMENT": [(11.5, -0.7, 9.5)],
    "PLANE_X": [(7.1, -0.3, -135), (3, 0, 0)],
    "PLANE_Y": [(7.1, -0.3, -135), (3, 0, 0)],
    "NINDEX": [(640, 4, 3.5, 20)],
    "RADIALSHIFT": [
        (0, 1, 0, 1, 1, 1, 1.33),
        (2, 0.8, 0.05, 1.5, 1, 1.5, 1.34),
        (2, 1, 0, 3, 1.33, 1.5, 1),
    ],
}


@pytest.mark.acceptance
@pytest.mark.office
def test_cells_equal_the_library_recalculated(book, tmp_path):
    sheet = recalculated(book, tmp_path)["Functions"]
    stored = openpyxl.load_workbook(book, data_only=True)["Functions"]
    found = places(book)
    assert tuple(found) == NAMES
    for name, (given, cells, call) in found.items():
        for row in range(given[0], cells + 1):
            assert sheet.cell(row, 3).value == pytest.approx(stored.cell(row, 3).value, rel=1e-12)
        assert stored.cell(call, 3).value == stored.cell(cells, 3).value
        values = [stored.cell(row, 3).value for row in given]
        if name in LIBRARY:
            known = float(LIBRARY[name](*values))
        else:
            back = shift(stored.cell(cells, 3).value, *values[1:4], *values[4:])
            known, values = float(back), [values[0]]
            assert known == pytest.approx(values[0], rel=1e-9)
            continue
        assert stored.cell(cells, 3).value == pytest.approx(known, rel=1e-9)
    # LibreOffice 7.4 knows no LAMBDA, and the sheet says so.
    assert "no LAMBDA" in sheet["A3"].value


@pytest.mark.acceptance
def test_functions_equal_the_library_where_lambda_is_known(book):
    ironcalc = pytest.importorskip("ironcalc")
    model = ironcalc.load_from_xlsx(str(book), "en", "UTC", "en")
    number = openpyxl.load_workbook(book).sheetnames.index("Functions")
    for name, (given, cells, call) in places(book).items():
        for values in OTHERS.get(name, ()):
            for row, value in zip(given, values, strict=True):
                model.set_user_input(number, row, 3, str(value))
            model.evaluate()
            both = [model.get_formatted_cell_value(number, row, 3) for row in (cells, call)]
            assert both[0] == both[1]
            assert float(both[1]) == pytest.approx(float(LIBRARY[name](*values)), abs=6e-7)
    assert model.get_formatted_cell_value(number, 3, 1) == "This program knows the functions."


def test_names_hold_what_the_file_format_wants(book):
    names = openpyxl.load_workbook(book).defined_names
    others = {name.casefold() for name in names} - {name.casefold() for name in NAMES}
    for name in NAMES:
        text = names[name].attr_text
        assert text.startswith("_xlfn.LAMBDA(_xlpm.")
        assert len(text) < 8192
        own = set(re.findall(r"_xlpm\.(\w+)", text))
        assert not own & others, "some programs take the workbook's own cell of that name"
        assert not [
            word for word in own if re.fullmatch(r"[a-z]{1,3}\d+|[rc]", word, re.IGNORECASE)
        ]
        bare = re.sub(r"_xl(pm|fn)\.\w+", "", text)
        assert set(re.findall(r"[A-Za-z_]\w*", bare)) <= {
            *("IF", "NA", "MIN", "SQRT", "ABS", "SIN", "COS", "RADIANS", "E")
        }
        assert bare.count("(") == bare.count(")")


@pytest.mark.parametrize(
    "language", ["en", *(pytest.param(m, marks=pytest.mark.acceptance) for m in ("it", "de"))]
)
def test_sheet_is_sound_and_in_its_language(language, tmp_path):
    path = tmp_path / "book.xlsx"
    write_template(path, functions=True, language=language, rows=3)
    assert lint(path) == []
    told = {"en": "far camera", "it": "camera lontana", "de": "fernen Kamera"}[language]
    assert told in openpyxl.load_workbook(path)["Functions"]["B7"].value


@pytest.mark.parametrize("plain", [False, True], ids=["named", "plain"])
def test_functions_saved_by_another_program_show_what_their_own_inputs_give(plain, tmp_path):
    """In place, those with names in another language too."""
    options = ("--rows", 8, "--functions", *(["--plain"] if plain else []))
    path = fill(tmp_path / "s.xlsx", [("A", 4.2424, 0, 4.4706, 0)], template=options)
    book = openpyxl.load_workbook(path)
    book["Functions"]["C7"], book["Functions"]["C8"] = 35 * 2 / 16.0, 19 * 2 / 8.0
    book.save(path)  # without any result
    language = [] if plain else ["--lang", "de"]
    done = run("solve", path, "--out", path, "--overwrite", *language)
    assert done.exit_code == 0, done.stderr
    solved = openpyxl.load_workbook(path)
    formulas = solved["Functions"]
    if language:
        assert solved.defined_names["RELIEF"].attr_text == book.defined_names["RELIEF"].attr_text
        assert "Kamera" in formulas["B7"].value
        assert "kennt kein LAMBDA" in formulas["A3"].value
    shown = openpyxl.load_workbook(path, data_only=True)["Functions"]
    cells = [c.coordinate for row in formulas.iter_rows() for c in row if c.data_type == "f"]
    assert len(cells) > 20
    assert all(shown[cell].value is not None for cell in cells)
    # A point 2 m off the nadir that stands out by 1.5 m: by the cells, and by the function.
    assert [shown[cell].value for cell in ("C12", "C13")] == pytest.approx([1.5, 1.5], rel=1e-12)
