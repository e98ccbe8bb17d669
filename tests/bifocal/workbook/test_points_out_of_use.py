"""A point with ``use`` = 0 in `Points` is neither check nor control point, and that is said."""

from __future__ import annotations

import numpy as np
import openpyxl
import pytest

from tests.bifocal.workbook.filled_forms import POINTS, by_id, fill, run, solved
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached

NAMES = tuple(name for name, *_ in POINTS)
BAD = NAMES[0]


def with_known_points(path, use, off=0.0):
    """All points are check and control points; the first is known wrong by half a metre.

    Coordinates of check points are ``off``, in turns high and low, and control points millimetres:
    the errors of exact points are rounding, in which no two programs agree.
    """
    moved = {n: (x, y, z + 0.5 * (n == BAD)) for n, x, y, z in POINTS}
    noise = np.random.default_rng(1).normal(0, 0.001, (len(POINTS), 3))
    exact = np.array([(1000 + x, 2000 - z, 50 + y) for x, y, z in moved.values()])
    world = [(n, *row) for n, row in zip(NAMES, (exact + noise).tolist(), strict=True)]
    fill(
        path,
        Check=[
            (n, *(v + off * (-1) ** i for v in xyz)) for i, (n, xyz) in enumerate(moved.items())
        ],
        Georeference=world,
    )
    book = openpyxl.load_workbook(path)
    heads = {cell.value: cell.column for cell in book["Points"][4]}
    book["Points"].cell(5, heads["use"], use)
    book.save(path)
    return path


@pytest.mark.acceptance
def test_a_point_out_of_use_is_neither_check_nor_control_point(tmp_path):
    answer, said = solved(with_known_points(tmp_path / "a.xlsx", 0))
    assert f"Check: {BAD} takes no part: use = 0 in Points." in said
    assert f"Georeference: {BAD} takes no part: use = 0 in Points." in said
    assert answer["check"]["n"] == len(POINTS) - 1
    assert answer["check"]["max_abs"] < 1e-6
    used = {point["id"]: point["used"] for point in answer["georeference"]["residuals"]}
    assert used == {name: name != BAD for name in NAMES}
    # In use, the error counts.
    answer, said = solved(with_known_points(tmp_path / "b.xlsx", 1))
    assert answer["check"]["max_abs"] == pytest.approx(0.5, abs=1e-6)
    assert "takes no part" not in said
    assert by_id(answer)[BAD]["flag"] == "OK"


@pytest.mark.office
@pytest.mark.acceptance
def test_the_sheets_say_the_same_new_and_in_place(tmp_path):
    path = with_known_points(tmp_path / "a.xlsx", 0, off=0.01)
    assert run("solve", path, "--out", path, "--overwrite").exit_code == 0
    assert_recalculated_equals_cached(path, tmp_path)
    check = openpyxl.load_workbook(path, data_only=True)["Check"]
    assert check["B5"].value == len(POINTS) - 1
    assert check["B9"].value == pytest.approx(0.01, abs=1e-6)
