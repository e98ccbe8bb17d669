"""Render the sample pairs of `bifocal demo`: `python -m tests.scenes.make_sample`.

In air photos of 1536 x 1024 px, 7.38 mm on the wall: a quarter of the paper's camera, quick to work
with. Under water the same façade a fifth as large, 2.3 m wide, through flat ports, 960 x 640 px.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from bifocal import SAMPLE, WATER_SAMPLE, Pair, ReliefMap
from bifocal.demo.samples import PICK_SIGMA
from multimedia import Layers
from photocore.tables import write_csv
from tests.scenes import NamedPoint, Rendering, bifocal_cameras, demo_scene, render
from tests.scenes.rendering import Haze
from tests.scenes.wet import pair_through_media, under_water

SIZE, PIXEL, SEED = (1536, 1024), 0.00738, 20240601
#: The same under water, in the lengths of the façade; what ships is `SHRUNK` times that, for
#: refraction knows no scale. Air, glass of 10 mm and water of 1.337; coastal haze.
WATER_SIZE, WATER_PIXEL, SHRUNK = (960, 640), 0.0118, 0.2
PORTS = ((1.0, 1.49, 1.337), (0.05,), (0.25, 0.25))
COAST = Haze(attenuation=(0.11, 0.04, 0.034), backscatter=(0.09, 0.036, 0.032),
             veil=(0.07, 0.32, 0.36))  # fmt: skip
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


def water_sample(rng: np.random.Generator) -> Rendering:
    """Return the photos of the façade under water and everything that is true about them."""
    indices, thicknesses, z0 = PORTS
    cameras = under_water(
        bifocal_cameras(size=WATER_SIZE, pixel=WATER_PIXEL),
        indices=indices, thicknesses=thicknesses, z0=z0,
    )  # fmt: skip
    large = render(demo_scene(), cameras, rng=rng, haze=COAST)
    pair = shrunk_pair(pair_through_media(cameras))
    scale = np.diag([SHRUNK, SHRUNK, 1.0])
    truth = ReliefMap.from_relief(
        large.truth.r * np.float32(SHRUNK), plane_from_pixel=scale @ large.truth.plane_from_pixel
    )
    targets = tuple(replace(target, xyz=target.xyz * SHRUNK) for target in large.targets)
    return replace(large, pair=pair, truth=truth, targets=targets)


def shrunk_pair(pair: Pair) -> Pair:
    """Return a pair through media with all lengths shrunk."""
    photos = []
    for photo in (pair.image1, pair.image2):
        assert photo.layers is not None
        assert photo.z0 is not None
        matrix = photo.plane_from_pixel / photo.plane_from_pixel[2, 2]
        thin = tuple(np.round(np.array(photo.layers.thicknesses) * SHRUNK, 12).tolist())
        photos.append(
            replace(
                photo, plane_from_pixel=np.diag([SHRUNK, SHRUNK, 1.0]) @ matrix,
                nadir=photo.nadir * SHRUNK, distance=round(photo.distance * SHRUNK, 12),
                z0=round(photo.z0 * SHRUNK, 12),
                layers=Layers(indices=photo.layers.indices, thicknesses=thin),
            )
        )  # fmt: skip
    return Pair(image1=photos[0], image2=photos[1])


def main(folder: Path, *, water: bool = False) -> None:
    """Write photos, pair file, picked targets, exact relief and what both cameras see."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(SEED)
    rendering = water_sample(rng) if water else sample(rng)
    for name, image in (("far.jpg", rendering.image1), ("near.jpg", rendering.image2)):
        Image.fromarray(image).save(folder / name, quality=JPEG_QUALITY, subsampling=0)
    pair = rendering.pair
    height, width = rendering.image1.shape[:2]
    pair = replace(
        pair,
        image1=replace(pair.image1, file="far.jpg", image_size=(width, height)),
        image2=replace(pair.image2, file="near.jpg", image_size=(width, height)),
    )
    pair.write(folder / "facade.pair.json", overwrite=True)
    rendering.truth.write(folder / "truth.tif", overwrite=True)
    both = rendering.visible1 & rendering.visible2 & np.isfinite(rendering.truth.r)
    Image.fromarray((both * 255).astype(np.uint8)).save(folder / "seen.png", optimize=True)
    seen = [target for target in rendering.targets if target.seen]
    write_csv(folder / "targets.csv", picked(seen, rng), overwrite=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SAMPLE)
    main(Path(sys.argv[2]) if len(sys.argv) > 2 else WATER_SAMPLE, water=True)
