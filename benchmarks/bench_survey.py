"""Whole surveys: import, solve and write workbooks and text tables, beside openpyxl's plain write.

Each job runs in a process of its own; CPU seconds without imports, and peak memory above that of an
interpreter that has imported what the job needs. Relief is checked against the truth first.
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

C1, D1, C2, D2 = 35.0, 17.5, 19.0, 9.5


def truth(rows):
    random = np.random.default_rng(7)
    span = (random.uniform(-5, 5, rows), random.uniform(-3, 3, rows), random.uniform(-1, 1, rows))
    return np.column_stack(span)


def observations(rows):
    from bifocal.survey.observations import PointObservations

    xyz = truth(rows)
    images = [c * xyz[:, :2] / (d - xyz[:, 2:]) for c, d in ((C1, D1), (C2, D2))]
    ids = tuple(f"P{i}" for i in range(rows))
    return PointObservations(ids=ids, xy1=images[0], xy2=images[1])


def write_workbook(path, rows):
    from bifocal import Pair
    from bifocal.survey.observations import PointObservations
    from bifocal.workbook.template_workflow import write_survey

    pair = Pair.ideal(d1=D1, d2=D2, c1=C1, c2=C2, pixel_size=0.004)
    pixels1, pixels2 = pair.project(truth(rows))
    ids = tuple(f"P{i}" for i in range(rows))
    points = PointObservations(ids=ids, pixels1=pixels1, pixels2=pixels2)
    begin = time.process_time()
    write_survey(path, points, pair=pair, overwrite=True)
    return time.process_time() - begin


def write_openpyxl(path, rows):
    """The same number of cells in `Points` and `Results`, plain numbers, no formulas."""
    import openpyxl

    values = np.random.default_rng(1).uniform(size=36).tolist()
    begin = time.process_time()
    book = openpyxl.Workbook()
    for _ in range(rows):
        book.active.append(values)
    book.save(path)
    return time.process_time() - begin


def solve(path, rows, out=None):
    from bifocal import Taking
    from bifocal.workbook import workflow
    from bifocal.workbook.output import write_result

    taking = Taking(d1=D1, d2=D2, c1=C1, c2=C2) if path.suffix == ".csv" else None
    begin = time.process_time()
    solution = workflow.solve(path, taking=taking)
    if out is not None:
        write_result(out, solution, overwrite=True)
    seconds = time.process_time() - begin
    assert np.nanmax(np.abs(solution.table.xyz - truth(rows))) < 1e-6
    return seconds


def write_csv(path, rows):
    from photocore.tables import write_csv

    points = observations(rows)
    columns = {"id": list(points.ids)}
    columns |= {f"x{i} [mm]": xy[:, 0] for i, xy in ((1, points.xy1), (2, points.xy2))}
    columns |= {f"y{i} [mm]": xy[:, 1] for i, xy in ((1, points.xy1), (2, points.xy2))}
    write_csv(path, columns, overwrite=True)
    return 0.0


JOBS = {
    "write 20000 rows, plain, openpyxl": lambda f: write_openpyxl(f / "plain.xlsx", 20_000),
    "write 20000 rows, live and solved": lambda f: write_workbook(f / "20000.xlsx", 20_000),
    "read and solve 20000 rows": lambda f: solve(f / "20000.xlsx", 20_000),
    "write 1000 rows, live and solved": lambda f: write_workbook(f / "1000.xlsx", 1000),
    "read, solve, update 1000 rows": lambda f: solve(f / "1000.xlsx", 1000, f / "out.xlsx"),
    "read, solve, update 20000 rows": lambda f: solve(f / "20000.xlsx", 20_000, f / "out20.xlsx"),
    "make 1000000 rows of text": lambda f: write_csv(f / "big.csv", 1_000_000),
    "read, solve, write 1000000 rows of text": lambda f: solve(
        f / "big.csv", 1_000_000, f / "out.csv"
    ),
}


def memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main():
    with tempfile.TemporaryDirectory() as folder:
        for job in JOBS:
            command = [sys.executable, __file__, job, folder]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            seconds, megabytes = json.loads(done.stdout)
            if seconds:
                print(f"{job:42s} {seconds:6.2f} s CPU {megabytes:6.0f} MB above base", flush=True)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        import openpyxl  # noqa: F401

        import photocore.tables  # noqa: F401

        base = memory()
        elapsed = JOBS[sys.argv[1]](Path(sys.argv[2]))
        print(json.dumps([elapsed, memory() - base]))
    else:
        main()
