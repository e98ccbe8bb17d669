"""Turns of the slow tests: of those marked `acceptance`, a run of everything takes a third.

Which third, the commit's hash says, so that landings take them all by and by, and a red run is
red again at the same commit. All run where files are named on the command line, where no commit is
known, and with `TEST_TURN=all`, as before a release (`.ci/check long`); `TEST_TURN=0`, `1` or `2`
names a third.

Some tests are slow only because another one, which is run by default, holds their promise already:
`tests/later.json` names both, and they too are marked `acceptance`.
"""

from __future__ import annotations

import json
import os
import subprocess
import zlib
from pathlib import Path

import pytest

THIRDS = 3
#: Of every test that waits for its turn though it is not marked, the one that holds its promise.
LATER: dict[str, str] = json.loads(Path(__file__).with_name("later.json").read_text("utf-8"))
#: Where the turn is kept for the processes of the run.
TURN = "TEST_TURN"


def turn_of(commit: str) -> str:
    """Return which third is run at a commit; without one, all."""
    return str(int(commit, 16) % THIRDS) if commit else "all"


def is_in_turn(name: str, turn: str) -> bool:
    """Return whether a test of this id runs; cases of one test are dealt one by one."""
    return turn == "all" or zlib.crc32(name.encode()) % THIRDS == int(turn)


def choose(config: pytest.Config) -> None:
    """Set the turn of a run; its workers, which are given every argument, take it over."""
    named = config.args_source is pytest.Config.ArgsSource.ARGS
    os.environ.setdefault(TURN, "all" if named else turn_of(_commit()))


def _commit() -> str:
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:
        return ""


def mark(items: list[pytest.Item]) -> None:
    """Mark what waits because another test holds its promise by default."""
    for item in items:
        if item.nodeid in LATER:
            item.add_marker("acceptance")


def leave_out(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the slow tests whose turn it is not."""
    waiting = [
        item
        for item in items
        if item.get_closest_marker("acceptance")
        and not is_in_turn(item.nodeid, os.environ.get(TURN, "all"))
    ]
    config.hook.pytest_deselected(items=waiting)
    items[:] = [item for item in items if item not in set(waiting)]
