"""Twice-the-digits arithmetic against exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from photocore import double_double as dd
from photocore.double_double import DoubleDouble


def fraction(value: DoubleDouble) -> Fraction:
    return Fraction(float(value.high)) + Fraction(float(value.low))


def test_product_of_two_floats_is_exact() -> None:
    rng = np.random.default_rng(1)
    for x, y in rng.normal(size=(50, 2)):
        assert fraction(dd.product(x, y)) == Fraction(float(x)) * Fraction(float(y))


@pytest.mark.parametrize("operation", ["add", "subtract", "multiply", "divide"])
def test_operations_keep_thirty_digits(operation: str) -> None:
    rng = np.random.default_rng(2)
    for values in rng.uniform(1, 2, (50, 4)):
        a, b = dd.product(values[0], values[1]), dd.product(values[2], values[3])
        x, y = fraction(a), fraction(b)
        truth = {"add": x + y, "subtract": x - y, "multiply": x * y, "divide": x / y}[operation]
        found = fraction(getattr(dd, operation)(a, b))
        assert abs(found - truth) <= Fraction(1, 10**30)


def test_square_root_squares_to_its_argument() -> None:
    root = dd.square_root(dd.exact(np.array(2.0)))
    assert abs(fraction(root) ** 2 - 2) < Fraction(1, 10**30)
