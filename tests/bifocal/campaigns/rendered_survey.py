"""A survey of rendered walls, each another one, with two pairs that are broken on purpose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from tests.bifocal.orientation.street import CONTROL, write_table
from tests.scenes import POOR, RICH, SetupErrors, bifocal_cameras, facade, render

#: Half width of what a pair shows, distance of the far camera. [m]
_HALF, _FAR = 5.67, 17.5
#: Names of the pairs that fail, and what the program has to say of them.
BROKEN = {"cut off": "cut_off_far.png: the image is damaged", "no control": "--control"}


def write_rendered_survey(
    folder: Path, *, pairs: int, width: int, products: tuple[str, ...]
) -> Path:
    """Write photos and tables of walls of different layout and light, and their survey file.

    Parameters
    ----------
    folder : Path
        To be made.
    pairs : int
        In all; two of them are broken: a photo cut off, a pair without control.
    width : int
        Of the photos, two thirds as high. [px]
    products : tuple of str
        Wanted of each pair.
    """
    folder.mkdir()
    pixel = 2 * _HALF / width
    wanted = ", ".join(f'"{product}"' for product in products)
    # 35 mm at 17.5 m.
    lines = ['scale = "1:100"', 'quality = "fast"', f"sensor_width = {2 * _HALF * 35 / _FAR:.5f}",
             "focal1 = 35", "focal2 = 19", f"products = [{wanted}]"]  # fmt: skip
    for number in range(pairs):
        rng = np.random.default_rng(number)
        # Every fifth wall is plain plaster.
        palette = POOR if number % 5 == 4 else RICH
        scene = facade(seed=number, palette=palette, texel=pixel / 2)
        cameras = bifocal_cameras(
            size=(width, width * 2 // 3), pixel=pixel, rng=rng,
            errors=SetupErrors(principal_point=0.0, focal=0.0),
        )  # fmt: skip
        shot = render(scene, cameras, rng=rng, gsd=0.2)
        name = [*BROKEN, *(f"wall_{k:02}" for k in range(2, pairs))][number]
        stem = name.replace(" ", "_")
        for side, image in (("far", shot.image1), ("near", shot.image2)):
            Image.fromarray(image).save(folder / f"{stem}_{side}.png")
        seen = [target for target in shot.targets if target.seen]
        lines += ["", "[[pair]]", f'name = "{name}"', f'far = "{stem}_far.png"']
        lines += [f'near = "{stem}_near.png"']
        for role in ("control", "check") if name != "no control" else ():
            chosen = [t for t in seen if (t.name in CONTROL) == (role == "control")]
            write_table(folder / f"{stem}_{role}.csv", chosen, rng)
            lines += [f'{role} = "{stem}_{role}.csv"']
    broken = folder / "cut_off_far.png"
    broken.write_bytes(broken.read_bytes()[: broken.stat().st_size // 2])
    path = folder / "street.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
