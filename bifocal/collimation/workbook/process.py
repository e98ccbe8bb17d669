"""A process that changes a large workbook, so that the page goes on meanwhile."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bifocal.collimation.records import PickedPoint
from bifocal.collimation.workbook.outlines import Outlines
from bifocal.collimation.workbook.rows import change_rows, read_rows
from bifocal.remarks import remark
from bifocal.workbook import read_pair
from photocore.errors import InputError, PhotogrammetryError
from photocore.remarks import learn, with_keys

#: From so many points on a process of its own pays.
FROM = 100
#: A workbook that takes longer is given up. [s]
_LONGEST = 600


def change_in_process(
    path: Path, points: Sequence[PickedPoint], pair_path: Path, *, keep: bool, outlines: Outlines,
    language: str,
) -> None:  # fmt: skip
    """Change the points of a workbook in place; as `rows.change_rows`.

    Raises
    ------
    InputError
        If the workbook is open elsewhere, or cannot take the points.
    """
    task = {
        "workbook": str(path.resolve()),
        "pair": str(pair_path.resolve()),
        "more": {"keep": keep, "outlines": outlines, "language": language},
        "points": [asdict(point) for point in points],
    }
    command = [sys.executable, "-m", "bifocal.collimation.workbook.process"]
    try:
        done = subprocess.run(
            command, input=json.dumps(task), capture_output=True, text=True, encoding="utf-8",
            timeout=_LONGEST, check=False,
        )  # fmt: skip
        answer = json.loads(done.stdout)
        learn(answer)
    except (OSError, ValueError, subprocess.TimeoutExpired):
        raise InputError(remark("page.book_not_written", name=path.name)) from None
    if "error" in answer:
        raise InputError(answer["error"])


def main() -> int:
    """Change the workbook that stdin names; answer with one line of JSON."""
    task = json.loads(sys.stdin.read())
    path, pair_path = Path(task["workbook"]), Path(task["pair"])
    try:
        points = [_point(entry) for entry in task["points"]]
        change_rows(path, read_rows(path), points, read_pair(pair_path), pair_path, **task["more"])
    except (PhotogrammetryError, OSError) as error:
        sys.stdout.write(json.dumps(with_keys({"error": str(error)})))
        return 1
    sys.stdout.write("{}")
    return 0


def _point(entry: dict[str, Any]) -> PickedPoint:
    first, second = (None if pick is None else tuple(pick) for pick in entry["picks"])
    reference = entry["reference"]
    fields = {**entry, "picks": (first, second), "reference": reference and tuple(reference)}
    return PickedPoint(**fields)


if __name__ == "__main__":
    sys.exit(main())
