"""The multimedia workbook: radial shift and refractive index as live formulas with their values."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from openpyxl.chart import Reference
from openpyxl.styles import Font
from openpyxl.utils import get_column_letter

from multimedia.refraction import HIGHEST_INDEX, STEPS, TOLERANCE, unrolled_shift
from multimedia.remarks import remark
from multimedia.workbook.index_sheet import FORMULAS, write_index_sheet
from multimedia.workbook.shift_points import ShiftPoints, ShiftSetup
from multimedia.workbook.shift_sketch import shift_sketch
from multimedia.workbook.words import WORDS
from photocore.errors import InputError
from photocore.output import check_ending
from photocore.workbook import (
    DOUBT,
    FACE,
    GOOD,
    HEAD_FILL,
    HEAD_FONT,
    LABEL,
    LABEL_FONT,
    BookBuilder,
    CellValue,
    LiveColumn,
    SheetBuilder,
    check_new_workbook,
    colour_words,
    scatter,
)

#: More rows make a workbook that is slow to open; text tables have no limit.
MOST_ROWS = 20_000
#: Columns that the user fills in, besides the name.
INPUTS = ("X", "Y", "Z", "R", "ZP")
#: The chart shows the first points only.
_CHART_ROWS = 1000
#: Name of the chart's numbers: R_u and dR of the points.
CHART_DATA = "chart_shift"
#: Columns that the chart takes beside the table.
_CHART_COLUMNS = 11
_FLAGS = {"OK": GOOD, "CHECK": DOUBT, "DRY": ("FCE4D6", "9C3D00")}


def write_shift_workbook(
    path: Path | str,
    setup: ShiftSetup,
    points: ShiftPoints | None = None,
    *,
    rows: int = 50,
    steps: int = STEPS,
    language: str = "en",
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
    language : {"en", "it", "de"}
        Of labels and help; keys and flags are the same in all.
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
        raise InputError(remark("shift.rows", of=path, count=count, most=MOST_ROWS))
    check_new_workbook(path, overwrite=overwrite, suffix="" if points is None else "-result")
    book = BookBuilder(language=language, words=WORDS)
    book.book.properties.creator = book.book.properties.title = "multimedia"
    lines = [line for line in WORDS.readme(language) if line]
    book.readme(lines, shift_sketch(book.word("sketch")), rows=len(lines) + 3)
    write_index_sheet(book)
    _shift_sheet(book, setup, points, count=count, steps=steps)
    book.book.move_sheet("RefractiveIndex", 1)
    book.open_at("Multimedia")
    book.calculate()
    book.save(path, overwrite=overwrite)


def _shift_sheet(
    book: BookBuilder, setup: ShiftSetup, points: ShiftPoints | None, *, count: int, steps: int
) -> None:
    """Write camera and media, and below them the table of points."""
    sheet = media_cells(book, setup, live=points is None)
    columns = shift_columns(len(setup.layers.indices), steps)
    keys, last = [column.key for column in columns], get_column_letter(len(columns))
    head = 7 + len(setup.layers.indices) + len(_lengths(setup))
    typed = {} if points is None else typed_values(points)
    inputs = {key: typed.get(key, ()) for key in ("id", *INPUTS)}
    sheet.table("tblMM", columns, at=(head, 1), rows=count, cells=inputs)
    flags = f"{last}{head + 1}:{last}{head + count}"
    colour_words(sheet.worksheet, flags, _FLAGS, bold=_FLAGS.keys() - {"OK"}, stop=True)
    _chart(sheet, keys, head=head, count=min(count, _CHART_ROWS))
    printed = count if points is None else max(len(points.ids), 1)
    sheet.finish(landscape=True, freeze=f"B{head + 1}", repeat=f"{head - 1}:{head}")
    sheet.worksheet.print_area = f"A1:{last}{head + printed}"


def media_cells(
    book: BookBuilder,
    setup: ShiftSetup,
    *,
    live: bool = False,
    links: Mapping[str, str] | None = None,
) -> SheetBuilder:
    """Write the sheet of camera and media, without points.

    Parameters
    ----------
    book : BookBuilder
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
    sheet = book.sheet("Multimedia", "shift_how" if named else "media_how")
    indices = setup.layers.indices
    count, least = len(indices), min(indices)
    # A workbook that is all ours is calculated whole.
    shown: list[float | None] = [None] * count if named else [least / n for n in indices]
    if live:
        links[f"n_{count}"] = "n_w"
    for letter, text in zip("ABCD", (book.word("name"), book.word("value"), "k", "q"), strict=True):
        sheet.text(f"{letter}4", text, HEAD_FONT)
        sheet.worksheet[f"{letter}4"].fill = HEAD_FILL
    for i, index in enumerate(indices, start=1):
        row, name = 4 + i, f"n_{i}"
        _value(sheet, row, name, index, links, carried=not named)
        prompt = book.word("index_prompt")
        sheet.validate(f"B{row}", title=name, prompt=prompt, limits=(1, HIGHEST_INDEX))
        # In a workbook of the user's own the names may be taken.
        own, ratio = (name, f"k_{i}") if named else (f"$B${row}", f"$C${row}")
        k, text = shown[i - 1], f"MIN($B$5:$B${4 + count})/{own}"
        sheet.formula(f"C{row}", text, k, form="0.000000", name=f"k_{i}")
        sheet.formula(f"D{row}", f"1-{ratio}^2", k and 1 - k * k, form="0.000000", name=f"q_{i}")
        place = "camera" if i == 1 else "object" if i == count else "layer"
        words = book.word(f"index_{place}").format(n=i - 1)
        sheet.text(f"E{row}", words, LABEL_FONT)
    _write_lengths(sheet, setup, links)
    return sheet


def _value(
    sheet: SheetBuilder, row: int, name: str, value: float, links: Mapping[str, str],
    *, carried: bool = True,
) -> None:  # fmt: skip
    """Write a named value, typed or as a reference to where it stands."""
    sheet.text(f"A{row}", name)
    if name in links:
        shown = value if carried else None
        sheet.formula(f"B{row}", links[name], shown, name=name, editable=True)
    else:
        sheet.input(f"B{row}", value, name=name)


def media_places(layers: int) -> dict[str, tuple[int, int]]:
    """Return row and column of each value on the sheet of `media_cells`, by name."""
    places = {f"{kind}_{i}": (4 + i, c) for c, kind in enumerate("nkq", start=2)
              for i in range(1, layers + 1)}  # fmt: skip
    lengths = [*(f"t_{i}" for i in range(1, layers - 1)), "z_0", "X_0", "Y_0"]
    return places | {name: (5 + layers + i, 2) for i, name in enumerate(lengths)}


def _lengths(setup: ShiftSetup) -> dict[str, float]:
    """Return the lengths to be typed, by name."""
    layers = {f"t_{i}": t for i, t in enumerate(setup.layers.thicknesses, start=1)}
    return {**layers, "z_0": setup.z0, "X_0": setup.nadir[0], "Y_0": setup.nadir[1]}


def _write_lengths(sheet: SheetBuilder, setup: ShiftSetup, links: Mapping[str, str]) -> None:
    """Write thicknesses and the camera's position below the indices."""
    first = 5 + len(setup.layers.indices)
    for row, (name, value) in enumerate(_lengths(setup).items(), start=first):
        key = "thickness" if name.startswith("t_") else name
        words = sheet.book.word(key).format(n=name[2:])
        _value(sheet, row, name, value, links)
        sheet.text(f"E{row}", words, LABEL_FONT)
        if name[0] in "tz":
            prompt = f"{words}. {sheet.book.word('length_prompt')}"
            sheet.validate(f"B{row}", title=name, prompt=prompt, limits=(0, 1e9))
        else:
            sheet.validate(f"B{row}", title=name, prompt=words, limits=(-1e9, 1e9))


def _chart(sheet: SheetBuilder, keys: list[str], *, head: int, count: int) -> None:
    """Draw the shift over the distance from the nadir, right of the table; numbers behind."""
    left, first = len(keys) + _CHART_COLUMNS, head + 1
    letters = [get_column_letter(left + i) for i in range(2)]
    sheet.word(f"{letters[0]}{head - 2}", "chart_data", LABEL_FONT)
    for letter, key in zip(letters, ("R_u", "dR"), strict=True):
        sheet.text(f"{letter}{head - 1}", key, LABEL_FONT)
        for i in range(count):
            # Texts would break a scatter chart, so blanks are #N/A.
            cell = f"INDEX(tblMM[{key}],{i + 1})"
            grey = Font(name=FACE, size=LABEL, color="7F7F7F")
            text = f"IF(ISNUMBER({cell}),{cell},NA())"
            sheet.formula(f"{letter}{first + i}", text, form="0.000", font=grey)
    x, y = (
        Reference(sheet.worksheet, min_col=left + i, min_row=first, max_row=first + count - 1)
        for i in range(2)
    )
    place = f"'Multimedia'!${letters[0]}${first}:${letters[1]}${first + count - 1}"
    sheet.book.define(CHART_DATA, place)
    chart = scatter(sheet.book.word("chart_shift"), "R", "Rbar - R", x, {"dR": y})
    chart.height, chart.width = 7.5, 13
    sheet.worksheet.add_chart(chart, f"{get_column_letter(len(keys) + 2)}{head - 1}")


def shift_columns(
    layers: int,
    steps: int,
    *,
    value: Callable[[str], str] = str,
    given: Collection[str] = INPUTS,
) -> tuple[LiveColumn, ...]:
    """Return every column of the table.

    Parameters
    ----------
    layers : int
        Media, the camera's and the object's with them.
    steps : int
        Newton columns.
    value : callable
        Returns what a formula calls a value of the set-up, ``k_1`` for instance.
    given : collection of str
        The input columns there are.
    """
    numbers = range(1, layers + 1)
    heights = [*map(value, ("z_0", *(f"t_{i}" for i in numbers[:-2]))), "[@ZP_u]"]
    k = [f"{height}*{value(f'k_{i}')}" for i, height in zip(numbers, heights, strict=True)]
    bent = [f"(1+{value(f'q_{i}')}*{{1}}^2)" for i in numbers]
    parts = {
        **{name: value(name) for name in ("k_1", "q_1", "X_0", "Y_0")},
        "last": str(steps),
        "steps": " ".join(f"{i}:{i - 1}" for i in range(1, steps + 1)),
        "flat": "+".join(k),
        "heights": "+".join(heights),
        "reach": "+".join(f"{a}/SQRT{b}" for a, b in zip(k, bent, strict=True)),
        "slope": "+".join(f"{a}/{b}^1.5" for a, b in zip(k, bent, strict=True)),
        "tolerance": f"{TOLERANCE:.0E}",
    }
    return FORMULAS.columns("shift", given, parts)


def typed_values(points: ShiftPoints) -> dict[str, list[CellValue]]:
    """Return what is typed of points: X, Y, Z, or R and ZP of those that have only these."""
    in_plane = np.asarray(np.isfinite(points.xy).all(axis=1))
    columns = {
        "X": (points.xy[:, 0], in_plane), "Y": (points.xy[:, 1], in_plane),
        "Z": (0.0 - points.depth, in_plane), "R": (points.radius, ~in_plane),
        "ZP": (points.depth, ~in_plane),
    }  # fmt: skip
    values: dict[str, list[CellValue]] = {"id": list(points.ids)}
    for key, (column, typed) in columns.items():
        values[key] = [
            float(x) if is_typed else None for x, is_typed in zip(column, typed, strict=True)
        ]
    return values


def table_values(
    setup: ShiftSetup, points: ShiftPoints, steps: int
) -> dict[str, Sequence[CellValue]]:
    """Return what the formulas of points show in a workbook that is not calculated whole."""
    # Not layers.heights: the sheet computes with what it holds.
    heights: list[ArrayLike] = [setup.z0, *setup.layers.thicknesses, points.depth]
    shift = unrolled_shift(points.radius, heights, setup.layers.indices, steps=steps)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(points.radius == 0, 1.0, shift.radius_bar / points.radius)
    nadir = np.asarray(setup.nadir)
    xy_bar = nadir + (points.xy - nadir) * ratio[:, None]
    solved = np.abs(shift.residual) <= TOLERANCE * points.radius
    columns = {f"u{step}": u for step, u in enumerate(shift.u)} | {
        "R_u": points.radius, "ZP_u": points.depth, "resid": shift.residual,
        "Rbar": shift.radius_bar, "dR": shift.radius_bar - points.radius,
    }  # fmt: skip
    in_plane = np.asarray(np.isfinite(points.xy).all(axis=1))
    return {
        **{key: column.tolist() for key, column in columns.items()},
        **{
            f"{axis}bar": [x if typed else "" for x, typed in zip(column, in_plane, strict=True)]
            for axis, column in zip("XY", xy_bar.T.tolist(), strict=True)
        },
        "flag": ["OK" if good else "CHECK" for good in solved],
    }
