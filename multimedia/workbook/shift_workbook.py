"""The multimedia workbook: radial shift and refractive index as live formulas with their values."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from openpyxl.styles import Alignment, Font
from openpyxl.utils import get_column_letter

from multimedia.refraction.layers import HIGHEST_INDEX
from multimedia.refraction.unrolled import STEPS, TOLERANCE, unrolled_shift
from multimedia.workbook.index_sheet import write_index_sheet
from multimedia.workbook.live_book import BOLD, NOTE, SMALL, LiveBook, allow_between, headings
from multimedia.workbook.shift_points import IN_PLANE, ShiftPoints, ShiftResult, ShiftSetup
from photocore.arrays import BoolArray
from photocore.errors import InputError
from photocore.output import check_ending
from photocore.workbook.cells import CellValue
from photocore.workbook.look import HEAD_FILL, INPUT_FILL, add_table, colour_words
from photocore.workbook.newbook import check_new_workbook

#: More rows make a workbook that is slow to open; text tables have no limit.
MOST_ROWS = 20_000

#: Columns that the user fills in, besides the name.
INPUTS = ("X", "Y", "Z", "R", "ZP")

_FLAGS = {"OK": ("E2F0D9", "1E5B12"), "CHECK": ("E4DFEC", "3F2A63"), "DRY": ("FCE4D6", "9C3D00")}

_WORDS = {
    "z_0": "distance from the camera's centre to the first interface",
    "X_0": "X of the camera",
    "Y_0": "Y of the camera",
}

_README = (
    "#What this is",
    "Photogrammetry through water: where a straight ray would see a point that is seen through "
    "air, glass and water (radial shift), and the refractive index of water. No macros.",
    "#How to use it",
    "Fill in the yellow cells; everything blue is calculated. All lengths in one unit, any.",
    "RefractiveIndex: light and water; n_w feeds the last index on the sheet Multimedia.",
    "Multimedia: the media from the camera to the object (n_1 air, n_2 glass, n_3 water; t_1 "
    "thickness of the glass), z_0 from the camera's centre to the first interface, X_0 Y_0 of the "
    "camera. Then the points: X, Y, Z (Z = 0 at the water side of the interface, negative in "
    "water), or R and ZP (distance from the camera's nadir, depth). Put Xbar, Ybar and Z into the "
    "collinearity equations instead of X, Y, Z.",
    "New rows: drag the corner of the table down. Without glass set t_1 to 0.",
    "#What is calculated",
    "R = z_0 tan(b1) + t_1 tan(b2) + ZP tan(b3), Rbar = (z_0 + t_1 + ZP) tan(b1), "
    "n_1 sin(b1) = n_2 sin(b2) = n_3 sin(b3): Maas, Sensors 15(8), 2015, Eqs. (1) to (3).",
    "u is tan(b) in the medium of the smallest index; k = n_min / n, q = 1 - k^2. u0 is the start, "
    "u1 u2 ... are Newton steps for R = F(u) = u * sum(h k / sqrt(1 + q u^2)). F is increasing and "
    "bends downwards, so the steps cannot diverge.",
    "resid = F(u) - R after the last step. flag: OK when |resid| is under 1e-9 of R; CHECK when "
    "not (very oblique rays: write the workbook with more steps, multimedia template --newton 10; "
    "or no ray exists); DRY when the point is above the water.",
    "Precision: 1e-9 of Rbar up to 75 degrees in the thinnest medium with six steps.",
    "n_w = 1.338 + 4e-5 (486 + 0.003 d + 50 S - wavelength - T): Höhle 1971; Maas 2015, Eq. (4). "
    "Salinity S in per cent: sea water 3.5.",
)


def write_shift_workbook(
    path: Path | str,
    setup: ShiftSetup,
    points: ShiftPoints | None = None,
    *,
    rows: int = 50,
    steps: int = STEPS,
    overwrite: bool = False,
) -> None:
    """Write the workbook, whole or not at all.

    Parameters
    ----------
    path : path
        An .xlsx file.
    setup : ShiftSetup
        Camera and media.
    points : ShiftPoints, optional
        The points; without any the table is empty, and the index of the last medium is that of
        the sheet RefractiveIndex.
    rows : int
        Least number of prepared rows.
    steps : int
        Newton columns.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    InputError
        If the file cannot be written, or rows or steps are out of range.
    """
    path = Path(path)
    check_ending(path, "the workbook must end in .xlsx.", ".xlsx")
    if not 1 <= steps <= 30:
        raise InputError(f"newton: 1 to 30 steps, found {steps}.")
    count = max(rows, len(points.ids) if points else 0)
    if not 1 <= count <= MOST_ROWS:
        raise InputError(
            f"{path}: {count} rows; a workbook may have 1 to {MOST_ROWS}. Write a .csv file."
        )
    check_new_workbook(path, overwrite=overwrite, other="" if points is None else "-result")
    book = LiveBook()
    readme = book.sheet("Readme", "Photogrammetry through water", "", first=True)
    readme.column_dimensions["A"].width = 110
    for row, line in enumerate(_README, start=3):
        cell = readme.cell(row, 1, line.lstrip("#"))
        cell.alignment = Alignment(wrap_text=True, vertical="top")
        cell.font = BOLD if line.startswith("#") else Font()
        # openpyxl cannot ask for automatic heights; LibreOffice and Excel wrap at about 115 signs.
        readme.row_dimensions[row].height = 15 * (1 + len(line) // 115)
    index = write_index_sheet(book)
    if points is None:
        indices = (*setup.layers.indices[:-1], index)
        setup = replace(setup, layers=replace(setup.layers, indices=indices))
    setup_rows = media_cells(book, setup, live=points is None)
    _points(book, setup, points, first=setup_rows + 3, count=count, steps=steps)
    book.book.move_sheet("RefractiveIndex", 1)
    book.book.active = 1
    for sheet in book.book.worksheets:
        sheet.sheet_view.tabSelected = sheet.title == "Multimedia"
    book.save(path, overwrite=overwrite)


def media_cells(
    book: LiveBook,
    setup: ShiftSetup,
    *,
    live: bool = False,
    links: Mapping[str, str] | None = None,
) -> int:
    """Write the sheet of camera and media, without points; return the last row used.

    Parameters
    ----------
    book : LiveBook
        Takes the sheet.
    setup : ShiftSetup
        Camera and media.
    live : bool
        Whether the last index is that of the sheet RefractiveIndex.
    links : mapping, optional
        By name, the cells of the user's own that hold a value; formulas here refer to them. None
        in a workbook that is all ours.
    """
    named, links = links is None, dict(links or {})
    sheet = book.sheet(
        "Multimedia",
        "Radial shift through plane-parallel media",
        "Yellow: fill in. Blue: calculated. All lengths in one unit."
        + (" See Readme." if named else ""),
        first=not named,
    )
    layers, count = setup.layers, len(setup.layers.indices)
    headings(sheet, 4, ("name", "value", "k", "q"))
    for i, index in enumerate(layers.indices, start=1):
        row = 4 + i
        sheet.cell(row, 1, f"n_{i}")
        if i == count and live:
            links[f"n_{i}"] = "n_w"
        if f"n_{i}" in links:
            book.formula(sheet, row, 2, links[f"n_{i}"], index)
            sheet.cell(row, 2).fill = INPUT_FILL
        else:
            book.typed(sheet, row, 2, index)
        words = "Refractive index, at least 1; the camera's first."
        allow_between(sheet, f"B{row}", (1, HIGHEST_INDEX), words)
        k = min(layers.indices) / index
        # In a workbook of the user's own the names may be taken.
        own, ratio = (f"n_{i}", f"k_{i}") if named else (f"$B${row}", f"$C${row}")
        book.formula(sheet, row, 3, f"MIN($B$5:$B${4 + count})/{own}", k)
        book.formula(sheet, row, 4, f"1-{ratio}^2", 1 - k * k)
        sheet.cell(row, 3).number_format = sheet.cell(row, 4).number_format = "0.000000"
        for column, name in enumerate("nkq", start=2):
            book.name(f"{name}_{i}", sheet, row, column)
        place = "the camera" if i == 1 else "the object" if i == count else f"layer {i - 1}"
        sheet.cell(row, 5, f"refractive index of the medium of {place}").font = NOTE
    row = 5 + count
    typed: list[tuple[str, float]] = [(f"t_{i}", t) for i, t in enumerate(layers.thicknesses, 1)]
    typed += [("z_0", setup.z0), ("X_0", setup.nadir[0]), ("Y_0", setup.nadir[1])]
    for name, value in typed:
        sheet.cell(row, 1, name)
        if name in links:
            book.formula(sheet, row, 2, links[name], value)
            sheet.cell(row, 2).fill = INPUT_FILL
        else:
            book.typed(sheet, row, 2, value)
        book.name(name, sheet, row, 2)
        words = _WORDS.get(name, f"thickness of layer {name[2:]}")
        sheet.cell(row, 5, words).font = NOTE
        if name[0] in "tz":
            allow_between(sheet, f"B{row}", (0, 1e9), "A length, zero or more.")
        row += 1
    return row - 1


def _points(
    book: LiveBook,
    setup: ShiftSetup,
    points: ShiftPoints | None,
    *,
    first: int,
    count: int,
    steps: int,
) -> None:
    """Write the table of points; its keys stand in row ``first``."""
    sheet = book.book["Multimedia"]
    columns = shift_columns(len(setup.layers.indices), steps)
    values = table_values(setup, points, count, steps)
    for number, (key, label, text) in enumerate(columns, start=1):
        above, head = sheet.cell(first - 1, number, label), sheet.cell(first, number, key)
        above.font, head.font, head.fill = SMALL, BOLD, HEAD_FILL
        above.alignment = Alignment(wrap_text=True, horizontal="center", vertical="bottom")
        head.alignment = Alignment(horizontal="center")
        sheet.column_dimensions[get_column_letter(number)].width = 13 if number > 1 else 11
        for i in range(count):
            row, value = first + 1 + i, values[key][i]
            if text:
                book.formula(sheet, row, number, text, value)
            else:
                book.typed(sheet, row, number, value)
            sheet.cell(row, number).number_format = number_format(key)
    sheet.row_dimensions[first - 1].height = 42
    last = get_column_letter(len(columns))
    keyed = ((key, text) for key, _, text in columns)
    add_table(sheet, "tblMM", f"A{first}:{last}{first + count}", keyed)
    flags = f"{last}{first + 1}:{last}{first + count}"
    colour_words(sheet, flags, _FLAGS, bold=_FLAGS.keys() - {"OK"}, stop=True)
    letters = {key: get_column_letter(i) for i, (key, _, _) in enumerate(columns, start=1)}
    for key in ("R", "ZP"):
        place = f"{letters[key]}{first + 1}:{letters[key]}{first + count}"
        allow_between(sheet, place, (0, 1e9), "A length, zero or more; in water ZP is positive.")
    sheet.freeze_panes = f"B{first + 1}"
    sheet.print_title_rows = f"{first - 1}:{first}"


def _in_table(key: str) -> str:
    return f"tblMM[[#This Row],[{key}]]"


def media_places(layers: int) -> dict[str, tuple[int, int]]:
    """Return row and column of each value on the sheet of `media_cells`, by name."""
    places = {f"{kind}_{i}": (4 + i, c) for c, kind in enumerate("nkq", start=2)
              for i in range(1, layers + 1)}  # fmt: skip
    lengths = [*(f"t_{i}" for i in range(1, layers - 1)), "z_0", "X_0", "Y_0"]
    return places | {name: (5 + layers + i, 2) for i, name in enumerate(lengths)}


def shift_columns(
    layers: int,
    steps: int,
    *,
    at: Callable[[str], str] = _in_table,
    value: Callable[[str], str] = str,
    given: Collection[str] = INPUTS,
) -> list[tuple[str, str, str]]:
    """Return key, label and formula of every column; inputs have no formula.

    Parameters
    ----------
    layers : int
        Media, the camera's and the object's with them.
    steps : int
        Newton columns.
    at : callable
        Returns what a formula calls the cell of a column in its own row.
    value : callable
        Returns what a formula calls a value of the set-up, ``k_1`` for instance.
    given : collection of str
        The input columns there are.
    """
    heights = [*map(value, ("z_0", *(f"t_{i}" for i in range(1, layers - 1)))), at("ZP_u")]
    k = [f"{h}*{value(f'k_{i}')}" for i, h in enumerate(heights, start=1)]
    q = [value(f"q_{i}") for i in range(1, layers + 1)]

    def f(u: str) -> str:
        return "+".join(f"{a}/SQRT(1+{b}*{u}^2)" for a, b in zip(k, q, strict=True))

    def slope(u: str) -> str:
        return "+".join(f"{a}/(1+{b}*{u}^2)^1.5" for a, b in zip(k, q, strict=True))

    r, end = at("R_u"), at(f"u{steps}")
    whole_row = f"AND(COUNT({r},{at('ZP_u')})=2,N({at('ZP_u')})>=0)"
    radius, depth = '""', '""'
    if {"X", "Y"} <= set(given):
        off = f"({at('X')}-{value('X_0')})^2+({at('Y')}-{value('Y_0')})^2"
        radius = f'IF(COUNT({at("X")},{at("Y")})=2,SQRT({off}),"")'
    if "R" in given:
        radius = f"IF(COUNT({at('R')})=1,{at('R')},{radius})"
    if "Z" in given:
        depth = f'IF(COUNT({at("Z")})=1,-{at("Z")},"")'
    if "ZP" in given:
        depth = f"IF(COUNT({at('ZP')})=1,{at('ZP')},{depth})"
    columns = [
        ("id", "Point", ""),
        ("X", "X", ""),
        ("Y", "Y", ""),
        ("Z", "Z (water: < 0)", ""),
        ("R", "or: distance from nadir", ""),
        ("ZP", "and: depth", ""),
        ("R_u", "R used", radius),
        ("ZP_u", "depth used", depth),
        ("u0", "tan b, start", f'IF({whole_row},{r}/({"+".join(k)}),"")'),
    ]
    for step in range(steps):
        u = at(f"u{step}")
        text = f'IF({u}="","",{u}+({r}-{u}*({f(u)}))/({slope(u)}))'
        columns.append((f"u{step + 1}", f"tan b, step {step + 1}", text))
    whole = "+".join(heights)
    columns += [
        ("Rbar", "shifted R",
         f'IF({end}="","",({whole})*{value("k_1")}*{end}/SQRT(1+{q[0]}*{end}^2))'),
        ("dR", "shift Rbar - R", f'IF({end}="","",{at("Rbar")}-{r})'),
    ]  # fmt: skip
    for axis in "XY" if {"X", "Y"} <= set(given) else "":
        centre = value(f"{axis}_0")
        columns.append(
            (f"{axis}bar", f"shifted {axis}",
             f'IF(OR({end}="",COUNT({at("X")},{at("Y")})<2),"",'
             f"{centre}+({at(axis)}-{centre})*IF({r}=0,1,{at('Rbar')}/{r}))")
        )  # fmt: skip
    columns += [
        ("resid", "F(u) - R", f'IF({end}="","",{end}*({f(end)})-{r})'),
        ("flag", "OK, CHECK or DRY",
         f'IF(COUNT({r},{at("ZP_u")})<2,"",IF({at("ZP_u")}<0,"DRY",'
         f'IF(ABS({at("resid")})<={TOLERANCE:.0E}*{r},"OK","CHECK")))'),
    ]  # fmt: skip
    return columns


def table_values(
    setup: ShiftSetup, points: ShiftPoints | None, count: int, steps: int
) -> dict[str, list[CellValue]]:
    """Return what every column shows, blank rows included."""
    keys = [key for key, _, _ in shift_columns(len(setup.layers.indices), steps)]
    values: dict[str, list[CellValue]] = {key: [None] * count for key in keys[:6]}
    values |= {key: [""] * count for key in keys[6:]}
    if points is None:
        return values
    # Not layers.heights: the sheet computes with what it holds.
    heights: list[ArrayLike] = [setup.z0, *setup.layers.thicknesses, points.depth]
    shift = unrolled_shift(points.radius, heights, setup.layers.indices, steps=steps)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(points.radius == 0, 1.0, shift.radius_bar / points.radius)
    nadir = np.asarray(setup.nadir)
    xy_bar = nadir + (points.xy - nadir) * ratio[:, None]
    solved = np.abs(shift.residual) <= TOLERANCE * points.radius
    columns = ShiftResult(
        radius_bar=shift.radius_bar,
        xy_bar=xy_bar,
        flags=tuple("OK" if good else "CHECK" for good in solved),
    ).columns(points, every=True)
    columns |= {f"u{step}": u for step, u in enumerate(shift.u)}
    columns |= {"R_u": points.radius, "ZP_u": points.depth, "resid": shift.residual}
    with_xy = np.asarray(np.isfinite(points.xy).all(axis=1))
    for key, column in columns.items():
        shown: BoolArray = np.ones(len(points.ids), dtype=bool)
        if key in (*IN_PLANE, "R", "ZP"):
            shown = with_xy if key in IN_PLANE else ~with_xy
        for i in np.flatnonzero(shown).tolist():
            values[key][i] = column[i] if key in ("id", "flag") else float(column[i])
    return values


def number_format(key: str) -> str:
    """Return how a column is shown; every digit is kept."""
    if key == "id":
        return "@"
    if key == "resid":
        return "0.0E+00"
    if key in ("X", "Y", "Z", "R", "ZP", "flag"):
        return "General"
    return "0.000000" if key[0] == "u" else "0.00000"
