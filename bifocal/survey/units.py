"""Pixels of millimetres; millimetres taken for pixels, or pixels for them, told by the numbers."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np

from bifocal.model import FARTHEST_WALL, Pair, Photo
from bifocal.remarks import remark
from bifocal.survey.observations import PointObservations
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import SurveySetup
from photocore.arrays import BoolArray, FloatArray, as_floats
from photocore.errors import GeometryError, InputError

#: Misfits across the radius beyond this many sigma, at most points, are no slips of the hand.
CONTRADICTION = 100.0

#: No lens sees further to the side than this many principal distances (72 degrees off axis).
WIDEST = 3.0
#: Without a principal distance: no sensor or film of a hand camera is this large. [mm]
LARGEST_MM = 150.0
#: So few points tell nothing of where their coordinates count from.
FEWEST_FOR_ORIGIN = 6
#: Pixels that all lie within this of the top-left corner are millimetres. [px]
CORNER_PX = 60.0


def refuse_wrong_unit(
    setup: SurveySetup, points: PointObservations, where: str, *, said: str = ""
) -> None:
    """Refuse coordinates whose size shows that they are in the other unit.

    Parameters
    ----------
    setup : SurveySetup
        Says the unit and how far from the nadir a point can lie.
    points : PointObservations
        As typed.
    where : str
        File and sheet, for the message.
    said : str
        Unit that the headings say, for the message.

    Raises
    ------
    InputError
        Naming the unit that the numbers seem to be in.
    """
    taking = setup.taking
    cartesian = points.use & points.is_cartesian
    place = "the headings" if said else "Setup (input_unit)"
    typed = np.hstack([points.xy1, points.xy2])[cartesian]
    if setup.unit == "mm":
        limit = LARGEST_MM if taking.c1 is None else WIDEST * max(c or 0.0 for c in taking.c_used)
        radial = points.polar[points.use & ~points.is_cartesian][:, :2]
        for values, what in ((typed, "coordinates"), (radial, "radii")):
            if (size := _typical(values)) > limit:
                seems = remark(f"units.{what}_in_pixels", size=size, limit=limit, place=place)
                raise InputError(f"{where}: {seems}")
        return
    first, second = taking.nadir1 or (0.0, 0.0), taking.nadir2 or (0.0, 0.0)
    nadir = max(abs(value) for value in (*first, *second))
    largest = float(np.nanmax(np.abs(typed))) if typed.size else np.inf
    reach = largest * (taking.pitch or np.inf)
    if nadir > 2 * CORNER_PX and largest < CORNER_PX:
        about = {"largest": largest, "x": first[0], "y": first[1], "place": place}
        raise InputError(f"{where}: {remark('units.far_from_nadir', **about)}")
    if nadir == 0 and reach < 0.01 * (taking.c1 or 20.0):
        raise InputError(f"{where}: {remark('units.all_at_nadir', reach=reach, place=place)}")


def _typical(values: FloatArray) -> float:
    """Return the median size of the numbers given; 0 where there are none."""
    finite = np.abs(values[~np.isnan(values)])
    return float(np.median(finite)) if finite.size else 0.0


def refuse_not_above_zero(**options: Any) -> None:
    """Refuse an option that is one number but not above zero, or more than one."""
    for name, value in options.items():
        if name in ("unit", "nadir1", "nadir2"):
            continue
        option = f"--{name.replace('_', '-')}"
        if as_floats(value, option).ndim:
            raise InputError(f"{option}: {remark('units.one_number')}")
        if not value > 0:
            raise InputError(f"{option}: {remark('units.above_zero', value=value)}")


def refuse_far_stations(
    d1: float | None, d2: float | None, where: str, *, options: Collection[str] = ()
) -> None:
    """Refuse distances so long that they are in millimetres or centimetres.

    Parameters
    ----------
    d1, d2 : float or None
        As typed, to be in metres.
    where : str
        File and sheet, for the message.
    options : collection of str
        Those given by option, ``"d1"`` or ``"d2"``.

    Raises
    ------
    InputError
        Naming the distance and what was probably meant.
    """
    for key, value in (("d1", d1), ("d2", d2)):
        if value is None or value <= FARTHEST_WALL:
            continue
        place = f"--{key}" if key in options else f"{where}: {key[0]}_{key[1]}"
        # 9500 is 9.5 m in millimetres; 950 is 9.5 m in centimetres and 0.95 m in millimetres.
        unit, per_metre = ("millimetres", 1000.0) if value >= 2000.0 else ("centimetres", 100.0)
        meant = remark(f"units.in_{unit}", meant=value / per_metre)
        raise InputError(f"{place} = {value:g} m: {meant}")


def refuse_pixels(xy: FloatArray, c: float, where: str) -> None:
    """Refuse coordinates said to be in mm that no lens of principal distance c [mm] can see.

    Raises
    ------
    InputError
        Saying that they look like pixels.
    """
    size = _typical(xy)
    if size > WIDEST * c:
        raise InputError(f"{where}: {remark('units.pixels', size=size, c=c)}")


def refuse_millimetres(pair: Pair, points: PointObservations, where: str) -> None:
    """Refuse raw pixels that all lie in the corner of photos whose nadir is far from it.

    Raises
    ------
    InputError
        Saying that they look like millimetres.
    """
    pixels = np.hstack([points.pixels1, points.pixels2])[points.use]
    if not np.isfinite(pixels).any() or float(np.nanmax(np.abs(pixels))) > CORNER_PX:
        return
    nadirs = [photo.pixels_from_plane(photo.nadir) for photo in (pair.image1, pair.image2)]
    if np.nanmax(np.abs(nadirs)) > 2 * CORNER_PX:
        seems = remark("units.millimetres", largest=np.nanmax(np.abs(pixels)))
        raise InputError(f"{where}: {seems}")


def refuse_corner(xy1: FloatArray, xy2: FloatArray, where: str) -> None:
    """Refuse coordinates in mm that count from a corner of the pictures, not from the nadir.

    Parameters
    ----------
    xy1, xy2 : ndarray, shape (n, 2)
        Of the points in use. [mm]
    where : str
        File and sheet, for the message.

    Raises
    ------
    InputError
        With what is to be subtracted.

    Notes
    -----
    Both photos show a point in one direction from the nadir, x1 y2 = x2 y1. Of coordinates that
    count from (a, b) the difference is a (y2 - y1) - b (x2 - x1).
    """
    whole = np.isfinite(np.hstack([xy1, xy2])).all(axis=1)
    first, second = xy1[whole], xy2[whole]
    one_sided = all((v >= 0).all() or (v <= 0).all() for v in np.hstack([first, second]).T)
    if whole.sum() < FEWEST_FOR_ORIGIN or not one_sided:
        return
    off = first[:, 0] * second[:, 1] - second[:, 0] * first[:, 1]
    apart = second - first
    design = np.column_stack([apart[:, 1], -apart[:, 0]])
    origin, *_ = np.linalg.lstsq(design, off)
    rest = np.sqrt(np.mean((off - design @ origin) ** 2))
    middle = origin / np.where(np.median(first, axis=0), np.median(first, axis=0), np.inf)
    if rest < 0.1 * np.sqrt(np.mean(off**2)) and (middle > 1 / 3).all() and (middle < 3).all():
        about = {"x": float(origin[0]), "y": float(origin[1])}
        raise InputError(f"{where}: {remark('units.from_corner', **about)}")


def refuse_contradiction(points: PointObservations, table: ReliefTable, where: str) -> None:
    """Refuse picks of which most contradict that both photos show the same points.

    Raises
    ------
    GeometryError
        With the likely reason.
    """
    miss = np.abs(table.standardised[points.use & ~np.isnan(table.standardised)])
    far = int((miss > CONTRADICTION).sum())
    if len(miss) < 3 or 2 * far <= len(miss):
        return
    about = {"far": far, "count": len(miss), "limit": CONTRADICTION}
    raise GeometryError(f"{where}: {remark('units.contradiction', **about)}")


def as_pixels(pair: Pair, points: PointObservations, where: str, unit: str) -> PointObservations:
    """Return the points with raw pixels for every kind of input, row by row."""
    missing = ~points.has_pixels
    cartesian = points.is_cartesian & missing
    polar = points.is_polar & missing & ~cartesian
    if polar.any():
        _refuse_polar(pair, points, polar & points.use, where)
    for rows, both, image in (
        (cartesian, (points.xy1, points.xy2), unit),
        (polar, points.polar_xy(), "mm"),
    ):
        if not rows.any():
            continue
        pixels = []
        for number, (photo, xy) in enumerate(zip((pair.image1, pair.image2), both, strict=True), 1):
            typed = np.where(rows[:, None], xy, np.nan)
            pixels.append(
                typed if image == "px" else _pixels_of_mm(photo, f"image{number}", typed, where)
            )
        points = replace(
            points,
            pixels1=np.where(rows[:, None], pixels[0], points.pixels1),
            pixels2=np.where(rows[:, None], pixels[1], points.pixels2),
        )
    return points


def _refuse_polar(pair: Pair, points: PointObservations, rows: BoolArray, where: str) -> None:
    """Refuse radial distances that say not where in the photos a point is."""
    if np.isnan(points.polar[rows, 2]).any():
        raise InputError(f"{where}: {remark('units.no_theta')}")
    if not np.allclose(pair.image1.nadir, pair.image2.nadir, atol=1e-9):
        raise GeometryError(f"{where}: {remark('units.two_nadirs')}")


def _pixels_of_mm(photo: Photo, key: str, xy: FloatArray, where: str) -> FloatArray:
    """Return pixels of image coordinates in mm from the nadir, y up."""
    c = photo.principal_distance
    if c is None:
        raise InputError(f"{where}: {remark('units.no_principal_distance', image=key)}")
    refuse_pixels(xy, c, where)
    return photo.pixels_from_apparent(photo.nadir + xy * photo.distance / c)
