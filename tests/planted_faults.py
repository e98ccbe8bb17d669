"""Planted faults: single lines made wrong, each of which the default tests must notice.

    .venv/bin/python -m tests.planted_faults             every fault by its nearest tests, 15 min
    .venv/bin/python -m tests.planted_faults --whole     survivors by the whole default suite too
    .venv/bin/python -m tests.planted_faults 3 17        some of them

They stand in `tests/planted_faults.toml`. Not collected by pytest; `tests/test_planted_faults.py`
only holds that every fault still fits the code. A fault is planted in a copy of the tree, never in
the tree itself.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True, slots=True)
class Fault:
    """A text that occurs once in a file, what takes its place, and the tests nearest to it."""

    file: str
    right: str
    wrong: str
    tests: str

    def planted(self, text: str) -> str:
        """Return the file's text with the fault in it."""
        if text.count(self.right) != 1:
            raise ValueError(f"{self.file}: {self.right!r} stands {text.count(self.right)} times")
        return text.replace(self.right, self.wrong)


FAULTS = tuple(
    Fault(file["name"], right, wrong, file["tests"])
    for file in tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))["file"]
    for right, wrong in file["lines"]
)


def copied_tree(folder: Path) -> Path:
    """Copy every file that git knows into a folder; return it."""
    names = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
    ).stdout.split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


class Planted(Protocol):
    """A fault that can be planted in the text of a file."""

    @property
    def file(self) -> str: ...  # from the root of the tree

    def planted(self, text: str) -> str: ...


def first_failure(tree: Path, tests: list[str], seconds: float | None = None) -> str:
    """Return the first test that fails in a copy of the tree, "" if none does."""
    with subprocess.Popen(
        [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:cacheprovider",
         *(["-n", "0"] if tests else []), *tests],
        cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
        env={name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
        | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"},
    ) as run:  # fmt: skip
        try:
            said = run.communicate(timeout=seconds)[0].decode(errors="replace")
        except BaseException:
            os.killpg(run.pid, signal.SIGKILL)  # with what the tests started
            raise
    if run.returncode in (0, 5):  # 5: no tests were found
        return ""
    if named := re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", said, re.M):
        return str(named[-1])
    if "while loading conftest" in said:
        return "conftest.py"
    raise RuntimeError(f"pytest ended with {run.returncode}: {said[-2000:]}")


def noticed_by(tree: Path, fault: Planted, tests: list[str], seconds: float | None = None) -> str:
    """Return the first test that fails with the fault planted in a copy of the tree, or ""."""
    path = tree / fault.file
    right = path.read_text(encoding="utf-8")
    path.write_text(fault.planted(right), encoding="utf-8")
    try:
        return first_failure(tree, tests, seconds)
    finally:
        path.write_text(right, encoding="utf-8")


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> int:
    """Plant the faults one by one; say which are noticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("numbers", nargs="*", type=int, help="faults to plant, from 1; default all")
    parser.add_argument("--whole", action="store_true", help="survivors by the whole suite too")
    given = parser.parse_args()
    numbers = given.numbers or range(1, len(FAULTS) + 1)
    survivors = []
    with tempfile.TemporaryDirectory() as folder:
        tree = copied_tree(Path(folder))
        for number in numbers:
            fault, begin = FAULTS[number - 1], time.monotonic()
            noticed = noticed_by(tree, fault, fault.tests.split())
            if not noticed and given.whole:
                noticed = noticed_by(tree, fault, [])
            seconds = time.monotonic() - begin
            word = "noticed " if noticed else "SURVIVES"
            _say(
                f"{number:3} {word} {seconds:4.0f} s  {fault.file}: {fault.right} -> {fault.wrong}"
            )
            if not noticed:
                survivors.append(number)
    _say(f"{len(numbers) - len(survivors)} of {len(numbers)} noticed; survivors: {survivors}")
    return bool(survivors)


if __name__ == "__main__":
    sys.exit(main())
