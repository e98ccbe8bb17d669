"""A text table of a million points: our tolerant reader and writer beside Python's csv module.

CPU seconds; what is read is checked to the last bit first.
"""

from __future__ import annotations

import csv
import tempfile
import time
from pathlib import Path

import numpy as np

from photocore.tables import Column, read_table, write_csv

COUNT = 1_000_000
KEYS = ("x1", "y1", "x2", "y2")


def timed(function, *arguments, **options):
    begin = time.process_time()
    value = function(*arguments, **options)
    return value, time.process_time() - begin


def read_plainly(path):
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.reader(file)
        next(rows)
        return np.array([[float(text) for text in row[1:]] for row in rows])


def main():
    random = np.random.default_rng(1)
    columns = {"id": [f"P{i}" for i in range(COUNT)]}
    columns |= {key: random.uniform(-100, 100, COUNT) for key in KEYS}
    asked = [Column("id", kind="text"), *map(Column, KEYS)]
    with tempfile.TemporaryDirectory() as folder:
        for flavour in ("plain", "excel-it"):
            path = Path(folder) / f"{flavour}.csv"
            _, writing = timed(write_csv, path, columns, flavour=flavour)
            table, reading = timed(read_table, path, asked)
            for key in KEYS:
                assert np.array_equal(table.numbers(key), columns[key])
            print(f"{flavour:10s} write {writing:5.2f} s CPU, read {reading:5.2f} s CPU")
        _, reading = timed(read_plainly, Path(folder) / "plain.csv")
        print(f"csv module, no checks, no names: read {reading:5.2f} s CPU")


if __name__ == "__main__":
    main()
