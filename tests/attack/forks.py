"""Run command lines in forked processes, under limits; imported once, so that each costs little.

Reads one JSON job per line from stdin and answers each with one JSON line. A job has ``line`` and
``folder``, and may have ``limit`` (largest file [bytes]), ``user`` (runs as nobody), ``stdout`` (a
path, ``closed`` or ``pipe`` without a reader), ``stdin`` (``closed``), ``home`` (false: no HOME),
``encoding`` (of stdout), ``signal`` and ``after`` (seconds until it is sent).
"""

from __future__ import annotations

import codecs
import gc
import io
import json
import os
import resource
import shlex
import signal
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import cv2
from PIL import Image

import bifocal
import multimedia
import photocore
from photocore.interrupts import end_on_signals
from tests.attack.site import PROGRAMS

NOBODY = 65534
# Nobody may not read every Python installation: what is loaded late must be there before.
for name in ("utf-8-sig", "utf-16", "latin-1", "cp1252", "idna"):
    codecs.lookup(name)


def work(job: dict[str, Any], place: Path, said: int) -> None:
    """Become the command; never returns."""
    os.chdir(job["folder"])
    out = job.get("stdout", str(place / "out"))
    if out == "pipe":
        reading, writing = os.pipe()
        os.close(reading)
    else:
        writing = os.open("/dev/null" if out == "closed" else out, os.O_WRONLY | os.O_CREAT)
    os.dup2(writing, 1)
    os.dup2(said, 2)
    if out == "closed":
        os.close(1)
    if job.get("stdin") == "closed":
        os.close(0)
    if not job.get("home", True):
        for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "MPLCONFIGDIR", "TERM"):
            os.environ.pop(name, None)
    encoding = job.get("encoding", "utf-8")
    sys.stdout = None  # type: ignore[assignment]
    if out != "closed":
        sys.stdout = io.TextIOWrapper(io.FileIO(1, "w", closefd=False), encoding=encoding)
    sys.stderr = io.TextIOWrapper(
        io.FileIO(2, "w", closefd=False), encoding=encoding, errors="backslashreplace",
        line_buffering=True,
    )  # fmt: skip
    if "limit" in job:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (job["limit"], job["limit"]))
    if job.get("user"):
        os.setgid(NOBODY)
        os.setuid(NOBODY)
    program, *words = shlex.split(job["line"])
    end_on_signals()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    try:
        PROGRAMS[program].main(args=words, prog_name=program)
        status = 0
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else 1
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        status = status or 120  # as Python itself
    os._exit(status)


def run(job: dict[str, Any], place: Path) -> dict[str, Any]:
    """Run one job; return status (negative: the signal that ended it), stdout and stderr."""
    out = place / "out"
    out.unlink(missing_ok=True)
    # What it says goes through a pipe: a limit on files would cut it.
    reading, writing = os.pipe()
    # A signal waits until the child is the program; before, it would hit this harness' code.
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    child = os.fork()
    if not child:
        try:
            work(job, place, writing)
        finally:
            os._exit(99)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    os.close(writing)
    if "signal" in job:
        time.sleep(job["after"])
        os.kill(child, job["signal"])
    with os.fdopen(reading, encoding="utf-8", errors="replace") as file:
        said = file.read()
    _, ended = os.waitpid(child, 0)
    return {
        "status": os.waitstatus_to_exitcode(ended),
        "stderr": said,
        "stdout": out.read_bytes().decode("utf-8", "replace") if out.exists() else "",
    }


def main() -> None:
    """Answer jobs until stdin ends."""
    cv2.setNumThreads(0)
    # All at once: a process that runs as nobody may not read the modules.
    for package in (bifocal, multimedia, photocore):
        for module in walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                import_module(module.name)
    for name in ("tomli_w", "ezdxf", "statistics"):  # loaded when a file of theirs is written
        import_module(name)
    Image.init()
    gc.freeze()  # a child would copy all memory that it looks through for garbage
    with tempfile.TemporaryDirectory() as name:
        for line in sys.stdin:
            sys.__stdout__.write(json.dumps(run(json.loads(line), Path(name))) + "\n")
            sys.__stdout__.flush()


if __name__ == "__main__":
    main()
