"""Tuned numbers: every one says what it is, is used, and cannot be changed on the way.

    .venv/bin/python -m tests.test_tuning     writes anew which numbers modules state

A number that is changed on purpose changes its line in `golden/stated_numbers.txt`; no other does.
"""

import ast
import dataclasses
import importlib
import re
from operator import attrgetter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXTS = {path: path.read_text("utf-8") for path in sorted(ROOT.glob("bifocal/**/*.py"))}
#: Modules with classes of tuned numbers.
MODULES = [path for path, text in TEXTS.items() if re.search(r"^class \w+Tuning:", text, re.M)]

#: Every tuned number, by module: the values that the evidence beside them was measured with.
TUNED = (ROOT / "tests/golden/tuned_numbers.txt").read_text("utf-8")

#: What modules state of other numbers.
STATED = ROOT / "tests/golden/stated_numbers.txt"


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def numbers(path: Path) -> set[str]:
    """Return the numbers of a module, as `STAGE.name`."""
    stages = re.findall(r"^([A-Z]\w*) = \w+Tuning\(\)$", TEXTS[path], re.M)
    module = importlib.import_module(name_of(path))
    fields = {stage: dataclasses.fields(getattr(module, stage)) for stage in stages}
    assert len(fields) == len(re.findall(r"^class \w+Tuning:", TEXTS[path], re.M)), path
    return {f"{stage}.{field.name}" for stage in stages for field in fields[stage]}


def uses(path: Path) -> set[str]:
    """Return all that the package takes of a module's tuned numbers, as `STAGE.name`."""
    stages = {number.partition(".")[0] for number in numbers(path)}
    listed = {path: stages}
    for importing, text in TEXTS.items():
        for names in re.findall(rf"from {name_of(path)} import (\([^)]*\)|.*)", text):
            imported = stages & set(re.findall(r"[A-Z]\w+", names))
            for stage in imported:
                assert re.search(rf"\b{stage}\.\w", text), f"{importing} has no use for {stage}"
            listed.setdefault(importing, set()).update(imported)
    return {
        f"{stage}.{name}"
        for importing, taken in listed.items()
        for stage in taken
        for name in re.findall(rf"(?<![\w.]){stage}\.(\w+)", TEXTS[importing])
    }


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_every_tuned_number_is_a_typed_field_that_says_what_it_is(path):
    lines = TEXTS[path].splitlines()
    for stage in (node for node in ast.parse(TEXTS[path]).body if isinstance(node, ast.ClassDef)):
        if not stage.name.endswith("Tuning"):
            continue
        assert ast.get_docstring(stage), stage.name
        for field in (node for node in stage.body if isinstance(node, ast.AnnAssign)):
            above = lines[field.lineno - 2].strip()
            assert above.startswith("#: "), lines[field.lineno - 1]
            assert above.endswith((".", "]")), lines[field.lineno - 1]
            assert ast.unparse(field.annotation).startswith(("int", "float", "tuple["))
            assert field.value is not None


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_no_tuned_number_can_be_changed_on_the_way(path):
    for name in sorted(numbers(path)):
        stage, _, number = name.partition(".")
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(getattr(importlib.import_module(name_of(path)), stage), number, 0)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_every_tuned_number_is_used(path):
    assert uses(path) == numbers(path)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_a_tuned_number_is_the_one_that_its_evidence_was_measured_with(path):
    """One that is changed wants its evidence measured anew, then its line among the golden ones."""
    module = importlib.import_module(name_of(path))
    lines = [f"{number} = {attrgetter(number)(module)!r}" for number in sorted(numbers(path))]
    block = "\n".join([f"[{name_of(path)}]", *lines]) + "\n"
    assert f"\n{block}\n" in f"\n{TUNED}\n", block


def stated(path: Path) -> list[str]:
    """Return the numbers that a module states outside of what it works out, by name.

    Constants, fields of classes and defaults of parameters; of long tables count and sum.
    """
    data, lines = path.read_bytes(), list[str]()
    rows = data.split(b"\n")

    def source(node: ast.expr) -> str:
        first, last = node.lineno - 1, node.end_lineno or node.lineno
        part = [*rows[first : last - 1], rows[last - 1][: node.end_col_offset]]
        part[0] = part[0][node.col_offset :]
        return " ".join(b"\n".join(part).decode().split())

    def add(name: str, value: ast.expr) -> None:
        constants = [node.value for node in ast.walk(value) if isinstance(node, ast.Constant)]
        numbers = [n for n in constants if type(n) in (int, float)]
        stands = source(value)
        if len(stands) > 60:
            stands = f"{len(numbers)} numbers, together {sum(numbers):.12g}"
        if numbers:
            lines.append(f"{name} = {stands}")

    for node in ast.walk(ast.parse(data)):
        if isinstance(node, ast.FunctionDef):
            place, words = [*node.args.posonlyargs, *node.args.args], node.args
            pairs = [*zip(reversed(place), reversed(words.defaults), strict=False)]
            for word, value in (*pairs, *zip(words.kwonlyargs, words.kw_defaults, strict=True)):
                if value is not None:
                    add(f"{node.name}({word.arg})", value)
        elif isinstance(node, ast.Module | ast.ClassDef):
            of = "" if isinstance(node, ast.Module) else f"{node.name}."
            for line in node.body if not of.endswith("Tuning.") else ():
                if isinstance(line, ast.Assign | ast.AnnAssign) and line.value is not None:
                    target = line.targets[0] if isinstance(line, ast.Assign) else line.target
                    add(of + source(target), line.value)
    return lines


def all_stated() -> str:
    """Return the stated numbers of all modules."""
    blocks = []
    for package in ("bifocal", "multimedia", "photocore"):
        for path in sorted((ROOT / package).rglob("*.py")):
            if lines := stated(path):
                blocks.append("\n".join([f"[{name_of(path)}]", *lines]))
    return "\n\n".join(blocks) + "\n"


def test_no_number_that_a_module_states_is_changed_by_accident():
    """Limits, physical constants and defaults act far from where tests look, or seldom."""
    golden, now = ({*block.split("\n\n")} for block in (STATED.read_text("utf-8"), all_stated()))
    way = "On purpose? .venv/bin/python -m tests.test_tuning writes them anew.\n"
    assert now == golden, way + "\n".join(sorted(now ^ golden))


if __name__ == "__main__":
    STATED.write_text(all_stated(), "utf-8")
