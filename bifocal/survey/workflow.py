"""Solve a survey: file in, relief, coordinates, precision, check and world coordinates out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.model.flags import FlagLimits
from bifocal.model.homography import apply_homography
from bifocal.model.pair import Pair
from bifocal.remarks import remark
from bifocal.survey.check_points import check_points
from bifocal.survey.georeferencing import georeference
from bifocal.survey.observations import PointObservations
from bifocal.survey.orientation_check import (
    OrientationCheck,
    check_orientation,
    with_zoom_centre,
    zoom_centre_of_points,
)
from bifocal.survey.point_survey import solve_points
from bifocal.survey.reference import CheckResult, Georeference, KnownPoints
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.remarks import (
    exchanged_remark,
    georeference_remarks,
    opposite_signs_remark,
    point_remarks,
    refraction_remarks,
    unused_remarks,
    wide_remarks,
)
from bifocal.survey.setup import SCALE_TOLERANCE, SurveySetup
from bifocal.survey.sources import Source, given_pair, measured, set_up
from bifocal.survey.survey_media import UNBENT, SurveyMedia
from bifocal.survey.tolerances import RULES, ToleranceRule, as_rule
from bifocal.survey.units import (
    as_pixels,
    given_above_zero,
    refuse_contradiction,
    refuse_millimetres,
    refuse_wrong_unit,
)
from bifocal.survey.workbook.content import SurveyContent
from bifocal.survey.workbook.reader import ReadOptions, SurveyInput, column_map
from bifocal.survey.workbook.setup_cells import OPTION_CELLS
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.tables.numbers import Decimal

#: Homographies of both images, shape (3, 3), None for none.
Corrections = tuple[FloatArray | None, FloatArray | None]
#: From this many points on, the picks' precision is taken from their misfits.
MINIMUM_FOR_SIGMA = 20
#: Precision is never taken for better than this. [px]
BEST_SIGMA_PX = 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvedSurvey(SurveyContent):
    """A solved survey: what the workbook shows of it, and where it comes from.

    Attributes
    ----------
    pair : Pair
        The geometry; ``setup`` is that of an ideal pair, None for one given by homographies.
    points : PointObservations
        As solved: images exchanged where the user had them the other way round.
    table : ReliefTable
        What came out: relief, displacements, coordinates, precision, flags.
    check : CheckResult
        Errors at check points.
    source : Path
        The file it came from.
    survey : SurveyInput
        What was read, with the set-up as options left it.
    pair_path : Path or None
        The pair file.
    orientation_check : OrientationCheck or None
        What the points of the reference plane tell.
    adjusted : bool
        Whether the orientation was corrected by it.
    corrections : pair of ndarray, shape (3, 3), or None
        Homographies that corrected the typed coordinates in mm, where the pair is ideal.
    given : mapping
        The options that took the place of what the workbook says.
    remarks : tuple of str
        What the user should know.
    """

    pair: Pair
    points: PointObservations
    table: ReliefTable
    check: CheckResult
    source: Path
    survey: SurveyInput
    pair_path: Path | None
    orientation_check: OrientationCheck | None
    adjusted: bool
    corrections: Corrections
    given: Mapping[str, Any]
    remarks: tuple[str, ...]

    @property
    def world(self) -> FloatArray:
        """E, N, H of every point, shape (n, 3); NaN without control points. [m]"""
        if self.georeference is None:
            return np.full((len(self.table), 3), np.nan)
        return self.georeference.world_from_wall(self.table.xyz)


def solve(
    source: Source,
    *,
    pair: Pair | Path | str | None = None,
    d1: float | None = None,
    d2: float | None = None,
    c1: float | None = None,
    c2: float | None = None,
    enlargement1: float | None = None,
    enlargement2: float | None = None,
    pitch: float | None = None,
    unit: str | None = None,
    sigma_s: float | None = None,
    sigma_px: float | None = None,
    sigma_r_max: float | None = None,
    adjust_setup: bool = False,
    model: str | None = None,
    scale_tolerance: float = SCALE_TOLERANCE,
    rules: Sequence[str | ToleranceRule] = (),
    columns: str | None = None,
    sheet: str | None = None,
    decimal: Decimal | None = None,
    visible_only: bool = False,
) -> SolvedSurvey:
    r"""Solve measured points: relief, displacements, coordinates, precision, check, world.

    Parameters
    ----------
    source : path, mapping, PointObservations, SurveyInput or tuple of two paths
        A survey workbook or table (``.xlsx .xlsm .ods .csv``), or columns by key: ``id`` and
        ``x1 y1 x2 y2`` [mm or px], or ``s1 s2`` [mm] and ``theta`` [deg], or ``col1 row1 col2
        row2`` [px]; each of shape (n,), NaN where blank. Two paths: the picks of photo 1 and of
        photo 2 (`bifocal.survey.pick_lists.read_picks`), joined by name.
    pair : Pair or path, optional
        Pair or pair file, for raw pixels, or a survey workbook whose set-up, check and control
        points are taken; default the workbook's own set-up.
    d1, d2 : float, optional
        Distances of the projection centres to the reference plane, d1 > d2, in place of those of
        `Setup`, as all that follow. [m]
    c1, c2 : float, optional
        Principal distances; without them X and Y stay NaN. [mm]
    enlargement1, enlargement2 : float, optional
        How many times larger than on the sensor the images are on the prints that were measured.
    pitch : float, optional
        Size of a pixel. [mm/px]
    unit : {"mm", "px"}, optional
        Of ``x1 y1 x2 y2``; default as headings or `Setup` say, else mm.
    sigma_s, sigma_px : float, optional
        Precision of an image coordinate [mm], default 0.5 px, of prints 0.2 mm, and of a raw pixel
        [px], default the pair's, else found from the misfits of 20 or more points, else 0.5.
    sigma_r_max : float, optional
        Points of less precise relief are UNCERTAIN; default 2 % of d2. [m]
    adjust_setup : bool
        Correct the orientation by points of the reference plane (code PLANE, r = 0).
    model : {"auto", "levelled", "3D", "2D"}, optional
        Of the roto-translation to the world; default the workbook's, else auto.
    scale_tolerance : float
        Share by which the scales of both photos may differ.
    rules : sequence of str or ToleranceRule
        For the verdict on drawing scales: names, ``"0.2mm"`` at scale, ``"2cm"`` on the wall.
    columns, sheet, decimal : str, optional
        Which column is which (``"id=A,s1=My heading"``), the sheet of the points, the separator
        (``point`` or ``comma``) of numbers typed as text; all found by default.
    visible_only : bool
        Leave out hidden and filtered rows.

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
    >>> survey = solve(picks, d1=17.5, d2=9.5, c1=35, c2=19)
    >>> survey.table.xyz.round(9).tolist(), survey.table.flags
    ([[2.0, 0.0, 1.0]], ('OK',))
    """
    lengths = {"d1": d1, "d2": d2, "c1": c1, "c2": c2, "pitch": pitch}
    lengths |= {"enlargement1": enlargement1, "enlargement2": enlargement2}
    given = given_above_zero(**lengths, sigma_s=sigma_s, sigma_r_max=sigma_r_max)
    given_above_zero(sigma_px=sigma_px, scale_tolerance=scale_tolerance)
    judged = tuple(as_rule(rule) for rule in rules) or RULES
    asked = {**given, "unit": unit, "pair": pair, "sigma_px": sigma_px, "model": model}
    asked = {name: value for name, value in asked.items() if value is not None}
    options = ReadOptions(
        columns=column_map(columns), sheet=sheet, decimal=decimal, visible_only=visible_only,
        given=[OPTION_CELLS.get(option, option) for option in asked],
    )  # fmt: skip
    survey, path = measured(source, options, unit)
    survey, pair = set_up(survey, pair, given, unit, options)
    general, pair_path, pair_remarks = given_pair(survey, path, pair)
    if general is None:
        solved = _solve_ideal(survey, scale_tolerance, adjust=adjust_setup)
    else:
        solved = _solve_pair(general, survey, sigma_px, adjust=adjust_setup)
    table, setup = solved.table, survey.setup
    refuse_contradiction(solved.points, table, survey.where)
    unused = solved.points.unused
    known, control = survey.known.without(unused), survey.control.without(unused)
    check = check_points(table, known, judged)
    world, world_remarks = _placed(control, table, model or survey.model)
    remarks = (
        *pair_remarks,  # what is wrong with the pair comes first
        *survey.remarks,
        *solved.remarks,
        *point_remarks(solved.points, table, solved.setup),
        *check.remarks,
        *unused_remarks(unused, Check=survey.known, Georeference=survey.control),
        *opposite_signs_remark(table, known),
        *world_remarks,
    )
    return SolvedSurvey(
        language=survey.language, source=path, survey=survey, points=solved.points, table=table,
        setup=solved.setup, pair=solved.pair, pair_path=pair_path, sigma_px=solved.sigma_px,
        known=survey.known, check=check, control=survey.control, georeference=world,
        model=model or survey.model, sensor=setup.sensor, limits=setup.limits,
        orientation_check=solved.check, media=_media(survey, pair, general), adjusted=adjust_setup,
        corrections=solved.corrections, given=asked, rules=judged,
        remarks=tuple(dict.fromkeys(remarks)),
    )  # fmt: skip


def _media(
    survey: SurveyInput, pair: Pair | Path | str | None, general: Pair | None
) -> SurveyMedia | None:
    """Return what the cells of media hold of a general pair: as typed, or those of its file."""
    typed = survey.setup.media
    if general is None or pair is None:
        return typed
    return SurveyMedia.of_photos((general.image1, general.image2), typed.media if typed else 0)


def _placed(
    control: KnownPoints, table: ReliefTable, model: str
) -> tuple[Georeference | None, list[str]]:
    """Return the wall in the world, where there are control points, and remarks on it."""
    if not control.used.any() or np.isnan(control.xyz).all():
        return None, []
    world = georeference(table, control, model=model)
    return world, georeference_remarks(world, control, table, is_auto=model == "auto")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _SolvedPoints:
    """Points solved with one geometry."""

    points: PointObservations
    table: ReliefTable
    pair: Pair
    setup: SurveySetup | None = None
    sigma_px: float | None = None
    check: OrientationCheck | None = None
    corrections: Corrections = (None, None)
    remarks: tuple[str, ...] = ()


def _solve_pair(
    pair: Pair, survey: SurveyInput, sigma_px: float | None, *, adjust: bool
) -> _SolvedPoints:
    """Solve raw pixels with a pair; coordinates in millimetres are carried to pixels first."""
    points = survey.points.exchanged() if pair.exchanged else survey.points
    setup = survey.setup
    points = as_pixels(pair, points, survey.where, setup.unit)
    refuse_millimetres(pair, points, survey.where)
    sigma = sigma_px or setup.sigma_px
    remarks: tuple[str, ...] = ()
    if sigma is None and not any(photo.sigma_pixel for photo in (pair.image1, pair.image2)):
        sigma, remarks = _sigma_from_misfits(pair, points)
    check = _check_plane(pair, points, (points.pixels1, points.pixels2), sigma, survey, adjust)
    if check is not None and adjust:
        pair, said = _with_centre(check.corrected, points, (points.pixels1, points.pixels2), sigma)
        remarks = (*remarks, *said)
    return _SolvedPoints(
        points=points,
        table=solve_points(pair, points, sigma_px=sigma, limits=setup.limits),
        pair=pair,
        sigma_px=sigma,
        check=check,
        remarks=(*remarks, *(check.remarks if check else ()), *refraction_remarks(pair, points)),
    )


def _with_centre(
    pair: Pair,
    points: PointObservations,
    pixels: tuple[FloatArray, FloatArray],
    sigma_px: float | None,
) -> tuple[Pair, tuple[str, ...]]:
    """Return a pair corrected by its plane points with the centre of zoom that the others show.

    Through media relief spreads from no one point: the nadirs stay as stated.
    """
    if pair.layers not in (None, UNBENT):
        return pair, ()
    rows = points.use & ~points.on_plane
    first, second = (
        photo.picks(picked[rows], sigma_px)
        for photo, picked in zip((pair.image1, pair.image2), pixels, strict=True)
    )
    variance = sum(np.trace(p.covariance, axis1=1, axis2=2) / 4 for p in (first, second))
    found = zoom_centre_of_points(
        pair, np.array(first.positions), np.array(second.positions), np.sqrt(variance)
    )
    if found is None:
        return pair, ()
    move = found[0] - pair.zoom_centre
    spread = float(np.sqrt(np.trace(found[1]) / 2))
    x, y, sigma = 1000 * np.array([*move, spread])
    return with_zoom_centre(pair, found[0]), (remark("survey.centre_moved", x=x, y=y, sigma=sigma),)


def _check_plane(
    pair: Pair,
    points: PointObservations,
    pixels: tuple[FloatArray, FloatArray],
    sigma: float | None,
    survey: SurveyInput,
    needed: bool,
) -> OrientationCheck | None:
    """Return what points of the reference plane tell; None where there are fewer than two."""
    rows = points.on_plane
    if rows.sum() < 2:
        if needed:
            raise InputError(
                f"{survey.where}: --adjust-setup needs two or more points that lie on the "
                "reference plane; mark them with the code PLANE."
            )
        return None
    names = [name for name, on in zip(points.ids, rows, strict=True) if on]
    return check_orientation(pair, pixels[0][rows], pixels[1][rows], names=names, sigma_px=sigma)


def _sigma_from_misfits(
    pair: Pair, points: PointObservations
) -> tuple[float | None, tuple[str, ...]]:
    """Return the picks' precision from their misfits across the radius, robustly; None if few.

    Root mean square of those that it does not make OFF-RADIAL. Real picks have long tails: the
    median alone says 0.32 px of church_2, where 0.44 px is what the points kept are good to.
    """
    rows = points.use & ~np.isnan(np.hstack([points.pixels1, points.pixels2])).any(axis=1)
    if rows.sum() < MINIMUM_FOR_SIGMA:
        return None, ()
    trial = pair.intersect(points.pixels1[rows], points.pixels2[rows], sigma_px=1.0)
    away = np.abs(trial.standardised[np.isfinite(trial.standardised)])
    # 1.4826 x median of |N(0, s)| is s: half of the points may be blunders.
    spread = 1.4826 * float(np.median(away)) if len(away) else 0.0
    for _ in range(10):
        kept = away[away <= FlagLimits().off_radial * spread]
        spread = float(np.sqrt(np.mean(kept**2))) if len(kept) else spread
    sigma = max(spread, BEST_SIGMA_PX)
    return sigma, (remark("survey.sigma_found", sigma=sigma, count=int(rows.sum())),)


def _solve_ideal(survey: SurveyInput, scale_tolerance: float, *, adjust: bool) -> _SolvedPoints:
    """Solve image coordinates or radial distances with the ideal pair of `Setup`."""
    points, setup = survey.points, survey.setup
    if points.has_pixels.any() and not points.is_cartesian.any():
        if setup.pitch is None:
            raise InputError(
                f"{survey.where}: raw pixels (col1 row1 col2 row2) need a pair file: --pair "
                "PAIR.pair.json."
            )
        points = replace(points, xy1=points.pixels1, xy2=points.pixels2)
        setup = replace(setup, unit="px")
    pair = setup.pair()
    remarks = [*setup.remarks, setup.check_scales(scale_tolerance)]
    refuse_wrong_unit(setup, points, survey.where, said=survey.unit)
    remarks += wide_remarks(setup, points)
    if pair.exchanged:
        remarks.append(exchanged_remark(setup))
        setup, points = setup.exchanged(), points.exchanged()
    measured = setup.in_millimetres(points)
    xy1, xy2 = measured.all_xy()
    check = _check_plane(pair, points, (xy1, xy2), None, survey, adjust)
    corrections: Corrections = (None, None)
    if check is not None:
        remarks += check.remarks
        if adjust:
            # Through media image 2 keeps its own scale: what the wall seems is not c / d.
            bent = setup.refracted
            scale = (pair.image2 if bent else pair.image1).plane_from_pixel[0, 0]
            correction = check.matrix @ pair.image2.plane_from_pixel / [[scale], [scale], [1.0]]
            moved = apply_homography(correction, xy2)
            only_theta = points.polar * np.array([np.nan, np.nan, 1.0])
            found, said = _with_centre(check.corrected, points, (xy1, xy2), None)
            # An ideal pair counts from its nadir; relief spreads from the centre of zoom.
            centre = found.zoom_centre / scale if said else np.zeros(2)
            points = measured = replace(
                measured, xy1=xy1 - centre, xy2=moved - centre, polar=only_theta
            )
            corrections = _with_corrections(setup, correction, centre)
            c2 = None if setup.c1 is None else setup.c1 * pair.d2 / pair.d1
            if bent:
                c2 = setup.c2
            if not bent:
                setup = replace(setup, enlargement2=setup.enlargement1)
            setup = replace(setup, unit="mm", c2=c2, adjusted=(None, None))
            pair = setup.pair()
            remarks += said
            if said:
                remarks.append(remark("survey.centre_found"))
            remarks.append(remark("survey.image2_corrected", image=2 if bent else 1))
    if setup.c1 is None:
        remarks.append(remark("survey.no_principal_distances"))
    return _SolvedPoints(
        points=points,
        table=solve_points(pair, measured, limits=setup.limits),
        pair=pair,
        setup=setup,
        check=check,
        corrections=corrections,
        remarks=(*filter(None, remarks), *refraction_remarks(pair, measured)),
    )


def _with_corrections(
    setup: SurveySetup, correction: FloatArray, centre: FloatArray
) -> Corrections:
    """Return what corrects typed coordinates in mm: of image 2, then both counted from a centre."""
    shift = np.array([[1.0, 0.0, -centre[0]], [0.0, 1.0, -centre[1]], [0.0, 0.0, 1.0]])
    first, second = setup.adjusted
    if centre.any():
        first = shift if first is None else shift @ first
    return first, shift @ (correction if second is None else correction @ second)
