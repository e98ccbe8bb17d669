"""Pair file in, orthophoto out."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.faces.faced_surface import FacedSurface, beneath
from bifocal.faces.faces import Faces
from bifocal.faces.faces_files import check_faces, given_faces
from bifocal.files.made_from import MadeFrom, check_maps, photos_of
from bifocal.files.photos import photo_info
from bifocal.files.point_tables import read_survey_points
from bifocal.model.doubts import check_scale, unit_of
from bifocal.model.geotiff import (
    RasterReader,
    bytes_in_words,
    check_relief,
    create_raster,
    dpi_at_scale,
)
from bifocal.model.grid import Bounds, Grid
from bifocal.model.pair import Pair
from bifocal.model.photo_alone import PhotoAlone
from bifocal.model.photo_set import PhotoSet
from bifocal.model.photos_of_set import PhotosOfSet
from bifocal.model.points import Points
from bifocal.model.relief_map import measured_part, told_pixels
from bifocal.model.surface import EVERYWHERE, FlatSurface, MapSurface, Surface
from bifocal.orthophotos.compose import choose_grid, render
from bifocal.orthophotos.moved_things import MovedThing
from bifocal.orthophotos.ortho_image import OF_SET, OrthoOptions, Source
from bifocal.orthophotos.radiometry import corrected_photo, match_exposure
from bifocal.orthophotos.rectify import SourcePhoto
from bifocal.orthophotos.tiles import RasterResult, write_tiles
from bifocal.orthophotos.triangles import TriangleSurface
from bifocal.orthophotos.tuning import PIXELS, WHOLE
from bifocal.remarks import remark
from photocore.arrays import ByteArray, IntArray
from photocore.cli import Progress, no_progress
from photocore.errors import InputError, located
from photocore.images import ImageArray
from photocore.large_photos import Pixels, open_photo
from photocore.output import check_ending, check_not_input, check_writable
from photocore.reports.words import words_of

#: What an orthophoto must be named.
ORTHO_ENDING = "an orthophoto is written as GeoTIFF; name it .tif."
#: Flags of points that say nothing about the relief.
_USELESS = frozenset({"UNCERTAIN", "NADIR", "OFF-RADIAL", "CHECK"})


@dataclass(frozen=True, slots=True, kw_only=True)
class OrthoTask:
    """What is asked for.

    Attributes
    ----------
    relief : Path, optional
        Relief map; else ``points``, else the plane ``r = plane``.
    points : Path or Points, optional
        Points, or the workbook or table that holds them.
    breaklines : sequence of sequences of str
        Ids of points along edges.
    plane : float
        Relief of the plane where neither is given. [m]
    faces : Faces or Path, optional
        Planes, edges and occluders that were drawn, or their file.
    image : str
        ``1``, ``2`` or ``both``; empty: of a whole picture both, else 1.
    gsd, bounds
        Pixel size and box; None for the natural ones. [m]
    scale : float, optional
        1:scale, for the DPI tag.
    match : bool
        Match the exposure of image 2 to image 1 where both are used.
    vignetting : str
        Empty, ``cos4`` or three coefficients ``k1,k2,k3``.
    chromatic : bool
        Measure and undo the lateral colour shift of each photo.
    any_size : bool
        Do not ask back about unusual sizes.
    overviews : bool, optional
        Reduced copies in the file; None: for large ones.
    """

    relief: Path | None = None
    points: Path | Points | None = None
    breaklines: Sequence[Sequence[str]] = ()
    plane: float = 0.0
    faces: Faces | Path | None = None
    image: str = ""
    gsd: float | None = None
    bounds: Bounds | None = None
    scale: float | None = None
    options: OrthoOptions = field(default_factory=OrthoOptions)
    match: bool = True
    vignetting: str = ""
    chromatic: bool = False
    any_size: bool = False
    overviews: bool | None = None

    @property
    def photo_words(self) -> str:
        """Which photos it is made of: ``1``, ``2`` or ``both``."""
        return self.image or ("1" if self.options.measured_only else "both")

    @classmethod
    def from_given(cls, given: Mapping[str, Any], **more: Any) -> OrthoTask:
        """Return the task of options by the names of the command's; absent ones by default."""
        settings = {key: value for key, value in given.items() if value is not None}
        settings.pop("complete", None)  # of survey files from when whole pictures were asked for
        if "mask" in settings:
            settings["mask_hidden"] = settings.pop("mask")
        how = {
            item.name: settings.pop(item.name)
            for item in fields(OrthoOptions)
            if item.name in settings
        }
        return cls(options=OrthoOptions(**how), **settings, **more)


def make_ortho(
    pair_path: Pair | PhotoSet | Path,
    out: Path,
    task: OrthoTask,
    *,
    overwrite: bool = False,
    world_file: bool = False,
    progress: Progress = no_progress,
) -> RasterResult:
    """Render the orthophoto of a pair or a set into a GeoTIFF: colours, source band, mask.

    Raises
    ------
    InputError
        If an input is missing or does not fit, the size is not plausible, or writing fails.
    """
    check_ending(out, ORTHO_ENDING, ".tif", ".tiff")
    pair = PhotosOfSet.of(pair_path)
    if task.scale:
        check_scale(pair.extra, pair_path if isinstance(pair_path, Path) else "")
    check_not_input(out, task.relief, *pair.photo_files)
    check_writable(out, overwrite=overwrite)
    with open_surface(task, pair) as (surface, _, remarks), ExitStack() as stack:
        faces, _ = given_faces(task.faces)
        drawn = (faces or Faces()).digest
        made_from = MadeFrom.of(photos_of(pair), faces=drawn, relief=task.relief)
        images, notes_of_photos = _images(pair, task, stack, progress)
        remarks += notes_of_photos
        numbers = tuple(images)
        height, width = images[numbers[0]].shape[:2]
        grid = _grid(pair, numbers[0], (width, height), surface, task)
        photos, notes = _sources(pair, images, surface, grid, task, progress)
        hidden, moved = 0, list[MovedThing]()

        def tiles() -> Iterator[tuple[int, int, ImageArray, ByteArray]]:
            nonlocal hidden
            for column, row, tile in render(photos, surface, grid, task.options, moved):
                hidden += int(np.count_nonzero(tile.hidden))
                yield column, row, tile.image, tile.source

        bands = ("grey",) if photos[0].image.ndim == 2 else ("red", "green", "blue")
        total = grid.width * grid.height
        with create_raster(
            out,
            grid,
            bands=len(bands) + 1,
            dtype=photos[0].image.dtype,
            overwrite=overwrite,
            names=(*bands, "source"),
            colour=len(bands) == 3,
            dpi=dpi_at_scale(grid.gsd, task.scale) if task.scale else None,
            crs_name=str(pair.extra.get("name") or "Facade plane"),
            tags=_tags(pair, task) | made_from.tags(),
            overviews=total > PIXELS.overviews_from if task.overviews is None else task.overviews,
            world_file=world_file,
        ) as writer:
            counts = write_tiles(
                writer, tiles(), sources=OF_SET + len(numbers) + 1, masked=True, progress=progress,
                what="orthophoto", empty=(Source.NONE, Source.NEITHER),
            )  # fmt: skip
            if counts[0] == total and not hidden:
                raise InputError(remark("ortho.nothing_in_common"))
            basis = _basis(counts, flat=isinstance(beneath(surface), FlatSurface))
            writer.tag(BIFOCAL_BASIS=json.dumps({key: round(v, 4) for key, v in basis.items()}))
    shares = {source.name.lower(): float(counts[source]) / total for source in Source}
    if isinstance(pair, PhotosOfSet):
        for number, photo in enumerate(pair.photos, start=OF_SET + 1):
            shares[photo.name] = float(counts[number]) / total
    shares["hidden"] = hidden / total
    for thing in moved:
        words = "ortho.moved" if thing.drawn_from_second else "ortho.occluder"
        notes.append(remark(words, x=thing.place[0], y=thing.place[1], area=thing.area))
    if task.relief and basis["plane"] > PIXELS.rectified:
        notes.append(remark("ortho.rectified", share=basis["plane"]))
    notes += [] if isinstance(pair, PhotoAlone | PhotosOfSet) else _advice(shares, task)
    pixel = photo_pixel(pair, task)
    if grid.gsd < PIXELS.said * pixel:
        notes.append(remark("ortho.finer_than_photo", size=1000 * grid.gsd, own=1000 * pixel))
    return RasterResult(
        path=out, grid=grid, shares=shares, remarks=(*pair.remarks, *remarks, *notes), basis=basis
    )


def _basis(counts: IntArray, *, flat: bool) -> dict[str, float]:
    """Return what parts of what is shown, or should be, rest on, of pixels by source."""
    total = max(int(counts.sum() - counts[Source.NONE]), 1)
    of = {
        "interpolated": counts[Source.INTERPOLATED],
        "plane": counts[Source.PLANE],
        "neither": counts[Source.FILLED] + counts[Source.NEITHER],
    }
    shares = {name: float(count) / total for name, count in of.items()}
    rest = 1.0 - sum(shares.values())
    if flat:
        return {"measured": 0.0, **shares, "plane": shares["plane"] + rest}
    return {"measured": rest, **shares}


def _images(
    pair: Pair, task: OrthoTask, stack: ExitStack, progress: Progress
) -> tuple[dict[int, Pixels], tuple[str, ...]]:
    """Return the photos that give the colours by their numbers, open in a stack, and remarks.

    A near photo that nobody asked for, and that cannot be used beside the far one, is left out.
    """

    def pixels(number: int) -> Pixels:
        return stack.enter_context(open_photo(photo_info(pair, number).path, progress))

    if isinstance(pair, PhotosOfSet):
        if task.image:
            raise InputError(remark("ortho.image_of_set"))
        numbers = range(1, len(pair.photos) + 1)
        return {number: pixels(number) for number in numbers}, ()
    words = "1" if isinstance(pair, PhotoAlone) else task.photo_words
    chosen: tuple[int, ...] = {"1": (1,), "2": (2,), "both": (1, 2)}[words]
    images = {chosen[0]: pixels(chosen[0])}
    for number in chosen[1:]:
        try:
            images[number] = pixels(number)
            first, second = images[1], images[number]
            if first.dtype != second.dtype or first.ndim != second.ndim:
                raise InputError(remark("ortho.photos_differ"))
        except InputError as error:
            if task.image:
                raise
            return {1: images[1]}, (remark("ortho.far_photo_alone", why=str(error)),)
    return images, ()


def basis_in_words(basis: Mapping[str, float], language: str = "en") -> str:
    """Return in words what parts of a picture rest on; empty if all was measured."""
    if basis["measured"] == 1.0:
        return ""
    say = words_of("bifocal.orthophotos", language)
    return ", ".join(say(key, share=100 * share) for key, share in basis.items() if share)


def _advice(shares: dict[str, float], task: OrthoTask) -> list[str]:
    """Return what could be done about the empty part of a picture."""
    if shares["none"] < PIXELS.worth_a_remark or not task.options.measured_only:
        return []
    ways = []
    if task.photo_words != "both":
        ways.append(remark("ortho.way_both"))
    if not task.options.fill:
        ways.append(remark("ortho.way_fill"))
    ways.append(remark("ortho.way_whole"))
    return [remark("ortho.empty", share=shares["none"], ways="; ".join(ways))]


@contextmanager
def open_surface(
    task: OrthoTask, pair: Pair
) -> Iterator[tuple[Surface, RasterReader | None, tuple[str, ...]]]:
    """Yield the relief asked for, checked against the cameras' distances, its map, and remarks."""
    faces, notes = given_faces(task.faces)
    notes += check_faces(faces, photos_of(pair))
    if task.relief is not None:
        now = MadeFrom.of(photos_of(pair), faces=(faces or Faces()).digest)
        notes += check_maps(now, relief=task.relief)
    with ExitStack() as stack:
        surface: Surface = FlatSurface(task.plane)
        reader: RasterReader | None = None
        remarks: tuple[str, ...] = ()
        if task.relief is not None and task.points is not None:
            raise InputError("give either a relief map or points, not both.")
        if task.relief is not None:
            reader = stack.enter_context(RasterReader(task.relief))
            check_relief(reader)
            with located(task.relief):
                surface = MapSurface(reader.grid, reader.read_floats, told_pixels(reader))
        elif task.points is not None:
            surface, remarks = _triangles(task.points, task.breaklines)
        if faces:
            measured = None if reader is None else measured_part(reader)
            surface = FacedSurface(surface, faces, measured)
        low, high = surface.extremes(EVERYWHERE)
        nearest = min(pair.image1.distance, pair.image2.distance)
        named = task.relief or (task.points.name if task.points is not None else "relief")
        if high >= nearest or low < -20 * pair.image1.distance:
            about = {"name": named, "low": low, "high": high, "near": nearest}
            raise InputError(remark("ortho.relief_of_another_pair", **about))
        yield surface, reader, (*remarks, *notes)


def _triangles(
    source: Path | Points, breaklines: Sequence[Sequence[str]]
) -> tuple[TriangleSurface, tuple[str, ...]]:
    """Return the surface through the useful points of a table, and remarks."""
    points, notes = survey_points_of(source)
    remarks = list(notes)
    finite = np.isfinite(points.xyz).all(axis=1)
    keep = finite & np.array([flag not in _USELESS for flag in points.flags], dtype=bool)
    if not keep.all():
        count = int((~keep).sum())
        remarks.append(remark("ortho.points_left_out", count=count, total=len(keep)))
    used = points.take(keep)
    index = {name: i for i, name in enumerate(used.ids)}
    lines = []
    for line in breaklines:
        missing = [name for name in line if name not in index]
        if missing:
            raise InputError(
                f"breakline {','.join(line)}: {source.name} has no usable point "
                f"{', '.join(missing)}."
            )
        if len(set(line)) < 2:
            raise InputError(f"breakline {','.join(line)}: name two points or more.")
        lines.append([index[name] for name in line])
    remarks.append(remark("ortho.between_points"))
    with located(source.name):
        return TriangleSurface(used.xyz, lines), tuple(remarks)


def survey_points_of(source: Path | Points) -> tuple[Points, tuple[str, ...]]:
    """Return points as they are, or those of a table, and remarks."""
    return (source, ()) if isinstance(source, Points) else read_survey_points(source)


def planned_grid(pair: Pair, surface: Surface, task: OrthoTask) -> Grid:
    """Return the grid the task will have, without decoding a photo; asks back like `make_ortho`."""
    number = 2 if task.image == "2" else 1
    return _grid(pair, number, photo_info(pair, number).size, surface, task)


def photo_pixel(pair: Pair, task: OrthoTask) -> float:
    """Return the side of a pixel of the photo that gives most colours, on the wall. [m]"""
    number = 2 if task.image == "2" else 1
    return pair.photo(number).gsd(photo_info(pair, number).size)


def _grid(pair: Pair, first: int, size: tuple[int, int], surface: Surface, task: OrthoTask) -> Grid:
    """Return the grid, or ask back if it cannot be meant."""
    bounds = task.bounds
    under = beneath(surface)
    if bounds is None and isinstance(under, TriangleSurface):
        bounds = under.bounds
    grid = choose_grid(pair, first, size, surface, gsd=task.gsd, bounds=bounds)
    photo_gsd = pair.photo(first).gsd(size)
    ratio = grid.gsd / photo_gsd
    pixels = grid.width * grid.height
    strange = not PIXELS.finest <= ratio <= PIXELS.coarsest or pixels > PIXELS.most
    strange = strange or (ratio < PIXELS.fine and pixels > PIXELS.many)
    if strange and not task.any_size:
        about = {"size": 1000 * grid.gsd, "width": grid.width, "height": grid.height}
        size_words = bytes_in_words(3 * pixels)
        raise InputError(
            remark("ortho.strange_size", bytes=size_words, own=1000 * photo_gsd, **about)
        )
    return grid


def _sources(
    pair: Pair,
    images: dict[int, Pixels],
    surface: Surface,
    grid: Grid,
    task: OrthoTask,
    progress: Progress,
) -> tuple[list[SourcePhoto], list[str]]:
    """Return the photos ready to be rendered, corrected as asked for, and what was done."""
    photos: list[SourcePhoto] = []
    remarks: list[str] = []
    for number in sorted(images):
        photo = pair.photo(number)
        pixels = images.pop(number)  # the reduced or corrected copy is enough from here on
        image, chromatic, notes = corrected_photo(
            pixels, photo, vignetting=task.vignetting, chromatic=task.chromatic
        )
        remarks += [remark("ortho.of_image", number=number, note=note) for note in notes]
        photos.append(
            SourcePhoto.prepare(
                photo, image, number=number, gsd=grid.gsd, chromatic=chromatic, progress=progress
            )
        )
    for place in range(1, len(photos)):
        first, second = photos[0].image, photos[place].image
        if first.dtype != second.dtype or first.ndim != second.ndim:
            raise InputError(remark("ortho.photos_differ"))
        if not task.match:
            continue
        for earlier in photos[:place]:  # the first that shares a part of the wall
            matched, note = match_exposure(earlier, photos[place], surface, grid)
            if matched is not photos[place]:
                break
        photos[place] = matched
        remarks.append(note)
    return photos, remarks


def _tags(pair: Pair, task: OrthoTask) -> dict[str, str]:
    """Return what the file should remember of its making."""
    relief = task.relief or task.points
    # Crumbs of interpolated relief were left out where that moves the picture by less.
    bound = f"{WHOLE.bound * photo_pixel(pair, task):.4f} m"
    return {
        "BIFOCAL_IMAGE": "all" if isinstance(pair, PhotosOfSet) else task.photo_words,
        "BIFOCAL_RELIEF": relief.name if relief else f"plane r = {task.plane:g} m",
        "BIFOCAL_UNIT": unit_of(pair.extra),
        "BIFOCAL_D1": f"{pair.image1.distance:.6g}",
        **({} if isinstance(pair, PhotoAlone) else {"BIFOCAL_D2": f"{pair.image2.distance:.6g}"}),
        **({} if task.options.measured_only else {"BIFOCAL_BOUND": bound}),
        **({"BIFOCAL_SCALE": f"1:{task.scale:g}"} if task.scale else {}),
    }
