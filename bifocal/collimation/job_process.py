"""The worker process of a long job: its task on stdin, its progress as lines of JSON on stdout."""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any

from bifocal.collimation.work import tasks
from bifocal.collimation.work.making import make_image, make_sheets, measure_relief
from bifocal.collimation.work.matching import match, suggest, targets
from bifocal.collimation.work.orienting import align, join, rectify
from photocore.cli import Progress
from photocore.errors import PhotogrammetryError
from photocore.interrupts import end_on_signals
from photocore.jsonfile import plain
from photocore.remarks import with_keys

#: Progress is told at most so often. [s]
_OFTEN = 0.2

_WORKS: Mapping[type[tasks.JobTask], Callable[[Any, Progress], Mapping[str, object]]] = {
    tasks.AlignTask: align,
    tasks.JoinTask: join,
    tasks.RectifyTask: rectify,
    tasks.MatchTask: match,
    tasks.TargetsTask: targets,
    tasks.SuggestTask: suggest,
    tasks.MapTask: measure_relief,
    tasks.ImageTask: make_image,
    tasks.SheetTask: make_sheets,
}


def main() -> int:
    """Carry out the task that stdin holds; return 0, or 1 where it was refused."""
    end_on_signals()
    task = pickle.load(sys.stdin.buffer)
    out = sys.stdout
    sys.stdout = sys.stderr  # nothing but our lines on the pipe
    last = 0.0

    def progress(done: float, total: float, what: str = "") -> None:
        nonlocal last
        if monotonic() - last > _OFTEN:
            last = monotonic()
            share = min(max(done / total, 0.0), 1.0) if total > 0 else 0.0
            tell({"progress": share, "message": what})

    def tell(line: dict[str, object]) -> None:
        out.write(json.dumps(with_keys(plain(line))) + "\n")
        out.flush()

    try:
        result = _WORKS[type(task)](task, progress)
    except PhotogrammetryError as error:
        tell({"error": str(error)})
        return 1
    except MemoryError:
        tell({"error": "there is not enough memory; choose a coarser pixel."})
        return 1
    tell({"result": result})
    return 0


if __name__ == "__main__":
    sys.exit(main())
