"""Least squares against problems with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from photocore.adjustment import DenseEquations, fit, minimise
from photocore.errors import ConvergenceError, GeometryError

X = np.arange(6.0)
Y = np.array([1.1, 2.9, 5.2, 6.8, 9.1, 10.9])


def line(state):
    return state[0] + state[1] * X - Y, np.stack([np.ones_like(X), X], axis=1)


def move(state, step):
    return state + step


def test_a_straight_line_equals_the_textbook_formulas():
    got = fit(np.zeros(2), line, move, names=("a", "b"), what="line")
    # b = Sxy / Sxx with Sxx = 17.5; sigma_b^2 = sigma0^2 / Sxx
    b = ((X - 2.5) * (Y - Y.mean())).sum() / 17.5
    assert got.state == pytest.approx([Y.mean() - 2.5 * b, b], rel=1e-10)
    assert got.linear.cofactor[1, 1] == pytest.approx(1 / 17.5, rel=1e-12)
    assert got.redundancy == 4
    assert got.linear.redundancy_numbers.sum() == pytest.approx(4.0, rel=1e-12)
    v = got.state[0] + got.state[1] * X - Y
    assert got.sigma0 == pytest.approx(np.sqrt(v @ v / 4), rel=1e-12)


def test_rosenbrocks_valley_is_followed_to_its_end():
    def valley(s):
        return np.array([10 * (s[1] - s[0] ** 2), 1 - s[0]]), np.array(
            [[-20 * s[0], 10], [-1, 0.0]]
        )

    got = minimise(np.array([-1.2, 1.0]), valley, move)
    assert got.state == pytest.approx([1.0, 1.0], abs=1e-10)
    assert got.iterations < 30


def test_the_unit_of_an_unknown_does_not_matter():
    def scaled(s):
        return s[0] + 1e9 * s[1] * X - Y, np.stack([np.ones_like(X), 1e9 * X], axis=1)

    plain = fit(np.zeros(2), line, move, names=("a", "b"), what="line")
    got = fit(np.zeros(2), scaled, move, names=("a", "b"), what="line")
    assert got.state * (1, 1e9) == pytest.approx(plain.state, rel=1e-11)


def test_unknowns_that_act_only_together_are_named():
    def double(s):
        return (s[0] + s[1]) * X - Y, np.stack([X, X], axis=1)

    residuals, jacobian = double([0, 0])
    equations = DenseEquations(residuals=residuals, jacobian=jacobian)
    assert equations.undetermined(("a", "b")) == ["a", "b"]
    with pytest.raises(GeometryError, match="cannot determine a, b"):
        fit(np.zeros(2), double, move, names=("a", "b"), what="line")


def test_an_unknown_without_effect_is_named():
    jacobian = np.array([[1.0, 0.0], [2.0, 0.0]])
    equations = DenseEquations(residuals=np.zeros(2), jacobian=jacobian)
    assert equations.undetermined(("a", "b")) == ["b"]


def test_an_impossible_start_is_refused():
    with pytest.raises(GeometryError, match="start values"):
        minimise(np.zeros(2), lambda _: None, move)


def test_an_adjustment_that_does_not_settle_says_so():
    def runaway(s):
        return np.exp(-s * 0.01), -0.01 * np.exp(-s * 0.01)[:, None]

    with pytest.raises(ConvergenceError, match="does not settle"):
        fit(np.zeros(1), runaway, move, names=("a",), what="decay", most=5)
