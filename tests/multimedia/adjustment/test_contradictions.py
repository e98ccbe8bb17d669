"""Images that contradict each other end the adjustment early, with the culprit named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimedia import (
    Camera,
    ConvergenceError,
    FlatInterface,
    ImagePoints,
    Layers,
    ObjectPoints,
    Project,
    Unknowns,
    bundle_adjust,
    project,
)
from multimedia.media.camera import EXTERIOR

GLASS = FlatInterface(layers=Layers(indices=(1.0, 1.46, 1.33), thicknesses=(6.0,)))
EYES = ((-150, -150, 700), (150, -150, 700), (150, 150, 700), (-150, 150, 700))
FULL = ("c", "xh", "yh", "k1", "p1", "p2", "scale")


def planes(interchanged: bool) -> Project:
    """Return four cameras before four plates; in one image two plates may change places. [mm]"""
    rng = np.random.default_rng(1)
    views = [
        replace(Camera.looking_at(eye, (0, 0, -60), principal_distance=70.0), name=f"cam{k}")
        for k, eye in enumerate(EYES, start=1)
    ]
    x, y = np.meshgrid(np.linspace(-70, 70, 9), np.linspace(-40, 40, 6))
    flat = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    plates = [flat - np.array([0, 0, 30 + 20 * k]) for k in range(4)]
    image = np.stack([[project(camera, plate, GLASS) for plate in plates] for camera in views])
    if interchanged:
        image[1, [0, 2]] = image[1, [2, 0]]
    image = image.reshape(-1, 2) + 0.0012 * rng.standard_normal((4 * 4 * x.size, 2))
    ids = tuple(f"{k}-{n}" for k in range(4) for n in range(x.size))
    off = np.array([5, -4, 6, 0.01, -0.01, 0.01])
    start = [c.stepped(EXTERIOR, off * rng.standard_normal(6)) for c in views]
    xyz = np.concatenate(plates)
    return Project(
        cameras=tuple(start), media={"glass": GLASS}, media_of=("glass",) * 4, unit="mm",
        object_points=ObjectPoints(
            ids=ids, xyz=xyz, sigma=np.zeros_like(xyz), groups=tuple(f"plate{i[0]}" for i in ids)
        ),
        image_points=ImagePoints(
            cameras=tuple(c.name for c in views for _ in ids), ids=ids * 4, image=image
        ),
    )  # fmt: skip


@pytest.mark.parametrize("interior", [(), FULL])
def test_plates_that_change_places_in_one_image_are_named_after_few_steps(interior):
    unknowns = Unknowns(plates=("plate1", "plate2", "plate3"), interior=interior)
    result = bundle_adjust(planes(False), unknowns)
    assert result.sigma0 < 0.0015
    with pytest.raises(
        ConvergenceError, match=r"contradict each other.*camera cam2, plate"
    ) as told:
        bundle_adjust(planes(True), unknowns)
    assert told.value.iterations <= 30
