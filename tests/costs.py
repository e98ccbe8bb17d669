"""What the tests cost in CPU seconds, with all they start; dear ones must say what only they see.

    .venv/bin/python -m tests.costs                     the default tests against `tests/costs.json`
    .venv/bin/python -m tests.costs tests/papers        some of them
    .venv/bin/python -m tests.costs --renew             and write the seconds into the table

`tests/costs.json` holds every default test above one second: its seconds and what only it sees. A
dear test without such a line is named, and the exit status is 1. Seconds are those of the machine
the table comes from: a slower one is known by what the tests of the table take there.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import pytest

TABLE = Path(__file__).with_suffix(".json")
#: A default test above this needs a line in the table. [CPU s]
DEAR = 1.0
#: By how much times of one machine differ from run to run, with whatever else runs on it.
SPREAD = 1.5
#: Where a run writes its seconds.
_OUT = "TEST_COSTS"
_seconds: dict[str, float] = {}


def _spent() -> float:
    clock = os.times()
    return clock.user + clock.system + clock.children_user + clock.children_system


def _timed(item: pytest.Item) -> Iterator[None]:
    start = _spent()
    try:
        return (yield)
    finally:
        item.user_properties.append(("cpu", _spent() - start))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    """Time a set-up: of fixtures for many, the first test of them bears the cost."""
    return (yield from _timed(item))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Time a test."""
    return (yield from _timed(item))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Add up what a test cost, here and in the processes of the run."""
    if report.when == "teardown":
        _seconds[report.nodeid] = sum(v for key, v in report.user_properties if key == "cpu")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the seconds where the command asked for them."""
    if (out := os.environ.get(_OUT)) and not hasattr(session.config, "workerinput"):
        Path(out).write_text(json.dumps(_seconds), encoding="utf-8")


def slowness(seconds: dict[str, float], table: dict[str, tuple[float, str]]) -> float:
    """Return how many times slower a machine is than that of the table; at least 1."""
    ratios = [seconds[name] / cost for name, (cost, _) in table.items() if name in seconds]
    return max(1.0, median(ratios)) if ratios else 1.0


def unexplained(seconds: dict[str, float], table: dict[str, tuple[float, str]]) -> dict[str, float]:
    """Return the dear tests of a run of which the table does not say what only they see."""
    limit = DEAR * SPREAD * slowness(seconds, table)
    return {
        name: cost
        for name, cost in sorted(seconds.items(), key=lambda pair: -pair[1])
        if cost > limit and not table.get(name, (0.0, ""))[1]
    }


def main() -> int:
    """Run tests, compare their seconds with the table or renew it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--renew", action="store_true", help="write the seconds into the table")
    given, words = parser.parse_known_args()
    table = {name: (cost, why) for name, (cost, why) in json.loads(TABLE.read_text()).items()}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "seconds.json"
        line = [sys.executable, "-m", "pytest", "-p", "tests.costs", *words]
        status = subprocess.run(line, env={**os.environ, _OUT: str(out)}, check=False).returncode
        seconds = json.loads(out.read_text(encoding="utf-8")) if out.exists() else {}
    if given.renew:
        table = {name: line for name, line in table.items() if seconds.get(name, DEAR + 1) > DEAR}
        table |= {
            name: (round(cost, 1), table.get(name, (0.0, ""))[1])
            for name, cost in seconds.items()
            if cost > DEAR
        }
        lines = (
            f" {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}"
            for k, v in sorted(table.items())
        )
        TABLE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    dear = unexplained(seconds, table)
    for name, cost in dear.items():
        sys.stdout.write(f"{cost:.1f} CPU s: {name}: make it cheaper, or say what only it sees\n")
    sys.stdout.write(f"{sum(seconds.values()):.0f} CPU s in {len(seconds)} tests\n")
    return status or bool(dear)


if __name__ == "__main__":
    sys.exit(main())
