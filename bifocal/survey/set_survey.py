"""Points measured in three photos and more of a set: coordinates, precision, wrong picks."""

from __future__ import annotations

import numpy as np

from bifocal.model import FlagLimits, PhotoSet, SetIntersection, displacement
from bifocal.rays import plane_position
from bifocal.remarks import remark
from bifocal.survey.observations import PointObservations
from bifocal.survey.relief_table import ReliefTable, entries


def solve_set(
    photos: PhotoSet,
    points: PointObservations,
    *,
    sigma_px: float | None = None,
    limits: FlagLimits,
) -> tuple[ReliefTable, tuple[str, ...], tuple[str, ...]]:
    """Solve points measured in photos of a set.

    Parameters
    ----------
    photos : PhotoSet
    points : PointObservations
        With raw pixels in each photo, in the order of the set.
    sigma_px : float, optional
        Measuring precision; by default each photo's own. [px]
    limits : FlagLimits
        Where the flags begin.

    Returns
    -------
    table : ReliefTable
        ``e1`` ... of every photo count from its own nadir, in mm at the scale of the first where
        its principal distance is known; radii and misfits of pairs are NaN.
    notes : tuple of str, length n
        Which pick is wrong, empty where none seems to be.
    remarks : tuple of str
        The same of used points, worst first.
    """
    unseen = [np.full((len(points), 2), np.nan)] * (len(photos) - len(points.pixels))
    solved = photos.intersect(
        [*points.pixels, *unseen], sigma_px=sigma_px, sigma_r_max=limits.sigma_r_max
    )
    scale_number = photos.photos[0].scale_number
    to_wall = 1000.0 / (scale_number or 1000.0)
    xyz, blank = solved.xyz, np.full(len(points), np.nan)
    pairs = ("s1_used", "s2_used", "theta_used", "ds", "den", "s_c", "q")
    displaced = {
        f"e{number}": to_wall * displacement(plane_position(xyz, photo.foot), xyz, photo.foot)
        for number, photo in enumerate(photos.photos, start=1)
    }
    sigma = solved.sigma
    columns = dict.fromkeys(pairs, blank) | displaced
    columns |= {"r": xyz[:, 2], "X": xyz[:, 0], "Y": xyz[:, 1], "Z": xyz[:, 2]}
    columns |= {f"sigma_{axis}": sigma[:, i] for i, axis in enumerate("XYr")}
    table = ReliefTable(
        ids=points.ids,
        columns=columns | entries(solved.covariance),
        flags=solved.flags,
        standardised=solved.standardised,
        of_pixels=entries(solved.own_covariance / solved.sigma_px**2, "k_"),
        image_scale=scale_number,
        sigma_px=solved.sigma_px,
        effect=solved.effect,
    )
    notes = _notes(photos, solved)
    off = [i for i in np.argsort(-np.abs(solved.standardised)) if notes[i] and points.use[i]]
    remarks = [
        remark(
            "survey.off_set", name=points.ids[i], sigmas=abs(solved.standardised[i]), picks=notes[i]
        )
        for i in off[:10]
    ]
    if len(off) > 10:
        remarks.append(remark("survey.off_radial_more", count=len(off) - 10))
    return table, notes, tuple(remarks)


def _notes(photos: PhotoSet, solved: SetIntersection) -> tuple[str, ...]:
    """Return which pick of each point is wrong and by how much, smallest first; empty for none."""
    notes = []
    for flag, suspects, slips in zip(solved.flags, solved.suspects, solved.slips, strict=True):
        named = sorted(np.flatnonzero(suspects), key=lambda number: slips[number])
        text = ""
        if named:
            picks = ", ".join(f"{photos.names[k]} ({slips[k]:.1f} px)" for k in named)
            key = "survey.wrong_pick" if len(named) == 1 else "survey.wrong_picks"
            text = remark(key, picks=picks)
        elif flag == "OFF-RADIAL":
            text = remark("survey.wrong_of_two")
        notes.append(text)
    return tuple(notes)
