"""One list of picks per photo, from CAD or an image viewer, joined by the names of the points."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.remarks import remark
from bifocal.survey import PointObservations
from bifocal.workbook.reading.reader import TO_MM
from bifocal.workbook.reading.setup_reader import LARGEST
from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError, WorkbookError
from photocore.tables import Column, read_table
from photocore.tables.drawing_points import model_space, named_points
from photocore.tables.numbers import Decimal

#: Headings of image viewers: pixels, rows down.
_COLUMNS = (
    Column("id", aliases=("Point", "Punto", "Punkt", "Name", "Nr", "Label"), kind="text"),
    Column("x", aliases=("x1", "x2"), unit=""),
    Column("y", aliases=("y1", "y2"), unit=""),
    Column("col", aliases=("column", "col1", "col2", "i", "u", "pixel x"), unit="px"),
    Column("row", aliases=("row1", "row2", "line", "j", "v", "pixel y"), unit="px"),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PickList:
    """Picks of one photo.

    Attributes
    ----------
    ids : tuple of str, length n
    places : ndarray, shape (n, 2)
        (column, row) [px], or x, y from the nadir, y up [mm].
    unit : str
        ``px``, ``mm``, or empty where the file does not say.
    file : Path
    """

    ids: tuple[str, ...]
    places: FloatArray
    unit: str
    file: Path


def read_picks(path: Path | str, decimal: Decimal | None = None) -> PickList:
    """Read the picks of one photo.

    Parameters
    ----------
    path : path
        A table (``.csv .xlsx .ods``) with the headings id and x, y or col, row; or a drawing
        (``.dxf``): a POINT with its name as the nearest TEXT, or TEXT alone, its insertion point
        being the pick. Attach the photo to the drawing, or place its top left corner at 0, 0 with
        one unit per pixel: y then is negative; else its coordinates are x, y from the nadir.
    decimal : {"point", "comma"}, optional
        Decimal separator of numbers typed as text.

    Raises
    ------
    InputError
        If the file holds no picks, or a point has no name or two places.
    """
    path = Path(path)
    picks = _of_drawing(path) if path.suffix.lower() == ".dxf" else _of_table(path, decimal)
    if not picks.ids:
        raise InputError(f"{path}: holds no picks.")
    names: set[str] = set()
    for name in picks.ids:
        if name in names:
            raise InputError(f"{path}: the point {name!r} stands there twice; give each one place.")
        names.add(name)
    return picks


def joined(first: PickList, second: PickList, unit: str | None = None) -> PointObservations:
    """Return the points that stand in both lists, in the order of the first.

    Raises
    ------
    InputError
        If the lists share no name, or have different units.
    """
    units = {unit} if unit else {first.unit, second.unit} - {""}
    if len(units) > 1:
        files = {"first": first.file, "second": second.file}
        unit_words = {"unit1": first.unit, "unit2": second.unit}
        raise InputError(remark("survey.units_of_lists", **files, **unit_words))
    place = {name: row for row, name in enumerate(second.ids)}
    ids = tuple(name for name in first.ids if name in place)
    if not ids:
        first_ids, second_ids = (", ".join(one.ids[:3]) for one in (first, second))
        files = {"first": first.file, "second": second.file}
        raise InputError(
            remark("survey.no_common_point", **files, here=first_ids, there=second_ids)
        )
    rows = {name: row for row, name in enumerate(first.ids)}
    one = first.places[[rows[name] for name in ids]]
    partners = second.places[[place[name] for name in ids]]
    if (units or {"px"}) == {"px"}:
        return PointObservations(ids=ids, pixels1=one, pixels2=partners)
    return PointObservations(ids=ids, xy1=one, xy2=partners)


def left_over(first: PickList, second: PickList) -> list[str]:
    """Return a sentence for each list that holds points which the other does not."""
    notes = []
    for one, partner in ((first, second), (second, first)):
        alone = [name for name in one.ids if name not in set(partner.ids)]
        if alone:
            more = " ..." if len(alone) > 10 else ""
            notes.append(
                f"{one.file.name}: {len(alone)} point(s) not in {partner.file.name}, left out: "
                f"{', '.join(alone[:10])}{more}"
            )
    return notes


def _of_table(path: Path, decimal: Decimal | None) -> PickList:
    """Return the picks of a text table or workbook."""
    errors: list[CellError] = []
    table = read_table(path, _COLUMNS, name="Points", decimal=decimal, errors=errors)
    keys = ("col", "row") if {"col", "row"} <= table.present else ("x", "y")
    if not set(keys) <= table.present or "id" not in table.present:
        raise InputError(remark("survey.no_pick_columns", of=path))
    errors += table.too_large(keys, LARGEST)
    names = [name or "" for name in table.texts("id")]
    places = np.stack([table.numbers(key) for key in keys], axis=-1)
    for row, name in enumerate(names):
        filled = ~np.isnan(places[row])
        if filled.any() and not filled.all():
            key = keys[int(np.argmin(filled))]
            errors.append(table.error(row, key, "is blank; a pick has two coordinates."))
        elif filled.all() and not name:
            errors.append(table.error(row, "id", "the pick has no name; give it one."))
    if errors:
        raise WorkbookError(errors)
    symbol = "px" if keys[0] == "col" else table.units.get("x", "")
    factor = TO_MM.get(symbol, 1.0)
    if symbol not in (*TO_MM, "px", ""):
        raise InputError(f"{path}: coordinates in {symbol}; give them in px or mm.")
    keep = np.array([bool(name) for name in names]) & ~np.isnan(places).any(axis=1)
    return PickList(
        ids=tuple(name for name, kept in zip(names, keep, strict=True) if kept),
        places=places[keep] * factor,
        unit="mm" if symbol in TO_MM else symbol,
        file=path,
    )


def _of_drawing(path: Path) -> PickList:
    """Return the picks of a drawing."""
    model = model_space(path)
    named = named_points(model, path)
    places: FloatArray = np.array([place[:2] for _, place in named]).reshape(-1, 2)
    unit = ""
    images = list(model.query("IMAGE"))
    if len(images) > 1:
        raise InputError(f"{path}: {len(images)} images; a list of picks is of one photo.")
    if images:
        places, unit = _pixels_of_image(images[0], places), "px"
    elif len(places) and (places[:, 1] <= 0).all() and (places[:, 0] >= 0).all():
        # The corner of the photo at 0, 0; pixels are counted from their centres.
        places, unit = places * [1.0, -1.0] - 0.5, "px"
    else:
        unit = "mm"
    return PickList(ids=tuple(name for name, _ in named), places=places, unit=unit, file=path)


def _pixels_of_image(image: Any, places: FloatArray) -> FloatArray:
    """Return the pixels of places in a drawing on the photo attached there."""
    dxf = image.dxf
    corner = np.array(tuple(dxf.insert)[:2])  # lower left corner of the photo
    axes = np.array([tuple(dxf.u_pixel)[:2], tuple(dxf.v_pixel)[:2]])  # of one pixel
    inside = np.linalg.solve(axes.T, (places - corner).T).T
    return np.stack([inside[:, 0] - 0.5, dxf.image_size[1] - inside[:, 1] - 0.5], axis=-1)
