"""Images of cameras whose poses are not known, and by how much their rays miss one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from multimedia.media import EXTERIOR, Camera, FlatInterface, Interfaces
from multimedia.orientation.object_rays import image_rays, nearest_points
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray, IntArray
from photocore.errors import GeometryError, InputError

#: So many distances and other points are enough to bring rays together.
_DISTANCES, _OTHERS = 20, 20
#: Weight of a distance's relative error beside the rays' angles [rad]; angle of a ray that is lost.
_WEIGHT, _LOST = 0.3, 1.0
#: From this angle on a miss counts less than by its square. [rad]
_GROSS = 0.003


@dataclass(frozen=True, slots=True, kw_only=True)
class ImagesOfCameras:
    """What the cameras saw: image points (m, n, 2) [mm], ends of distances (d, 2), lengths (d,)."""

    cameras: tuple[Camera, ...]
    media: tuple[FlatInterface | Interfaces | None, ...]
    image: FloatArray
    ends: IntArray
    lengths: FloatArray

    def stretched(self, points: FloatArray) -> FloatArray:
        """Return the distances between points over their true lengths."""
        first, second = points[self.ends.T]
        return np.asarray(np.linalg.norm(first - second, axis=1) / self.lengths)

    @property
    def share_of_noise(self) -> float:
        """Typical distance of a ray from where rays meet, over the noise of a coordinate.

        The median of two normal errors is 1.18 sigma; three coordinates of each point take theirs.
        """
        rays = float(np.isfinite(self.image[..., 0]).sum(axis=0).mean())
        return 1.18 * float(np.sqrt(1.0 - 1.5 / rays))

    def few(self) -> ImagesOfCameras:
        """Return some of the distances and points, the same each time."""
        distances = slice(0, _DISTANCES)
        others = np.random.default_rng(1).permutation(self.image.shape[1])[:_OTHERS]
        kept, place = np.unique(
            np.concatenate([self.ends[distances].ravel(), others]), return_inverse=True
        )
        ends = place[: self.ends[distances].size].reshape(-1, 2)
        return replace(self, image=self.image[:, kept], ends=ends, lengths=self.lengths[distances])


def images_with_distances(
    project: Project, distances: Sequence[tuple[str, str, float]]
) -> ImagesOfCameras:
    """Return the points that two cameras see, and the distances between them."""
    names = project.image_points.names
    image, _ = project.image_points.grid(project.camera_names, names)
    often = np.flatnonzero(np.isfinite(image[..., 0]).sum(axis=0) >= 2)
    row = {names[k]: n for n, k in enumerate(often.tolist())}
    usable = [(row[a], row[b], s) for a, b, s in distances if a in row and b in row]
    if not usable:
        raise InputError(remark("orient.no_distance"))
    return ImagesOfCameras(
        cameras=project.cameras, media=project.interfaces, image=image[:, often],
        ends=np.array([each[:2] for each in usable]), lengths=np.array([s for *_, s in usable]),
    )  # fmt: skip


def object_rays(images: ImagesOfCameras, k: int, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return the rays of camera ``k`` in the object's medium; NaN where it cannot stand."""
    try:
        return image_rays(camera, images.image[k], images.media[k])
    except GeometryError:  # beyond its face
        nothing = np.full((images.image.shape[1], 3), np.nan)
        return nothing, nothing


def _misses(
    images: ImagesOfCameras,
    cameras: Sequence[Camera],
    rays: Sequence[tuple[FloatArray, FloatArray]],
) -> FloatArray:
    """Return all misses of these rays."""
    origins, along = (np.array(parts) for parts in zip(*rays, strict=True))
    points = nearest_points(list(origins), list(along))
    way = points - origins
    depth = np.einsum("mni,mni->mn", way, along)[..., None]
    aside = way - np.maximum(depth, 0.0) * along  # no point lies before the face
    apart = points - np.array([camera.centre for camera in cameras])[:, None]
    misses = aside / np.sqrt(np.einsum("mni,mni->mn", apart, apart))[..., None]
    misses[np.isnan(misses)] = _LOST
    misses[np.isnan(images.image[..., 0])] = 0.0
    errors = _WEIGHT * (images.stretched(points) - 1)
    return np.concatenate([misses.ravel(), np.where(np.isfinite(errors), errors, _LOST)])


def noise_as_angle(project: Project) -> float:
    """Return the precision of an image coordinate as an angle. [rad]"""
    return project.sigma_image / float(np.mean([c.principal_distance for c in project.cameras]))


def all_misses(images: ImagesOfCameras, cameras: Sequence[Camera]) -> FloatArray:
    """Return the angles by which rays miss their points (m n 3), then errors of the distances."""
    return _misses(images, cameras, [object_rays(images, k, c) for k, c in enumerate(cameras)])


def cost(images: ImagesOfCameras, cameras: Sequence[Camera]) -> float:
    """Return the square sum of all misses."""
    return float((all_misses(images, cameras) ** 2).sum())


def typical_miss(images: ImagesOfCameras, cameras: Sequence[Camera]) -> float:
    """Return the median angle by which a ray that was seen misses its point. [rad]"""
    is_seen = np.isfinite(images.image[..., 0]).ravel()
    misses = all_misses(images, cameras)[: 3 * is_seen.size].reshape(-1, 3)
    return float(np.median(np.linalg.norm(misses[is_seen], axis=1)))


def settled(
    images: ImagesOfCameras, start: tuple[Camera, ...], loss: str = "soft_l1", gross: float = _GROSS
) -> tuple[Camera, ...]:
    """Return the cameras turned and moved until their rays meet as well as they can from there."""
    from scipy.optimize import least_squares

    middle = np.mean([camera.centre for camera in start], axis=0)
    size = float(max(np.linalg.norm(camera.centre - middle) for camera in start)) or 1.0
    unit = np.array([size, size, size, 1.0, 1.0, 1.0])

    def moved(k: int, step: FloatArray) -> Camera:
        return start[k].stepped(EXTERIOR, step[6 * k : 6 * k + 6] * unit)

    def cameras_at(step: FloatArray) -> tuple[Camera, ...]:
        return tuple(moved(k, step) for k in range(len(start)))

    def misses(step: FloatArray) -> FloatArray:
        return all_misses(images, cameras_at(step))

    def slopes(step: FloatArray) -> FloatArray:
        cameras = cameras_at(step)
        rays = [object_rays(images, k, camera) for k, camera in enumerate(cameras)]
        here = _misses(images, cameras, rays)
        columns = np.empty((len(here), len(step)))
        for column in range(len(step)):
            k, more = column // 6, step.copy()
            more[column] += 1e-7
            views, lines = list(cameras), list(rays)
            views[k] = moved(k, more)
            lines[k] = object_rays(images, k, views[k])
            columns[:, column] = (_misses(images, views, lines) - here) / 1e-7
        return columns

    solution = least_squares(
        misses, np.zeros(6 * len(start)), slopes, loss=loss, f_scale=gross, max_nfev=40, ftol=1e-3,
        xtol=1e-5,
    )  # fmt: skip
    return cameras_at(solution.x)
