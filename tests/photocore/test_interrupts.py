"""Ctrl-C and polite kills at moments that can be chosen; `tests/attack` chooses at random."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from photocore.interrupts import STOPPED

pytestmark = pytest.mark.skipif(os.name == "nt", reason="sends signals to other processes")

BEGIN = """
import time
from photocore import interrupts
from photocore.output import all_or_none, atomic_folder, atomic_path
interrupts.end_on_signals()
def wait(seconds):
    # In many short sleeps: a signal just before a long one would be heard behind it.
    for _ in range(int(seconds * 50)):
        time.sleep(0.02)
def ready(seconds=20):
    print("ready", flush=True)
    wait(seconds)
"""


def ended(
    code: str, folder: Path, number: int = signal.SIGINT, *, shield: bool = False
) -> tuple[int, str, str]:
    """Run a script, send it a signal when it is ready; return status, stdout and stderr."""
    command = [sys.executable, "-c", BEGIN + code]
    environment = {**os.environ, "TMPDIR": str(folder)}
    ignore = (lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)) if shield else None
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=ignore, env=environment,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(number)
        out, err = process.communicate(timeout=15)
    return process.returncode, out, err


WRITING = {
    "file": "with atomic_path('o.csv', overwrite=False) as name: name.write_text('x'); ready()",
    "folder": """
with atomic_folder('new/er', overwrite=False) as folder:
    (folder / 'sub').mkdir()
    (folder / 'sub' / 'o.csv').write_text('x')
    ready()
""",
    "set": """
with all_or_none():
    for name in ('o.csv', 'p.csv'):
        with atomic_path(name, overwrite=False) as path:
            path.write_text('x')
    ready()
""",
    "beside": """
from photocore.output import temporary_folder
with temporary_folder() as folder, atomic_path('o.tif', overwrite=False) as name:
    name.with_name(name.name + '.plain.tif').write_text('x')
    (folder / 'passing').write_text('x')
    ready()
""",
    "exit": "import atexit\natexit.register(ready)",
    "finalizer": """
class Thing:
    def __del__(self):
        ready()
thing = Thing()
del thing
print('went on')
""",
    "library": """
import _thread
try:
    ready()
except BaseException as error:
    raise ValueError('no valid LAZ file') from None
""",
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("work", WRITING)
def test_whatever_it_is_at_it_ends_with_one_message_and_nothing_left(
    tmp_path: Path, work: str, number: int
) -> None:
    if number != signal.SIGINT and work in ("exit", "finalizer", "library"):
        pytest.skip("as SIGINT")
    assert ended(WRITING[work], tmp_path, number) == (1, "", STOPPED + "\n")
    assert list(tmp_path.iterdir()) == []


def test_steps_that_belong_together_are_finished_first(tmp_path: Path) -> None:
    code = """
with interrupts.held(), interrupts.held():
    ready(0.5)
    print('finished', flush=True)
print('went on')
"""
    assert ended(code, tmp_path) == (1, "finished\n", STOPPED + "\n")


def test_a_signal_while_steps_are_counted_waits_too(tmp_path: Path) -> None:
    code = """
try:
    with interrupts.raising():
        with interrupts._lock:
            ready(0.3)
        with interrupts.held():
            print('counted')
except KeyboardInterrupt:
    print('stopped')
"""
    assert ended(code, tmp_path) == (0, "counted\nstopped\n", "")


def test_a_body_that_has_something_to_stop_stops_it_and_only_once(tmp_path: Path) -> None:
    code = """
try:
    with interrupts.raising():
        ready()
except KeyboardInterrupt:
    print('stopped')
with interrupts.raising():
    pass
"""
    assert ended(code, tmp_path) == (0, "stopped\n", "")
    impatient = """
import os, signal
with interrupts.raising():
    try:
        ready()
    finally:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(20)
"""
    assert ended(impatient, tmp_path) == (1, "", STOPPED + "\n")


def test_what_the_process_was_told_to_ignore_stays_ignored(tmp_path: Path) -> None:
    assert ended("ready(0.5)\nprint('done')", tmp_path, shield=True) == (0, "done\n", "")


def test_a_child_leaves_what_is_its_parents(tmp_path: Path) -> None:
    code = """
import os, signal
with atomic_path('o.csv', overwrite=False) as path:
    path.write_text('x')
    child = os.fork()
    if not child:
        wait(20)
    time.sleep(0.1)
    os.kill(child, signal.SIGINT)
    assert os.waitpid(child, 0)[1] == signal.SIGINT
    assert path.exists()
    print('ready', flush=True)
"""
    status, _, err = ended(code, tmp_path, signal.SIGCONT)
    assert (status, err) == (0, "")
    assert [path.name for path in tmp_path.iterdir()] == ["o.csv"]


#: Modules that are loaded when the program has just begun, and while it gets a command ready.
LOADED = {"bifocal": ("click.types", "numpy"), "multimedia": ("importlib.metadata", "numpy")}


@pytest.mark.parametrize(("program", "module"), [(p, m) for p in LOADED for m in LOADED[p]])
def test_imports_are_interrupted_as_politely(tmp_path: Path, program: str, module: str) -> None:
    lines = {
        "bifocal": ["relief", "no.pair.json", "--out", "o.tif"],
        "multimedia": ["index"],
    }
    command = [sys.executable, "-X", "importtime", "-m", program, *lines[program]]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.rpartition("|")[2].strip() == module:
                break
        else:
            pytest.fail(f"never loads {module}")
        process.send_signal(signal.SIGINT)
        said = [line for line in process.stderr if not line.startswith("import time:")]
    assert process.returncode == 1
    assert said == [STOPPED + "\n"]
