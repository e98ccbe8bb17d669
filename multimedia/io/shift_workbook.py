"""The multimedia workbook: radial shift and refractive index as live formulas with their values."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from openpyxl import Workbook
from openpyxl.formatting.rule import FormulaRule
from openpyxl.styles import Alignment, Border, Font, PatternFill, Side
from openpyxl.utils import get_column_letter
from openpyxl.workbook.defined_name import DefinedName
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.table import Table, TableFormula, TableStyleInfo
from openpyxl.worksheet.worksheet import Worksheet

from multimedia.domain.shift_points import ShiftPoints, ShiftSetup
from multimedia.unrolled import STEPS, TOLERANCE, unrolled_shift
from multimedia.water import (
    QUAN_FRY,
    salinity_from_index,
    water_index_derivatives,
    water_refractive_index,
)
from photocore.errors import InputError
from photocore.output import check_writable
from photocore.spreadsheet.cellxml import CellInput
from photocore.spreadsheet.editor import WorkbookEditor

#: More rows make a workbook that is slow to open; text tables have no limit.
MOST_ROWS = 20_000

_INPUT = PatternFill("solid", start_color="FFF9DB", end_color="FFF9DB")
_HEAD = PatternFill("solid", start_color="DCE6F1", end_color="DCE6F1")
_EDGE = Border(*(Side(style="hair", color="BFBFBF"),) * 4)
_FORMULA, _TITLE, _BOLD = Font(color="1F3FA8"), Font(bold=True, size=14), Font(bold=True)
_SMALL, _NOTE = Font(size=9), Font(italic=True, color="595959")
_FLAGS = {
    "OK": ("E2F0D9", "1E5B12"),
    "CHECK": ("E4DFEC", "3F2A63"),
    "DRY": ("FCE4D6", "9C3D00"),
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


@dataclass(slots=True, eq=False)
class _Book:
    """A workbook under construction, with the values its formulas will show."""

    book: Workbook = field(default_factory=Workbook)
    results: list[tuple[str, int, int, CellInput]] = field(default_factory=list)
    inputs: list[tuple[str, int, int, float]] = field(default_factory=list)

    def sheet(self, name: str, title: str, note: str, *, first: bool = False) -> Worksheet:
        sheet: Worksheet = self.book.active if first else self.book.create_sheet()
        sheet.title = name
        sheet["A1"], sheet["A1"].font = title, _TITLE
        sheet["A2"], sheet["A2"].font = note, _NOTE
        sheet.sheet_view.showGridLines = False
        sheet.page_setup.paperSize = 9  # A4
        sheet.page_setup.orientation = "landscape"
        sheet.sheet_properties.pageSetUpPr.fitToPage = True
        sheet.page_setup.fitToHeight = 0
        sheet.oddFooter.left.text, sheet.oddFooter.right.text = "&F · &A", "&P / &N"
        return sheet

    def formula(self, sheet: Worksheet, row: int, column: int, text: str, value: CellInput) -> None:
        cell = sheet.cell(row, column, f"={text}")
        cell.font = _FORMULA
        self.results.append((sheet.title, row, column, value))

    def typed(self, sheet: Worksheet, row: int, column: int, value: CellInput) -> None:
        cell = sheet.cell(row, column)
        if value is not None and value == value:
            cell.value = value
            if isinstance(value, str):
                cell.data_type = "s"  # a name like =A1 is a name, not a formula
            elif float(f"{value:.16g}") != value:
                self.inputs.append((sheet.title, row, column, float(value)))
        cell.fill, cell.border = _INPUT, _EDGE

    def name(self, name: str, sheet: Worksheet, row: int, column: int) -> None:
        place = f"'{sheet.title}'!${get_column_letter(column)}${row}"
        self.book.defined_names[name] = DefinedName(name, attr_text=place)

    def save(self, path: Path, *, overwrite: bool) -> None:
        """Write the workbook, then put the values into its formula cells."""
        check_writable(path, overwrite=overwrite)
        with tempfile.TemporaryDirectory() as folder:
            plain = Path(folder) / "plain.xlsx"
            self.book.save(plain)
            editor = WorkbookEditor(plain)
            for title, row, column, number in self.inputs:  # openpyxl writes 16 digits only
                editor.set_value(title, row, column, number)
            for title, row, column, value in self.results:
                editor.set_result(title, row, column, value)
            editor.save(path, overwrite=overwrite)


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
    if path.suffix.lower() != ".xlsx":
        raise InputError(f"{path}: the workbook must end in .xlsx.")
    if not 1 <= steps <= 30:
        raise InputError(f"newton: 1 to 30 steps, found {steps}.")
    count = max(rows, len(points.ids) if points else 0)
    if not 1 <= count <= MOST_ROWS:
        raise InputError(
            f"{path}: {count} rows; a workbook may have 1 to {MOST_ROWS}. Write a .csv file."
        )
    check_writable(path, overwrite=overwrite)
    book = _Book()
    readme = book.sheet("Readme", "Photogrammetry through water", "", first=True)
    readme.column_dimensions["A"].width = 110
    for row, line in enumerate(_README, start=3):
        cell = readme.cell(row, 1, line.lstrip("#"))
        cell.alignment = Alignment(wrap_text=True, vertical="top")
        cell.font = _BOLD if line.startswith("#") else Font()
        # openpyxl cannot ask for automatic heights; LibreOffice and Excel wrap at about 115 signs.
        readme.row_dimensions[row].height = 15 * (1 + len(line) // 115)
    index = _refractive_index(book)
    setup_rows = _media(book, setup, index if points is None else None)
    if points is None:
        media = ShiftSetup(
            layers=type(setup.layers)(
                indices=(*setup.layers.indices[:-1], index), thicknesses=setup.layers.thicknesses
            ),
            z0=setup.z0,
            nadir=setup.nadir,
        )
    else:
        media = setup
    _points(book, media, points, first=setup_rows + 3, count=count, steps=steps)
    book.book.move_sheet("RefractiveIndex", 1)
    book.book.active = 1
    for sheet in book.book.worksheets:
        sheet.sheet_view.tabSelected = sheet.title == "Multimedia"
    book.save(path, overwrite=overwrite)


def _refractive_index(book: _Book) -> float:
    """Write the sheet of the refractive index; return the index it shows."""
    sheet = book.sheet(
        "RefractiveIndex",
        "Refractive index of water",
        "Fill in the yellow cells; salinity in per cent (sea water 3.5).",
    )
    sheet.column_dimensions["A"].width, sheet.column_dimensions["B"].width = 18, 66
    sheet.column_dimensions["C"].width, sheet.column_dimensions["D"].width = 14, 10
    given = {
        "wavelength_nm": (550.0, "Wavelength; blue 460, green 550, red 620", "nm", (180, 1200)),
        "temperature_c": (
            20.0,
            "Water temperature; the formulas hold from 0 to 30",
            "°C",
            (-5, 100),
        ),
        "salinity_percent": (
            0.0,
            "Salinity; sea water 3.5 (per cent)",
            "%",
            (0, 30),
        ),
        "depth_m": (0.0, "Water depth", "m", (0, 11000)),
    }
    _headings(sheet, 4, ("name", "description", "value", "unit"))
    for row, (name, (value, words, unit, limits)) in enumerate(given.items(), start=5):
        sheet.cell(row, 1, name)
        sheet.cell(row, 2, words)
        sheet.cell(row, 4, unit)
        book.typed(sheet, row, 3, value)
        book.name(name, sheet, row, 3)
        _between(sheet, f"C{row}", limits, words)
    nm, celsius = given["wavelength_nm"][0], given["temperature_c"][0]
    slopes = water_index_derivatives(
        wavelength_nm=nm, temperature_c=celsius, salinity_percent=0.0, depth=0.0
    )
    n_w = float(slopes.refractive_index)
    quan_fry = water_refractive_index(
        wavelength_nm=nm, temperature_c=celsius, salinity_percent=0.0, depth=0.0, formula=QUAN_FRY
    )
    measured = 1.3345
    salinity = salinity_from_index(measured, wavelength_nm=nm, temperature_c=celsius, depth=0.0)
    results = (
        ("n_w", "Refractive index (Höhle 1971; Maas 2015, Eq. 4)",
         "1.338+4E-5*(486+0.003*depth_m+50*salinity_percent-wavelength_nm-temperature_c)", n_w, ""),
        ("n_w_quan_fry", "Refractive index (Quan and Fry 1995), for comparison", _QUAN_FRY_FORMULA,
         float(quan_fry), ""),
        ("dn_dT", "Change of n_w per degree", "-4E-5", float(slopes.d_temperature), "1/°C"),
        ("dn_dS", "Change of n_w per per cent of salt", "4E-5*50", float(slopes.d_salinity), "1/%"),
    )  # fmt: skip
    _headings(sheet, 10, ("result", "description", "value", "unit"))
    for row, (name, words, text, value, unit) in enumerate(results, start=11):
        sheet.cell(row, 1, name)
        sheet.cell(row, 2, words)
        sheet.cell(row, 4, unit)
        book.formula(sheet, row, 3, text, value)
        sheet.cell(row, 3).number_format = "0.000000"
    book.name("n_w", sheet, 11, 3)
    _headings(sheet, 16, ("inverse", "description", "value", "unit"))
    sheet.cell(17, 1, "n_measured")
    sheet.cell(17, 2, "A measured index, e.g. from an adjustment")
    book.typed(sheet, 17, 3, measured)
    book.name("n_measured", sheet, 17, 3)
    sheet.cell(18, 1, "salinity")
    sheet.cell(18, 2, "Salinity of that water (Höhle)")
    sheet.cell(18, 4, "%")
    text = "((n_measured-1.338)/4E-5-486-0.003*depth_m+wavelength_nm+temperature_c)/50"
    book.formula(sheet, 18, 3, text, float(salinity))
    sheet.cell(18, 3).number_format = "0.000"
    sheet.freeze_panes = "A5"
    return n_w


#: Quan and Fry's Eq. (3) in the names of the sheet; their salinity is per mille.
_QUAN_FRY_FORMULA = (
    "1.31405+(0.0001779-0.00000105*temperature_c+0.000000016*temperature_c^2)*10*salinity_percent"
    "-0.00000202*temperature_c^2"
    "+(15.868+0.01155*10*salinity_percent-0.00423*temperature_c)/wavelength_nm"
    "-4382/wavelength_nm^2+1145500/wavelength_nm^3"
)


def _media(book: _Book, setup: ShiftSetup, live_index: float | None) -> int:
    """Write camera and media; return the last row used."""
    sheet = book.sheet(
        "Multimedia",
        "Radial shift through plane-parallel media",
        "Yellow: fill in. Blue: calculated. All lengths in one unit. See Readme.",
    )
    layers, count = setup.layers, len(setup.layers.indices)
    _headings(sheet, 4, ("name", "value", "k", "q"))
    row = 5
    for i, index in enumerate(layers.indices, start=1):
        sheet.cell(row, 1, f"n_{i}")
        last = i == count
        if last and live_index is not None:
            book.formula(sheet, row, 2, "n_w", live_index)
            sheet.cell(row, 2).fill = _INPUT
            index = live_index
        else:
            book.typed(sheet, row, 2, index)
        _between(sheet, f"B{row}", (1, 3), "Refractive index, camera's medium first; at least 1.")
        book.name(f"n_{i}", sheet, row, 2)
        row += 1
    every = [*layers.indices[:-1], layers.indices[-1] if live_index is None else live_index]
    for i, index in enumerate(every, start=1):
        k = min(every) / index
        book.formula(sheet, 4 + i, 3, f"MIN($B$5:$B${4 + count})/n_{i}", k)
        book.formula(sheet, 4 + i, 4, f"1-k_{i}^2", 1 - k * k)
        book.name(f"k_{i}", sheet, 4 + i, 3)
        book.name(f"q_{i}", sheet, 4 + i, 4)
    typed: list[tuple[str, float]] = [(f"t_{i}", t) for i, t in enumerate(layers.thicknesses, 1)]
    typed += [("z_0", setup.z0), ("X_0", setup.nadir[0]), ("Y_0", setup.nadir[1])]
    for name, value in typed:
        sheet.cell(row, 1, name)
        book.typed(sheet, row, 2, value)
        book.name(name, sheet, row, 2)
        if name[0] in "tz":
            _between(sheet, f"B{row}", (0, 1e9), "A length, zero or more.")
        row += 1
    return row - 1


def _points(
    book: _Book,
    setup: ShiftSetup,
    points: ShiftPoints | None,
    *,
    first: int,
    count: int,
    steps: int,
) -> None:
    """Write the table of points; its keys stand in row ``first``."""
    sheet = book.book["Multimedia"]
    columns = _columns(len(setup.layers.indices), steps)
    values = _values(setup, points, count, steps)
    for number, (key, label, text) in enumerate(columns, start=1):
        above, head = sheet.cell(first - 1, number, label), sheet.cell(first, number, key)
        above.font, head.font, head.fill = _SMALL, _BOLD, _HEAD
        above.alignment = Alignment(wrap_text=True, horizontal="center", vertical="bottom")
        head.alignment = Alignment(horizontal="center")
        sheet.column_dimensions[get_column_letter(number)].width = 13 if number > 1 else 11
        for i in range(count):
            row, value = first + 1 + i, values[key][i]
            if text:
                book.formula(sheet, row, number, text, value)
            else:
                book.typed(sheet, row, number, value)
            cell = sheet.cell(row, number)
            cell.number_format = "@" if key == "id" else "0.0E+00" if key == "resid" else "General"
    sheet.row_dimensions[first - 1].height = 42
    last = get_column_letter(len(columns))
    table = Table(displayName="tblMM", name="tblMM", ref=f"A{first}:{last}{first + count}")
    table._initialise_columns()
    for described, (key, _, text) in zip(table.tableColumns, columns, strict=True):
        described.name = key
        if text:
            described.calculatedColumnFormula = TableFormula(attr_text=text)
    table.tableStyleInfo = TableStyleInfo(name="TableStyleLight1", showRowStripes=False)
    sheet.add_table(table)
    for flag, (fill, ink) in _FLAGS.items():
        rule = FormulaRule(
            formula=[f'${last}{first + 1}="{flag}"'],
            fill=PatternFill("solid", start_color=fill, end_color=fill),
            font=Font(color=ink, bold=flag != "OK"),
            stopIfTrue=True,
        )
        sheet.conditional_formatting.add(f"{last}{first + 1}:{last}{first + count}", rule)
    letters = {key: get_column_letter(i) for i, (key, _, _) in enumerate(columns, start=1)}
    for key in ("R", "ZP"):
        place = f"{letters[key]}{first + 1}:{letters[key]}{first + count}"
        _between(sheet, place, (0, 1e9), "A length, zero or more; in water ZP is positive.")
    sheet.freeze_panes = f"B{first + 1}"
    sheet.print_title_rows = f"{first - 1}:{first}"


def _columns(layers: int, steps: int) -> list[tuple[str, str, str]]:
    """Return key, label and formula of every column; inputs have no formula."""

    def at(key: str) -> str:
        return f"tblMM[[#This Row],[{key}]]"

    heights = ["z_0", *(f"t_{i}" for i in range(1, layers - 1)), at("ZP_u")]
    k = [f"{h}*k_{i}" for i, h in enumerate(heights, start=1)]

    def f(u: str) -> str:
        return "+".join(f"{part}/SQRT(1+q_{i}*{u}^2)" for i, part in enumerate(k, start=1))

    def slope(u: str) -> str:
        return "+".join(f"{part}/(1+q_{i}*{u}^2)^1.5" for i, part in enumerate(k, start=1))

    r, end = at("R_u"), at(f"u{steps}")
    given = f"AND(COUNT({r},{at('ZP_u')})=2,N({at('ZP_u')})>=0)"
    columns = [
        ("id", "Point", ""),
        ("X", "X", ""),
        ("Y", "Y", ""),
        ("Z", "Z (water: < 0)", ""),
        ("R", "or: distance from nadir", ""),
        ("ZP", "and: depth", ""),
        ("R_u", "R used",
         f"IF(COUNT({at('R')})=1,{at('R')},IF(COUNT({at('X')},{at('Y')})=2,"
         f'SQRT(({at("X")}-X_0)^2+({at("Y")}-Y_0)^2),""))'),
        ("ZP_u", "depth used",
         f'IF(COUNT({at("ZP")})=1,{at("ZP")},IF(COUNT({at("Z")})=1,-{at("Z")},""))'),
        ("u0", "tan b, start", f'IF({given},{r}/({"+".join(k)}),"")'),
    ]  # fmt: skip
    for step in range(steps):
        u = at(f"u{step}")
        text = f'IF({u}="","",{u}+({r}-{u}*({f(u)}))/({slope(u)}))'
        columns.append((f"u{step + 1}", f"tan b, step {step + 1}", text))
    whole = "+".join(heights)
    columns += [
        ("Rbar", "shifted R", f'IF({end}="","",({whole})*k_1*{end}/SQRT(1+q_1*{end}^2))'),
        ("dR", "shift Rbar - R", f'IF({end}="","",{at("Rbar")}-{r})'),
    ]
    for axis in "XY":
        columns.append(
            (f"{axis}bar", f"shifted {axis}",
             f'IF(OR({end}="",COUNT({at("X")},{at("Y")})<2),"",'
             f"{axis}_0+({at(axis)}-{axis}_0)*IF({r}=0,1,{at('Rbar')}/{r}))")
        )  # fmt: skip
    columns += [
        ("resid", "F(u) - R", f'IF({end}="","",{end}*({f(end)})-{r})'),
        ("flag", "OK / CHECK / DRY",
         f'IF(COUNT({r},{at("ZP_u")})<2,"",IF({at("ZP_u")}<0,"DRY",'
         f'IF(ABS({at("resid")})<={TOLERANCE:.0E}*{r},"OK","CHECK")))'),
    ]  # fmt: skip
    return columns


def _values(
    setup: ShiftSetup, points: ShiftPoints | None, count: int, steps: int
) -> dict[str, list[CellInput]]:
    """Return what every column shows, blank rows included."""
    keys = [key for key, _, _ in _columns(len(setup.layers.indices), steps)]
    values: dict[str, list[CellInput]] = {key: [None] * count for key in keys[:6]}
    values |= {key: [""] * count for key in keys[6:]}
    if points is None:
        return values
    # Not layers.heights: the sheet computes with what it holds.
    heights: list[ArrayLike] = [setup.z0, *setup.layers.thicknesses, points.depth]
    found = unrolled_shift(points.radius, heights, setup.layers.indices, steps=steps)
    with_xy = np.asarray(np.isfinite(points.xy).all(axis=1)).tolist()
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(points.radius == 0, 1.0, found.radius_bar / points.radius)
    nadir = np.asarray(setup.nadir)
    xy_bar = nadir + (points.xy - nadir) * ratio[:, None]
    for i, name in enumerate(points.ids):
        values["id"][i] = name
        if with_xy[i]:
            values["X"][i], values["Y"][i] = (float(v) for v in points.xy[i])
            values["Z"][i] = float(-points.depth[i])
            values["Xbar"][i], values["Ybar"][i] = (float(v) for v in xy_bar[i])
        else:
            values["R"][i], values["ZP"][i] = float(points.radius[i]), float(points.depth[i])
        values["R_u"][i], values["ZP_u"][i] = float(points.radius[i]), float(points.depth[i])
        for step, u in enumerate(found.u):
            values[f"u{step}"][i] = float(u[i])
        bar, left = float(found.radius_bar[i]), float(found.residual[i])
        values["Rbar"][i], values["resid"][i] = bar, left
        values["dR"][i] = bar - float(points.radius[i])
        values["flag"][i] = "OK" if abs(left) <= TOLERANCE * points.radius[i] else "CHECK"
    return values


def _headings(sheet: Worksheet, row: int, words: Sequence[str]) -> None:
    """Write a row of headings."""
    for column, word in enumerate(words, start=1):
        cell = sheet.cell(row, column, word)
        cell.font, cell.fill = _BOLD, _HEAD


def _between(sheet: Worksheet, cells: str, limits: tuple[float, float], prompt: str) -> None:
    """Refuse numbers outside the limits, with a prompt."""
    rule = DataValidation(
        type="decimal",
        operator="between",
        formula1=f"{limits[0]:g}",
        formula2=f"{limits[1]:.0f}",
        allow_blank=True,
        showErrorMessage=True,
        showInputMessage=True,
        promptTitle="multimedia",
        prompt=prompt,
    )
    rule.add(cells)
    sheet.add_data_validation(rule)
