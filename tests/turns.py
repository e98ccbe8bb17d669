"""Turns of the slow tests: of those marked `acceptance`, a run of everything takes a third.

Which third, the commit's hash says, so that landings take them all by and by, and a red run is
red again at the same commit. Tests that recalculate with LibreOffice run every time. All run where
files are named on the command line, where no commit is known, and with `BIFOCAL_TURN=all`, as
before a release (`.ci/check long`); `BIFOCAL_TURN=0`, `1` or `2` names a third.
"""

from __future__ import annotations

import os
import subprocess
import zlib
from pathlib import Path

import pytest

THIRDS = 3


def turn_of(commit: str, wish: str = "") -> int | None:
    """Return which third is run; None for all of them."""
    if wish:
        return None if wish == "all" else int(wish) % THIRDS
    return int(commit, 16) % THIRDS if commit else None


def is_in_turn(name: str, turn: int | None) -> bool:
    """Return whether a test of this id runs; cases of one test are dealt one by one."""
    return turn is None or zlib.crc32(name.encode()) % THIRDS == turn


def _commit() -> str:
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:
        return ""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the slow tests whose turn it is not."""
    named = config.invocation_params.args and config.args_source.name == "ARGS"
    if named or "not acceptance" in (config.option.markexpr or ""):
        return
    turn = turn_of(_commit(), os.environ.get("BIFOCAL_TURN", ""))
    waiting = {
        item
        for item in items
        if item.get_closest_marker("acceptance")
        and not item.get_closest_marker("office")
        and not is_in_turn(item.nodeid, turn)
    }
    config.hook.pytest_deselected(items=list(waiting))
    items[:] = [item for item in items if item not in waiting]
