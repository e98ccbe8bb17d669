"""A solved survey written: into the user's own workbook, a new one, a text table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from bifocal.files import export_points
from bifocal.remarks import remark
from bifocal.survey import (
    RULES,
    KnownPoints,
    PointObservations,
    SolvedSurvey,
    SurveySetup,
    csv_columns,
)
from bifocal.workbook.changing.kinds import check_kind, is_same_kind
from bifocal.workbook.changing.own_table import add_results
from bifocal.workbook.changing.update import BookUpdate, update_book
from bifocal.workbook.content import SurveyContent
from bifocal.workbook.making.book import write_book
from bifocal.workbook.template_workflow import MOST_ROWS, log_row
from photocore.errors import InputError
from photocore.output import check_not_input, relative_name
from photocore.tables import write_csv
from photocore.tables.heading_words import bare
from photocore.workbook import check_new_workbook

#: Sheets of a survey workbook, as `bare` writes them.
_OURS = {
    *("readme", "setup", "points", "results", "check", "georeference", "planning", "charts", "log")
}


def write_result(
    path: Path | str,
    solution: SolvedSurvey,
    *,
    language: str | None = None,
    overwrite: bool = False,
) -> str:
    """Write a solved survey as a workbook (.xlsx, .xlsm) or a text table (.csv).

    Parameters
    ----------
    path : path
        Its ending says which.
    solution : SolvedSurvey
        What was solved.
    language : str, optional
        Of the workbook; default that of the survey.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    str
        Where the old state of a workbook changed in place is kept, or what a new workbook leaves
        behind; empty where there is nothing to say.

    Notes
    -----
    A survey workbook is carried over with all the user put into it, results filled in and options
    written into its cells. A workbook of the user's own that is named as output too gets the
    results as new columns of its table, live formulas. Any other table gives a new workbook, which
    never replaces one that holds anything but what this program wrote.

    Raises
    ------
    InputError
        If the ending is another, there are too many points for a workbook, or a new workbook would
        replace the user's own.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending == ".csv":
        check_not_input(path, solution.source)
        write_csv(path, csv_columns(solution), overwrite=overwrite)
        return ""
    if ending not in (".xlsx", ".xlsm"):
        raise InputError(f"{path}: results are written as .xlsx, .xlsm or .csv.")
    if solution.photos is not None:
        note = export_points(path, solution.to_points(), overwrite=overwrite)
        return " ".join([remark("survey.set_as_values", count=len(solution.photos)), *note])
    if len(solution.table) > MOST_ROWS:
        about = {"count": len(solution.table), "name": path.with_suffix(".csv").name}
        raise InputError(remark("survey.too_many_points", of=path, limit=MOST_ROWS, **about))
    content = result_content(solution, path, language)
    in_place, is_book = _is_same_file(path, solution.source), _is_survey_book(solution)
    same_kind = is_same_kind(solution.survey, content)
    if is_book and (in_place or same_kind):
        return _update(path, solution, content, overwrite=overwrite)
    if not solution.survey.is_ours and (ending == ".xlsm" or in_place):
        return _add_columns(path, solution, content, overwrite=overwrite)
    write_book(path, content, overwrite=overwrite)
    return _left_behind(solution)


def check_target(path: Path, solution: SolvedSurvey, *, overwrite: bool) -> None:
    """Refuse an output that cannot be written; first for a reason that no option mends.

    Raises
    ------
    InputError
        As `write_result`.
    """
    if _is_survey_book(solution) and _is_same_file(path, solution.source):
        check_kind(solution.source, solution.survey, SurveyContent.of(solution))
    check_new_workbook(path, overwrite=overwrite, source=solution.source)


def _is_survey_book(solution: SolvedSurvey) -> bool:
    return solution.survey.is_ours and solution.source.suffix.lower() in (".xlsx", ".xlsm")


def _update(path: Path, solution: SolvedSurvey, content: SurveyContent, *, overwrite: bool) -> str:
    """Put the results into a survey workbook; return where its old state is kept."""
    done = _put(update_book, path, solution, content, overwrite=overwrite)
    kept = _kept_as(done.kept)
    if done.added:
        titles = ", ".join(done.added)
        kept = f"missing sheets were added again, behind all others: {titles}; {kept}".rstrip("; ")
    return " ".join([kept, *done.remarks]).strip()


def _put(
    into: Callable[..., BookUpdate], path: Path, solution: SolvedSurvey, content: SurveyContent,
    *, overwrite: bool,
) -> BookUpdate:  # fmt: skip
    """Put the results into a workbook, with all that options put in the place of what it says."""
    options = dict(solution.given)
    if solution.rules != RULES:
        options["rules"] = solution.rules
    if solution.adjusted:
        options["adjust_setup"] = True
    return into(
        solution.source, path, solution.survey, typed_content(solution, content),
        options=options, overwrite=overwrite,
    )  # fmt: skip


def _add_columns(
    path: Path, solution: SolvedSurvey, content: SurveyContent, *, overwrite: bool
) -> str:
    """Put the results beside the user's own table; return where its old state is kept."""
    if solution.source.suffix.lower() not in (".xlsx", ".xlsm"):
        raise InputError(remark("survey.no_macros", of=path))
    done = _put(add_results, path, solution, content, overwrite=overwrite)
    note = "the results are new columns of your table"
    note = f"{note}; {_kept_as(done.kept)}" if done.kept else f"{note}."
    return " ".join([note, *done.remarks])


def _left_behind(solution: SolvedSurvey) -> str:
    """Return what a new workbook does not hold of the one that the points come from."""
    source, survey = solution.source, solution.survey
    if not survey.titles:
        return ""
    # A survey workbook saved as .ods has lost its tables, but not its sheets.
    is_ours = survey.is_ours or {"setup", "points"} <= {*map(bare, survey.titles)}
    others = [title for title in survey.titles if bare(title) not in _OURS or not is_ours]
    note = f"a new workbook; {source.name} stays as it is"
    if source.suffix.lower() in (".xlsx", ".xlsm") and not survey.is_ours:
        return f"{note} (--out {source} --overwrite puts the results into its own table)."
    if not others:
        return f"{note}."
    return f"{note}, and what else it holds is not in the new one: {', '.join(others)}."


def _kept_as(kept: Path | None) -> str:
    return f"the workbook as it was is kept as {kept}." if kept else ""


def _is_same_file(path: Path, source: Path) -> bool:
    return path.exists() and source.exists() and path.samefile(source)


def typed_content(solution: SolvedSurvey, content: SurveyContent) -> SurveyContent:
    """Return the content as it was typed: images in that order, no relief given beside points."""
    setup, points = solution.setup, solution.points
    if solution.corrections[1] is not None and setup is not None:
        setup, points = _uncorrected(solution, setup)
    if solution.pair.exchanged and setup is not None:
        setup, points = setup.exchanged(), points.exchanged()
    listed, reference = len(solution.survey.known_rows), solution.survey.known
    reference = KnownPoints(
        ids=reference.ids[:listed], xyz=reference.xyz[:listed], use=reference.used[:listed]
    )
    exchanged = solution.pair.exchanged
    return replace(content, setup=setup, as_given=exchanged, points=points, known=reference)


def _uncorrected(
    solution: SolvedSurvey, setup: SurveySetup
) -> tuple[SurveySetup, PointObservations]:
    """Return set-up and points as typed, the corrections of the images beside them.

    Points given by radial distances get coordinates, since only these can be corrected.
    """
    typed, points = solution.survey.setup, solution.survey.points
    if solution.pair.exchanged:
        typed, points = typed.exchanged(), points.exchanged()
    rows = (points.is_polar & ~points.is_cartesian)[:, None]
    polar = points.polar_xy()
    taking = typed.taking
    if typed.unit == "px" and taking.pitch is not None:
        flip = np.array([1, -1]) / taking.pitch
        nadirs = [np.array(nadir or (0.0, 0.0)) for nadir in (taking.nadir1, taking.nadir2)]
        polar = (nadirs[0] + polar[0] * flip, nadirs[1] + polar[1] * flip)
    points = replace(
        points, xy1=np.where(rows, polar[0], points.xy1), xy2=np.where(rows, polar[1], points.xy2)
    )
    return replace(setup.but(unit=typed.unit), adjusted=solution.corrections), points


def result_content(solution: SolvedSurvey, path: Path, language: str | None) -> SurveyContent:
    """Return the content of a new result workbook."""
    what = "solved" + (", set-up corrected by plane points" if solution.adjusted else "")
    pair_path = solution.pair_path
    return replace(
        SurveyContent.of(solution),
        language=language or solution.survey.language,
        pair_file="" if pair_path is None else relative_name(pair_path, path.parent),
        setup=_moved(solution.setup, solution.source.parent, path.parent),
        photo_files=_photo_files(solution, path.parent),
        log=[log_row(what, solution.source)],
    )


def _moved(setup: SurveySetup | None, old: Path, new: Path) -> SurveySetup | None:
    """Return the set-up with its photos as seen from another folder."""
    if setup is None or not (setup.photo1 or setup.photo2):
        return setup
    names = [name and relative_name(old / name, new) for name in (setup.photo1, setup.photo2)]
    return replace(setup, photo1=names[0], photo2=names[1])


def _photo_files(solution: SolvedSurvey, folder: Path) -> tuple[str, str]:
    """Return the photos that the survey's workbook names, as seen from a folder."""
    setup, old = solution.survey.setup, solution.source.parent
    first, second = (n and relative_name(old / n, folder) for n in (setup.photo1, setup.photo2))
    return first, second
