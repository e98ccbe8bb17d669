"""The table of dear tests: a new one needs a reason, a slow machine needs none."""

from __future__ import annotations

import json

from tests.costs import TABLE, slowness, unexplained

KNOWN = {"a": (2.0, "the whole survey"), "b": (4.0, "the real photos"), "c": (3.0, "")}


def test_a_dear_test_without_a_reason_is_named_and_one_with_a_reason_is_not():
    seconds = {"a": 2.2, "b": 3.9, "new": 1.8, "cheap": 0.3, "c": 3.0}
    assert unexplained(seconds, KNOWN) == {"c": 3.0, "new": 1.8}


def test_a_machine_half_as_fast_is_known_by_the_tests_of_the_table():
    seconds = {"a": 4.0, "b": 8.4, "new": 2.9, "c": 6.0}
    assert slowness(seconds, KNOWN) == 2.0
    assert unexplained(seconds, KNOWN) == {"c": 6.0}
    assert slowness({"new": 9.0}, KNOWN) == 1.0


def test_every_line_of_the_table_says_what_only_its_test_sees():
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    assert all(cost > 1 and len(why.split()) > 3 for cost, why in table.values())
