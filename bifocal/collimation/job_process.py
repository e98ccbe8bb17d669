"""The worker process of a long job: its task on stdin, its progress as lines of JSON on stdout."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from bifocal.campaigns import rectify_photo
from bifocal.collimation.proposals import wall_sheet
from bifocal.collimation.shapes import shapes_from
from bifocal.collimation.stated_media import media_from_dict
from bifocal.faces import faces_path, suggest_faces
from bifocal.files import default_title
from bifocal.matching import MatchSettings
from bifocal.model import NAMES, LengthCheck, Pair, PhotoSet, ReliefMap, WorldFrame, gsd_at_scale
from bifocal.networks import align_photo_set
from bifocal.options.commands import RectifyCommand
from bifocal.orientation import (
    AlignOptions,
    KnownLens,
    SiteMeasures,
    align_photos,
    alignment_as_dict,
)
from bifocal.orthophotos import DPI, DeliverTask, OrthoTask, deliver, make_ortho
from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair
from bifocal.reports import HandoverTask, report_of, view_relief, wall_in_words, write_handover
from bifocal.reports.content import ReportTask
from bifocal.workbook import is_workbook, match_pair_file, read_pair
from photocore.cli import Progress
from photocore.errors import GeometryError, PhotogrammetryError
from photocore.images import image_info, read_grey
from photocore.interrupts import end_on_signals
from photocore.jsonfile import plain
from photocore.options import options_of
from photocore.remarks import with_keys
from photocore.tables import write_csv
from photocore.tables.csvwrite import Columns

#: What a job is told and what it answers: what JSON holds, by the keys of its kind.
Task = Mapping[str, Any]
Result = dict[str, Any]
#: Progress is told at most so often. [s]
_OFTEN = 0.2
#: Points of a pair that hold the frame where further photos join it.
FRAME = 24


def main() -> int:
    """Carry out the task that stdin holds; return 0, or 1 where it was refused."""
    end_on_signals()
    task = json.loads(sys.stdin.read())
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
        result = _WORKS[task["kind"]](task, progress)
    except PhotogrammetryError as error:
        tell({"error": str(error)})
        return 1
    except MemoryError:
        tell({"error": "there is not enough memory; choose a coarser pixel."})
        return 1
    tell({"result": result})
    return 0


def _align(task: Task, progress: Progress) -> Result:
    site = SiteMeasures(**task["site"])
    lenses = [KnownLens(**lens) for lens in task["lenses"]]
    progress(0.0, 1.0)
    options = AlignOptions(
        lenses=(lenses[0], lenses[1]),
        site=site,
        auto=task["auto"],
        one_lens=task["auto"],
        as_set_up=task["as_set_up"],
        media=media_from_dict(task["media"]),
        control=_path(task["control"]),
        lengths=_path(task["lengths"]),
        world=task["world"] and WorldFrame.from_json(task["world"]),
    )
    alignment = align_photos(
        Path(task["far"]), Path(task["near"]), Path(task["out"]), options, overwrite=True
    )
    sizes = [image_info(Path(task[which])).size for which in ("far", "near")]
    if alignment.pair.photo_file(1).name != Path(task["far"]).name:
        sizes.reverse()
    sheets = zip((alignment.tie1, alignment.tie2), sizes, strict=True)
    return alignment_as_dict(alignment) | {
        "free_scale": task["free_scale"],
        "planes": alignment.setup["planes"],
        "wall": [wall_sheet(ties, alignment.wall, size) for ties, size in sheets],
    }


def _join(task: Task, progress: Progress) -> Result:
    """Adjust a pair and further photos of its wall together.

    Without control points, points that the pair gives hold the frame, as precisely as it gives
    them: X, Y and r stay those of the pair.
    """
    first, second, others = (KnownLens(**lens) for lens in task["lenses"])
    out, photos = Path(task["out"]), [Path(path) for path in task["photos"]]
    with tempfile.TemporaryDirectory() as folder:
        control, site = _path(task["control"]), SiteMeasures()
        if control is None:
            control = Path(folder) / "points.csv"
            pair, distance_row = read_pair(task["pair"]), NAMES.index("Z 1")
            variance = (
                None if pair.orientation is None else pair.orientation[distance_row, distance_row]
            )
            site = SiteMeasures(
                sigma_control=_frame(pair, control, len(photos)), distance1=pair.d1,
                sigma=site.sigma if variance is None else max(float(np.sqrt(variance)), 1e-4),
            )  # fmt: skip
        options = AlignOptions(
            lenses=(first, second), other_lenses=others, site=site, control=control,
            lengths=_path(task["lengths"]),
        )  # fmt: skip
        alignment = align_photo_set(photos, out, options, overwrite=True, progress=progress)
    lenses = {photo.extra.get("lens") for photo in alignment.photos.photos} - {None}
    # Of points that the program chose nobody can mend the picks.
    of_control = alignment.remarks if task["control"] else ()
    return {"remarks": [*alignment.words, *of_control], "lenses": sorted(map(str, lenses))}


def _frame(pair: Pair, table: Path, photos: int) -> float:
    """Write points of a pair, spread over it, as control points; return their precision. [m]"""
    _, matches = match_pair_file(pair, MatchSettings(count=FRAME, features=True))
    solved = pair.intersect(matches.pixels1, matches.pixels2)
    sigma = np.sqrt(np.trace(solved.covariance, axis1=1, axis2=2) / 3)
    good = np.array([flag in ("OK", "ON-PLANE") for flag in solved.flags]) & (sigma > 0)
    columns: Columns = {"id": [name for name, keep in zip(matches.ids, good, strict=True) if keep]}
    columns |= dict(zip(("X [m]", "Y [m]", "r [m]"), solved.xyz[good].T, strict=True))
    blank = np.full(int(good.sum()), np.nan)
    pixels = [*matches.pixels1[good].T, *matches.pixels2[good].T, *[blank] * (2 * photos - 4)]
    names = [f"{axis}{number} [px]" for number in range(1, photos + 1) for axis in ("col", "row")]
    write_csv(table, columns | dict(zip(names, pixels, strict=True)), overwrite=True)
    return float(np.median(sigma[good])) if good.any() else SiteMeasures().sigma_control


def _rectify(task: Task, progress: Progress) -> Result:
    """Bring one photo alone to scale, with drawings."""
    settings = {name: one.fixed_default for name, one in options_of(RectifyCommand).items()}
    settings |= {"scale": 50.0, **task, "corners": np.ravel(task["corners"])}
    done = rectify_photo(
        Path(task["photo"]), Path(task["out"]), settings, folder=Path(task["folder"]),
        overwrite=task["overwrite"], progress=progress,
    )  # fmt: skip
    assert done.delivery is not None
    width, height = task["rectangle"]
    rectangle = np.array([[0, height], [width, height], [width, 0], [0, 0]], dtype=float)
    fitted = done.photo.as_pair().image1.pixels_from_plane(rectangle)
    picks = np.array(task["corners"])
    apart = fitted[None] - picks[:, None]  # whichever corner the rectangle was begun at
    nearest = np.linalg.norm(apart, axis=2).argmin(axis=1)
    misfits = apart[range(len(picks)), nearest].tolist()
    words = [*done.words, *done.remarks]
    return {"words": words, "files": done.delivery.files, "misfits": misfits}


def _match(task: Task, progress: Progress) -> Result:
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


def _targets(task: Task, progress: Progress) -> Result:
    """Return the targets that both photos show."""
    try:
        matches = _match({**task, "count": 5000, "features": False}, progress)
    except GeometryError:  # too few to check the pair by
        return {"points": []}
    return {"points": [one for one in matches["points"] if one["code"] != "feature"]}


def _relief(task: Task, progress: Progress) -> Result:
    job = ReliefJob(
        out=Path(task["out"]), overwrite=task["overwrite"], faces=faces_path(None, task["pair"]),
        **task["options"],
    )  # fmt: skip
    named = Path(task.get("set") or task["pair"])  # the map tells by its name which photos it is of
    source = read_pair(named) if is_workbook(named) else named
    summary, remarks = relief_of_pair(source, job, progress=progress)
    return {"summary": summary, "remarks": remarks}


def _ortho_task(task: Task) -> OrthoTask:
    settings = dict(task["options"])
    if "scale" in settings:
        settings.setdefault("gsd", gsd_at_scale(task["dpi"] or DPI, settings["scale"]))
    return OrthoTask.from_given(
        settings, relief=_path(task["relief"]), faces=faces_path(None, task["pair"]),
    )  # fmt: skip


def _ortho(task: Task, progress: Progress) -> Result:
    result = make_ortho(
        _source(task), Path(task["out"]), _ortho_task(task), overwrite=task["overwrite"],
        progress=progress,
    )  # fmt: skip
    return {"remarks": result.remarks}


def _deliver(task: Task, progress: Progress) -> Result:
    """Make drawings, report and 3-D view; relief and orthophoto first where they are lacking."""
    path, out = Path(task["pair"]), Path(task["out"])
    if task["mark"] and not Path(task["mark"]).is_file():  # it could not be written
        task = {**task, "mark": None}
    files_of_kind: dict[str, list[str]] = {}
    sentences: list[str] = []
    for kind, first, last in (("relief", 0.0, 0.5), ("ortho", 0.5, 0.65)):
        if before := task.get("before", {}).get(kind):
            sentences += _WORKS[kind](before, _within(progress, first, last))["remarks"]
            files_of_kind[kind] = [Path(before["out"]).name]
    pair = _source(task)
    title = task["title"] or default_title(pair, path)
    wish = DeliverTask(
        title=title, mark=_path(task["mark"]), lengths=tuple(_lengths(task).values()),
        expected=partial(wall_in_words, language=task["drawing"].get("language", "en")),
        **{"scale": 50.0, **task["drawing"]},
    )  # fmt: skip
    done = deliver(
        pair, out, _ortho_task(task), wish, overwrite=task["overwrite"],
        progress=_within(progress, 0.65, 0.9),
    )  # fmt: skip
    files = [*done.files, *_documents(task, title, _within(progress, 0.9, 1.0))]
    sentences += [text for text in done.ortho.remarks if text not in sentences]
    return {"files": files, "made": files_of_kind, "sheet": done.sheet, "remarks": sentences}


def _documents(task: Task, title: str, progress: Progress) -> list[str]:
    """Write the file to hand over, the report and a view of the relief; return their names."""
    out, relief, ortho = Path(task["out"]), _path(task["relief"]), _path(task["ortho"])
    language = task["drawing"]["language"]
    names = {key: out / f"{task['stem']}_{key}.html" for key in ("report", "3d", "handover")}
    shown = HandoverTask(
        relief=relief, ortho=ortho, points=_path(task["mark"]), title=title, language=language
    )
    write_handover(Path(task["pair"]), names["handover"], shown, overwrite=task["overwrite"])
    progress(0.4, 1.0)
    if relief is not None:
        view_relief(relief, names["3d"], ortho=ortho, title=title, language=language,
                    overwrite=task["overwrite"])  # fmt: skip
    else:
        del names["3d"]
    about = ReportTask(
        title=title, language=language, scale=task["drawing"].get("scale"), relief=relief,
        ortho=ortho, view=names.get("3d"), lengths=_lengths(task),
    )  # fmt: skip
    # A set tells of all its photos; a workbook of points that two of them show.
    source = _path(task["set"]) or _path(task["mark"]) or Path(task["pair"])
    report_of(source, names["report"], about, overwrite=task["overwrite"])
    return [path.name for path in names.values()]


def _lengths(task: Task) -> dict[str, LengthCheck]:
    return {name: LengthCheck(**check) for name, check in task.get("lengths", {}).items()}


def _suggest(task: Task, progress: Progress) -> Result:
    """Return the faces that the program would draw."""
    progress(0.0, 1.0)
    pair = read_pair(task["pair"])
    images = [read_grey(pair.photo_file(number)) for number in (1, 2)]
    faces = suggest_faces(ReliefMap.read(Path(task["relief"])), [pair.image1, pair.image2], images)
    return {"shapes": shapes_from(faces, pair)}


def _within(progress: Progress, first: float, last: float) -> Progress:
    """Return what tells the progress of a part of the whole."""

    def part(done: float, total: float, what: str = "") -> None:
        share = min(max(done / total, 0.0), 1.0) if total > 0 else 0.0
        progress(first + (last - first) * share, 1.0, what)

    return part


def _source(task: Task) -> Pair | PhotoSet:
    """Return the pair, or the set that holds it and further photos."""
    return PhotoSet.read(task["set"]) if task.get("set") else read_pair(task["pair"])


def _path(name: str | None) -> Path | None:
    return Path(name) if name else None


_WORKS: dict[str, Callable[[Task, Progress], Result]] = {
    "align": _align,
    "join": _join,
    "rectify": _rectify,
    "match": _match,
    "targets": _targets,
    "relief": _relief,
    "ortho": _ortho,
    "deliver": _deliver,
    "suggest": _suggest,
}


if __name__ == "__main__":
    sys.exit(main())
