"""``multimedia shift`` and ``multimedia template`` as a user runs them."""

from __future__ import annotations

import json
from pathlib import Path

import openpyxl
import pytest
from click.testing import CliRunner, Result

from multimedia import Layers, radial_shift
from photocore.workbook.changing.editor import WorkbookEditor
from tests.builders.commands import multimedia_command as main
from tests.rounding import EPS

TANK = ("--indices", "1,1.5,1.34", "--thicknesses", "0.01", "--camera", "0.2,0.1,0.51")
LAYERS = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(0.01,))
POINTS = "Point,X [m],Y [m],Z [m],note\nP1,0.5,0.5,-0.2,rim\n007,0.2,0.1,-0.1,\n"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def points(tmp_path: Path) -> Path:
    path = tmp_path / "points.csv"
    path.write_text(POINTS, encoding="utf-8")
    return path


def test_csv_in_csv_out(points: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    result = run("shift", points, *TANK, "--out", out)
    assert result.exit_code == 0, result.stderr
    lines = out.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "id,X,Y,Z,R,ZP,Rbar,dR,Xbar,Ybar,flag"
    row = dict(zip(lines[0].split(","), lines[1].split(","), strict=True))
    # Camera 0.5 m above the glass; R = 0.5 (3-4-5), depth 0.2.
    exact = float(radial_shift(0.5, z0=0.5, zp=0.2, layers=LAYERS))
    assert float(row["R"]) == pytest.approx(0.5, rel=4 * EPS)
    assert float(row["Rbar"]) == pytest.approx(exact, rel=4 * EPS)
    assert float(row["Xbar"]) == pytest.approx(0.2 + 0.3 * exact / 0.5, rel=16 * EPS)
    assert lines[2].startswith("007,")


def test_json_is_one_object_and_nothing_else(points: Path) -> None:
    data = json.loads(run("shift", points, *TANK, "--json").stdout)
    assert [point["id"] for point in data["points"]] == ["P1", "007"]
    assert data["points"][1]["Rbar"] == 0
    assert data["setup"]["z0"] == pytest.approx(0.5)


def test_workbook_out_and_in_again_keeps_points_and_set_up(points: Path, tmp_path: Path) -> None:
    book, back = tmp_path / "out.xlsx", tmp_path / "back.csv"
    assert run("shift", points, *TANK, "--out", book).exit_code == 0
    once = json.loads(run("shift", points, *TANK, "--json").stdout)
    again = run("shift", book, "--json", "--out", back)
    assert again.exit_code == 0, again.stderr
    twice = json.loads(again.stdout)
    for one, two in zip(once["points"], twice["points"], strict=True):
        assert two["id"] == one["id"]
        assert two["Rbar"] == pytest.approx(one["Rbar"], rel=16 * EPS, abs=1e-300)
        assert two["Xbar"] == pytest.approx(one["Xbar"], rel=16 * EPS)


def test_options_override_the_workbook(points: Path, tmp_path: Path) -> None:
    book = tmp_path / "out.xlsx"
    run("shift", points, *TANK, "--out", book)
    data = json.loads(run("shift", book, "--z0", "0.7", "--indices", "1,1.337", "--json").stdout)
    assert data["setup"] == {
        "indices": [1.0, 1.337], "thicknesses": [], "z0": 0.7, "nadir": [0.2, 0.1],
    }  # fmt: skip


def test_german_table_with_radius_and_depth(tmp_path: Path) -> None:
    path, out = tmp_path / "punkte.csv", tmp_path / "out.csv"
    path.write_text("Punkt;Radius [mm];Tiefe [mm]\n1;100,5;50\n", encoding="utf-8")
    result = run(
        "shift", path, "--z0", "500", "--indices", "1,1.337", "--out", out, "--csv", "excel-de"
    )
    assert result.exit_code == 0, result.stderr
    exact = float(radial_shift(100.5, z0=500.0, zp=50.0, layers=Layers(indices=(1.0, 1.337))))
    fields = out.read_text(encoding="utf-8-sig").splitlines()[1].split(";")
    assert float(fields[3].replace(",", ".")) == pytest.approx(exact, rel=4 * EPS)


def test_template_filled_in_by_hand_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "tank.xlsx"
    assert run("template", path, "--rows", "3").exit_code == 0
    sheet = openpyxl.load_workbook(path)["Multimedia"]
    head = next(r for r in range(1, 40) if sheet.cell(r, 1).value == "id")
    editor = WorkbookEditor(path)
    for column, value in ((1, "A"), (5, 120.0), (6, 80.0)):
        editor.set_value("Multimedia", head + 1, column, value)
    editor.save()
    # The index of the last medium is a formula, which only a spreadsheet program recalculates.
    editor = WorkbookEditor(path)
    editor.set_result("Multimedia", 7, 2, 1.33464)
    editor.save()
    result = run("shift", path, "--json")
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    layers = Layers(indices=(1.0, 1.5, 1.33464), thicknesses=(10.0,))
    exact = float(radial_shift(120.0, z0=500.0, zp=80.0, layers=layers))
    assert data["points"][0]["Rbar"] == pytest.approx(exact, rel=16 * EPS)


def test_dry_and_incomplete_points_are_named_by_cell(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("id,X,Y,Z\nA,1,2,-3\nB,1,2,0.4\nC,1,,-2\n", encoding="utf-8")
    result = run("shift", path, *TANK, "--json")
    assert result.exit_code == 1
    assert "points.csv › D3 (Z): the point is 0.4 above" in result.stderr
    assert "points.csv › B4 (X): is blank" in result.stderr
    assert result.stdout == ""


def test_a_camera_below_the_interface_is_refused(points: Path) -> None:
    result = run("shift", points, *TANK[:4], "--camera", "0,0,-0.5", "--json")
    assert result.exit_code == 1
    assert "must be above them" in result.stderr


def test_millimetres_among_metres_are_noted(points: Path) -> None:
    result = run("shift", points, "--indices", "1,1.5,1.34", "--thicknesses", "10", "--z0", "0.5",
                 "--json")  # fmt: skip
    assert "thicknesses in mm and the rest in m" in result.stderr


def test_swapped_glass_and_water_are_noted(points: Path) -> None:
    result = run("shift", points, "--indices", "1,1.33,1.46", "--thicknesses", "0.01", "--z0", "1",
                 "--json")  # fmt: skip
    assert result.exit_code == 0
    assert "swapped" in result.stderr


def test_unseen_points_are_flagged(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("id,R,ZP\nA,0.5,1\nB,9,1\n", encoding="utf-8")
    result = run("shift", path, "--z0", "0", "--indices", "1,1.34", "--json")
    data = json.loads(result.stdout)
    assert [point["flag"] for point in data["points"]] == ["OK", "NO-RAY"]
    assert data["points"][1]["Rbar"] is None
    assert "1 points cannot be seen from the camera, no ray gets there: B." in result.stderr


def test_headings_in_different_units_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("id,X [m],Y [m],Z [mm]\nA,1,2,-300\n", encoding="utf-8")
    result = run("shift", path, *TANK, "--json")
    assert result.exit_code == 1
    assert "mix m and mm" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--z0", "1"], "refractive indices are not known"),
        (["--indices", "1,1.34"], "camera's position is not known"),
        (["--indices", "1,0.5", "--z0", "1"], "medium 2 has refractive index 0.5"),
        (["--indices", "1,1.5,1.34", "--z0", "1"], "found 0 thicknesses"),
        (["--indices", "1,1.34", "--z0", "-1"], "above the first interface"),
    ],
)
def test_set_ups_without_meaning_are_refused(
    arguments: list[str], message: str, points: Path
) -> None:
    result = run("shift", points, *arguments, "--json")
    assert result.exit_code == 1
    assert message in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [["--z0", "1"], ["--z0", "1", "--camera", "1,2,3", "--json"], ["--camera", "1,2", "--json"]],
)
def test_wrong_usage_ends_with_two(arguments: list[str], points: Path) -> None:
    assert run("shift", points, *arguments).exit_code == 2


def test_existing_files_stay_unless_told_otherwise(points: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_text("mine", encoding="utf-8")
    assert run("shift", points, *TANK, "--out", out).exit_code == 1
    assert out.read_text(encoding="utf-8") == "mine"
    assert run("shift", points, *TANK, "--out", out, "--overwrite").exit_code == 0
    assert run("template", out).exit_code == 1


def test_other_kinds_of_files_are_refused(points: Path, tmp_path: Path) -> None:
    result = run("shift", points, *TANK, "--out", tmp_path / "out.pdf")
    assert result.exit_code == 1
    assert ".xlsx or .csv" in result.stderr
    missing = run("shift", tmp_path / "none.csv", *TANK, "--json")
    assert missing.exit_code == 1
    assert "no such file" in missing.stderr


def test_a_table_without_coordinates_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("id,X,Y\nA,1,2\n", encoding="utf-8")
    result = run("shift", path, *TANK, "--json")
    assert result.exit_code == 1
    assert "needs the columns X, Y, Z" in result.stderr


def test_a_result_shifted_again_with_another_camera_is_refused(
    points: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.csv"
    assert run("shift", points, *TANK, "--out", out).exit_code == 0
    assert run("shift", out, *TANK, "--json").exit_code == 0
    other = run("shift", out, *TANK[:4], "--camera", "0,0,0.51", "--json")
    assert other.exit_code == 1
    assert "E2 (R): found 0.5, but 0.707106781 follows from X, Y and the camera" in other.stderr
