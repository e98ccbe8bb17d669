"""A table of points picked on both photos, turned into coordinates with their precision.

    python examples/survey_from_csv.py

The table and the pair file are those of `bifocal demo`. The command line does the same with
workbooks: bifocal solve targets.csv --pair facade.pair.json --out result.xlsx
"""

import csv

import numpy as np

import bifocal
from bifocal.demo import SAMPLE

pair = bifocal.Pair.read(SAMPLE / "facade.pair.json")
with (SAMPLE / "targets.csv").open(newline="", encoding="utf-8") as file:
    rows = list(csv.DictReader(file))
far = np.array([[row["col1 [px]"], row["row1 [px]"]] for row in rows], float)
near = np.array([[row["col2 [px]"], row["row2 [px]"]] for row in rows], float)

points = pair.intersect(far, near, sigma_px=0.2)
sigma_r = np.sqrt(points.covariance[:, 2, 2])
for k in range(0, len(rows), 8):
    x, y, r = points.xyz[k]
    print(
        f"{rows[k]['id']}  X {x:7.3f}  Y {y:7.3f}  r {r:7.4f} m  sigma {1000 * sigma_r[k]:4.1f} mm"
    )

error = points.xyz[:, 2] - np.array([row["r measured [m]"] for row in rows], float)
good = np.array([flag in ("OK", "ON-PLANE", "WEAK") for flag in points.flags])
rms = 1000 * np.sqrt((error[good] ** 2).mean())
print(f"{good.sum()} of {len(rows)} points, RMS error of r {rms:.1f} mm")
