"""What a surveyor should be told about the results: mispicks, exchanged photos, poor control."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from bifocal.model import Pair
from bifocal.model.hypotheses import unit_of
from bifocal.remarks import remark
from bifocal.survey.georeferencing import georeference
from bifocal.survey.observations import PointObservations
from bifocal.survey.reference import Georeference, KnownPoints
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import SurveySetup
from photocore.arrays import FloatArray
from photocore.errors import GeometryError

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
    remarks: list[str] = [remark("survey.left_out", name=name) for name in world.bad]
    unknown = control.missing_in(table)
    if unknown:
        remarks.append(remark("survey.no_such_control", names=", ".join(unknown[:10])))
    if is_auto and world.model == "2D":
        remarks.append(remark("survey.no_heights"))
    elif is_auto and world.model != "levelled":
        lean = math.degrees(math.acos(min(1.0, float(world.world_from_wall.rotation[2, 1]))))
        remarks.append(remark("survey.model_taken", model=world.model, lean=lean))
    scale = world.world_from_wall.scale
    if abs(scale - 1.0) > SCALE_SHARE:
        remarks.append(remark("survey.wrong_scale", scale=scale))
        if unit := unit_of(max(scale, 1 / scale)):
            remarks.append(remark("survey.scale_of_unit", unit=unit))
    sizes = np.where(world.used, np.sqrt(np.nansum(world.residuals**2, axis=1)), 0.0)
    if sizes.size and sizes.max() > LARGEST_RESIDUAL:
        name = world.ids[int(sizes.argmax())]
        remarks.append(remark("survey.large_residuals", size=sizes.max(), name=name))
        turned = replace(control, xyz=control.xyz[:, [1, 0, 2]])
        try:
            fitted = georeference(table, turned, model=world.model).residuals
        except GeometryError:
            return remarks
        if np.sqrt(np.nansum(fitted**2, axis=1)).max() < 0.1 * sizes.max():
            remarks.insert(0, remark("survey.east_north_exchanged"))
    return remarks


def angle_remarks(points: PointObservations) -> list[str]:
    """Return that angles typed as degrees look like radians or gon."""
    theta = points.polar[points.use & ~points.is_cartesian, 2]
    theta = theta[np.isfinite(theta)]
    if len(theta) >= 6 and np.abs(theta).max() < 6.3 and np.ptp(theta) > 3.0:
        return [remark("survey.angles_in_radians", most=theta.max())]
    if len(theta) and 360.0 < theta.max() <= 400.0:
        return [remark("survey.angles_in_gon", most=theta.max())]
    return []


def exchanged_remark(setup: SurveySetup) -> str:
    """Return what is said of a set-up whose image 1 has the shorter distance."""
    taking = setup.taking
    if taking.c1 is None:
        return remark("survey.exchanged_unsure", d1=taking.d1, d2=taking.d2)
    return remark("survey.exchanged", d1=taking.d1, d2=taking.d2, c1=taking.c1)


def unused_remarks(unused: Collection[str], **listed: KnownPoints) -> list[str]:
    """Return what is said of check and control points that are out of use in the table of points.

    Parameters
    ----------
    unused : collection of str
        Names of points with ``use`` = 0.
    **listed : KnownPoints
        What is typed, by the name of its sheet.
    """
    remarks: list[str] = []
    for sheet, points in listed.items():
        names = [n for n, use in zip(points.ids, points.used, strict=True) if use and n in unused]
        if len(names) == 1:
            remarks.append(remark("survey.unused", sheet=sheet, name=names[0]))
        elif names:
            remarks.append(
                remark("survey.unused_several", sheet=sheet, names=", ".join(names[:10]))
            )
    return remarks


def opposite_signs_remark(table: ReliefTable, reference: KnownPoints) -> list[str]:
    """Return a warning where most points of known relief come out with the opposite sign."""
    rows = reference.rows_in(table)
    here = reference.used & (rows >= 0)
    r, z, sigma = table["r"][rows[here]], reference.xyz[here, 2], table["sigma_r"][rows[here]]
    # Signs tell nothing where relief is not different from zero.
    clear = np.minimum(np.abs(r), np.abs(z)) > 2 * sigma
    opposite = np.flatnonzero(clear & (r * z < 0))
    if len(opposite) < 2 or 2 * len(opposite) <= clear.sum():
        return []
    worst = opposite[np.abs(z[opposite]).argmax()]
    name = np.array(reference.ids)[here][worst]
    count = {"count": len(opposite), "all": int(clear.sum())}
    return [remark("survey.opposite_signs", name=name, found=r[worst], known=z[worst], **count)]


def point_remarks(
    points: PointObservations, table: ReliefTable, setup: SurveySetup | None
) -> list[str]:
    """Return a sentence for each mispicked point, worst first, with the size of the miss."""
    flags = np.array(table.flags)
    off = [int(i) for i in np.flatnonzero(flags == "OFF-RADIAL") if points.use[i]]
    off.sort(key=lambda i: -abs(table.standardised[i]))
    misses, unit = table["q"], "mm"
    if "misfit_px" in table.of_pixels:
        misses, unit = table.of_pixels["misfit_px"], "px"
    elif setup is not None and setup.taking.pitch is not None:
        misses, unit = table["q"] / setup.taking.pitch, "px"
    remarks: list[str] = [
        remark(
            "survey.off_radial", name=points.ids[i], miss=abs(misses[i]), unit=unit,
            sigmas=abs(table.standardised[i]),
        )
        for i in off[:10]
    ]  # fmt: skip
    if len(off) > 10:
        remarks.append(remark("survey.off_radial_more", count=len(off) - 10))
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
    name, angle = points.ids[worst], angles.max()
    return [remark("survey.off_axis", name=name, angle=angle, image=int(image) + 1)]


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
    return [
        remark(
            "survey.refraction", media=len(pair.layers.indices), most=off[:, 2].max(),
            median=np.median(off[:, 2]), aside=np.hypot(off[:, 0], off[:, 1]).max(),
        )
    ]  # fmt: skip


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
