"""Make a pair file and a point table of an example façade whose cameras are known.

    python examples/pair_from_geometry.py $BIFOCAL_DATA/facade_pairs/church_1 church_1

writes ``church_1/church_1.pair.json`` (beside it nothing is copied: it names the photos where they
are) and ``church_1/points.csv``, ready for

    bifocal solve church_1/points.csv --pair church_1/church_1.pair.json --json
"""

from __future__ import annotations

import csv
import json
import os
import sys
from pathlib import Path

import numpy as np

from bifocal import Pair, Photo


def pair_of(geometry: dict, photos: Path, out: Path) -> Pair:
    """Return the pair: a homography, a nadir and a distance for each camera."""

    def photo(view: str) -> Photo:
        camera = geometry[view]
        return Photo(
            file=Path(os.path.relpath(photos / f"{view}.jpg", out)).as_posix(),
            plane_from_pixel=np.linalg.inv(camera["H_wall_to_pixel"]),
            nadir=camera.get("nadir_wall_m", camera.get("nadir_wall")),
            distance=camera.get("height_over_plane_m", camera.get("height_over_plane")),
        )

    return Pair(image1=photo("far"), image2=photo("near"), extra={"name": geometry["label"]})


def main(source: Path, out: Path) -> None:
    """Write both files."""
    out.mkdir(parents=True, exist_ok=True)
    geometry = json.loads((source / "geometry.json").read_text())
    pair = pair_of(geometry, source.resolve(), out.resolve())
    pair.write(out / f"{source.name}.pair.json", overwrite=True)
    with (source / "points.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    relief = "relief_m" if "relief_m" in rows[0] else "relief"
    with (out / "points.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["id", "col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]", "r measured [m]"]
        )
        for row in rows:
            picks = [row[key] for key in ("x_far_px", "y_far_px", "x_near_px", "y_near_px")]
            writer.writerow([row["id"], *picks, row[relief]])
    print(f"{out / source.name}.pair.json, {out / 'points.csv'} ({len(rows)} points)")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
