"""Cameras to start from where a pair looks through media and no control points are given.

Common points are looked for as in air, in pixels freed of refraction: as if both cameras stood
square to the wall at the distances supposed, which the cameras found so correct.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal.matching import Features
from bifocal.orientation.adjustment.observed_points import views_of
from bifocal.orientation.adjustment.pair_observations import PairUnknowns
from bifocal.orientation.approximate_orientation import Given, scaled
from bifocal.orientation.starts.relative_orientation import Ties, find_ties, first_cameras
from bifocal.orientation.tuning import STAGES
from bifocal.orientation.walls.wall_shape import straightened
from bifocal.remarks import remark
from photocore.camera import Pinhole, ray_on_plane
from photocore.errors import GeometryError


def refracted_start(inputs: Given, found: tuple[Features, Features]) -> tuple[PairUnknowns, Ties]:
    """Return approximate cameras and common points, seen through the media and freed of them.

    Raises
    ------
    GeometryError
        If the photos have too little in common, or nothing gives the scale.
    """
    ideal = [i.ideal(f.pixels) for i, f in zip(inputs.interiors, found, strict=True)]
    first, second = (replace(i, lens=None, sigma_radial=0.0) for i in inputs.interiors)
    distances = _supposed(inputs)
    for _ in range(STAGES.freed_rounds):
        square = _square_on(inputs, distances)
        free1, free2 = straightened(square, ideal[0], ideal[1])
        features = replace(found[0], pixels=free1), replace(found[1], pixels=free2)
        ties = find_ties(*features, (first, second), inputs.names)
        first_picks, second_picks = (
            interior.ideal(pixels)
            for interior, pixels in zip(inputs.interiors, inputs.control.picks, strict=False)
        )
        known1, known2 = straightened(square, first_picks, second_picks)
        control = replace(inputs.control, pixels1=known1, pixels2=known2)
        cameras = first_cameras(ties, (first, second))
        cameras = scaled(cameras, replace(inputs, control=control), (first, second))
        before, distances = distances, (float(cameras[0].centre[2]), float(cameras[1].centre[2]))
        if np.abs(np.log(np.divide(distances, before))).max() < STAGES.freed_enough:
            break
    ties = ties.fewer(STAGES.most_bent_ties)
    straight = zip(square.cameras, (ties.pixels1, ties.pixels2), strict=True)
    bent1, bent2 = (
        views_of(square, ray_on_plane(camera, pixels))[k].pixels
        for k, (camera, pixels) in enumerate(straight)
    )
    return PairUnknowns(cameras=cameras, media=inputs.media), replace(
        ties, seen1=bent1, seen2=bent2
    )


def _square_on(inputs: Given, distances: tuple[float, float]) -> PairUnknowns:
    """Return both cameras square to the wall at distances, no nearer than their media allow."""
    media = inputs.media
    least = media.layers.thickness + (media.depth or 0.0)
    first, second = (
        Pinhole(
            interior.matrix,
            np.diag([1.0, -1.0, -1.0]),
            np.array([0.0, 0.0, max(d, 1.05 * (least + (media.port or (0.0, 0.0))[k]))]),
        )
        for k, (interior, d) in enumerate(zip(inputs.interiors, distances, strict=True))
    )
    return PairUnknowns(cameras=(first, second), media=media)


def _supposed(inputs: Given) -> tuple[float, float]:
    """Return the distances that are measured, or follow if both photos have one scale. [m]"""
    (first, second), site, control = inputs.interiors, inputs.site, inputs.control
    d1, d2 = site.distances
    ratio = min(second.focal / first.focal, 0.8)
    if d1 is None and d2 is None and site.delta_d:
        d1 = site.delta_d / (1.0 - ratio)
    elif d1 is None and d2 is None and control.lengths:
        a, b, length = control.lengths[0]
        ends = first.ideal(control.pixels1[[a, b]])
        apparent = length * first.focal / float(np.linalg.norm(ends[0] - ends[1]))
        d1 = apparent * inputs.media.layers.indices[-1] / inputs.media.layers.indices[0]
    if d1 is None and d2 is None:
        raise GeometryError(remark("align.no_scale"))
    far = d1 if d1 is not None else (d2 or 0.0) / ratio
    return far, far * ratio if d2 is None else d2
