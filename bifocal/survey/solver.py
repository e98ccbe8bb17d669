"""Solve a survey: relief, coordinates, precision, check and world coordinates of its points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal.model import SCALE_TOLERANCE, FlagLimits, Pair, PhotoSet, WorldFrame, apply_homography
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
from bifocal.survey.other_photos import contradictions, of_all_photos
from bifocal.survey.point_survey import solve_points
from bifocal.survey.reference import Georeference, KnownPoints
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.remarks import (
    angle_remarks,
    exchanged_remark,
    georeference_remarks,
    opposite_signs_remark,
    point_remarks,
    refraction_remarks,
    unused_remarks,
    wide_remarks,
)
from bifocal.survey.set_survey import solve_set
from bifocal.survey.setup import SurveySetup
from bifocal.survey.solved_survey import Corrections, SolvedSurvey
from bifocal.survey.survey_input import SurveyInput
from bifocal.survey.survey_media import AIR
from bifocal.survey.tolerances import RULES, ToleranceRule
from bifocal.survey.units import (
    as_pixels,
    refuse_contradiction,
    refuse_corner,
    refuse_millimetres,
    refuse_wrong_unit,
)
from photocore.arrays import FloatArray
from photocore.errors import InputError

#: From this many points on, the picks' precision is taken from their misfits.
MINIMUM_FOR_SIGMA = 20
#: Precision is never taken for better than this. [px]
BEST_SIGMA_PX = 0.02


def solve_survey(
    survey: SurveyInput,
    pair: Pair | None = None,
    *,
    adjust: bool = False,
    scale_tolerance: float = SCALE_TOLERANCE,
    rules: tuple[ToleranceRule, ...] = RULES,
) -> SolvedSurvey:
    """Solve what was measured with a general pair, or with the ideal one of its set-up.

    Parameters
    ----------
    survey : SurveyInput
    pair : Pair, optional
        For raw pixels.
    adjust, scale_tolerance, rules
        As of `bifocal.solve`.

    Raises
    ------
    InputError, GeometryError
        If the set-up or the geometry is at fault.
    """
    if pair is None:
        arranged = _ideal(survey, scale_tolerance, adjust=adjust)
    else:
        arranged = _general(pair, survey, adjust=adjust)
    points, pair, sigma_px = arranged.points, arranged.pair, arranged.sigma_px
    measured = points if arranged.measured is None else arranged.measured
    table = solve_points(pair, measured, sigma_px=sigma_px, limits=survey.setup.measuring.limits)
    refuse_contradiction(points, table, survey.where)
    table, other_remarks = _with_others(survey, table, arranged)
    unused = points.unused
    reference, control = survey.known.without(unused), survey.control.without(unused)
    check = check_points(table, reference, rules)
    world, world_remarks = _placed(control, table, survey.model, pair.extra)
    plane = arranged.check
    remarks = (
        *survey.remarks,
        *arranged.remarks,
        *refraction_remarks(pair, measured),
        *point_remarks(points, table, arranged.setup),
        *other_remarks,
        *check.remarks,
        *unused_remarks(unused, Check=survey.known, Georeference=survey.control),
        *opposite_signs_remark(table, reference),
        *(survey.tape.compared(table).remarks if survey.tape else ()),
        *world_remarks,
    )
    return SolvedSurvey(
        survey=survey, setup=arranged.setup, pair=pair, media=survey.setup.media,
        sigma_px=sigma_px, points=points, table=table, check=check, rules=rules,
        georeference=world, orientation_check=plane, adjusted=adjust,
        corrections=arranged.corrections, remarks=tuple(dict.fromkeys(filter(None, remarks))),
    )  # fmt: skip


def _with_others(
    survey: SurveyInput, table: ReliefTable, arranged: _Arranged
) -> tuple[ReliefTable, list[str]]:
    """Return the table with what other photos beside an ideal pair tell, and remarks on it."""
    setup = survey.setup
    if arranged.setup is None or not setup.others or not survey.points.other_xy.size:
        return table, []
    adjusted = arranged.setup.adjusted
    setup = replace(setup, adjusted=adjusted[::-1] if arranged.pair.exchanged else adjusted)
    columns = of_all_photos(setup, survey.points)
    doubtful = contradictions(table.ids, np.where(survey.points.use, columns["chance"], np.nan))
    remarks: list[str] = []
    if doubtful:
        remarks.append(remark("survey.picks_contradict", names=", ".join(doubtful[:10])))
    return replace(table, columns={**table.columns, **columns}), remarks


def solve_survey_of_set(
    survey: SurveyInput, photos: PhotoSet, *, rules: tuple[ToleranceRule, ...] = RULES
) -> SolvedSurvey:
    """Solve what was measured in three photos and more.

    Raises
    ------
    InputError
        If there are no raw pixels.
    """
    points, measuring = survey.points, survey.setup.measuring
    numbers = photos.picked_in(points.pixels)
    picked = photos.only(numbers) if len(numbers) < len(photos) else photos
    pair = picked.best_pair()
    if not points.has_pixels.any():
        needed = remark("survey.set_pixels", count=len(photos))
        raise InputError(f"{survey.where}: {needed}")
    sigma, said = measuring.sigma_px, tuple[str, ...]()
    if sigma is None and not any(photo.sigma_pixel for photo in photos.photos):
        pixels = [points.pixels[k] for k in numbers if k < len(points.pixels)]
        sigma, said = _sigma_of_set(picked, points, pixels)
    table, notes, off = solve_set(photos, points, sigma_px=sigma, limits=measuring.limits)
    noted = ("; ".join(filter(None, both)) for both in zip(points.note, notes, strict=True))
    unused = points.unused
    reference, control = survey.known.without(unused), survey.control.without(unused)
    check = check_points(table, reference, rules)
    world, world_remarks = _placed(control, table, survey.model, photos.extra)
    remarks = (
        *survey.remarks, *said, *off, *check.remarks,
        *unused_remarks(unused, Check=survey.known, Georeference=survey.control),
        *opposite_signs_remark(table, reference), *world_remarks,
    )  # fmt: skip
    return SolvedSurvey(
        survey=survey, setup=None, pair=pair, photos=photos, sigma_px=sigma,
        points=replace(points, note=tuple(noted)), table=table, check=check, rules=rules,
        georeference=world, remarks=tuple(dict.fromkeys(filter(None, remarks))),
    )  # fmt: skip


def _placed(
    control: KnownPoints, table: ReliefTable, model: str, extra: Mapping[str, object]
) -> tuple[Georeference | None, list[str]]:
    """Return the wall in the world, and remarks on it: by control points, or as the pair's were."""
    if not control.used.any() or np.isnan(control.xyz).all():
        frame = WorldFrame.of(extra)
        return None if frame is None else Georeference.of_frame(frame), []
    world = georeference(table, control, model=model)
    return world, georeference_remarks(world, control, table, is_auto=model == "auto")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Arranged:
    """Points and the geometry to solve them with; ``measured`` in mm where that is ideal."""

    points: PointObservations
    pair: Pair
    measured: PointObservations | None = None
    setup: SurveySetup | None = None
    sigma_px: float | None = None
    check: OrientationCheck | None = None
    corrections: Corrections = (None, None)
    remarks: tuple[str, ...] = ()


def _general(pair: Pair, survey: SurveyInput, *, adjust: bool) -> _Arranged:
    """Arrange raw pixels for a pair; coordinates in millimetres are carried to pixels first."""
    points = survey.points.exchanged() if pair.exchanged else survey.points
    setup = survey.setup
    points = as_pixels(pair, points, survey.where, setup.unit)
    refuse_millimetres(pair, points, survey.where)
    sigma = setup.measuring.sigma_px
    remarks: tuple[str, ...] = ()
    if sigma is None and not any(photo.sigma_pixel for photo in (pair.image1, pair.image2)):
        sigma, remarks = _sigma_from_misfits(pair, points)
    pixels = (points.pixels1, points.pixels2)
    check = _check_plane(pair, points, pixels, sigma, survey, adjust)
    if check is not None and adjust:
        pair, centred = _with_centre(check.corrected, points, pixels, sigma)
        remarks = (*remarks, *centred)
    return _Arranged(
        points=points, pair=pair, sigma_px=sigma, check=check,
        remarks=(*remarks, *(check.remarks if check else ())),
    )  # fmt: skip


def _with_centre(
    pair: Pair,
    points: PointObservations,
    pixels: tuple[FloatArray, FloatArray],
    sigma_px: float | None,
) -> tuple[Pair, tuple[str, ...]]:
    """Return a pair corrected by its plane points with the centre of zoom that the others show.

    Through media relief spreads from no one point: the nadirs stay as stated.
    """
    if pair.layers not in (None, AIR):
        return pair, ()
    rows = points.use & ~points.on_plane
    first, second = (
        photo.picks(picked[rows], sigma_px)
        for photo, picked in zip((pair.image1, pair.image2), pixels, strict=True)
    )
    variance = sum(np.trace(p.covariance, axis1=1, axis2=2) / 4 for p in (first, second))
    centre = zoom_centre_of_points(
        pair, np.array(first.positions), np.array(second.positions), np.sqrt(variance)
    )
    if centre is None:
        return pair, ()
    move = centre[0] - pair.zoom_centre
    spread = float(np.sqrt(np.trace(centre[1]) / 2))
    x, y, sigma = 1000 * np.array([*move, spread])
    return with_zoom_centre(pair, centre[0]), (
        remark("survey.centre_moved", x=x, y=y, sigma=sigma),
    )


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
            raise InputError(remark("survey.no_plane_points", of=survey.where))
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


def _sigma_of_set(
    photos: PhotoSet, points: PointObservations, pixels: Sequence[FloatArray]
) -> tuple[float | None, tuple[str, ...]]:
    """Return the picks' precision from the misfits of the pair whose are largest; None if few."""
    estimates, count = [], len(pixels)
    for far, near, *_ in photos.pairs():
        if max(far, near) < count:
            both = replace(points, pixels1=pixels[far], pixels2=pixels[near])
            estimates.append(_sigma_from_misfits(photos.pair(far, near), both))
    return max(estimates, key=lambda each: each[0] or 0.0, default=(None, ()))


def _ideal(survey: SurveyInput, scale_tolerance: float, *, adjust: bool) -> _Arranged:
    """Arrange image coordinates or radial distances for the ideal pair of the set-up."""
    points, setup = survey.points, survey.setup
    if points.has_pixels.any() and not points.is_cartesian.any():
        if setup.taking.pitch is None:
            raise InputError(remark("survey.pixels_need_pair", of=survey.where))
        points = replace(points, xy1=points.pixels1, xy2=points.pixels2)
        setup = setup.but(unit="px")
    pair = setup.pair()
    if setup.lenses and (setup.lenses[0].distorts or setup.lenses[1].distorts):
        if adjust:
            raise InputError(f"{survey.where}: {remark('setup.lens_adjusted')}")
        if (points.use & points.is_polar & ~points.is_cartesian).any():
            raise InputError(f"{survey.where}: {remark('setup.lens_of_radii')}")
    remarks = [*setup.remarks, setup.check_scales(scale_tolerance)]
    refuse_wrong_unit(setup, points, survey.where, said=survey.unit)
    remarks += wide_remarks(setup, points)
    remarks += angle_remarks(points)
    if pair.exchanged:
        remarks.append(exchanged_remark(setup))
        setup, points = setup.exchanged(), points.exchanged()
    measured = setup.in_millimetres(points)
    if not adjust:  # which finds by itself what is counted from
        typed = points.use & points.is_cartesian
        first, second = measured.all_xy()
        refuse_corner(first[typed], second[typed], survey.where)
    check = _check_plane(pair, points, measured.all_xy(), None, survey, adjust)
    arranged = _Arranged(
        points=points, measured=measured, pair=pair, setup=setup, check=check,
        remarks=(*remarks, *(check.remarks if check else ())),
    )  # fmt: skip
    if check is not None and adjust:
        arranged = _corrected(arranged, setup, measured, check)
    if setup.taking.c1 is None:
        words = remark("survey.no_principal_distances")
        arranged = replace(arranged, remarks=(*arranged.remarks, words))
    return arranged


def _corrected(
    arranged: _Arranged, setup: SurveySetup, measured: PointObservations, check: OrientationCheck
) -> _Arranged:
    """Return points and ideal set-up with image 2 corrected by the points of the plane."""
    pair, points = arranged.pair, arranged.points
    xy1, xy2 = measured.all_xy()
    # Through media image 2 keeps its own scale: what the wall seems is not c / d.
    bent = setup.refracted
    scale = (pair.image2 if bent else pair.image1).plane_from_pixel[0, 0]
    correction = check.matrix @ pair.image2.plane_from_pixel / [[scale], [scale], [1.0]]
    moved, centred = _with_centre(check.corrected, points, (xy1, xy2), None)
    # An ideal pair counts from its nadir; relief spreads from the centre of zoom.
    centre = moved.zoom_centre / scale if centred else np.zeros(2)
    measured = replace(
        measured, xy1=xy1 - centre, xy2=apply_homography(correction, xy2) - centre,
        polar=points.polar * np.array([np.nan, np.nan, 1.0]),
    )  # fmt: skip
    corrections = _with_corrections(setup, correction, centre)
    if not bent:
        c2 = None if setup.taking.c1 is None else setup.taking.c1 * pair.d2 / pair.d1
        setup = setup.but(enlargement2=setup.taking.enlargement1, c2=c2)
    setup = replace(setup.but(unit="mm"), adjusted=(None, None))
    remarks = [*arranged.remarks, *centred]
    if centred:
        remarks.append(remark("survey.centre_found"))
    remarks.append(remark("survey.image2_corrected", image=2 if bent else 1))
    return replace(
        arranged, points=measured, measured=measured, pair=setup.pair(), setup=setup,
        corrections=corrections, remarks=tuple(remarks),
    )  # fmt: skip


def _with_corrections(
    setup: SurveySetup, correction: FloatArray, centre: FloatArray
) -> Corrections:
    """Return what corrects typed coordinates in mm: of image 2, then both counted from a centre."""
    shift = np.array([[1.0, 0.0, -centre[0]], [0.0, 1.0, -centre[1]], [0.0, 0.0, 1.0]])
    first, second = setup.adjusted
    if centre.any():
        first = shift if first is None else shift @ first
    return first, shift @ (correction if second is None else correction @ second)
