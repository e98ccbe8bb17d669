"""Changes of the set-up typed into the sheet `WhatIf`: what becomes of every relief."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import openpyxl
import pytest

from bifocal import InputError, Taking, solve
from bifocal.workbook.content import SurveyContent
from bifocal.workbook.formulas.columns import CHANGED
from bifocal.workbook.making.book import build, write_book
from bifocal.workbook.template_workflow import write_template
from tests.bifocal.workbook.filled_forms import SETUP, fill, named, run
from tests.bifocal.workbook.test_survey_workbook import (
    assert_recalculated_equals_cached,
    ideal_content,
)

PICKS = {"id": ["a", "b"], "s1": [4.2, 9.0], "s2": [4.5, 8.9], "theta": [90, 30]}
TAKING = Taking(d1=17.5, d2=9.5, c1=35.0, c2=19.0)


def what_if(taking, changes):
    """Return the columns of the sheet for the two points, and its workbook."""
    content = replace(SurveyContent.of(solve(PICKS, taking=taking)), changes=changes)
    built = build(content)
    return {k: np.array(v[:2], float) for k, v in built.tables["tblWhatIf"].cells.items()
            if k != "id"}, built  # fmt: skip


def test_a_change_gives_the_relief_that_the_changed_set_up_gives():
    changes = {"d_1": 0.03, "d_2": -0.02, "c_1": 0.1, "c_2": 0.05, "pitch": 0.0}
    cells, built = what_if(TAKING, changes)
    before = solve(PICKS, taking=TAKING).table
    for name in CHANGED[:4]:
        key = name.replace("_", "")
        taking = replace(TAKING, **{key: getattr(TAKING, key) + changes[name]})
        by_change = solve(PICKS, taking=taking).table["r"] - before["r"]
        np.testing.assert_allclose(cells[f"by_{name}"], by_change, rtol=1e-9)
        assert built.value_of(f"effect_max_by_{name}") == pytest.approx(np.abs(by_change).max())
    whole = Taking(d1=17.53, d2=9.48, c1=35.1, c2=19.05)
    solved = solve(PICKS, taking=whole).table
    np.testing.assert_allclose(cells["r_new"], solved["r"], rtol=1e-10)
    moved = np.hypot(solved["X"], solved["Y"]) - np.hypot(before["X"], before["Y"])
    np.testing.assert_allclose(cells["moved"], moved, atol=1e-12)
    rms = np.sqrt(np.mean((solved["r"] - before["r"]) ** 2))
    assert built.value_of("effect_rms_change") == pytest.approx(rms, rel=1e-9)


def test_the_size_of_a_pixel_moves_points_and_leaves_their_relief():
    taking = replace(TAKING, pitch=0.004)
    cells, _ = what_if(taking, dict.fromkeys(CHANGED, 0.0) | {"pitch": 0.00004})
    table = solve(PICKS, taking=TAKING).table
    np.testing.assert_allclose(cells["by_pitch"], 0, atol=1e-15)
    np.testing.assert_allclose(cells["moved"], 0.01 * np.hypot(table["X"], table["Y"]), rtol=1e-9)


@pytest.mark.acceptance
def test_changes_that_were_typed_are_solved_in_place(tmp_path):
    points = [dict(zip(PICKS, values, strict=True)) for values in zip(*PICKS.values(), strict=True)]
    setup, path = {**SETUP, "change_d_2": 0.1}, tmp_path / "trial.xlsx"
    fill(path, points, setup, ("--what-if", "--rows", 8))
    result = run("solve", path, "--out", path, "--overwrite")
    assert result.exit_code == 0, result.stderr
    book = openpyxl.load_workbook(path, data_only=True)
    before = solve(PICKS, taking=TAKING).table["r"]
    assert named(book, "new_d_2").value == pytest.approx(9.6)
    by_d_2 = solve(PICKS, taking=replace(TAKING, d2=9.6)).table["r"] - before
    assert named(book, "effect_max_by_d_2").value == pytest.approx(np.abs(by_d_2).max(), rel=1e-9)
    whole = Taking(d1=17.51, d2=9.6, c1=35.05, c2=19.05)
    change = solve(PICKS, taking=whole).table["r"] - before
    rms = np.sqrt(np.mean(change**2))
    assert named(book, "effect_rms_change").value == pytest.approx(rms, rel=1e-9)


@pytest.mark.acceptance
@pytest.mark.office
def test_the_formulas_recalculated_by_libreoffice_equal_the_library(tmp_path):
    changes = {"d_1": 0.02, "c_2": 0.1, "pitch": 0.0001}
    content = replace(ideal_content(), changes=changes, language="it")
    write_book(tmp_path / "trial.xlsx", content)
    assert assert_recalculated_equals_cached(tmp_path / "trial.xlsx", tmp_path) > 3000


def test_it_is_for_photos_in_air(tmp_path):
    with pytest.raises(InputError, match="what_if"):
        write_template(tmp_path / "no.xlsx", what_if=True, media=3)


def test_where_nothing_was_typed_a_tape_and_a_calibration_are_what_is_doubted():
    """10 mm of either distance, 0.05 mm of either principal distance, and nothing of the pixel."""
    shown, typed = (
        what_if(TAKING, changes)[0]
        for changes in ({}, {"d_1": 0.01, "d_2": 0.01, "c_1": 0.05, "c_2": 0.05, "pitch": 0.0})
    )
    assert shown.keys() == typed.keys()
    for key, values in shown.items():
        np.testing.assert_array_equal(values, typed[key], err_msg=key)
