"""Cameras joined as if the object's medium were all around: pair by pair, by straight rays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from multimedia.media import Camera, FlatInterface, Interfaces, as_media
from multimedia.orientation.object_rays import image_rays, nearest_points
from multimedia.orientation.ray_misses import ImagesOfCameras, cost, settled
from multimedia.projects import FLIP, SHOWN
from multimedia.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import cameras_seeing
from photocore.errors import GeometryError

#: Points that two cameras must both see for their essential matrix.
FEWEST = 8
#: Bounds for matches of a pair, of image coordinates over c: the medium left out costs as much.
_BOUNDS = (5e-4, 1e-3, 2e-3, 4e-3, 8e-3)
#: Where distances come out more unevenly than this share, so many chains are improved first, and so
#: many of them kept.
_EVEN, _CHAINS, _KEPT = 0.15, 6, 3
#: Points that give a camera its place in a chain.
_LEAST = 6
#: The most that a ray's miss counts [rad], and the weight of distances that come out unevenly.
_MOST, _WEIGHT = 0.1, 0.1


class StraightPoses(NamedTuple):
    """Cameras in a frame of their own, as OpenCV has them: turns, centres, where rays meet."""

    turns: FloatArray
    centres: FloatArray
    points: FloatArray


def stands_still(media: FlatInterface | Interfaces | None) -> bool:
    """Return whether there are media that do not move with their camera."""
    if isinstance(media, Interfaces):
        return not all(media.with_camera)
    return media is not None and not media.moves_with_camera


def straightened(
    camera: Camera, image: FloatArray, media: FlatInterface | Interfaces | None
) -> FloatArray:
    """Return image points (x right, y down, over c) as if the object's medium were all around."""
    if not stands_still(media):
        home = replace(camera, centre=np.zeros(3), rotation=np.eye(3))
        _, along = image_rays(home, image, media)
        return np.asarray(along[:, :2] * (1, -1) / -along[:, 2:])
    indices = as_media(media).indices
    ideal = camera.ideal(image) * (1, -1) / camera.principal_distance
    return np.asarray(ideal * indices[0] / indices[-1])


def straight_chains(
    rays: FloatArray, images: ImagesOfCameras, names: Sequence[str]
) -> list[StraightPoses]:
    """Return all cameras from the pairs that lead to rays and distances that agree best."""
    chains: dict[float, StraightPoses] = {}
    even = False
    for first, second, turn, centre in _pairs(rays):
        poses = _chained(rays, {first: (np.eye(3), np.zeros(3)), second: (turn, centre)})
        if poses is None:
            continue
        stretched = images.stretched(poses.points)
        if np.isfinite(stretched).any():
            scale = float(np.nanmedian(stretched))
            misses = float(np.nanmean(_angles(rays, poses)))
            uneven = float(np.nanmean(np.abs(stretched / scale - 1)))
            scaled = poses._replace(centres=poses.centres / scale, points=poses.points / scale)
            chains.setdefault(misses + _WEIGHT * uneven, scaled)
            even |= uneven < _EVEN
    if not chains:
        shown = ", ".join(names[:SHOWN])
        raise GeometryError(remark("orient.too_few_common", names=shown, fewest=FEWEST))
    best = [chains[score] for score in sorted(chains)[:_CHAINS]]
    return best[:1] if even else _evened(rays, images, best)


def _evened(
    rays: FloatArray, images: ImagesOfCameras, chains: Sequence[StraightPoses]
) -> list[StraightPoses]:
    """Return the chains that come nearest to rays and distances when all their cameras move."""
    straight = replace(images, image=rays * (1, -1), media=(None,) * len(rays))
    few = straight.few()
    improved = [
        settled(few, tuple(
            Camera(centre=centre, rotation=turn.T @ FLIP, principal_distance=1.0)
            for turn, centre in zip(poses.turns, poses.centres, strict=True)
        ))
        for poses in chains
    ]  # fmt: skip
    evened = []
    for views in sorted(improved, key=lambda cameras: cost(few, cameras))[:_KEPT]:
        lines = [
            image_rays(view, points) for view, points in zip(views, straight.image, strict=True)
        ]
        evened.append(StraightPoses(
            turns=np.array([FLIP @ camera.rotation.T for camera in views]),
            centres=np.array([camera.centre for camera in views]),
            points=nearest_points(*(list(parts) for parts in zip(*lines, strict=True))),
        ))  # fmt: skip
    return evened


def _pairs(rays: FloatArray) -> Iterator[tuple[int, int, FloatArray, FloatArray]]:
    """Yield two cameras, the turn of the second and its centre, as their common points have it."""
    import cv2

    for first, second in combinations(range(len(rays)), 2):
        both = np.isfinite(rays[first] + rays[second]).all(axis=1)
        if both.sum() < FEWEST:
            continue
        one, two = (np.ascontiguousarray(rays[k, both]) for k in (first, second))
        for bound in _BOUNDS:
            cv2.setRNGSeed(7)
            matrix, fits = cv2.findEssentialMat(one, two, np.eye(3), cv2.RANSAC, 0.999, bound)
            if matrix is not None and matrix.shape == (3, 3):
                _, turn, shift, *_ = cv2.recoverPose(
                    matrix, one, two, np.eye(3), distanceThresh=1e3, mask=fits
                )
                yield first, second, turn, -(turn.T @ shift).ravel()


def _chained(
    rays: FloatArray, placed: dict[int, tuple[FloatArray, FloatArray]]
) -> StraightPoses | None:
    """Return all cameras: each next one sees most of the points that those before it give."""
    import cv2

    while True:
        turns, centres = map(np.array, zip(*placed.values(), strict=True))
        along = _along(rays[list(placed)], turns)
        origins = np.broadcast_to(centres[:, None], along.shape)
        points = nearest_points(list(origins), list(along))
        visible = np.isfinite(rays[..., 0] + points[:, 0])
        rest = [k for k in range(len(rays)) if k not in placed]
        if not rest:
            order = np.argsort(list(placed))
            return StraightPoses(turns[order], centres[order], points)
        most = max(rest, key=lambda k: int(visible[k].sum()))
        if visible[most].sum() < _LEAST:
            return None
        use: BoolArray = visible[most]
        views = cameras_seeing(
            points[use], rays[most, use], np.eye(3), methods=[cv2.SOLVEPNP_SQPNP]
        )
        if not views:
            return None
        placed[most] = (views[0].rotation, views[0].centre)


def _along(rays: FloatArray, turns: FloatArray) -> FloatArray:
    """Return unit vectors of rays in the common frame, shape (m, n, 3)."""
    along = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=2) @ turns
    return np.asarray(along / np.linalg.norm(along, axis=2, keepdims=True))


def _angles(rays: FloatArray, poses: StraightPoses) -> FloatArray:
    """Return by which angles rays miss their point, at most `_MOST`, shape (m, n)."""
    way = poses.points - poses.centres[:, None]
    along = _along(rays, poses.turns)
    depth = (way * along).sum(axis=2)
    miss = np.linalg.norm(way - depth[..., None] * along, axis=2) / np.abs(depth)
    return np.minimum(np.where(depth < 0, _MOST, miss), _MOST)
