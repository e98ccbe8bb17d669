"""What a comparison is, and how one of its runs is measured: in a process of its own."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

#: A run is repeated until it has taken so long in all, or so often; the quickest counts. [s]
ENOUGH, REPEATS = 1.0, 5
STATUS = Path("/proc/self/status")


@dataclass(frozen=True, slots=True)
class Task:
    """Work with its data at hand, and how far a result of it is from the truth."""

    work: Callable[[], Any]
    error: Callable[[Any], float]


@dataclass(frozen=True, slots=True)
class Tool:
    """One way to do it: `make` gets size and folder of the data and returns the task.

    ``package`` is what has to be installed, `largest` the size beyond which it takes too long.
    """

    make: Callable[[int, Path], Task]
    package: str
    largest: float = float("inf")

    @property
    def version(self) -> str:
        """The version installed; empty where it is not."""
        try:
            return version(self.package)
        except PackageNotFoundError:
            return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """The same data for all tools.

    Attributes
    ----------
    title, data : str
        What is done; with what, and how truth is known.
    item, error : str
        What is counted; which error is told, with its unit.
    sizes : tuple of int
        How many items, small to large.
    tools : mapping of str to Tool
        Ours first; times of the others are told as multiples of its time.
    prepare : callable, optional
        Writes data of a size into a folder, once for all tools.
    """

    title: str
    data: str
    item: str
    error: str
    sizes: tuple[int, ...]
    tools: Mapping[str, Tool]
    prepare: Callable[[int, Path], None] | None = None


def installed(package: str) -> bool:
    """Tell whether a tool's package is there."""
    return find_spec(package.replace("-", "_")) is not None


def processor_seconds() -> float:
    """Return the processor time of this process and of those it waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def measured(task: Task) -> dict[str, float]:
    """Return seconds of processor time, memory above what was there [MB], and the error."""
    before = _memory("VmRSS")
    _forget_peak()
    times: list[float] = []
    result = None
    while len(times) < REPEATS and sum(times) < ENOUGH:
        begin = processor_seconds()
        result = task.work()
        times.append(processor_seconds() - begin)
    own = _memory("VmHWM") - before
    if min(times) < 0.05:  # the clock of processes has hundredths: count whole rounds
        rounds = int(np.ceil(0.2 / max(min(times), 1e-4)))
        begin = time.process_time()
        for _ in range(rounds):
            result = task.work()
        times.append((time.process_time() - begin) / rounds)
        times = times[-1:]
    return {
        "seconds": min(times),
        "memory": max(own, _children_memory()),
        "error": float(task.error(result)),
    }


def _forget_peak() -> None:
    """Let the peak of memory begin anew, where the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return


def _memory(key: str) -> float:
    """Return a line of the process's status in MB; NaN where the system has none."""
    if not STATUS.exists():
        return float("nan")
    line = next(one for one in STATUS.read_text("ascii").splitlines() if one.startswith(key))
    return int(line.split()[1]) / 1024


def _children_memory() -> float:
    """Return the peak of the processes started. [MB]"""
    try:
        import resource
    except ImportError:
        return 0.0
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
