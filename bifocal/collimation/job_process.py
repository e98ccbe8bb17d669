"""The worker process of a long job: its task on stdin, its progress as lines of JSON on stdout."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any

from bifocal.collimation.stated_media import media_from_dict
from bifocal.faces.faces_files import faces_path
from bifocal.matching.matching import MatchSettings
from bifocal.model.geotiff import gsd_at_scale
from bifocal.orientation.align_workflow import (
    AlignOptions,
    KnownLens,
    align_photos,
    alignment_as_dict,
)
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orthophotos.deliver_workflow import DPI, DeliverTask, default_title, deliver
from bifocal.orthophotos.ortho_workflow import OrthoTask, make_ortho
from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair
from bifocal.workbook.match_workflow import match_pair_file
from bifocal.workbook.pair_workflow import read_pair
from photocore.cli import Progress
from photocore.errors import PhotogrammetryError
from photocore.interrupts import end_on_signals
from photocore.jsonfile import plain

Task = Mapping[str, Any]
#: Progress is told at most so often. [s]
_OFTEN = 0.2


def main() -> int:
    """Carry out the task that stdin holds; return 0, or 1 where it was refused."""
    end_on_signals()
    task = json.loads(sys.stdin.read())
    out = sys.stdout
    sys.stdout = sys.stderr  # nothing but our lines on the pipe
    told = 0.0

    def progress(done: float, total: float, what: str = "") -> None:
        nonlocal told
        if monotonic() - told > _OFTEN:
            told = monotonic()
            share = min(max(done / total, 0.0), 1.0) if total > 0 else 0.0
            tell({"progress": share, "message": what})

    def tell(line: Mapping[str, Any]) -> None:
        out.write(json.dumps(line) + "\n")
        out.flush()

    try:
        result = _WORKS[task["kind"]](task, progress)
    except PhotogrammetryError as error:
        tell({"error": str(error)})
        return 1
    except MemoryError:
        tell({"error": "there is not enough memory; choose a coarser pixel."})
        return 1
    tell({"result": plain(result)})
    return 0


def _align(task: Task, progress: Progress) -> dict[str, Any]:
    site = SiteMeasures(**task["site"])
    lenses = [KnownLens(**lens) for lens in task["lenses"]]
    progress(0.0, 1.0)
    options = AlignOptions(
        lenses=(lenses[0], lenses[1]),
        site=site,
        auto=task["auto"],
        as_set_up=task["as_set_up"],
        media=media_from_dict(task["media"]),
        control=_path(task["control"]),
        lengths=_path(task["lengths"]),
    )
    alignment = align_photos(
        Path(task["far"]), Path(task["near"]), Path(task["out"]), options, overwrite=True
    )
    return alignment_as_dict(alignment)


def _match(task: Task, progress: Progress) -> dict[str, Any]:
    progress(0.0, 1.0)
    settings = MatchSettings(count=task["count"], features=task["features"])
    _, matches = match_pair_file(read_pair(task["pair"]), settings)
    return {
        "points": [
            {
                "name": name,
                "picks": [first, second],
                "code": kind,
                "note": f"sigma {sigma:.2f} px, misfit {abs(misfit):.2f} px",
            }
            for name, first, second, kind, sigma, misfit in zip(
                matches.ids, matches.pixels1.round(4).tolist(), matches.pixels2.round(4).tolist(),
                matches.kinds, matches.sigma.tolist(), matches.misfit.tolist(), strict=True,
            )
        ]
    }  # fmt: skip


def _relief(task: Task, progress: Progress) -> dict[str, Any]:
    job = ReliefJob(
        out=Path(task["out"]), overwrite=task["overwrite"], faces=faces_path(None, task["pair"]),
        **task["options"],
    )  # fmt: skip
    summary, remarks = relief_of_pair(read_pair(task["pair"]), job, progress=progress)
    return {"summary": summary, "remarks": remarks}


def _ortho_task(task: Task) -> OrthoTask:
    said = dict(task["options"])
    if "scale" in said:
        said.setdefault("gsd", gsd_at_scale(task["dpi"] or DPI, said["scale"]))
    return OrthoTask.from_given(
        said, relief=_path(task["relief"]), points=_path(task["points"]),
        faces=faces_path(None, task["pair"]),
    )  # fmt: skip


def _ortho(task: Task, progress: Progress) -> dict[str, Any]:
    result = make_ortho(
        read_pair(task["pair"]), Path(task["out"]), _ortho_task(task), overwrite=task["overwrite"],
        progress=progress,
    )  # fmt: skip
    return {"remarks": result.remarks}


def _deliver(task: Task, progress: Progress) -> dict[str, Any]:
    path = Path(task["pair"])
    pair = read_pair(path)
    title = task["title"] or default_title(pair, path)
    wish = DeliverTask(title=title, mark=_path(task["mark"]), **{"scale": 50.0, **task["drawing"]})
    made = deliver(
        pair, Path(task["out"]), _ortho_task(task), wish,
        overwrite=task["overwrite"], progress=progress,
    )  # fmt: skip
    return {"files": made.files, "sheet": made.sheet, "remarks": made.ortho.remarks}


def _path(name: str | None) -> Path | None:
    return Path(name) if name else None


_WORKS: dict[str, Callable[[Task, Progress], dict[str, Any]]] = {
    "align": _align,
    "match": _match,
    "relief": _relief,
    "ortho": _ortho,
    "deliver": _deliver,
}


if __name__ == "__main__":
    sys.exit(main())
