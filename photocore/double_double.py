"""Arithmetic with twice the digits: a number is the unevaluated sum of two float64.

For the rare residual that cancels: about 31 digits, where numpy has no wider type on Windows and
macOS. Values must stay below 1e150 (the splitting of a product squares them).

References
----------
.. [1] Dekker, "A floating-point technique for extending the available precision", Numerische
   Mathematik 18, 1971.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray

_SPLITTER = 134217729.0  # 2**27 + 1


class DoubleDouble(NamedTuple):
    """The exact sum high + low, low below half a unit of high's last digit."""

    high: FloatArray
    low: FloatArray


def exact(value: ArrayLike) -> DoubleDouble:
    """Return a float64 value as it is."""
    high = np.asarray(value, dtype=np.float64)
    return DoubleDouble(high, np.zeros_like(high))


def product(a: ArrayLike, b: ArrayLike) -> DoubleDouble:
    """Return the exact product of two float64 values."""
    x, y = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    high = np.asarray(x * y)
    x1, y1 = _upper_half(x), _upper_half(y)
    x2, y2 = x - x1, y - y1
    return DoubleDouble(high, ((x1 * y1 - high) + x1 * y2 + x2 * y1) + x2 * y2)


def add(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """Return a + b."""
    high = a.high + b.high
    back = high - a.high
    low = (a.high - (high - back)) + (b.high - back)
    return _tidy(high, low + (a.low + b.low))


def subtract(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """Return a - b."""
    return add(a, DoubleDouble(-b.high, -b.low))


def multiply(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """Return a b."""
    whole = product(a.high, b.high)
    return _tidy(whole.high, whole.low + (a.high * b.low + a.low * b.high))


def divide(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """Return a / b."""
    first = np.asarray(a.high / b.high)
    rest = subtract(a, multiply(exact(first), b))
    return _tidy(first, rest.high / b.high)


def square_root(a: DoubleDouble) -> DoubleDouble:
    """Return the square root of a, a > 0."""
    first = np.sqrt(a.high)
    rest = subtract(a, product(first, first))
    return _tidy(first, rest.high / (2 * first))


def _upper_half(x: FloatArray) -> FloatArray:
    """Return the upper 26 bits of a value (Veltkamp's splitting)."""
    spread = _SPLITTER * x
    return np.asarray(spread - (spread - x))


def _tidy(high: FloatArray, low: FloatArray) -> DoubleDouble:
    """Return high + low with low below half a unit of the last digit."""
    whole = np.asarray(high + low)
    return DoubleDouble(whole, np.asarray(low - (whole - high)))
