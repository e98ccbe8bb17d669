"""Solve a survey: file in, relief, coordinates, precision, check and world coordinates out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from bifocal.model import SCALE_TOLERANCE, Pair, PhotoSet
from bifocal.remarks import remark
from bifocal.survey import (
    RULES,
    Measuring,
    SolvedSurvey,
    SurveyInput,
    SurveyMedia,
    Taking,
    ToleranceRule,
    as_rule,
    given_of,
    refuse_not_above_zero,
    solve_survey,
    solve_survey_of_set,
)
from bifocal.workbook.formulas.setup_cells import cells_of
from bifocal.workbook.reading.known_lists import with_list
from bifocal.workbook.reading.reader import ReadOptions
from bifocal.workbook.sources import Source, given_pair, measured, set_or_pair, set_up
from photocore.errors import InputError


def solve(
    source: Source,
    *,
    pair: PhotoSet | Pair | Path | str | None = None,
    taking: Taking | None = None,
    measuring: Measuring | None = None,
    control: Path | str | None = None,
    control_order: str | None = None,
    adjust_setup: bool = False,
    model: str | None = None,
    scale_tolerance: float = SCALE_TOLERANCE,
    rules: Sequence[str | ToleranceRule] = (),
    reading: ReadOptions | None = None,
) -> SolvedSurvey:
    r"""Solve measured points: relief, displacements, coordinates, precision, check, world.

    Parameters
    ----------
    source : path, mapping, Matches, PointObservations, SurveyInput or tuple of two paths
        A survey workbook or table (``.xlsx .xlsm .ods .csv``), or columns by key: ``id`` and
        ``x1 y1 x2 y2`` [mm or px], or ``s1 s2`` [mm] and ``theta`` [deg], or ``col1 row1 col2
        row2`` [px], of a set of photos more; each of shape (n,), NaN where blank. A table may also
        have ``id photo col row``, a row a photo. Two paths: the picks of photo 1 and of photo 2
        (`bifocal.workbook.reading.pick_lists.read_picks`), joined by name. What `bifocal.match`
        gives goes with its ``pair``.
    pair : Pair, PhotoSet or path, optional
        Pair, set of photos or the file of either, for raw pixels, or a survey workbook whose
        set-up, check and control points are taken; default the workbook's own set-up.
    taking : Taking, optional
        Distances [m], principal distances [mm] and the like, in place of those of `Setup`.
    measuring : Measuring, optional
        Unit and precision of what was measured, in place of those of `Setup`.
    control : path, optional
        Table of points from the field, beside those of the workbook: id with E, N, H for control
        points, with X, Y, Z or r for check points. [m]
    control_order : str, optional
        Columns of a list without headings: ``"PNEZD"``, ``"id,E,N,H"``.
    adjust_setup : bool
        Correct the orientation by points of the reference plane (code PLANE, r = 0).
    model : {"auto", "levelled", "3D", "2D"}, optional
        Of the roto-translation to the world; default the workbook's, else auto.
    scale_tolerance : float
        Share by which the scales of both photos may differ.
    rules : sequence of str or ToleranceRule
        For the verdict on drawing scales: names, ``"0.2mm"`` at scale, ``"2cm"`` on the wall.
    reading : ReadOptions, optional
        Which column is which, the sheet of the points, the decimal separator; found by default.

    Returns
    -------
    SolvedSurvey
        ``table`` holds the columns of the sheet `Points` by key (``table["r"]``, ``table.xyz`` of
        shape (n, 3), ``table.flags``), NaN where undefined; ``remarks`` what the user should know.

    Raises
    ------
    WorkbookError
        Naming every bad cell.
    InputError, GeometryError
        If an option, the set-up or the geometry is at fault.

    Notes
    -----
    Eqs. (1) to (7) of [1]_; see `bifocal.survey.point_survey.solve_points`.

    References
    ----------
    .. [1] Midulla, "Bifocal pairs of images for low-cost survey in close range photogrammetry".

    Examples
    --------
    A point 2 m right of the nadir and 1 m before the wall, 35 mm / 17.5 m and 19 mm / 9.5 m:

    >>> picks = {"id": ["P1"], "s1": [35 * 2 / 16.5], "s2": [19 * 2 / 8.5], "theta": [90]}
    >>> survey = solve(picks, taking=Taking(d1=17.5, d2=9.5, c1=35, c2=19))
    >>> survey.table.xyz.round(9).tolist(), survey.table.flags
    ([[2.0, 0.0, 1.0]], ('OK',))
    """
    settings = given_of(taking) | given_of(measuring)
    refuse_not_above_zero(**settings, scale_tolerance=scale_tolerance)
    judged = tuple(as_rule(rule) for rule in rules) or RULES
    more = {"pair": pair, "model": model, "control": control}
    requests = settings | {name: value for name, value in more.items() if value is not None}
    photos, pair = set_or_pair(pair)
    count = 2 if photos is None else len(photos)
    options = replace(reading or ReadOptions(), given=tuple(cells_of(requests)), photos=count)
    survey, path = measured(source, options, settings.get("unit"), photos or pair)
    if control is not None:
        survey = with_list(survey, control, options.decimal, control_order)
    if photos is not None:
        return _solved_of_set(survey, photos, path, requests, rules=judged, adjust=adjust_setup)
    survey, pair = set_up(survey, pair, settings, options)
    general, pair_path, pair_remarks = given_pair(survey, path, pair)
    # What is wrong with the pair comes first.
    survey = replace(survey, model=model or survey.model, remarks=(*pair_remarks, *survey.remarks))
    solved = solve_survey(
        survey, general, adjust=adjust_setup, scale_tolerance=scale_tolerance, rules=judged
    )
    solved = replace(solved, remarks=(*_photos_contradict(solved, general), *solved.remarks))
    media = solved.media
    if general is not None and pair is not None:  # the cells of media take those of its file
        media = SurveyMedia.of_photos((general.image1, general.image2), media)
    return replace(solved, media=media, source=path, pair_path=pair_path, given=requests)


def _photos_contradict(solved: SolvedSurvey, pair: Pair | None) -> tuple[str, ...]:
    """Return what the pair's photos, where they are at hand, say against the picks."""
    photos = () if pair is None else (pair.image1, pair.image2)
    if pair is None or not all(photo.file and photo.path.is_file() for photo in photos):
        return ()
    # Only who has photos decodes them: OpenCV takes longer to load than a table to solve.
    from bifocal.workbook.held_picks import photos_against_picks

    return photos_against_picks(solved, pair)


def _solved_of_set(
    survey: SurveyInput,
    photos: PhotoSet,
    path: Path,
    requests: Mapping[str, Any],
    *,
    rules: tuple[ToleranceRule, ...],
    adjust: bool,
) -> SolvedSurvey:
    """Return what was measured in three photos and more, solved.

    Raises
    ------
    InputError
        If an option goes with pairs alone, or there are no points.
    """
    names = {"pair", "model", "control", *(f.name for f in fields(Measuring))}
    idle = ["adjust_setup"] if adjust else [name for name in requests if name not in names]
    if idle:
        raise InputError(remark("survey.not_of_a_set", option=idle[0], count=len(photos)))
    if not len(survey.points):
        raise InputError(f"{survey.where}: there is no point. Fill in the measured points.")
    others = ("pair", "model", "control")
    settings = {name: value for name, value in requests.items() if name not in others}
    remarks = (*photos.remarks, *survey.remarks)
    survey = replace(
        survey,
        setup=survey.setup.but(**settings),
        model=requests.get("model", survey.model),
        remarks=remarks,
    )
    solved = solve_survey_of_set(survey, photos, rules=rules)
    file = None if isinstance(requests["pair"], PhotoSet) else Path(requests["pair"])
    return replace(solved, source=path, pair_path=file, given=requests)
