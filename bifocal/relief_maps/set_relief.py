"""Dense relief of a pair, or of all useful pairs of a set, place by place of the wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import cv2
import numpy as np

from bifocal.faces.faced_surface import faced
from bifocal.faces.faces import Faces
from bifocal.model.grid import Bounds, Grid, bounds_of
from bifocal.model.image import as_grey
from bifocal.model.pair import Pair
from bifocal.model.photo import Photo
from bifocal.model.photo_set import WIDEST, PhotoSet, ray_angles
from bifocal.relief_maps.dense_matching import DenseRelief, pair_relief
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import common_bounds
from bifocal.relief_maps.fusion import PairRelief, fused
from bifocal.relief_maps.orientation_sigma import orientation_sigma
from bifocal.relief_maps.photo_evidence import Witness
from bifocal.relief_maps.seed import usual_range
from bifocal.relief_maps.turned_plane import TurnedPlane, steepness
from bifocal.remarks import remark
from photocore.arrays import ByteArray, Float32Array, FloatArray
from photocore.cli import Progress, no_progress
from photocore.errors import GeometryError, InputError
from photocore.large_photos import Pixels


@dataclass(frozen=True, slots=True, kw_only=True)
class PairingTuning:
    """Which pairs of a set measure a part of the wall."""

    #: Side of the windows in which a set's map is made: memory goes by it, not by the wall. [px]
    tile: int = 4096
    #: Pairs that measure a place: the best by geometry.
    #: Evidence: chosen: three photos make three.
    pairs: int = 3
    #: Places a side of a window at which pairs are judged.
    places: int = 24
    #: A pair is measured if it is among the best at more than this share of the places.
    least_share: float = 0.03
    #: Of two photos equally far from the wall one counts as farther by this share.
    #: Evidence: 0.01 mm at 10 m.
    farther: float = 1e-06
    #: Relief over a turned plane is so much less precise than its geometry promises.
    #: Evidence: façade 41 near the nadir: median 0.75 mm against 0.46 of a pair of the same
    #: geometry.
    turned: float = 1.6


PAIRING = PairingTuning()


#: Cameras whose base rises less from the plane, per length along it, stand beside each other.
_SIDEWAYS = 0.05


def dense_relief(
    pair: Pair | PhotoSet,
    image1: Pixels,
    image2: Pixels,
    *others: Pixels,
    gsd: float | None = None,
    bounds: Bounds | None = None,
    quality: str = "standard",
    relief_range: tuple[float, float] | None = None,
    faces: Faces | None = None,
    progress: Progress = no_progress,
) -> DenseRelief:
    r"""Measure the relief of everything both photos of a pair, or any two of a set, show.

    Parameters
    ----------
    pair : Pair or PhotoSet
        Geometry; registered, see Notes.
    image1, image2 : ndarray of uint8 or uint16, shape (height, width[, 3])
        Far and near photo as taken; lens distortion is removed on the way if the pair has lenses.
        Of a set all its photos, in its order.
    others : ndarray
        The third photo of a set and on.
    gsd : float, optional
        Pixel of the map; by default that of the far photo on the plane. [m] The photos are
        matched at half a coarser one, so it also costs detail and precision.
    bounds : tuple of float, optional
        X min, Y min, X max, Y max; by default all that both photos see of the plane. [m]
    quality : str
        ``fast`` matches at half the resolution and refines at the whole one, ``best`` matches
        also large photos at full resolution.
    relief_range : tuple of float, optional
        Least and greatest relief to expect; by default -36 % to +22 % of d2. [m]
    faces : Faces, optional
        Planes, edges and occluders that were drawn: the map obeys them exactly (`Quality.DRAWN`),
        and nothing else of it changes.
    progress : callable
        Told how far the work is.

    Returns
    -------
    DenseRelief
        A `ReliefMap` (``r``, ``sigma``, ``quality``, ``plane_from_pixel``) with diagnostics.

    Raises
    ------
    InputError
        If an image, the GSD, the bounds or the quality is unusable.
    GeometryError
        If the photos have no common area or do not fit each other.

    Notes
    -----
    On the plane photo 2 is a zoom of photo 1 by k(r) about one point e, whatever the offset of the
    cameras: ``q2 - e = k(r) (q1 - e)``. Flow along the radius from e gives k and so r; flow across
    it is known to be zero, so its local RMS is the matching precision, and

    .. math:: \sigma_r = \sigma_m B / s', \qquad B = d_1 d_2 / (d_1 - d_2).

    A relative scale error of the photos shifts all relief by B times that error and leaves no
    residual: the scale must come from control points or distances (`bifocal align`).

    Of a set each useful pair is measured alone. Where pairs agree, relief is their mean by what a
    pixel of parallax is worth; where they differ the photos decide, for what stands in front if it
    fits nearly as well, and what they cannot decide is unknown. What is hidden from one pair comes
    from another; HIDDEN is what fewer than two photos see. Sigma is as if the errors
    of all pairs were one.

    Examples
    --------
    >>> from bifocal import SAMPLE, read_image
    >>> photos = [read_image(SAMPLE / name) for name in ("far.jpg", "near.jpg")]
    >>> pair = Pair.read(SAMPLE / "facade.pair.json")
    >>> result = dense_relief(pair, *photos, gsd=0.06, bounds=(-3, -2, 3, 2))
    >>> result.shape, round(result.gsd, 6)
    ((67, 100), 0.06)
    """
    wishes = _Wishes(gsd, bounds, quality, relief_range)
    relief = _measured_relief(pair, (image1, image2, *others), wishes, progress)
    drawn, surface = faced(relief, faces)
    if surface is None or not surface.unplaced:
        return drawn
    names = ", ".join(surface.unplaced)
    return replace(drawn, notes=(*drawn.notes, remark("faces.unplaced", names=names)))


def _measured_relief(
    pair: Pair | PhotoSet, images: Sequence[Pixels], wishes: _Wishes, progress: Progress
) -> DenseRelief:
    """Return the relief as it is measured, before anything that was drawn."""
    if isinstance(pair, Pair) and len(images) == 2:
        return wishes.fulfilled(pair, images[0], images[1], progress)
    photos = PhotoSet.of(pair)
    if len(images) != len(photos):
        raise InputError(remark("relief.photos_missing", count=len(photos), given=len(images)))
    if len(photos) > 2:
        return _of_set(photos, images, wishes, progress)
    far, near = sorted((0, 1), key=lambda number: -photos.photos[number].distance)
    return wishes.fulfilled(photos.pair(far, near), images[far], images[near], progress)


class _Wishes(NamedTuple):
    """What `dense_relief` is asked for."""

    gsd: float | None
    bounds: Bounds | None
    quality: str
    relief_range: tuple[float, float] | None
    sideways: bool = False
    of_set: bool = False

    def fulfilled(
        self, pair: Pair, image1: Pixels, image2: Pixels, progress: Progress
    ) -> DenseRelief:
        """Return the relief of a pair."""
        return pair_relief(pair, image1, image2, progress=progress, **self._asdict())


class _Part(NamedTuple):
    """A window of the map and the pairs that are best there, far photo first."""

    grid: Grid
    pairs: tuple[tuple[int, int], ...]


def _of_set(
    photos: PhotoSet, images: Sequence[Pixels], wishes: _Wishes, progress: Progress
) -> DenseRelief:
    """Return the relief of three photos or more, window by window of the wall.

    Each window is measured by the pairs that are best there: what a place costs does not grow with
    the photos that do not see it.
    """
    greys = [as_grey(image, name) for image, name in zip(images, photos.names, strict=True)]
    for photo, grey in zip(photos.photos, greys, strict=True):
        photo.check_size(grey.shape[::-1], photo.name)
    grid = _grid(photos, greys, wishes)
    witnesses = [
        Witness.of(photo, grey, grid.gsd) for photo, grey in zip(photos.photos, greys, strict=True)
    ]
    parts = [
        _Part(part, _best_pairs(photos, greys, part)) for _, _, part in grid.tiles(PAIRING.tile)
    ]
    jobs = sum(len(part.pairs) for part in parts)
    bands = MapBands(
        np.full(grid.shape, np.nan, np.float32), np.full(grid.shape, np.nan, np.float32),
        np.zeros(grid.shape, np.uint8),
    )  # fmt: skip
    reliefs: dict[tuple[int, int], DenseRelief] = {}
    refused: dict[tuple[int, int], Exception] = {}
    done = 0
    for part in parts:
        maps = []
        for pair in part.pairs:
            try:
                relief, one = _measured(
                    photos, images, pair, part.grid, wishes, _within(progress, done, jobs)
                )
            except (GeometryError, InputError) as error:
                refused[pair] = error
            else:
                reliefs[pair] = relief
                maps.append(one)
            done += 1
        if maps:
            column, row = part.grid.whole_offset_in(grid) or (0, 0)
            cut = np.s_[row : row + part.grid.height, column : column + part.grid.width]
            bands.put(cut, fused(maps, witnesses, part.grid))
    if not reliefs:
        raise next(iter(refused.values()), GeometryError(remark("relief.nothing_in_common")))
    progress(1.0, 1.0)
    names = photos.names
    worst = max(reliefs.values(), key=lambda one: one.registration.systematic)
    judged = [one.registration.false_relief_per_scale for one in reliefs.values()]
    wide = all(one.registration.base for one in reliefs.values())
    registration = replace(
        worst.registration,
        false_relief_per_scale=min(judged),
        base=worst.registration.base if wide else 0.0,
    )
    return DenseRelief(
        r=bands.r, sigma=bands.sigma, quality=bands.quality, plane_from_pixel=grid.plane_from_pixel,
        registration=registration, working_gsd=worst.working_gsd,
        used=tuple((names[far], names[near]) for far, near in reliefs),
        notes=tuple(
            remark("relief.pair_left_out", far=names[far], near=names[near], why=str(error))
            for (far, near), error in refused.items() if (far, near) not in reliefs
        ),
    )  # fmt: skip


def _within(progress: Progress, done: int, jobs: int) -> Progress:
    """Return the progress of one job among others."""
    start = done

    def tell(done: float, total: float, what: str = "") -> None:
        progress((start + done / total) / jobs, 1.0, what)

    return tell


def _pair(photos: PhotoSet, far: int, near: int) -> Pair:
    """Return two photos as a pair, also if both stand equally far from the wall."""
    one, second = photos.photos[far], photos.photos[near]
    if one.distance == second.distance:
        farther = replace(one, distance=one.distance * (1 + PAIRING.farther))
        changed = (farther if number == far else p for number, p in enumerate(photos.photos))
        photos = replace(photos, photos=tuple(changed))
    return photos.pair(far, near)


def _grid(photos: PhotoSet, greys: Sequence[ByteArray], wishes: _Wishes) -> Grid:
    """Return the grid of the map: by default what any two photos see, at the best pair's pixel."""
    ranked = photos.pairs()
    first = ranked[0].far if ranked else 0
    gsd = wishes.gsd or photos.photos[first].gsd(greys[first].shape[::-1])
    bounds = wishes.bounds
    if bounds is None:
        boxes = []
        for far, near in combinations(range(len(photos)), 2):
            far, near = sorted((far, near), key=lambda number: -photos.photos[number].distance)
            try:
                shapes = (greys[far].shape, greys[near].shape)
                boxes.append(common_bounds(_pair(photos, far, near), shapes))
            except GeometryError:  # these two have nothing in common
                continue
        if not boxes:
            raise GeometryError(remark("relief.nothing_in_common"))
        bounds = bounds_of(np.array(boxes).reshape(-1, 2))
    return Grid.from_bounds(bounds, gsd=gsd)


def _best_pairs(
    photos: PhotoSet, greys: Sequence[ByteArray], part: Grid
) -> tuple[tuple[int, int], ...]:
    """Return the pairs that promise the best relief at places of a window, far photo first."""
    places = np.stack(
        np.meshgrid(*(np.linspace(0.5, side - 0.5, PAIRING.places) for side in part.shape[::-1])),
        axis=-1,
    ).reshape(-1, 2)
    xy = places * [part.gsd, -part.gsd] + [part.x0, part.y0]
    xyz0 = np.column_stack([xy, np.zeros(len(xy))])
    pixel = [_pixel(photo, grey, xy) for photo, grey in zip(photos.photos, greys, strict=True)]
    pairs, sigmas = [], []
    for one, second in combinations(range(len(photos)), 2):
        away = np.linalg.norm(_parallax(photos, one, second, xy), axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            sigma = np.hypot(pixel[one], pixel[second]) / away
        sigma[ray_angles(photos.photos[one], photos.photos[second], xyz0) > WIDEST] = np.inf
        sigma[~np.isfinite(sigma)] = np.inf
        pairs.append((one, second))
        sigmas.append(sigma)
    rank = np.argsort(np.argsort(sigmas, axis=0), axis=0)
    chosen = (rank < PAIRING.pairs) & np.isfinite(sigmas)
    useful = chosen.mean(axis=1) > PAIRING.least_share
    distance = [photo.distance for photo in photos.photos]
    return tuple(
        pair if distance[pair[0]] >= distance[pair[1]] else pair[::-1]
        for pair, use in zip(pairs, useful, strict=True) if use
    )  # fmt: skip


def _pixel(photo: Photo, grey: ByteArray, xy: FloatArray) -> FloatArray:
    """Return the side of a photo's pixel at places, infinite where it shows nothing. [m]"""
    pixels = photo.pixels_from_plane(xy)
    size = np.array(grey.shape[::-1])
    with np.errstate(invalid="ignore", divide="ignore"):
        inside = ((pixels >= -0.5) & (pixels <= size - 0.5)).all(axis=-1)
        inside &= photo.sees_ahead(xy, grey.shape)
        side = np.sqrt(np.abs(np.linalg.det(photo.metres_per_pixel(pixels))))
    return np.asarray(np.where(inside, side, np.inf))


def _parallax(photos: PhotoSet, first: int, second: int, xy: FloatArray) -> FloatArray:
    """Return how places part in two photos per metre of relief, (..., 2). [m/m]

    Eq. (1) at r = 0: a point is seen ``r (P - N) / d`` beside its place.
    """
    a, b = photos.photos[first], photos.photos[second]
    return np.asarray((xy - a.nadir) / a.distance - (xy - b.nadir) / b.distance)


def _measured(
    photos: PhotoSet, images: Sequence[Pixels], numbers: tuple[int, int], part: Grid,
    wishes: _Wishes, progress: Progress,
) -> tuple[DenseRelief, PairRelief]:  # fmt: skip
    """Return what a pair measures of a window, and that on the window's grid with its weight."""
    far, near = numbers
    pair, two = _pair(photos, far, near), (photos.photos[far], photos.photos[near])
    left, bottom, right, top = part.bounds
    middle = np.array([left + right, bottom + top]) / 2
    turn = None if pair.refracted else TurnedPlane.for_base(two, middle)
    sideways = steepness(two) < _SIDEWAYS
    wishes = wishes._replace(gsd=part.gsd, bounds=part.bounds, sideways=sideways, of_set=True)
    if turn is None:
        relief = wishes.fulfilled(pair, images[far], images[near], progress)
        bands = MapBands(relief.r, relief.sigma, relief.quality)
    else:
        reliefs = wishes.relief_range or usual_range(pair.d2)
        wishes = wishes._replace(bounds=turn.bounds(part.bounds, reliefs))
        turned = Pair(image1=turn.photo(two[0]), image2=turn.photo(two[1]))
        relief = wishes.fulfilled(turned, images[far], images[near], progress)
        bands = turn.brought_back(relief, part)
        bands = bands._replace(sigma=np.hypot(bands.sigma, orientation_sigma(pair, bands.r, part)))
    return relief, PairRelief(bands, _weight(photos, numbers, part, turn is not None))


def _weight(photos: PhotoSet, numbers: tuple[int, int], part: Grid, turned: bool) -> Float32Array:
    """Return one over the square of the relief that a pixel of parallax is worth. [1/m²]"""
    x, y = (np.linspace(0, side - 1, PAIRING.places) for side in part.shape[::-1])
    coarse = np.stack(np.meshgrid(part.x0 + x * part.gsd, part.y0 - y * part.gsd), axis=-1)
    square = np.zeros(coarse.shape[:2])
    for number in numbers:
        photo = photos.photos[number]
        pixels = photo.pixels_from_plane(coarse.reshape(-1, 2))
        with np.errstate(invalid="ignore", divide="ignore"):
            area = np.abs(np.linalg.det(photo.metres_per_pixel(pixels))).reshape(square.shape)
        square += np.nan_to_num(area, nan=1.0, posinf=1.0)
    size = (part.width, part.height)
    pixel = cv2.resize(square.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    xy = np.stack(np.meshgrid(part.columns_x, part.rows_y), axis=-1)
    away = (_parallax(photos, *numbers, xy) ** 2).sum(axis=-1)
    return np.asarray(away / pixel / (PAIRING.turned if turned else 1.0) ** 2, np.float32)
