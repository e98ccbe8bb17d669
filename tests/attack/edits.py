"""What exchanges one thing in a file that is well else."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path


def edited(name: str, *path: object, value: object) -> Callable[[Path], str]:
    """Return what makes a JSON file with one value exchanged, or taken out (...)."""

    def make(folder: Path) -> str:
        data = json.loads((folder / name).read_text())
        place = data
        for key in path[:-1]:
            place = place[key]
        if value is ...:
            del place[path[-1]]
        else:
            place[path[-1]] = value
        return json.dumps(data)

    return make


def swapped(name: str, old: str, new: str) -> Callable[[Path], str]:
    """Return what makes a text file with one passage exchanged."""

    def make(folder: Path) -> str:
        text = (folder / name).read_text()
        assert old in text, (name, old)
        return text.replace(old, new, 1)

    return make


def row(name: str, line: str) -> Callable[[Path], str]:
    """Return what makes a text file with one more line."""
    return lambda folder: (folder / name).read_text() + line + "\n"
