"""Read measured points from whatever people bring: our workbook, their own, or a text table."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bifocal.remarks import remark
from bifocal.survey import (
    TAPE,
    KnownPoints,
    PointObservations,
    SurveyInput,
    TapedDistance,
    pixel_keys,
    where_of,
    with_measured,
)
from bifocal.workbook.formulas.columns import other_keys
from bifocal.workbook.reading.row_checks import PIXELS, POLAR, XY, check_rows
from bifocal.workbook.reading.setup_reader import (
    LARGEST,
    is_general,
    other_count,
    read_setup,
    settle_names,
)
from bifocal.workbook.words import LANGUAGES, headings, word
from photocore.errors import CellError, InputError, WorkbookError
from photocore.tables import (
    Column,
    Table,
    open_tables,
    parse_column_map,
    read_named_values,
    read_table,
)
from photocore.tables.advice import advice
from photocore.tables.csvread import CsvFile
from photocore.tables.heading_words import bare
from photocore.tables.model import Kind
from photocore.tables.numbers import Decimal
from photocore.workbook import TEXT_KEYS, SheetFile, uncollected

#: Units expected where neither heading nor cell says one; that of x1..y2 depends on `Setup`.
_UNITS = {"theta": "deg", "r_measured": "m", "s1": "mm", "s2": "mm"} | dict.fromkeys(PIXELS, "px")
#: Coordinates of both photos under one heading each, in the order of the photos.
_SHARED = {key: key.rstrip("12") for key in (*XY, *PIXELS)}
#: Headings of image coordinates in other programs: i counts columns, j rows.
_OTHER = {"col1": "i", "row1": "j", "col2": "i", "row2": "j"}
TO_DEGREES = {"deg": 1.0, "gon": 0.9, "rad": float(np.degrees(1.0))}
TO_MM = {"mm": 1.0, "cm": 10.0, "um": 1e-3, "m": 1000.0}
TO_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "dm": 0.1}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """How to read: columns by hand, sheet, decimal separator, hidden rows.

    Attributes
    ----------
    columns : mapping
        Key to heading or column letter.
    sheet : str or None
        The sheet of the points.
    decimal : {"point", "comma"} or None
        Decimal separator of numbers typed as text.
    visible_only : bool
        Leave hidden rows out.
    given : collection of str
        Cells of the set-up that options replace, by their names; ``pair`` replaces them all.
    photos : int
        Photos that the points were measured in; of more than two raw pixels alone are read, and a
        point may be blank in any.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    sheet: str | None = None
    decimal: Decimal | None = None
    visible_only: bool = False
    given: Collection[str] = ()
    photos: int = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class _KnownTable:
    """Check or control points as read.

    Attributes
    ----------
    points : KnownPoints
    rows : tuple of int
        Their rows in the sheet.
    remarks, text_cells : tuple of str
        What the user should know; cells whose number was typed as text.
    """

    points: KnownPoints = field(default_factory=KnownPoints)
    rows: tuple[int, ...] = ()
    remarks: tuple[str, ...] = ()
    text_cells: tuple[str, ...] = ()


def _more_pixels(photos: int) -> list[str]:
    """Return the keys of raw pixels of the third photo and more."""
    return [key for number in range(3, photos + 1) for key in pixel_keys(number)]


def point_columns(*, shared: Sequence[str] = (), photos: int = 2, others: int = 0) -> list[Column]:
    """Return the columns of measured points with every heading that is understood.

    Parameters
    ----------
    photos : int
        Photos that they were measured in.
    others : int
        Photos beside an ideal pair, of which the workbook has coordinates.
    shared : sequence of str
        Keys that also take the headings "x y x y" or "col row col row" of photos 1 and 2. Tables
        of points often hold X and Y on the wall too, so this is tried where nothing else fits.
    """
    columns = []
    for key in ("id", *XY, *POLAR, *PIXELS, "use", "code", "note", "r_measured"):
        more = [_SHARED[key], *([_OTHER[key]] if key in _OTHER else [])] if key in shared else []
        columns.append(understood(key, more=more, unit=_UNITS.get(key, "")))
    columns += [Column(key, (key,), kind="number") for key in other_keys(others)]
    for key in _more_pixels(photos):
        names = [name for name in headings("columns", f"{key[:3]}1") if "1" in name]
        further = (name.replace("1", key[3:]) for name in names)
        columns.append(Column(key, tuple(further), kind="number", unit="px"))
    return columns


def understood(
    key: str, *, more: Sequence[str] = (), unit: str = "", required: bool = False
) -> Column:
    """Return a column to read, with every heading that is understood."""
    kind: Kind = "text" if key in TEXT_KEYS else "flag" if key == "use" else "number"
    names = dict.fromkeys((*headings("columns", key), *more))
    return Column(key, tuple(names), kind=kind, unit=unit, required=required)


def column_map(text: str | None) -> dict[str, str]:
    """Return key to heading or column letter from what a user typed; empty for None."""
    return parse_column_map(text, [column.key for column in point_columns()]) if text else {}


@uncollected()
def read_survey(path: Path | str, options: ReadOptions | None = None) -> SurveyInput:
    """Read a survey: points, set-up, check points and control points.

    Parameters
    ----------
    path : path
        ``.xlsx``, ``.xlsm``, ``.ods`` or ``.csv``.
    options : ReadOptions, optional
        How to read.

    Returns
    -------
    SurveyInput

    Raises
    ------
    WorkbookError
        Naming every bad cell of all sheets.
    InputError
        If the file or a sheet cannot be used at all.
    """
    options = options or ReadOptions()
    book, errors = open_tables(path), list[CellError]()
    if isinstance(book, SheetFile):
        settle_names(book, options.given)
    table = _read_points(book, options, errors)
    if options.photos > 2:
        _require_photos(table, options.photos)
    else:
        _require_coordinates(table, book, path)
    points, unit = _observations(table, errors, options.photos)
    sheets = book if isinstance(book, SheetFile) else None
    setup = read_setup(book, errors, decimal=options.decimal, options=options.given)
    check = _known(book, "Check", ("X_ref", "Y_ref", "Z_ref"), options.decimal, errors)
    control = _known(book, "Georeference", ("E", "N", "H"), options.decimal, errors)
    parts = (table, setup, check, control)
    model, language, is_ours, tape = "auto", "en", False, None
    if sheets is not None:
        named = read_named_values(
            sheets, [Column("g_model", kind="text")], sheet="Georeference", errors=errors
        )
        model = named.text("g_model") or "auto"
        tape = _taped(sheets, options.decimal, errors)
        language = _language(sheets)
        is_ours = any(area.name == "tblPoints" for area in sheets.tables)
    if errors:
        raise WorkbookError(errors)
    remarks = [remark for part in (table, check, control) for remark in part.remarks]
    remarks += _typed_as_text([cell for part in parts for cell in part.text_cells])
    return SurveyInput(
        points=points,
        setup=setup,
        unit=unit,
        known=with_measured(check.points.called_as(points.ids), points),
        control=control.points.called_as(points.ids),
        tape=tape,
        model=model,
        language=language,
        is_ours=is_ours,
        table=table,
        book=sheets,
        titles=() if sheets is None else tuple(sheets.titles),
        known_rows=check.rows,
        control_rows=control.rows,
        remarks=tuple(dict.fromkeys(remarks)),
    )


def _taped(
    book: SheetFile, decimal: Decimal | None, errors: list[CellError]
) -> TapedDistance | None:
    """Return the distance taped on site, where its three cells are filled in."""
    if not all(name in book.names for name in TAPE):
        return None
    columns = [Column(name, kind="text") for name in TAPE[:2]]
    columns.append(Column(TAPE[2], kind="number", unit="m"))
    cells = read_named_values(book, columns, sheet="Check", decimal=decimal, errors=errors)
    first, second, length = cells.text(TAPE[0]), cells.text(TAPE[1]), cells.given(TAPE[2])
    if length is not None and not 0 < length <= LARGEST:
        errors.append(cells.error(TAPE[2], f"found {length:g} m, expected a length above zero."))
    if length is None or not (first and second):
        return None
    return TapedDistance(ends=(first, second), length=length)


def _known(
    book: SheetFile | CsvFile,
    sheet: str,
    keys: tuple[str, str, str],
    decimal: Decimal | None,
    errors: list[CellError],
) -> _KnownTable:
    """Return check or control points of the sheet made for them; nothing where it is absent."""
    if not isinstance(book, SheetFile):
        return _KnownTable()
    names = {bare(sheet), bare(f"tbl{sheet}"), "tblgeo" if sheet == "Georeference" else ""}
    areas = [area for area in book.tables if bare(area.name) in names]
    titles = [title for title in book.titles if bare(title) in names]
    if not areas and not titles:
        return _KnownTable()
    table = read_table(
        book,
        [understood(key, required=key == "id") for key in ("id", *keys, "use")],
        name="Geo" if sheet == "Georeference" and areas else sheet,
        sheet=areas[0].sheet if areas else titles[0],
        decimal=decimal,
        as_typed=True,
        errors=errors,
    )
    faulty = {(error.sheet, error.cell) for error in errors}
    errors += table.repeated("id")
    errors += table.too_large(keys, LARGEST)
    xyz = np.stack([table.in_unit(key, TO_M, errors) for key in keys], axis=-1)
    use = table.numbers("use")
    rows = [i for i, name in enumerate(table.texts("id")) if name]
    for i, name in enumerate(table.texts("id")):
        own_complaint = (table.sheet, table.cell(i, "id")) in faulty
        if not name and not own_complaint and not np.isnan(xyz[i]).all():
            errors.append(table.error(i, "id", "coordinates without the name of a point."))
    return _KnownTable(
        points=KnownPoints(
            ids=tuple(table.texts("id")[i] for i in rows),
            xyz=xyz[rows],
            use=(np.isnan(use) | (use != 0))[rows],
        ),
        rows=tuple(table.rows[i] for i in rows),
        remarks=tuple(text for text in table.remarks if "rows directly below" not in text),
        text_cells=tuple(table.text_cells),
    )


def _typed_as_text(cells: Sequence[str]) -> list[str]:
    """Return what is said about numbers that the formulas of a workbook do not see."""
    if not cells:
        return []
    more = f" and {len(cells) - 10} more" if len(cells) > 10 else ""
    return [
        f"{', '.join(cells[:10])}{more}: numbers typed as text. They were read, but formulas do "
        "not see them: the result workbook (--out) holds them as numbers."
    ]


def _read_points(book: SheetFile | CsvFile, options: ReadOptions, errors: list[CellError]) -> Table:
    """Return the table of points; headings that both photos share are the last resort."""
    # In the workbook of a general pair x1..y2 are formulas that follow from the raw pixels.
    general = isinstance(book, SheetFile) and is_general(book)
    others = other_count(book.names) if isinstance(book, SheetFile) else 0
    followed = {*XY, *POLAR} if general else set()
    # Points of our own sheets, and of more photos than two, may lack many numbers.
    ours = isinstance(book, SheetFile) and any(area.name == "tblPoints" for area in book.tables)
    for shared in ((), PIXELS, XY):
        last = shared == XY
        complaints: list[CellError] = []
        try:
            table = read_table(
                book,
                [
                    column
                    for column in point_columns(shared=shared, photos=options.photos, others=others)
                    if column.key not in followed
                ],
                name="Points",
                sheet=options.sheet,
                decimal=options.decimal,
                column_map=options.columns or None,
                visible_only=options.visible_only,
                whole=options.photos == 2 and not ours,
                as_typed=isinstance(book, SheetFile),
                errors=complaints,
            )
        except InputError:
            if last:
                raise
            continue
        keys = table.present & {*XY, *PIXELS, "s1", "s2"}
        if last or (keys and (not shared or table.present.issuperset(shared))):
            break
    errors.extend(complaints)
    for key in followed:
        table.values[key] = np.full(len(table), np.nan)
    return table


def _require_coordinates(table: Table, book: object, path: Path | str) -> None:
    """Refuse a table without the coordinates of both photos.

    Raises
    ------
    InputError
        Naming the missing sheet or columns.
    """
    have = table.present
    kinds = (XY, PIXELS, ("s1", "s2"))
    # A column that is missing beside filled ones matters even where another kind is complete.
    broken = any(
        not have.issuperset(keys)
        and any(not np.isnan(table.numbers(key)).all() for key in keys if key in have)
        for keys in kinds
    )
    if not broken and any(have.issuperset(keys) for keys in kinds):
        return
    where = where_of(table)
    ours = isinstance(book, SheetFile) and bare(table.sheet) != "points"
    if ours and not any(bare(title) == "points" for title in book.titles):  # type: ignore[attr-defined]
        shown = ", ".join(f'"{title}"' for title in book.titles)  # type: ignore[attr-defined]
        text = remark("survey.no_points_sheet", of=Path(path).name, sheets=shown)
        raise InputError(f"{text} {advice('rename', first='id')}")
    groups = [keys for keys in kinds if have & set(keys) and not have.issuperset(keys)]
    columns = groups[0] if groups else XY
    missing = ", ".join(key for key in columns if key not in have)
    how = advice("rename", first=missing.partition(",")[0])
    raise InputError(f"{remark('survey.no_column', of=where, missing=missing)} {how}")


def _require_photos(table: Table, photos: int) -> None:
    """Refuse a table that lacks the raw pixels of two photos of a set, or half of one's.

    Raises
    ------
    InputError
        Naming the missing columns.
    """
    groups = [pixel_keys(number) for number in range(1, photos + 1)]
    whole = [keys for keys in groups if table.present.issuperset(keys)]
    halves = [key for keys in groups for key in keys if keys not in whole]
    broken = [
        key for keys in groups if keys not in whole and table.present & {*keys} for key in keys
    ]
    if broken or len(whole) < 2:
        lacking = next(key for key in broken or halves if key not in table.present)
        about = {"of": where_of(table), "missing": lacking, "photos": photos}
        how = advice("rename", first=lacking)
        raise InputError(f"{remark('survey.no_column_of_set', **about)} {how}")


def _observations(
    table: Table, errors: list[CellError], photos: int = 2
) -> tuple[PointObservations, str]:
    """Return the points and the unit of x1..y2 that the headings say."""
    faulty = {(error.cell, error.column) for error in errors}
    ids = table.texts("id")
    if "id" not in table.present:
        ids = [str(number) for number in range(1, len(table) + 1)]
    is_angle = bare(table.headings.get("theta", "")) in ("angle", "angolo", "winkel")
    if is_angle and len(table) and "s1" in table.present and "x1" not in table.present:
        about = {"cell": table.cell(0, "theta"), "heading": table.headings["theta"]}
        table.remarks.append(remark("survey.angle_as_theta", **about))
    errors += table.repeated("id")
    more = _more_pixels(photos)
    errors += table.too_large((*XY, *POLAR, *PIXELS, *more, "r_measured"), LARGEST)
    use = table.numbers("use")
    unit, factor = _unit_of_xy(table, errors)
    units = dict(zip(POLAR, (TO_MM, TO_MM, TO_DEGREES), strict=True))
    turn = 2 * np.pi / np.radians(TO_DEGREES.get(table.units.get("theta", "deg"), 1.0))
    for row in np.flatnonzero(np.abs(table.numbers("theta")) > turn + 1e-9).tolist():
        angle = float(table.numbers("theta")[row])
        message = remark("survey.beyond_a_turn", angle=angle, turn=float(turn))
        errors.append(table.error(row, "theta", message))
    units["r_measured"] = TO_M
    columns = {key: table.in_unit(key, factors, errors) for key, factors in units.items()}
    columns |= {key: table.numbers(key) * factor for key in XY}
    columns |= {key: table.numbers(key) for key in (*PIXELS, *more)}
    texts = {"id": ids, "code": table.texts("code"), "note": table.texts("note")}
    used = np.isnan(use) | (use != 0)
    points = PointObservations.from_columns({**texts, "use": used, **columns})
    others = [int(key[1:]) for key in table.present if re.fullmatch(r"[xy][3-9]", key)]
    if others:
        keys = other_keys(max(others) - 2)
        errors += table.too_large(keys, LARGEST)
        typed = np.stack([table.numbers(key) * factor for key in keys], axis=-1)
        points = replace(points, other_xy=typed.reshape(len(table), len(keys) // 2, 2))
    check_rows(table, points, faulty, errors)
    return points, unit


def _unit_of_xy(table: Table, errors: list[CellError]) -> tuple[str, float]:
    """Return ``mm`` or ``px`` as the headings say, and the factor to it."""
    units = {key: table.units[key] for key in XY if table.units.get(key)}
    kinds = set(units.values())
    if not kinds:
        return "", 1.0
    if len(kinds) > 1:
        key = next(iter(units))
        shown = ", ".join(f"{name} [{symbol}]" for name, symbol in units.items())
        errors.append(
            CellError(
                remark("survey.units_differ", units=shown),
                file=table.file,
                sheet=table.sheet,
                column=key,
            )
        )
        return "", 1.0
    symbol = kinds.pop()
    bare_keys = [k for k in XY if k not in units and not np.isnan(table.numbers(k)).all()]
    for key in sorted(table.typed_units.intersection(units)) if bare_keys else ():
        row = int(np.flatnonzero(~np.isnan(table.numbers(key)))[0])
        message = remark("survey.unit_of_one", unit=symbol, others=", ".join(bare_keys))
        errors.append(table.error(row, key, message))
    if symbol == "px":
        return "px", 1.0
    if symbol not in TO_MM:
        errors.append(table.unit_error(next(iter(units)), symbol, "mm or px"))
        return "", 1.0
    return "mm", TO_MM[symbol]


def _language(book: SheetFile) -> str:
    """Return the language of a survey workbook by the title of its sheet `Points`."""
    title = next((name for name in book.titles if bare(name) == "points"), None)
    if title is not None:
        words = {str(cell) for cell in book.grid(title).rows.get(1, {}).values()}
        for language in LANGUAGES:
            if word("Points", language) in words:
                return language
    return "en"
