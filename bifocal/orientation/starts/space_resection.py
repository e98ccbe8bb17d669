"""First camera of a photo from control points: where it stood, which way it looked, its lens."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model.interior_orientation import Interior
from photocore.arrays import BoolArray, FloatArray
from photocore.camera.pinhole import Pinhole, camera_matrix, cameras_seeing, project
from photocore.errors import GeometryError

#: Picks that miss by more than this share of the image width are gross, whatever the lens.
GROSS_SHARE = 0.006


def resect(xyz: FloatArray, pixels: FloatArray, interior: Interior) -> tuple[Pinhole, BoolArray]:
    """Return an approximate camera and which points agree with it.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Control points. [m]
    pixels : ndarray, shape (n, 2)
        Their ideal pixels.
    interior : Interior
        What is known of the lens. An unknown principal distance is searched over a wide range.

    Returns
    -------
    camera : Pinhole
    agree : ndarray of bool, shape (n,)

    Raises
    ------
    GeometryError
        With fewer than four points, or points in line, or none that agree.
    """
    if len(xyz) < 4:
        raise GeometryError(
            f"{len(xyz)} control points with X, Y and pixels in this photo; a camera needs four, "
            "and nine are advised."
        )
    _refuse_line(xyz)
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
            share = np.nan_to_num(misfit, nan=1e6) / (GROSS_SHARE * width)
            # Robust cost that still prefers the more precise of two solutions, and at equal fit the
            # lens that is nearer to what is known.
            cost = float((np.minimum(share, 1.0) ** 2).sum())
            cost += 1e-6 * (np.log(factor) / interior.sigma_focal) ** 2
            if cost < best:
                best, camera, agree = cost, candidate, share < 1.0
    if camera is None or agree.sum() < 4:
        raise GeometryError(
            "no camera fits four of the control points. Check that their pixels belong to the "
            "right photo and the right point, that Y points up, and that all are in metres."
        )
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
    found = cameras_seeing(xyz, pixels, matrix, methods=[cv2.SOLVEPNP_SQPNP])
    return [camera for camera in found if camera.centre[2] > 0]


def _refuse_line(xyz: FloatArray) -> None:
    """Refuse points that lie (almost) on one line."""
    singular = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    if singular[1] < 0.02 * singular[0]:
        raise GeometryError(
            "the control points lie on one line; choose them spread over the whole wall."
        )
