"""Two relief maps in, a folder with what has changed out."""

from __future__ import annotations

import math
import os
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.comparison.change import ChangedRegion, Comparison, compare
from bifocal.comparison.change_report import change_document
from bifocal.comparison.photo_evidence import holds_photos, photos_at_hand
from bifocal.files import add_text, new_drawing, save_drawing
from bifocal.model import ReliefMap, create_raster
from bifocal.remarks import remark
from photocore.arrays import FloatArray, as_floats
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.jsonfile import read_object
from photocore.output import atomic_folder, atomic_path
from photocore.reports import write_document
from photocore.tables import write_csv
from photocore.workbook import plain_cell, save_book

#: Bands of the difference.
BANDS = ("difference [m]", "sigma [m]", "region (0 no change proven, -1 another surface seen)")
#: Layers of the drawing: what came forward, what went back, numbers; contours by their interval.
LAYERS = {"BIFOCAL_FORWARD": 1, "BIFOCAL_BACK": 5, "BIFOCAL_NAMES": 7}


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedFiles:
    """A comparison, and the files that tell it."""

    comparison: Comparison
    folder: Path
    files: tuple[str, ...]

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is to be known of it."""
        return self.comparison.remarks

    def lines(self) -> list[str]:
        """Return what people are told."""
        done = self.comparison
        sentences = [f"Compared  {done.compared:.1f} m2; errors hang together over "
                f"{done.correlation_length:.2f} m"]  # fmt: skip
        if any(done.sigma_trend):
            sentences.append(f"Common    {1000 * done.trend[0]:+.2f} mm, taken off")
        sentences += [
            f"Proven    over {area:.2g} m2: {_least(half)} on half of the wall, "
            f"{_least(most)} on nine tenths"
            for area, half, most in done.patches[1:3]
        ]
        sentences.append(f"Regions   {len(done.regions) or 'none: no change is proven'}")
        sentences += [
            f"  {one.number}  X {one.X:.2f}  Y {one.Y:.2f}  {one.area:.3f} m2  "
            f"{1000 * one.mean:+.1f} +- {1000 * one.sigma_mean:.1f} mm  "
            f"{1000 * one.volume:+.2f} +- {1000 * one.sigma_volume:.2f} dm3  "
            f"{100 * one.measured:.0f} % measured"
            for one in done.regions[:10]
        ]
        return [*sentences, f"Written   {self.folder}: {', '.join(self.files)}"]

    def to_dict(self) -> dict[str, object]:
        """Return it for ``--json``."""
        done = self.comparison
        return {
            "regions": [asdict(one) for one in done.regions],
            "compared": done.compared, "level": done.level,
            "correlation_length": done.correlation_length,
            "trend": done.trend, "sigma_trend": done.sigma_trend,
            "patches": [
                {"area": area, "change": _finite(half), "change_most": _finite(most)}
                for area, half, most in done.patches
            ],
            "folder": str(self.folder), "files": self.files, "remarks": done.remarks,
        }  # fmt: skip


def _least(change: float) -> str:
    """Say from which change on, or that none would be proven. [m]"""
    return f"from {1000 * change:.1f} mm" if math.isfinite(change) else "none"


def compare_files(
    before: Path,
    after: Path,
    out: Path,
    *,
    stable: Path | None = None,
    fit: bool = False,
    smallest: float = 0.02,
    language: str = "en",
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> ComparedFiles:
    """Compare two relief maps and write a folder.

    Parameters
    ----------
    before, after : Path
        Relief maps, or files of pairs and sets with their ``relief.tif`` beside them. The photos
        that a map says it is of are asked where they are at hand.
    out : Path
        Folder: difference.tif, regions.csv, .xlsx and .dxf, report.html and .pdf.
    stable : Path, optional
        GeoJSON polygons of parts that did not move.

    Raises
    ------
    InputError
        If a file is unusable, the maps have nothing in common, a map was made from another state
        of the pair that is named, or the folder cannot be written.
    """
    if stable is not None and fit:
        raise InputError(remark("compare.stable_and_fit"))
    paths = [_relief_of(path) for path in (before, after)]
    if os.path.realpath(paths[0]) == os.path.realpath(paths[1]):
        raise InputError(f"{before}: is compared with itself; name two dates.")
    polygons = [] if stable is None else _polygons(stable)
    with atomic_folder(out, overwrite=overwrite) as folder:
        progress(0.1, 1, "reading")
        maps = [ReliefMap.read(path) for path in paths]
        progress(0.2, 1, "testing")
        first, second = map(photos_at_hand, (before, after), paths)
        both = None if first is None or second is None else (first, second)
        done = compare(maps[0], maps[1], stable=polygons, fit=fit, smallest=smallest, dates=both)
        if done.regions and both is None:
            done = replace(done, remarks=(*done.remarks, remark("compare.maps_alone")))
        progress(0.7, 1, "writing")
        _write_map(folder / "difference.tif", done)
        _write_tables(folder, done)
        _write_drawing(folder / "regions.dxf", done)
        names = tuple(path.name for path in (before, after))
        if names[0] == names[1]:
            names = tuple(f"{path.absolute().parent.name}/{path.name}" for path in (before, after))
        document = change_document(done, (names[0], names[1]), language)
        for name in ("report.html", "report.pdf"):
            write_document(folder / name, document)
        files = tuple(sorted(path.name for path in folder.iterdir()))
    return ComparedFiles(comparison=done, folder=out, files=files)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _relief_of(path: Path) -> Path:
    """Return the relief map a file stands for."""
    if not holds_photos(path):
        return path
    stem = path.name.rsplit(".", 2)[0]
    places = [path.with_name(name) for name in (f"{stem}_relief.tif", f"{stem}.tif", "relief.tif")]
    for place in places:
        if place.is_file():
            return place
    raise InputError(
        f"{path}: has no relief beside it ({', '.join(place.name for place in places)}); make it "
        "with bifocal relief."
    )


def _polygons(path: Path) -> list[FloatArray]:
    """Return the outer rings of the polygons of a GeoJSON file, each of shape (n, 2). [m]"""
    data = read_object(path, what="GeoJSON file of polygons")
    items = data.get("features", [data])
    rings = []
    for number, item in enumerate(items if isinstance(items, list) else [], start=1):
        shape = item.get("geometry", item) if isinstance(item, dict) else {}
        try:
            parts: Any = shape["coordinates"]
            outer = {"Polygon": [parts], "MultiPolygon": parts}[shape["type"]]
            rings += [as_floats(part[0], "ring")[:, :2] for part in outer]
        except (KeyError, TypeError, IndexError, InputError):
            raise InputError(remark("compare.no_polygon", path=path, number=number)) from None
    if not rings or any(len(ring) < 3 or not np.isfinite(ring).all() for ring in rings):
        raise InputError(remark("compare.no_polygon", path=path, number=1))
    return rings


def _write_map(path: Path, done: Comparison) -> None:
    difference = done.difference
    with create_raster(
        path, difference.grid, bands=3, dtype=np.float32, names=BANDS, nodata=float("nan")
    ) as writer:
        layers = (difference.r, difference.sigma, done.region.astype(np.float32))
        writer.write(np.stack(layers, axis=-1), column=0, row=0)


def _write_tables(folder: Path, done: Comparison) -> None:
    """Write the regions as CSV and as a plain table of values in a workbook."""
    from openpyxl import Workbook

    units = dict.fromkeys(("number", "probability", "measured", "open_rim"), "")
    units |= {"area": "m2", "volume": "m3"}
    keys = [field.name for field in fields(ChangedRegion)]
    headings = [
        f"{key} [{unit}]" if (unit := units.get(key.removeprefix("sigma_"), "m")) else key
        for key in keys
    ]
    rows = [asdict(one) for one in done.regions]
    columns = {
        heading: np.array([row[key] for row in rows])
        for heading, key in zip(headings, keys, strict=True)
    }
    write_csv(folder / "regions.csv", columns)
    book = Workbook(write_only=True)
    sheet = book.create_sheet("Regions")
    sheet.append(headings)
    for row in rows:
        sheet.append([plain_cell(sheet, float(row[key])) for key in keys])
    with atomic_path(folder / "regions.xlsx", overwrite=False) as temporary:
        save_book(book, temporary)


def _write_drawing(path: Path, done: Comparison) -> None:
    """Write outlines of the regions, contours of the change inside them, and numbers."""
    from contourpy import contour_generator

    grid = done.difference.grid
    height = max(0.01, round(max(grid.shape) * grid.gsd / 150, 3))
    drawing, model = new_drawing(LAYERS, point_style=3, point_size=height)

    smooth = done.smooth

    def draw(field: FloatArray, levels: FloatArray, layer: str) -> None:
        lines = contour_generator(z=np.pad(field, 1), name="serial")
        for line in (line for level in levels.tolist() for line in lines.lines(level)):
            places = [grid.x0, grid.y0] + (np.asarray(line) - 1) * [grid.gsd, -grid.gsd]
            model.add_lwpolyline(places.tolist(), dxfattribs={"layer": layer})

    for one in done.regions:
        part = done.region == one.number
        outline = "BIFOCAL_FORWARD" if one.mean > 0 else "BIFOCAL_BACK"
        draw(part.astype(float), np.array([0.5]), outline)
        interval = 10 ** np.floor(np.log10(abs(one.largest) / 2))
        levels = np.arange(1, int(1.5 * abs(one.largest) / interval) + 1) * interval
        draw(np.where(part, np.abs(smooth), 0.0), levels, f"BIFOCAL_CONTOURS_{1000 * interval:g}MM")
        words = f"{one.number}: {1000 * one.mean:+.1f} mm"
        add_text(model, words, (one.X, one.Y), height, "BIFOCAL_NAMES")
    with atomic_path(path, overwrite=False) as temporary:
        save_drawing(drawing, temporary)
