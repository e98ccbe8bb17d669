"""Photographs as cameras deliver them: tilted, not square on, lens not quite calibrated, JPEG.

Numbers are tuned on ``TUNED`` seeds only; ``KEPT`` seeds of every scene are for reporting.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tests.scenes.balconies import balconies
from tests.scenes.cameras import SceneCamera, SetupErrors, bifocal_cameras
from tests.scenes.facade import POOR, RICH, Palette, facade
from tests.scenes.rendering import Exposure, Rendering, render
from tests.scenes.shapes import Scene
from tests.scenes.streets import (
    MIRRORING,
    WHITE,
    arcade,
    gable,
    palazzo,
    people,
    street,
    tracery,
)  # fmt: skip

#: Seeds that numbers may be tuned on, and seeds that they never are.
TUNED, KEPT = (5001, 5002), (6001, 6002)
#: Pixel on the wall of a photo of 6 MP. [m]
FINE = 0.00369


@dataclass(frozen=True, slots=True, kw_only=True)
class Taking:
    """How a scene is photographed.

    Attributes
    ----------
    layout : callable
        Returns the scene of a seed.
    palette : Palette
    d1, d2 : float
        Distances. [m]
    tilt_deg, offset : float
        Half widths of the cameras' tilts [deg] and of their offsets along the wall [m].
    residual : float
        What the lens calibration leaves, RMS. [px of `FINE`]
    jpeg : int, optional
        Quality of both photos; None keeps them as they are.
    passers : int
        People who walk on between the photos.
    """

    layout: Callable[..., Scene]
    palette: Palette
    d1: float = 17.5
    d2: float = 9.5
    tilt_deg: float = 1.0
    offset: float = 0.2
    residual: float = 0.1
    jpeg: int | None = 85
    passers: int = 0


#: What a camera delivers, and scenes without any of its faults.
TAKINGS = {
    "arcade": Taking(layout=arcade, palette=MIRRORING),
    "tracery": Taking(layout=tracery, palette=MIRRORING, tilt_deg=5.0, jpeg=90),
    "street": Taking(layout=street, palette=MIRRORING, d1=25.0, d2=12.0, passers=2),
    "gable": Taking(layout=gable, palette=MIRRORING, d2=14.0, offset=0.8, jpeg=95),
    "white": Taking(layout=facade, palette=WHITE),
    "palazzo": Taking(layout=palazzo, palette=WHITE, d2=12.0, jpeg=75),
    "plaster": Taking(layout=facade, palette=POOR, tilt_deg=0.0, offset=0.0, residual=0.0),
    "balconies": Taking(
        layout=balconies, palette=RICH, tilt_deg=0.0, offset=0.0, residual=0.0, jpeg=None
    ),
    "35/19": Taking(
        layout=facade, palette=RICH, tilt_deg=0.0, offset=0.0, residual=0.0, jpeg=None
    ),
    "35/28": Taking(
        layout=facade, palette=RICH, d2=14.0, tilt_deg=0.0, offset=0.0, residual=0.0, jpeg=None
    ),
}  # fmt: skip


def unseen(
    name: str, seed: int, *, size: tuple[int, int] = (1536, 1024), pixel: float = 0.00738,
    jpeg: int | None = None,
) -> Rendering:  # fmt: skip
    """Photograph a scene by its name, a key of `TAKINGS`.

    Parameters
    ----------
    name : str
    seed : int
        Of layout, textures, set-up, exposure and noise.
    size : tuple of int
        Width and height of both photos. [px]
    pixel : float
        Side of a pixel on the wall. [m]
    jpeg : int, optional
        Another quality than the taking's.
    """
    taking = TAKINGS[name]
    rng = np.random.default_rng(seed)
    ideal = not (taking.tilt_deg or taking.offset or taking.residual)
    errors = SetupErrors(
        tilt_deg=taking.tilt_deg, distance=0.01, focal=0.005, offset=taking.offset,
        principal_point=4.0,
    )  # fmt: skip
    cameras = bifocal_cameras(
        size=size, pixel=pixel, d1=taking.d1, d2=taking.d2, errors=None if ideal else errors,
        rng=rng,
    )  # fmt: skip
    cameras = replace(
        cameras,
        far=_aimed(cameras.far, taking, pixel, rng),
        near=_aimed(cameras.near, taking, pixel, rng),
    )
    exposures = [
        Exposure(
            gain=1.0 if ideal else rng.uniform(0.85, 1.1),
            gamma=1.0 if ideal else rng.uniform(0.95, 1.1),
            vignetting=0.0 if ideal else 0.15,
            jpeg=jpeg or taking.jpeg,
        )
        for _ in range(2)
    ]
    return render(
        taking.layout(seed=seed, palette=taking.palette, texel=pixel / 1.5), cameras, rng=rng,
        exposures=(exposures[0], exposures[1]), passing=people(rng, taking.passers),
    )  # fmt: skip


def _aimed(
    camera: SceneCamera, taking: Taking, pixel: float, rng: np.random.Generator
) -> SceneCamera:
    """Return a camera turned back to the middle of the scene, with a lens residual."""
    middle = (camera.view_of(np.zeros((1, 3)))[0] - np.subtract(camera.size, 1) / 2) * 0.9
    matrix = camera.matrix.copy()
    matrix[:2, 2] -= middle  # as a shifted lens does, or cropping
    residual = taking.residual * rng.choice([-1.0, 1.0]) * FINE / pixel
    return replace(camera, matrix=matrix, residual=residual)
