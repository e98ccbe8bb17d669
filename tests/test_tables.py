"""A table of cases in one test tries all and names every one that fails."""

from __future__ import annotations

import pytest

from tests.tables import each


def test_all_cases_are_tried_and_those_that_fail_are_named(tmp_path):
    tried = []

    @each(("number", "text"), [(1, "a"), pytest.param(2, "b", id="second"), (3, "c"), (4, "d")])
    def odd(number, text, folder):
        tried.append(text)
        assert folder == tmp_path
        if number == 4:
            pytest.fail("four")
        assert number % 2

    with pytest.raises(AssertionError, match=r"(?s)2 of 4\nsecond: .*\n4, d: Failed: four"):
        odd(folder=tmp_path)
    assert tried == list("abcd")


@each("number", [1, 2], ids=["one", "two"])
@pytest.mark.parametrize("sign", [1, -1])
def test_fixtures_and_parameters_reach_the_cases(number, sign, tmp_path):
    assert number * sign
    assert tmp_path.exists()
