"""What a surveyor should be told about the results: mispicks, exchanged photos, poor control."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from bifocal.model.pair import Pair
from bifocal.survey.observations import PointObservations
from bifocal.survey.reference import Georeference, KnownPoints
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import SurveySetup
from photocore.arrays import FloatArray

#: A scale further from 1 than this is no matter of taping distances.
SCALE_SHARE = 0.01
#: Only a handful of lenses sees further off its axis, and none of them on a telephoto. [deg]
WIDEST_ANGLE = 60.0
#: Residuals of control points beyond this are named. [m]
LARGEST_RESIDUAL = 0.10


def georeference_remarks(
    world: Georeference, control: KnownPoints, table: ReliefTable, *, is_auto: bool
) -> list[str]:
    """Return what is wrong or surprising about the world coordinates.

    Parameters
    ----------
    world : Georeference
        As found.
    control : KnownPoints
        As typed.
    table : ReliefTable
        Solved points.
    is_auto : bool
        Whether the data chose the model.
    """
    said = [f"{name} contradicts the other control points and was left out." for name in world.bad]
    unknown = control.missing_in(table)
    if unknown:
        said.append(f"no measured point is called {', '.join(unknown[:10])}; not used.")
    if is_auto and world.model == "2D":
        said.append("no heights H are given: the model 2D was taken, H stays blank.")
    elif is_auto and world.model != "levelled":
        lean = math.degrees(math.acos(min(1.0, float(world.world_from_wall.rotation[2, 1]))))
        said.append(
            f"auto took the model {world.model}, since levelled does not fit the control points as "
            f"well; the wall's Y then leans {lean:.2f} deg from upright. If the photos were "
            "levelled, check the control points, or say --georeference levelled."
        )
    scale = world.world_from_wall.scale
    if abs(scale - 1.0) > SCALE_SHARE:
        said.append(
            f"WARNING: scale {scale:.4g} instead of 1: the control points lie {scale:.4g} times as "
            "far apart as the survey says. Check the distances and principal distances in Setup, "
            "that E, N, H are in metres, and that each name has its own coordinates."
        )
    sizes = np.where(world.used, np.sqrt(np.nansum(world.residuals**2, axis=1)), 0.0)
    if sizes.size and sizes.max() > LARGEST_RESIDUAL:
        worst = int(sizes.argmax())
        said.append(
            f"WARNING: residuals of up to {sizes[worst]:.2f} m, the largest at "
            f"{world.ids[worst]}: the control points do not fit the survey. Check names and "
            "coordinates; do not use E, N, H before."
        )
    return [f"Georeference: {text}" for text in said]


def exchanged_remark(setup: SurveySetup) -> str:
    """Return what is said of a set-up whose image 1 has the shorter distance."""
    taking = setup.taking
    camera = "" if taking.c1 is None else f" with c = {taking.c1:g} mm"
    nothing = (
        " Neither c_1 nor c_2 is given, so nothing else tells which photo is the far one."
        if taking.c1 is None
        else ""
    )
    return (
        f"d_1 = {taking.d1:g} m is shorter than d_2 = {taking.d2:g} m, so image 1 was taken for "
        "the near photo (swapped images): photos 1 and 2 were exchanged together with their "
        f"distances.{nothing} This is right only if image 1 (x1 y1, s1) was measured on the photo "
        f"taken from {taking.d1:g} m{camera}; if only the distances were typed the wrong way "
        "round, exchange d_1 and d_2, else all relief is wrong."
    )


def unused_remarks(unused: Collection[str], **listed: KnownPoints) -> list[str]:
    """Return what is said of check and control points that are out of use in the table of points.

    Parameters
    ----------
    unused : collection of str
        Names of points with ``use`` = 0.
    **listed : KnownPoints
        What is typed, by the name of its sheet.
    """
    said = []
    for sheet, known in listed.items():
        names = [n for n, use in zip(known.ids, known.used, strict=True) if use and n in unused]
        if names:
            verb = "takes" if len(names) == 1 else "take"
            said.append(f"{sheet}: {', '.join(names[:10])} {verb} no part: use = 0 in Points.")
    return said


def opposite_signs_remark(table: ReliefTable, known: KnownPoints) -> list[str]:
    """Return a warning where most points of known relief come out with the opposite sign."""
    rows = known.rows_in(table)
    here = known.used & (rows >= 0)
    r, z, sigma = table["r"][rows[here]], known.xyz[here, 2], table["sigma_r"][rows[here]]
    # Signs tell nothing where relief is not different from zero.
    clear = np.minimum(np.abs(r), np.abs(z)) > 2 * sigma
    opposite = np.flatnonzero(clear & (r * z < 0))
    if len(opposite) < 2 or 2 * len(opposite) <= clear.sum():
        return []
    worst = opposite[np.abs(z[opposite]).argmax()]
    name = np.array(known.ids)[here][worst]
    return [
        f"WARNING: relief has the wrong sign at {len(opposite)} of {int(clear.sum())} points of "
        f"known relief (at {name} {r[worst]:+.3f} m, measured {z[worst]:+.3f} m): photos 1 and 2 "
        "look exchanged. x1 y1 belong to the far photo (d_1), x2 y2 to the near one; relief counts "
        "+ towards the camera."
    ]


def point_remarks(
    points: PointObservations, table: ReliefTable, setup: SurveySetup | None
) -> list[str]:
    """Return a sentence for each mispicked point, worst first, with the size of the miss."""
    flags = np.array(table.flags)
    off = [int(i) for i in np.flatnonzero(flags == "OFF-RADIAL") if points.use[i]]
    off.sort(key=lambda i: -abs(table.standardised[i]))
    misses, unit = table["q"], "mm"
    if "misfit_px" in table.carried:
        misses, unit = table.carried["misfit_px"], "px"
    elif setup is not None and setup.taking.pitch is not None:
        misses, unit = table["q"] / setup.taking.pitch, "px"
    remarks = [
        f"{points.ids[i]}: the two picks miss each other by {abs(misses[i]):.3g} {unit} across the "
        f"radius ({abs(table.standardised[i]):.1f} sigma); measure it again."
        for i in off[:10]
    ]
    if len(off) > 10:
        remarks.append(f"... and {len(off) - 10} more OFF-RADIAL points.")
    return remarks


def wide_remarks(setup: SurveySetup, points: PointObservations) -> list[str]:
    """Return a warning where a point lies further off the axis than lenses see."""
    measured = setup.in_millimetres(points)
    x, y = np.array([measured.xy1, measured.xy2]).transpose(2, 0, 1)
    s = np.where(measured.is_cartesian, np.hypot(x, y), measured.polar[:, :2].T)
    c = np.array([[c or np.inf] for c in setup.taking.c_used])
    angles = np.nan_to_num(np.degrees(np.arctan(s / c))) * measured.use
    image, worst = np.unravel_index(angles.argmax(), angles.shape)
    if angles[image, worst] <= WIDEST_ANGLE:
        return []
    return [
        f"WARNING: {points.ids[worst]} lies {angles.max():.0f} deg off the axis of image "
        f"{image + 1}, further than lenses see. If prints were measured, give their enlargements "
        "(enlargement_1, enlargement_2 in Setup; --enlargement1, --enlargement2; 1 = on the "
        f"sensor); else check c_{image + 1}, the unit and the size of a pixel."
    ]


def refraction_remarks(pair: Pair, points: PointObservations) -> list[str]:
    """Return what it would cost to take a pair through media for one in air; empty in air.

    Parameters
    ----------
    pair : Pair
        As solved.
    points : PointObservations
        With ``pixels1`` and ``pixels2`` [px]; of an ideal pair image coordinates [mm]. Only points
        in use are counted.
    """
    off = refraction_errors(pair, points)
    if not pair.layers or not len(off):
        return []
    aside = float(np.hypot(off[:, 0], off[:, 1]).max())
    return [
        f"refraction in {len(pair.layers.indices)} media is taken into account; neglected it would "
        f"falsify relief by up to {off[:, 2].max():.3f} m (median {np.median(off[:, 2]):.3f} m) "
        f"and places by up to {aside:.3f} m."
    ]


def refraction_errors(pair: Pair, points: PointObservations) -> FloatArray:
    """Return by how much points would be wrong if their pair were taken for one in air.

    Parameters
    ----------
    pair, points
        As in `refraction_remarks`.

    Returns
    -------
    ndarray, shape (n, 3)
        Sizes of the errors of X, Y and r of points in use that both ways solve; none in air. [m]
    """
    if not pair.layers or len(set(pair.layers.indices)) == 1:
        return np.zeros((0, 3))
    picks = points.all_xy()
    if points.has_pixels.any():
        picks = points.pixels1, points.pixels2
    bent, straight = (one.intersect(*picks).xyz for one in (pair, pair.in_air()))
    off = np.abs(straight - bent)[points.use]
    return np.asarray(off[np.isfinite(off).all(axis=1)])
