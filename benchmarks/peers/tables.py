"""Workbooks beside openpyxl, XlsxWriter and pandas."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks import bench_workbook as book
from benchmarks.peers.comparison import Comparison, Task, Tool


def _written(path: Path, rows: int) -> float:
    """Return by how much the stored relief is wrong; where only formulas are stored, 0. [m]"""
    import openpyxl

    opened = openpyxl.load_workbook(path, read_only=True, data_only=True)
    sheet = opened.worksheets[0]
    table = list(sheet.iter_rows(min_row=2, max_row=rows + 1, values_only=True))
    assert len(table) == rows, len(table)
    column = 1 + len(book.INPUTS) + list(book.FORMULAS).index("r")
    values = np.array([row[column] for row in table], dtype=float)
    away = np.abs(values - book.columns(rows)["r"])
    return float(np.nanmax(away, initial=0.0, where=np.isfinite(away)))


def _write(work: Callable[[Path, int], object]) -> Callable[[int, Path], Task]:
    def make(rows: int, folder: Path) -> Task:
        out = folder / f"{work.__name__}.xlsx"

        def anew() -> None:
            out.unlink(missing_ok=True)
            work(out, rows)

        return Task(anew, lambda _: _written(out, rows))

    return make


def xlsxwriter(path: Path, rows: int) -> None:
    """Write inputs, formulas and their values, as XlsxWriter can."""
    import xlsxwriter as writer

    value = book.columns(rows)
    opened = writer.Workbook(str(path))
    sheet = opened.add_worksheet("Points")
    sheet.write_row(0, 0, ["id", *book.INPUTS, *book.FORMULAS])
    listed = {name: value[name].tolist() for name in (*book.INPUTS, *book.FORMULAS)}
    first = 1 + len(book.INPUTS)
    for row in range(rows):
        sheet.write_string(row + 1, 0, f"P{row + 1}")
        for column, name in enumerate(book.INPUTS, start=1):
            sheet.write_number(row + 1, column, listed[name][row])
        for column, (name, formula) in enumerate(book.FORMULAS.items(), start=first):
            sheet.write_formula(row + 1, column, f"={formula}", None, listed[name][row])
    headings = [{"header": name} for name in ("id", *book.INPUTS, *book.FORMULAS)]
    place = {"name": "tblPoints", "columns": headings}
    sheet.add_table(0, 0, rows, len(headings) - 1, place)
    opened.close()


def pandas(path: Path, rows: int) -> None:
    """Write values: pandas has no formulas."""
    import pandas as pd

    value = book.columns(rows)
    columns = {"id": [f"P{row + 1}" for row in range(rows)]}
    columns |= {name: value[name] for name in (*book.INPUTS, *book.FORMULAS)}
    pd.DataFrame(columns).to_excel(path, sheet_name="Points", index=False)


def openpyxl_read(path: Path) -> np.ndarray:
    """Read relief with openpyxl."""
    import openpyxl

    sheet = openpyxl.load_workbook(path, data_only=True, read_only=True)["Points"]
    column = 1 + len(book.INPUTS) + list(book.FORMULAS).index("r")
    return np.array([row[column] for row in sheet.iter_rows(min_row=2, values_only=True)])


def pandas_read(path: Path) -> np.ndarray:
    """Read relief with pandas."""
    import pandas as pd

    return np.asarray(pd.read_excel(path, sheet_name="Points")["r"])


def ours_read(path: Path) -> np.ndarray:
    """Read relief as every command does: by the headings."""
    from photocore.tables import Column, read_table

    keys = [Column(key) for key in (*book.INPUTS, *book.FORMULAS)]
    return read_table(path, [Column("id", kind="text"), *keys], name="Points").numbers("r")


def _read(work: Callable[[Path], np.ndarray]) -> Callable[[int, Path], Task]:
    def make(rows: int, folder: Path) -> Task:
        truth = book.columns(rows)["r"]
        return Task(
            lambda: work(folder / "book.xlsx"),
            lambda found: np.abs(np.asarray(found, dtype=float) - truth).max(),
        )

    return make


SIZES = (1_000, 5_000, 20_000)
DATA = "A table of 13 columns: a name, 4 numbers, 8 live formulas that refer to columns by name."
COMPARISONS = {
    "workbook-written": Comparison(
        title="A workbook written",
        data=f"{DATA} Ours and XlsxWriter store the results as well, openpyxl none, pandas "
        "values alone.",
        item="row", error="largest error of stored relief [m]", sizes=SIZES,
        tools={
            "bifocal, into a workbook that exists": Tool(_write(book.write_ours), "bifocal-relief"),
            "openpyxl, formulas alone": Tool(_write(book.write_openpyxl), "openpyxl"),
            "XlsxWriter, a new workbook": Tool(_write(xlsxwriter), "xlsxwriter"),
            "pandas, values alone": Tool(_write(pandas), "pandas"),
        },
    ),
    "workbook-read": Comparison(
        title="A workbook read",
        data=DATA, item="row", error="largest error of relief [m]", sizes=SIZES,
        tools={
            "bifocal": Tool(_read(ours_read), "bifocal-relief"),
            "openpyxl, read only": Tool(_read(openpyxl_read), "openpyxl"),
            "pandas": Tool(_read(pandas_read), "pandas"),
        },
        prepare=lambda rows, folder: book.write_ours(folder / "book.xlsx", rows),
    ),
}  # fmt: skip
