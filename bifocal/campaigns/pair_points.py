"""Known points of a pair: solved, compared with the tables, and as they are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bifocal.campaigns.surveyed_pair import SCALE, PairJob, tables_of

if TYPE_CHECKING:
    from bifocal.model import Points, WorldFrame
    from bifocal.survey import SolvedSurvey


def solved_points(
    job: PairJob, tables: Mapping[str, Path], options: Mapping[str, Any]
) -> SolvedSurvey:
    """Return the points of tables, solved and compared."""
    from bifocal.model import pair_or_set
    from bifocal.reports import is_exchanged, solve_control

    return solve_control(
        job.pair_path, **{"control": None, **tables}, photos=len(job.photos),
        exchanged=is_exchanged(pair_or_set(job.pair_path), job.far),
        language=options.get("language", "en"), unit=options.get("unit", ""),
        columns=options.get("columns"),
    )  # fmt: skip


def checked_points(job: PairJob) -> tuple[int, float, float] | None:
    """Return check points, and their RMSE in X, Y and in relief; None if too few prove it. [m]"""
    from bifocal.survey import FEW

    if "check" not in job.files:
        return None
    check = solved_points(job, {"check": job.files["check"]}, job.options).check
    x, y, r = (check.axes[axis] for axis in "XYZ")
    count = min(x.n, y.n, r.n)
    return (count, max(x.rmse, y.rmse), r.rmse) if count >= FEW else None


def known_of(job: PairJob, frame: WorldFrame | None = None) -> dict[str, Points]:
    """Return the coordinates that the tables of a pair hold; E, N, H in a frame's X, Y, r."""
    from bifocal.orientation import known_points

    reading = job.options_of("unit", "columns") | {"names": [str(path) for path in job.photos]}
    return {
        role: known_points(path, photos=len(job.photos), frame=frame, **reading)
        for role, path in tables_of(job).items()
    }


def points_to_draw(job: PairJob, *, solved: bool) -> dict[str, Points]:
    """Return what a drawing for CAD holds: known points where they are, and as they were solved."""
    from bifocal.files import read_survey_points
    from bifocal.model import WorldFrame, pair_or_set

    points = known_of(job, WorldFrame.of(pair_or_set(job.pair_path).extra))
    if solved:
        (table,) = (job.folder / "points").glob(f"{escape(job.title)}_points.*")
        points["points"] = read_survey_points(table)[0]
    return points


def proven(job: PairJob) -> list[str]:
    """Return what the compared points of a finished pair prove, for the terminal."""
    from bifocal.reports import ReportTask, read_content, verdict_in_words

    settings: dict[str, Any] = {k: job.options[k] for k in ReportTask.PLAIN if k in job.options}
    if "drawing" in job.products:
        settings.setdefault("scale", SCALE)
    task = ReportTask(**(settings | tables_of(job)), far=job.far)
    return verdict_in_words(read_content(job.pair_path, task, pictures=False))
