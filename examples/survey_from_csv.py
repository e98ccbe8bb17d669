"""A table of points picked on both photos, turned into coordinates with their precision.

    python examples/survey_from_csv.py

The table and the pair file are those of `bifocal demo`. The command line does the same with
workbooks: bifocal solve targets.csv --pair facade.pair.json --out result.xlsx
"""

import numpy as np

import bifocal

picks = bifocal.Measuring(sigma_px=0.2)
survey = bifocal.solve(
    bifocal.SAMPLE / "targets.csv", pair=bifocal.SAMPLE / "facade.pair.json", measuring=picks
)
points = survey.table
for k in range(0, len(points), 8):
    x, y, r = points.xyz[k]
    sigma = 1000 * points["sigma_r"][k]
    print(f"{points.ids[k]}  X {x:7.3f}  Y {y:7.3f}  r {r:7.4f} m  sigma {sigma:4.1f} mm")

# The column "r measured [m]" of the table is taken as a check.
known = dict(zip(survey.check.ids, survey.check.errors[:, 2], strict=True))
good = [name for name, flag in zip(points.ids, points.flags, strict=True) if flag != "UNCERTAIN"]
rms = 1000 * np.sqrt(np.mean([known[name] ** 2 for name in good]))
print(f"{len(good)} of {len(points)} points, RMS error of r {rms:.1f} mm")
