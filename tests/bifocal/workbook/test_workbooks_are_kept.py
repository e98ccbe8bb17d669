"""A new workbook never takes the place of the user's own, and backups are kept for ever."""

from __future__ import annotations

import json
import re
import zipfile

import numpy as np
import openpyxl
import pytest

from tests.bifocal.workbook.filled_forms import SETUP, fill, named, rows, run, write_csv
from tests.bifocal.workbook.kept_workbook import (
    DISTANCES,
    TABLE,
    own_table,
    slow,
    solved_in_place,
    with_own_chart,
)
from tests.bifocal.workbook.test_cli_solve import write_pair
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached, parts
from tests.recalculate import recalculated


def with_plane_points(path):
    book = openpyxl.load_workbook(path)
    heads = {cell.value: cell.column for cell in book["Points"][4]}
    for row in (5, 8):
        book["Points"].cell(row, heads["code"], "PLANE")
    book.save(path)
    return path


#: LibreOffice takes seconds a workbook: it recalculates those whose formulas change.
RECALCULATED = ("--d1", "--tolerance-rule", "--adjust-setup")
OPTIONS = [
    (("--d1", 17.6), {"d_2": 9.5, "delta_d": 8.1}),
    slow(("--d2", 9.4), {"d_2": 9.4, "delta_d": 8.1}),
    slow(("--c1", 35.5, "--sigma-s", 0.01), {"c_1": 35.5, "sigma_s": 0.01}),
    slow(("--unit", "mm"), {"input_unit": "mm"}),
    slow(("--sigma-r-max", 0.5), {"sigma_r_max": 0.5}),
    (("--lang", "it"), {}),
    slow(("--tolerance-rule", "2cm"), {}),
    slow(("--adjust-setup",), {}),
]


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize(("options", "cells"), OPTIONS, ids=lambda value: str(value)[:20])
def test_options_are_written_into_the_cells_of_the_users_workbook(tmp_path, options, cells):
    path = with_plane_points(with_own_chart(fill(tmp_path / "own.xlsx")))
    table = json.loads(run("solve", path, "--json", *options).stdout)["points"]
    own = {name for name in parts(path) if "chart6" in name or "sheet10" in name}
    assert len(own) >= 2
    _, changed = solved_in_place(path, *options)
    assert not own & changed
    book = openpyxl.load_workbook(path)
    assert {name: named(book, name).value for name in cells} == cells
    if options[0] in RECALCULATED:
        assert_recalculated_equals_cached(path, tmp_path)
    # What is solved from the workbook alone is the same: the options are in it now.
    again = json.loads(run("solve", path, "--json").stdout)["points"]
    for one, other in zip(table, again, strict=True):
        for key in ("r", "X", "Y", "sigma_r"):
            assert other[key] == pytest.approx(one[key], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("far_first", [slow(True), False])
def test_a_centre_of_zoom_that_was_found_goes_into_the_cells_too(tmp_path, monkeypatch, far_first):
    """The near camera stands 6 cm aside: relief spreads from elsewhere than the nadir."""
    # Formulas that stand once for all rows are replaced in all of them.
    monkeypatch.setattr("bifocal.workbook.making.book.STRUCTURED_ROWS", 10)
    rng = np.random.default_rng(8)
    xyz = rng.uniform([-5, -3, -0.5], [5, 3, 0.6], (30, 3))
    xyz[:14, 2] = 0.0
    photos = (((0.0, 0.0), 17.5, 35), ((0.06, -0.04), 9.5, 19))
    seen = [
        (nadir + (xyz[:, :2] - nadir) * (d / (d - xyz[:, 2]))[:, None]) * c / d
        for nadir, d, c in photos
    ]
    lenses = ("--d1", 17.5, "--d2", 9.5, "--c1", 35, "--c2", 19)
    if not far_first:
        seen, lenses = seen[::-1], ("--d1", 9.5, "--d2", 17.5, "--c1", 19, "--c2", 35)
    rows = [
        f"P{i}," + ",".join(map(repr, row)) + (",PLANE" if i < 14 else ",")
        for i, row in enumerate(np.hstack(seen).tolist())
    ]
    table = write_csv(tmp_path / "p.csv", "\n".join(["id,x1,y1,x2,y2,code", *rows, ""]))
    path = tmp_path / "s.xlsx"
    assert run("solve", table, "--out", path, *lenses).exit_code == 0
    found = json.loads(run("solve", path, "--adjust-setup", "--json").stdout)["points"]
    away = np.hypot(xyz[:, 0], xyz[:, 1]) > 1.5
    relief = np.array([point["r"] for point in found], float)
    np.testing.assert_allclose(relief[away], xyz[away, 2], atol=1e-3)
    solved_in_place(path, "--adjust-setup")
    again = json.loads(run("solve", path, "--json").stdout)["points"]
    for one, other in zip(found, again, strict=True):
        for key in ("r", "X", "Y", "sigma_r"):
            assert other[key] == pytest.approx(one[key], rel=1e-9, abs=1e-12)
    if far_first:
        assert_recalculated_equals_cached(path, tmp_path)


@pytest.mark.acceptance
def test_another_language_changes_labels_and_nothing_the_user_wrote(tmp_path):
    path = with_own_chart(fill(tmp_path / "own.xlsx"))
    book = openpyxl.load_workbook(path)
    book["Points"]["K5"], book["Points"]["A20"] = "Point", "Results"
    book.save(path)
    solved_in_place(path, "--lang", "it")
    book = openpyxl.load_workbook(path)
    assert book["Points"]["A1"].value == "Punti misurati e loro rilievo"
    assert book["Points"]["A3"].value == "Punto"
    assert book["Points"]["K5"].value == "Point"
    assert '"tiene"' in book["Check"]["W13"].value
    assert "Pagina" in book["Setup"].oddFooter.right.text
    with zipfile.ZipFile(path) as package:
        assert b"Punti sul muro" in package.read("xl/charts/chart1.xml")
        assert b'="tiene"' in package.read("xl/worksheets/sheet5.xml")
    solved_in_place(path, "--lang", "en")
    assert openpyxl.load_workbook(path)["Points"]["A3"].value == "Point"


@pytest.mark.acceptance
@pytest.mark.office
def test_rows_below_the_prepared_ones_get_formulas(tmp_path):
    table = rows([(f"Q{i}", 1 + i / 50, 2, 0.3) for i in range(30)])
    path = with_own_chart(fill(tmp_path / "own.xlsx", table))
    solved_in_place(path)
    assert_recalculated_equals_cached(path, tmp_path)
    book = openpyxl.load_workbook(path, data_only=True)
    assert [book["Results"].cell(34, column).value for column in (1, 4)] == [
        "Q29",
        pytest.approx(0.3),
    ]
    assert book["Points"].tables["tblPoints"].ref.endswith("34")
    assert book["Results"].tables["tblResults"].ref.endswith("34")


@pytest.mark.acceptance
@pytest.mark.office
def test_a_row_inserted_without_formulas_gets_them(tmp_path):
    path = fill(tmp_path / "own.xlsx")
    book = openpyxl.load_workbook(path)
    sheet = book["Points"]
    for cell in sheet[6]:
        cell.value = None
    for column, value in enumerate(rows([("NEW", 1, 1, 0.7)])[0], start=1):
        sheet.cell(6, column, value)
    book.save(path)
    solved_in_place(path)
    assert_recalculated_equals_cached(path, tmp_path)
    assert openpyxl.load_workbook(path, data_only=True)["Results"]["D6"].value == pytest.approx(0.7)


@pytest.mark.acceptance
@pytest.mark.office
def test_check_and_control_points_below_their_tables_are_seen_by_every_sum(tmp_path):
    points = [(f"Q{i}", i / 5 - 3, 2.5 - i % 7, 0.1 * (i % 5)) for i in range(40)]
    checks = [(name, None, None, r + 0.01) for name, _, _, r in points[:30]]
    # Residuals of millimetres: of noughts none is the largest.
    control = [
        (name, 100 + x, 200 - r, 5 + y + 1e-4 * (i * i % 17))
        for i, (name, x, y, r) in enumerate(points)
    ]
    path = fill(tmp_path / "own.xlsx", rows(points), Check=checks, Georeference=control)
    solved_in_place(path)
    assert_recalculated_equals_cached(path, tmp_path)
    book = openpyxl.load_workbook(path, data_only=True)
    assert [book["Check"]["D5"].value, book["Georeference"]["B7"].value] == [30, 40]


@pytest.mark.acceptance
@pytest.mark.office
def test_deleted_rows_leave_no_errors_in_results(tmp_path):
    path = fill(tmp_path / "own.xlsx")
    book = openpyxl.load_workbook(path)
    book["Points"].delete_rows(20, 5)
    table = book["Points"].tables["tblPoints"]
    table.ref = re.sub(r"\d+$", "19", table.ref)
    book.save(path)
    for values in recalculated(path, tmp_path)["Results"].iter_rows(min_row=20, values_only=True):
        assert not any(values)
    solved_in_place(path)
    assert_recalculated_equals_cached(path, tmp_path)


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize(
    "title",
    [slow("Setup"), "Results", slow("Check"), slow("Georeference"), slow("Planning"), slow("Log")],
)
def test_a_sheet_that_is_missing_is_added(tmp_path, title):
    path = with_own_chart(fill(tmp_path / "own.xlsx"))
    book = openpyxl.load_workbook(path)
    del book[title]
    if title == "Setup":
        book.defined_names = {k: v for k, v in book.defined_names.items() if "Setup" not in
                              v.attr_text}  # fmt: skip
    book.save(path)
    solved_in_place(path, *(DISTANCES if title == "Setup" else ()))
    book = openpyxl.load_workbook(path)
    assert book.sheetnames[-2:] == ["My chart", title]
    if title in ("Setup", "Georeference"):
        assert_recalculated_equals_cached(path, tmp_path)
    assert json.loads(run("solve", path, "--json").stdout)["points"][0]["r"] == pytest.approx(1.0)


def test_a_text_table_is_not_replaced_by_its_own_results(tmp_path):
    path = write_csv(tmp_path / "p.csv", TABLE)
    result = run("solve", path, "--out", path, "--overwrite", *DISTANCES)
    assert result.exit_code == 1
    assert "p.csv: is one of the files that are read" in result.stderr
    assert path.read_text() == TABLE


@pytest.mark.acceptance
def test_a_result_is_replaced_until_somebody_else_saved_it(tmp_path):
    source, out = write_csv(tmp_path / "p.csv", TABLE), tmp_path / "r.xlsx"
    for _ in range(3):
        result = run("solve", source, "--out", out, "--overwrite", *DISTANCES)
        assert result.exit_code == 0, result.stderr
    with_own_chart(out)
    kept = out.read_bytes()
    result = run("solve", source, "--out", out, "--overwrite", *DISTANCES)
    assert result.exit_code == 1
    assert "r-result.xlsx" in result.stderr
    assert out.read_bytes() == kept


def test_a_result_with_a_part_put_in_is_no_longer_ours(tmp_path):
    source, out = write_csv(tmp_path / "p.csv", TABLE), tmp_path / "r.xlsx"
    assert run("solve", source, "--out", out, *DISTANCES).exit_code == 0
    with zipfile.ZipFile(out, "a") as package:
        package.writestr("xl/vbaProject.bin", b"MACROS")
    assert run("solve", source, "--out", out, "--overwrite", *DISTANCES).exit_code == 1


def commands(folder):
    """Every command that writes a new workbook, by its name."""
    source, solved = write_csv(folder / "p.csv", TABLE), folder / "solved.xlsx"
    assert run("solve", source, "--out", solved, *DISTANCES).exit_code == 0
    plan = ("plan", "--focal", 35, "--focal", 19, "--sensor", "36x24", "--pixels", "6000x4000")
    plan += ("--object", "10x6", "--scale", 500)
    return {
        "template": lambda out: ("template", out, "--rows", 3, "--overwrite"),
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
    proposed = "out2.xlsx" if name == "template" else "out-result.xlsx"
    # Without --overwrite too: the option would only lead into the same refusal.
    for arguments in (command(out), [a for a in command(out) if a != "--overwrite"]):
        result = run(*arguments)
        assert result.exit_code == 1
        assert proposed in result.stderr
        assert "add --overwrite" not in result.stderr
    assert out.read_bytes() == kept


@pytest.mark.acceptance
def test_a_changed_copy_never_replaces_another_workbook_of_the_user(tmp_path):
    source, out = fill(tmp_path / "s.xlsx"), own_table(tmp_path / "mine.xlsx")
    kept = out.read_bytes()
    result = run("solve", source, "--out", out, "--overwrite")
    assert result.exit_code == 1
    assert "mine-result.xlsx" in result.stderr
    assert out.read_bytes() == kept
    for _ in range(2):
        copy = tmp_path / "copy.xlsx"
        assert run("solve", source, "--out", copy, "--overwrite").exit_code == 0


@pytest.mark.acceptance
def test_the_mode_of_a_workbook_changed_in_place_stays_and_a_link_is_followed(tmp_path):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    real, link = fill(folder / "s.xlsx"), tmp_path / "link.xlsx"
    real.chmod(0o600)
    link.symlink_to(real)
    before = real.read_bytes()
    result = run("solve", link, "--out", link, "--overwrite")
    assert result.exit_code == 0, result.stderr
    assert link.is_symlink()
    assert real.stat().st_mode & 0o777 == 0o600
    backup = tmp_path / "link.xlsx.bak"
    assert backup.read_bytes() == before
    assert backup.stat().st_mode & 0o777 == 0o600
    assert str(backup) in result.stderr


@pytest.mark.acceptance
def test_the_first_state_stays_in_its_backup(tmp_path):
    path = fill(tmp_path / "s.xlsx")
    assert run("solve", path, "--out", path).exit_code == 1
    states = []
    for number in range(3):
        states.append(path.read_bytes())
        result = run("solve", path, "--out", path, "--overwrite")
        assert result.exit_code == 0
        assert openpyxl.load_workbook(path)["Log"][f"C{5 + number}"].value == "solved"
        backup = path.with_name(f"s.xlsx.bak{number + 1 if number else ''}")
        assert f"is kept as {backup}." in result.stderr
    for name, state in zip(("s.xlsx.bak", "s.xlsx.bak2", "s.xlsx.bak3"), states, strict=True):
        assert (tmp_path / name).read_bytes() == state


@pytest.mark.acceptance
def test_a_backup_of_somebody_else_is_not_replaced(tmp_path):
    path = fill(tmp_path / "s.xlsx", setup=SETUP)
    before = path.read_bytes()
    (tmp_path / "s.xlsx.bak").write_text("mine")
    assert run("solve", path, "--out", path, "--overwrite").exit_code == 0
    assert (tmp_path / "s.xlsx.bak").read_text() == "mine"
    assert (tmp_path / "s.xlsx.bak2").read_bytes() == before


@pytest.mark.acceptance
def test_a_coordinate_survey_becomes_one_for_pixels_in_a_new_workbook_only(tmp_path):
    pair = write_pair(
        tmp_path / "wall.pair.json", image1_principal_distance=35, image2_principal_distance=19
    )
    table = write_csv(tmp_path / "p.csv", TABLE)
    path = tmp_path / "survey.xlsx"
    assert run("solve", table, "--out", path, *DISTANCES).exit_code == 0
    with_own_chart(path)
    before = path.read_bytes()
    for more in ((), ("--overwrite",)):
        result = run("solve", path, "--pair", pair, "--out", path, *more)
        assert result.exit_code == 1
        assert result.stderr.count("\n") == 1
        assert "--out survey-result.xlsx; this one stays as it is" in result.stderr
        assert path.read_bytes() == before
    out = tmp_path / "survey-result.xlsx"
    result = run("solve", path, "--pair", pair, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert "a new workbook; survey.xlsx stays as it is, and what else it holds" in result.stderr
    assert "My chart" in result.stderr
    assert path.read_bytes() == before
    again = run("solve", out, "--json")
    assert again.exit_code == 0, again.stderr
    assert json.loads(again.stdout)["points"]
    # The way out of the other direction is the same.
    result = run("solve", out, "--out", out, "--overwrite")
    assert result.exit_code == 0, result.stderr


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "names",
    [
        ("g_alarm",),
        ("g_space", "g_space_block"),
        ("enlargement_1", "enlargement_2", "setup_missing"),
    ],
)
def test_a_workbook_of_an_earlier_version_goes_into_a_new_one(tmp_path, names):
    path, out = tmp_path / "s.xlsx", tmp_path / "s-result.xlsx"
    table = write_csv(tmp_path / "p.csv", TABLE)
    assert run("solve", table, "--out", path, *DISTANCES).exit_code == 0
    truth = json.loads(run("solve", path, "--json").stdout)["points"]
    book = openpyxl.load_workbook(path)
    for name in names:
        del book.defined_names[name]
    book.save(path)
    before = path.read_bytes()
    result = run("solve", path, "--out", path, "--overwrite")
    assert (result.exit_code, result.stderr.count("\n")) == (1, 1)
    assert f"{path}: was made by an earlier version" in result.stderr
    assert "--out s-result.xlsx" in result.stderr
    assert path.read_bytes() == before
    assert run("solve", path, "--out", out).exit_code == 0
    assert path.read_bytes() == before
    assert json.loads(run("solve", out, "--json").stdout)["points"] == truth
    solved_in_place(out)
