"""Workbooks of 20 000 rows: our splice writer and reader, and `solve`, beside openpyxl.

Rows of 8 live formulas are written and read; then a survey of as many points is solved, into a new
workbook and into one that is there, beside openpyxl loading and saving that workbook.

Each job runs in a process of its own; CPU seconds, and peak memory above that of an interpreter
that has only imported what the job needs. The results are checked against each other first.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROWS = 20_000
INPUTS = ("x1", "y1", "x2", "y2")
FORMULAS = {
    "s1": "SQRT(tblPoints[[#This Row],[x1]]^2+tblPoints[[#This Row],[y1]]^2)",
    "s2": "SQRT(tblPoints[[#This Row],[x2]]^2+tblPoints[[#This Row],[y2]]^2)",
    "ds": "tblPoints[[#This Row],[s2]]-tblPoints[[#This Row],[s1]]",
    "den": "tblPoints[[#This Row],[s2]]/9.5-tblPoints[[#This Row],[s1]]/17.5",
    "r": "tblPoints[[#This Row],[ds]]/tblPoints[[#This Row],[den]]",
    "e1": "tblPoints[[#This Row],[s1]]*tblPoints[[#This Row],[r]]/17.5",
    "e2": "tblPoints[[#This Row],[s2]]*tblPoints[[#This Row],[r]]/9.5",
    "s_c": "tblPoints[[#This Row],[s1]]-tblPoints[[#This Row],[e1]]",
}


def columns(rows=ROWS):
    random = np.random.default_rng(7)
    value = {name: random.uniform(1, 12, rows) for name in INPUTS}
    value["s1"] = np.hypot(value["x1"], value["y1"])
    value["s2"] = np.hypot(value["x2"], value["y2"])
    value["ds"] = value["s2"] - value["s1"]
    value["den"] = value["s2"] / 9.5 - value["s1"] / 17.5
    value["r"] = value["ds"] / value["den"]
    value["e1"] = value["s1"] * value["r"] / 17.5
    value["e2"] = value["s2"] * value["r"] / 9.5
    value["s_c"] = value["s1"] - value["e1"]
    return value


def start(rows, count):
    """Return an openpyxl workbook with the table of so many rows, its first ones filled in."""
    import openpyxl
    from openpyxl.worksheet.table import Table

    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Points"
    sheet.append(["id", *INPUTS, *FORMULAS])
    value = columns(count)
    for row in range(rows):
        inputs = [float(value[name][row]) for name in INPUTS]
        sheet.append([f"P{row + 1}", *inputs, *(f"={f}" for f in FORMULAS.values())])
    sheet.add_table(Table(displayName="tblPoints", ref=f"A1:M{rows + 1}"))
    return book


def write_openpyxl(path, rows=ROWS):
    start(rows, rows).save(path)


def write_ours(path, rows=ROWS):
    from photocore.workbook.changing.editor import WorkbookEditor

    first = path.with_name("first.xlsx")
    start(1, rows).save(first)
    value = columns(rows)
    editor = WorkbookEditor(first)
    for column, name in enumerate(FORMULAS, start=6):
        editor.set_result("Points", 2, column, float(value[name][0]))
    for column, name in enumerate(INPUTS, start=2):
        # openpyxl writes 16 digits, which is one too few for some numbers.
        editor.set_value("Points", 2, column, float(value[name][0]))
    inputs = {name: value[name][1:] for name in INPUTS}
    inputs["id"] = [f"P{row + 1}" for row in range(1, rows)]
    editor.append_columns("tblPoints", inputs, {name: value[name][1:] for name in FORMULAS})
    editor.save(path)


def read_openpyxl(path):
    import openpyxl

    sheet = openpyxl.load_workbook(path, data_only=True)["Points"]
    return len(list(sheet.iter_rows(values_only=True)))


def read_ours(path):
    from photocore.tables import Column, read_table

    keys = (*INPUTS, *FORMULAS)
    table = read_table(path, [Column("id", kind="text"), *map(Column, keys)], name="Points")
    value = columns()
    for key in keys:
        assert np.array_equal(table.numbers(key), value[key]), key
    return len(table)


def solve_new(path):
    from bifocal import Taking

    x, y, r = np.random.default_rng(1).uniform((-5, -3, -0.5), (5, 3, 0.5), (ROWS, 3)).T
    measured = [f * axis / (d - r) for f, d in ((35, 17.5), (19, 9.5)) for axis in (x, y)]
    picks = path.with_suffix(".csv")
    header, ids = ",".join(("id", *INPUTS)), [f"P{i}" for i in range(ROWS)]
    table = np.column_stack([ids, *(np.char.mod("%.4f", column) for column in measured)])
    np.savetxt(picks, table, fmt="%s", delimiter=",", header=header, comments="")
    solve(picks, path, taking=Taking(d1=17.5, d2=9.5, c1=35, c2=19))


def solve_in_place(path):
    from bifocal import Measuring

    # Another precision changes every sigma of every row.
    solve(path, path, measuring=Measuring(sigma_px=0.7))


def solve(picks, book, **given):
    from bifocal.workbook import workflow
    from bifocal.workbook.output import write_result

    write_result(book, workflow.solve(picks, **given), overwrite=True)


def save_openpyxl(path):
    import openpyxl

    openpyxl.load_workbook(path).save(path.with_name("saved.xlsx"))


JOBS = {
    "write ours (with results)": write_ours,
    "write openpyxl (without)": write_openpyxl,
    "read ours": read_ours,
    "read openpyxl": read_openpyxl,
    "solve into a new book": solve_new,
    "solve in place": solve_in_place,
    "solve openpyxl (load, save)": save_openpyxl,
}


def memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def child(job, path):
    import openpyxl  # noqa: F401

    import photocore.tables
    import photocore.workbook.changing.editor  # noqa: F401

    base, begin = memory(), time.process_time()
    JOBS[job](path)
    print(json.dumps([time.process_time() - begin, memory() - base]))


def main():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ours.xlsx"
        found = {}
        for job in ("write ours (with results)", "read ours", "read openpyxl"):
            found[job] = run(job, path)
        found["write openpyxl (without)"] = run(
            "write openpyxl (without)", Path(folder) / "plain.xlsx"
        )
        size = path.stat().st_size / 1e6
        survey = Path(folder) / "survey.xlsx"
        for job in ("solve into a new book", "solve openpyxl (load, save)", "solve in place"):
            found[job] = run(job, survey)
    print(f"{ROWS} rows, {len(FORMULAS)} formulas each, {size:.1f} MB")
    for verb in ("write", "read", "solve"):
        base = next(v for k, v in found.items() if k.startswith(f"{verb} openpyxl"))
        for job in (k for k in found if k.startswith(verb)):
            seconds, megabytes = found[job]
            print(
                f"{job:28s} {seconds:6.2f} s CPU {megabytes:6.0f} MB above base, "
                f"{seconds / base[0]:5.2f} times openpyxl's time"
            )


def run(job, path):
    done = subprocess.run(
        [sys.executable, __file__, job, str(path)], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        child(sys.argv[1], Path(sys.argv[2]))
    else:
        main()
