"""Pair files, workbooks or a survey's folder in, a report out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bifocal.options import OF_STEP, PROJECT
from bifocal.remarks import remark
from bifocal.reports.content import ReportTask, StepTold, read_content
from bifocal.reports.pair_report import report_document
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.jsonfile import read_object
from photocore.output import check_writable
from photocore.reports import check_report, write_document

#: How the files of pairs and of sets end.
_ENDINGS = re.compile(r"\.(pair|photos)\.json$")

__all__ = ["ReportTask", "StepTold", "report_of", "write_report"]


def write_report(
    sources: Sequence[Path],
    outs: Sequence[Path],
    tasks: Sequence[ReportTask],
    *,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> tuple[str, ...]:
    """Write the report of pairs, once for each file to write, and return remarks.

    Parameters
    ----------
    sources : sequence of Path
        Pair files or solved workbooks.
    outs : sequence of Path
        ``.html`` or ``.pdf``.
    tasks : sequence of ReportTask
        One for each source; the first one's language is the report's.

    Raises
    ------
    InputError
        If a file is unusable or an ending is another.
    """
    for out in outs:
        check_writable(out, overwrite=overwrite)
        check_report(out)
    contents = [read_content(source, task) for source, task in zip(sources, tasks, strict=True)]
    document = report_document(contents, tasks[0].language)
    for number, out in enumerate(outs):

        def part(done: float, total: float, what: str = "", number: int = number) -> None:
            progress(number + done / max(total, 1), len(outs), what)

        write_document(out, document, overwrite=overwrite, progress=part)
    remarks = [remark for content in contents for remark in content.pair.remarks]
    return tuple(dict.fromkeys(remarks))


def report_of(
    source: Path,
    out: Path,
    task: ReportTask,
    *,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> tuple[str, ...]:
    """Write the report of a workbook, a pair file or a survey's folder; see `write_report`."""
    sources, tasks = [source], [replace(task, language=task.language or "en")]
    if source.is_dir():
        if task.control or task.check or task.relief or task.ortho:
            raise InputError(remark("report.folder_knows", of=source))
        sources, tasks = find_pairs(source, task)
    return write_report(sources, [out], tasks, overwrite=overwrite, progress=progress)


def find_pairs(folder: Path, task: ReportTask) -> tuple[list[Path], list[ReportTask]]:
    """Return the pairs of a façade's or a survey's folder, with what was made of each.

    A pair is told by the workbook of its points, which names the pair file, or by the pair file.

    Raises
    ------
    InputError
        If there is none.
    """
    sources = _aligned(folder, "") or _aligned(folder, "*/")
    if not sources:
        raise InputError(remark("report.no_pair", of=folder))
    tasks, origins = [], []
    for source in sources:
        home, name = source.parent.parent, _ENDINGS.sub("", source.name)
        orthos = (home / "drawing" / f"{name}.tif", home / "ortho" / f"{name}_ortho.tif")
        relief = home / "relief" / f"{name}_relief.tif"
        view = home / "view" / f"{name}_view.html"
        workbook = home / "points" / f"{name}_points.xlsx"
        fields: dict[str, Any] = {
            "title": task.title if len(sources) == 1 and task.title else name,
            "relief": relief if relief.is_file() else None,
            "ortho": next((path for path in orthos if path.is_file()), None),
            "view": view if view.is_file() else None,
            **_remembered(home, task),
        }
        is_set = source.name.endswith(".photos.json")
        if is_set:  # its workbook holds values: the points are solved from their tables
            fields |= _tables(home / "points")
        has_book = workbook.is_file() and not is_set
        origins.append(workbook if has_book else _pair_file(source, folder))
        tasks.append(replace(task, **fields))
    return origins, tasks


def _tables(folder: Path) -> dict[str, Path]:
    """Return the tables that points of a folder were solved from, by the names of a task."""
    record = folder / ".made.json"
    files = read_object(record, what="record of a step")["inputs"] if record.is_file() else {}
    return {role: Path(files[role][0]) for role in ("control", "check") if role in files}


def _aligned(folder: Path, within: str) -> list[Path]:
    """Return the files of the pairs and sets that were set up."""
    paths = folder.glob(f"{within}align/*.json")
    return sorted(path for path in paths if _ENDINGS.search(path.name))


@dataclass(frozen=True, slots=True)
class _Time:
    seconds: float
    machine: str


def _remembered(home: Path, task: ReportTask) -> dict[str, object]:
    """Return what the records of a pair's steps tell, and the task does not say otherwise."""
    steps: list[StepTold] = []
    remembered: dict[str, object] = {}
    for path in (home / name / ".made.json" for name in OF_STEP):
        if not path.is_file():
            continue
        record = read_object(path, what="record of a step")
        if isinstance(options := record.get("options"), dict):
            remembered |= options
            if (name := str(record.get("step"))) != "report":
                time = _Time(float(record.get("seconds", 0)), str(record.get("machine", "")))
                files = {role: Path(file) for role, (file, _) in record["inputs"].items()}
                steps.append(StepTold.of(name, {**options, **files}, time))
    scale = task.scale or remembered.get("scale")
    return {
        "steps": tuple(steps),
        "scale": float(scale) if isinstance(scale, int | float) else None,
        "columns": remembered.get("columns"),
        "language": task.language or remembered.get("language", "en"),
        "project": {name: remembered[name] for name in PROJECT if name in remembered}
        | dict(task.project),
    }


def _pair_file(own: Path, folder: Path) -> Path:
    """Return the pair file that a pair's products were made with: its own, or that of all pairs.

    The records of the steps tell; what was adjusted once and is not used any more does not count.
    """
    joint = folder / "joint" / own.name
    if not joint.is_file():
        return own
    records = sorted(own.parents[1].glob("*/.made.json"))
    used = [read_object(path, what="record of a step").get("inputs") for path in records]
    is_joint = any(isinstance(files, dict) and "pair" in files for files in used)
    return joint if is_joint else own
