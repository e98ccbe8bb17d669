"""Tuned numbers: every one says what it is, is used, and cannot be changed on the way."""

import ast
import dataclasses
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = sorted(path.parent for path in ROOT.glob("bifocal/**/tuning.py"))


def module_of(room: Path) -> str:
    return ".".join((room / "tuning").relative_to(ROOT).parts)


def numbers(room: Path) -> set[str]:
    """Return the numbers of a room, as `STAGE.name`."""
    return {
        f"{stage}.{field.name}"
        for stage, value in vars(importlib.import_module(module_of(room))).items()
        if stage.isupper()
        for field in dataclasses.fields(value)
    }


def uses(room: Path) -> set[str]:
    """Return all that the package asks of a room's tuning, as `STAGE.name`."""
    asked = set()
    for path in ROOT.glob("bifocal/**/*.py"):
        text = path.read_text("utf-8")
        for names in re.findall(rf"from {module_of(room)} import (\([^)]*\)|.*)", text):
            for stage in re.findall(r"[A-Z]\w+", names):
                found = re.findall(rf"\b{stage}\.(\w+)", text)
                assert found, f"{path} imports {stage} and asks nothing of it"
                asked |= {f"{stage}.{name}" for name in found}
    return asked


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.name)
def test_every_tuned_number_is_a_typed_field_that_says_what_it_is(room):
    text = (room / "tuning.py").read_text("utf-8")
    lines = text.splitlines()
    for stage in (node for node in ast.parse(text).body if isinstance(node, ast.ClassDef)):
        assert ast.get_docstring(stage), stage.name
        for field in (node for node in stage.body if isinstance(node, ast.AnnAssign)):
            above = lines[field.lineno - 2].strip()
            assert above.startswith("#: "), lines[field.lineno - 1]
            assert above.endswith((".", "]")), lines[field.lineno - 1]
            assert ast.unparse(field.annotation).startswith(("int", "float", "tuple["))
            assert field.value is not None


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.name)
def test_no_tuned_number_can_be_changed_on_the_way(room):
    for name in sorted(numbers(room)):
        stage, _, number = name.partition(".")
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(getattr(importlib.import_module(module_of(room)), stage), number, 0)


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.name)
def test_every_tuned_number_is_used(room):
    assert uses(room) == numbers(room)
