"""What a test may want that a machine with nothing but Python lacks; its marker decides.

A test is marked ``office``, ``browser`` or, by taking ``data_dir``, ``data``. Where that lacks it
is skipped, which one line tells; where ``CI_FULL`` is set, all must be there, and it fails.
"""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

import pytest

#: Marker -> what it wants.
KINDS = {"office": "LibreOffice", "browser": "Chromium", "data": "data"}
_FIXTURES = {"browser": "browser", "data_dir": "data"}


def soffice() -> str | None:
    """Return where LibreOffice is."""
    return shutil.which("soffice") or shutil.which("libreoffice")


def chromium() -> str | None:
    """Return where Debian's or the user's Chromium is, if it can be driven."""
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    if find_spec("playwright") is None:
        return None
    return next(filter(None, map(shutil.which, names)), None)


def data() -> str | None:
    """Return the folder of real example data."""
    folder = os.environ.get("BIFOCAL_DATA")
    return folder if folder and Path(folder).is_dir() else None


PLACES = {"office": soffice, "browser": chromium, "data": data}


def mark(items: Iterable[pytest.Item]) -> None:
    """Mark the tests whose fixtures want something."""
    for item in items:
        for fixture in getattr(item, "fixturenames", ()):
            if fixture in _FIXTURES:
                item.add_marker(_FIXTURES[fixture])


def check(item: pytest.Item) -> None:
    """Skip a test that wants what is not there; fail it where all must be there."""
    lacks = [KINDS[kind] for kind in KINDS if item.get_closest_marker(kind) and not PLACES[kind]()]
    if lacks and os.environ.get("CI_FULL"):
        pytest.fail(f"CI_FULL is set, and there is no {lacks[0]}", pytrace=False)
    if lacks:
        pytest.skip(f"wants {lacks[0]}")


def place(kind: str) -> str:
    """Return where the thing is that a test asks for; a test without the marker is at fault."""
    if found := PLACES[kind]():
        return found
    pytest.fail(f"there is no {KINDS[kind]}: mark this test {kind!r}")


def summary(reasons: Iterable[str]) -> str:
    """Return one line that counts the reasons of skips, those of equipment first."""
    counts = Counter(reasons)
    parts = [f"{counts.pop(f'wants {name}', 0)} want {name}" for name in KINDS.values()]
    parts = [part for part in parts if not part.startswith("0 ")]
    parts += [f"{count} {reason}" for reason, count in sorted(counts.items())]
    return "skipped: " + ", ".join(parts) if parts else ""
