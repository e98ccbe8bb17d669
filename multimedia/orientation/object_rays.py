"""Image points to rays in the object's medium, and their linear intersection."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media import Camera, Media, OpticalMedia, as_media
from multimedia.remarks import remark
from photocore.arrays import BoolArray, FloatArray, as_points
from photocore.compiled import inlined
from photocore.errors import InputError


def image_rays(
    camera: Camera, image_points: ArrayLike, media: Media = None
) -> tuple[FloatArray, FloatArray]:
    """Follow image points through the media into the object's medium.

    Parameters
    ----------
    camera : Camera
        Exterior and interior orientation.
    image_points : array_like, shape (..., 2)
        Measured image coordinates. [mm]
    media : Layers, FlatInterface, Interfaces or None
        As for `project`.

    Returns
    -------
    origins : ndarray, shape (..., 3)
        Where the rays enter the object's medium, in the world. [object unit]
    directions : ndarray, shape (..., 3)
        Unit vectors there. NaN for rays that do not reach it.

    Notes
    -----
    Snell's law in closed form: no iteration.

    Examples
    --------
    45 degrees in air are 32.04 degrees in water of index 1.3329:

    >>> from multimedia import Layers
    >>> camera = Camera.from_angles((0, 0, 1), 0.0, 0.0, 0.0, principal_distance=25.0)
    >>> origin, ray = image_rays(camera, (25.0, 0.0), Layers(indices=(1.0, 1.3329)))
    >>> origin.round(9).tolist(), round(float(np.degrees(np.arcsin(ray[0]))), 2)
    ([1.0, 0.0, 0.0], 32.04)
    """
    measured = as_points(image_points, "image_points", dimension=2)
    ideal = camera.ideal(measured).reshape(-1, 2)
    directions: FloatArray = np.empty((len(ideal), 3))
    directions[:, :2] = ideal
    directions[:, 2] = -camera.principal_distance
    shape = (*measured.shape[:-1], 3)
    origins, rays = as_media(media).object_rays(camera, directions)
    return origins.reshape(shape), rays.reshape(shape)


def refuse_curved_rays(media: Sequence[OpticalMedia], what: str) -> None:
    """Refuse media in which what takes rays for straight lines would be wrong.

    Raises
    ------
    InputError
        If the index changes with depth.
    """
    if any(item.curves_in_object for item in media):
        raise InputError(remark("rays.curved", of=what))


def nearest_points(origins: Sequence[FloatArray], directions: Sequence[FloatArray]) -> FloatArray:
    """Return the points nearest to all rays, least squares of the distances, shape (n, 3).

    NaN rays do not count; NaN where fewer than two remain or all are parallel.

    Notes
    -----
    Normal equations sum(I - d d^T) X = sum((I - d d^T) o), solved in closed form.
    """
    n = len(origins[0])
    normal, right = np.zeros((6, n)), np.zeros((3, n))
    for origin, direction in zip(origins, directions, strict=True):
        finite = np.isfinite(direction[:, 0])
        use: slice | BoolArray = slice(None) if finite.all() else finite
        o, d = origin[use], direction[use]
        x, y, z = d.T
        part = np.stack([1 - x * x, -x * y, -x * z, 1 - y * y, -y * z, 1 - z * z])
        along = np.einsum("ni,ni->n", o, d)
        normal[:, use] += part
        right[:, use] += (o - along[:, None] * d).T
    return np.stack(times.plain(inverse_3x3(normal), right), axis=-1)


@inlined
def cofactors(xx: Any, xy: Any, xz: Any, yy: Any, yz: Any, zz: Any) -> tuple[Any, Any, Any]:
    """Return adjugate and determinant of symmetric 3 x 3 matrices, and whether they are regular."""
    first = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    rest = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    determinant = xx * first[0] + xy * first[1] + xz * first[2]
    # Singular when the determinant is rounding of its own terms.
    return first + rest, determinant, determinant > 1e-13 * (xx * yy * zz)


@inlined
def times(inverse: Any, right: Any) -> tuple[Any, Any, Any]:
    """Return symmetric matrices, as rows xx, xy, xz, yy, yz, zz, times vectors."""
    xx, xy, xz, yy, yz, zz = inverse
    a, b, c = right
    return xx * a + xy * b + xz * c, xy * a + yy * b + yz * c, xz * a + yz * b + zz * c


def inverse_3x3(normal: FloatArray) -> FloatArray:
    """Return the inverses of symmetric 3 x 3 matrices, as rows xx, xy, xz, yy, yz, zz."""
    adjugate, determinant, regular = cofactors.plain(*normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack(adjugate) / np.where(regular, determinant, np.nan)


def largest_angle(directions: Sequence[FloatArray]) -> FloatArray:
    """Return the largest angle between two rays of each point; NaN with fewer than two."""
    widest = np.full(len(directions[0]), np.nan)
    for one, two in combinations(directions, 2):
        # The chord keeps small angles exact where the cosine would lose them.
        gap = one - two
        chord = np.sqrt(np.einsum("ni,ni->n", gap, gap))
        widest = np.fmax(widest, chord)
    return 2.0 * np.arcsin(np.minimum(0.5 * widest, 1.0))
