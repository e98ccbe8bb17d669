"""A new workbook never takes the place of the user's own, and backups are kept for ever."""

from __future__ import annotations

import zipfile

import openpyxl
import pytest
from openpyxl.chart import BarChart, Reference

from tests.bifocal.survey.test_cli_solve import POINTS, SETUP, fill, rows, run, write_csv

TABLE = "\n".join(["id,x1,y1,x2,y2", *(",".join(map(str, row)) for row in rows(POINTS))])
DISTANCES = ("--d1", 17.5, "--d2", 9.5, "--c1", 35, "--c2", 19)


def with_own_chart(path):
    """Add a sheet with a chart, as a user does in the spreadsheet program."""
    book = openpyxl.load_workbook(path)
    sheet = book.create_sheet("My chart")
    sheet.append([1, 2, 3])
    chart = BarChart()
    chart.add_data(Reference(sheet, min_col=1, max_col=3, min_row=1))
    sheet.add_chart(chart, "A3")
    book.save(path)
    return path


def own_table(path):
    """A table of the user's own, not our template."""
    book = openpyxl.Workbook()
    for row in [("id", "x1", "y1", "x2", "y2"), *rows(POINTS)]:
        book.active.append(row)
    book.save(path)
    return with_own_chart(path)


def refused(path, *options, reason):
    before = path.read_bytes()
    files = sorted(path.parent.iterdir())
    result = run("solve", path, "--out", path, "--overwrite", *options)
    assert result.exit_code == 1
    assert path.read_bytes() == before
    assert sorted(path.parent.iterdir()) == files
    assert reason in result.stderr
    assert f"--out {path.stem}-result.xlsx" in result.stderr


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--d1", 17.6), "the set-up was given by options"),
        (("--unit", "mm"), "the set-up was given by options"),
        (("--sigma-s", 0.01), "the set-up was given by options"),
        (("--lang", "it"), "another language"),
        (("--tolerance-rule", "2cm"), "other tolerance rules"),
        (("--adjust-setup",), "the set-up was corrected"),
    ],
)
def test_options_never_replace_the_users_workbook_by_a_new_one(tmp_path, options, reason):
    path = with_own_chart(fill(tmp_path / "own.xlsx"))
    book = openpyxl.load_workbook(path)
    heads = {cell.value: cell.column for cell in book["Points"][4]}
    for row in (5, 8):
        book["Points"].cell(row, heads["code"], "PLANE")
    book.save(path)
    refused(path, *options, reason=reason)
    other = path.with_name("own-result.xlsx")
    for _ in range(2):
        result = run("solve", path, "--out", other, "--overwrite", *options)
        assert result.exit_code == 0, result.stderr


def test_rows_below_the_prepared_ones_do_not_cost_the_workbook(tmp_path):
    table = rows([(f"Q{i}", 1 + i / 50, 2, 0.3) for i in range(30)])
    refused(with_own_chart(fill(tmp_path / "own.xlsx", table)), reason="10 points stand below")


def test_a_table_of_the_users_own_is_not_replaced(tmp_path):
    refused(own_table(tmp_path / "own.xlsx"), *DISTANCES, reason="not come from a survey workbook")


def test_a_text_table_is_not_replaced_by_its_own_results(tmp_path):
    path = write_csv(tmp_path / "p.csv", TABLE)
    result = run("solve", path, "--out", path, "--overwrite", *DISTANCES)
    assert result.exit_code == 1
    assert "is the survey itself" in result.stderr
    assert path.read_text() == TABLE


def test_a_result_is_replaced_until_somebody_else_saved_it(tmp_path):
    source, out = write_csv(tmp_path / "p.csv", TABLE), tmp_path / "r.xlsx"
    for _ in range(3):
        result = run("solve", source, "--out", out, "--overwrite", *DISTANCES)
        assert result.exit_code == 0, result.stderr
    with_own_chart(out)
    kept = out.read_bytes()
    result = run("solve", source, "--out", out, "--overwrite", *DISTANCES)
    assert result.exit_code == 1
    assert "--out r-result.xlsx" in result.stderr
    assert out.read_bytes() == kept


def test_a_result_with_a_part_put_in_is_no_longer_ours(tmp_path):
    source, out = write_csv(tmp_path / "p.csv", TABLE), tmp_path / "r.xlsx"
    assert run("solve", source, "--out", out, *DISTANCES).exit_code == 0
    with zipfile.ZipFile(out, "a") as package:
        package.writestr("xl/vbaProject.bin", b"MACROS")
    assert run("solve", source, "--out", out, "--overwrite", *DISTANCES).exit_code == 1


def test_a_solved_table_is_not_replaced_by_a_new_one_either(tmp_path):
    source, out = write_csv(tmp_path / "p.csv", TABLE), tmp_path / "r.xlsx"
    assert run("solve", source, "--out", out, *DISTANCES).exit_code == 0
    refused(out, "--d1", 17.6, reason="the set-up was given by options")


def commands(folder):
    """Every command that writes a new workbook, by its name."""
    source, solved = write_csv(folder / "p.csv", TABLE), folder / "solved.xlsx"
    assert run("solve", source, "--out", solved, *DISTANCES).exit_code == 0
    plan = ("plan", "--focal", 35, "--focal", 19, "--sensor", "36x24", "--pixels", "6000x4000")
    plan += ("--object", "10x6", "--scale", 500)
    return {
        "template": lambda out: ("template", out, "--overwrite"),
        "export": lambda out: ("export", solved, "--out", out, "--overwrite"),
        "solve": lambda out: ("solve", source, "--out", out, "--overwrite", *DISTANCES),
        "plan": lambda out: (*plan, "--out", out, "--overwrite"),
    }


@pytest.mark.parametrize("name", ["template", "export", "solve", "plan"])
def test_every_writer_respects_locks_and_foreign_workbooks(tmp_path, name):
    command, out = commands(tmp_path)[name], tmp_path / "out.xlsx"
    for _ in range(2):
        result = run(*command(out))
        assert result.exit_code == 0, result.output
    for lock, program in (("~$out.xlsx", "Excel"), (".~lock.out.xlsx#", "LibreOffice")):
        (tmp_path / lock).touch()
        result = run(*command(out))
        assert result.exit_code == 1
        assert f"is open in {program}" in result.stderr
        (tmp_path / lock).unlink()
    kept = own_table(out).read_bytes()
    result = run(*command(out))
    assert result.exit_code == 1
    assert "out-result.xlsx" in result.stderr
    assert out.read_bytes() == kept


def test_the_first_state_stays_in_its_backup(tmp_path):
    path = fill(tmp_path / "s.xlsx")
    states = []
    for number in range(3):
        states.append(path.read_bytes())
        result = run("solve", path, "--out", path, "--overwrite")
        assert result.exit_code == 0
        assert f"is kept as s.xlsx.bak{number + 1 if number else ''}." in result.stderr
    for name, state in zip(("s.xlsx.bak", "s.xlsx.bak2", "s.xlsx.bak3"), states, strict=True):
        assert (tmp_path / name).read_bytes() == state


def test_a_backup_of_somebody_else_is_not_replaced(tmp_path):
    path = fill(tmp_path / "s.xlsx", setup=SETUP)
    before = path.read_bytes()
    (tmp_path / "s.xlsx.bak").write_text("mine")
    assert run("solve", path, "--out", path, "--overwrite").exit_code == 0
    assert (tmp_path / "s.xlsx.bak").read_text() == "mine"
    assert (tmp_path / "s.xlsx.bak2").read_bytes() == before
