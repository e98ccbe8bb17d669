"""Image points of other points: their rays miss those of the others by far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from multimedia.orientation.object_rays import image_rays, nearest_points
from multimedia.orientation.ray_misses import noise_as_angle
from multimedia.projects import SHOWN, ImagePoints, Project
from photocore.arrays import BoolArray, FloatArray

#: Rays that miss their point by so many times what is typical are of other points.
_STRAY = 15.0
#: Without either of two rays the others meet equally well if they miss by no more times as much.
_ALIKE = 3.0


def stray_rows(
    project: Project, places: FloatArray | None = None,
    distances: Sequence[tuple[str, str, float]] = (),
) -> BoolArray:  # fmt: skip
    """Return which image points belong to other points, shape (n,).

    Of each point that ray goes first without which the others meet best; the rest is looked at
    again. Where they meet as well without another one, both go: so do two rays that do not meet.

    Parameters
    ----------
    project : Project
        Its cameras have poses.
    places : ndarray, shape (p, 3), optional
        Where the points are, in the order of their names; NaN where only rays tell.
    distances : sequence of (str, str, float)
        Two points and how far they are apart. Where they are not, ends of two rays go.
    """
    points, names = project.image_points, project.image_points.names
    image, _ = points.grid(project.camera_names, names)
    rays = [image_rays(camera, measured, media) for camera, measured, media in
            zip(project.cameras, image, project.interfaces, strict=True)]  # fmt: skip
    origins, along = (np.array(parts) for parts in zip(*rays, strict=True))
    centres = np.array([camera.centre for camera in project.cameras])[:, None]
    place = np.full((len(names), 3), np.nan) if places is None else places
    is_fixed = np.isfinite(place[:, 0])
    noise, is_seen = noise_as_angle(project), np.isfinite(image[..., 0])
    for _ in project.cameras:
        misses = _misses(centres, origins, along, place)
        # Where images are exact, what is typical is rounding and the start's own error.
        typical = max(noise, float(np.median(misses[is_seen])))
        is_far = misses > _STRAY * typical
        if not is_far.any():
            break
        far = np.flatnonzero(is_far.any(axis=0) & ~is_fixed)
        is_far[:, far] = _disturbing(centres, origins[:, far], along[:, far], typical)
        along[is_far] = np.nan
    lost = is_seen & np.isnan(along[..., 0])
    lost |= is_seen & _ends_apart(origins, along, names, distances, noise)
    line = {name: k for k, name in enumerate(project.camera_names)}
    column = {name: n for n, name in enumerate(names)}
    at = [(line[c], column[p]) for c, p in zip(points.cameras, points.ids, strict=True)]
    return np.array([lost[pair] for pair in at], dtype=bool)


def without_rows(project: Project, is_out: BoolArray) -> Project:
    """Return a project without some of its image points."""
    points = project.image_points
    kept = np.flatnonzero(~is_out).tolist()
    rest = ImagePoints(
        cameras=tuple(points.cameras[row] for row in kept),
        ids=tuple(points.ids[row] for row in kept),
        groups=tuple(points.groups[row] for row in kept),
        image=points.image[kept], sigma=points.sigma[kept],
    )  # fmt: skip
    return replace(project, image_points=rest)


def names_of(points: ImagePoints, is_meant: BoolArray) -> dict[str, object]:
    """Return number and names of image points, as remarks have them."""
    rows = np.flatnonzero(is_meant).tolist()
    pairs = sorted((points.cameras[row], points.ids[row]) for row in rows)
    shown = ", ".join(f"{name} in {camera}" for camera, name in pairs[:SHOWN])
    return {"count": len(pairs), "names": shown + (" ..." if len(pairs) > SHOWN else "")}


def _misses(
    centres: FloatArray, origins: FloatArray, along: FloatArray, places: FloatArray
) -> FloatArray:
    """Return the angles by which rays miss their points, 0 where there is no ray. [rad]"""
    meeting = nearest_points(list(origins), list(along))
    points = np.where(np.isfinite(places), places, meeting)
    way = points - origins
    depth = np.einsum("mni,mni->mn", way, along)[..., None]
    aside = way - np.maximum(depth, 0.0) * along  # no point lies before the face
    return np.nan_to_num(np.linalg.norm(aside, axis=2) / np.linalg.norm(points - centres, axis=2))


def _disturbing(
    centres: FloatArray, origins: FloatArray, along: FloatArray, typical: float
) -> BoolArray:
    """Return the rays of each point without which the others meet: more than one if in doubt."""
    rest_misses = np.full(along.shape[:2], np.inf)
    for k in range(len(along)):
        rest, of_rays = along.copy(), np.isfinite(along[k, :, 0])
        rest[k] = np.nan
        misses = _misses(centres, origins, rest, np.full(rest.shape[1:], np.nan)).max(axis=0)
        rest_misses[k, of_rays] = misses[of_rays]
    return rest_misses <= _ALIKE * np.maximum(rest_misses.min(axis=0), typical)


def _ends_apart(
    origins: FloatArray, along: FloatArray, names: Sequence[str],
    distances: Sequence[tuple[str, str, float]], noise: float,
) -> BoolArray:  # fmt: skip
    """Return the rays of ends of two rays each that are not as far apart as they have to be."""
    is_apart = np.zeros(along.shape[:2], dtype=bool)
    column = {name: n for n, name in enumerate(names)}
    both = [(column[a], column[b], s) for a, b, s in distances if a in column and b in column]
    ends = np.array([pair for *pair, _ in both], dtype=np.int64).reshape(-1, 2)
    lengths = np.array([length for *_, length in both])
    points = nearest_points(list(origins), list(along))
    error = np.abs(np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1) - lengths)
    if not np.isfinite(error).any():
        return is_apart
    way = np.nanmedian(np.linalg.norm(points - origins, axis=2))
    typical = max(float(np.nanmedian(error)), noise * float(way))
    off = np.unique(ends[error > _STRAY * typical])
    is_apart[:, off] = np.isfinite(along[:, off, 0]).sum(axis=0) == 2
    return is_apart
