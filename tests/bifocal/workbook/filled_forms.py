"""Forms of `bifocal solve`, filled in the way a user does, and what the command says of them."""

from __future__ import annotations

import functools
import io
import json
import pickle
import tempfile
from copy import copy
from pathlib import Path

import openpyxl
from click.testing import CliRunner

from tests.builders.commands import bifocal_command as main

SETUP = {"c_1": 35, "c_2": 19, "d_2": 9.5, "delta_d": 8}


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def seen(x, y, r, c, d):
    return c * x / (d - r), c * y / (d - r)


def rows(points):
    """Rows id, x1, y1, x2, y2 [mm] of points (X, Y, r) seen with 35 mm/17.5 m and 19 mm/9.5 m."""
    return [(name, *seen(x, y, r, 35, 17.5), *seen(x, y, r, 19, 9.5)) for name, x, y, r in points]


POINTS = [("P1", 2, 0, 1), ("P2", -3, 2, 0.5), ("P3", 4, -2, -0.4), ("P4", -4, -1.5, 0)]


@functools.cache
def form(*options):
    """Return the bytes of a template: making it costs more than the tests themselves."""
    with tempfile.TemporaryDirectory() as folder:
        made = run("template", Path(folder, "form.xlsx"), *(options or ("--rows", 20)))
        assert made.exit_code == 0, made.stderr
        return Path(folder, "form.xlsx").read_bytes()


@functools.cache
def loaded(*options):
    return openpyxl.load_workbook(io.BytesIO(form(*options)))


#: Forms as they were filled in; many tests begin with the same.
FILLED = {}


def fill(path, table=None, setup=SETUP, template=(), **sheets):
    """Fill in a template the way a user does, with openpyxl standing for Excel.

    The rows of a table are values from its first column on, or values by heading; the template is
    a file, or the options of one, which is read once: what was written is then taken back.
    """
    is_new, before = isinstance(template, tuple), []
    key = pickle.dumps((table, setup, template, sheets)) if is_new else b""
    if key in FILLED:
        path.write_bytes(FILLED[key])
        return path
    book = loaded(*template) if is_new else openpyxl.load_workbook(template)

    def write(cell, value):
        before.append((cell, cell.value, copy(cell._style)))
        cell.value = value

    for name, value in setup.items():
        write(named(book, name), value)
    points = rows(POINTS) if table is None else table
    for name, lines in {"Points": points, **sheets}.items():
        head = next(i for i in range(1, 60) if book[name].cell(i, 1).value == "id")
        columns = {cell.value: cell.column for cell in book[name][head]}
        for row, values in enumerate(lines, start=head + 1):
            keyed = values if isinstance(values, dict) else dict(zip(columns, values, strict=False))
            for key, value in keyed.items():
                if value is not None:
                    write(book[name].cell(row, columns[key]), value)
    book.save(path)
    for cell, value, style in reversed(before):
        cell.value, cell._style = value, style
    if is_new:
        FILLED[key] = path.read_bytes()
    return path


def named(book, name):
    """Return the cell of a name."""
    sheet, _, cell = book.defined_names[name].attr_text.replace("$", "").partition("!")
    return book[sheet.strip("'")][cell]


def put(book, name, value):
    named(book, name).value = value


def solved(path, *options):
    result = run("solve", path, "--json", *options)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout), result.stderr


def by_id(answer):
    return {point["id"]: point for point in answer["points"]}


def write_csv(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def refused(path, *patterns, options=()):
    result = run("solve", path, *options)
    assert result.exit_code == 1, result.stdout + result.stderr
    assert not isinstance(result.exception, Exception) or isinstance(result.exception, SystemExit)
    for pattern in patterns:
        assert pattern in result.stderr
    assert result.stdout == ""
