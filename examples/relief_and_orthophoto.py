"""Dense relief and a true orthophoto of a piece of wall, compared with the exact relief.

    python examples/relief_and_orthophoto.py

The photos are those of `bifocal demo`: rendered, so that the truth is known.
"""

import numpy as np

import bifocal

pair = bifocal.Pair.read(bifocal.SAMPLE / "facade.pair.json")
far, near = pair.photo1.image, pair.photo2.image

relief = bifocal.dense_relief(pair, far, near, gsd=0.03, bounds=(-4, -2.5, 4, 2.5))
ortho = bifocal.orthophoto(pair, far, relief, gsd=0.015)

truth = bifocal.ReliefMap.read(bifocal.SAMPLE / "truth.tif")
columns, rows = np.meshgrid(relief.grid.columns_x, relief.grid.rows_y)
error = relief.r - truth.sample(np.stack([columns, rows], axis=-1))
measured = relief.quality == bifocal.Quality.MEASURED
median = np.nanmedian(np.abs(error[measured]))
print(f"{measured.mean():.0%} of the wall measured, median error of r {1000 * median:.1f} mm")
height, width = ortho.image.shape[:2]
print(
    f"orthophoto {width} x {height} px of {1000 * ortho.gsd:g} mm, {ortho.valid.mean():.0%} filled"
)
