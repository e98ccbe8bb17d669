"""Errors at check points and what drawing scale they hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import InputError, KnownPoints, ReliefTable, ToleranceRule
from bifocal.survey.check_points import check_points
from bifocal.survey.tolerances import RULES, judge, sentence


def table(z):
    n = len(z)
    columns = {"X": np.zeros(n), "Y": np.ones(n), "Z": np.array(z, dtype=float)}
    columns |= dict.fromkeys(("sigma_X", "sigma_Y", "sigma_r"), np.full(n, 0.01))
    return ReliefTable(
        ids=tuple(f"P{i}" for i in range(n)), columns=columns, flags=("OK",) * n,
        standardised=np.zeros(n), of_pixels={}, image_scale=500.0,
    )  # fmt: skip


def relief(names, values):
    nothing = np.full(len(names), np.nan)
    return KnownPoints(ids=tuple(names), xyz=np.stack([nothing, nothing, values], axis=-1))


def test_known_points_are_called_as_those_measured_unless_two_would_be_one():
    known = relief(["P1", "007"], [0.1, 0.2])
    assert known.called_as(["p1", "7"]).ids == ("p1", "7")
    both = relief(["7", "07"], [0.1, 0.2])
    assert both.called_as(["007"]) is both


def test_statistics_of_three_errors_by_hand():
    # Errors 0.01, -0.02, 0.02 m: RMSE sqrt((1 + 4 + 4)/3) cm, mean 1/3 cm, largest 2 cm.
    check = check_points(table([0.11, 0.18, 0.32]), relief(["P0", "P1", "P2"], [0.1, 0.2, 0.3]))
    axis = check.axes["Z"]
    assert axis.n == 3
    assert axis.rmse == pytest.approx(np.sqrt(3) / 100)
    assert axis.mean == pytest.approx(1 / 300)
    assert axis.max_abs == pytest.approx(0.02)
    assert check.axes["X"].n == 0


def test_a_point_that_was_not_measured_is_named_and_does_not_count():
    check = check_points(table([0.1]), relief(["P0", "P9"], [0.1, 0.2]))
    assert check.missing == ("P9",)
    assert check.axes["Z"].n == 1


def test_a_point_set_aside_does_not_count():
    known = KnownPoints(ids=("P0",), xyz=[[np.nan, np.nan, 5.0]], use=[False])
    check = check_points(table([0.1]), known)
    assert check.axes["Z"].n == 0
    assert check.verdicts == ()


def test_verdict_names_the_finest_scale_held_and_the_next_that_fails():
    # 0.18 mm at 1:50 is 9 mm, at 1:20 3.6 mm.
    assert sentence(judge(0.008, RULES[:1])) == "0.18 mm: holds 1:50 (9 mm), fails 1:20 (3.6 mm)"
    assert sentence(judge(0.001, RULES[:1])) == "0.18 mm: holds 1:10 (1.8 mm)"
    assert sentence(judge(1.0, RULES[:1])) == "0.18 mm: fails 1:500 (90 mm)"


def test_fixed_tolerances_speak_only_of_their_scales():
    assert [v.scale for v in judge(0.02, RULES[2:])] == [20, 50, 100]
    assert sentence(judge(0.02, RULES[2:])) == (
        "Eckstein III/IV: holds 1:50 (25 mm), fails 1:20 (10 mm)"
    )


def test_a_rule_needs_one_kind_of_tolerance():
    with pytest.raises(InputError, match="one of them"):
        ToleranceRule(key="x", name="x")


def test_flagged_points_are_named_and_do_not_count():
    flags = ("OK", "OFF-RADIAL", "UNCERTAIN", "WEAK", "ON-PLANE", "CHECK")
    measured = replace(table([0.11, 9.0, 8.0, 0.42, 0.5, np.nan]), flags=flags)
    known = relief([f"P{i}" for i in range(6)], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    check = check_points(measured, known)
    assert check.flagged == {"P1": "OFF-RADIAL", "P2": "UNCERTAIN", "P5": "CHECK"}
    assert check.axes["Z"].n == 3
    assert check.axes["Z"].max_abs == pytest.approx(0.02)
    assert np.isnan(check.errors[[1, 2, 5]]).all()
    (said,) = check.remarks
    assert "P1 (OFF-RADIAL), P2 (UNCERTAIN), P5 (CHECK)" in said
    unused = check_points(measured, replace(known, use=np.array([True, False, False] * 2)))
    assert unused.flagged == {}


def test_errors_are_told_in_sigmas_of_the_point():
    check = check_points(table([0.11, 0.2]), relief(["P0", "P1"], [0.1, 0.26]))
    np.testing.assert_allclose(check.standardised[:, 2], [1.0, -6.0])
    assert np.isnan(check.standardised[:, :2]).all()
