"""What the orientation's own covariance does to points: common to all of them, unlike their picks.

A pair file may carry the covariance of its cameras, as `bifocal align` found it; then every point,
map and report states what the whole measurement is worth, not the pick alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from bifocal.media import PLACING, MediaPath, PointViews, view
from multimedia import Layers
from photocore.arrays import FloatArray, as_floats, read_only
from photocore.camera import PARAMETERS, Pinhole, camera_matrix
from photocore.errors import InputError

#: What each camera's covariance counts: a pinhole's parameters and two terms of radial distortion.
CAMERA = (*PARAMETERS, "k1", "k2")
NAMES = tuple(f"{name} {number}" for number in (1, 2) for name in CAMERA)


class PlanePhoto(Protocol):
    """A photo as a homography with nadir and distance."""

    @property
    def plane_from_pixel(self) -> FloatArray:
        """Homography from pixels to the plane, shape (3, 3)."""

    @property
    def nadir(self) -> FloatArray:
        """Foot of the camera, shape (2,). [m]"""

    @property
    def distance(self) -> float:
        """Distance of the camera. [m]"""

    @property
    def media(self) -> MediaPath | None:
        """What lies between it and the plane; None in air."""


def common_names(layers: Layers | None) -> tuple[str, ...]:
    """Return the names of what both photos' media have in common, counted from the camera.

    Examples
    --------
    >>> common_names(Layers(indices=(1.0, 1.49, 1.337), thicknesses=(0.01,)))
    ('index1', 'index2', 'index3', 'thickness1')
    """
    return (
        ()
        if layers is None
        else (
            *(f"index{k}" for k in range(1, len(layers.indices) + 1)),
            *(f"thickness{k}" for k in range(1, len(layers.thicknesses) + 1)),
        )
    )


def names_of(layers: Layers | None, count: int = 2) -> tuple[str, ...]:
    """Return what the covariance of so many photos counts: cameras, through media also of them.

    Examples
    --------
    >>> names_of(None) == NAMES, names_of(None, 3)[-1]
    (True, 'k2 3')
    """
    common, numbers = common_names(layers), range(1, count + 1)
    cameras = tuple(f"{name} {number}" for number in numbers for name in CAMERA)
    placing = (f"{name} {number}" for number in numbers for name in PLACING)
    return (*cameras, *common, *placing) if common else cameras


def pinhole(photo: PlanePhoto) -> Pinhole:
    """Return the camera that a homography, a nadir and a distance describe.

    Notes
    -----
    ``pixel ~ K R [e1 e2 -C] (X, Y, 1)``; K R follows from the homography's inverse, and an
    orthogonal decomposition splits it. Where rows count upwards with Y the photo is a mirror image:
    its camera matrix has a negative aspect, the rotation none.
    """
    centre = np.array([*photo.nadir, photo.distance])
    base = np.column_stack([np.eye(3)[:, :2], -centre])
    mapped = np.linalg.inv(photo.plane_from_pixel) @ np.linalg.inv(base)
    mapped /= np.cbrt(np.linalg.det(mapped))
    if mirrored := mapped[2, 2] > 0:  # else its camera would look away from the plane
        mapped = mapped * [[-1.0], [1.0], [-1.0]]
    # K R = (reversed QR of the transposed, reversed matrix), with a positive diagonal.
    base, triangle = np.linalg.qr(mapped[::-1].T)
    matrix, rotation = triangle.T[::-1, ::-1], base.T[::-1]
    sign = np.sign(np.diag(matrix))
    matrix, rotation = matrix * sign, rotation * sign[:, None]
    scale = matrix[2, 2]
    focal, aspect = matrix[0, 0] / scale, matrix[1, 1] / matrix[0, 0]
    ideal = camera_matrix(focal, aspect, *(matrix[:2, 2] / scale))
    ideal[0, 1] = matrix[0, 1] / scale  # a homography typed in may be skewed
    if mirrored:
        ideal[1] *= -1.0
    return Pinhole(ideal, rotation, centre)


def orientation_covariance(
    photos: Sequence[PlanePhoto], covariance: FloatArray, xyz: FloatArray
) -> FloatArray:
    """Return the covariance of points at fixed pixels from that of the orientation. [m²]

    Parameters
    ----------
    photos : sequence of photos
    covariance : ndarray, shape (k, k)
        Of `NAMES`, through media and of more photos of `names_of`.
    xyz : ndarray, shape (n, 3)
        Points. [m]

    Returns
    -------
    ndarray, shape (n, 3, 3)
        NaN where a point is.
    """
    jacobian = _by_orientation(photos, xyz)
    return np.asarray(jacobian @ covariance @ jacobian.transpose(0, 2, 1))


def orientation_effect(
    photos: Sequence[PlanePhoto], covariance: FloatArray, xyz: FloatArray
) -> FloatArray:
    """Return what independent errors of the orientation, of sigma 1, move each point by. [m]

    Parameters
    ----------
    photos, covariance, xyz
        As for `orientation_covariance`, which is the result times its transpose, point by point.

    Returns
    -------
    ndarray, shape (n, 3, k)
        NaN where a point is.
    """
    return np.asarray(_by_orientation(photos, xyz) @ independent(covariance))


def independent(covariance: FloatArray) -> FloatArray:
    """Return what independent errors of sigma 1 add to the parameters, (k, k): a root of it."""
    scale = np.sqrt(np.diag(covariance))
    safe = np.where(scale > 0, scale, 1.0)
    # As a correlation: radians, metres and pixels differ by many powers of ten.
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    return np.asarray(safe[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _by_orientation(photos: Sequence[PlanePhoto], xyz: FloatArray) -> FloatArray:
    """Return the derivative of points at fixed pixels by the orientation, shape (n, 3, k).

    Notes
    -----
    The pixels p of a point P in cameras c stay: ``A dP = -dp/dc dc`` by least squares with
    ``A = dp/dP``, so ``J = -(AᵀA)⁻¹Aᵀ dp/dc``.
    """
    design, by_camera = pixel_rates(photos, xyz)
    finite = np.isfinite(design).all(axis=(1, 2))
    out = np.full((len(xyz), 3, by_camera.shape[2]), np.nan)
    out[finite] = -np.linalg.pinv(design[finite]) @ by_camera[finite]
    return out


def pixel_rates(photos: Sequence[PlanePhoto], xyz: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how the pixels of points in m photos move with the points and with the orientation.

    Returns
    -------
    by_point : ndarray, shape (n, 2 m, 3)
    by_orientation : ndarray, shape (n, 2 m, k)
        By what `names_of` counts. NaN where a photo does not see the point.
    """
    by_point, by_orientation = [], []
    for number, photo in enumerate(photos):
        camera = pinhole(photo)
        points = view(camera, photo.media, xyz)
        # Straightened by 1 / (1 + k1 rho² + k2 rho⁴), ideal pixels move inwards.
        away = points.pixels - camera.matrix[:2, 2]
        square = (away**2).sum(axis=1, keepdims=True) / camera.matrix[0, 0] ** 2
        radial = np.stack([away * square, away * square**2], axis=2)
        by_point.append(points.by_point)
        by_orientation.append(rates_of(points, radial, number, len(photos)))
    return np.concatenate(by_point, axis=1), np.concatenate(by_orientation, axis=1)


def rates_of(views: PointViews, radial: FloatArray, number: int, photos: int = 2) -> FloatArray:
    """Return how the pixels of one camera move with all that `names_of` counts, (n, 2, k).

    Parameters
    ----------
    views : PointViews
        Of that camera.
    radial : ndarray, shape (n, 2, 2)
        By its two terms of radial distortion.
    number, photos : int
        Of the camera, from 0, and how many there are.
    """
    placing, cameras = len(PLACING), photos * len(CAMERA)
    common = max(views.by_media.shape[2] - placing, 0)
    count = cameras + common + (photos * placing if common else 0)
    rates = np.zeros((*views.pixels.shape, count))
    first, last = number * len(CAMERA), cameras + common + number * placing
    rates[..., first : first + len(PARAMETERS)] = views.by_camera
    rates[..., first + len(PARAMETERS) : first + len(CAMERA)] = radial
    rates[..., cameras : cameras + common] = views.by_media[..., :common]
    rates[..., last : last + placing] = views.by_media[..., common:]
    return rates


def of_distances(d1: float, d2: float, sigma: float) -> FloatArray:
    """Return the covariance of distances known to their sigma, at scales that are exact.

    Parameters
    ----------
    d1, d2 : float
        Distances of both cameras. [m]
    sigma : float
        Standard deviation of either. [m]

    Returns
    -------
    ndarray, shape (24, 24)
        Of `NAMES`.

    Notes
    -----
    The scales on the wall are what a bifocal set-up is made for: an error of a distance alone turns
    into one of the principal distance beside it, ``d(ln f) = dZ / Z``.
    """
    covariance = np.zeros((len(NAMES), len(NAMES)))
    for number, distance in ((1, d1), (2, d2)):
        row = np.zeros(len(NAMES))
        row[NAMES.index(f"Z {number}")] = 1.0
        row[NAMES.index(f"focal length {number}")] = 1.0 / distance
        covariance += sigma**2 * np.outer(row, row)
    return covariance


def exchanged(covariance: FloatArray) -> FloatArray:
    """Return the covariance of a pair with both cameras exchanged."""
    return of_photos(covariance, (1, 0), 2)


def of_photos(covariance: FloatArray, numbers: Sequence[int], count: int) -> FloatArray:
    """Return the covariance of some of ``count`` photos, counted from 0, in their order."""
    size, rest = len(CAMERA), np.arange(count * len(CAMERA), len(covariance))
    order = [np.arange(size) + number * size for number in numbers]
    if len(rest):  # what the media have in common stays, what places them goes with its camera
        common, placing = np.split(rest, [-count * len(PLACING)])
        order += [common, *(placing.reshape(count, -1)[number] for number in numbers)]
    chosen = np.concatenate(order)
    return covariance[np.ix_(chosen, chosen)]


def moved(covariance: FloatArray, axes: FloatArray, count: int = 2) -> FloatArray:
    """Return the covariance of so many photos in a frame whose axes are the rows of ``axes``."""
    turn = np.eye(len(covariance))
    for number in range(count):
        for name in ("turn X", "X"):
            first = number * len(CAMERA) + CAMERA.index(name)
            turn[first : first + 3, first : first + 3] = axes
        if len(covariance) > count * len(CAMERA):  # the interfaces lean about the same axes
            first = len(covariance) - (count - 1 - number) * len(PLACING) - 3
            turn[first : first + 3, first : first + 3] = axes
    return turn @ covariance @ turn.T


def as_dict(
    covariance: FloatArray, layers: Layers | None = None, count: int = 2
) -> dict[str, object]:
    """Return what the file of a pair, or of ``count`` photos, holds under ``orientation``."""
    cameras, each = count * len(CAMERA), "either" if count == 2 else "each"
    names = names_of(layers if len(covariance) > cameras else None, count)
    units = f"ln, ln, px, px, rad, rad, rad, m, m, m, 1, 1 for {each} camera"
    if len(names) > cameras:
        units += f"; then 1 for indices, m for thicknesses; m, rad, rad, rad for {each} camera"
    return {"parameters": list(names), "units": units, "covariance": covariance}


def from_dict(data: Any, layers: Layers | None = None, count: int = 2) -> FloatArray:
    """Return the covariance that a file holds under ``orientation``, of ``count`` photos.

    Raises
    ------
    InputError
        If it is not one of `names_of` the photos, with or without their media, or no covariance.
    """
    stated = data.get("parameters") if isinstance(data, Mapping) else None
    possible = [list(names_of(media, count)) for media in (None, layers)]
    if not isinstance(stated, list) or stated not in possible:
        raise InputError(
            '"orientation": expected {"parameters": [...], "covariance": [[...]]} with the '
            f"{len(possible[1])} parameters that `bifocal align` writes; leave the key out if "
            "the orientation's precision is not known."
        )
    return checked(as_floats(data.get("covariance", ()), "orientation.covariance"), len(stated))


def checked_of(covariance: FloatArray, layers: Layers | None, count: int = 2) -> FloatArray:
    """Return a read-only covariance of so many photos, with or without their media's."""
    whole, size = len(names_of(layers, count)), len(names_of(None, count))
    return checked(covariance, whole if np.shape(covariance) == (whole, whole) else size)


def checked(covariance: FloatArray, size: int = len(NAMES)) -> FloatArray:
    """Return a read-only covariance of ``size`` parameters, refusing what is none."""
    matrix = read_only(covariance, "orientation", shape=(size, size))
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    largest = np.outer(scale, scale) + 1e-30
    wrong = (np.abs(matrix) > 1.001 * largest) | (np.abs(matrix - matrix.T) > 1e-6 * largest)
    if not np.isfinite(matrix).all() or (np.diag(matrix) < 0).any() or wrong.any():
        raise InputError('"orientation": the matrix is no covariance (symmetric, not negative).')
    return matrix
