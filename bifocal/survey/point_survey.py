"""Measured points to relief, coordinates, precision and flags: exactly the workbook's formulas."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bifocal.equations import plane_coordinates, relief, relief_displacement
from bifocal.model import (
    DOUBTFUL_SHARE,
    FlagLimits,
    Pair,
    Photo,
    PlanePicks,
    intersect,
    point_flags,
)
from bifocal.precision import point_covariance, sigma_relief
from bifocal.rays import in_line, meeting_of, object_rays, zoom_centre
from bifocal.survey.observations import PointObservations
from bifocal.survey.radii import Radii
from bifocal.survey.refracted_radii import (
    length,
    met_rays,
    refracted_radii,
    scale_ratio,
    slope_gains,
)
from bifocal.survey.relief_table import ReliefTable, entries
from photocore.arrays import FloatArray


def solve_points(
    pair: Pair,
    points: PointObservations,
    *,
    sigma_px: float | None = None,
    limits: FlagLimits | None = None,
    as_given: bool = False,
) -> ReliefTable:
    """Solve points measured on both photos of a pair.

    Parameters
    ----------
    pair : Pair
        Any pair for raw pixels; for image coordinates and radial distances an ideal one, whose
        image coordinates are millimetres (`bifocal.Pair.ideal` without ``pixel_size``).
    points : PointObservations
        With ``pixels1, pixels2``, or else with ``xy1, xy2`` or ``polar`` in millimetres.
    sigma_px : float, optional
        Measuring precision; default the pair's own, else 0.5. [px, or mm for an ideal pair]
    limits : FlagLimits, optional
        Where the flags begin.
    as_given : bool
        Count from the photos in the order in which an exchanged ideal pair was given, as the
        formulas of the user's workbook do.

    Returns
    -------
    ReliefTable
        NaN where undefined: relief at the nadir and where the rays do not meet before the near
        camera; X, Y where no direction, or for image coordinates no principal distance, is known.

    Notes
    -----
    Midulla's Eqs. (1) to (7) on radial distances at the scale of image 1, one workbook column
    after the other. Radial distances of an ideal pair are taken as measured, the misfit across the
    radius stays in ``q``. For any pair ``q2 - e = k(r) (q1 - e)`` about the zoom centre e, so
    Eq. (6) gives r exactly from radii about e; pixels are first moved onto one radial line by
    least squares, so that the result equals `Pair.intersect`; ``e1``, ``e2`` and ``s_c`` count
    from each camera's own nadir.

    Through media the columns hold what refraction leaves: ``s1_used`` and
    ``s2_used`` are radii of where the bent rays meet the reference plane, ``den`` is how much their
    slopes differ, ``ds`` their distance along that difference, and ``r = ds / den`` is as closed as
    Eq. (6) (`bifocal.media`).

    Examples
    --------
    A point 1 m before the wall and 2 m right of the nadir, 35 mm / 17.5 m and 19 mm / 9.5 m:

    >>> points = PointObservations(ids=("P1",), xy1=[[35 * 2 / 16.5, 0]], xy2=[[19 * 2 / 8.5, 0]])
    >>> pair = Pair.ideal(d1=17.5, d2=9.5, c1=35, c2=19, sigma=0.004)
    >>> table = solve_points(pair, points)
    >>> table.xyz.round(9).tolist(), table.flags
    ([[2.0, 0.0, 1.0]], ('OK',))
    """
    first, second = pair.as_given if as_given else (pair.image1, pair.image2)
    limits = limits or FlagLimits()
    if points.has_pixels.any():
        radii = _adjusted_radii(first, second, points, sigma_px, limits, pair)
    else:
        radii = _measured_radii(first, second, points, sigma_px)
    if points.in_doubt.any():
        radii = _doubted(radii, points, first.distance, DOUBTFUL_SHARE * pair.d2)
    s1, s2, d1, d2 = radii.s1, radii.s2, first.distance, second.distance
    if radii.bent is not None:
        ds, den, r, e1, e2, *_ = radii.bent
    else:
        ds, den = s2 - s1, s2 / d2 - s1 / d1
        (d_far, far), (d_near, near) = _far_first((d1, s1), (d2, s2))
        r = relief(far, near, d1=d_far, d2=d_near)  # Eq. (6)
        e1, e2 = (  # Eqs. (1) and (3)
            relief_displacement(radius, r, d=d)
            for radius, d in ((radii.own1, d1), (radii.own2, d2))
        )
    x, y = plane_coordinates(radii.own1, e1, np.radians(radii.own_theta))  # Eq. (7)
    if radii.bent is not None:
        x, y = radii.bent.place.T  # a port that leans bends rays also across the radius
    sigma_r = np.where(np.isnan(r), np.nan, radii.sigma_r)
    return ReliefTable(
        ids=points.ids,
        columns={
            "s1_used": s1,
            "s2_used": s2,
            "theta_used": radii.theta,
            "ds": ds,
            "den": den,
            "r": r,
            "e1": e1,
            "e2": e2,
            "s_c": radii.own1 - e1,
            "X": first.nadir[0] + x * radii.scale_number / 1000,
            "Y": first.nadir[1] + y * radii.scale_number / 1000,
            "Z": r,
            "q": radii.q,
            "sigma_X": np.sqrt(radii.covariance[:, 0, 0]),
            "sigma_Y": np.sqrt(radii.covariance[:, 1, 1]),
            "sigma_r": sigma_r,
            **entries(radii.covariance),
        },
        flags=point_flags(
            at_nadir=radii.at_nadir,
            standardised=radii.standardised,
            incomplete=np.isnan(s1),
            relief=r,
            sigma_r=sigma_r,
            near_distance=pair.d2,
            limits=limits,
        ),
        standardised=radii.standardised,
        of_pixels=radii.of_pixels,
        image_scale=first.scale_number,
        sigma_px=radii.sigma_px,
        pair=None if pair.whole_orientation is None else pair,
    )


def _doubted(radii: Radii, points: PointObservations, d1: float, sigma: float) -> Radii:
    """Return radii whose doubtful points may lie anywhere on the ray of the far photo. [m]"""
    spread = np.where(points.in_doubt, sigma, 0.0)
    angle = np.radians(radii.own_theta)
    outwards = (radii.own1 / d1)[:, None] * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    if radii.bent is not None:
        outwards = radii.bent.outwards
    rate = -outwards * radii.scale_number / 1000
    along = np.column_stack([rate, np.ones(len(angle))]) * spread[:, None]
    covariance = along[:, :, None] * along[:, None, :]
    of_pixels = dict(radii.of_pixels)
    if radii.sigma_px is not None:
        of_pixels["k_r"] = np.hypot(of_pixels["k_r"], spread / radii.sigma_px)
        for key, value in entries(covariance / radii.sigma_px**2, "k_").items():
            of_pixels[key] = of_pixels[key] + value
    return replace(
        radii,
        sigma_r=np.hypot(radii.sigma_r, spread),
        covariance=radii.covariance + covariance,
        of_pixels=of_pixels,
    )


def _measured_radii(
    first: Photo, second: Photo, points: PointObservations, sigma: float | None
) -> Radii:
    """Return radial distances as measured on the photos of an ideal pair."""
    scale_number = first.scale_number
    k12 = 1.0
    if scale_number is not None and second.scale_number is not None:
        k12 = second.scale_number / scale_number  # brings image 2 to the scale of image 1
        if first.refracted:
            k12 = scale_ratio(first, second)
    (x1, y1), (x2, y2) = points.xy1.T, points.xy2.T
    cartesian = points.is_cartesian
    s1 = np.where(cartesian, np.sqrt(x1**2 + y1**2), points.polar[:, 0])
    s2 = np.where(cartesian, np.sqrt(x2**2 + y2**2), points.polar[:, 1]) * k12
    incomplete = np.isnan(s1) | np.isnan(s2)
    s1, s2 = np.where(incomplete, np.nan, s1), np.where(incomplete, np.nan, s2)
    bearing = np.where(s1 == 0, 0.0, np.degrees(np.arctan2(x1, y1)))
    theta = np.where(incomplete, np.nan, np.where(cartesian, bearing, points.polar[:, 2]))
    sigma = first.precision(sigma)
    (d_far, far, sigma_far), (d_near, near, sigma_near) = _far_first(
        (first.distance, s1, sigma), (second.distance, s2, k12 * sigma)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        across = (x1 * y2 - y1 * x2) * k12 / s1
        q = np.where(s1 > 0, across, np.where(cartesian & ~incomplete, 0.0, np.nan))
        spread = sigma * np.sqrt(1.0 + (s2 / s1) ** 2)
        standardised = q / np.where(s1 > 0, spread, np.nan)
    measured = Radii(
        scale_number=np.nan if scale_number is None else scale_number,
        s1=s1,
        s2=s2,
        theta=theta,
        own1=s1,
        own2=s2,
        own_theta=theta,
        q=q,
        standardised=standardised,
        at_nadir=s1 == 0,
        sigma_r=sigma_relief(far, near, d1=d_far, d2=d_near, sigma_1=sigma_far, sigma_2=sigma_near),
        covariance=point_covariance(
            s1, s2, np.radians(theta), d1=first.distance, d2=second.distance, sigma_1=sigma,
            sigma_2=k12 * sigma, metres=np.nan if scale_number is None else scale_number / 1000,
        ),
    )  # fmt: skip
    if not first.refracted:
        return measured
    return refracted_radii(measured, (first, second), (s1, s2 / k12), sigma)


def _adjusted_radii(
    first: Photo,
    second: Photo,
    points: PointObservations,
    sigma_px: float | None,
    limits: FlagLimits,
    pair: Pair,
) -> Radii:
    """Return radial distances of raw pixels after least squares moved them onto one line.

    The movement is kept as gains (movement per millimetre of misfit q), which lets the workbook's
    formulas follow a changed pick.
    """
    picks = first.picks(points.pixels1, sigma_px), second.picks(points.pixels2, sigma_px)
    solved = intersect(*picks, limits=limits)
    centre = zoom_centre(first.foot, second.foot)
    scale_number = first.scale_number or 1000.0
    to_mm = 1000.0 / scale_number
    feet = [pick.foot for pick in picks]
    places = [object_rays(pick.positions, pick.foot) for pick in picks]
    fitted = [object_rays(solved.adjusted1, feet[0]), object_rays(solved.adjusted2, feet[1])]
    x1, x2 = ((ray.position - centre) * to_mm for ray in places)
    radius = np.hypot(x1[:, 0], x1[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        q, spread = _miss(x1, x2, picks, centre, to_mm)
        q = np.where(np.isnan(x1[:, 0]) | np.isnan(x2[:, 0]), np.nan, q)
        gain1, gain2 = (
            np.where((q != 0)[:, None], (x - (ray.position - centre) * to_mm) / q[:, None], 0.0)
            for x, ray in zip((x1, x2), fitted, strict=True)
        )
        k_q = spread / solved.sigma_px
        k_r = solved.sigma[:, 2] / solved.sigma_px
        common = pair.covariance_of_orientation(np.array(solved.xyz))
        o_r = np.sqrt(common[:, 2, 2])
        standardised = q / (solved.sigma_px * k_q)
    moved1, moved2 = x1 - q[:, None] * gain1, x2 - q[:, None] * gain2
    own1, own2 = (
        moved - (photo.nadir - centre) * to_mm
        for moved, photo in ((moved1, first), (moved2, second))
    )
    gains, bent = dict(zip(("g1x", "g1y"), gain1.T, strict=True)), None
    gains |= dict(zip(("g2x", "g2y"), gain2.T, strict=True))
    if pair.refracted:
        bent = met_rays(
            fitted, (moved1, moved2), (own1, own2), to_mm, solved.xyz[:, 2],
            outwards=-places[0].slope * to_mm,
        )  # fmt: skip
        gains |= slope_gains(places, fitted, q, to_mm)
    s1 = length(moved1)
    return Radii(
        scale_number=scale_number,
        s1=s1,
        s2=length(moved2),
        theta=np.where(s1 == 0, 0.0, np.degrees(np.arctan2(moved1[:, 0], moved1[:, 1]))),
        own1=length(own1),
        own2=length(own2),
        own_theta=np.degrees(np.arctan2(own1[:, 0], own1[:, 1])),
        q=q,
        standardised=standardised,
        at_nadir=radius == 0,
        sigma_r=np.hypot(solved.sigma_px * k_r, o_r),
        covariance=solved.covariance + common,
        sigma_px=float(solved.sigma_px),
        of_pixels=gains
        | {
            "k_q": k_q,
            "k_w": k_q * scale_number / 1000,
            "k_r": k_r,
            "o_r": o_r,
            "misfit_px": solved.misfit,
        }
        | entries(solved.covariance / solved.sigma_px**2, "k_")
        | entries(common, "o_"),
        bent=bent,
    )


def _far_first(*photos: tuple[Any, ...]) -> list[tuple[Any, ...]]:
    """Return what is known of both photos, each with its distance first, the far one's first."""
    return sorted(photos, key=lambda photo: -photo[0])


def _miss(
    x1: FloatArray,
    x2: FloatArray,
    picks: tuple[PlanePicks, PlanePicks],
    centre: FloatArray,
    to_mm: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the misfit q across the radius and its standard deviation. [mm]

    Through media it is the distance at which both rays pass each other, seen along relief.
    """
    if picks[0].foot.media is None:
        value, g1, g2 = in_line(x1, x2)
        radius = np.hypot(x1[:, 0], x1[:, 1])
        q, unit = np.where(radius > 0, value / radius, 0.0), to_mm / length(x1)
    else:
        feet = [pick.foot for pick in picks]
        value, g1, g2 = meeting_of(feet[0], feet[1], centre)(
            *(pick.positions - centre for pick in picks)
        )
        rays = [object_rays(pick.positions, pick.foot) for pick in picks]
        rate = length(rays[0].slope - rays[1].slope)
        unit = to_mm / rate
        q = np.where(rate > 0, value * unit, 0.0)
    variance = sum(
        np.einsum("ni,nij,nj->n", g, pick.covariance, g)
        for g, pick in zip((g1, g2), picks, strict=True)
    )
    return q, np.asarray(np.sqrt(variance) * unit)
