"""Whether the wall, freed of the refraction that a pair's media are said to cause, is flat."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model.homography import apply_homography
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.adjustment.pair_observations import PairUnknowns
from bifocal.orientation.adjustment.seen_points import meeting_points, on_the_plane, views_of
from bifocal.orientation.walls.bend import WallBend, bend_of_wall
from photocore.arrays import FloatArray
from photocore.camera.pinhole import project

#: Draws of the cameras and media as uncertain as they are, and the bend that counts, in what they
#: bend the wall by.
DRAWS, BEYOND = 24, 2.0


def refracted_bend(
    adjusted: AdjustedPair, pixels1: FloatArray, pixels2: FloatArray, size: tuple[int, int]
) -> WallBend:
    """Return how far the wall is from a plane between photos freed of refraction.

    Parameters
    ----------
    adjusted : AdjustedPair
        Cameras and media.
    pixels1, pixels2 : ndarray, shape (n, 2)
        Ties, free of the lenses' distortion. [px]
    size : tuple of int
        Width and height of photo 1. [px]

    Returns
    -------
    WallBend
        As of `bend_of_wall`; NaN too where it is no more than cameras and media, as uncertain as
        they are, leave open. [px, at 3000 px of width]
    """
    flat = straightened(adjusted, pixels1, pixels2)
    known = np.isfinite(np.concatenate(flat, axis=1)).all(axis=1)
    xyz = meeting_points(adjusted, pixels1[known], pixels2[known])
    height = xyz[:, 2] / adjusted.cameras[0].centre[2]
    bend = bend_of_wall(flat[0][known], flat[1][known], size, height)
    return bend if bend.px > BEYOND * _open(adjusted, size) else WallBend()


def straightened(
    state: PairUnknowns, pixels1: FloatArray, pixels2: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where ideal pixels would lie if the media did not bend what lies on the plane, (n, 2).

    Between photos of a wall freed of refraction the wall is a plane again.
    """
    first, second = (
        project(camera, on_the_plane(state, number, pixels))
        for number, (camera, pixels) in enumerate(
            zip(state.cameras, (pixels1, pixels2), strict=True)
        )
    )
    return first, second


def _open(adjusted: AdjustedPair, size: tuple[int, int]) -> float:
    """Return how much the uncertainty of cameras and media bends a flat wall, root mean square."""
    columns, rows = np.meshgrid(np.linspace(0, size[0], 12), np.linspace(0, size[1], 8))
    seen = np.column_stack([columns.ravel(), rows.ravel()])
    seen1, seen2 = (view.pixels for view in views_of(adjusted, on_the_plane(adjusted, 0, seen)))
    values, vectors = np.linalg.eigh(adjusted.of_unknowns)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    squares = []
    for draw in np.random.default_rng(7).normal(size=(DRAWS, len(values))):
        state = adjusted.stepped(factor @ draw)
        if state is None:
            continue
        flat1, flat2 = straightened(state, seen1, seen2)
        known = np.isfinite(np.hstack([flat1, flat2])).all(axis=1)
        if known.sum() < 12:
            continue
        matrix, _ = cv2.findHomography(flat1[known], flat2[known], 0)
        apart = flat2[known] - apply_homography(matrix, flat1[known])
        squares.append(float((apart**2).sum(axis=1).mean()))
    return float(np.sqrt(np.mean(squares))) / (max(size) / 3000.0) if squares else 0.0
