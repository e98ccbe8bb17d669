"""Everything a drawing needs, in one folder, from one call."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from bifocal.faces.faced_surface import FacedSurface
from bifocal.files.hash_list import list_hashes, listed_hashes
from bifocal.files.pair_names import default_title
from bifocal.files.strips import write_png
from bifocal.media import media_words
from bifocal.model.doubts import MISFITS, check_scale, doubts_of
from bifocal.model.geotiff import (
    RELIEF_BANDS,
    RasterReader,
    create_raster,
    dpi_at_scale,
    gsd_at_scale,
)
from bifocal.model.grid import Grid
from bifocal.model.length_checks import LengthCheck, agreement, checks_of
from bifocal.model.pair import Pair
from bifocal.model.photo_set import PhotoSet
from bifocal.model.photos_of_set import PhotosOfSet
from bifocal.model.points import Points
from bifocal.model.relief_map import Quality, measured_part
from bifocal.model.surface import FlatSurface, MapSurface, Surface
from bifocal.orthophotos.contour_lines import contour_grid, contours
from bifocal.orthophotos.drawing import Contour, Drawing, Legend, PrintSheet, round_step
from bifocal.orthophotos.drawing_files import write_drawing
from bifocal.orthophotos.hatching import DIRECTIONS, hatched_strips
from bifocal.orthophotos.ortho_workflow import (
    ORTHO_ENDING,
    OrthoTask,
    basis_in_words,
    make_ortho,
    open_surface,
    photo_pixel,
    planned_grid,
    survey_points_of,
)
from bifocal.orthophotos.pdf_sheet import LeftOut, write_sheet
from bifocal.orthophotos.section_files import write_section_dxf, write_section_svg
from bifocal.orthophotos.sections import section, section_letter
from bifocal.orthophotos.shading import colour_limits, shaded, tints, unmeasured
from bifocal.orthophotos.spot_heights import spot_heights
from bifocal.orthophotos.tiles import RasterResult
from bifocal.orthophotos.tuning import COMPOSE, CONTOURS, PIXELS
from bifocal.remarks import remark
from photocore.arrays import Float32Array, FloatArray, positive
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.output import (
    atomic_folder,
    atomic_path,
    check_ending,
    check_not_input,
    check_writable,
)
from photocore.provenance import program, today
from photocore.reports.words import words_of
from photocore.textfile import file_name

#: Print resolution for which 1:50 makes pixels of 5.00 mm. [dpi]
DPI = 254.0
#: Every picture is written with its world file, for the web, for CAD and on a sheet.
PICTURE_ENDINGS = ("tif", "tfw", "png", "dxf", "pdf")


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
        Empty: `default_title`.
    paper : str, optional
        ``A4`` to ``A0``; None: the smallest that holds the picture.
    mark, control : Path or Points, optional
        Points to draw, or their tables.
    cad : mapping of str to Points
        Of ``points``, ``control`` and ``check``: what the drawing for CAD holds though the sheet
        does not show it.
    layers : str
        How those of drawings are called: ``language``, ``bifocal`` or ``ncs``.
    sections : sequence of str
        ``x=1.5``, ``y=2`` or corners.
    contours : float, optional
        Between contour lines; None: about 1/25 of the relief. [m]
    hatch : bool
        Lines over what is not measured.
    language : str
        Of the sheets and sections.
    camera : str
        What the sheet says of one photo alone, instead of the distances of two cameras.
    checked : (int, float, float), optional
        Independent check points, and their RMSE in X, Y (the worse) and in relief [m]: told by the
        sheet in place of the standard deviations.
    lengths : sequence of LengthCheck
        Lengths taped on site that check the scale; the sheet tells how they agree.
    expected : callable
        Tells in lines what the sigmas of a pair let expect: said of measured relief that no check
        points tell of.
    hashes : bool
        List the files' SHA-256 in ``SHA256SUMS``, for ``bifocal verify``.
    """

    scale: float
    dpi: float = DPI
    title: str = ""
    paper: str | None = None
    mark: Path | None = None
    control: Path | Points | None = None
    cad: Mapping[str, Points] = field(default_factory=dict)
    layers: str = "language"
    sections: Sequence[str] = ()
    contours: float | None = None
    hatch: bool = True
    language: str = "en"
    camera: str = ""
    checked: tuple[int, float, float] | None = None
    lengths: Sequence[LengthCheck] = ()
    expected: Callable[[Pair], Sequence[str]] = lambda _: ()
    hashes: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """What was made: the orthophoto's result, the files and the sheet of paper."""

    ortho: RasterResult
    files: tuple[str, ...]
    sheet: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Relief:
    """A relief as it is drawn: all of it, what was measured, and its file where it has one."""

    surface: Surface
    measured: Surface
    reader: RasterReader | None
    interval: float
    limits: tuple[float, float]
    beyond: tuple[bool, bool]
    lines: tuple[Contour, ...]
    spots: FloatArray


def deliver(
    pair_path: Pair | PhotoSet | Path,
    folder: Path,
    task: OrthoTask,
    wish: DeliverTask,
    *,
    out: Path | None = None,
    world_file: bool = False,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> Delivery:
    """Write orthophoto, relief, drawings, sections and print sheets into a folder.

    Parameters
    ----------
    out : Path, optional
        Where the orthophoto is wanted besides.
    world_file : bool
        Whether that one has a ``.tfw`` beside it, as the one in the folder has.

    Raises
    ------
    InputError
        If the picture does not fit the paper, a table or section is unusable, or writing fails.
    """
    scale = positive(wish.scale, "scale")
    gsd = task.gsd or gsd_at_scale(positive(wish.dpi, "dpi"), scale)
    task = replace(task, gsd=gsd, scale=scale, overviews=True)
    pair = PhotosOfSet.of(pair_path)
    check_scale(pair.extra, pair_path if isinstance(pair_path, Path) else "")
    title = wish.title or default_title(pair_path)
    name = file_name(title)
    _check_outputs(out, folder, name, (task.relief, *pair.photo_files))
    listed_hashes(folder)  # refuses what is none, before the work
    points, remarks = _points(wish.mark or task.points)
    control, notes_on_control = _points(wish.control)
    remarks += notes_on_control
    with ExitStack() as stack:
        surface, reader, _ = stack.enter_context(open_surface(task, pair))
        # Everything that can be refused is, before the work.
        grid = planned_grid(pair, surface, task)
        drawing = Drawing(
            title=title, grid=grid, scale=scale, points=points, control=control,
            notes=_notes(pair, grid, wish, task, reader), language=wish.language, cad=wish.cad,
            layers=wish.layers,
        )  # fmt: skip
        sheet = PrintSheet.fitting(drawing, wish.paper)
        measured = _measured(reader, surface)
        cuts = tuple(
            section(surface, grid, cut, step=gsd, measured=measured, letter=section_letter(number))
            for number, cut in enumerate(wish.sections)
        )
        if cuts:
            named = drawing.say("sections", titles="; ".join(cut.title for cut in cuts))
            drawing = replace(drawing, sections=cuts, notes=(*drawing.notes, named))
        flat = isinstance(surface, FlatSurface)
        relief = None if flat else _prepared((surface, measured), reader, drawing, wish)
        inside = out is not None and out.resolve().parent == folder.resolve()
        copies = [] if out is None else [out, out.with_suffix(".tfw")][: 1 + world_file]
        extra = tuple(path.name for path in copies) if inside else ()
        _check_free(folder, name, relief is not None, len(cuts), extra, overwrite=overwrite)
        outside = [] if inside else copies
        targets = [stack.enter_context(atomic_path(p, overwrite=overwrite)) for p in outside]
        place = stack.enter_context(atomic_folder(folder, overwrite=overwrite))
        result = make_ortho(
            pair_path, place / f"{name}.tif", task, world_file=True, progress=progress
        )
        picture = _with_shares(drawing, result.basis, hatch=wish.hatch)
        missing = _pictures(place, name, picture, sheet, relief, hatch=wish.hatch)
        if missing.names:
            remarks += (remark("drawing.without_name", count=missing.names),)
        if missing.points:
            remarks += (remark("drawing.outside", count=missing.points),)
        if relief:
            drawn = _draw_relief(place, f"{name}_relief", relief, drawing, sheet, hatch=wish.hatch)
            if drawn["guessed"]:
                remarks += (remark("drawing.relief_not_measured", **drawn),)
        for number, cut in enumerate(cuts, start=1):
            for writer, ending in ((write_section_dxf, "dxf"), (write_section_svg, "svg")):
                writer(place / f"{name}_section{number}.{ending}", cut, drawing=drawing)
        for path, target in zip(copies, targets or [place / one for one in extra], strict=True):
            original = place / f"{name}.{'tfw' if path.suffix == '.tfw' else 'tif'}"
            if target != original:
                shutil.copyfile(original, target)
        files = {item.name for item in place.iterdir()}
    if wish.hashes:
        files.add(list_hashes(folder, files))
    remarks = (*result.remarks, *remarks)
    result = replace(result, path=out or folder / f"{name}.tif", remarks=remarks)
    return Delivery(ortho=result, files=tuple(sorted(files)), sheet=sheet.name)


def _check_outputs(
    out: Path | None, folder: Path, name: str, inputs: Sequence[Path | None]
) -> None:
    """Refuse outputs that would take the place of what is read."""
    check_ending(out, ORTHO_ENDING, ".tif", ".tiff")
    rasters = [
        folder / f"{name}{what}.{ending}"
        for what in ("", "_relief", "_relief_values")
        for ending in ("tif", "png")
    ]
    for path in (out, *rasters):
        check_not_input(path, *inputs)


def _check_free(
    folder: Path, name: str, relief: bool, sections: int, extra: Sequence[str], *, overwrite: bool
) -> None:
    """Refuse a folder that holds a file of the delivery already; call it before the work."""
    pictures = [name, f"{name}_relief"] if relief else [name]
    names = [f"{one}.{ending}" for one in pictures for ending in PICTURE_ENDINGS] + [*extra]
    if relief:
        names += [f"{name}_relief_values.{ending}" for ending in ("tif", "tfw")]
    names += [
        f"{name}_section{number}.{ending}"
        for number in range(1, sections + 1)
        for ending in ("dxf", "svg")
    ]
    for path in map(folder.joinpath, names):
        if path.exists():
            check_writable(path, overwrite=overwrite)


def _with_shares(drawing: Drawing, basis: Mapping[str, float], *, hatch: bool) -> Drawing:
    """Return a drawing that says what parts of its picture rest on: by hatches, or a note."""
    if basis["plane"] > PIXELS.rectified:
        drawing = replace(drawing, kind="rectified")
    if hatch:
        parts = ((source, basis.get(source.name.lower())) for source in DIRECTIONS)
        return replace(drawing, hatched=tuple((source, share) for source, share in parts if share))
    guess = basis_in_words(basis, drawing.language)
    note = (drawing.say("guessed", shares=guess),) if guess else ()
    return replace(drawing, notes=(*note, *drawing.notes))


def _pictures(
    place: Path, name: str, drawing: Drawing, sheet: PrintSheet, relief: _Relief | None, *,
    hatch: bool,
) -> LeftOut:  # fmt: skip
    """Write PNG, drawing and print sheet of a raster; return what the sheet left out.

    The drawing has contour lines and spot heights whatever the sheet shows: CAD switches their
    layers off.
    """
    dpi = dpi_at_scale(drawing.grid.gsd, drawing.scale)
    with RasterReader(place / f"{name}.tif") as reader:
        strips = partial(hatched_strips, reader, drawing.scale, hatch=hatch)
        write_png(place / f"{name}.png", reader, dpi=dpi, overwrite=False, strips=strips())
        everything = drawing
        if relief is not None:
            everything = replace(drawing, contours=relief.lines, spots=relief.spots)
        write_drawing(place / f"{name}.dxf", everything, sheet, f"{name}.png")
        return write_sheet(place / f"{name}.pdf", drawing, sheet, strips())


def _prepared(
    surfaces: tuple[Surface, Surface], reader: RasterReader | None, drawing: Drawing,
    wish: DeliverTask,
) -> _Relief:  # fmt: skip
    """Return a relief with its colours and contour lines."""
    surface, measured = surfaces
    coarse = contour_grid(drawing.grid, drawing.scale)
    shown, whole = measured.window(coarse), surface.window(coarse)
    if not np.isfinite(shown).any():  # nothing measured in here
        shown = whole
    limits, beyond = colour_limits(shown)
    # A phantom far off a flat wall must not make more levels than can be drawn.
    span = float(np.ptp(whole[np.isfinite(whole)])) if np.isfinite(whole).any() else 0.0
    least = max((limits[1] - limits[0]) / 12, span / CONTOURS.most_automatic, 0.001)
    interval = wish.contours or round_step(least)
    lines = contours(
        surface, drawing.grid, interval=interval, scale=drawing.scale,
        sigma=_band(reader, 2), guessed=unmeasured(surface, measured, coarse, scale=drawing.scale),
    )  # fmt: skip
    return _Relief(
        surface=surface, measured=measured, reader=reader, interval=interval, limits=limits,
        beyond=beyond, lines=lines, spots=spot_heights(measured, drawing.grid, drawing.scale),
    )  # fmt: skip


def _draw_relief(
    place: Path, name: str, relief: _Relief, drawing: Drawing, sheet: PrintSheet, *, hatch: bool
) -> dict[str, float]:
    """Write the relief as numbers, and shaded with contour lines as picture, drawing and sheet.

    Returns what share of the coloured part was measured and what was not, and what share of the
    picture is unknown.
    """
    grid, measured, (low, high) = drawing.grid, relief.measured, relief.limits
    _write_values(place / f"{name}_values.tif", relief, grid)
    guessed = coloured = 0
    with create_raster(
        place / f"{name}.tif", grid, bands=3, dtype=np.uint8, colour=True, world_file=True,
        dpi=dpi_at_scale(grid.gsd, drawing.scale), overviews=True, names=("red", "green", "blue"),
    ) as writer:  # fmt: skip
        for column, row, part in grid.tiles(COMPOSE.tile):
            picture, alpha = shaded(
                relief.surface, part, limits=(low, high), scale=drawing.scale,
                measured=measured if hatch else None,
            )  # fmt: skip
            guessed += int(np.count_nonzero((alpha > 0) & np.isnan(measured.window(part))))
            coloured += int(np.count_nonzero(alpha))
            writer.write(picture, column=column, row=row, mask=alpha > 0)
    share = guessed / max(coloured, 1)
    unknown = 1.0 - coloured / (grid.width * grid.height)
    shares = {"measured": 1.0 - share, "guessed": share, "unknown": unknown}
    scale = np.concatenate([np.linspace(low, 0, 18), np.linspace(0, high, 18)])
    colours = np.rint(tints(scale, (low, high))).astype(int).tolist()
    legend = Legend(
        limits=(low, high), beyond=relief.beyond, colours=tuple((r, g, b) for r, g, b in colours),
        hatched=hatch and guessed > 0,
    )  # fmt: skip
    lowest, highest = legend.words
    words = drawing.say("contours", low=lowest, high=highest, interval=relief.interval)
    words += f"; {drawing.say('shares', **shares)}" if guessed else ""
    drawing = replace(
        drawing, kind="relief", contours=relief.lines, notes=(words, *drawing.notes),
        legend=legend, spots=relief.spots,
    )  # fmt: skip
    _pictures(place, name, drawing, sheet, relief, hatch=False)
    return shares


def _write_values(path: Path, relief: _Relief, grid: Grid) -> None:
    """Write relief in metres, and beside it sigma and quality where the map knows them."""
    reader = relief.reader
    bands = 1 if reader is None else min(reader.bands, len(RELIEF_BANDS))
    with create_raster(
        path, grid, bands=bands, dtype=np.float32, nodata=float("nan"),
        names=RELIEF_BANDS[:bands], overviews=True, world_file=True,
    ) as writer:  # fmt: skip
        for column, row, part in grid.tiles(COMPOSE.tile):
            r = relief.surface.window(part)
            layers = [r]
            if reader is not None and bands > 1:
                beside = reader.nearest(part, bands=list(range(2, bands + 1)))
                fill = np.where(np.arange(bands - 1) == 0, np.nan, Quality.UNKNOWN)
                beside = np.where(np.isnan(r)[..., None], fill.astype(np.float32), beside)
                layers += list(np.moveaxis(beside, -1, 0))
            writer.write(np.stack(layers, axis=-1), column=column, row=row)


def _band(reader: RasterReader | None, number: int) -> Surface | None:
    """Return another band of a relief map, 2 for sigma; None where it has none that says much."""
    if reader is None or reader.bands < number:
        return None

    def fetch(*window: int) -> Float32Array:
        return np.asarray(reader.read(*window, bands=[number])[:, :, 0], np.float32)

    with suppress(InputError):
        return MapSurface(reader.grid, fetch)
    return None


def _measured(reader: RasterReader | None, surface: Surface) -> Surface:
    """Return what of a relief was measured or drawn; all of it where no map tells."""
    # A map of which nothing was measured is drawn as it is, hatched by no one.
    part = None if reader is None else measured_part(reader)
    if part is None:
        return surface
    return FacedSurface(part, surface.faces) if isinstance(surface, FacedSurface) else part


def _points(source: Path | Points | None) -> tuple[Points | None, tuple[str, ...]]:
    """Return the points of a table, and remarks."""
    if source is None:
        return None, ()
    points, remarks = survey_points_of(source)
    if not np.isfinite(points.xyz[:, :2]).all(axis=1).any():
        raise InputError(f"{source.name}: no point has X and Y in the plane frame.")
    return points, tuple(remarks)


def _notes(
    pair: Pair, grid: Grid, wish: DeliverTask, task: OrthoTask, reader: RasterReader | None
) -> tuple[str, ...]:
    """Return the lines of the title block."""
    words, lengths = "photo_pixel", {"own": 1000 * photo_pixel(pair, task)}
    expected: Sequence[str] = ()
    misfit = bool(doubts_of(MISFITS, pair.remarks))
    checks = [*checks_of(pair.extra.get("setup")).values(), *wish.lengths]
    if wish.checked is not None:
        count, place, deep = wish.checked
        words, lengths = "accuracy_checked", lengths | {
            "count": count, "place": 1000 * place, "relief": 1000 * deep
        }  # fmt: skip
    elif reader is not None and not misfit:
        expected = wish.expected(pair)
    relief, say = task.relief or task.points, words_of("bifocal.orthophotos", wish.language)
    if isinstance(pair, PhotosOfSet):
        distances = ", ".join(f"{photo.distance:.3f} m" for photo in pair.photos)
        cameras = say("photos_of_set", count=len(pair.photos), distances=distances)
    else:
        d1, d2 = pair.image1.distance, pair.image2.distance
        cameras = say(f"photo_{task.photo_words}", d1=d1, d2=d2)
    return (
        say("pixel", size=grid.gsd * 1000, dpi=dpi_at_scale(grid.gsd, wish.scale)),
        say(words, **lengths),
        *expected,
        *((say("lengths_checked", **agreement(checks)),) if checks else ()),
        *((say("misfit"),) if misfit else ()),
        wish.camera or cameras,
        *((say("media", media=media_words(pair.layers)),) if pair.layers else ()),
        say("relief_of", name=relief.name) if relief else say("relief_plane", plane=task.plane),
        f"{program()}, {today()}",
    )
