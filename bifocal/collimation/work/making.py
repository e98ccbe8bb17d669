"""Jobs that make relief, orthophoto and drawings with the documents beside them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from bifocal.collimation.work.tasks import (
    ImageTask,
    MapTask,
    ProductMade,
    ProductTask,
    SheetsMade,
    SheetTask,
)
from bifocal.faces import faces_path
from bifocal.files import default_title
from bifocal.model import Pair, PhotoSet, gsd_at_scale
from bifocal.orthophotos import DPI, DeliverTask, OrthoTask, deliver, make_ortho
from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair
from bifocal.reports import (
    HandoverTask,
    ReportTask,
    report_of,
    view_relief,
    wall_in_words,
    write_handover,
)
from bifocal.workbook import is_workbook, read_pair
from photocore.cli import Progress


def measure_relief(task: MapTask, progress: Progress) -> ProductMade:
    """Measure the relief of a pair or a set."""
    faces = faces_path(None, task.pair)
    job = ReliefJob(out=task.out, overwrite=task.overwrite, faces=faces, **task.settings)
    named = task.photo_set or task.pair  # the map tells by its name which photos it is of
    source = read_pair(named) if is_workbook(named) else named
    _, remarks = relief_of_pair(source, job, progress=progress)
    return {"remarks": remarks}


def make_image(task: ImageTask, progress: Progress) -> ProductMade:
    """Make the orthophoto."""
    result = make_ortho(
        _source(task), task.out, _image_options(task), overwrite=task.overwrite, progress=progress
    )
    return {"remarks": result.remarks}


def _image_options(task: ImageTask) -> OrthoTask:
    settings = task.settings.copy()
    if "scale" in settings:
        settings.setdefault("gsd", gsd_at_scale(task.dpi or DPI, settings["scale"]))
    return OrthoTask.from_given(settings, relief=task.relief, faces=faces_path(None, task.pair))


def make_sheets(task: SheetTask, progress: Progress) -> SheetsMade:
    """Make drawings, report and 3-D view; relief and orthophoto first where they are lacking."""
    if task.mark is not None and not task.mark.is_file():  # it could not be written
        task = replace(task, mark=None)
    files_of_kind: dict[str, list[str]] = {}
    sentences: list[str] = []
    if task.relief_first is not None:
        sentences += measure_relief(task.relief_first, _within(progress, 0.0, 0.5))["remarks"]
        files_of_kind["relief"] = [task.relief_first.out.name]
    if task.ortho_first is not None:
        sentences += make_image(task.ortho_first, _within(progress, 0.5, 0.65))["remarks"]
        files_of_kind["ortho"] = [task.ortho_first.out.name]
    pair = _source(task)
    title = task.title or default_title(pair, task.pair)
    wish = DeliverTask(
        title=title, mark=task.mark, lengths=tuple(task.lengths.values()),
        language=task.language, expected=partial(wall_in_words, language=task.language),
        **({"scale": 50.0} | task.sheet),
    )  # fmt: skip
    done = deliver(
        pair, task.out, _image_options(task), wish, overwrite=task.overwrite,
        progress=_within(progress, 0.65, 0.9),
    )  # fmt: skip
    files = [*done.files, *_documents(task, title, _within(progress, 0.9, 1.0))]
    sentences += [text for text in done.ortho.remarks if text not in sentences]
    return {"files": files, "made": files_of_kind, "remarks": sentences}


def _documents(task: SheetTask, title: str, progress: Progress) -> list[str]:
    """Write the file to hand over, the report and a view of the relief; return their names."""
    names = {key: task.out / f"{task.stem}_{key}.html" for key in ("report", "3d", "handover")}
    shown = HandoverTask(
        relief=task.relief, ortho=task.ortho, points=task.mark, title=title, language=task.language
    )
    write_handover(task.pair, names["handover"], shown, overwrite=task.overwrite)
    progress(0.4, 1.0)
    if task.relief is not None:
        view_relief(task.relief, names["3d"], ortho=task.ortho, title=title,
                    language=task.language, overwrite=task.overwrite)  # fmt: skip
    else:
        del names["3d"]
    about = ReportTask(
        title=title, language=task.language, scale=task.sheet.get("scale"), relief=task.relief,
        ortho=task.ortho, view=names.get("3d"), lengths=dict(task.lengths),
    )  # fmt: skip
    # A set tells of all its photos; a workbook of points that two of them show.
    source = task.photo_set or task.mark or task.pair
    report_of(source, names["report"], about, overwrite=task.overwrite)
    return [path.name for path in names.values()]


def _within(progress: Progress, first: float, last: float) -> Progress:
    """Return what tells the progress of a part of the whole."""

    def part(done: float, total: float, what: str = "") -> None:
        share = min(max(done / total, 0.0), 1.0) if total > 0 else 0.0
        progress(first + (last - first) * share, 1.0, what)

    return part


def _source(task: ProductTask) -> Pair | PhotoSet:
    """Return the pair, or the set that holds it and further photos."""
    return PhotoSet.read(task.photo_set) if task.photo_set else read_pair(task.pair)
