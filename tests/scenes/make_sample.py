"""Render the sample pair of `bifocal demo`: `python -m tests.scenes.make_sample`.

Photos of 1536 x 1024 px, 7.38 mm on the wall: a quarter of the paper's camera, quick to work with.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from bifocal.demo import SAMPLE
from bifocal.demo.workflow import PICK_SIGMA
from bifocal.files.geotiff import write_relief
from photocore.tables import write_csv
from tests.scenes import NamedPoint, Rendering, bifocal_cameras, demo_scene, render

SIZE, PIXEL, SEED = (1536, 1024), 0.00738, 20240601
#: High enough that the noise of the photos, not the compression, limits matching.
JPEG_QUALITY = 95


def sample(rng: np.random.Generator) -> Rendering:
    """Return the photos of the sample façade and everything that is true about them."""
    return render(demo_scene(), bifocal_cameras(size=SIZE, pixel=PIXEL), rng=rng)


def picked(targets: list[NamedPoint], rng: np.random.Generator) -> dict[str, object]:
    """Return the columns of targets picked as a careful hand would."""
    noise = rng.normal(0, PICK_SIGMA, (2, len(targets), 2))
    picks = np.array([(*target.pixel1, *target.pixel2) for target in targets])
    picks[:, :2] += noise[0]
    picks[:, 2:] += noise[1]
    headings = ("col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]")
    columns = dict(zip(headings, np.round(picks, 3).T, strict=True))
    relief = np.round([target.xyz[2] for target in targets], 5)
    return {"id": tuple(t.name for t in targets), **columns, "r measured [m]": relief}


def main(folder: Path) -> None:
    """Write photos, pair file, picked targets, exact relief and what both cameras see."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(SEED)
    rendering = sample(rng)
    for name, image in (("far.jpg", rendering.image1), ("near.jpg", rendering.image2)):
        Image.fromarray(image).save(folder / name, quality=JPEG_QUALITY, subsampling=0)
    pair = rendering.pair
    pair = replace(
        pair,
        image1=replace(pair.image1, file="far.jpg"),
        image2=replace(pair.image2, file="near.jpg"),
    )
    pair.write(folder / "facade.pair.json", overwrite=True)
    write_relief(folder / "truth.tif", rendering.truth, overwrite=True)
    both = rendering.visible1 & rendering.visible2 & np.isfinite(rendering.truth.r)
    Image.fromarray((both * 255).astype(np.uint8)).save(folder / "seen.png", optimize=True)
    seen = [target for target in rendering.targets if target.seen]
    write_csv(folder / "targets.csv", picked(seen, rng), overwrite=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SAMPLE)
