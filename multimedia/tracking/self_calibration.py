"""Cameras adjusted on the particles that they see, without a calibration body in the water."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from multimedia.adjustment import Adjustment, Unknowns, bundle_adjust
from multimedia.media import EXTERIOR
from multimedia.openptv.chance_counts import chance_counts
from multimedia.openptv.correspondences import correspondences
from multimedia.orientation import intersect
from multimedia.projects import ImagePoints, ObjectPoints, Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import GeometryError, InputError

#: How far cameras may be off. [px]
CAMERAS_OFF = 8.0
#: Rounds at most; particles that an adjustment holds, chosen at random, and targets of a camera
#: among which they are sought. Of 300 particles, disparity 5 px, 15 % of the first round were true
#: and three rounds enough; of 1000 particles, 1.6 px, a quarter and two; of 1000, 4.2 px, 1 %.
_ROUNDS, _PARTICLES, _TARGETS = 16, 600, 1200
#: Standard deviations of a target within which the next round seeks, but so many pixels at least.
_SIGMAS, _LEAST = 5.0, 0.25
#: Change of that standard deviation below which the rounds end; share of chance that is too much.
_SETTLED, _CHANCE = 0.1, 0.5
#: What is told of it in figures.
FIGURES = ("particles", "before", "after", "moved", "sigma", "sigma_px")
#: How far cameras are off, beforehand, in disparities (100 to 1000 particles, six scenes).
_SURER = 1.5
#: Huber's bound.
_ROBUST = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SelfCalibration:
    """Cameras that were adjusted on particles.

    Attributes
    ----------
    project : Project
        With the adjusted cameras; all else as it was.
    particles : int
        That were adjusted.
    before, after : ndarray, shape (cameras,)
        Disparity: root mean square distance of their targets from where a camera would see the
        points that the rays of all are nearest to, by the cameras as they were and as they are.
        [px]
    moved, sigma : ndarray, shape (cameras,)
        How far each centre moved, and its standard deviation, what all cameras share included.
        [object unit]
    sigma_px : float
        A-posteriori standard deviation of an image coordinate. [px]
    """

    project: Project
    particles: int
    before: FloatArray
    after: FloatArray
    moved: FloatArray
    sigma: FloatArray
    sigma_px: float


def calibrated_on_particles(
    content: Project, frames: Sequence[Sequence[FloatArray]], *, tolerance: float = CAMERAS_OFF
) -> SelfCalibration:
    """Return the cameras that fit the particles of some frames best.

    Parameters
    ----------
    content : Project
        Cameras that are off a little, with their sensors, and the media, which are kept.
    frames : sequence of sequence of ndarray, shape (n, 2)
        Targets of each camera in each frame. [px]
    tolerance : float
        How far cameras may be off. [px]

    Returns
    -------
    SelfCalibration

    Raises
    ------
    InputError
        If there are fewer than three cameras: rays of two meet wherever these are not.
    GeometryError
        If particles are so many for cameras so far off that what fits is chance.

    Notes
    -----
    Volume self-calibration [1]_ as a bundle adjustment through the media: what all
    cameras see within the tolerance are tie points, most of them wrong at first. They are anywhere
    within it, the true ones where the error of the cameras puts them: each round moves the cameras
    towards these, and then more are true. Where no particle tells (the place and scale of all,
    which refraction alone holds) the cameras stay where they were, as far as their precision goes.

    References
    ----------
    .. [1] Wieneke, "Volume self-calibration for 3D particle image velocimetry", Experiments in
       Fluids 45 (2008).
    """
    if len(content.cameras) < 3:
        raise InputError(remark("tracks.few_cameras", count=len(content.cameras)))
    sensors = [c.described_sensor("its sensor is not described; targets need it.")
               for c in content.cameras]  # fmt: skip
    pitch = float(np.mean([sensor.pixel_size.mean() for sensor in sensors]))
    rng, reach, before, cameras = np.random.default_rng(1), tolerance, np.inf, content.cameras
    most = float(np.mean([[len(pixels) for pixels in targets] for targets in frames]))
    count = min(len(frames), int(np.ceil(_TARGETS / max(most, 1.0))))
    chosen = [frames[k] for k in np.linspace(0, len(frames) - 1, count).astype(int)]
    for _ in range(_ROUNDS):
        pixels = _seen_by_all(replace(content, cameras=cameras), chosen, reach)
        if pixels.shape[1] < 2 * len(EXTERIOR):
            break
        ties = pixels[:, np.sort(rng.permutation(pixels.shape[1])[:_PARTICLES])]
        image = np.stack([s.image_from_pixel(p) for s, p in zip(sensors, ties, strict=True)])
        result = _adjusted(content, image, tolerance * pitch)
        cameras, sigma = result.project.cameras, result.sigma0 / pitch
        narrower = min(reach, max(_SIGMAS * sigma, _LEAST))
        if tolerance > reach <= narrower and abs(sigma - before) <= _SETTLED * sigma:
            counts = chance_counts(result.project, chosen, reach, len(cameras))
            if counts.chance.sum() < _CHANCE * counts.found.sum():
                return _calibration(content, image, tolerance * pitch)
            break
        reach, before = narrower, sigma
    raise GeometryError(remark("tracks.not_calibrated", tolerance=tolerance))


def _seen_by_all(
    content: Project, frames: Sequence[Sequence[FloatArray]], tolerance: float
) -> FloatArray:
    """Return the targets of particles that all cameras see, shape (cameras, n, 2). [px]"""
    parts = []
    for targets in frames:
        _, numbers, _ = correspondences(
            content.cameras, targets, content.interfaces, tolerance=tolerance,
            fewest=len(content.cameras),
        )  # fmt: skip
        parts.append([pixels[rows] for pixels, rows in zip(targets, numbers.T, strict=True)])
    return np.stack([np.concatenate(each) for each in zip(*parts, strict=True)])


def _adjusted(content: Project, image: FloatArray, off: float) -> Adjustment:
    """Return the adjustment of image points (cameras, n, 2), with cameras off by so much. [mm]"""
    count, names = image.shape[1], content.camera_names
    points = ImagePoints(
        cameras=tuple(np.repeat(names, count).tolist()),
        ids=tuple(map(str, range(count))) * len(names), image=image.reshape(-1, 2),
    )  # fmt: skip
    places = intersect(content.cameras, image, content.interfaces).xyz
    priors: dict[str, float] = {}
    for camera in content.cameras:
        angle = off / camera.principal_distance
        away = angle * float(np.nanmedian(np.linalg.norm(places - camera.centre, axis=1)))
        priors |= {f"{camera.name}:{name}": away if name in EXTERIOR[:3] else angle
                   for name in EXTERIOR}  # fmt: skip
    unknowns = Unknowns(control="free", robust=_ROBUST, priors=priors)
    bare = replace(content, object_points=ObjectPoints(), image_points=points)
    return bundle_adjust(bare, unknowns)


def _calibration(content: Project, image: FloatArray, most: float) -> SelfCalibration:
    """Return what image points (cameras, n, 2) make of cameras off by so much at most. [mm]."""
    sizes = np.array([c.described_sensor("").pixel_size for c in content.cameras])[:, None]
    before = _disparities(content, image)
    # What the particles do not tell is as sure as what they do tell was right.
    off = min(most, _SURER * float(sizes.mean() * np.sqrt(np.mean(before**2))))
    result = _adjusted(content, image, off)
    moved = [new.centre - old.centre
             for old, new in zip(content.cameras, result.project.cameras, strict=True)]  # fmt: skip
    sigma = [[result.sigma(f"{name}:{axis}") for axis in EXTERIOR[:3]]
             for name in content.camera_names]  # fmt: skip
    return SelfCalibration(
        project=replace(result.project, object_points=content.object_points,
                        image_points=content.image_points),
        particles=image.shape[1], before=before, after=_disparities(result.project, image),
        moved=np.linalg.norm(moved, axis=1), sigma=np.linalg.norm(sigma, axis=1),
        sigma_px=float(result.sigma0 / sizes.mean()),
    )  # fmt: skip


def _disparities(content: Project, image: FloatArray) -> FloatArray:
    """Return the root mean square misses of each camera. [px]"""
    sizes = np.array([c.described_sensor("").pixel_size for c in content.cameras])[:, None]
    misses = intersect(content.cameras, image, content.interfaces).residuals / sizes
    return np.sqrt(np.nanmean((misses**2).sum(axis=2), axis=1))
