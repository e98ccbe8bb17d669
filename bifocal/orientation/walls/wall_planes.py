"""Planes of any direction among a pair's ties: which of them is the wall, where the first is not.

The dominant homography of two photos may be that of a roof, of another façade or of nothing at all
(a strong distortion bends the wall); the wall's faces are then looked for in the model itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.tuning import WALLS
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class WallPlane:
    """A plane ``normal . X = offset`` on which ties gather.

    Attributes
    ----------
    normal : ndarray, shape (3,)
        Unit vector towards the cameras.
    offset : float
        [m]
    share : float
        Of the photo's cells that hold ties, the part on the plane.
    members : ndarray of bool, shape (n,)
    """

    normal: FloatArray
    offset: float
    share: float
    members: BoolArray

    @property
    def slope(self) -> float:
        """Slope against Z = 0. [m/m]"""
        return float(np.hypot(*self.normal[:2]) / max(self.normal[2], 1e-9))

    def distance(self, centre: FloatArray) -> float:
        """Return how far a camera stands before it. [m]"""
        return float(self.normal @ centre - self.offset)


def planes_of_any_direction(
    xyz: FloatArray,
    weight: FloatArray,
    centres: Sequence[FloatArray] = (),
    *,
    distance: float | None = None,
) -> list[WallPlane]:
    """Return the planes before all cameras on which points gather, one after the other.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        [m]
    weight : ndarray, shape (n,)
        What each point stands for: ties crowd where there is texture.
    centres : sequence of ndarray, shape (3,)
        Projection centres; none: where the cameras stand does not matter. [m]
    distance : float, optional
        From which the photos were taken.  [default: the first centre's Z] [m]
    """
    distance = float(centres[0][2]) if distance is None else distance
    band = WALLS.rough_band * distance
    generator = np.random.default_rng(7)
    free, planes = np.ones(len(xyz), dtype=bool), []
    for _ in range(WALLS.most_planes):
        remaining = np.flatnonzero(free)
        if len(remaining) < 20:
            break
        corners = xyz[generator.choice(remaining, (WALLS.triples, 3))]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(normals, axis=1)
        normals = normals[size > 0] / size[size > 0, None]
        normals *= np.where(normals[:, 2:] < 0, -1.0, 1.0)
        offsets = (normals * corners[size > 0, 0]).sum(axis=1)
        some = generator.choice(remaining, min(len(remaining), 1500), replace=False)
        away = np.abs(xyz[some] @ normals.T - offsets)
        scores = weight[some] @ np.maximum(1.0 - away / band, 0.0)
        for centre in centres:
            scores[normals @ centre - offsets < 0.05 * distance] = 0.0
        best = int(scores.argmax())
        normal, offset = _refined(
            xyz[remaining], weight[remaining], normals[best], offsets[best], band
        )
        height = np.abs(xyz @ normal - offset)
        members = free & (height < band)
        share = float(weight[members].sum() / weight.sum())
        if share < 0.02:
            break
        planes.append(WallPlane(normal, offset, share, members))
        free &= height >= 2 * band
    return planes


def _refined(
    xyz: FloatArray, weight: FloatArray, normal: FloatArray, offset: float, band: float
) -> tuple[FloatArray, float]:
    """Return the plane of the points within the band of a first one."""
    for _ in range(5):
        near = np.abs(xyz @ normal - offset) < band
        if near.sum() < 10:
            break
        middle = np.average(xyz[near], axis=0, weights=weight[near])
        rows = (xyz[near] - middle) * np.sqrt(weight[near])[:, None]
        normal = np.linalg.svd(rows, full_matrices=False)[2][2]
        normal = normal if normal[2] > 0 else -normal
        offset = float(normal @ middle)
    return normal, offset


def likely_wall(
    planes: Sequence[WallPlane],
    pixels: FloatArray,
    centres: tuple[FloatArray, FloatArray],
    site: SiteMeasures,
    *,
    sigma_ratio: float,
) -> WallPlane | None:
    """Return the plane to be taken for the wall; None where there is no plane at all.

    The spot the user named decides; else, of the planes whose distances stand in the ratio of the
    measured ones within two sigma, the fullest; but one of nearly the present direction, Z = 0,
    unless another holds clearly more or the ratio contradicts it by four.

    Parameters
    ----------
    planes : sequence of WallPlane
    pixels : ndarray, shape (n, 2)
        The points in the far photo. [px]
    centres : pair of ndarray, shape (3,)
        [m]
    site : SiteMeasures
    sigma_ratio : float
        Standard deviation of ln(d1 / d2), found without both measured distances.
    """
    if not planes:
        return None
    d1, d2 = site.distances
    fair = [p for p in planes if p.share >= WALLS.fair * planes[0].share]
    if site.wall is not None:
        nearest = np.argsort(np.linalg.norm(pixels - np.array(site.wall), axis=1))[:15]
        chosen = max(planes, key=lambda p: int(p.members[nearest].sum()))
        return chosen if chosen.members[nearest].sum() >= 5 else None
    if d1 and d2 and np.isfinite(sigma_ratio):
        sigma = float(np.hypot(sigma_ratio, np.hypot(site.sigma / d1, site.sigma / d2)))
        ratios = [np.log(p.distance(centres[0]) / p.distance(centres[1])) for p in fair]
        tests = np.abs(np.array(ratios) - np.log(d1 / d2)) / sigma
        limits = [
            WALLS.plane_contradicted if p.slope <= WALLS.face_slope else WALLS.face_fits
            for p in fair
        ]
        fair = [p for p, test, most in zip(fair, tests, limits, strict=True) if test < most] or fair
    best = max(fair, key=lambda p: p.share)
    present = [
        p for p in fair if p.slope <= WALLS.face_slope and WALLS.fuller * p.share >= best.share
    ]
    return max(present, key=lambda p: p.share) if present else best


def steep_rivals_in_words(
    planes: Sequence[WallPlane], chosen: WallPlane, pixels: FloatArray, site: SiteMeasures
) -> str:
    """Return the question which of several planes is meant; empty where none competes."""
    d1, d2 = site.distances
    others = [
        p
        for p in planes
        if p is not chosen
        and p.share >= WALLS.comparable * chosen.share
        and float(p.normal @ chosen.normal) < np.cos(np.arctan(WALLS.face_slope))
    ]
    if not others or site.wall is not None or (d1 and d2):
        return ""
    named = []
    for plane in others:
        turn = np.rad2deg(np.arccos(np.clip(plane.normal @ chosen.normal, -1.0, 1.0)))
        column, row = np.median(pixels[plane.members], axis=0)
        about = {"angle": turn, "share": 100 * plane.share, "column": column, "row": row}
        named.append(remark("orientation.turned_plane", **about))
    return remark("orientation.which_plane", share=100 * chosen.share, planes="; ".join(named))
