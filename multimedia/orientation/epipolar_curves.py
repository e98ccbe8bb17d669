"""Epipolar curves through the media as polygons, and the candidates along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media import Camera, Media, as_media, project
from multimedia.orientation.object_rays import image_rays, refuse_curved_rays
from photocore.arrays import FloatArray, IntArray, as_points, positive
from photocore.errors import InputError

#: Intervals of the first look at a curve.
_COARSE = 4
#: Most vertices of a curve; a hundred intervals of a curve over a whole sensor are nanometres.
_MOST = 1025
#: Share of a ray by which its first vertex lies within the object's medium.
INSIDE = 1e-12
#: Distances worked out at a time when looking for candidates.
_CHUNK = 4_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EpipolarCurves:
    """Polygons in the second image.

    Attributes
    ----------
    image : ndarray, shape (..., k, 2)
        Vertices, from the near to the far end of the depth range; curves with fewer vertices
        than k repeat their last one. NaN where the second camera cannot see the ray. [mm]
    points : ndarray, shape (..., k, 3)
        The object point of each vertex. [object unit]
    counts : ndarray of int, shape (...)
        Number of different vertices.
    """

    image: FloatArray
    points: FloatArray
    counts: IntArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidates:
    """Image points of the second image near epipolar curves.

    Attributes
    ----------
    curves, targets : ndarray of int, shape (m,)
        Which curve and which image point; nearest first within each curve.
    distance : ndarray, shape (m,)
        Distance of the image point from the curve. [mm]
    points : ndarray, shape (m, 3)
        Object point of the foot on the curve, interpolated between vertices: good enough to
        sort candidates by depth; `intersect` gives the exact one. [object unit]
    """

    curves: IntArray
    targets: IntArray
    distance: FloatArray
    points: FloatArray


def epipolar_curve(
    camera: Camera,
    image_points: ArrayLike,
    other: Camera,
    media: Media | tuple[Media, Media] = None,
    *,
    z_range: tuple[float, float],
    chord_error: float = 5e-4,
    vertices: int | None = None,
) -> EpipolarCurves:
    """Return where the rays of image points run in another camera's image.

    Parameters
    ----------
    camera : Camera
        The camera of the image points.
    image_points : array_like, shape (..., 2)
        Measured image coordinates. [mm]
    other : Camera
        The camera in whose image the curves are wanted.
    media : Layers, FlatInterface, Interfaces, None, or a pair of these
        What both cameras look through, or each of them.
    z_range : tuple of float
        Planes Z = constant of the world between which the object lies. [object unit]
    chord_error : float
        Largest distance between curve and polygon. [mm]
    vertices : int, optional
        Fixed number of vertices, at equal steps of depth, instead of ``chord_error``.

    Returns
    -------
    EpipolarCurves
        Each vertex exactly on the curve.

    Raises
    ------
    InputError
        If the depth range is empty or the chord error not above zero.

    Notes
    -----
    Through refracting media the epipolar line is curved; Maas 1992 replaces it by a polygon
    through depth planes. In the object's medium the ray is straight, so its points at equal steps
    of depth, projected into the other image, are exact vertices. A coarse polygon gives the
    curvature; its second differences fall with the square of the step, which gives the number of
    vertices for the chord error asked for.

    Examples
    --------
    >>> from multimedia import Layers
    >>> left, right = (Camera.looking_at((x, 0, 0.5), (0, 0, -0.1), principal_distance=25.0)
    ...                for x in (-0.2, 0.2))
    >>> water = Layers(indices=(1.0, 1.337))
    >>> curve = epipolar_curve(left, (1.0, 2.0), right, water, z_range=(-0.2, -0.01))
    >>> curve.image.shape
    (4, 2)
    """
    measured = as_points(image_points, "image_points", dimension=2)
    first, second = media if isinstance(media, tuple) else (media, media)
    low, high = sorted(float(z) for z in z_range)
    if not (np.isfinite([low, high]).all() and high > low):
        raise InputError(f"z_range: {z_range} is no range of depths.")
    if vertices is not None and not 2 <= vertices <= _MOST:
        raise InputError(f"vertices: expected 2 to {_MOST}, found {vertices}.")
    positive(chord_error, "chord_error", unit="mm")
    second = as_media(second)
    refuse_curved_rays([as_media(first)], "epipolar")
    flat = measured.reshape(-1, 2)
    origins, directions = image_rays(camera, flat, first)
    near, far = _ends(origins, directions, low, high)
    if vertices is None:
        coarse = project(other, _between(near, far, _COARSE + 1), second)
        intervals = _intervals(coarse, chord_error)
    else:
        intervals = np.full(len(flat), vertices - 1)
    most = int(intervals.max(initial=1)) + 1
    points = np.full((len(flat), most, 3), np.nan)
    image = np.full((len(flat), most, 2), np.nan)
    for number in np.unique(intervals):
        rows = np.flatnonzero(intervals == number)
        some = _between(near[rows], far[rows], int(number) + 1)
        points[rows, : number + 1] = some
        image[rows, : number + 1] = project(other, some, second)
        points[rows, number + 1 :] = points[rows, number, None]
        image[rows, number + 1 :] = image[rows, number, None]
    shape = measured.shape[:-1]
    return EpipolarCurves(
        image=image.reshape(*shape, most, 2),
        points=points.reshape(*shape, most, 3),
        counts=(intervals + 1).astype(np.int64).reshape(shape),
    )


def epipolar_candidates(
    curves: EpipolarCurves, targets: ArrayLike, *, tolerance: float
) -> Candidates:
    """Return the image points that lie within a band along epipolar curves.

    Parameters
    ----------
    curves : EpipolarCurves
        Of n image points, arrays of shape (n, k, .) or, for one, (k, .).
    targets : array_like, shape (m, 2)
        Measured image points of the second image. [mm]
    tolerance : float
        Half the width of the band; the ends of a curve are extended by it too. [mm]

    Returns
    -------
    Candidates

    Examples
    --------
    >>> line = EpipolarCurves(image=np.array([[0.0, 0.0], [10.0, 0.0]]),
    ...                       points=np.array([[0.0, 0, -1], [0, 0, -2]]), counts=np.array(2))
    >>> near = epipolar_candidates(line, [(5.0, 0.02), (5.0, 1.0)], tolerance=0.05)
    >>> near.targets.tolist(), near.points.tolist()
    ([0], [[0.0, 0.0, -1.5]])
    """
    positive(tolerance, "tolerance", unit="mm")
    pixels = as_points(targets, "targets", dimension=2).reshape(-1, 2)
    polygons = curves.image.reshape(-1, *curves.image.shape[-2:])
    points = curves.points.reshape(-1, *curves.points.shape[-2:])
    size = max(1, _CHUNK // max(1, len(pixels) * (polygons.shape[1] - 1)))
    parts = [
        _near(polygons[k : k + size], points[k : k + size], pixels, tolerance, k)
        for k in range(0, len(polygons), size)
    ]
    names = Candidates.__slots__
    return Candidates(**{k: np.concatenate([getattr(part, k) for part in parts]) for k in names})


def _ends(
    origins: FloatArray, directions: FloatArray, low: float, high: float
) -> tuple[FloatArray, FloatArray]:
    """Return where rays enter and leave the depth range; NaN if they do not cross it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one = (low - origins[:, 2]) / directions[:, 2]
        two = (high - origins[:, 2]) / directions[:, 2]
        # A ray starts where it enters the object's medium, even within the range.
        start, end = np.maximum(np.minimum(one, two), 0.0), np.maximum(one, two)
        end = np.where(np.isfinite(end) & (end > start), end, np.nan)
        # Just beyond the interface: on it, rounding decides on which side a point lies.
        start = np.maximum(start, INSIDE * end)
    return origins + start[:, None] * directions, origins + end[:, None] * directions


def _between(near: FloatArray, far: FloatArray, count: int) -> FloatArray:
    """Return points at equal steps from near to far, shape (n, count, 3)."""
    share = np.linspace(0.0, 1.0, count)[:, None]
    return near[:, None] * (1.0 - share) + far[:, None] * share


def _intervals(coarse: FloatArray, chord_error: float) -> IntArray:
    """Return how many intervals keep the polygon within the chord error of the curve."""
    second = coarse[:, :-2] - 2.0 * coarse[:, 1:-1] + coarse[:, 2:]
    along = coarse[:, 2:] - coarse[:, :-2]
    length = np.hypot(along[..., 0], along[..., 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        across = np.abs(second[..., 0] * along[..., 1] - second[..., 1] * along[..., 0]) / length
    # Where the ray points at the other camera the curve shrinks to a point.
    across = np.where(length > 0, across, np.hypot(second[..., 0], second[..., 1]))
    across = np.nan_to_num(across, nan=0.0)
    # The curvature may grow beyond the outermost vertices it is measured at.
    ends = [2.0 * across[:, 0] - across[:, 1], 2.0 * across[:, -1] - across[:, -2]]
    bend = np.maximum(across.max(axis=1, initial=0.0), np.maximum(*ends))
    # Chord error = (second difference) / 8 at this step, and it falls with the step squared; a
    # seventh in reserve for what the coarse polygon does not show.
    count = _COARSE * np.sqrt(1.15 * bend / (8.0 * chord_error))
    return np.clip(np.ceil(count), 2, _MOST - 1).astype(np.int64)


def _near(
    polygons: FloatArray, points: FloatArray, targets: FloatArray, tolerance: float, first: int
) -> Candidates:
    """Return the candidates of some curves."""
    start, along = polygons[:, :-1], np.diff(polygons, axis=1)
    square = np.einsum("nki,nki->nk", along, along)
    offset = targets[None, :, None, :] - start[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.einsum("nmki,nki->nmk", offset, along) / square[:, None]
        share = np.clip(np.where(square[:, None] > 0, share, 0.0), 0.0, 1.0)
        gap = offset - share[..., None] * along[:, None]
        distance = np.sqrt(np.einsum("nmki,nmki->nmk", gap, gap))
    distance = np.where(np.isnan(distance), np.inf, distance)
    segment = distance.argmin(axis=2)
    least = np.take_along_axis(distance, segment[..., None], axis=2)[..., 0]
    curve, target = np.nonzero(least <= tolerance)
    order = np.lexsort((least[curve, target], curve))
    curve, target = curve[order], target[order]
    place = segment[curve, target]
    part = share[curve, target, place][:, None]
    foot = points[curve, place] * (1.0 - part) + points[curve, place + 1] * part
    return Candidates(
        curves=(curve + first).astype(np.int64),
        targets=target.astype(np.int64),
        distance=least[curve, target],
        points=foot,
    )
