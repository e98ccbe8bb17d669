"""Rows of control that are switched off are left out and named; what the reader says is told."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pytest

from bifocal import Pair
from bifocal.networks.joint_control import named_positions
from bifocal.networks.joint_workflow import JointResult
from bifocal.orientation.control_points import read_control
from bifocal.reports.control_survey import solve_control

HEADINGS = ("id", "X", "Y", "r", "col1", "row1", "col2", "row2")
ROWS = [(f"P{k}", k, 2 * k, 0, 10 * k, 20 * k, 11 * k, 21 * k) for k in range(1, 7)]


def control(path: Path):
    return read_control(path, sigma=0.003, sigma_plane=0.005)


def as_csv(folder: Path, rows, headings=HEADINGS) -> Path:
    path = folder / "control.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in [headings, *rows]) + "\n")
    return path


@pytest.mark.parametrize("mark", ["#", "# ", "//"])
def test_a_row_behind_a_comment_mark_is_left_out_and_said(tmp_path, mark):
    rows = [(f"{mark}{row[0]}", *row[1:]) if row[0] == "P3" else row for row in ROWS]
    points = control(as_csv(tmp_path, rows))
    assert points.ids == ("P1", "P2", "P4", "P5", "P6")
    assert points.pixels1[2].tolist() == [40, 80]
    assert any("begin with # or //: row 4" in text for text in points.remarks)


def test_names_that_all_begin_with_a_hash_are_names(tmp_path):
    points = control(as_csv(tmp_path, [(f"#{row[0]}", *row[1:]) for row in ROWS]))
    assert points.ids == tuple(f"#P{k}" for k in range(1, 7))


@pytest.mark.parametrize("word", ["no", "0", "nein"])
def test_a_row_with_use_no_is_left_out_by_name(tmp_path, word):
    rows = [(*row, word if row[0] in ("P2", "P5") else "yes") for row in ROWS]
    points = control(as_csv(tmp_path, rows, (*HEADINGS, "use")))
    assert points.ids == ("P1", "P3", "P4", "P6")
    assert points.xyz[1].tolist() == [3, 6, 0]
    assert any("left out: P2, P5." in text for text in points.remarks)


def test_a_table_without_any_of_it_reads_as_before_and_says_nothing(tmp_path):
    points = control(as_csv(tmp_path, ROWS))
    assert points.ids == tuple(f"P{k}" for k in range(1, 7))
    assert points.remarks == ()


def test_hidden_rows_are_used_and_said(tmp_path):
    book = openpyxl.Workbook()
    for row in [HEADINGS, *ROWS]:
        book.active.append(row)
    book.active.row_dimensions[4].hidden = True
    book.save(tmp_path / "control.xlsx")
    points = control(tmp_path / "control.xlsx")
    assert len(points.ids) == 6
    assert any("1 hidden or filtered rows are used too" in text for text in points.remarks)


def with_p2_off(folder: Path) -> Path:
    rows = [(*row, "no" if row[0] == "P2" else "yes") for row in ROWS]
    return as_csv(folder, rows, (*HEADINGS, "use"))


def test_the_joint_adjustment_says_which_rows_took_no_part(tmp_path):
    named = named_positions(
        [tmp_path / "a.json"], [Pair.ideal(d1=17.5, d2=9.5)], control=(with_p2_off(tmp_path),)
    )
    assert "P2" not in named.ids
    assert any("left out: P2." in text for text in named.remarks)
    result = JointResult(pairs=(), names=(), adjustment=None, points=(), remarks=named.remarks)
    assert result.remarks == named.remarks


def test_the_report_of_control_says_which_rows_took_no_part(tmp_path):
    control = with_p2_off(tmp_path)
    pair = tmp_path / "a.pair.json"
    Pair.ideal(d1=17.5, d2=9.5, c1=35, c2=19, pixel_size=0.01).write(pair)
    solved = solve_control(pair, control=control)
    assert "P2" not in solved.points.ids
    assert any("left out: P2." in text for text in solved.remarks)
