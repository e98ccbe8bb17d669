"""Everything a drawing needs, in one folder, from one call."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bifocal.files.geotiff import RasterReader, create_raster, dpi_at_scale, gsd_at_scale
from bifocal.files.strips import write_png
from bifocal.model.grid import Grid
from bifocal.model.pair import Pair
from bifocal.model.points import SurveyPoints
from bifocal.model.relief_map import Quality
from bifocal.model.surface import FlatSurface, MapSurface, Surface
from bifocal.orthophotos.compose import TILE
from bifocal.orthophotos.drawing import Drawing, Legend, PrintSheet, round_step
from bifocal.orthophotos.drawing_files import write_drawing, write_section_dxf, write_section_svg
from bifocal.orthophotos.ortho_workflow import (
    OrthoTask,
    make_ortho,
    open_surface,
    planned_grid,
    survey_points_of,
)
from bifocal.orthophotos.pdf_sheet import write_sheet
from bifocal.orthophotos.sections import contours, section
from bifocal.orthophotos.shading import shaded, tints
from bifocal.orthophotos.tiles import RasterResult
from photocore.arrays import Float32Array, positive
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.output import atomic_folder
from photocore.provenance import program, today

#: Print resolution for which 1:50 makes pixels of 5.00 mm. [dpi]
DPI = 254.0
#: Relief detail worth drawing, on paper. [mm]
_CONTOUR_DETAIL = 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class DeliverTask:
    """What is wanted besides the orthophoto itself.

    Attributes
    ----------
    scale : float
        1:scale.
    dpi : float
        Pixels per inch of paper.
    title : str
        Empty: the name of the pair.
    paper : str, optional
        ``A4`` to ``A0``; None: the smallest that holds the picture.
    marked, control : Path, optional
        Tables of points to draw.
    sections : sequence of str
        ``x=1.5``, ``y=2`` or corners.
    interval : float, optional
        Between contour lines; None: about 1/25 of the relief. [m]
    """

    scale: float
    dpi: float = DPI
    title: str = ""
    paper: str | None = None
    marked: Path | None = None
    control: Path | None = None
    sections: Sequence[str] = ()
    interval: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """What was made: the orthophoto's result, the files and the sheet of paper."""

    ortho: RasterResult
    files: tuple[str, ...]
    sheet: str


def deliver(
    pair_path: Pair | Path,
    folder: Path,
    task: OrthoTask,
    wish: DeliverTask,
    *,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> Delivery:
    """Write orthophoto, relief, drawings, sections and print sheets into a folder.

    Raises
    ------
    InputError
        If the picture does not fit the paper, a table or section is unusable, or writing fails.
    """
    scale = positive(wish.scale, "scale")
    gsd = task.gsd or gsd_at_scale(positive(wish.dpi, "dpi"), scale)
    task = replace(task, gsd=gsd, scale=scale, overviews=True)
    pair = Pair.of(pair_path)
    pair.refuse_media("the set of deliverables")
    title = wish.title or str(pair.extra.get("name") or _name_of(pair_path))
    name = file_name(title)
    points, remarks = _points(wish.marked or task.points)
    control, notes_on_control = _points(wish.control)
    remarks += notes_on_control
    with open_surface(task, pair) as (surface, reader, _):
        # Everything that can be refused is, before the work.
        grid = planned_grid(pair, surface, task)
        notes = _notes(pair, grid, wish, task)
        drawing = Drawing(
            title=title, grid=grid, scale=scale, points=points, control=control, notes=notes
        )
        sheet = PrintSheet.fitting(drawing, wish.paper)
        cuts = tuple(section(surface, grid, cut, step=gsd) for cut in wish.sections)
        drawing = replace(drawing, sections=cuts)
        with atomic_folder(folder, overwrite=overwrite) as place:
            result = make_ortho(
                pair_path, place / f"{name}.tif", task, world_file=True, progress=progress
            )
            nameless = _pictures(place, name, drawing, sheet)
            if nameless:
                remarks += (
                    f"{nameless} marked points stand on the sheet without name, since names would "
                    "lie over each other; the drawing (.dxf) has them all.",
                )
            if not isinstance(surface, FlatSurface):
                surfaces = (surface, _measured(reader) or surface)
                share = _relief(place, f"{name}_relief", surfaces, drawing, sheet, wish)
                if share:
                    remarks += (
                        f"relief sheet: {share:.1%} of it was not measured but interpolated or "
                        "hidden; hatched in grey and without contour lines.",
                    )
            for number, cut in enumerate(cuts, start=1):
                for writer, ending in ((write_section_dxf, "dxf"), (write_section_svg, "svg")):
                    target = place / f"{name}_section{number}.{ending}"
                    writer(target, cut, scale=scale, overwrite=False)
            files = tuple(sorted(item.name for item in place.iterdir()))
    result = replace(result, path=folder / f"{name}.tif", remarks=(*result.remarks, *remarks))
    return Delivery(ortho=result, files=files, sheet=sheet.name)


def file_name(title: str) -> str:
    """Return a title as a file name every system and CAD program takes.

    Examples
    --------
    >>> file_name("Palazzo Müller (nord)")
    'Palazzo_Muller_nord'
    """
    plain = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode("ascii")
    words = "".join(c if c.isalnum() or c == "-" else " " for c in plain).split()
    return "_".join(words) or "ortho"


def _pictures(place: Path, name: str, drawing: Drawing, sheet: PrintSheet) -> int:
    """Write PNG, drawing and print sheet of a raster; return how many points bear no name."""
    dpi = dpi_at_scale(drawing.grid.gsd, drawing.scale)
    with RasterReader(place / f"{name}.tif") as reader:
        write_png(place / f"{name}.png", reader, dpi=dpi, overwrite=False)
        write_drawing(place / f"{name}.dxf", drawing, f"{name}.png", overwrite=False)
        return write_sheet(place / f"{name}.pdf", drawing, sheet, reader, overwrite=False)


def _relief(
    place: Path, name: str, surfaces: tuple[Surface, Surface], drawing: Drawing, sheet: PrintSheet,
    wish: DeliverTask,
) -> float:  # fmt: skip
    """Write the relief as numbers, and shaded with contour lines as picture, drawing and sheet.

    Returns the share of the picture whose relief is known but was not measured.
    """
    grid = drawing.grid
    surface, measured = surfaces
    low, high = measured.extremes(grid.bounds)
    if np.isnan(low):  # nothing measured in here
        low, high = surface.extremes(grid.bounds)
    interval = wish.interval or round_step(max((high - low) / 12, 0.001))
    lines = contours(
        measured, grid, interval=interval, detail=_CONTOUR_DETAIL / 1000 * drawing.scale
    )
    with create_raster(
        place / f"{name}_values.tif", grid, bands=1, dtype=np.float32, nodata=float("nan"),
        names=["relief [m]"], overviews=True, world_file=True,
    ) as writer:  # fmt: skip
        for column, row, part in grid.tiles(TILE):
            writer.write(surface.window(part), column=column, row=row)
    guessed = 0
    with create_raster(
        place / f"{name}.tif", grid, bands=3, dtype=np.uint8, colour=True, world_file=True,
        dpi=dpi_at_scale(grid.gsd, drawing.scale), overviews=True,
    ) as writer:  # fmt: skip
        for column, row, part in grid.tiles(TILE):
            picture, known = shaded(surface, part, limits=(low, high), measured=measured)
            guessed += int(np.count_nonzero((known > 0) & np.isnan(measured.window(part))))
            writer.write(picture, column=column, row=row, mask=known > 0)
    notes = (f"relief {low:+.2f} to {high:+.2f} m, contour lines every {interval:g} m",)
    share = guessed / (grid.width * grid.height)
    colours = np.rint(tints(np.linspace(low, high, 36), (low, high))).astype(int).tolist()
    legend = Legend(
        limits=(low, high), colours=tuple((r, g, b) for r, g, b in colours), guessed=share
    )
    drawing = replace(
        drawing, subtitle="Relief", contours=lines, notes=(*notes, *drawing.notes), legend=legend
    )
    _pictures(place, name, drawing, sheet)
    return share


def _measured(reader: RasterReader | None) -> Surface | None:
    """Return the measured part of a relief map; None where no map tells, or nothing was."""
    if reader is None or reader.bands < 3 or not reader.names[2].startswith("quality"):
        return None

    def fetch(*window: int) -> Float32Array:
        quality = reader.read(*window, bands=[3])[:, :, 0]
        return np.where(quality == Quality.MEASURED, reader.read_floats(*window), np.float32("nan"))

    # A map of which nothing was measured is drawn as it is, hatched by no one.
    with suppress(InputError):
        return MapSurface(reader.grid, fetch)
    return None


def _name_of(source: Pair | Path) -> str:
    return "wall" if isinstance(source, Pair) else source.name.split(".")[0]


def _points(source: Path | SurveyPoints | None) -> tuple[SurveyPoints | None, tuple[str, ...]]:
    """Return the points of a table, and remarks."""
    if source is None:
        return None, ()
    points, remarks = survey_points_of(source)
    if not np.isfinite(points.xyz[:, :2]).all(axis=1).any():
        raise InputError(f"{source.name}: no point has X and Y in the plane frame.")
    return points, tuple(remarks)


def _notes(pair: Pair, grid: Grid, wish: DeliverTask, task: OrthoTask) -> tuple[str, ...]:
    """Return the lines of the title block."""
    relief = task.relief or task.points
    dpi = dpi_at_scale(grid.gsd, wish.scale)
    image = {"1": "far photo", "2": "near photo", "both": "both photos"}[task.image]
    return (
        f"pixel {grid.gsd * 1000:.4g} mm on the wall, {dpi:.4g} dpi on paper",
        f"{image}, camera distances {pair.image1.distance:.3f} m and {pair.image2.distance:.3f} m",
        f"relief: {relief.name if relief else f'plane at {task.plane:g} m'}",
        f"{program()}, {today()}",
    )
