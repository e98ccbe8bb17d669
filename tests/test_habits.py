"""Version, changelog, citation and hooks say the same thing."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]


def test_changelog_and_citation_have_the_version_of_the_package() -> None:
    sections = re.findall(
        r"^## (\S+) \((\d{4}-\d\d-\d\d)\)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M
    )
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert sections[0][0] == VERSION
    numbers = [tuple(map(int, version.split("."))) for version, _ in sections]
    assert numbers == sorted(numbers, reverse=True)
    assert [day for _, day in sections] == sorted((day for _, day in sections), reverse=True)
    assert f"\nversion: {VERSION}\ndate-released: {sections[0][1]}\n" in citation


def test_papers_in_the_citation_are_those_the_tests_check() -> None:
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    for path in (ROOT / "tests" / "papers").glob("test_*.py"):
        name = path.stem.split("_")[1].capitalize()
        assert f"family-names: {name}" in citation, path.name


def test_commands_named_for_contributors_exist() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    for script in re.findall(r"\.ci/\w+", page):
        assert (ROOT / script).exists(), script
    for target in re.findall(r"\]\(([^)#]+)\)", page):
        assert (ROOT / target).exists(), target
    steps = re.search(r"only these steps: (.*)", (ROOT / ".ci" / "check").read_text("utf-8"))[1]
    for step in steps.split(", "):
        assert f"\n        {step})" in (ROOT / ".ci" / "check").read_text("utf-8")


def test_hooks_fetch_nothing() -> None:
    hooks = (ROOT / ".pre-commit-config.yaml").read_text("utf-8")
    assert "http" not in hooks
    assert re.findall(r"- repo: (\S+)", hooks) == ["local"]


def test_the_plan_of_a_room_names_all_of_its_modules() -> None:
    rooms = "bifocal/campaigns bifocal/faces bifocal/matching bifocal/relief_maps bifocal/survey"
    for room in (*rooms.split(), "multimedia/refraction", "multimedia/tracking"):
        plan = (ROOT / room / "__init__.py").read_text("utf-8")
        modules = {path.stem for path in (ROOT / room).glob("*.py")} - {"__init__"}
        assert modules == set(re.findall(r"`(\w+)`", plan)), room


#: Names of values that say where a thing was instead of what it is, and how many there are: the
#: number may only fall.
HISTORIES = {
    "own", "other", "told", "said", "seen", "found", "given", "known", "asked", "made", "there",
    "stands", "left", "taken", "wanted",
}  # fmt: skip
MOST_HISTORIES = 343
#: Maps of which no type checker knows what they hold: the number may only fall, too.
MOST_UNTYPED = 88


def test_names_that_tell_a_history_and_maps_to_anything_grow_no_more() -> None:
    bound = untyped = 0
    for package in ("bifocal", "multimedia", "photocore"):
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                    bound += node.id in HISTORIES
                elif isinstance(node, ast.arg):
                    bound += node.arg in HISTORIES
                elif isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple):
                    is_map = getattr(node.value, "id", "") in ("dict", "Mapping", "MutableMapping")
                    untyped += is_map and getattr(node.slice.elts[-1], "id", "") == "Any"
    assert bound <= MOST_HISTORIES, "say what a new value is: a noun of the field"
    assert bound > MOST_HISTORIES - 40, f"lower MOST_HISTORIES to {bound}"
    assert untyped <= MOST_UNTYPED, "say what a new map holds: a TypedDict, a class, objects"
    assert untyped > MOST_UNTYPED - 20, f"lower MOST_UNTYPED to {untyped}"
