"""A window of the orthophoto from one or more photos: visibility, choice, feathering, holes."""

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
from bifocal.model.surface import FlatSurface, MapSurface, Surface, measured_on
from bifocal.orthophotos.best_view import chosen
from bifocal.orthophotos.holes import close_holes, grown
from bifocal.orthophotos.moved_things import MovedThing, moved_things
from bifocal.orthophotos.ortho_image import OrthoOptions, Orthophoto, Source
from bifocal.orthophotos.pull_push import fill_holes
from bifocal.orthophotos.rectify import SourcePhoto, footprint
from bifocal.orthophotos.tuning import COMPOSE, GAPS, HOLES, TIDYING
from bifocal.orthophotos.visibility import hidden_from, tidied
from bifocal.orthophotos.whole_picture import CompletedSurface, completed
from bifocal.remarks import remark
from photocore.arrays import BoolArray, ByteArray, Float32Array
from photocore.errors import InputError
from photocore.large_photos import LargePhoto, Pixels


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
    #: Of a second photo, what is taken from it.
    taken: BoolArray = np.zeros(0, bool)


def orthophoto(
    pair: Pair | PhotoSet,
    image: Pixels | Sequence[Pixels],
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
    image : ndarray, shape (h, w, 3) or (h, w), uint8 or uint16; or LargePhoto
        The photo, RGB. A sequence (image 1, image 2) renders from both: from the far photo
        wherever it sees the wall; the near one closes gaps beside which relief was measured and
        both photos agree. Of a set all its photos, in its order: each pixel from the one that
        sees it best.
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
    alone = isinstance(image, np.ndarray | LargePhoto)
    photos: Sequence[Pixels] = [image] if isinstance(image, np.ndarray | LargePhoto) else image
    if isinstance(pair, PhotoSet):
        pair, photos = _of_set(pair, photos)
        alone &= not isinstance(pair, PhotosOfSet)
    count = len(pair.photos) if isinstance(pair, PhotosOfSet) else 2
    if alone:
        if source not in (1, 2):
            raise InputError(f"source: must be 1 or 2, got {source}.")
        images = {source: photos[0]}
    else:
        images = dict(enumerate(photos, start=1))
        if len(images) != count:
            expected = "one photo or two" if count == 2 else f"{count} photos"
            raise InputError(f"image: expected {expected}, got {len(images)}.")
    for number, pixels in images.items():
        pair.photo(number).check_size((pixels.shape[1], pixels.shape[0]), f"image {number}")
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


def _of_set(photos: PhotoSet, images: Sequence[Pixels]) -> tuple[Pair, Sequence[Pixels]]:
    """Return what renders a set, a set of two as its pair, and the images in its order."""
    if len(photos) > 2:
        return PhotosOfSet.of_set(photos), images
    pair = photos.pair(0, 1)
    swapped = photos.photos[0].distance < photos.photos[1].distance
    return pair, images[::-1] if swapped else images


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
    map_grid = under.grid if isinstance(under, MapSurface) else None
    if map_grid is not None and bounds is None and (gsd is None or gsd == map_grid.gsd):
        return map_grid
    if gsd is None:
        gsd = map_grid.gsd if map_grid is not None else photo.gsd(size)
    if bounds is None:
        bounds = map_grid.bounds if map_grid is not None else footprint(photo, size)
    return Grid.from_bounds(bounds, gsd=gsd)


def render(
    views: Sequence[SourcePhoto], surface: Surface, grid: Grid, options: OrthoOptions,
    moved: list[MovedThing] | None = None,
) -> Iterator[tuple[int, int, Tile]]:  # fmt: skip
    """Yield (column, row, tile) of an orthophoto, each in memory that does not grow with it.

    What moved between two photos is listed in ``moved`` before the first.
    """
    things: tuple[MovedThing, ...] = ()
    if not options.measured_only:
        surface = completed(surface, grid, views[0].photo, views[0].photo.gsd(views[0].size))
        if len(views) == 2 and not isinstance(surface, FlatSurface):
            things = moved_things(views, surface, grid)
    if moved is not None:
        moved.extend(things)
    for column, row, window in grid.tiles(COMPOSE.tile):
        yield column, row, render_window(views, surface, window, options, things)


def render_window(
    views: Sequence[SourcePhoto], surface: Surface, window: Grid, options: OrthoOptions,
    moved: Sequence[MovedThing] = (),
) -> Tile:  # fmt: skip
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
    place = _Place(surface, wide, relief)
    alone = views[:1] if len(views) == 2 else views
    looks = [place.look(view, options, views[0]) for view in alone]
    if len(views) == 2:
        looks.append(_closing_gaps(views, looks[0], place, options, moved))
    image, source = _choose(views, looks, wide, options)
    hidden: BoolArray = (source == Source.NONE) & np.logical_or.reduce([o.hidden for o in looks])
    if isinstance(surface, CompletedSurface):
        mark = surface.source(wide)
        estimated = (mark > 0) & (source > 0)
        source[estimated] = mark[estimated]
    if close:
        source[unknown & (source > 0)] = Source.FILLED
        # Holes lie within the photos' own area: the rim of the orthophoto is not extended.
        holes = (source == Source.NONE) & np.logical_or.reduce([look.inside for look in looks])
        largest = math.inf if options.fill else HOLES.largest
        if holes.any():
            image = np.array(image)
            close_holes(image, source, holes, relief, wide.gsd, largest=largest)
    if margin:
        core = np.s_[margin : margin + window.height, margin : margin + window.width]
        image, source, hidden = image[core], source[core], hidden[core]
    return Tile(image, source, hidden)


class _Place(NamedTuple):
    """A window of the wall."""

    surface: Surface
    grid: Grid
    relief: Float32Array

    def part(self, box: tuple[slice, slice]) -> _Place:
        """Return a part of it, by rows and columns."""
        rows, columns = box
        width, height = columns.stop - columns.start, rows.stop - rows.start
        grid = self.grid.window(columns.start, rows.start, width, height)
        return _Place(self.surface, grid, np.ascontiguousarray(self.relief[box]))

    def look(self, view: SourcePhoto, options: OrthoOptions, first: SourcePhoto) -> _Look:
        """Return how a photo sees it; what occluders cover is hidden."""
        column, row = view.pixel_map(self.grid, self.relief)
        inside = view.inside(column, row)
        hidden = np.zeros(self.grid.shape, bool)
        if not inside.any():
            shape = (*self.grid.shape, *view.image.shape[2:])
            return _Look(np.zeros(shape, view.image.dtype), inside, hidden)
        if options.mask_hidden:
            hidden = hidden_from(self.surface, self.grid, view.photo.foot, self.relief)
            # Of a whole picture a shadow narrower than this is drawn, a little stretched.
            widest = 0.0 if options.measured_only else TIDYING.sliver * view.photo.gsd(view.size)
            hidden = tidied(hidden, max(3, int(widest / self.grid.gsd) | 1)) & inside
        if (covered := self.covered(view, first)) is not None:
            hidden = hidden | (covered & inside)
        return _Look(view.sample(column, row, options.interpolation), inside, hidden)

    def covered(self, view: SourcePhoto, first: SourcePhoto) -> BoolArray | None:
        """Return what drawn occluders cover in a photo; None without any."""
        surface = self.surface
        under = surface.surface if isinstance(surface, CompletedSurface) else surface
        if not isinstance(under, FacedSurface) or not under.faces.occluders:
            return None
        if view.number == 1:
            return under.occluded(self.grid)
        if first.number != 1:
            return None
        return under.occluded_in(self.grid, view.photo.foot, first.photo.foot)


def _closing_gaps(
    views: Sequence[SourcePhoto], first: _Look, place: _Place, options: OrthoOptions,
    moved: Sequence[MovedThing],
) -> _Look:  # fmt: skip
    """Return what the second of two photos shows of a window where it closes gaps of the first.

    A gap within the first photo is closed if at least half of its rim was measured, and both
    photos look alike there. Relief behind a step is a guess, and so is whether the second photo
    sees it: not backed by a rim, most of what it would show is wrong. Beyond the first photo's
    own edge the second goes on; behind drawn occluders it is what was asked for, as where
    something stood in the first photo only.
    """
    surface, grid, relief = place
    empty = np.zeros(grid.shape, bool)
    second = _Look(np.zeros_like(first.image), empty, empty.copy(), empty.copy())
    gaps, free = ~first.inside | first.hidden, ~first.inside
    if (covered := place.covered(views[0], views[0])) is not None:
        free |= covered
    things = empty.copy()
    for thing in moved:
        if thing.drawn_from_second and (mask := thing.on(grid)) is not None:
            things |= mask
    gaps, free = gaps | things, free | things
    if not gaps.any():
        return second
    measured = measured_on(surface, grid)
    usable = first.inside & ~first.hidden
    # What lies beyond the first photo is one part, lest it join the gaps that reach its edge.
    inner = (gaps & first.inside).astype(np.uint8)
    _, label, stats, _ = cv2.connectedComponentsWithStats(inner, connectivity=8)
    boxes = [(int(c), int(r), int(wide), int(high)) for c, r, wide, high, _ in stats[1:]]
    if not first.inside.all():
        label[~first.inside] = len(stats)
        column, row, wide, high = cv2.boundingRect((~first.inside).astype(np.uint8))
        boxes.append((column, row, wide, high))
    ring = np.ones((2 * GAPS.rim + 1,) * 2, np.uint8)
    for number, bounds in enumerate(boxes, start=1):
        box = grown(bounds, TIDYING.margin, grid.shape)
        gap = label[box] == number
        region = gap & free[box]
        heights = relief[box][gap & np.isfinite(relief[box])]
        level = np.median(heights) + np.float32(GAPS.before) if heights.size else -np.inf
        rim = (cv2.dilate(gap.astype(np.uint8), ring) > 0) & usable[box] & (relief[box] < level)
        backed = rim if measured is None else rim & measured[box]
        anchored = backed.any() and backed.sum() >= GAPS.measured * rim.sum()
        if not (anchored or region.any()):
            continue
        look = place.part(box).look(views[1], options, views[0])
        sees = look.inside & ~look.hidden
        if anchored and _alike(first.image[box], look.image, backed & sees, views[0], grid.gsd):
            region = gap
        second.image[box], second.inside[box] = look.image, second.inside[box] | look.inside
        second.hidden[box] |= look.hidden
        # Of a thing that moved the relief is no wall's, nor is what it would hide.
        second.taken[box] |= region & (sees | (things[box] & look.inside))
    return second


def _alike(
    first: ImageArray, second: ImageArray, where: BoolArray, view: SourcePhoto, gsd: float
) -> bool:
    """Return whether two photos show one surface at some pixels, beyond noise and half a pixel."""
    if not where.any():
        return False
    blur = GAPS.blur * max(view.photo.gsd(view.size) / gsd, 1.0)
    smooth = [cv2.GaussianBlur(image.astype(np.float32), (0, 0), blur) for image in (first, second)]
    away = np.abs(smooth[0] - smooth[1])[where]
    return float(np.median(away)) < GAPS.differ * np.iinfo(first.dtype).max


def _choose(
    views: Sequence[SourcePhoto], looks: Sequence[_Look], grid: Grid, options: OrthoOptions
) -> tuple[ImageArray, ByteArray]:
    """Return colours and sources of a window: the better view, feathered where both see it."""
    usable = [look.inside & ~look.hidden for look in looks]
    if len(views) > 2:
        return chosen(views, [look.image for look in looks], usable, grid, options.feather)
    source = np.where(usable[0], np.uint8(views[0].number), np.uint8(0))
    if len(views) == 1 or not looks[1].taken.any():
        return _masked(looks[0].image, usable[0]), source
    from_second = looks[1].taken
    share = from_second.astype(np.float32)
    if options.feather:
        # The second fades in towards what it alone shows, where both see the wall.
        depth = cv2.distanceTransform((~from_second).astype(np.uint8), cv2.DIST_L2, 3)
        near = np.clip(1 - depth / np.float32(options.feather), 0, 1)
        share = np.where(usable[0] & usable[1], near, share)
    source[share > 0] = Source.BOTH
    source[share >= 1] = Source.IMAGE_2
    first, second = (look.image.astype(np.float32) for look in looks)
    weight = share.reshape(share.shape + (1,) * (first.ndim - 2)).astype(np.float32)
    image = np.rint(first + (second - first) * weight).astype(looks[0].image.dtype)
    return _masked(image, source > 0), source


def _masked(image: ImageArray, keep: BoolArray) -> ImageArray:
    """Return the image with 0 where it is not to be kept."""
    return image if keep.all() else cv2.copyTo(image, keep.astype(np.uint8))
