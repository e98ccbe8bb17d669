"""A third of the slow tests runs at a commit, and three turns run all of them."""

from __future__ import annotations

import ast
from functools import cache

from tests.planted_faults import ROOT
from tests.turns import LATER, THIRDS, is_in_turn, turn_of

NAMES = [f"tests/test_wall.py::test_a_wall[{number}]" for number in range(300)]


def test_every_slow_test_has_one_turn_of_three_and_the_turns_are_even():
    thirds = [{name for name in NAMES if is_in_turn(name, str(turn))} for turn in range(THIRDS)]
    assert sorted(name for third in thirds for name in third) == sorted(NAMES)
    assert all(70 < len(third) < 130 for third in thirds)


def test_the_commit_chooses_the_turn_and_all_run_without_one():
    assert [turn_of(commit) for commit in ("f0", "f1", "f2")] == ["0", "1", "2"]
    assert turn_of("") == "all"
    assert all(is_in_turn(name, "all") for name in NAMES)


@cache
def names_in(file: str) -> set[str]:
    """Return the names of a file's tests, those of classes too."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_what_waits_is_a_test_and_so_is_the_one_that_holds_its_promise_and_does_not_wait():
    for name in (*LATER, *LATER.values()):
        file, _, test = name.partition("::")
        assert test.partition("[")[0].rpartition("::")[2] in names_in(file), name
    assert not LATER.keys() & set(LATER.values())
