"""What each stage of dense relief is worth: errors with it and without it, one at a time.

    python benchmarks/relief_ablation.py [SCENE ...]

The scenes are rendered with exact truth and nothing was tuned on them: a façade at 35/19 and at
35/28 mm, a balcony and a portal, the front of a church whose second photo is exposed otherwise,
the front taken from the side, and façade, balcony and church in plain plaster. Photos of 1.6 MP, a
minute or two a scene on one core; flow is found once a scene. Beside what a stage does to errors
stands what it does to what the map promises: which pixels count as measured, and which an
orthophoto leaves empty as hidden.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from unittest.mock import patch

import cv2
import numpy as np

from bifocal import dense_relief, orthophoto
from bifocal.relief_maps import flow, stages
from tests.scenes import (
    POOR,
    RICH,
    CameraPair,
    Exposure,
    SceneCamera,
    bifocal_cameras,
    facade,
    render,
)  # fmt: skip
from tests.scenes.church import church
from tests.scenes.delivery import hidden_figures, ortho_figures, relief_figures
from tests.scenes.loggia import loggia

DIM = Exposure(gain=0.8, gamma=1.15, vignetting=0.3, noise=2.0)
PLASTER = replace(POOR, wall=replace(POOR.wall, contrast=0.005))
#: Façade, seed, palette, pixel [m], d2 [m], exposure of photo 2.
SCENES = {
    "facade": (facade, 1001, RICH, 0.00738, 9.5, Exposure()),
    "facade 35/28": (facade, 1002, RICH, 0.00738, 14.0, Exposure()),
    "balcony": (loggia, 1003, RICH, 0.00369, 9.5, Exposure()),
    "church": (church, 1006, RICH, 0.00738, 9.5, DIM),
    "church from the side": (church, 1008, RICH, 0.00738, 9.5, Exposure()),
    "plaster facade": (facade, 1004, POOR, 0.00738, 9.5, Exposure()),
    "plaster balcony": (loggia, 1005, PLASTER, 0.00369, 9.5, Exposure()),
    "plaster church": (church, 1007, POOR, 0.00738, 12.0, Exposure()),
}
#: Heading, name in `tests.scenes.delivery`.
FIGURES = {
    "median": "median mm",
    ">3 cm": "beyond 3 cm %",
    "RMSE": "rmse off edges mm",
    "covered": "covered %",
    "measured": "measured %",
    "of it >3 cm": "measured beyond 3 cm %",
    "falsely": "false measured %",
    "sigma": "measured error/sigma",
    "phantoms": "phantom px",
    "specks": "specks",
    "hidden": "hidden recall",
    "rightly": "hidden precision",
}


def aside(camera: SceneCamera, place: tuple[float, float]) -> SceneCamera:
    """Return a camera moved along the wall and turned to its middle."""
    centre = np.array([*place, camera.centre[2]])
    view = -centre / np.linalg.norm(centre)
    right = np.cross([0.0, -1.0, 0.0], view)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(view, right), view])
    return replace(camera, centre=centre, rotation=rotation)


def shots(name: str, size: tuple[int, int] = (1536, 1024), coarser: int = 1):
    """Return a rendered scene, with pixels that are so many times coarser."""
    layout, seed, palette, pixel, d2, exposure = SCENES[name]
    pixel *= coarser
    cameras = bifocal_cameras(size=size, pixel=pixel, d2=d2)
    if "side" in name:
        sides = aside(cameras.far, (8.0, -1.5)), aside(cameras.near, (8.5, -1.5))
        cameras = CameraPair(
            far=sides[0], near=sides[1], nominal_far=sides[0], nominal_near=sides[1]
        )
    scene = layout(seed=seed, palette=palette, texel=pixel / 1.5)
    rng = np.random.default_rng(seed)
    return render(scene, cameras, rng=rng, exposures=(Exposure(), exposure))


def figures(shot) -> dict[str, float]:
    """Return the figures of a relief map and of the mask of its orthophoto."""
    grid = shot.truth.grid
    found = dense_relief(shot.pair, shot.image1, shot.image2, gsd=grid.gsd, bounds=grid.bounds)
    picture = orthophoto(shot.pair, shot.image1, found)
    both = shot.visible1 & shot.visible2
    covered = {"covered %": 100 * float(np.isfinite(found.r)[both].mean())}
    known = relief_figures(found, shot) | covered | ortho_figures(picture, found)
    known |= hidden_figures(picture.hidden, shot)
    return {heading: known[key] for heading, key in FIGURES.items()}


def ablation(name: str) -> None:
    """Print the figures of a scene, and how they change without each stage."""
    shot, whole = shots(name), stages.STAGES
    measured = {}

    def once(frame, coarse, **options):
        key = frame.grid.shape
        if key not in measured:
            measured[key] = measure(frame, coarse, **options)
        return measured[key]

    measure = flow.measure
    with patch.object(flow, "measure", once):
        base = figures(shot)
        print(f"\n{name:34s}" + " ".join(f"{heading:>11s}" for heading in FIGURES))
        print(" " * 34 + " ".join(f"{value:11.3f}" for value in base.values()))
        for stage in whole:
            if stage.needed:
                continue
            rest = tuple(other for other in whole if other is not stage)
            with patch.object(stages, "STAGES", rest):
                found = figures(shot)
            changes = (found[heading] - base[heading] for heading in FIGURES)
            print(f"  without {stage.name:24s}", end="")
            print(" ".join(f"{c:+11.3f}" if abs(c) >= 5e-4 else f"{'.':>11s}" for c in changes))
            sys.stdout.flush()


if __name__ == "__main__":
    cv2.setNumThreads(1)
    for scene in sys.argv[1:] or SCENES:
        ablation(scene)
