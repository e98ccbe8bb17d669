"""A window of the orthophoto from one or both photos: visibility, choice, feathering, filling."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, cast

import cv2
import numpy as np
from numpy.typing import ArrayLike

from bifocal.faces.faced_surface import FacedSurface, beneath
from bifocal.faces.faces import Faces
from bifocal.model.grid import Bounds, Grid
from bifocal.model.image import ImageArray
from bifocal.model.pair import Pair
from bifocal.model.photo_set import PhotoSet
from bifocal.model.photos_of_set import PhotosOfSet
from bifocal.model.relief_map import Quality, ReliefMap
from bifocal.model.surface import FlatSurface, MapSurface, Surface
from bifocal.orthophotos.best_view import chosen
from bifocal.orthophotos.ortho_image import OrthoOptions, Orthophoto, Source
from bifocal.orthophotos.pull_push import fill_holes
from bifocal.orthophotos.rectify import SourcePhoto, footprint
from bifocal.orthophotos.tuning import COMPOSE, TIDYING
from bifocal.orthophotos.visibility import hidden_from, tidied
from bifocal.orthophotos.whole_picture import CompletedSurface
from bifocal.remarks import remark
from photocore.arrays import BoolArray, ByteArray, Float32Array
from photocore.errors import InputError


class Tile(NamedTuple):
    """A finished window: colours, where they come from, and what is hidden."""

    image: ImageArray
    source: ByteArray
    hidden: BoolArray


class _Look(NamedTuple):
    """A window as one photo sees it."""

    image: ImageArray
    inside: BoolArray
    hidden: BoolArray


def orthophoto(
    pair: Pair | PhotoSet,
    image: ImageArray | Sequence[ImageArray],
    relief: ReliefMap | Surface | ArrayLike | None = None,
    *,
    faces: Faces | None = None,
    gsd: float | None = None,
    bounds: Bounds | None = None,
    source: int = 1,
    options: OrthoOptions | None = None,
) -> Orthophoto:
    """Return the orthophoto of a wall in memory.

    Every pixel is taken from the original photo in one step that joins relief, homography and
    lens distortion. The picture is whole unless asked for otherwise; its source says of each
    pixel what it rests on.

    Parameters
    ----------
    pair : Pair or PhotoSet
    image : ndarray, shape (h, w, 3) or (h, w), uint8 or uint16
        The photo, RGB. A sequence (image 1, image 2) renders from both: from the far photo
        wherever it sees the wall, else from the near one. Of a set all its photos, in its order:
        each pixel from the one that sees it best.
    relief : ReliefMap, Surface or float, optional
        Where the wall is; a number is a parallel plane, None the reference plane. [m]
    faces : Faces, optional
        Planes, edges and occluders that were drawn; relief obeys them at the orthophoto's pixels.
    gsd : float, optional
        Pixel size; by default that of the relief map, else of the photo in its middle. [m]
    bounds : tuple of float, optional
        xmin, ymin, xmax, ymax; by default the relief map's, else what the photo covers. [m]
    source : int
        1 if ``image`` is image 1 (default), 2 if it is image 2; unused for a sequence.
    options : OrthoOptions, optional
        Interpolation, mask, filling.

    Returns
    -------
    Orthophoto

    Raises
    ------
    InputError
        If the image is not a photo, or the relief map and the photo have nothing in common.
    GeometryError
        If the photo looks past the horizon and no ``bounds`` are given.

    Notes
    -----
    With an error sigma_m of matching, the orthophoto of image 1 is wrong by
    ``sigma_m d2 / (d1 - d2)`` whatever the distance from the nadir, that of image 2 by
    ``sigma_m d1 / (d1 - d2)``: image 1 is the one to project.

    Examples
    --------
    A photo square to a flat wall, 10 mm a pixel, comes back unchanged:

    >>> from bifocal import Photo
    >>> h = [[0.01, 0, -0.02], [0, -0.01, 0.01], [0, 0, 1]]
    >>> far = Photo(plane_from_pixel=h, nadir=(0, 0), distance=17.5)
    >>> near = Photo(plane_from_pixel=h, nadir=(0, 0), distance=9.5)
    >>> photo = np.arange(15, dtype=np.uint8).reshape(3, 5)
    >>> flat = orthophoto(Pair(image1=far, image2=near), photo)
    >>> bool((flat.image == photo).all()), round(flat.gsd, 9)
    (True, 0.01)
    """
    options = options or OrthoOptions()
    surface = as_surface(relief)
    if faces:
        surface = FacedSurface(surface, faces)
    if isinstance(pair, PhotoSet):
        pair, image = _of_set(pair, image)
    count = len(pair.photos) if isinstance(pair, PhotosOfSet) else 2
    if isinstance(image, np.ndarray):
        if source not in (1, 2):
            raise InputError(f"source: must be 1 or 2, got {source}.")
        images = {source: image}
    else:
        images = dict(enumerate(image, start=1))
        if len(images) != count:
            expected = "one photo or two" if count == 2 else f"{count} photos"
            raise InputError(f"image: expected {expected}, got {len(images)}.")
    for number, pixels in images.items():
        pair.photo(number).check_size(pixels.shape[1::-1], f"image {number}")
    first = min(images)
    height, width = images[first].shape[:2]
    grid = choose_grid(pair, first, (width, height), surface, gsd=gsd, bounds=bounds)
    views = [
        SourcePhoto.prepare(pair.photo(number), pixels, number=number, gsd=grid.gsd)
        for number, pixels in images.items()
    ]
    out = np.zeros((*grid.shape, *views[0].image.shape[2:]), views[0].image.dtype)
    marks = np.zeros(grid.shape, np.uint8)
    hidden = np.zeros(grid.shape, bool)
    for column, row, tile in render(views, surface, grid, options):
        cut = np.s_[row : row + tile.source.shape[0], column : column + tile.source.shape[1]]
        out[cut], marks[cut], hidden[cut] = tile
    if not marks.any():
        raise InputError(remark("ortho.nothing_in_common"))
    return Orthophoto(
        image=out, source=marks, hidden=hidden, plane_from_pixel=grid.plane_from_pixel
    )


def _of_set(
    photos: PhotoSet, image: ImageArray | Sequence[ImageArray]
) -> tuple[Pair, ImageArray | Sequence[ImageArray]]:
    """Return what renders a set, a set of two as its pair, and the images in its order."""
    if len(photos) > 2:
        return PhotosOfSet.of_set(photos), [image] if isinstance(image, np.ndarray) else image
    pair = photos.pair(0, 1)
    swapped = photos.photos[0].distance < photos.photos[1].distance
    return pair, image[::-1] if swapped and not isinstance(image, np.ndarray) else image


def as_surface(relief: ReliefMap | Surface | ArrayLike | None) -> Surface:
    """Return relief of any kind as a surface."""
    if relief is None:
        return FlatSurface()
    if hasattr(relief, "window") and hasattr(relief, "extremes"):
        return cast(Surface, relief)
    if hasattr(relief, "r") and hasattr(relief, "plane_from_pixel"):
        r = np.asarray(relief.r)
        # A map without sigma is taken as exact: it does not tell what the photos saw.
        measured = None
        if isinstance(relief, ReliefMap) and np.any(relief.sigma > 0):
            measured = relief.quality == Quality.MEASURED
        return MapSurface.of_array(r, Grid.from_affine(relief.plane_from_pixel, r.shape), measured)
    number = np.asarray(relief)
    if number.ndim != 0 or number.dtype.kind not in "fiu":
        raise InputError(remark("ortho.relief_or_number"))
    return FlatSurface(float(number))


def choose_grid(
    pair: Pair,
    number: int,
    size: tuple[int, int],
    surface: Surface,
    *,
    gsd: float | None,
    bounds: Bounds | None,
) -> Grid:
    """Return the grid asked for, by default the relief map's own, else that of the photo."""
    photo = pair.photo(number)
    under = beneath(surface)
    own = under.grid if isinstance(under, MapSurface) else None
    if own is not None and bounds is None and (gsd is None or gsd == own.gsd):
        return own
    if gsd is None:
        gsd = own.gsd if own is not None else photo.gsd(size)
    if bounds is None:
        bounds = own.bounds if own is not None else footprint(photo, size)
    return Grid.from_bounds(bounds, gsd=gsd)


def render(
    views: Sequence[SourcePhoto], surface: Surface, grid: Grid, options: OrthoOptions
) -> Iterator[tuple[int, int, Tile]]:
    """Yield (column, row, tile) of an orthophoto, each in memory that does not grow with it."""
    if not options.measured_only:
        surface = CompletedSurface(surface, grid)
    for column, row, window in grid.tiles(COMPOSE.tile):
        yield column, row, render_window(views, surface, window, options)


def render_window(
    views: Sequence[SourcePhoto], surface: Surface, window: Grid, options: OrthoOptions
) -> Tile:
    """Return one window of an orthophoto."""
    close = options.fill or not options.measured_only
    margin = COMPOSE.fill_reach if close else 0
    if options.mask_hidden:
        margin = max(margin, TIDYING.margin)
    if len(views) > 1:
        margin = max(margin, math.ceil(2 * options.feather))
    wide = window
    if margin:
        wide = window.window(
            -margin, -margin, window.width + 2 * margin, window.height + 2 * margin
        )
    relief = surface.window(wide)
    unknown = np.isnan(relief)
    if options.fill and unknown.any():
        # Where relief is unknown that of the surroundings shows the photo itself, slightly off.
        relief, _ = fill_holes(relief, ~unknown, unknown)
    looks = _looks(views, surface, wide, relief, options)
    looks = _past_occluders(views, looks, surface, wide)
    image, source = _choose(views, looks, wide, options)
    hidden: BoolArray = (source == Source.NONE) & np.logical_or.reduce([o.hidden for o in looks])
    if isinstance(surface, CompletedSurface):
        mark = surface.source(wide)
        estimated = (mark > 0) & (source > 0)
        source[estimated] = mark[estimated]
    if close:
        source[unknown & (source > 0)] = Source.FILLED
        # Holes lie within the photos' own area: the rim of the orthophoto is not extended.
        area = np.logical_or.reduce([look.inside for look in looks])
        image, source = _fill(image, source, area, relief)
    if margin:
        core = np.s_[margin : margin + window.height, margin : margin + window.width]
        image, source, hidden = image[core], source[core], hidden[core]
    return Tile(image, source, hidden)


def _looks(
    views: Sequence[SourcePhoto], surface: Surface, grid: Grid, relief: Float32Array,
    options: OrthoOptions,
) -> list[_Look]:  # fmt: skip
    """Return how photos see a window; of a pair the second only around what the first does not."""
    first = _look(views[0], surface, grid, relief, options)
    under = surface.surface if isinstance(surface, CompletedSurface) else surface
    drawn = isinstance(under, FacedSurface) and under.faces.occluders
    if len(views) != 2 or drawn or _second_is_finer(views, grid):
        return [first, *(_look(view, surface, grid, relief, options) for view in views[1:])]
    none = np.zeros(grid.shape, bool)
    second = _Look(np.zeros_like(first.image), none, none.copy())
    row, column = np.nonzero(~first.inside | first.hidden)
    if len(row):
        margin = TIDYING.margin + math.ceil(2 * options.feather)
        top, left = max(int(row.min()) - margin, 0), max(int(column.min()) - margin, 0)
        bottom, right = int(row.max()) + margin + 1, int(column.max()) + margin + 1
        cut = np.s_[top:bottom, left:right]
        height, width = relief[cut].shape
        part = grid.window(left, top, width, height)
        seen = _look(views[1], surface, part, np.ascontiguousarray(relief[cut]), options)
        second.image[cut], second.inside[cut], second.hidden[cut] = seen
    return [first, second]


def _second_is_finer(views: Sequence[SourcePhoto], grid: Grid) -> bool:
    """Return whether the second of two photos shows a window so much finer that it goes first."""
    middle = np.array([[grid.x0 + grid.gsd * grid.width / 2, grid.y0 - grid.gsd * grid.height / 2]])
    sizes = []
    for view in views:
        pixel = view.photo.pixels_from_plane(middle)
        sizes.append(math.sqrt(abs(float(np.linalg.det(view.photo.metres_per_pixel(pixel)[0])))))
    return sizes[1] < COMPOSE.finer * sizes[0]


def _look(
    view: SourcePhoto, surface: Surface, grid: Grid, relief: Float32Array, options: OrthoOptions
) -> _Look:
    column, row = view.pixel_map(grid, relief)
    inside = view.inside(column, row)
    if not inside.any():
        shape = (*grid.shape, *view.image.shape[2:])
        return _Look(np.zeros(shape, view.image.dtype), inside, np.zeros(grid.shape, bool))
    hidden = np.zeros(grid.shape, bool)
    if options.mask_hidden:
        hidden = tidied(hidden_from(surface, grid, view.photo.foot, relief)) & inside
    return _Look(view.sample(column, row, options.interpolation), inside, hidden)


def _past_occluders(
    views: Sequence[SourcePhoto], looks: list[_Look], surface: Surface, grid: Grid
) -> list[_Look]:
    """Return how photos see a window with what occluders cover hidden."""
    under = surface.surface if isinstance(surface, CompletedSurface) else surface
    if not isinstance(under, FacedSurface) or not under.faces.occluders:
        return looks
    covered = under.occluded(grid)
    first = next((view.photo.foot for view in views if view.number == 1), None)
    passed = []
    for view, look in zip(views, looks, strict=True):
        own = covered
        if view.number != 1:
            own = np.zeros(grid.shape, bool)
            if first is not None:
                own = under.occluded_in(grid, view.photo.foot, first)
        passed.append(look._replace(hidden=look.hidden | (own & look.inside)))
    return passed


def _choose(
    views: Sequence[SourcePhoto], looks: Sequence[_Look], grid: Grid, options: OrthoOptions
) -> tuple[ImageArray, ByteArray]:
    """Return colours and sources of a window: the better view, feathered where both see it."""
    usable = [look.inside & ~look.hidden for look in looks]
    if len(views) > 2:
        return chosen(views, [look.image for look in looks], usable, grid, options.feather)
    if len(views) == 1:
        source = np.where(usable[0], np.uint8(views[0].number), np.uint8(0))
        return _masked(looks[0].image, usable[0]), source
    share = _share_of_first(views, usable, grid, options.feather)
    source = np.where(share >= 1, np.uint8(Source.IMAGE_1), np.uint8(Source.BOTH))
    source[share <= 0] = Source.IMAGE_2
    source[~(usable[0] | usable[1])] = Source.NONE
    if not (source == Source.BOTH).any() and not (source == Source.IMAGE_2).any():
        return _masked(looks[0].image, usable[0]), source
    first, second = (look.image.astype(np.float32) for look in looks)
    weight = share.reshape(share.shape + (1,) * (first.ndim - 2)).astype(np.float32)
    mixed = second + (first - second) * weight
    image = np.rint(mixed).astype(looks[0].image.dtype)
    return _masked(image, source > 0), source


def _share_of_first(
    views: Sequence[SourcePhoto], usable: Sequence[BoolArray], grid: Grid, feather: float
) -> Float32Array:
    """Return the weight of the first view, 0..1."""
    first, second = usable
    if _second_is_finer(views, grid):
        return np.where(second, np.float32(0), np.float32(1))
    if feather == 0:
        return first.astype(np.float32)
    # The second fades in towards where it alone sees the wall, not towards any other rim.
    alone = second & ~first
    if not alone.any():
        return first.astype(np.float32)
    depth = cv2.distanceTransform((~alone).astype(np.uint8), cv2.DIST_L2, 3)
    share = np.clip(depth / np.float32(feather), 0, 1)
    return np.where(second & first, share, first.astype(np.float32)).astype(np.float32)


def _masked(image: ImageArray, keep: BoolArray) -> ImageArray:
    """Return the image with 0 where it is not to be kept."""
    return image if keep.all() else cv2.copyTo(image, keep.astype(np.uint8))


def _fill(
    image: ImageArray, source: ByteArray, area: BoolArray, relief: Float32Array
) -> tuple[ImageArray, ByteArray]:
    """Close holes within an area, with the colours of the surface behind, not of what hides it."""
    holes = (source == Source.NONE) & area
    if not holes.any():
        return image, source
    known = source > 0
    depth = np.where(holes & ~np.isnan(relief), relief, np.float32(-1e6))
    around = cv2.dilate(depth, np.ones((COMPOSE.fill_side, COMPOSE.fill_side), np.uint8))
    before = (around > -1e6) & (relief > around + np.float32(COMPOSE.before))
    image, done = fill_holes(image, known & ~before, holes)
    if (holes & ~done).any():
        # Nothing of the surface behind is in sight: better the colours of what hides it than none.
        image, rest = fill_holes(image, known | done, holes & ~done)
        done |= rest
    return image, np.where(done, np.uint8(Source.FILLED), source)
