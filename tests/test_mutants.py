"""The tool of `tests/mutants.py` draws faults that fit, and tells noticed ones from survivors."""

from __future__ import annotations

import ast

import pytest

from tests.mutants import drawn, importers, mutants_of, nearest_tests
from tests.planted_faults import noticed_by

WALL = """from __future__ import annotations

HALF = 0.5


def gap(a: float, b: float | None = -1.0) -> float:
    if b is None or a > b:
        return min(a, (HALF * (a)
                       - 2))
    return a  # é - 1
"""


@pytest.fixture
def tree(tmp_path):
    """A tree of two modules, one over the other, and two tests."""
    for name, text in {
        "bifocal/__init__.py": "",
        "bifocal/__init__.pyi": "from .wall import gap\n",
        "bifocal/wall.py": WALL,
        "bifocal/rooms/house.py": "from ..wall import gap\n\n_GAPS = [gap(5, 3)]\n",
        "tests/bifocal/test_wall.py": "from bifocal.wall import gap\n\n\n"
        "def test_a_gap():\n    assert gap(5, 3) == 0.5\n",
        "tests/test_front_door.py": "from bifocal import gap\n",
        "tests/bifocal/rooms/test_house.py": "from bifocal.rooms import house\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_every_operator_sign_comparison_and_constant_is_a_mutant_and_no_type_is():
    found = mutants_of("wall.py", WALL)
    assert {(m.line, m.old, m.new) for m in found} == {
        (3, "0.5", "1.0"), (6, "-", ""), (6, "1.0", "2.0"), (7, "is", "is not"), (7, "or", "and"),
        (7, ">", ">="), (7, ">", "<"), (8, "min", "max"), (8, "*", "/"), (9, "-", "+"),
        (9, "2", "3"),
    }  # fmt: skip
    for mutant in found:
        assert ast.dump(ast.parse(mutant.planted(WALL))) != ast.dump(ast.parse(WALL))


def test_a_seed_draws_the_same_mutants_again_and_one_a_module(tree):
    first = drawn(tree, seed=7, count=5)
    assert first == drawn(tree, seed=7, count=5)
    assert sorted(mutant.file for mutant in first) == ["bifocal/rooms/house.py", "bifocal/wall.py"]
    assert len({tuple(drawn(tree, seed=seed, count=5)) for seed in range(20)}) > 10


def test_the_nearest_tests_import_the_module_by_the_fewest_steps(tree):
    by = importers(tree)
    direct = ["tests/bifocal/test_wall.py", "tests/test_front_door.py"]
    assert nearest_tests("bifocal/wall.py", by, 9) == [*direct, "tests/bifocal/rooms/test_house.py"]
    assert nearest_tests("bifocal/wall.py", by, 2) == direct


def test_a_mutant_is_noticed_by_the_test_that_fails_with_it_and_the_tree_is_as_before(tree):
    text = (tree / "bifocal/wall.py").read_text("utf-8")
    half, equal = (
        next(m for m in mutants_of("bifocal/wall.py", text) if m.old == old and m.new == new)
        for old, new in (("0.5", "1.0"), (">", ">="))
    )
    tests = ["tests/bifocal/test_wall.py"]
    assert noticed_by(tree, half, tests) == "tests/bifocal/test_wall.py::test_a_gap"
    assert noticed_by(tree, equal, tests) == ""
    assert (tree / "bifocal/wall.py").read_text("utf-8") == text
