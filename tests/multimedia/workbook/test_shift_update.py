"""Results put into the user's own workbook: everything else stays."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import openpyxl
import pytest
from click.testing import CliRunner, Result
from openpyxl.chart import ScatterChart

from multimedia import Layers, radial_shift
from multimedia.cli.main import main
from tests import office
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


def test_columns_are_added_and_everything_else_stays(own: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.xlsx"
    result = run(own, *MEDIA, "--out", out)
    assert result.exit_code == 0, result.stderr
    sheet = openpyxl.load_workbook(out)["Messung"]
    assert [c.value for c in sheet[3]][:12] == [
        "Punkt", "X [m]", "Y [m]", "Z [m]", "Bemerkung", None, None,
        "Rbar", "dR", "Xbar", "Ybar", "flag",
    ]  # fmt: skip
    exact = float(radial_shift(0.5, z0=0.5, zp=0.2, layers=LAYERS))
    assert sheet["H4"].value == pytest.approx(exact, rel=4 * EPS)
    assert sheet["J4"].value == pytest.approx(0.3 * exact / 0.5, rel=16 * EPS)
    assert sheet["L4"].value == "OK"
    assert sheet["G4"].value == "=B4*2"
    with zipfile.ZipFile(own) as before, zipfile.ZipFile(out) as after:
        changed = {n for n in before.namelist() if before.read(n) != after.read(n)}
        assert before.namelist() == after.namelist()
    assert changed <= {"xl/worksheets/sheet1.xml", "xl/workbook.xml"}


def test_a_second_run_fills_the_same_columns_and_keeps_a_backup(own: Path) -> None:
    assert run(own, *MEDIA, "--out", own, "--overwrite").exit_code == 0
    once = openpyxl.load_workbook(own)["Messung"].max_column
    assert run(own, *MEDIA[:-1], "0,0,0.61", "--out", own, "--overwrite").exit_code == 0
    sheet = openpyxl.load_workbook(own)["Messung"]
    assert sheet.max_column == once
    exact = float(radial_shift(0.5, z0=0.6, zp=0.2, layers=LAYERS))
    assert sheet["H4"].value == pytest.approx(exact, rel=4 * EPS)
    assert own.with_name("becken.xlsx.bak").exists()


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


def test_a_template_for_other_media_is_refused(tmp_path: Path) -> None:
    first, points = tmp_path / "tank.xlsx", tmp_path / "points.csv"
    points.write_text("id,R,ZP\nA,0.3,0.2\n", encoding="utf-8")
    run(points, *MEDIA, "--out", first)
    result = run(first, "--indices", "1,1.337", "--out", tmp_path / "two.xlsx")
    assert result.exit_code == 1
    assert "formulas are for 3 media, the options give 2" in result.stderr


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
    from bifocal.cli.main import main as bifocal

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
