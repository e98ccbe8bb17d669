"""Read the cells of the sheet `Setup`, or of a user's own, found by name or label."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from bifocal.model import LEAST_COSINE
from bifocal.remarks import remark
from bifocal.survey import (
    FEWEST,
    HEIGHTS,
    MOST,
    MOST_PHOTOS,
    NORMALS,
    Measuring,
    OtherPhoto,
    SurveyLens,
    SurveyMedia,
    SurveySetup,
    Taking,
    index_names,
    media_names,
    thickness_names,
)
from bifocal.workbook.formulas.columns import adjustment_names, other_numbers
from bifocal.workbook.formulas.setup_cells import (
    INDEX_LIMITS,
    MATRICES,
    NADIRS,
    PHOTOS,
    TITLE_BLOCK,
    TYPED_FORMULAS,
    cells_of,
    formulas,
    lens_cells,
    numbers,
    other_cells,
)
from bifocal.workbook.words import headings, term
from photocore.arrays import FloatArray
from photocore.errors import CellError
from photocore.tables import Column, NamedValues, read_named_values
from photocore.tables.csvread import CsvFile
from photocore.tables.model import Kind
from photocore.tables.numbers import Decimal
from photocore.workbook import (
    SheetFile,
    cell_name,
    fixed_cell,
    quoted_title,
    split_cell,
    with_names,
)

_TEXTS = ("input_unit", "pair_file", *PHOTOS)
#: No coordinate of a photo or a map is larger.
LARGEST = 1e9
#: d_1 typed and d_2 + delta_d may differ by this much: a tape's millimetre.
_AGREE = 0.0015
#: Names that make a set-up: two of them are believed wherever they lead.
_BELIEVED = {"d_1", "d_2", "delta_d", "c_1", "c_2"}


def home_of(book: SheetFile) -> str | None:
    """Return the sheet whose names are those of the set-up.

    None where all names are: in a survey workbook, and in files that tell no formulas. Empty where
    no sheet of ours stands in a workbook of the user's own: its names may mean anything.
    """
    titles = book.titles
    if any(area.name == "tblPoints" for area in book.tables) or not book.text(titles[0]):
        return None
    for title in titles:
        sheet, row, column = book.names_on(title).get("check_order", ("", 0, 0))
        if sheet == title and '"CHECK"' in book.formula(sheet, row, column):
            return title
    return ""


def settle_names(book: SheetFile, options: Collection[str]) -> None:
    """Leave of a workbook's names those that are of a set-up.

    Where no sheet of ours stands, names of the user's own are believed if two of the values that
    make a set-up have one, and options replace neither; which were read is then a remark.
    """
    home = home_of(book)
    if home is None:
        return
    names = book.names_on(home) if home else {}
    if not home:
        stated = {n: p for n, p in book.names.items() if n in numbers() and n not in options}
        values = {n: book.grid(t).rows.get(row, {}).get(c) for n, (t, row, c) in stated.items()
                  if t in book.titles}  # fmt: skip
        read = {n: v for n, v in values.items() if isinstance(v, float)}
        if len(read.keys() & _BELIEVED) > 1:
            names = {name: stated[name] for name in read}
            readings = (f"{n} = {v:.15g} ({names[n][0]}!{cell_name(*names[n][1:])})"
                    for n, v in read.items())  # fmt: skip
            book.remarks.append(remark("table.beside_names", values=", ".join(readings)))
    book.names.clear()
    book.names.update(names)


def read_setup(
    book: SheetFile | CsvFile,
    errors: list[CellError],
    *,
    decimal: Decimal | None,
    options: Collection[str],
) -> SurveySetup:
    """Return the values of `Setup`, complaining about what cannot be meant.

    Parameters
    ----------
    book : SheetFile or CsvFile
        The workbook, or a text table, which has no other sheets and no set-up.
    errors : list of CellError
        Takes the complaints.
    decimal, given
        As in `bifocal.workbook.reading.reader.ReadOptions`.
    """
    if not isinstance(book, SheetFile):
        return SurveySetup(where=book.label)
    complaints: list[CellError] = []
    # In the workbook of a general pair sigma_s follows from sigma_px: nothing to read.
    columns = [c for c in _columns() if not (c.key == "sigma_s" and is_general(book))]
    if "d_1" in book.names and "d_2" in book.names:
        # Our own workbook: every value has its name, labels need not be searched for.
        titles = [Column(key, kind="text") for key in TITLE_BLOCK]
        columns = [c for c in (*columns, *titles) if c.key.casefold() in book.names]
    else:
        # Cells of media are found by name only: no workbook of a user's own has them otherwise.
        named_only = (*media_names(MOST, leaning=True), *lens_cells()[0])
        columns = [c for c in columns if c.key not in named_only]
    count = other_count(book.names)
    others = [name for k in other_numbers(count) for name in other_cells(k)]
    columns += [Column(name, kind="number") for name in others]
    values = read_named_values(
        book,
        columns,
        sheet="Setup",
        decimal=decimal,
        errors=complaints,
        several=True,
        options=options,
    )
    where = f"{book.label} › Setup" if "Setup" in book.titles else book.label
    live = _formulas(book, values)
    defaults = {key for key in ("sigma_s", "sigma_r_max") if key in live}
    # Cells with the template's own formula are defaults, calculated or not.
    reported = [e for e in complaints if e.column not in live]
    number = {key: values.given(key) for key in numbers() if key not in defaults}
    further = {name: values.given(name) for name in others}
    _check_positive(values, number | further, reported)
    media = _media(book, values, reported)
    d1, d2 = _distances(values, number, "d_1" in live, reported)
    unit = _unit(values, reported)
    # What options replace may hold anything, as all beside another pair that is not our workbook.
    is_idle = "pair" in options and "d_1" not in book.names
    errors.extend(e for e in reported if not is_idle and e.column not in options)
    matrices, nadirs = _general(values)
    return SurveySetup(
        taking=_stated(
            Taking,
            number,
            d1=d1,
            d2=d2,
            nadir1=_place(number["nadir_1_col"], number["nadir_1_row"]),
            nadir2=_place(number["nadir_2_col"], number["nadir_2_row"]),
        ),
        measuring=_stated(Measuring, number, unit=unit),
        sensor=_place(number["sensor_w"], number["sensor_h"]),
        pair_file=_text(values, "pair_file"),
        photo1=_text(values, "photo_1").strip(),
        photo2=_text(values, "photo_2").strip(),
        title_block={key: text for key in TITLE_BLOCK if (text := _text(values, key))},
        matrices=matrices,
        nadirs=nadirs,
        adjusted=_adjusted(book),
        media=media,
        lenses=_lenses(book, values),
        others=tuple(_other_photo(further, k) for k in other_numbers(count)),
        places=values.places,
        where=where,
        remarks=tuple(values.remarks),
        text_cells=tuple(values.text_cells),
    )


def _stated(kind: type[Any], number: Mapping[str, float | None], **values: object) -> Any:
    """Return what numbers state of the taking or measuring, besides what is known."""
    names = {f.name for f in fields(kind)} - values.keys()
    return kind(**values, **{name: number.get(*cells_of([name])) for name in names})


def _adjusted(book: SheetFile) -> tuple[FloatArray | None, FloatArray | None]:
    """Return the corrections of both photos' coordinates, None where the workbook has none."""
    matrices: list[FloatArray | None] = []
    for image in (1, 2):
        names = adjustment_names(image)
        places = [book.names[name] for name in names if name in book.names]
        cells = [book.grid(sheet).rows.get(row, {}).get(column) for sheet, row, column in places]
        numbers = [cell for cell in cells if isinstance(cell, float)]
        matrices.append(np.reshape(numbers, (3, 3)) if len(numbers) == len(names) else None)
    return matrices[0], matrices[1]


def media_count(names: Collection[str]) -> int:
    """Return for how many media a workbook has cells, by the names of its cells; 0 for air."""
    count = sum(name in names for name in index_names(MOST))
    return count if count >= FEWEST else 0


def _media(book: SheetFile, values: NamedValues, errors: list[CellError]) -> SurveyMedia | None:
    """Return what the cells of media hold, complaining about what cannot be meant."""
    count = media_count(book.names)
    if not count:
        return None
    leaning = NORMALS[0][0] in book.names
    cells = {name: values.given(name) for name in media_names(count, leaning=leaning)}
    media = SurveyMedia.of_cells(cells, count)
    complaints = {**_bad_indices(media), **_bad_thicknesses(media), **_bad_normals(media)}
    for name in HEIGHTS:
        z0 = cells[name]
        if z0 is not None and z0 < 0:
            complaints[name] = f"found {z0:g} m, expected zero or more."
        elif z0 is None and any(index is not None for index in media.indices[1:]):
            complaints[name] = "is blank: type the way from the camera to the first interface [m]."
    faulty = {error.column for error in errors}
    errors += [values.error(name, text) for name, text in complaints.items() if name not in faulty]
    return media


def _lenses(book: SheetFile, values: NamedValues) -> tuple[SurveyLens, SurveyLens] | None:
    """Return the distortion of both lenses; None where the workbook has no cells for it."""
    if "lens_1_k1" not in book.names:
        return None
    keys = ("k1", "k2", "x", "y")
    first, second = (
        SurveyLens(**{key: values.given(f"lens_{image}_{key}") for key in keys}) for image in "12"
    )
    return first, second


def other_count(names: Collection[str]) -> int:
    """Return for how many photos beside those of a pair a workbook has cells."""
    return sum(f"d_{k}" in names for k in range(3, MOST_PHOTOS + 1))


def _other_photo(cells: Mapping[str, float | None], photo: int) -> OtherPhoto:
    """Return how a photo beside those of the pair was taken."""
    c, d, enlargement, column, row = (cells[name] for name in other_cells(photo))
    return OtherPhoto(d=d, c=c, enlargement=enlargement, nadir=_place(column, row))


def _bad_indices(media: SurveyMedia) -> dict[str, str]:
    """Return what is wrong with refractive indices, by cell."""
    low, high = INDEX_LIMITS
    return {
        name: f"found {index:g}, expected a refractive index, {low:g} to {high:g}."
        for name, index in zip(index_names(media.media), media.indices, strict=True)
        if index is not None and not low <= index <= high
    }


def _bad_thicknesses(media: SurveyMedia) -> dict[str, str]:
    """Return what is wrong with thicknesses, by cell: media between two others have one."""
    stated = [n for n, index in enumerate(media.indices, start=1) if index is not None or n == 1]
    complaints = {}
    names = thickness_names(media.media)
    for n, (name, thick) in enumerate(zip(names, media.thicknesses, strict=True), start=2):
        inside = n in stated and n != stated[-1]
        if thick is not None and thick < 0:
            complaints[name] = f"found {thick:g} m, expected zero or more."
        elif inside and thick is None:
            complaints[name] = f"is blank: type the thickness of medium {n} in metres."
        elif n not in stated and thick:
            complaints[name] = f"found {thick:g} m, but index_{n} is blank: type it, or clear this."
        elif not inside and thick:
            complaints[name] = remark("survey.last_medium", thickness=thick, medium=n, next=n + 1)
    return complaints


def _bad_normals(media: SurveyMedia) -> dict[str, str]:
    """Return which normals do not point to their camera, by the cell along relief."""
    normals = {names[2]: media.normal(k) for k, names in enumerate(NORMALS, start=1)}
    return {
        name: remark("photo.interface_normal", normal=list(normal))
        for name, normal in normals.items()
        if normal is not None and not normal[2] > LEAST_COSINE * math.hypot(*normal)
    }


def is_general(book: SheetFile) -> bool:
    """Whether a workbook describes a general pair by homographies."""
    return "h1_11" in book.names


def _columns() -> list[Column]:
    columns = []
    media = media_names(MOST, leaning=True)
    for key in (*numbers(), *media, *lens_cells()[0], *_general_names(), *_TEXTS):
        entry = term("setup", key)
        unit = entry.unit if entry is not None and key not in _TEXTS else ""
        kind: Kind = "text" if key in _TEXTS else "number"
        columns.append(Column(key, headings("setup", key), kind=kind, unit=unit))
    return columns


def _general_names() -> Iterable[str]:
    return (name for group in (*MATRICES, *NADIRS) for name in group)


def _text(values: NamedValues, key: str) -> str:
    return values.text(key) if key in values.values else ""


def _formulas(book: SheetFile, values: NamedValues) -> set[str]:
    """Return which cells hold the template's own formula instead of a typed number."""
    typed = set()
    places = {
        name: f"{quoted_title(sheet)}!{fixed_cell(*place)}"
        for name, (sheet, *place) in book.names.items()
    }
    for key in values.places.keys() & set(TYPED_FORMULAS):
        sheet, cell = values.places[key]
        # Those of older versions are a part of today's.
        formula = _plain(with_names(book.formula(sheet, *split_cell(cell)), places))
        if formula.startswith("if(") and formula in _plain(formulas()[key]):
            typed.add(key)
    return typed


def _plain(formula: str) -> str:
    """Return a formula without blanks, case and sheet-name noise."""
    return re.sub(r"[\s$]", "", formula).casefold()


def _check_positive(
    values: NamedValues, number: dict[str, float | None], errors: list[CellError]
) -> None:
    for key, value in number.items():
        if value is not None and not key.startswith("nadir") and value <= 0:
            errors.append(values.error(key, f"found {value:g}, expected a number above zero."))
        elif value is not None and not 1e-9 < abs(value or 1.0) < LARGEST:
            errors.append(values.error(key, f"found {value:g}, which cannot be meant; correct it."))


def _distances(
    values: NamedValues, number: dict[str, float | None], is_formula: bool, errors: list[CellError]
) -> tuple[float | None, float | None]:
    """Return d_1 and d_2, the one not typed by delta_d; complain if all are given and differ."""
    near, step = number["d_2"], number["delta_d"]
    typed = None if is_formula else number["d_1"]
    total = near + step if near is not None and step is not None else None
    if typed is not None and total is not None and abs(typed - total) > _AGREE:
        about = {"far": typed, "near": near, "step": step, "total": total}
        errors.append(values.error("d_1", remark("survey.distances_differ", **about)))
    far = typed if typed is not None else total
    if near is None and far is not None and step is not None and far > step:
        near = far - step
    return far, near


def _place(column: float | None, row: float | None) -> tuple[float, float] | None:
    return None if column is None or row is None else (column, row)


def _unit(values: NamedValues, errors: list[CellError]) -> str:
    """Return the input unit, millimetres where the cell is blank."""
    text = _text(values, "input_unit").strip().casefold()
    if text in ("px", "pixel", "pixels", "pix"):
        return "px"
    if text not in ("", "mm"):
        errors.append(values.error("input_unit", f'found "{text}", expected mm or px.'))
    return "mm"


def _general(
    values: NamedValues,
) -> tuple[tuple[FloatArray, FloatArray] | None, tuple[FloatArray, FloatArray]]:
    """Return homographies and nadirs on the wall, if the workbook describes a general pair."""
    if not all(name in values.values and values.has(name) for name in _general_names()):
        return None, (np.zeros(2), np.zeros(2))
    first, second = (
        np.array([values.number(name) for name in names]).reshape(3, 3) for names in MATRICES
    )
    nadirs = [np.array([values.number(name) for name in names]) for names in NADIRS]
    return (first, second), (nadirs[0], nadirs[1])
