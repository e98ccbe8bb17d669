"""First camera of a photo from control points: where it stood, which way it looked, its lens."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from bifocal import rays
from bifocal.model import Interior, PairMedia
from bifocal.orientation.tuning import RESECTION
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import Pinhole, camera_matrix, cameras_seeing, project
from photocore.errors import GeometryError


def resect(
    xyz: FloatArray, pixels: FloatArray, interior: Interior, media: PairMedia | None = None,
    number: int = 0,
) -> tuple[Pinhole, BoolArray]:  # fmt: skip
    """Return an approximate camera and which points agree with it.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Control points. [m]
    pixels : ndarray, shape (n, 2)
        Their ideal pixels.
    interior : Interior
        What is known of the lens. An unknown principal distance is searched over a wide range.
    media : PairMedia, optional
        What the camera looks through.
    number : int
        Which of theirs it is: 0 for the far camera, 1 for the near one.

    Returns
    -------
    camera : Pinhole
    agree : ndarray of bool, shape (n,)

    Raises
    ------
    GeometryError
        With fewer than four points, or points in line, or none that agree; or points before the
        media.

    Notes
    -----
    A camera in air sees the points where their straight rays of the first medium are (Maas 2015,
    Eqs. 1 and 2: the radial shift). Seen near the axis, that is a scene compressed in depth by
    n_1 / n_m behind a surface that stays with it, and behind a port a lens n_m / n_1 times as long;
    from there both are found in turn.
    """
    if not media:
        return _in_air(xyz, pixels, interior)
    bent = media.layers.indices[0] / media.layers.indices[-1]
    if media.depth is not None:
        squeezed = xyz.copy()
        squeezed[:, 2] = media.depth - (media.depth - xyz[:, 2]) * bent
        camera, agree = _in_air(squeezed, pixels, interior)
        ratio = camera.matrix[0, 0] / interior.focal
    else:
        longer = replace(interior, focal=interior.focal / bent)
        camera, agree = _in_air(xyz, pixels, longer)
        ratio = camera.matrix[0, 0] * bent / interior.focal
    # A principal distance that was searched is found; it is not searched in every round.
    refracted = replace(
        interior, focal=interior.focal * ratio, sigma_focal=min(interior.sigma_focal, 0.02)
    )
    for _ in range(RESECTION.rounds):
        usable = np.zeros(len(xyz), dtype=bool)
        if media.z0(number, camera) >= 0:
            seeming = _seeming(camera, media, number, xyz)
            usable = np.asarray(np.isfinite(seeming).all(axis=1))
        if usable.sum() < 4:
            raise GeometryError(remark("resection.before_media"))
        before = camera.centre
        camera, fits = _in_air(seeming[usable], pixels[usable], refracted)
        agree = usable.copy()
        agree[usable] = fits
        if np.linalg.norm(camera.centre - before) < RESECTION.settled * before[2]:
            break
    return camera, agree


def _seeming(camera: Pinhole, media: PairMedia, number: int, xyz: FloatArray) -> FloatArray:
    """Return points moved along their heights onto the straight rays that show them, (n, 3)."""
    foot = media.foot(number, camera)
    away = rays.plane_position(xyz, foot) - foot.nadir
    reach = 1.0 - xyz[:, 2:] / foot.distance
    return np.concatenate([foot.nadir + away * reach, xyz[:, 2:]], axis=1)


def _in_air(xyz: FloatArray, pixels: FloatArray, interior: Interior) -> tuple[Pinhole, BoolArray]:
    """Return `resect` of a camera that looks through no media."""
    refuse_line(xyz)
    generator = np.random.default_rng(7)
    width = max(interior.image_size)
    spread = min(3.0 * interior.sigma_focal, 1.3)
    count = 1 + 2 * int(np.ceil(spread / 0.08)) if spread > 0.02 else 1
    factors = np.exp(np.linspace(-spread, spread, count)) if count > 1 else [1.0]
    best, camera, agree = np.inf, None, np.zeros(len(xyz), dtype=bool)
    for factor in factors:
        matrix = camera_matrix(interior.focal * factor, interior.aspect, *interior.centre)
        for candidate in _candidates(xyz, pixels, matrix, generator):
            misfit = np.linalg.norm(pixels - project(candidate, xyz), axis=1)
            share = np.nan_to_num(misfit, nan=1e6) / (RESECTION.gross_share * width)
            # Robust cost that still prefers the more precise of two solutions, and at equal fit the
            # lens that is nearer to what is known.
            cost = float((np.minimum(share, 1.0) ** 2).sum())
            cost += 1e-6 * (np.log(factor) / interior.sigma_focal) ** 2
            if cost < best:
                best, camera, agree = cost, candidate, share < 1.0
    if camera is None or agree.sum() < 4:
        raise GeometryError(remark("resection.no_camera"))
    return camera, agree


def _candidates(
    xyz: FloatArray, pixels: FloatArray, matrix: FloatArray, generator: np.random.Generator
) -> list[Pinhole]:
    """Return cameras from all points and from small random subsets."""
    cameras = _solve(xyz, pixels, matrix)
    if len(xyz) >= 6:
        subsets = [generator.choice(len(xyz), 5, replace=False) for _ in range(12)]
    elif len(xyz) == 5:
        subsets = [np.delete(np.arange(5), index) for index in range(5)]
    else:
        subsets = []
    for subset in subsets:
        cameras += _solve(xyz[subset], pixels[subset], matrix)
    return cameras


def _solve(xyz: FloatArray, pixels: FloatArray, matrix: FloatArray) -> list[Pinhole]:
    """Return the solutions of one set of points in front of the wall."""
    solutions = cameras_seeing(xyz, pixels, matrix, methods=[cv2.SOLVEPNP_SQPNP])
    return [camera for camera in solutions if camera.centre[2] > 0]


def refuse_line(xyz: FloatArray) -> None:
    """Refuse fewer than four points, and such that lie (almost) on one line."""
    if len(xyz) < 4:
        raise GeometryError(remark("resection.few_points", count=len(xyz)))
    singular = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    if singular[1] <= 0.02 * singular[0]:
        raise GeometryError(remark("resection.one_line"))
