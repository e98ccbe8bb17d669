"""The sheet RefractiveIndex: the index of water as live formulas."""

from __future__ import annotations

from typing import Any

from openpyxl.worksheet.worksheet import Worksheet

from multimedia.refraction.water import (
    QUAN_FRY,
    salinity_from_index,
    water_index_derivatives,
    water_refractive_index,
)
from multimedia.workbook.live_book import LiveBook, allow_between, headings

#: Name, value, description, unit and limits of the cells to fill in.
_GIVEN = (
    ("wavelength_nm", 550.0, "Wavelength; blue 460, green 550, red 620", "nm", (180, 1200)),
    ("temperature_c", 20.0, "Water temperature; the formulas hold from 0 to 30", "°C", (-5, 100)),
    ("salinity_percent", 0.0, "Salinity; sea water 3.5 (per cent)", "%", (0, 30)),
    ("depth_m", 0.0, "Water depth", "m", (0, 11000)),
)
#: An index to find the salinity of.
_MEASURED = 1.3416


def write_index_sheet(book: LiveBook) -> float:
    """Write the sheet of the refractive index; return the index it shows."""
    sheet = book.sheet(
        "RefractiveIndex",
        "Refractive index of water",
        "Fill in the yellow cells; salinity in per cent (sea water 3.5).",
    )
    for letter, width in zip("ABCD", (18, 66, 14, 10), strict=True):
        sheet.column_dimensions[letter].width = width
    headings(sheet, 4, ("name", "description", "value", "unit"))
    for row, (name, value, words, unit, limits) in enumerate(_GIVEN, start=5):
        _describe(sheet, row, name, words, unit)
        book.typed(sheet, row, 3, value)
        book.name(name, sheet, row, 3)
        allow_between(sheet, f"C{row}", limits, words)
    water: dict[str, Any] = {name.removesuffix("_m"): value for name, value, *_ in _GIVEN}
    slopes = water_index_derivatives(**water)
    n_w = float(slopes.refractive_index)
    results = (
        ("n_w", "Refractive index (Höhle 1971; Maas 2015, Eq. 4)",
         "1.338+4E-5*(486+0.003*depth_m+50*salinity_percent-wavelength_nm-temperature_c)", n_w, ""),
        ("n_w_quan_fry", "Refractive index (Quan and Fry 1995), for comparison", _QUAN_FRY_FORMULA,
         float(water_refractive_index(**water, formula=QUAN_FRY)), ""),
        ("dn_dT", "Change of n_w per degree", "-4E-5", float(slopes.d_temperature), "1/°C"),
        ("dn_dS", "Change of n_w per per cent of salt", "4E-5*50", float(slopes.d_salinity), "1/%"),
    )  # fmt: skip
    headings(sheet, 10, ("result", "description", "value", "unit"))
    for row, (name, words, text, value, unit) in enumerate(results, start=11):
        _describe(sheet, row, name, words, unit)
        book.formula(sheet, row, 3, text, value)
        sheet.cell(row, 3).number_format = "0.000000"
    book.name("n_w", sheet, 11, 3)
    headings(sheet, 16, ("inverse", "description", "value", "unit"))
    _describe(sheet, 17, "n_measured", "A measured index, e.g. from an adjustment")
    book.typed(sheet, 17, 3, _MEASURED)
    book.name("n_measured", sheet, 17, 3)
    _describe(sheet, 18, "salinity", "Salinity of that water (Höhle)", "%")
    del water["salinity_percent"]
    text = "((n_measured-1.338)/4E-5-486-0.003*depth_m+wavelength_nm+temperature_c)/50"
    book.formula(sheet, 18, 3, text, float(salinity_from_index(_MEASURED, **water)))
    sheet.cell(18, 3).number_format = "0.000"
    sheet.freeze_panes = "A5"
    return n_w


def _describe(sheet: Worksheet, row: int, name: str, words: str, unit: str | None = None) -> None:
    """Write what stands beside a value."""
    for column, text in ((1, name), (2, words), (4, unit)):
        sheet.cell(row, column, text)


#: Quan and Fry's Eq. (3) in the names of the sheet; their salinity is per mille.
_QUAN_FRY_FORMULA = (
    "1.31405+(0.0001779-0.00000105*temperature_c+0.000000016*temperature_c^2)*10*salinity_percent"
    "-0.00000202*temperature_c^2"
    "+(15.868+0.01155*10*salinity_percent-0.00423*temperature_c)/wavelength_nm"
    "-4382/wavelength_nm^2+1145500/wavelength_nm^3"
)
