"""Numbers that are none, or too large to be one, are refused by name."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import InputError
from photocore.arrays import as_floats, is_finite_number, positive


@pytest.mark.parametrize(
    "value", [10**400, [1, -(10**400)], 10**5000], ids=["one", "among others", "very long"]
)
def test_a_whole_number_beyond_float64_is_refused(value: object) -> None:
    with pytest.raises(InputError, match=r"^width: holds a whole number above 1\.8e\+308\.$"):
        as_floats(value, "width")


@pytest.mark.parametrize(
    "value", ["a", "17.5", ["1", "2"], [1, [2, 3]], {}, [None, "x"], [[0, True], [1.5, 2]]]
)
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(InputError, match=r"^width: expected numbers"):
        as_floats(value, "width")


@pytest.mark.parametrize("value", [[1, 2], [], [[1, 2], [3, 4]]])
def test_one_number_is_one(value: object) -> None:
    with pytest.raises(InputError, match=r"^width: expected one number, found shape"):
        positive(value, "width")


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2), [2.0], np.array([[2]])])
def test_a_single_number_may_come_in_brackets(value: object) -> None:
    assert positive(value, "width") == 2.0


def test_what_a_file_holds_is_a_finite_number_or_not() -> None:
    assert all(map(is_finite_number, [0, -1, 1.5, 10**300, -1.7e308]))
    assert not any(
        map(is_finite_number, [True, "1", None, [], np.nan, np.inf, 10**309, -(10**5000)])
    )
