"""What becomes of a job's result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from bifocal.collimation.drawing import write_points_drawing
from bifocal.collimation.fields import tupled
from bifocal.collimation.live_orientation import control_of
from bifocal.collimation.product_graph import causes_of
from bifocal.collimation.proposals import Report, discard_pair
from bifocal.collimation.session import Session
from bifocal.collimation.shapes import outlines_of
from bifocal.collimation.wording import say, without_options
from bifocal.collimation.work import tasks
from photocore.tables import write_csv
from photocore.tables.csvwrite import Columns


def finish(session: Session, task: tasks.JobTask, result: Mapping[str, object]) -> str:
    """Take over what a job made; return what the user should know."""
    return _FINISHED[type(task)](session, task, result)


def _in_words(session: Session, sentences: object) -> str:
    texts = cast("tuple[str, ...]", sentences)
    return " ".join(without_options(text, session.spoken) for text in texts)


def _aligned(session: Session, task: tasks.AlignTask, result: Report) -> str:
    if task.quiet and len(control_of(session.state).ids):
        discard_pair(task.out)
        return ""  # the user took it in hand meanwhile
    causes = _same(task, "control", *(() if task.free_scale else ("site",)))
    session.propose(task.out, {**result, "causes": causes})
    return _in_words(session, result.get("remarks", ()))


def _joined(session: Session, task: tasks.JoinTask, result: tasks.Joined) -> str:
    session.note_made("set", [*result["lenses"], task.out.name])
    session.join(task.out)
    return _in_words(session, result["remarks"])


def _rectified(session: Session, task: tasks.RectifyTask, result: tasks.Rectified) -> str:
    drawn = [f"{task.folder.name}/{name}" for name in result["files"]]
    session.note_made("rectified", [*drawn, task.out.name])
    session.misfits = result["misfits"]
    return _in_words(session, result["words"][:2])


def _matched(session: Session, _task: tasks.MatchTask, result: tasks.FoundPoints) -> str:
    session.command({"op": "points.add", "points": result["points"]})
    return ""


def _targeted(session: Session, _task: tasks.TargetsTask, result: tasks.FoundPoints) -> str:
    picks = {point.picks for point in session.state.control.values()}
    new = [one for one in result["points"] if tupled(one["picks"]) not in picks]
    if new:
        session.command({"op": "control.add", "control": new})
    return say("targets", "found" if new else "none", session.spoken, count=len(new))


def _suggested(session: Session, _task: tasks.SuggestTask, result: tasks.FoundShapes) -> str:
    session.suggested = result["shapes"]
    return "" if result["shapes"] else say("shapes", "none", session.spoken)


def _made(kind: str) -> Callable[[Session, tasks.ProductTask, tasks.ProductMade], str]:
    """Return what takes over a map or an image."""

    def take(session: Session, task: tasks.ProductTask, result: tasks.ProductMade) -> str:
        session.note_made(kind, [task.out.name], dict(task.causes) or causes_of(session, kind))
        session.show_products()
        return _in_words(session, result.get("remarks", ()))

    return take


def _delivered(session: Session, task: tasks.SheetTask, result: tasks.SheetsMade) -> str:
    folder = task.out
    for kind, paths in result["made"].items():
        session.note_made(kind, paths, {**causes_of(session, kind), **_same(task, "pair", "faces")})
    names = [f"{folder.name}/{name}" for name in result["files"]]
    if any(point.is_complete for point in session.state.points.values()):
        drawing = folder / f"{session.products.stem}_points.dxf"
        with session.lock:
            write_points_drawing(session.state, session.results, drawing)
        names.append(f"{folder.name}/{drawing.name}")
    names += [f"{folder.name}/{name}" for name in _write_outlines(session, folder)]
    now = causes_of(session, "deliver")  # relief and orthophoto may have been made before it
    causes = {**(task.causes or now), "relief": now["relief"], "ortho": now["ortho"]}
    session.note_made("deliver", names, causes)
    session.show_products()
    return _in_words(session, result.get("remarks", ()))


def _write_outlines(session: Session, folder: Path) -> list[str]:
    """Write what was drawn to be measured as a table; return its name, if there is any."""
    pair = session.pictures.pair
    with session.lock:
        drawn = {} if pair is None else outlines_of(session.state, pair)
    if not drawn:
        return []
    columns: Columns = {
        "id": list(drawn), "layer": [str(one["layer"]) for one in drawn.values()],
    }  # fmt: skip
    units = {"width": "m", "height": "m", "area": "m2", "length": "m", "relief": "m"}
    for key, unit in units.items():
        columns[f"{key} [{unit}]"] = np.array([one[key] for one in drawn.values()])
    path = folder / f"{session.products.stem}_outlines.csv"
    write_csv(path, columns, overwrite=path.is_file())
    return [path.name]


def _same(task: tasks.JobTask, *causes: str) -> dict[str, str]:
    """Return the digests of causes as they were when the job began."""
    return {key: value for key, value in task.causes.items() if key in causes}


_FINISHED: Mapping[type[tasks.JobTask], Callable[[Session, Any, Any], str]] = {
    tasks.AlignTask: _aligned,
    tasks.JoinTask: _joined,
    tasks.RectifyTask: _rectified,
    tasks.MatchTask: _matched,
    tasks.TargetsTask: _targeted,
    tasks.SuggestTask: _suggested,
    tasks.MapTask: _made("relief"),
    tasks.ImageTask: _made("ortho"),
    tasks.SheetTask: _delivered,
}
