"""Ctrl-C and polite kills: a program tidies up and ends at once, whatever it is doing.

Python's own answer, KeyboardInterrupt, comes up anywhere in the code of anybody: libraries swallow
it in callbacks and finalizers, turn it into errors of their own, and it cuts clean-ups in two. Our
files are whole at any moment, also under kill -9; so nothing has to be unwound. What is left to do
is to remove temporary files and to say so.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

STOPPED = "Stopped by the user; nothing was left half-written."
#: Temporary files and folders in use by this process; removed, with all they hold and what lies
#: beside them under a longer name, if it is ended.
temporary: set[Path] = set()
#: Folders made for outputs that are not there yet; removed, if empty, the last one first.
made_folders: list[Path] = []

_SHOW_CURSOR = b"\x1b[?25h\n"


class _State:
    """What this process does on a signal, and what it does at the moment."""

    process = 0
    held = 0
    raising = False
    heard = 0


_state = _State()
_lock = threading.Lock()


def end_on_signals() -> None:
    """Let this process end tidily on Ctrl-C, SIGTERM and a closed terminal; call it first of all.

    What the process was told to ignore (nohup) stays ignored. For programs only: who imports the
    packages gets Python's KeyboardInterrupt.
    """
    _state.process = os.getpid()
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _hear)


@contextmanager
def held() -> Iterator[None]:
    """Let a signal wait until the body is done: several steps that belong together."""
    with _lock:
        _state.held += 1
    try:
        yield
    finally:
        with _lock:
            _state.held -= 1
        if _state.heard and not _state.held:
            signal.raise_signal(_state.heard)  # answered in the main thread


@contextmanager
def raising() -> Iterator[None]:
    """Let the first signal raise KeyboardInterrupt: the body has processes or a server to stop."""
    before, _state.raising = _state.raising, True
    try:
        yield
    finally:
        _state.raising = before


def _hear(number: int, frame: object) -> None:  # noqa: ARG001
    if os.getpid() != _state.process:  # a child's clean-up is not its parent's
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
    elif _state.held or _lock.locked():  # in the middle of counting, the count would stay wrong
        _state.heard = number
    else:
        _answer()


def _answer() -> None:
    _state.heard = 0
    if _state.raising:
        _state.raising = False  # a second one does not wait any more
        raise KeyboardInterrupt
    for path in list(temporary):
        with suppress(OSError):  # what libraries write beside a file bears its name and more
            for beside in list(path.parent.iterdir()):
                if beside.name.startswith(path.name):
                    _remove(beside)
    for path in reversed(made_folders):
        with suppress(OSError):
            path.rmdir()
    # Not through sys.stderr: it may be in the middle of a line.
    with suppress(OSError):
        os.write(2, (_SHOW_CURSOR if os.isatty(2) else b"") + f"{STOPPED}\n".encode())
    os._exit(1)


def _remove(path: Path) -> None:
    """Remove a file or a folder with all it holds; not by shutil, which may be half imported."""
    for folder, folders, files in os.walk(path, topdown=False):
        for name in files:
            with suppress(OSError):
                Path(folder, name).unlink()
        for name in folders:
            with suppress(OSError):
                Path(folder, name).rmdir()
    with suppress(OSError):
        path.rmdir() if path.is_dir() else path.unlink()
