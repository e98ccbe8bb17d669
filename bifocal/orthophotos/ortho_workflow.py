"""Pair file in, orthophoto out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.files.geotiff import RasterReader, check_relief, create_raster, dpi_at_scale
from bifocal.files.images import ImageArray, image_info, read_image
from bifocal.files.point_tables import read_survey_points
from bifocal.model.grid import Grid
from bifocal.model.pair import Pair, Photo
from bifocal.model.surface import Bounds, FlatSurface, MapSurface, Surface
from bifocal.orthophotos.compose import NOTHING_IN_COMMON, choose_grid, render
from bifocal.orthophotos.ortho_image import OrthoOptions, Source
from bifocal.orthophotos.radiometry import correct_view, match_exposure
from bifocal.orthophotos.rectify import View, native_gsd
from bifocal.orthophotos.triangles import TriangleSurface
from photocore.arrays import ByteArray
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.output import check_writable

#: A pixel this many times finer or coarser than the photo's own is asked back about.
FINEST, COARSEST = 1 / 16, 40.0
#: So is one this much finer that makes so many pixels that it takes minutes.
FINE, MANY_PIXELS = 1 / 5.5, 25_000_000
#: So are orthophotos of more pixels than this.
MOST_PIXELS = 4_000_000_000
#: Orthophotos of more pixels get reduced copies inside the file, for fast display.
OVERVIEWS_FROM = 50_000_000
#: Flags of points that say nothing about the relief.
_USELESS = frozenset({"UNCERTAIN", "NADIR", "OFF-RADIAL", "CHECK"})


@dataclass(frozen=True, slots=True, kw_only=True)
class OrthoTask:
    """What is asked for.

    Attributes
    ----------
    relief : Path, optional
        Relief map; else ``points``, else the plane ``r = plane``.
    points : Path, optional
        Workbook or table of points.
    breaklines : sequence of sequences of str
        Ids of points along edges.
    plane : float
        Relief of the plane where neither is given. [m]
    image : str
        ``1``, ``2`` or ``both``.
    gsd, bounds
        Pixel size and box; None for the natural ones. [m]
    scale : float, optional
        1:scale, for the DPI tag.
    match : bool
        Match the exposure of image 2 to image 1 where both are used.
    vignetting : str
        Empty, ``auto`` or three coefficients.
    chromatic : bool
        Measure and undo the lateral colour shift of each photo.
    any_size : bool
        Do not ask back about unusual sizes.
    overviews : bool, optional
        Reduced copies in the file; None: for large ones.
    """

    relief: Path | None = None
    points: Path | None = None
    breaklines: Sequence[Sequence[str]] = ()
    plane: float = 0.0
    image: str = "1"
    gsd: float | None = None
    bounds: Bounds | None = None
    scale: float | None = None
    options: OrthoOptions = field(default_factory=OrthoOptions)
    match: bool = True
    vignetting: str = ""
    chromatic: bool = False
    any_size: bool = False
    overviews: bool | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class OrthoResult:
    """What was made.

    Attributes
    ----------
    path : Path
    grid : Grid
    shares : dict of str to float
        Part of the pixels by source, and hidden ones.
    remarks : tuple of str
    """

    path: Path
    grid: Grid
    shares: dict[str, float]
    remarks: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the result for ``--json``."""
        return {
            "file": str(self.path),
            "gsd": self.grid.gsd,
            "width": self.grid.width,
            "height": self.grid.height,
            "bounds": list(self.grid.bounds),
            "shares": self.shares,
            "remarks": list(self.remarks),
        }


def make_ortho(
    pair_path: Path,
    out: Path,
    task: OrthoTask,
    *,
    overwrite: bool = False,
    world_file: bool = False,
    progress: Progress = no_progress,
) -> OrthoResult:
    """Render the orthophoto of a pair into a GeoTIFF; colours, source band, validity mask.

    Raises
    ------
    InputError
        If an input is missing or does not fit, the size is not plausible, or writing fails.
    """
    check_writable(out, overwrite=overwrite)
    if out.suffix.lower() not in {".tif", ".tiff"}:
        raise InputError(f"{out}: an orthophoto is written as GeoTIFF; name it .tif.")
    pair = Pair.read(pair_path)
    remarks = list(pair.remarks)
    with open_surface(task, pair, remarks) as surface:
        numbers = {"1": (1,), "2": (2,), "both": (1, 2)}[task.image]
        images = {number: read_photo(pair, number) for number in numbers}
        first_image = images[numbers[0]]
        size = (first_image.shape[1], first_image.shape[0])
        grid = _grid(pair, numbers[0], size, surface, task)
        del first_image
        views = _views(pair, images, surface, grid, task, remarks)
        counts = np.zeros(len(Source), np.int64)
        hidden = 0
        first = views[0].image
        bands = 1 if first.ndim == 2 else 3
        overviews = task.overviews
        if overviews is None:
            overviews = grid.width * grid.height > OVERVIEWS_FROM
        with create_raster(
            out,
            grid,
            bands=bands + 1,
            dtype=first.dtype,
            overwrite=overwrite,
            names=(*(("red", "green", "blue") if bands == 3 else ("grey",)), "source"),
            colour=bands == 3,
            dpi=dpi_at_scale(grid.gsd, task.scale) if task.scale else None,
            crs_name=str(pair.extra.get("name") or "Facade plane"),
            tags=_tags(pair, task),
            overviews=overviews,
            world_file=world_file,
        ) as writer:
            total = grid.width * grid.height
            done = 0
            for column, row, tile in render(views, surface, grid, task.options):
                writer.write(
                    with_band(tile.image, tile.source),
                    column=column,
                    row=row,
                    mask=tile.source > 0,
                )
                counts += np.bincount(tile.source.ravel(), minlength=len(Source))
                hidden += int(np.count_nonzero(tile.hidden))
                done += tile.source.size
                progress(done, total, "orthophoto")
            if counts[0] == total and not hidden:
                raise InputError(NOTHING_IN_COMMON)
    shares = {source.name.lower(): float(counts[source]) / total for source in Source}
    shares["hidden"] = hidden / total
    return OrthoResult(path=out, grid=grid, shares=shares, remarks=tuple(remarks))


def with_band(image: ImageArray, band: ByteArray) -> ImageArray:
    """Return colours and one more band, shape (h, w, bands); stored band after band."""
    layers = image.reshape(*image.shape[:2], -1)
    stacked = np.empty((layers.shape[2] + 1, *band.shape), image.dtype)
    for number in range(layers.shape[2]):
        stacked[number] = layers[:, :, number]
    stacked[-1] = band
    return stacked.transpose(1, 2, 0)


def read_photo(pair: Pair, number: int) -> ImageArray:
    """Return the pixels of a photo of the pair, upright.

    Raises
    ------
    InputError
        If the pair file does not name it.
    """
    photo = pair.image1 if number == 1 else pair.image2
    if not photo.file:
        raise InputError(f'the pair file names no "file" for image{number}; add it.')
    return read_image(pair.folder / photo.file)


@contextmanager
def open_surface(task: OrthoTask, pair: Pair, remarks: list[str]) -> Iterator[Surface]:
    """Yield the relief asked for, checked against the cameras' distances."""
    with ExitStack() as stack:
        surface: Surface
        if task.relief is not None and task.points is not None:
            raise InputError("give either a relief map or points, not both.")
        if task.relief is not None:
            reader = stack.enter_context(RasterReader(task.relief))
            check_relief(reader)
            try:
                surface = MapSurface(reader.grid, reader.read_floats)
            except InputError as error:
                raise InputError(f"{task.relief}: {error}") from None
        elif task.points is not None:
            surface = _triangles(task, remarks)
        else:
            surface = FlatSurface(task.plane)
        box = (-math.inf, -math.inf, math.inf, math.inf)
        if isinstance(surface, MapSurface | TriangleSurface):
            box = surface.grid.bounds if isinstance(surface, MapSurface) else surface.bounds
        low, high = surface.extremes(box)
        nearest = min(pair.image1.distance, pair.image2.distance)
        if high >= nearest or low < -20 * pair.image1.distance:
            raise InputError(
                f"{task.relief or task.points or 'relief'}: runs from {low:g} to {high:g} m, "
                f"but the near camera stands {nearest:g} m from the plane. It must be in metres, "
                "positive towards the cameras, and belong to this pair."
            )
        yield surface


def _triangles(task: OrthoTask, remarks: list[str]) -> TriangleSurface:
    """Return the surface through the useful points of a table."""
    assert task.points is not None
    points, notes = read_survey_points(task.points)
    remarks.extend(notes)
    known = np.isfinite(points.xyz).all(axis=1)
    keep = known & np.array([flag not in _USELESS for flag in points.flags], dtype=bool)
    if not keep.all():
        remarks.append(f"{int((~keep).sum())} of {len(keep)} points left out: no usable relief.")
    used = points.take(keep)
    index = {name: i for i, name in enumerate(used.ids)}
    lines = []
    for line in task.breaklines:
        missing = [name for name in line if name not in index]
        if missing:
            raise InputError(
                f"breakline {','.join(line)}: {task.points} has no usable point "
                f"{', '.join(missing)}."
            )
        lines.append([index[name] for name in line])
    remarks.append(
        "Relief between the points is interpolated; outside of them the orthophoto is empty."
    )
    try:
        return TriangleSurface(used.xyz, lines)
    except InputError as error:
        raise InputError(f"{task.points}: {error}") from None


def planned_grid(pair: Pair, surface: Surface, task: OrthoTask) -> Grid:
    """Return the grid the task will have, without decoding a photo; asks back like `make_ortho`."""
    number = 2 if task.image == "2" else 1
    photo = pair.image1 if number == 1 else pair.image2
    if not photo.file:
        raise InputError(f'the pair file names no "file" for image{number}; add it.')
    return _grid(pair, number, image_info(pair.folder / photo.file).size, surface, task)


def _grid(pair: Pair, first: int, size: tuple[int, int], surface: Surface, task: OrthoTask) -> Grid:
    """Return the grid, or ask back if it cannot be meant."""
    bounds = task.bounds
    if bounds is None and isinstance(surface, TriangleSurface):
        bounds = surface.bounds
    grid = choose_grid(pair, first, size, surface, gsd=task.gsd, bounds=bounds)
    photo: Photo = pair.image1 if first == 1 else pair.image2
    own = native_gsd(photo, size)
    ratio = grid.gsd / own
    pixels = grid.width * grid.height
    strange = not FINEST <= ratio <= COARSEST or pixels > MOST_PIXELS
    strange = strange or (ratio < FINE and pixels > MANY_PIXELS)
    if strange and not task.any_size:
        raise InputError(
            f"a pixel of {grid.gsd * 1000:g} mm makes an orthophoto of {grid.width:,} x "
            f"{grid.height:,} px ({pixels * 3 / 1e9:,.3g} GB), while a pixel of the photo covers "
            f"{own * 1000:.2g} mm. If that is what you want, add --any-size; otherwise give --gsd "
            f"in metres or with its unit (0.005 or 5mm), or smaller --bounds."
        )
    return grid


def _views(
    pair: Pair, images: dict[int, ImageArray], surface: Surface, grid: Grid, task: OrthoTask,
    remarks: list[str],
) -> list[View]:  # fmt: skip
    """Return the photos ready to be rendered, corrected as asked for and not otherwise."""
    views = []
    for number in sorted(images):
        photo = pair.image1 if number == 1 else pair.image2
        pixels = images.pop(number)  # the reduced or corrected copy is enough from here on
        image, chromatic, notes = correct_view(
            pixels, photo, vignetting=task.vignetting, chromatic=task.chromatic
        )
        remarks.extend(f"image {number}: {note}" for note in notes)
        views.append(View.prepare(photo, image, number=number, gsd=grid.gsd, chromatic=chromatic))
    if len(views) == 2:
        if views[0].image.dtype != views[1].image.dtype or (
            views[0].image.ndim != views[1].image.ndim
        ):
            raise InputError(
                "the two photos differ in bits or colour; save both alike, or use --image 1."
            )
        if task.match:
            views[1], note = match_exposure(views[0], views[1], surface, grid)
            remarks.append(note)
    return views


def _tags(pair: Pair, task: OrthoTask) -> dict[str, str]:
    """Return what the file should remember of its making."""
    relief = task.relief or task.points
    return {
        "BIFOCAL_IMAGE": task.image,
        "BIFOCAL_RELIEF": relief.name if relief else f"plane r = {task.plane:g} m",
        "BIFOCAL_D1": f"{pair.image1.distance:.6g}",
        "BIFOCAL_D2": f"{pair.image2.distance:.6g}",
        **({"BIFOCAL_SCALE": f"1:{task.scale:g}"} if task.scale else {}),
    }
