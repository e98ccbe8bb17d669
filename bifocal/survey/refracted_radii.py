"""Measured points seen through media: the columns that refraction adds to Eqs. (1) to (7)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal.media import MediaPath, ObjectRays
from bifocal.model import Photo
from bifocal.rays import seen_distance
from bifocal.survey.radii import Radii, RefractedRays
from photocore.arrays import FloatArray


def scale_ratio(first: Photo, second: Photo) -> float:
    """Return what brings image 2 to the scale of image 1 near the axis, through media.

    The wall seems to lie at ``z0 + sum t n1/n + H n1/nm``, which takes the place of d in d / c.
    """
    of_second = seen_distance(second.foot) / (second.principal_distance or second.distance)
    return of_second / (seen_distance(first.foot) / (first.principal_distance or first.distance))


def refracted_radii(
    radii: Radii, photos: tuple[Photo, Photo], measured: tuple[FloatArray, FloatArray], sigma: float
) -> Radii:
    """Return radial distances on the photos of an ideal pair as media bend their rays.

    Parameters
    ----------
    radii : Radii
        As they are in air.
    photos : tuple of Photo
        In the order of the workbook.
    measured : tuple of ndarray, shape (n,)
        Radial distances in both images. [mm]
    sigma : float
        Precision of an image coordinate. [mm]

    Returns
    -------
    Radii
        Whose ``s1, s2`` are where the bent rays meet the plane.

    Notes
    -----
    With ``tan = s / c`` of the known ray ``a = tan arm``, ``T = tan bend`` and r = (a2 - a1) /
    (T2 - T1), R = a1 - r T1. By each s moves r by ``g = (da/ds - r dT/ds) / (T2 - T1)``, and R by
    T of the other ray times as much.
    """
    scale = radii.scale_number
    to_mm = 1.0 if np.isnan(scale) else 1000.0 / scale
    s, t, ways = [], [], []
    for photo, radius in zip(photos, measured, strict=True):
        per_mm = float(photo.plane_from_pixel[0, 0]) / photo.distance
        tangent = radius * per_mm
        path = photo.media
        assert isinstance(path, MediaPath)
        way = path.radial_rays(tangent)
        s.append(tangent * way.arm * to_mm)
        t.append(tangent * way.bend * to_mm)
        ways.append((way.pace * per_mm * to_mm, way.turn * per_mm * to_mm))
    lost = np.isnan(s[0]) | np.isnan(s[1])
    s1, s2, t1, t2 = (np.where(lost, np.nan, values) for values in (*s, *t))
    ds, den = s2 - s1, t2 - t1
    highest = min(p.distance - p.media.last_interface for p in photos if p.media is not None)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where((s1 > 0) & (den != 0), ds / den, np.nan)
        r = np.where(ratio <= highest, ratio, np.nan)
        g1, g2 = (pace - r * turn for pace, turn in ways)
        v1, v2 = (g1 * sigma / den) ** 2, (g2 * sigma / den) ** 2
        aside = ((s1 - t1 * r) / measured[0] * sigma) ** 2
    metres = np.nan if np.isnan(scale) else scale / 1000
    angle = np.radians(radii.theta)
    sine, cosine = np.sin(angle), np.cos(angle)
    place = (s1 - t1 * r)[:, None] * np.stack([sine, cosine], axis=-1)
    along = (v1 * t2**2 + v2 * t1**2) * metres**2
    with_r = -(v1 * t2 + v2 * t1) * metres
    across = aside * metres**2
    rows = [
        [along * sine**2 + across * cosine**2, (along - across) * sine * cosine, with_r * sine],
        [(along - across) * sine * cosine, along * cosine**2 + across * sine**2, with_r * cosine],
        [with_r * sine, with_r * cosine, v1 + v2],
    ]
    outwards = t1[:, None] * np.stack([sine, cosine], axis=-1)
    return replace(
        radii,
        s1=s1,
        s2=s2,
        own1=s1,
        own2=s2,
        sigma_r=np.sqrt(v1 + v2),
        covariance=np.moveaxis(np.array(rows), 2, 0),
        bent=RefractedRays(ds, den, r, t1 * r, t2 * r, place, outwards),
    )


def length(vectors: FloatArray) -> FloatArray:
    """Return the lengths of vectors, shape (n, k) to (n,)."""
    return np.asarray(np.sqrt((vectors**2).sum(axis=1)))


def met_rays(
    rays: list[ObjectRays],
    feet: tuple[FloatArray, FloatArray],
    own: tuple[FloatArray, FloatArray],
    to_mm: float,
    solved: FloatArray,
    *,
    outwards: FloatArray,
) -> RefractedRays:
    """Return what Eq. (6) becomes for rays through media; NaN where the relief solved is.

    ``feet`` and ``own`` are where they meet the plane, from one point and from each nadir. [mm]
    """
    gap = feet[1] - feet[0]
    rate = (rays[0].slope - rays[1].slope) * to_mm
    den = length(rate)
    with np.errstate(divide="ignore", invalid="ignore"):
        ds = np.where(den > 0, (gap * rate).sum(axis=1) / den, 0.0)
        relief = np.where(~np.isnan(solved) & (den > 0), ds / den, np.nan)
    places = [
        foot + ray.slope * (to_mm * relief)[:, None] for foot, ray in zip(own, rays, strict=True)
    ]
    e1, e2 = (length(foot) - length(place) for foot, place in zip(own, places, strict=True))
    return RefractedRays(ds, den, relief, np.asarray(e1), np.asarray(e2), places[0], outwards)


def slope_gains(
    places: list[ObjectRays], fitted: list[ObjectRays], q: FloatArray, to_mm: float
) -> dict[str, FloatArray]:
    """Return how the slopes of both rays move with the misfit. [mm/m per mm of q]

    Parameters
    ----------
    places, fitted : list of ObjectRays
        The rays in the object's medium, as measured and adjusted.
    q : ndarray, shape (n,)
        Misfits. [mm]
    to_mm : float
        What brings metres on the plane to the scale of image 1. [mm/m]
    """
    columns: dict[str, FloatArray] = {}
    for image, (place, moved) in enumerate(zip(places, fitted, strict=True), start=1):
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.where((q != 0)[:, None], (moved.slope - place.slope) / q[:, None], 0.0)
        columns |= {f"u{image}{axis}": gain[:, k] * to_mm for k, axis in enumerate("xy")}
    return columns
