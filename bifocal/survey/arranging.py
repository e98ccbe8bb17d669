"""Points and the geometry to solve them with: of a pair, or the ideal one of a set-up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal.model import FlagLimits, Pair, PhotoSet, apply_homography
from bifocal.remarks import remark
from bifocal.survey.observations import PointObservations
from bifocal.survey.orientation_check import (
    OrientationCheck,
    check_orientation,
    with_zoom_centre,
    zoom_centre_of_points,
)
from bifocal.survey.remarks import (
    angle_remarks,
    exchanged_remark,
    wide_remarks,
)
from bifocal.survey.setup import SurveySetup
from bifocal.survey.solved_survey import Corrections
from bifocal.survey.survey_input import SurveyInput
from bifocal.survey.survey_media import AIR
from bifocal.survey.units import (
    as_pixels,
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Arranged:
    """Points and the geometry to solve them with; ``measured`` in mm where that is ideal."""

    points: PointObservations
    pair: Pair
    measured: PointObservations | None = None
    setup: SurveySetup | None = None
    sigma_px: float | None = None
    check: OrientationCheck | None = None
    corrections: Corrections = (None, None)
    remarks: tuple[str, ...] = ()


def general_arranged(pair: Pair, survey: SurveyInput, *, adjust: bool) -> Arranged:
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
    return Arranged(
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


def sigma_of_set(
    photos: PhotoSet, points: PointObservations, pixels: Sequence[FloatArray]
) -> tuple[float | None, tuple[str, ...]]:
    """Return the picks' precision from the misfits of the pair whose are largest; None if few."""
    estimates, count = [], len(pixels)
    for far, near, *_ in photos.pairs():
        if max(far, near) < count:
            both = replace(points, pixels1=pixels[far], pixels2=pixels[near])
            estimates.append(_sigma_from_misfits(photos.pair(far, near), both))
    return max(estimates, key=lambda each: each[0] or 0.0, default=(None, ()))


def ideal_arranged(survey: SurveyInput, scale_tolerance: float, *, adjust: bool) -> Arranged:
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
    arranged = Arranged(
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
    arranged: Arranged, setup: SurveySetup, measured: PointObservations, check: OrientationCheck
) -> Arranged:
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
