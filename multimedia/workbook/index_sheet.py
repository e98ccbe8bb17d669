"""The sheet RefractiveIndex: the index of water as live formulas."""

from __future__ import annotations

from multimedia.refraction.water import (
    QUAN_FRY,
    salinity_from_index,
    water_index_derivatives,
    water_refractive_index,
)
from multimedia.workbook.live_book import LiveBook, allow_between, headings


def write_index_sheet(book: LiveBook) -> float:
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
    headings(sheet, 4, ("name", "description", "value", "unit"))
    for row, (name, (value, words, unit, limits)) in enumerate(given.items(), start=5):
        sheet.cell(row, 1, name)
        sheet.cell(row, 2, words)
        sheet.cell(row, 4, unit)
        book.typed(sheet, row, 3, value)
        book.name(name, sheet, row, 3)
        allow_between(sheet, f"C{row}", limits, words)
    nm, celsius = given["wavelength_nm"][0], given["temperature_c"][0]
    slopes = water_index_derivatives(
        wavelength_nm=nm, temperature_c=celsius, salinity_percent=0.0, depth=0.0
    )
    n_w = float(slopes.refractive_index)
    quan_fry = water_refractive_index(
        wavelength_nm=nm, temperature_c=celsius, salinity_percent=0.0, depth=0.0, formula=QUAN_FRY
    )
    measured = 1.3416
    salinity = salinity_from_index(measured, wavelength_nm=nm, temperature_c=celsius, depth=0.0)
    results = (
        ("n_w", "Refractive index (Höhle 1971; Maas 2015, Eq. 4)",
         "1.338+4E-5*(486+0.003*depth_m+50*salinity_percent-wavelength_nm-temperature_c)", n_w, ""),
        ("n_w_quan_fry", "Refractive index (Quan and Fry 1995), for comparison", _QUAN_FRY_FORMULA,
         float(quan_fry), ""),
        ("dn_dT", "Change of n_w per degree", "-4E-5", float(slopes.d_temperature), "1/°C"),
        ("dn_dS", "Change of n_w per per cent of salt", "4E-5*50", float(slopes.d_salinity), "1/%"),
    )  # fmt: skip
    headings(sheet, 10, ("result", "description", "value", "unit"))
    for row, (name, words, text, value, unit) in enumerate(results, start=11):
        sheet.cell(row, 1, name)
        sheet.cell(row, 2, words)
        sheet.cell(row, 4, unit)
        book.formula(sheet, row, 3, text, value)
        sheet.cell(row, 3).number_format = "0.000000"
    book.name("n_w", sheet, 11, 3)
    headings(sheet, 16, ("inverse", "description", "value", "unit"))
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
