"""Mutants: single-line faults drawn at random, and which of them the nearest tests miss.

    .venv/bin/python -m tests.mutants --seed 7 --count 100 --jobs 2
    .venv/bin/python -m tests.mutants --seed 7 --count 100 --whole   survivors by all tests too

One fault a module, modules drawn by their length: an operator, sign, comparison or constant. The
nearest tests are the module's own examples and the test files that import it over the fewest other
modules. Where the list of `tests.planted_faults` is one's own choice, this one flatters nobody. A
survivor is mended by a test that fails with it, or changes nothing that anyone could see.
"""

from __future__ import annotations

import argparse
import ast
import queue
import random
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from tests.planted_faults import ROOT, copied_tree, first_failure, noticed_by

PACKAGES = ("bifocal", "multimedia", "photocore")
_OPERATORS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"), ast.Mod: ("%", "*"), ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"), ast.And: ("and", "or"), ast.Or: ("or", "and"),
    ast.Lt: ("<", "<=", ">"), ast.LtE: ("<=", "<", ">="), ast.Gt: (">", ">=", "<"),
    ast.GtE: (">=", ">", "<="), ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is"), ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"), ast.USub: ("-", ""), ast.Not: ("not ", ""),
}  # fmt: skip
_SKIPPED = ("annotation", "returns", "decorator_list", "type_params")


@dataclass(frozen=True, slots=True)
class Mutant:
    """A place in a line of a file (bytes from `column` on), what stands there and takes its place.

    Its form is that of `tests.planted_faults.Fault`: it can be planted in the file's text.
    """

    file: str
    line: int
    column: int
    old: str
    new: str

    def planted(self, text: str) -> str:
        """Return the file's text with the fault in it."""
        lines = text.split("\n")
        line, end = lines[self.line - 1].encode(), self.column + len(self.old.encode())
        lines[self.line - 1] = (line[: self.column] + self.new.encode() + line[end:]).decode()
        return "\n".join(lines)

    def __str__(self) -> str:
        right = (ROOT / self.file).read_text(encoding="utf-8")
        was, now = (t.split("\n")[self.line - 1].strip() for t in (right, self.planted(right)))
        return f"{self.file}:{self.line} {self.old!r} -> {self.new!r}\n    - {was}\n    + {now}"


def _nodes(node: ast.AST) -> Iterator[ast.AST]:
    """Walk what is calculated: no types, no decorators, no f-strings (they tell no columns)."""
    yield node
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            skip = name in _SKIPPED or isinstance(child, ast.JoinedStr)
            if isinstance(child, ast.AST) and not skip:
                yield from _nodes(child)


def _places(node: ast.AST) -> Iterator[tuple[ast.AST, ast.expr, ast.expr]]:
    """Return the operators of a node, each with what stands before and after it."""
    match node:
        case ast.BinOp():
            yield node.op, node.left, node.right
        case ast.BoolOp():
            yield from ((node.op, a, b) for a, b in zip(node.values, node.values[1:], strict=False))
        case ast.Compare():
            yield from zip(node.ops, [node.left, *node.comparators], node.comparators, strict=False)


def _altered(value: float) -> str:
    if isinstance(value, float):
        return repr(2 * value or 1.0)
    return str(value + 1)


def mutants_of(file: str, text: str) -> list[Mutant]:
    """Return every mutant of a file."""
    lines = [line.encode() for line in text.split("\n")]
    found = []
    for node in _nodes(ast.parse(text)):
        for operator, left, right in _places(node):
            old, *others = _OPERATORS.get(type(operator), ("",))
            start = (left.end_col_offset or 0) if left.end_lineno == right.lineno else 0
            column = lines[right.lineno - 1].find(old.encode(), start, right.col_offset)
            if column >= 0:
                found += [Mutant(file, right.lineno, column, old, new) for new in others]
        match node:
            case ast.UnaryOp(op=ast.USub() | ast.Not()):
                old, new = _OPERATORS[type(node.op)]
                found.append(Mutant(file, node.lineno, node.col_offset, old, new))
            case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
                old = lines[node.lineno - 1][node.col_offset : node.end_col_offset].decode()
                new = _altered(node.value)
                found.append(Mutant(file, node.lineno, node.col_offset, old, new))
            case ast.Name(id="min" | "max"):
                new = "max" if node.id == "min" else "min"
                found.append(Mutant(file, node.lineno, node.col_offset, node.id, new))
    return found


def drawn(root: Path, seed: int, count: int) -> list[Mutant]:
    """Draw mutants, at most one a module: modules by length, then a line, then a fault in it."""
    dice = random.Random(seed)
    files = sorted(file for package in PACKAGES for file in (root / package).rglob("*.py"))
    texts = {file: file.read_text(encoding="utf-8") for file in files}
    ranks = {file: dice.random() ** (1 / (len(texts[file]) + 1)) for file in files}
    found: list[Mutant] = []
    for file in sorted(files, key=ranks.__getitem__, reverse=True):
        by_line = defaultdict(list)
        for mutant in mutants_of(file.relative_to(root).as_posix(), texts[file]):
            by_line[mutant.line].append(mutant)
        if by_line and len(found) < count:
            found.append(dice.choice(by_line[dice.choice(sorted(by_line))]))
    return found


def _imported(module: str, text: str, is_package: bool) -> Iterator[tuple[str, str]]:
    """Return the modules and names that a module imports."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = module.split(".")
            up = parts[: len(parts) - node.level + is_package] if node.level else []
            source = ".".join([*up, *([node.module] if node.module else [])])
            yield from ((source, alias.name) for alias in node.names)


def importers(root: Path) -> dict[str, set[str]]:
    """Return which files import a file; public names count as imports of where they are made."""
    files = {}
    for package in (*PACKAGES, "tests"):
        for file in (root / package).rglob("*.py"):
            parts = file.relative_to(root).with_suffix("").parts
            files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    public = {}
    for stub in (one for part in PACKAGES for one in (root / part).rglob("__init__.pyi")):
        package = ".".join(stub.relative_to(root).parent.parts)
        for source, name in _imported(package, stub.read_text("utf-8"), True):
            public[package, name] = source
    for package, name in list(public):  # a package may offer what the door of a room does
        public[package, name] = public.get((public[package, name], name), public[package, name])
    found = defaultdict(set)
    for module, file in files.items():
        text = file.read_text(encoding="utf-8")
        for source, name in _imported(module, text, file.stem == "__init__"):
            known = (
                f"{source}.{name}" if f"{source}.{name}" in files else public.get((source, name))
            )
            if target := files.get(known or source):
                found[target.relative_to(root).as_posix()].add(file.relative_to(root).as_posix())
        if file.parent.name == "cli":  # commands are loaded by name
            found[file.relative_to(root).as_posix()].add(f"{file.parts[-3]}/cli/main.py")
    return found


def nearest_tests(file: str, by: dict[str, set[str]], most: int) -> list[str]:
    """Return the test files that import a file over the fewest others.

    Of equals, those of its own folder come first, and those named like it.
    """
    room, words = f"tests/{Path(file).parent.as_posix()}/", Path(file).stem.split("_")

    def rank(test: str) -> tuple[bool, bool, str]:
        return not test.startswith(room), not any(word in test for word in words), test

    seen, ring, tests = {file}, {file}, []
    while ring and len(tests) < most:
        ring = set().union(*(by.get(one, set()) for one in ring)) - seen
        seen |= ring
        near = (one for one in ring if Path(one).name.startswith("test_"))
        tests += sorted(near, key=rank)
    return tests[:most]


def judged(tree: Path, mutant: Mutant, tests: list[str], given: argparse.Namespace) -> str:
    """Return what became of a mutant, and by which test."""
    try:
        name = noticed_by(tree, mutant, tests, given.seconds)
        if not name and given.whole:
            name = noticed_by(tree, mutant, [])
        if not name:
            return "SURVIVES"
        red = name != "conftest.py" and first_failure(tree, [name], given.seconds)
        return f"red without it: {name}" if red else f"noticed by {name}"
    except subprocess.TimeoutExpired:
        return "runs on"


def main() -> int:
    """Draw mutants, run their nearest tests, print the survivors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2, help="test runs at once")
    parser.add_argument("--tests", type=int, default=12, help="most test files for a mutant")
    parser.add_argument("--seconds", type=float, default=600, help="most time for a mutant")
    parser.add_argument("--whole", action="store_true", help="survivors by the whole suite too")
    given = parser.parse_args()
    mutants, by = drawn(ROOT, given.seed, given.count), importers(ROOT)
    trees: queue.SimpleQueue[Path] = queue.SimpleQueue()

    def fate(mutant: Mutant) -> str:
        tree = trees.get()
        try:
            own = [mutant.file] if ">>> " in (ROOT / mutant.file).read_text("utf-8") else []
            word = judged(tree, mutant, own + nearest_tests(mutant.file, by, given.tests), given)
        finally:
            trees.put(tree)
        sys.stdout.write(f"{word}: {mutant}\n")
        sys.stdout.flush()
        return word.split()[0]

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(given.jobs) as pool:
        for job in range(given.jobs):
            trees.put(copied_tree(Path(folder) / str(job)))
        words = list(pool.map(fate, mutants))
    noticed = words.count("noticed")
    sys.stdout.write(f"{noticed} of {len(words)} noticed, {words.count('SURVIVES')} survive\n")
    return int(noticed < len(words))


if __name__ == "__main__":
    sys.exit(main())
