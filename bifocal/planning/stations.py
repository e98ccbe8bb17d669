"""Where to stand: stations, scale and expected precision for every pair of lenses at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import ceil, hypot, sqrt

import numpy as np

from bifocal.model import Pair, PairMedia
from bifocal.planning.camera_plan import CameraSensor, Plan, Station, planned_pair, sigma_at
from bifocal.precision import base_factor, uncertainty_radius
from bifocal.remarks import remark
from photocore.arrays import positive
from photocore.errors import GeometryError, InputError

#: Share of the photo that neighbouring photos of a large façade have in common.
OVERLAP = 0.2
#: Closer than this share of the far distance the two stations hardly differ.
LEAST_RATIO = 1.05
#: More lenses than anyone carries.
MOST_LENSES = 40
#: Nobody photographs a wall from closer than this. [m]
NEAREST = 0.2


def plan_stations(
    focal_lengths: Sequence[float],
    sensor: CameraSensor,
    *,
    object_size: tuple[float, float] | None = None,
    scale_number: float | None = None,
    gsd: float | None = None,
    sigma_r: float | None = None,
    sigma_px: float = 0.5,
    sigma_r_max: float | None = None,
    free_space: float | None = None,
    media: PairMedia | None = None,
) -> Plan:
    """Return stations, scale and precision for every pair of the given lenses.

    Parameters
    ----------
    focal_lengths : sequence of float
        Two or more different principal distances. [mm]
    sensor : CameraSensor
    object_size : tuple of float, optional
        Width and height of the wall. Alone it sets the scale so that one photo covers it. [m]
    scale_number : float, optional
        Wanted photo scale 1 : scale_number.
    gsd : float, optional
        Wanted pixel on the wall. [m]
    sigma_r : float, optional
        Wanted sigma of the relief at the RMS radius of the frame. [m]
    sigma_px : float
        Picking precision per coordinate. [px]
    sigma_r_max : float, optional
        Bound of the area of uncertainty; default three times the sigma at the RMS radius of the
        best pair. [m]
    free_space : float, optional
        Room in front of the wall. [m]
    media : PairMedia, optional
        What both photos look through; scales are then those near the axis.

    Returns
    -------
    Plan

    Raises
    ------
    InputError
        If fewer than two different lenses, no wish or more than one wish for the scale is given.
    GeometryError
        If no pair of lenses fits into the free space; the message says what each would reach.

    Notes
    -----
    Same scale: d = m c / 1000 for both lenses, so B = m / (1000 (1/c2 - 1/c1)): at equal scale
    the difference of the reciprocals of the focal lengths decides.
    sigma_r = sqrt(2) sigma_px GSD B / s'.

    Examples
    --------
    The paper's camera at 1:500: 17.5 m and 9.5 m for 35 and 19 mm.

    >>> canon = CameraSensor(width=22.7, height=15.1, columns=3072, rows=2048)
    >>> best = plan_stations([35, 28, 19], canon, scale_number=500, sigma_px=1.0).best
    >>> best.c1, best.c2, round(best.d1, 2), round(best.d2, 2), round(best.sigma_r_rms * 1000, 1)
    (35.0, 19.0, 17.5, 9.5, 27.6)
    """
    if len(focal_lengths) > MOST_LENSES:
        raise InputError(
            f"focal lengths: {len(focal_lengths)} lenses make too many pairs to compare; give at "
            f"most {MOST_LENSES} of them."
        )
    lenses = sorted({positive(c, "focal length", unit="mm") for c in focal_lengths}, reverse=True)
    if len(lenses) < 2:
        raise InputError("give at least two different focal lengths, e.g. --focal 35 --focal 19.")
    sigma_px = positive(sigma_px, "sigma_px", unit="px")
    wishes = {"scale": scale_number, "gsd": gsd, "sigma_r": sigma_r}
    stated = [name for name, value in wishes.items() if value is not None]
    if len(stated) > 1:
        raise InputError(f"give only one of {' and '.join(stated)}: each of them sets the scale.")
    if not stated and object_size is None:
        raise InputError("give the size of the wall, a photo scale, a GSD or a wanted sigma of r.")
    media = media or PairMedia.none()
    if media and sigma_r is not None:
        raise InputError("through media give a scale, a GSD or the size of the wall, not a sigma.")
    for name, value in (*wishes.items(), ("free_space", free_space)):
        if value is not None:
            positive(value, name)

    def scale_of(c1: float, c2: float) -> float:
        """Return the photo scale number that the wish asks of one pair of lenses."""
        if scale_number is not None:
            return scale_number
        if gsd is not None:
            return gsd * 1000 / sensor.pitch
        if sigma_r is not None:
            # sigma_r = sqrt(2) sigma_px B / (RMS radius in px), B proportional to the scale number
            radius_px = hypot(sensor.columns, sensor.rows) / sqrt(12)
            return sigma_r * 1000 * (c1 - c2) / (c1 * c2) * radius_px / (sqrt(2) * sigma_px)
        assert object_size is not None
        width, height = (positive(v, "object size", unit="m") for v in object_size)
        return 1000 * max(width / sensor.width, height / sensor.height)

    pairs = [(c1, c2) for c1, c2 in combinations(lenses, 2) if c1 / c2 >= LEAST_RATIO]
    if not pairs:
        raise InputError("the focal lengths differ by less than 5 %: too little to see relief.")
    drafts = [
        _station(c1, c2, scale_of(c1, c2), sensor, object_size, sigma_px, free_space, media)
        for c1, c2 in pairs
    ]
    nearest = min(station.d2 for station in drafts)
    if nearest < NEAREST:
        raise InputError(remark("plan.too_near", away=nearest * 100))
    if not any(station.feasible for station in drafts):
        notes = "; ".join(f"{s.c1:g}/{s.c2:g} mm {s.note}" for s in drafts)
        raise GeometryError(f"no pair of lenses fits into the free space: {notes}.")
    # A wanted sigma makes all alike in it, but for rounding: the larger photo is then the better.
    drafts.sort(key=lambda s: (not s.feasible, float(f"{s.sigma_r_rms:.9g}"), -s.gsd, s.d1))
    limit = sigma_r_max or 3 * drafts[0].sigma_r_rms
    stations = tuple(_with_uncertainty(s, sigma_px, limit) for s in drafts)
    return Plan(
        sensor=sensor, stations=stations, sigma_px=sigma_px, sigma_r_max=limit, media=media,
        object_size=object_size, free_space=free_space,
    )  # fmt: skip


def _station(
    c1: float, c2: float, scale_number: float, sensor: CameraSensor,
    object_size: tuple[float, float] | None, sigma_px: float, free_space: float | None,
    media: PairMedia,
) -> Station:  # fmt: skip
    """Return the stations of one pair of lenses, the uncertainty still open."""
    d1, d2 = straight = (scale_number * c1 / 1000, scale_number * c2 / 1000)
    gsd = sensor.pitch * scale_number / 1000
    footprint = (sensor.columns * gsd, sensor.rows * gsd)
    if media:
        d1, d2 = (_placed(media, k, d, c) for k, d, c in ((0, d1, c1), (1, d2, c2)))
    pair = planned_pair(media, (d1, d2), (c1, c2), pitch=sensor.pitch, sigma_px=sigma_px)
    if media:
        straight = pair.straight_distances
        footprint = _seen_by_both(pair, sensor, (c1, c2))
    half_diagonal = hypot(*footprint) / 2
    # Mean square radius of a rectangle about its centre is diagonal² / 12.
    rms = hypot(*footprint) / sqrt(12)
    base = base_factor(d1=straight[0], d2=straight[1])
    sigma_rms, sigma_corner = sigma_at(pair, np.array([rms, half_diagonal])).tolist()
    feasible = free_space is None or d1 <= free_space
    note = ""
    if not feasible:
        assert free_space is not None
        reach = 1000 * free_space / c1
        wide = sensor.columns * sensor.pitch * reach / 1000
        note = remark("plan.no_room", need=d1, free=free_space, scale=reach, wide=wide)
    return Station(
        c1=c1, c2=c2, d1=d1, d2=d2, delta_d=d1 - d2, scale_number=scale_number, gsd=gsd,
        footprint=footprint, photos=_photos(object_size, footprint),
        sigma_r_rms=sigma_rms, sigma_r_corner=sigma_corner,
        # e1 = s1 r / d1, Eq. (1)
        sigma_ortho=sqrt(2) * sigma_px * gsd * base / straight[0],
        uncertain_radius=0.0, uncertain_share=0.0, feasible=feasible, note=note,
        z0_1=pair.image1.z0, z0_2=pair.image2.z0, straight=straight,
    )  # fmt: skip


def _placed(media: PairMedia, number: int, apparent: float, c: float) -> float:
    """Return the distance of camera 0 or 1 that shows the wall's middle from afar.

    Parameters
    ----------
    apparent : float
        Distance from which a camera without media shows the middle at the wanted scale. [m]
    c : float
        Principal distance, for the message. [mm]

    Raises
    ------
    GeometryError
        If the media leave no room at that scale.

    Notes
    -----
    Near the axis a layer of thickness h and index n seems ``h n1 / n`` thick, so the scale is
    ``c / (z0 + sum(t n1 / n) + H n1 / nm)``: that sum, not d, is proportional to c.
    """
    first, *inner, last = media.layers.indices
    glass = zip(media.layers.thicknesses, inner, strict=True)
    rest = apparent - sum(t * first / n for t, n in glass)
    if media.port is not None:
        z0 = media.port[number]
        behind = (rest - z0) * last / first
    else:
        assert media.depth is not None
        z0, behind = rest - media.depth * first / last, media.depth
    if z0 < 0 or behind <= 0:
        raise GeometryError(remark("plan.inside_media", c=c, apparent=apparent))
    return z0 + media.layers.thickness + behind


def _seen_by_both(pair: Pair, sensor: CameraSensor, c: tuple[float, float]) -> tuple[float, float]:
    """Return width and height of the wall in the middle of both photos through media. [m]

    Raises
    ------
    GeometryError
        If the rays at a photo's edge are totally reflected; the lens is named.
    """
    rim = np.array([[sensor.columns / 2, 0.0], [0.0, sensor.rows / 2]])
    reach = [np.abs(photo.plane_from_pixels(rim)) for photo in (pair.image1, pair.image2)]
    for length, places in zip(c, reach, strict=True):
        if not np.isfinite(places).all():
            raise GeometryError(remark("plan.total_reflection", length=length))
    width, height = np.minimum(*reach)[[0, 1], [0, 1]]
    return 2 * float(width), 2 * float(height)


def _photos(
    object_size: tuple[float, float] | None, footprint: tuple[float, float]
) -> tuple[int, int]:
    """Return how many photos cover the wall across and up."""
    if object_size is None:
        return (1, 1)
    counts = []
    for size, covered in zip(object_size, footprint, strict=True):
        step = covered * (1 - OVERLAP)
        # A wall that fits to the millimetre fits: the 1e-9 absorbs rounding of the scale.
        counts.append(1 + max(0, ceil((size - covered) / step - 1e-9)))
    return (counts[0], counts[1])


def _with_uncertainty(station: Station, sigma_px: float, limit: float) -> Station:
    """Return the station with the area of uncertainty for the given sigma of r."""
    radius = float(
        uncertainty_radius(
            limit,
            d1=station.straight[0],
            d2=station.straight[1],
            sigma_m=sqrt(2) * sigma_px * station.gsd,
        )
    )
    half_diagonal = hypot(*station.footprint) / 2
    return replace(station, uncertain_radius=radius, uncertain_share=radius / half_diagonal)
