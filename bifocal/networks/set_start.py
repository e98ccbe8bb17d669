"""First cameras of a set of photos: one pair as always, the others by resection, one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import cv2
import numpy as np

from bifocal.model import SAME_FOCAL, SIGMA_RADIAL, Interior
from bifocal.networks.joint_ties import FEWEST_MATCHES, SharedPoints
from bifocal.orientation import (
    VALIDATION,
    Control,
    OrientedPair,
    PhotoInput,
    SiteMeasures,
    orient_pair,
    resect,
)
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import Pinhole, camera_matrix, homogeneous, ray_on_plane
from photocore.errors import ConvergenceError, GeometryError

#: So many pairs are tried, the most promising first.
TRIED = 5
#: Rays that meet at a larger angle tell no more: their photos match less well. [rad]
WIDE = 0.3
#: Rays that meet at a smaller one give no place to resect by: 1 less the angle's cosine.
NARROW = 2e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FirstCameras:
    """Cameras to start from.

    Attributes
    ----------
    far, near : int
        Photos of the first pair.
    pair : OrientedPair
    cameras, interiors : tuple
        Of all photos, in the frame of the first pair.
    lens : tuple of int
        Of each photo, the first of the same unknown lens.
    radial : ndarray, shape (m, 2)
    xyz : ndarray, shape (p, 3)
        Of points whose rays do not meet, roughly on the wall.
    met : ndarray of bool, shape (p,)
        Which points' rays do, at a fair angle.
    """

    far: int
    near: int
    pair: OrientedPair
    cameras: tuple[Pinhole, ...]
    interiors: tuple[Interior, ...]
    lens: tuple[int, ...]
    radial: FloatArray
    xyz: FloatArray
    met: BoolArray


def first_cameras_of(
    photos: Sequence[PhotoInput], points: SharedPoints, control: Control, site: SiteMeasures
) -> FirstCameras:
    """Return first cameras of all photos.

    Parameters
    ----------
    photos : sequence of PhotoInput
    points : SharedPoints
        Control points first, in their order, then ties; pixels free of the lens files' distortion.
    control, site
        As of a pair; distance 1 is that of the first photo, distance 2 of the second.

    Raises
    ------
    GeometryError
        If no two photos make a pair, for the reason of the most promising, or one photo shares too
        few points with the others.
    """
    (far, near), pair = _first_pair(photos, points, control, site)
    interiors = [photo.interior for photo in photos]
    interiors[far], interiors[near] = pair.observations.interiors
    lens = _lenses(interiors)
    radial = np.zeros((len(photos), 2))
    radial[[far, near]] = pair.adjusted.radial
    for k, first in enumerate(lens):
        its = next((j for j in (far, near) if lens[j] == first), None)
        if its is not None:
            interiors[k], radial[k] = interiors[its], radial[its]
        elif radial.any() and not interiors[k].is_calibrated:
            interiors[k] = replace(interiors[k], sigma_radial=SIGMA_RADIAL)
    cameras = {far: pair.adjusted.cameras[0], near: pair.adjusted.cameras[1]}
    pixels = points.pixels.copy()
    for k, interior in enumerate(interiors):
        rays = points.photo == k
        pixels[rays] = interior.radial(*radial[k]).undistort(pixels[rays])
    coordinates = np.full((points.count, 3), np.nan)
    coordinates[: len(control.ids)] = control.xyz
    while len(cameras) < len(photos):
        xyz = np.where(np.isfinite(coordinates), coordinates, meeting(cameras, points, pixels))
        placed = np.asarray(np.isfinite(xyz).all(axis=1))[points.point]
        count = [-1 if k in cameras else int((placed & (points.photo == k)).sum())
                 for k in range(len(photos))]  # fmt: skip
        k = int(np.argmax(count))
        rays = placed & (points.photo == k)
        try:
            camera, agree = resect(xyz[points.point[rays]], pixels[rays], interiors[k])
        except GeometryError:
            agree = np.zeros(1, dtype=bool)
        if agree.sum() < min(FEWEST_MATCHES, max(len(agree), 4)) or agree.mean() < 0.5:
            raise GeometryError(
                f"{photos[k].name}: shares too few details with the other photos ({count[k]}, "
                f"{agree.sum()} of them agree) to be set up with them. Photos must overlap and be "
                "taken from not too different directions: leave it out, or pick control points."
            )
        cameras[k] = camera
    for k, leader in enumerate(lens):  # what is one unknown begins with one value
        if leader != k:
            whole, centre = cameras[leader].matrix, cameras[k].matrix[:2, 2]
            matrix = camera_matrix(whole[0, 0], whole[1, 1] / whole[0, 0], *centre)
            cameras[k], radial[k] = cameras[k]._replace(matrix=matrix), radial[leader]
    xyz = meeting(cameras, points, pixels)
    middle, unknown = np.nanmedian(xyz, axis=0), np.asarray(np.isnan(xyz).any(axis=1))
    for k, camera in cameras.items():  # what is seen under too small an angle stands on the wall
        rays = np.flatnonzero((points.photo == k) & unknown[points.point])
        xyz[points.point[rays]] = ray_on_plane(camera, pixels[rays])
    return FirstCameras(
        far=far, near=near, pair=pair, cameras=tuple(cameras[k] for k in range(len(photos))),
        interiors=tuple(interiors), lens=lens, radial=radial,
        xyz=np.where(np.isfinite(xyz), xyz, middle), met=~unknown,
    )  # fmt: skip


def _first_pair(
    photos: Sequence[PhotoInput], points: SharedPoints, control: Control, site: SiteMeasures
) -> tuple[tuple[int, int], OrientedPair]:
    """Return the best pair that today's way orients, and its photos, the far one first."""
    reasons: list[GeometryError | ConvergenceError] = []
    for one, second in _promising(photos, points, control, site)[:TRIED]:
        for far, near in ((one, second), (second, one)):
            try:
                pair = orient_pair(
                    (photos[far], photos[near]), control=control.of(far, near),
                    site=_measures(site, far, near),
                )  # fmt: skip
            except (GeometryError, ConvergenceError) as error:
                reasons.append(error)
                break
            if not pair.exchanged:
                return (far, near), pair
    if reasons:
        raise reasons[0]
    raise GeometryError(remark("set.no_first_pair"))


def _measures(site: SiteMeasures, far: int, near: int) -> SiteMeasures:
    """Return what was measured of two photos: the distances go with their photos."""
    taped = {0: site.distance1, 1: site.distance2}
    both = {far, near} == {0, 1}
    return replace(
        site, distance1=taped.get(far), distance2=taped.get(near), ordered=True,
        delta_d=site.delta_d if both else None, parallel=site.parallel and both,
    )  # fmt: skip


def _promising(
    photos: Sequence[PhotoInput], points: SharedPoints, control: Control, site: SiteMeasures
) -> list[tuple[int, int]]:
    """Return the pairs that may be oriented, those whose rays meet best first.

    Of each, the photo first that seems to be taken from farther away.
    """
    ranked = []
    for pair, ties in _common(points, len(photos), len(control.ids)):
        one, second = pair
        picked = control.of(one, second)
        enough = all(
            (picked.positioned & np.isfinite(p).all(axis=1)).sum() >= 4
            for p in (picked.pixels1, picked.pixels2)
        )
        measures = _measures(site, one, second)
        scaled = (
            measures.distance1
            or measures.distance2
            or measures.delta_d
            or (control.lengths and one == 0)
        )
        if enough or ((scaled or picked.positioned.sum() >= 2) and (site.wall is None or not one)):
            promise = promise_of(photos[one].interior, photos[second].interior, *ties)
            ranked.append((enough, abs(promise), pair if promise >= 0 or site.wall else pair[::-1]))
    return [pair for *_, pair in sorted(ranked, reverse=True)]


def _common(
    points: SharedPoints, photos: int, first: int
) -> Iterator[tuple[tuple[int, int], tuple[FloatArray, FloatArray]]]:
    """Yield all two photos with the ties that both show, if these are no chance."""
    pixels = np.full((photos, points.count, 2), np.nan)
    pixels[points.photo, points.point] = points.pixels
    pixels = pixels[:, first:]
    for one, second in combinations(range(photos), 2):
        both = np.isfinite(pixels[one] + pixels[second]).all(axis=1)
        if both.sum() >= FEWEST_MATCHES:
            yield (one, second), (pixels[one, both], pixels[second, both])


def promise_of(first: Interior, second: Interior, x1: FloatArray, x2: FloatArray) -> float:
    """Return how well rays of common points meet: their angles' square sum, up to `WIDE`.

    Less where both cameras stand at nearly one distance: two such photos are no pair. Negative
    where the second camera stands farther from them.
    """
    y1, y2 = (homogeneous(x) @ np.linalg.inv(i.matrix).T for i, x in ((first, x1), (second, x2)))
    cv2.setRNGSeed(7)
    limit = 3.0 / min(first.focal, second.focal)
    a, b = np.ascontiguousarray(y1[:, :2]), np.ascontiguousarray(y2[:, :2])
    matrix, inside = cv2.findEssentialMat(a, b, np.eye(3), cv2.RANSAC, 0.999, limit)
    if matrix is None or matrix.shape != (3, 3):
        return 0.0
    _, turn, shift, inside, xyz = cv2.recoverPose(
        matrix, a, b, np.eye(3), distanceThresh=1e3, mask=inside
    )
    good = inside.ravel() > 0
    if not good.any():
        return 0.0
    points = (xyz[:3] / xyz[3]).T[good]
    depth2 = (points @ turn.T + shift.T)[:, 2]
    change = float(np.log(np.median(points[:, 2]) / np.median(depth2)))
    d1, d2 = y1[good], y2[good] @ turn
    sine = np.linalg.norm(np.cross(d1, d2), axis=1)
    sine /= np.linalg.norm(d1, axis=1) * np.linalg.norm(d2, axis=1)
    promise = float((np.minimum(sine, WIDE) ** 2).sum())
    return float(np.clip(change / (2 * VALIDATION.least_change), -1, 1)) * promise


def _lenses(interiors: Sequence[Interior]) -> tuple[int, ...]:
    """Return, of each photo, the first of the same lens, of which no file tells more."""

    def same(first: Interior, second: Interior) -> bool:
        if first.is_assumed or first.is_calibrated or second.is_calibrated:
            return False
        if first.image_size != second.image_size:
            return False
        return bool(abs(np.log(first.focal / second.focal)) < SAME_FOCAL)

    return tuple(
        next((j for j in range(k) if same(interiors[j], interior)), k)
        for k, interior in enumerate(interiors)
    )


def meeting(cameras: Mapping[int, Pinhole], seen: SharedPoints, pixels: FloatArray) -> FloatArray:
    """Return where all rays of each point meet, shape (p, 3); NaN at too small angles. [m]"""
    normal, right = np.zeros((seen.count, 3, 3)), np.zeros((seen.count, 3))
    for k, camera in cameras.items():
        rays: IntArray = np.flatnonzero(seen.photo == k)
        along = homogeneous(pixels[rays]) @ np.linalg.inv(camera.matrix).T @ camera.rotation
        along /= np.linalg.norm(along, axis=1)[:, None]
        across = np.eye(3) - along[:, :, None] * along[:, None, :]
        np.add.at(normal, seen.point[rays], across)
        np.add.at(right, seen.point[rays], across @ camera.centre)
    xyz = np.full((seen.count, 3), np.nan)
    good = np.linalg.eigvalsh(normal)[:, 0] > NARROW
    xyz[good] = np.linalg.solve(normal[good], right[good][..., None])[..., 0]
    for k, camera in cameras.items():  # wrong matches meet behind a camera
        points = seen.point[seen.photo == k]
        xyz[points[(xyz[points] - camera.centre) @ camera.rotation[2] <= 0]] = np.nan
    return xyz
