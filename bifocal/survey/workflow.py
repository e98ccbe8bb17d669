"""Solve a survey: file in, relief, coordinates, precision, check and world coordinates out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.model.pair import Pair, Photo, apply_homography
from bifocal.survey.check_points import check_points
from bifocal.survey.georeferencing import georeference
from bifocal.survey.observations import PointObservations
from bifocal.survey.orientation_check import SetupCheck, check_setup
from bifocal.survey.point_survey import solve_ideal, solve_pair
from bifocal.survey.reference import CheckResult, Georeference
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.remarks import (
    exchanged_remark,
    georeference_remarks,
    opposite_signs_remark,
    point_remarks,
)
from bifocal.survey.setup import SCALE_TOLERANCE, SurveySetup
from bifocal.survey.tolerances import RULES, ToleranceRule
from bifocal.survey.units import (
    refuse_far_stations,
    refuse_millimetres,
    refuse_pixels,
    refuse_wrong_unit,
)
from bifocal.survey.workbook.reader import ReadOptions, SurveyInput, pair_of, read_survey
from bifocal.survey.workbook.setup_reader import SetupValues
from photocore.arrays import FloatArray
from photocore.errors import GeometryError, InputError

#: From this many points on, the picks' precision is taken from their misfits.
MINIMUM_FOR_SIGMA = 20
#: Precision is never taken for better than this. [px]
BEST_SIGMA_PX = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveOptions:
    """What the user may choose.

    Attributes
    ----------
    read : ReadOptions
        How to read the table.
    pair : Path or None
        Pair file, for raw pixels.
    setup : mapping
        Values in place of those of `Setup`: ``d1 d2 c1 c2 pitch sigma_s sigma_r_max unit``.
    sigma_px : float or None
        Measuring precision of raw pixels; default the pair's, else found from the misfits. [px]
    adjust_setup : bool
        Correct the set-up by points of the reference plane.
    model : str or None
        Georeference model in place of the workbook's.
    scale_tolerance : float
        Share by which the scales of both photos may differ.
    rules : tuple of ToleranceRule
        For the verdict.
    """

    read: ReadOptions = field(default_factory=ReadOptions)
    pair: Path | None = None
    setup: Mapping[str, Any] = field(default_factory=dict)
    sigma_px: float | None = None
    adjust_setup: bool = False
    model: str | None = None
    scale_tolerance: float = SCALE_TOLERANCE
    rules: tuple[ToleranceRule, ...] = RULES


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """A solved survey.

    Attributes
    ----------
    source : Path
        The file it came from.
    survey : SurveyInput
        What was read.
    points : PointObservations
        As solved: images exchanged where the user had them the other way round.
    table : ReliefTable
        What came out.
    setup, pair : SurveySetup or None, Pair or None
        The geometry: an ideal pair or any pair.
    pair_path : Path or None
        The pair file.
    sigma_px : float or None
        Measuring precision of raw pixels. [px]
    check : CheckResult
        Errors at check points.
    georeference : Georeference or None
        World coordinates; None without control points.
    setup_check : SetupCheck or None
        What the points of the reference plane tell.
    adjusted : bool
        Whether the set-up was corrected by it.
    exchanged : bool
        Whether images 1 and 2 were exchanged.
    overridden : bool
        Whether options took the place of what the workbook says.
    rules : tuple of ToleranceRule
        For the verdict.
    remarks : tuple of str
        What the user should know.
    """

    source: Path
    survey: SurveyInput
    points: PointObservations
    table: ReliefTable
    setup: SurveySetup | None
    pair: Pair | None
    pair_path: Path | None
    sigma_px: float | None
    check: CheckResult
    georeference: Georeference | None
    setup_check: SetupCheck | None
    adjusted: bool
    exchanged: bool
    overridden: bool
    rules: tuple[ToleranceRule, ...]
    remarks: tuple[str, ...]

    @property
    def world(self) -> FloatArray:
        """E, N, H of every point, shape (n, 3); NaN without control points. [m]"""
        if self.georeference is None:
            return np.full((len(self.table), 3), np.nan)
        return self.georeference.world_from_wall(self.table.xyz)


def solve_file(path: Path | str, options: SolveOptions | None = None) -> Solution:
    """Read and solve a survey.

    Parameters
    ----------
    path : path
        Workbook or text table with measured points.
    options : SolveOptions, optional
        What the user chose.

    Returns
    -------
    Solution

    Raises
    ------
    InputError, GeometryError
        If a cell, the set-up or the geometry is at fault.
    """
    options, path = options or SolveOptions(), Path(path)
    survey = read_survey(path, options.read)
    remarks = list(survey.remarks)
    values = survey.setup.with_options(**options.setup)
    survey = replace(survey, setup=values)
    if not len(survey.points):
        raise InputError(f"{_where(survey)}: there is no point. Fill in the measured points.")
    if options.pair is None:
        refuse_far_stations(values.d1, values.d2, values.where, options=set(options.setup))
    pair, pair_path = _pair(path, values, options, remarks)
    points = survey.points
    if pair is not None:
        geometry = _solve_general(pair, points, survey, values, options, remarks)
    else:
        geometry = _solve_ideal(points, survey, values, options, remarks)
    table = geometry.table
    remarks += point_remarks(geometry.points, table, geometry.setup)
    check = check_points(table, survey.known, options.rules)
    if check.missing:
        remarks.append(f"Check: no measured point is called {', '.join(check.missing[:10])}.")
    remarks += opposite_signs_remark(table, survey.known)
    world = None
    if survey.control.used.any() and not np.isnan(survey.control.xyz).all():
        model = options.model or survey.model
        world = georeference(table, survey.control, model=model)
        remarks += georeference_remarks(world, survey.control, table, is_auto=model == "auto")
    return Solution(
        source=path,
        survey=survey,
        points=geometry.points,
        table=table,
        setup=geometry.setup,
        pair=geometry.pair,
        pair_path=pair_path,
        sigma_px=geometry.sigma_px,
        check=check,
        georeference=world,
        setup_check=geometry.check,
        adjusted=geometry.adjusted,
        exchanged=geometry.exchanged,
        overridden=bool(options.setup) or options.pair is not None or geometry.new_sigma,
        rules=options.rules,
        remarks=tuple(dict.fromkeys(remarks)),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solved:
    """Points solved with one geometry."""

    points: PointObservations
    table: ReliefTable
    setup: SurveySetup | None = None
    pair: Pair | None = None
    sigma_px: float | None = None
    check: SetupCheck | None = None
    adjusted: bool = False
    exchanged: bool = False
    new_sigma: bool = False


def _where(survey: SurveyInput) -> str:
    table = survey.table
    return f"{table.file} › {table.sheet}" if table.sheet else table.file


def _pair(
    path: Path, values: SetupValues, options: SolveOptions, remarks: list[str]
) -> tuple[Pair | None, Path | None]:
    """Return the pair asked for, or the one the workbook describes, with its file."""
    if options.pair is not None:
        given = Pair.read(options.pair)
        remarks += [f"{options.pair}: {remark}" for remark in given.remarks]
        return given, options.pair
    pair = pair_of(values, path.parent)
    named = path.parent / values.pair_file if values.pair_file else None
    if pair is not None:
        remarks += [f"{values.where}: {remark}" for remark in pair.remarks]
        return pair, named if named is not None and named.is_file() else None
    return None, None


def _solve_general(
    pair: Pair,
    points: PointObservations,
    survey: SurveyInput,
    values: SetupValues,
    options: SolveOptions,
    remarks: list[str],
) -> _Solved:
    """Solve raw pixels with a pair; coordinates in millimetres are carried to pixels first."""
    exchanged = pair.exchanged
    if exchanged:
        points = points.exchanged()
    unit = str(options.setup.get("unit") or survey.unit or values.unit or "mm")
    points = _as_pixels(pair, points, survey, unit)
    refuse_millimetres(pair, points, _where(survey))
    sigma = options.sigma_px or values.sigma_px
    own = any(photo.sigma_pixel for photo in (pair.image1, pair.image2))
    if sigma is None and not own:
        sigma = _sigma_from_misfits(pair, points, remarks)
    check, adjusted = None, False
    if points.on_plane.sum() >= 2:
        names = [name for name, on in zip(points.ids, points.on_plane, strict=True) if on]
        check = check_setup(
            pair,
            points.pixels1[points.on_plane],
            points.pixels2[points.on_plane],
            names=names,
            sigma_px=sigma,
        )
        remarks += [f"Set-up: {line}" for line in check.sentences()]
        if options.adjust_setup:
            pair, adjusted = check.corrected, True
    elif options.adjust_setup:
        raise InputError(_TOO_FEW_PLANE_POINTS.format(where=_where(survey)))
    table = solve_pair(
        pair,
        points,
        sigma_px=sigma,
        sigma_r_max=values.sigma_r_max,
        flag_sigmas=values.flag_sigmas,
    )
    return _Solved(
        points=points,
        table=table,
        pair=pair,
        sigma_px=sigma,
        check=check,
        adjusted=adjusted,
        exchanged=exchanged,
        new_sigma=sigma != values.sigma_px,
    )


_TOO_FEW_PLANE_POINTS = (
    "{where}: --adjust-setup needs two or more points that lie on the reference plane; mark them "
    "with the code PLANE."
)


def _as_pixels(
    pair: Pair, points: PointObservations, survey: SurveyInput, unit: str
) -> PointObservations:
    """Return the points with raw pixels for every kind of input."""
    missing = ~points.has_pixels
    xy = points.is_cartesian & missing
    if xy.any():
        if unit == "px":
            pixels1, pixels2 = points.xy1, points.xy2
        else:
            pixels1, pixels2 = _pixels_of_mm(pair, points.xy1, points.xy2, survey)
    else:
        polar = missing & ~np.isnan(points.polar[:, :2]).all(axis=1)
        if not polar.any():
            return points
        if np.isnan(points.polar[polar & points.use, 2]).any():
            raise InputError(
                f"{_where(survey)}: theta is needed beside s1 and s2 to use them with a pair file."
            )
        if not np.allclose(pair.image1.nadir, pair.image2.nadir, atol=1e-9):
            raise GeometryError(
                f"{_where(survey)}: the cameras of this pair have different nadir points, so s1 and"
                " s2 do not share one direction theta; measure x1 y1 x2 y2 or pixels."
            )
        angle = np.radians(points.polar[:, 2])
        direction = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
        pixels1, pixels2 = _pixels_of_mm(
            pair,
            points.polar[:, :1] * direction,
            points.polar[:, 1:2] * direction,
            survey,
        )
        xy = polar
    return replace(
        points,
        pixels1=np.where(xy[:, None], pixels1, points.pixels1),
        pixels2=np.where(xy[:, None], pixels2, points.pixels2),
    )


def _pixels_of_mm(
    pair: Pair, xy1: FloatArray, xy2: FloatArray, survey: SurveyInput
) -> tuple[FloatArray, FloatArray]:
    """Return pixels of image coordinates in mm from each nadir, y up."""
    pixels = []
    for key, photo, xy in (("image1", pair.image1, xy1), ("image2", pair.image2, xy2)):
        c = photo.extra.get("principal_distance")
        if not c:
            raise InputError(
                f"{_where(survey)}: coordinates in mm need the principal distance of each photo; "
                f'add "principal_distance" [mm] to {key} in the pair file, or give pixels '
                "(col1 row1 col2 row2)."
            )
        refuse_pixels(xy, float(c), _where(survey))
        pixels.append(photo.pixels_from_plane(photo.nadir + xy * photo.distance / float(c)))
    return pixels[0], pixels[1]


def _sigma_from_misfits(pair: Pair, points: PointObservations, remarks: list[str]) -> float | None:
    """Return the picks' precision from their misfits across the radius, robustly; None if few."""
    rows = points.use & ~np.isnan(np.hstack([points.pixels1, points.pixels2])).any(axis=1)
    if rows.sum() < MINIMUM_FOR_SIGMA:
        return None
    found = pair.intersect(points.pixels1[rows], points.pixels2[rows], sigma_px=1.0)
    # 1.4826 x median of |N(0, s)| is s: half of the points may be blunders.
    spread = 1.4826 * float(np.nanmedian(np.abs(found.standardised)))
    sigma = max(spread, BEST_SIGMA_PX)
    remarks.append(
        f"sigma_px = {sigma:.3g} px, found from the misfits of {int(rows.sum())} points across the "
        "radius; --sigma-px sets it."
    )
    return sigma


def _solve_ideal(
    points: PointObservations,
    survey: SurveyInput,
    values: SetupValues,
    options: SolveOptions,
    remarks: list[str],
) -> _Solved:
    """Solve image coordinates or radial distances with the ideal pair of `Setup`."""
    if points.has_pixels.any() and not points.is_cartesian.any():
        if values.pitch is None:
            raise InputError(
                f"{_where(survey)}: raw pixels (col1 row1 col2 row2) need a pair file: --pair "
                "PAIR.pair.json."
            )
        points = replace(points, xy1=points.pixels1, xy2=points.pixels2)
        values = replace(values, unit="px")
    chosen = str(options.setup.get("unit") or "")
    unit = chosen or survey.unit or values.unit or "mm"
    setup = values.ideal(unit)
    try:
        remark = setup.check_scales(options.scale_tolerance)
    except GeometryError as error:
        raise GeometryError(f"{values.where}: {error}") from None
    if remark:
        remarks.append(remark)
    refuse_wrong_unit(setup, points, _where(survey), said=survey.unit)
    exchanged = setup.is_exchanged
    if exchanged:
        remarks.append(exchanged_remark(setup))
        setup, points = setup.exchanged(), points.exchanged()
    setup, points, check = _check_ideal(
        setup, points, adjust=options.adjust_setup, remarks=remarks, where=_where(survey)
    )
    if setup.c1 is None:
        remarks.append("c_1 and c_2 are not given: relief is solved, X and Y are not.")
    return _Solved(
        points=points,
        table=solve_ideal(setup, points),
        setup=setup,
        check=check,
        adjusted=options.adjust_setup,
        exchanged=exchanged,
    )


def _check_ideal(
    setup: SurveySetup, points: PointObservations, *, adjust: bool, remarks: list[str], where: str
) -> tuple[SurveySetup, PointObservations, SetupCheck | None]:
    """Report what points of the plane tell; when asked, bring image 2 onto image 1 by it."""
    rows = points.on_plane
    if rows.sum() < 2:
        if adjust:
            raise InputError(_TOO_FEW_PLANE_POINTS.format(where=where))
        return setup, points, None
    xy1, xy2 = _image_mm(setup, points)
    scale = (setup.scale_number or 1000.0) / 1000.0
    # A pair whose pixels are millimetres: one check serves both kinds of survey.
    photos = [
        Photo(plane_from_pixel=np.diag([factor, factor, 1.0]), nadir=np.zeros(2), distance=d)
        for factor, d in ((scale, setup.d1), (scale * setup.scale_ratio, setup.d2))
    ]
    check = check_setup(
        Pair(image1=photos[0], image2=photos[1]),
        xy1[rows],
        xy2[rows],
        names=[name for name, on in zip(points.ids, rows, strict=True) if on],
        sigma_px=setup.precision,
    )
    remarks += [f"Set-up: {line}" for line in check.sentences()]
    if not adjust:
        return setup, points, check
    on_wall = xy2 * scale * setup.scale_ratio
    moved = apply_homography(check.matrix, on_wall) / scale
    c2 = None if setup.c1 is None else setup.c1 * setup.d2 / setup.d1
    remarks.append(
        "Set-up: image 2 was corrected by the points of the reference plane; its coordinates are "
        "now in mm at the scale of image 1."
    )
    nothing = np.full_like(points.polar, np.nan)
    nothing[:, 2] = points.polar[:, 2]
    return (
        replace(setup, unit="mm", c2=c2),
        replace(points, xy1=xy1, xy2=moved, polar=nothing),
        check,
    )


def _image_mm(setup: SurveySetup, points: PointObservations) -> tuple[FloatArray, FloatArray]:
    """Return image coordinates in mm of all points, radial distances turned into x and y."""
    angle = np.radians(points.polar[:, 2:])
    direction = np.concatenate([np.sin(angle), np.cos(angle)], axis=1)
    cartesian = points.is_cartesian[:, None]
    first = np.where(cartesian, setup.image_mm(points.xy1, 1), points.polar[:, :1] * direction)
    second = np.where(cartesian, setup.image_mm(points.xy2, 2), points.polar[:, 1:2] * direction)
    return first, second
