"""Fixtures shared by all tests."""

from __future__ import annotations

import gc
import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZipFile

# Tests run one process per core: threads inside each would only get in each other's way.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# Hundreds of processes are started: each would compile the packages anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A shell that runs the tests in the background (`&`, nohup) has programs ignore these two.
for _number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, signal.SIG_DFL)

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

from photocore import cli  # noqa: E402
from photocore.workbook.reading import package  # noqa: E402
from tests import equipment, turns  # noqa: E402
from tests.workbook_schema import schema_faults  # noqa: E402

#: The folder of the tests.
TESTS = Path(__file__).parent

# The same examples on every machine and in every run: a red test is then a change of the code.
settings.register_profile("same", derandomize=True, deadline=None)
settings.load_profile("same")


class Doctests:
    """Doctests are looked for only where a module holds examples: the search costs seconds."""

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(self, file_path: Path) -> Iterator[None]:
        """Leave out the doctests of a module that holds none."""
        collectors = yield
        if collectors and b">>>" not in file_path.read_bytes():
            return [one for one in collectors if type(one) is pytest.Module]
        return collectors


def pytest_configure(config: pytest.Config) -> None:
    """Choose which third of the slow tests is run; only with slow ones kernels are compiled.

    On a fresh machine numba takes a minute for them: the other tests run them as they are written.
    """
    config.pluginmanager.register(Doctests())
    turns.choose(config)
    if "not acceptance" in config.getoption("markexpr"):
        os.environ["NUMBA_DISABLE_JIT"] = "1"


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what fixtures want, take turns; order as ``TEST_ORDER`` says: reversed, or a seed."""
    equipment.mark(items)
    turns.mark(items)
    turns.leave_out(config, items)
    order = os.environ.get("TEST_ORDER")
    if order == "reversed":
        items.reverse()
    elif order:
        random.Random(order).shuffle(items)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what wants LibreOffice, Chromium or data where they are not (office, browser, data)."""
    equipment.check(item)


def pytest_collection_finish() -> None:
    """Look for garbage rarely: through whole workbooks that took a fifth of their tests' time."""
    gc.freeze()
    gc.set_threshold(100_000, 10, 10)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Tell the skips in one line."""
    skipped = terminalreporter.stats.get("skipped", [])
    reasons = [str(report.longrepr[2]).removeprefix("Skipped: ") for report in skipped]
    if line := equipment.summary(reasons):
        terminalreporter.write_line(line)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real example data."""
    return Path(equipment.place("data"))


@pytest.fixture(scope="session", autouse=True)
def _observed_commands() -> Iterator[tuple[list[str], list[subprocess.Popen]]]:
    """Note what the last-resort handler says, and every process started, in the whole session."""
    said: list[str] = []
    started: list[subprocess.Popen] = []
    message, start = cli.unforeseen_message, subprocess.Popen.__init__

    def noted_message(task: str, error: BaseException) -> str:
        said.append(message(task, error))
        return said[-1]

    def noted_start(process: subprocess.Popen, *args: object, **options: object) -> None:
        started.append(process)
        start(process, *args, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cli, "unforeseen_message", noted_message)
        patch.setattr(subprocess.Popen, "__init__", noted_start)
        yield said, started


@pytest.fixture(scope="session", autouse=True)
def _no_wait_for_the_disk() -> Iterator[None]:
    """What a test writes need not outlast a power cut: a page's journal waits at every step."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _books_by_the_schemas() -> Iterator[None]:
    """Hold every part of a workbook that is written against the schemas, but what was there."""
    check = package._refuse_damage

    def checked(path: Path, old: ZipFile, target: Path, changed: dict[str, bytes | None]) -> None:
        check(path, old, target, changed)
        for name, data in changed.items():
            if data and name.startswith("xl/") and name.endswith(".xml"):
                before = schema_faults(old.read(name)) if name in old.namelist() else []
                faults = [fault for fault in schema_faults(data) if fault not in before]
                assert not faults, f"{path}, {name}: {faults}"

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(package, "_refuse_damage", checked)
        yield


class Unforeseen:
    """What the last-resort handler of the commands had to say in a test; none may be left."""

    def __init__(self, said: list[str], started: list[subprocess.Popen]) -> None:
        self._said, self._started = said, started

    def taken(self) -> list[str]:
        """Return the messages and the processes of its exit status so far, and forget them."""
        ended = [p for p in self._started if getattr(p, "returncode", None) == cli.UNFORESEEN]
        met = [*self._said, *(f"exit status {p.returncode}: {p.args}" for p in ended)]
        self._said.clear()
        self._started[:] = [p for p in self._started if getattr(p, "returncode", 0) is None]
        return met


@pytest.fixture(autouse=True)
def unforeseen(
    _observed_commands: tuple[list[str], list[subprocess.Popen]],
) -> Iterator[Unforeseen]:
    """Fail a test whose commands, here or in other processes, end in the last-resort handler."""
    met = Unforeseen(*_observed_commands)
    yield met
    left = met.taken()
    assert not left, "\n".join(["a command ended in the handler of unforeseen errors:", *left])
