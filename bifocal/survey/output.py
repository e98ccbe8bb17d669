"""What `bifocal solve` shows and writes: a table, JSON, a workbook, a text table."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.survey.basis import basis
from bifocal.survey.check_points import check_points
from bifocal.survey.georeferencing import georeference
from bifocal.survey.observations import PointObservations
from bifocal.survey.point_survey import solve_points
from bifocal.survey.reference import KnownPoints
from bifocal.survey.setup import SurveySetup
from bifocal.survey.solved_survey import SolvedSurvey
from bifocal.survey.template_workflow import MOST_ROWS, log_row
from bifocal.survey.tolerances import RULES, sentence
from bifocal.survey.workbook.book import write_book
from bifocal.survey.workbook.content import SurveyContent
from bifocal.survey.workbook.own_table import add_results
from bifocal.survey.workbook.update import check_kind, is_same_kind, update_book
from photocore.errors import InputError
from photocore.jsonfile import to_text
from photocore.output import check_not_input, relative_name
from photocore.tables import write_csv
from photocore.tables.headings import bare
from photocore.workbook.making.newbook import check_new_workbook

#: Sheets of a survey workbook, as `bare` writes them.
_OURS = {
    *("readme", "setup", "points", "results", "check", "georeference", "planning", "charts", "log")
}
_NUMBERS = ("r", "e1", "e2", "s_c", "X", "Y", "Z", "q", "sigma_X", "sigma_Y", "sigma_r")

#: Columns shown on the screen.
SHOWN = ("r", "e1", "e2", "X", "Y", "sigma_X", "sigma_Y", "sigma_r")


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
        write_csv(path, _csv_columns(solution), overwrite=overwrite)
        return ""
    if ending not in (".xlsx", ".xlsm"):
        raise InputError(f"{path}: results are written as .xlsx, .xlsm or .csv.")
    solution.pair.refuse_ports_that_lean(f"{path}: a survey workbook")
    if len(solution.table) > MOST_ROWS:
        raise InputError(
            f"{path}: {len(solution.table)} points are too many for a workbook (limit {MOST_ROWS})."
            f" Write a text table instead: --out {path.with_suffix('.csv').name}"
        )
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
    own = as_typed(solution, content)
    done = update_book(
        solution.source, path, solution.survey, own, given=_options(solution), overwrite=overwrite
    )
    kept = _kept_as(done.kept)
    if done.added:
        titles = ", ".join(done.added)
        kept = f"missing sheets were added again, behind all others: {titles}; {kept}".rstrip("; ")
    return kept


def _options(solution: SolvedSurvey) -> dict[str, Any]:
    """Return all that options put in the place of what a workbook says."""
    given = dict(solution.given)
    if solution.rules != RULES:
        given["rules"] = solution.rules
    if solution.adjusted:
        given["adjust_setup"] = True
    return given


def _add_columns(
    path: Path, solution: SolvedSurvey, content: SurveyContent, *, overwrite: bool
) -> str:
    """Put the results beside the user's own table; return where its old state is kept."""
    if solution.source.suffix.lower() not in (".xlsx", ".xlsm"):
        raise InputError(
            f"{path}: a workbook with macros is made from one only; write the result as .xlsx."
        )
    own = as_typed(solution, content)
    kept = add_results(
        solution.source, path, solution.survey, own, given=_options(solution), overwrite=overwrite
    )
    said = "the results are new columns of your table"
    return f"{said}; {_kept_as(kept)}" if kept else f"{said}."


def _left_behind(solution: SolvedSurvey) -> str:
    """Return what a new workbook does not hold of the one that the points come from."""
    source, survey = solution.source, solution.survey
    if not survey.titles:
        return ""
    # A survey workbook saved as .ods has lost its tables, but not its sheets.
    is_ours = survey.is_ours or {"setup", "points"} <= {*map(bare, survey.titles)}
    others = [title for title in survey.titles if bare(title) not in _OURS or not is_ours]
    said = f"a new workbook; {source.name} stays as it is"
    if source.suffix.lower() in (".xlsx", ".xlsm") and not survey.is_ours:
        return f"{said} (--out {source} --overwrite puts the results into its own table)."
    if not others:
        return f"{said}."
    return f"{said}, and what else it holds is not in the new one: {', '.join(others)}."


def _kept_as(kept: Path | None) -> str:
    return f"the workbook as it was is kept as {kept}." if kept else ""


def _is_same_file(path: Path, source: Path) -> bool:
    return path.exists() and source.exists() and path.samefile(source)


def as_typed(solution: SolvedSurvey, content: SurveyContent) -> SurveyContent:
    """Return the content as the workbook's formulas see it: images in the order they were typed."""
    table, setup, points = solution.table, solution.setup, solution.points
    world, exchanged = solution.georeference, solution.pair.exchanged
    control = solution.survey.control.without(points.unused)
    if solution.corrections[1] is not None and setup is not None:
        setup, points = _uncorrected(solution, setup)
    if exchanged and setup is not None:
        setup, points = setup.exchanged(), points.exchanged()
        table = solve_points(
            solution.pair, setup.in_millimetres(points), limits=setup.limits, as_given=True
        )
        if world is not None:
            world = georeference(table, control, model=world.model)
    # Relief given beside the points is checked too, but stands not on the sheet Check.
    listed = len(solution.survey.known_rows)
    whole = solution.survey.known
    known = KnownPoints(ids=whole.ids[:listed], xyz=whole.xyz[:listed], use=whole.used[:listed])
    return replace(
        content,
        setup=setup,
        as_given=exchanged,
        points=points,
        table=table,
        known=known,
        check=check_points(table, known.without(points.unused)),
        georeference=world,
    )


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
    if typed.unit == "px" and typed.pitch is not None:
        flip = np.array([1, -1]) / typed.pitch
        nadirs = [np.array(nadir or (0.0, 0.0)) for nadir in (typed.nadir1, typed.nadir2)]
        polar = (nadirs[0] + polar[0] * flip, nadirs[1] + polar[1] * flip)
    points = replace(
        points, xy1=np.where(rows, polar[0], points.xy1), xy2=np.where(rows, polar[1], points.xy2)
    )
    return replace(setup, unit=typed.unit, adjusted=solution.corrections), points


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


def _csv_columns(solution: SolvedSurvey) -> dict[str, Any]:
    """Return the columns of the text table, headings with units."""
    table, world = solution.table, solution.world
    columns: dict[str, Any] = {"id": list(table.ids)}
    units = dict.fromkeys(("e1", "e2", "s_c", "q"), length_unit(solution))
    for key in ("X", "Y", "Z"):
        columns[f"{key} [m]"] = table[key]
    if solution.georeference is not None:
        columns |= {f"{key} [m]": world[:, i] for i, key in enumerate("ENH")}
    for key in ("r", "e1", "e2", "s_c", "q", "sigma_X", "sigma_Y", "sigma_r"):
        columns[f"{key} [{units.get(key, 'm')}]"] = table[key]
    if solution.georeference is not None:
        sigma = solution.world_sigma
        columns |= {f"sigma_{key} [m]": sigma[:, i] for i, key in enumerate("ENH")}
    columns["flag"] = list(table.flags)
    if any(solution.points.note):
        columns["note"] = list(solution.points.note)
    return columns


def solution_json(solution: SolvedSurvey) -> str:
    """Return everything as the text of one JSON object; undefined numbers are null."""
    head = to_text(_head(solution))
    # A million points: each record is put together as text, not as a tree of objects.
    records = ",\n".join(_records(solution))
    return f'{{"points": [{records}], {head[1:]}'


def _records(solution: SolvedSurvey) -> list[str]:
    table = solution.table
    columns = [table[key].tolist() for key in _NUMBERS]
    world, keys = [], list(_NUMBERS)
    if solution.georeference is not None:
        placed = np.hstack([solution.world, solution.world_sigma])
        world = placed.T.tolist()
        keys += ["E", "N", "H", "sigma_E", "sigma_N", "sigma_H"]
    numbers = [
        [repr(value) if math.isfinite(value) else "null" for value in values]
        for values in (*columns, *world)
    ]
    names = [json.dumps(name, ensure_ascii=False) for name in table.ids]
    use = ["true" if value else "false" for value in solution.points.use]
    template = (
        '{{"id": {}, ' + ", ".join(f'"{key}": {{}}' for key in keys)
        + ', "flag": "{}", "use": {}}}'
    )  # fmt: skip
    return [template.format(*row) for row in zip(names, *numbers, table.flags, use, strict=True)]


def _head(solution: SolvedSurvey) -> dict[str, Any]:
    """Return all but the points."""
    axes = solution.check.axes
    return {
        "check": {
            **asdict(axes["Z"]),
            "axes": {key: asdict(axis) for key, axis in axes.items()},
            "errors": [
                {"id": name, "dX": e[0], "dY": e[1], "dZ": e[2]}
                for name, e in zip(solution.check.ids, solution.check.errors, strict=True)
            ],
            "verdict": verdict_lines(solution),
            "missing": list(solution.check.missing),
        },
        "georeference": _georeference(solution),
        "setup_check": _orientation_check(solution),
        "sigma_px": solution.sigma_px,
        "rests_on": basis(solution),
        "units": {
            "r": "m",
            "X": "m",
            "e1": length_unit(solution),
            "sigma_X": "m",
            "sigma_Y": "m",
            "sigma_r": "m",
        },
        "remarks": list(solution.remarks),
    }


def length_unit(solution: SolvedSurvey) -> str:
    """Return the unit of e1, e2, s_c and q: without an image scale they are on the wall."""
    known = solution.setup is not None or solution.table.image_scale is not None
    return "mm" if known else "m"


def _georeference(solution: SolvedSurvey) -> dict[str, Any] | None:
    geo = solution.georeference
    if geo is None:
        return None
    return {
        "model": geo.model,
        "n": int(geo.used.sum()),
        "left_out": list(geo.bad),
        "sigma0": geo.sigma0,
        "error_ratio": geo.error_ratio,
        "scale": geo.world_from_wall.scale,
        "rotation": geo.world_from_wall.rotation,
        "wall_centre": geo.world_from_wall.source_centre,
        "world_centre": geo.world_from_wall.target_centre,
        "residuals": [
            {"id": name, "vE": v[0], "vN": v[1], "vH": v[2], "used": bool(used)}
            for name, v, used in zip(geo.ids, geo.residuals, geo.used, strict=True)
        ],
    }


def _orientation_check(solution: SolvedSurvey) -> dict[str, Any] | None:
    check = solution.orientation_check
    if check is None:
        return None
    return {
        "points": check.points,
        "sigma0": check.sigma0,
        "outliers": list(check.outliers),
        "adjusted": solution.adjusted,
        "parameters": [asdict(parameter) for parameter in check.parameters],
    }


def verdict_lines(solution: SolvedSurvey) -> list[str]:
    """Return one sentence per tolerance rule."""
    verdicts = solution.check.verdicts
    rules = list(dict.fromkeys(verdict.rule.key for verdict in verdicts))
    return [sentence(tuple(v for v in verdicts if v.rule.key == key)) for key in rules]


def point_rows(solution: SolvedSurvey, most: int) -> list[tuple[str, ...]]:
    """Return the first points as rows of text: id, the columns of `SHOWN`, flag.

    A point that is not used is no good point: its flag stands in brackets.
    """
    table = solution.table
    rows = []
    for i in range(min(most, len(table))):
        shown = [_shown(table[key][i], 4) for key in SHOWN]
        flag = table.flags[i] if solution.points.use[i] else f"({table.flags[i]}, unused)"
        rows.append((table.ids[i], *shown, flag))
    return rows


def summary(solution: SolvedSurvey) -> list[str]:
    """Return what the sigmas rest on, check points, verdict and georeference in words."""
    lines = [basis(solution)]
    for axis, errors in solution.check.axes.items():
        if errors.n:
            lines.append(
                f"Check {axis}: {errors.n} {_points(errors.n)}, RMSE {errors.rmse:.4f} m, "
                f"mean {errors.mean:+.4f} m, largest {errors.max_abs:.4f} m"
            )
    lines += [f"Drawing scale, {line}" for line in verdict_lines(solution)]
    geo = solution.georeference
    if geo is not None:
        used = int(geo.used.sum())
        spread = "no redundancy" if math.isnan(geo.sigma0) else f"sigma0 {geo.sigma0:.4f} m"
        lines.append(
            f"Georeference: {geo.model}, {used} {_points(used)}, {spread}, scale "
            f"{geo.world_from_wall.scale:.6f}"
        )
    return lines


def _points(count: int) -> str:
    return "point" if count == 1 else "points"


def _shown(value: float, places: int) -> str:
    return f"{value:.{places}f}" if math.isfinite(value) else "-"
