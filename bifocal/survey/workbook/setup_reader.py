"""Read the cells of the sheet `Setup`, or of a user's own, found by name or label."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bifocal.survey.setup import OFF_RADIAL_SIGMAS, ON_PLANE_SIGMAS, SurveySetup
from bifocal.survey.workbook.known_reader import LARGEST
from bifocal.survey.workbook.words import SETUP
from photocore.arrays import FloatArray
from photocore.errors import CellError, GeometryError, InputError
from photocore.tables import Column, NamedValues, read_named_values
from photocore.tables.numbers import Decimal
from photocore.workbook.grid import SheetFile

_CAMERA = ("c_1", "c_2", "d_1", "d_2", "delta_d", "pitch")
_PRECISION = ("sigma_s", "sigma_px", "sigma_r_max", "k_off", "k_plane")
_NADIRS = ("nadir_1_col", "nadir_1_row", "nadir_2_col", "nadir_2_row")
_NUMBERS = (*_CAMERA, *_PRECISION, *_NADIRS, "sensor_w", "sensor_h")
#: Labels people write beside the values in their own sheets.
_LABELS = {
    "c_1": ("f1", "principal distance 1", "distanza principale 1", "kammerkonstante 1"),
    "c_2": ("f2", "principal distance 2", "distanza principale 2", "kammerkonstante 2"),
    "d_1": ("distance 1", "distanza 1", "abstand 1"),
    "d_2": ("distance 2", "distanza 2", "abstand 2"),
    "delta_d": ("Δd", "delta d"),
    "pitch": ("pixel pitch", "pixel size", "dimensione pixel", "pixelgröße"),
    "input_unit": ("input unit", "unità", "einheit"),
}
#: d_1 typed and d_2 + delta_d may differ by this much: a tape's millimetre.
_AGREE = 0.0015


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SetupValues:
    """The cells of `Setup`; None where blank or absent.

    Attributes are the named cells without underscore; ``where`` says where they stand,
    ``text_cells`` which numbers were typed as text.
    """

    c1: float | None = None
    c2: float | None = None
    d1: float | None = None
    d2: float | None = None
    pitch: float | None = None
    sigma_s: float | None = None
    sigma_px: float | None = None
    sigma_r_max: float | None = None
    nadir1: tuple[float, float] | None = None
    nadir2: tuple[float, float] | None = None
    flag_sigmas: tuple[float, float] = (OFF_RADIAL_SIGMAS, ON_PLANE_SIGMAS)
    sensor: tuple[float, float] | None = None
    unit: str = ""
    pair_file: str = ""
    matrices: tuple[FloatArray, FloatArray] | None = None
    nadirs: tuple[FloatArray, FloatArray] = (np.zeros(2), np.zeros(2))
    where: str = ""
    remarks: tuple[str, ...] = ()
    text_cells: tuple[str, ...] = ()

    def with_options(self, **options: float | str | None) -> SetupValues:
        """Return the values with those the user gave on the command line in their place."""
        return replace(self, **{key: value for key, value in options.items() if value is not None})  # type: ignore[arg-type]

    def ideal(self, unit: str) -> SurveySetup:
        """Return the set-up of an ideal pair.

        Raises
        ------
        InputError, GeometryError
            If distances are missing or values contradict each other, naming the file.
        """
        missing = [name for name, value in (("d_1", self.d1), ("d_2", self.d2)) if value is None]
        if missing:
            raise InputError(
                f"{self.where}: no value for {', '.join(missing)}. Fill in the sheet Setup (d_2 "
                "and delta_d, or d_1), or give --d1 and --d2 in metres, or a pair file with --pair."
            )
        assert self.d1 is not None
        assert self.d2 is not None
        if unit == "px" and (self.nadir1 is None or self.nadir2 is None):
            raise InputError(
                f"{self.where}: coordinates in pixels need the nadir points of both images "
                "(nadir_1_col, nadir_1_row, nadir_2_col, nadir_2_row); fill them in."
            )
        try:
            return SurveySetup(
                d1=self.d1,
                d2=self.d2,
                c1=self.c1,
                c2=self.c2,
                pitch=self.pitch,
                sigma_s=self.sigma_s,
                nadir1=self.nadir1 or (0.0, 0.0),
                nadir2=self.nadir2 or (0.0, 0.0),
                unit=unit,
                sigma_r_max=self.sigma_r_max,
                off_radial_sigmas=self.flag_sigmas[0],
                on_plane_sigmas=self.flag_sigmas[1],
            )
        except GeometryError as error:
            raise GeometryError(f"{self.where}: {error}") from None
        except InputError as error:
            raise InputError(f"{self.where}: {error}") from None


def read_setup(
    path: Path, book: SheetFile | None, decimal: Decimal | None, errors: list[CellError]
) -> SetupValues:
    """Return the values of `Setup`.

    Parameters
    ----------
    path : Path
        The file, to look at formulas.
    book : SheetFile or None
        The open workbook; None for a text table, which has no set-up.
    decimal : str or None
        Decimal separator of numbers typed as text.
    errors : list
        Takes the complaints.
    """
    if book is None:
        return SetupValues(where=path.name)
    found: list[CellError] = []
    # In the workbook of a general pair sigma_s follows from sigma_px: nothing to read.
    columns = [c for c in _columns() if not (c.key == "sigma_s" and is_general(book))]
    if "d_1" in book.names and "d_2" in book.names:
        # Our own workbook: every value has its name, labels need not be searched for.
        columns = [c for c in columns if c.key.casefold() in book.names]
    values = read_named_values(
        book,
        columns,
        sheet="Setup",
        decimal=decimal,
        errors=found,
    )
    where = f"{book.label} › Setup" if "Setup" in book.titles else book.label
    formulas = _formulas(path, values)
    defaults = {key for key in ("sigma_s", "sigma_r_max") if key in formulas}
    # Cells with the template's own formula are defaults, calculated or not.
    errors += [e for e in found if e.column not in formulas]
    number = {key: _number(values, key) for key in _NUMBERS if key not in defaults}
    _check_positive(values, number, errors)
    d1 = _distance(values, number, "d_1" in formulas, errors)
    nadirs = [_place(number[f"nadir_{i}_col"], number[f"nadir_{i}_row"]) for i in (1, 2)]
    matrices, plane_nadirs = _general(values)
    return SetupValues(
        c1=number["c_1"],
        c2=number["c_2"],
        d1=d1,
        d2=_near(number, d1),
        pitch=number["pitch"],
        sigma_s=number.get("sigma_s"),
        sigma_px=number["sigma_px"],
        sigma_r_max=number.get("sigma_r_max"),
        nadir1=nadirs[0],
        nadir2=nadirs[1],
        flag_sigmas=(number["k_off"] or OFF_RADIAL_SIGMAS, number["k_plane"] or ON_PLANE_SIGMAS),
        sensor=_place(number["sensor_w"], number["sensor_h"]),
        unit=_unit(values, errors),
        pair_file=values.text("pair_file") if "pair_file" in values.values else "",
        matrices=matrices,
        nadirs=plane_nadirs,
        where=where,
        remarks=tuple(values.remarks),
        text_cells=tuple(values.text_cells),
    )


def is_general(book: SheetFile) -> bool:
    """Whether a workbook describes a general pair by homographies."""
    return "h1_11" in book.names


def _columns() -> list[Column]:
    columns = []
    for key in (*_NUMBERS, *_general_names(), "input_unit", "pair_file"):
        words = SETUP.get(key, ("",))[1:]
        kind = "text" if key in ("input_unit", "pair_file") else "number"
        aliases = (*words, *_LABELS.get(key, ()))
        unit = SETUP.get(key, ("",))[0] if kind == "number" else ""
        columns.append(Column(key, aliases, kind=kind, unit=unit))  # type: ignore[arg-type]
    return columns


def _general_names() -> list[str]:
    entries = [f"h{k}_{i}{j}" for k in "12" for i in "123" for j in "123"]
    return entries + [f"n{k}_{axis}" for k in "12" for axis in "xy"]


def _number(values: NamedValues, key: str) -> float | None:
    return values.number(key) if key in values.values and values.has(key) else None


def _formulas(path: Path, values: NamedValues) -> set[str]:
    """Return which cells hold the template's own formula instead of a typed number."""
    from bifocal.survey.workbook.defaults import TYPED_FORMULAS
    from photocore.workbook.package import open_package
    from photocore.workbook.xlsx import read_directory

    wanted = {key: values.places[key] for key in TYPED_FORMULAS if key in values.places}
    if path.suffix.lower() not in (".xlsx", ".xlsm", ".xltx", ".xltm") or not wanted:
        return set()
    with open_package(path) as package:
        directory = read_directory(path, package)
        parts = {sheet.title: sheet.part for sheet in directory.sheets}
        found = set()
        for key, (sheet, cell) in wanted.items():
            text = package.read(parts[sheet]).decode("utf-8", errors="replace")
            match = re.search(rf'<(?:\w+:)?c r="{cell}"[^>]*><(?:\w+:)?f[^>]*>([^<]*)<', text)
            if match and _plain(match[1]) == _plain(TYPED_FORMULAS[key]):
                found.add(key)
    return found


def _plain(formula: str) -> str:
    """Return a formula without blanks, case and sheet-name noise."""
    text = formula.replace("&quot;", '"').replace("&lt;", "<").replace("&gt;", ">")
    return re.sub(r"[\s$]", "", text).casefold()


def _check_positive(
    values: NamedValues, number: dict[str, float | None], errors: list[CellError]
) -> None:
    for key, value in number.items():
        if value is not None and not key.startswith("nadir") and value <= 0:
            errors.append(values.error(key, f"found {value:g}, expected a number above zero."))
        elif value is not None and not 1e-9 < abs(value or 1.0) < LARGEST:
            errors.append(values.error(key, f"found {value:g}, which cannot be meant; correct it."))


def _distance(
    values: NamedValues, number: dict[str, float | None], is_formula: bool, errors: list[CellError]
) -> float | None:
    """Return d_1: typed, or d_2 + delta_d; complain if both are given and differ."""
    near, step = number["d_2"], number["delta_d"]
    typed = None if is_formula else number["d_1"]
    total = near + step if near is not None and step is not None else None
    if typed is not None and total is not None and abs(typed - total) > _AGREE:
        errors.append(
            values.error(
                "d_1",
                f"found {typed:g} m, but d_2 + delta_d = {near:g} + {step:g} = {total:g} m. "
                "Correct one of the three, or clear delta_d.",
            )
        )
    return typed if typed is not None else total


def _place(column: float | None, row: float | None) -> tuple[float, float] | None:
    return None if column is None or row is None else (column, row)


def _near(number: dict[str, float | None], d1: float | None) -> float | None:
    """Return d_2: typed, or d_1 - delta_d."""
    step = number["delta_d"]
    if number["d_2"] is None and d1 is not None and step is not None and d1 > step:
        return d1 - step
    return number["d_2"]


def _unit(values: NamedValues, errors: list[CellError]) -> str:
    """Return the input unit, empty where the cell is blank."""
    text = values.text("input_unit").strip().casefold() if "input_unit" in values.values else ""
    if text in ("", "mm"):
        return text
    if text in ("px", "pixel", "pixels", "pix"):
        return "px"
    errors.append(values.error("input_unit", f'found "{text}", expected mm or px.'))
    return ""


def _general(
    values: NamedValues,
) -> tuple[tuple[FloatArray, FloatArray] | None, tuple[FloatArray, FloatArray]]:
    """Return homographies and nadirs on the wall, if the workbook describes a general pair."""
    if not all(name in values.values and values.has(name) for name in _general_names()):
        return None, (np.zeros(2), np.zeros(2))
    first, second = (
        np.array([[values.number(f"h{k}_{i}{j}") for j in "123"] for i in "123"]) for k in "12"
    )
    nadirs = [np.array([values.number(f"n{k}_{axis}") for axis in "xy"]) for k in "12"]
    return (first, second), (nadirs[0], nadirs[1])
