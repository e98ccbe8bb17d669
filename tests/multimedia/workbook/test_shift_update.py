"""Results put into the user's own workbook: everything else stays."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import openpyxl
import pytest
from click.testing import CliRunner, Result
from openpyxl.chart import ScatterChart
from openpyxl.workbook.defined_name import DefinedName

from multimedia import Layers, radial_shift
from tests import office
from tests.builders.commands import multimedia_command as main
from tests.rounding import EPS

MEDIA = ("--indices", "1,1.5,1.34", "--thicknesses", "0.01", "--camera", "0,0,0.51")
LAYERS = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(0.01,))


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["shift", *(str(argument) for argument in arguments)])


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Return a surveyor's workbook: a title, a table, a note beside it, a chart, another sheet."""
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Messung"
    sheet["A1"] = "Becken 3"
    sheet.append([])
    sheet.append(["Punkt", "X [m]", "Y [m]", "Z [m]", "Bemerkung"])
    sheet.append(["A", 0.3, 0.4, -0.2, "Rand"])
    sheet.append(["B", 0.0, 0.1, -0.1, None])
    sheet["G4"] = "=B4*2"
    sheet.add_chart(ScatterChart(), "J2")
    book.create_sheet("Notizen")["A1"] = "bleibt"
    path = tmp_path / "becken.xlsx"
    book.save(path)
    return path


def test_live_columns_are_added_and_everything_else_stays(own: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.xlsx"
    result = run(own, *MEDIA, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert [c.value for c in openpyxl.load_workbook(out)["Messung"][3]] == [
        "Punkt", "X [m]", "Y [m]", "Z [m]", "Bemerkung", None, None,
        "Rbar", "dR", "Xbar", "Ybar", "flag",
        "R_u", "ZP_u", "u0", "u1", "u2", "u3", "u4", "u5", "u6", "resid",
    ]  # fmt: skip
    shown, formulas = office.stored(out), office.formulas_of(out)
    assert {f"{c}{row}" for c in "HIJKLMNOPQRSTUV" for row in (4, 5)} <= formulas["Messung"].keys()
    cells = shown["Messung"]
    exact = float(radial_shift(0.5, z0=0.5, zp=0.2, layers=LAYERS))
    assert cells["H4"] == pytest.approx(exact, rel=4 * EPS)
    assert cells["J4"] == pytest.approx(0.3 * exact / 0.5, rel=16 * EPS)
    assert cells["L4"] == "OK"
    assert formulas["Messung"]["G4"] == "=B4*2"
    assert shown["Media"]["B9"] == 0.5
    with zipfile.ZipFile(own) as before, zipfile.ZipFile(out) as after:
        changed = {n for n in before.namelist() if before.read(n) != after.read(n)}
        new = set(after.namelist()) - set(before.namelist())
    assert changed <= {
        "xl/worksheets/sheet1.xml", "xl/workbook.xml", "xl/styles.xml", "[Content_Types].xml",
        "xl/_rels/workbook.xml.rels",
    }  # fmt: skip
    assert len(new) == 1, new


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("kind", ["labels", "texts", "names", "radius"])
def test_the_formulas_beside_an_own_table_calculate_the_same(
    own: Path, tmp_path: Path, kind: str
) -> None:
    book = openpyxl.load_workbook(own)
    sheet, notes = book["Messung"], book["Notizen"]
    media = ("--indices", "1,1.5,1.34", "--thicknesses", "0.01", "--z0", "0.5")
    if kind in ("labels", "names"):
        values = {"n_1": 1.0, "n_2": 1.5, "n_3": 1.34, "t_1": 0.01, "z_0": 0.5, "k_1": 7.0}
        for row, (name, value) in enumerate(values.items(), start=3):
            notes.append([name if kind == "labels" else None, value])
            if kind == "names":
                place = f"'Notizen'!$B${row - 1}"
                book.defined_names[name] = DefinedName(name, attr_text=place)
        media = ()
    elif kind == "radius":
        rows = [("R [m]", "Tiefe"), (0.5, 0.2), (0.1, 0.1)]
        for row, (radius, depth) in enumerate(rows, start=3):
            sheet.cell(row, 2, radius)
            sheet.cell(row, 3, depth)
            sheet.cell(row, 4).value = None
    elif kind == "texts":
        sheet["B4"], sheet["D5"] = "0,3", "-0.1 m"
        sheet["D3"] = "Z"
        sheet["D4"] = "-0.2 m"
    book.save(own)
    out = tmp_path / "out.xlsx"
    result = run(own, *media, "--out", out)
    assert result.exit_code == 0, result.stderr
    stored, anew = office.stored(out), office.recalculated(out, tmp_path / "lo")
    assert anew["Messung"].pop("G4", None) is not None  # openpyxl stores no result
    for title in ("Messung", "Media"):
        assert stored[title].keys() == anew[title].keys()
        for cell, value in stored[title].items():
            if isinstance(value, int | float):
                assert anew[title][cell] == pytest.approx(value, rel=64 * EPS, abs=64 * EPS), cell
            else:
                assert anew[title][cell] == value
    exact = [
        float(radial_shift(r, z0=0.5, zp=zp, layers=LAYERS)) for r, zp in ((0.5, 0.2), (0.1, 0.1))
    ]
    assert [anew["Messung"]["H4"], anew["Messung"]["H5"]] == pytest.approx(exact, rel=64 * EPS)
    if kind != "labels":
        return
    # The set-up is live where the user typed it.
    book = openpyxl.load_workbook(out)
    row = next(cell.row for cell in book[notes.title]["B"] if cell.value == 0.5)
    book[notes.title].cell(row, 2).value = 0.75
    book.save(out)
    moved = office.recalculated(out, tmp_path / "lo")["Messung"]
    exact = [
        float(radial_shift(r, z0=0.75, zp=z, layers=LAYERS)) for r, z in ((0.5, 0.2), (0.1, 0.1))
    ]
    assert [moved["H4"], moved["H5"]] == pytest.approx(exact, rel=64 * EPS)


def test_a_second_run_fills_the_same_columns_and_keeps_a_backup(own: Path) -> None:
    assert run(own, *MEDIA, "--out", own, "--overwrite").exit_code == 0
    once = openpyxl.load_workbook(own)
    assert run(own, *MEDIA[:-1], "0,0,0.61", "--out", own, "--overwrite").exit_code == 0
    twice = openpyxl.load_workbook(own)
    assert twice["Messung"].max_column == once["Messung"].max_column
    assert twice.sheetnames == once.sheetnames
    exact = float(radial_shift(0.5, z0=0.6, zp=0.2, layers=LAYERS))
    shown = office.stored(own)
    assert shown["Messung"]["H4"] == pytest.approx(exact, rel=4 * EPS)
    assert shown["Media"]["B9"] == 0.6
    assert own.with_name("becken.xlsx.bak").exists()
    # The media are in the workbook now.
    result = run(own, "--json")
    assert json.loads(result.stdout)["points"][0]["Rbar"] == pytest.approx(exact, rel=4 * EPS)


def test_other_media_than_the_formulas_are_for_are_refused_there_too(own: Path) -> None:
    assert run(own, *MEDIA, "--out", own, "--overwrite").exit_code == 0
    before = own.read_bytes()
    result = run(own, "--indices", "1,1.34", "--z0", "1", "--out", own, "--overwrite")
    assert result.exit_code == 1
    assert "its formulas are for 3 media, the options give 2; add --new" in result.stderr
    assert own.read_bytes() == before


def test_the_backup_is_named_and_never_replaced(own: Path) -> None:
    before = own.read_bytes()
    assert f"is kept as {own}.bak." in run(own, *MEDIA, "--out", own, "--overwrite").stderr
    other = (*MEDIA[:-1], "0,0,0.61")
    assert f"is kept as {own}.bak2." in run(own, *other, "--out", own, "--overwrite").stderr
    assert own.with_name("becken.xlsx.bak").read_bytes() == before


def test_a_new_workbook_replaces_only_what_this_program_wrote(own: Path, tmp_path: Path) -> None:
    before, out = own.read_bytes(), tmp_path / "live.xlsx"
    result = run(own, *MEDIA, "--out", own, "--new", "--overwrite")
    assert result.exit_code == 1
    assert "becken-result.xlsx" in result.stderr
    assert own.read_bytes() == before
    for _ in range(2):
        assert run(own, *MEDIA, "--out", out, "--new", "--overwrite").exit_code == 0
    (tmp_path / "~$live.xlsx").touch()
    result = run(own, *MEDIA, "--out", out, "--new", "--overwrite")
    assert result.exit_code == 1
    assert "open in Excel" in result.stderr


def test_a_new_workbook_has_live_formulas(own: Path, tmp_path: Path) -> None:
    out = tmp_path / "live.xlsx"
    assert run(own, *MEDIA, "--out", out, "--new").exit_code == 0
    assert "Rbar" in str(office.formulas_of(out)["Multimedia"].values())


@pytest.mark.acceptance
@pytest.mark.office
def test_a_template_gets_results_and_the_options_set_up(tmp_path: Path) -> None:
    first, second = tmp_path / "tank.xlsx", tmp_path / "moved.xlsx"
    points = tmp_path / "points.csv"
    points.write_text("id,X,Y,Z\nA,0.3,0.4,-0.2\nB,0,0,-0.1\n", encoding="utf-8")
    assert run(points, *MEDIA, "--out", first).exit_code == 0
    changed = ("--z0", "0.8", "--indices", "1,1.5,1.337")
    result = run(first, *changed, "--out", second, "--json")
    assert result.exit_code == 0, result.stderr
    told = json.loads(result.stdout)["points"][0]["Rbar"]
    layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))
    assert told == pytest.approx(
        float(radial_shift(0.5, z0=0.8, zp=0.2, layers=layers)), rel=4 * EPS
    )
    live, kept = office.recalculated(second, tmp_path), office.stored(second)
    for sheet, cells in office.formulas_of(second).items():
        for cell in cells:
            value = live[sheet].get(cell)
            if isinstance(value, float | int):
                assert kept[sheet].get(cell) == pytest.approx(value, rel=1e-12, abs=1e-12), cell
    assert told in [pytest.approx(v) for v in kept["Multimedia"].values() if isinstance(v, float)]


def test_what_options_say_of_the_set_up_is_typed_into_its_cells(tmp_path: Path) -> None:
    first, second = tmp_path / "tank.xlsx", tmp_path / "moved.xlsx"
    points = tmp_path / "points.csv"
    points.write_text("id,X,Y,Z\nA,0.3,0.4,-0.2\nB,0,0,-0.1\n", encoding="utf-8")
    assert run(points, *MEDIA, "--out", first).exit_code == 0
    changed = ("--z0", "0.8", "--indices", "1,1.5,1.337")
    assert run(first, *changed, "--out", second).exit_code == 0
    before, after = office.stored(first)["Multimedia"], office.stored(second)["Multimedia"]
    moved = {cell: value for cell, value in after.items() if before.get(cell) != value}
    k, q = 1 / 1.337, 1 - 1 / 1.337**2
    for value in (0.8, 1.337, k, q):
        assert value in [pytest.approx(v) for v in moved.values() if isinstance(v, float)], value
    book = openpyxl.load_workbook(first)
    del book.defined_names["n_3"]
    book.save(first)
    result = run(first, *changed, "--out", tmp_path / "o.xlsx")
    assert result.exit_code == 1
    assert "n_3" in result.stderr


def test_a_template_for_other_media_is_refused(tmp_path: Path) -> None:
    first, points = tmp_path / "tank.xlsx", tmp_path / "points.csv"
    points.write_text("id,R,ZP\nA,0.3,0.2\n", encoding="utf-8")
    run(points, *MEDIA, "--out", first)
    result = run(first, "--indices", "1,1.337", "--out", tmp_path / "two.xlsx")
    assert result.exit_code == 1
    assert "formulas are for 3 media, the options give 2" in result.stderr


@pytest.mark.acceptance
@pytest.mark.office
def test_an_option_takes_the_place_of_a_formula_that_was_never_calculated(tmp_path: Path) -> None:
    path, out = tmp_path / "tank.xlsx", tmp_path / "out.xlsx"
    CliRunner().invoke(main, ["template", str(path), "--rows", "2"])
    book = openpyxl.load_workbook(path)
    for column, value in ((1, "A"), (5, 120.0), (6, 80.0)):
        book["Multimedia"].cell(15, column, value)
    book.save(path)
    result = run(path, "--out", out)
    assert result.exit_code == 1
    assert "has never been calculated" in result.stderr
    result = run(path, "--indices", "1,1.5,1.4", "--out", out, "--json")
    assert result.exit_code == 0, result.stderr
    assert office.formulas_of(out)["Multimedia"].get("B7") is None
    assert office.stored(out)["Multimedia"]["B7"] == 1.4
    told = json.loads(result.stdout)["points"][0]["Rbar"]
    live = office.recalculated(out, tmp_path)["Multimedia"].values()
    assert any(v == pytest.approx(told, rel=1e-12) for v in live if isinstance(v, float))


def test_a_bifocal_survey_is_refused_in_one_line(tmp_path: Path) -> None:
    from tests.builders.commands import bifocal_command as bifocal

    path = tmp_path / "survey.xlsx"
    assert CliRunner().invoke(bifocal, ["template", str(path)]).exit_code == 0
    result = run(path, *MEDIA, "--json")
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1
    assert "solve it with `bifocal solve`" in result.stderr


def test_a_state_that_a_backup_holds_is_not_saved_again(own: Path) -> None:
    before = own.read_bytes()
    for _ in range(3):
        own.write_bytes(before)
        assert run(own, *MEDIA, "--out", own, "--overwrite").exit_code == 0
    assert [path.name for path in own.parent.glob("*.bak*")] == ["becken.xlsx.bak"]


@pytest.mark.parametrize(
    ("command", "proposed"), [("template", "out2.xlsx"), ("shift", "out-result.xlsx")]
)
def test_every_writer_respects_locks_and_the_users_workbooks(
    tmp_path: Path, command: str, proposed: str
) -> None:
    out, points = tmp_path / "out.xlsx", tmp_path / "points.csv"
    points.write_text("id,R,ZP\nA,0.3,0.2\n", encoding="utf-8")
    arguments = {"template": [out], "shift": [points, *MEDIA, "--out", out]}[command]

    def written() -> Result:
        texts = [command, *map(str, arguments), "--overwrite"]
        return CliRunner().invoke(main, texts)

    assert [written().exit_code for _ in range(2)] == [0, 0]
    for lock, program in (("~$out.xlsx", "Excel"), (".~lock.out.xlsx#", "LibreOffice")):
        (tmp_path / lock).touch()
        assert f"is open in {program}" in written().stderr
        (tmp_path / lock).unlink()
    book = openpyxl.load_workbook(out)
    book.create_sheet("Meine")
    book.save(out)
    kept = out.read_bytes()
    assert proposed in written().stderr
    assert out.read_bytes() == kept
