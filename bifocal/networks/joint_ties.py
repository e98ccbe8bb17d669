"""Points that several photos of a façade share, and all pairs brought roughly into one frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import cv2
import numpy as np

from bifocal.matching import Features, alike, match_features, spread_evenly
from bifocal.model import PairMedia
from bifocal.networks.joint_adjustment import JointUnknowns
from bifocal.networks.joint_media import highest_relief
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import Pinhole, Similarity, fit_plane
from photocore.errors import GeometryError

Media = Sequence[PairMedia]
#: Where points begin, they keep this share of the way to the last interface, in which none lies.
BEFORE_MEDIA = 0.8
#: Matches of two photos that one geometry explains to this are kept. [px of the searched photo]
TOLERANCE = 2.0
#: Fewer of them are chance.
FEWEST_MATCHES = 15
#: Common points of two photos that are kept, spread evenly: more add nothing but time.
MOST_MATCHES = 250
#: Points that two pairs share, from which one is brought into the frame of the other.
FEWEST_SHARED = 6
#: Points of two frames that lie apart by more than this share of their spread are not the same:
#: nominal cameras turned by 0.2 degrees, as in the rendered street, put them apart by half of it.
SLACK = 0.02
#: Rays of one point meet the wall no further from each other than this share of the distance.
NEAR = 0.03


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SharedPoints:
    """Where points are seen.

    Attributes
    ----------
    photo, point : ndarray of int, shape (n,)
    pixels : ndarray, shape (n, 2)
        As given; for features, raw. [px]
    count : int
        Points.
    """

    photo: IntArray
    point: IntArray
    pixels: FloatArray
    count: int

    def of_photos(self, which: Sequence[int]) -> SharedPoints:
        """Return the rays of some photos, which are counted anew and may be named twice."""
        rays = [np.flatnonzero(self.photo == photo) for photo in which]
        photo, rows = (
            np.repeat(range(len(rays)), [len(part) for part in rays]),
            np.concatenate(rays),
        )
        return SharedPoints(
            photo=photo, point=self.point[rows], pixels=self.pixels[rows], count=self.count
        )


def common_features(
    features: Sequence[Features],
    shapes: Sequence[tuple[int, ...]],
    together: BoolArray,
    most: int = MOST_MATCHES,
) -> SharedPoints:
    """Return the points that features of several photos show.

    Parameters
    ----------
    features : sequence of Features
        Of every photo.
    shapes : sequence of (height, width)
    together : ndarray of bool, shape (m, m)
        Which photos may show the same part of the wall.
    most : int
        Common points of two photos that are kept.

    Notes
    -----
    Matches that one epipolar geometry explains are joined into points; a point that would be in
    one photo twice is dropped.
    """
    start = np.cumsum([0, *(len(part.pixels) for part in features)])
    parent = np.arange(start[-1])

    def root(index: int) -> int:
        while parent[index] != index:
            parent[index] = parent[parent[index]]
            index = int(parent[index])
        return index

    for first, second in combinations(range(len(features)), 2):
        if together[first, second]:
            for a, b in _matches(features[first], features[second], shapes[first], most):
                parent[root(start[first] + a)] = root(start[second] + b)
    roots = np.array([root(k) for k in range(len(parent))], dtype=np.int64)
    photo = np.repeat(np.arange(len(features)), np.diff(start))
    _, point, count = np.unique(roots, return_inverse=True, return_counts=True)
    # Twice in one photo: more rays than photos.
    photos = np.bincount(np.unique(np.column_stack([point, photo]), axis=0)[:, 0])
    good = (count >= 2) & (photos == count)
    number = np.cumsum(good) - 1
    rays = good[point]
    pixels = np.concatenate([part.pixels for part in features])
    return SharedPoints(
        photo=photo[rays], point=number[point[rays]], pixels=pixels[rays], count=int(good.sum())
    )


def _matches(
    first: Features, second: Features, shape: tuple[int, ...], most: int
) -> list[list[int]]:
    """Return matches of two photos, rows of both, none where they share too little."""
    rows1, rows2 = match_features(first, second)
    fits = alike(first, second, rows1, rows2)
    rows1, rows2 = rows1[fits], rows2[fits]
    if len(rows1) < FEWEST_MATCHES:
        return []
    tolerance = TOLERANCE * max(first.reduction, second.reduction)
    cv2.setRNGSeed(0)
    matrix, inside = cv2.findFundamentalMat(
        first.pixels[rows1], second.pixels[rows2], cv2.USAC_MAGSAC, tolerance, 0.999, 5000
    )
    if matrix is None or inside is None:
        return []
    good = inside.ravel() > 0
    if good.sum() < max(FEWEST_MATCHES, 0.3 * len(good)):
        return []
    pairs = np.column_stack([rows1[good], rows2[good]]).astype(np.int64)
    # Features come strongest first.
    keep = spread_evenly(first.pixels[pairs[:, 0]], np.arange(len(pairs), dtype=float), shape, most)
    found_again: list[list[int]] = pairs[keep].tolist()
    return found_again


def into_one_frame(
    cameras: Sequence[Pinhole],
    shared: SharedPoints,
    ideal: FloatArray,
    known: FloatArray,
    names: Sequence[str],
    media: Media = (),
) -> JointUnknowns:
    """Return all cameras and points roughly in the frame of the control points.

    Parameters
    ----------
    cameras : sequence of Pinhole
        2 k and 2 k + 1 are the far and the near one of pair k, each pair in a frame of its own.
    shared : SharedPoints
    ideal : ndarray, shape (n, 2)
        Their pixels, free of distortion.
    known : ndarray, shape (p, 3)
        Control points, NaN for others. [m]
    names : sequence of str
        Of the pairs.
    media : sequence of PairMedia
        What the cameras of each pair look through; empty where all are in air.

    Raises
    ------
    GeometryError
        If a pair shares no points with the others; it is named.
    """
    count = len(cameras) // 2
    media = media or (PairMedia.none(),) * (len(cameras) // 2)
    places = _places_by_pair(cameras, shared, ideal, media)
    fixed = [int(np.isfinite(known + place).all(axis=1).sum()) for place in places]
    root = int(np.argmax(fixed))
    xyz: FloatArray = places[root].copy()
    frames: dict[int, Similarity | None] = {root: None}
    if fixed[root] >= 3:
        frames[root] = _robust(places[root], known)
        xyz = _moved(places[root], frames[root])
        fixed_points = np.asarray(np.isfinite(known)).all(axis=1)
        xyz[fixed_points] = known[fixed_points]
    while len(frames) < count:
        rest = [k for k in range(count) if k not in frames]
        common = [int(np.isfinite(xyz + places[k]).all(axis=1).sum()) for k in rest]
        best = int(np.argmax(common))
        if common[best] < FEWEST_SHARED:
            raise GeometryError(
                f"{', '.join(names[k] for k in rest)}: fewer than {FEWEST_SHARED} points are "
                "shared with the other pairs. Pairs must overlap by a fifth or more; else leave "
                "them out, or name common points in their control tables."
            )
        k = rest[best]
        frames[k] = _robust(places[k], xyz)
        xyz = np.where(np.isfinite(xyz), xyz, _moved(places[k], frames[k]))
    framed = [(camera, frames[k // 2]) for k, camera in enumerate(cameras)]
    moved = [camera if frame is None else camera.carried(frame) for camera, frame in framed]
    if fixed[root] < 3 and np.isfinite(known + xyz).all(axis=1).sum() >= 3:
        whole = _robust(xyz, known)
        xyz, moved = _moved(xyz, whole), [camera.carried(whole) for camera in moved]
    # What no pair sees in both photos stands on the wall, where its rays meet that.
    xyz = np.where(np.isfinite(xyz), xyz, _on_the_wall(moved, shared, ideal, media))
    middle = np.nanmedian(xyz, axis=0)
    return JointUnknowns(cameras=tuple(moved), xyz=np.where(np.isfinite(xyz), xyz, middle[None, :]))


def near_each_other(
    cameras: Sequence[Pinhole], shared: SharedPoints, ideal: FloatArray, media: Media = ()
) -> BoolArray:
    """Return which rays meet the wall near the others of their point, shape (n,).

    Repeated windows are matched a window apart; what is left of the frames' tilts, and the relief
    itself, put rays of one point apart by a few per cent of the distance.
    """
    media = media or (PairMedia.none(),) * (len(cameras) // 2)
    places = _meeting_the_wall(cameras, shared, ideal, media)[:, :2]
    reach = NEAR * np.array([camera.centre[2] for camera in cameras])[shared.photo]
    order = np.argsort(shared.point, kind="stable")
    starts = np.searchsorted(shared.point[order], np.arange(shared.count + 1))
    good = np.zeros(len(ideal), dtype=bool)
    for first, last in pairwise(starts.tolist()):
        rays = order[first:last]
        rays = rays[np.isfinite(places[rays]).all(axis=1)]
        if not len(rays):
            continue
        away = np.abs(places[rays] - np.median(places[rays], axis=0)).max(axis=1)
        good[rays] = away < reach[rays]
    return good


def _meeting_the_wall(
    cameras: Sequence[Pinhole], shared: SharedPoints, ideal: FloatArray, media: Media
) -> FloatArray:
    """Return where rays meet the reference plane, shape (n, 3); NaN where they do not. [m]"""
    places = np.full((len(ideal), 3), np.nan)
    for number, camera in enumerate(cameras):
        rays = shared.photo == number
        places[rays] = media[number // 2].on_plane(number % 2, camera, ideal[rays])
    return places


def _on_the_wall(
    cameras: Sequence[Pinhole], shared: SharedPoints, ideal: FloatArray, media: Media
) -> FloatArray:
    """Return the mean of the places where each point's rays meet the wall, shape (p, 3). [m]"""
    places = _meeting_the_wall(cameras, shared, ideal, media)
    met = np.isfinite(places).all(axis=1)
    total = np.zeros((shared.count, 3))
    np.add.at(total, shared.point[met], places[met])
    count = np.bincount(shared.point[met], minlength=shared.count)
    return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], np.nan)


def _places_by_pair(
    cameras: Sequence[Pinhole], shared: SharedPoints, ideal: FloatArray, media: Media
) -> list[FloatArray]:
    """Return the points seen in both photos of each pair, in its frame; NaN for others."""
    places = []
    for k in range(len(cameras) // 2):
        pixels = np.full((2, shared.count, 2), np.nan)
        for side in (0, 1):
            rays = shared.photo == 2 * k + side
            pixels[side, shared.point[rays]] = ideal[rays]
        both = slice(2 * k, 2 * k + 2)
        xyz = media[k].meeting(cameras[both], pixels[0], pixels[1])
        lowest = min(cameras[2 * k].centre[2], cameras[2 * k + 1].centre[2])
        wild = ~(np.abs(xyz[:, 2]) < 0.5 * lowest)  # near the zoom centre relief is not known
        wild |= xyz[:, 2] > BEFORE_MEDIA * highest_relief(cameras[both], media[k])
        xyz[wild] = np.nan
        places.append(xyz)
    return places


def _robust(source: FloatArray, target: FloatArray) -> Similarity:
    """Return the shift, turn in the wall and scale of most of the points that both have.

    Relief is far less certain than X and Y, and every pair's plane is the wall already: tilts are
    left to the adjustment. Repeated windows match wrongly by the dozen, so most is all that counts.
    """
    both = np.flatnonzero(np.isfinite(source + target).all(axis=1))
    if len(both) >= FEWEST_SHARED:
        spread = float(np.ptp(target[both, :2], axis=0).max())
        cv2.setRNGSeed(0)
        _, inside = cv2.estimateAffinePartial2D(
            source[both, :2], target[both, :2], method=cv2.RANSAC, maxIters=5000,
            ransacReprojThreshold=SLACK * spread,
        )  # fmt: skip
        if inside is not None and inside.sum() >= 3:
            both = both[inside.ravel() > 0]
    plane = fit_plane(source[both], target[both])
    lifted = np.median(target[both, 2] - plane(source[both])[:, 2])
    return replace(plane, target_centre=plane.target_centre + np.array([0.0, 0.0, lifted]))


def _moved(xyz: FloatArray, frame: Similarity | None) -> FloatArray:
    return xyz if frame is None else np.where(np.isfinite(xyz), frame(np.nan_to_num(xyz)), np.nan)
