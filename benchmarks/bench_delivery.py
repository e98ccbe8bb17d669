"""What a client would send back, in figures: relief and orthophoto of rendered façades.

    python benchmarks/bench_delivery.py [SEED ...]

For every seed (default 71) a textured pair at 35/19 and 35/28 and one of plain plaster, 6 MP each:
median, tails, wrongly measured pixels, phantoms, holes, scraps and radial bars
(`tests/scenes/delivery.py`), for standard and fast quality. A scene takes some 50 CPU s.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from bifocal import dense_relief
from bifocal.orthophotos.compose import orthophoto
from tests.scenes import POOR, RICH, bifocal_cameras, facade, render
from tests.scenes.delivery import bars, hidden_figures, ortho_figures, relief_figures

POORER = replace(
    POOR,
    wall=replace(POOR.wall, contrast=0.004),
    stone=replace(POOR.stone, contrast=0.006),
    trim=replace(POOR.trim, contrast=0.004),
    wood=replace(POOR.wood, contrast=0.009),
)
SCENES = {"35/19": (9.5, RICH), "35/28": (14.0, RICH), "plaster": (9.5, POORER)}


def main(seeds: list[int]) -> None:
    """Render, measure, print."""
    for seed in seeds:
        for name, (d2, palette) in SCENES.items():
            rng = np.random.default_rng(seed)
            scene = facade(seed=seed, palette=palette, texel=0.0025)
            shot = render(scene, bifocal_cameras(d2=d2), rng=rng)
            for quality in ("standard", "fast"):
                relief = dense_relief(shot.pair, shot.image1, shot.image2, quality=quality)
                picture = orthophoto(shot.pair, shot.image1, relief)
                figures = relief_figures(relief, shot) | ortho_figures(picture, relief)
                figures |= hidden_figures(picture.hidden, shot)
                nadir = relief.grid.pixel_of(shot.pair.image1.nadir)
                figures["bars"] = bars(picture.hidden, nadir)
                print(f"\n{name}, façade {seed}, {quality}")
                for key, value in figures.items():
                    print(f"  {key:32s}{value:10.4g}")


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]] or [71])
