"""How precisely places and relief of the wall are known, and what drawing scale that holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bifocal.model import Pair
from bifocal.survey.observations import PointObservations
from bifocal.survey.point_survey import solve_points
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.tolerances import RULES, SCALES
from photocore.arrays import BoolArray, FloatArray

#: Nodes along the longer side of photo 1 at which sigma of relief is computed.
NODES = 40
#: The same of places, whose covariance is common to all of them.
PLACES = 12
PRINT = next(rule for rule in RULES if rule.key == "print-0.25")

#: Width and height of the far and of the near photo. [px]
Sizes = tuple[tuple[int, int], tuple[int, int]]


@dataclass(frozen=True, slots=True, kw_only=True)
class WallPrecision:
    """How precisely the wall is known where both photos show it.

    Attributes
    ----------
    middle, rim : float
        Median sigma of relief over the middle ninth of it, and over the rest. [m]
    place : float
        Nine tenths of all places are known within this, X and Y together, in the survey's own
        frame: what moves all places alike is in no drawing. [m]
    scale : int or None
        The finest drawing scale whose tolerance of a print holds the places.
    """

    middle: float
    rim: float
    place: float
    scale: int | None


def wall_precision(
    pair: Pair, sizes: Sizes, solve: Callable[[PointObservations], ReliefTable] | None = None
) -> WallPrecision | None:
    """Return how precisely relief and places are known over the wall.

    Parameters
    ----------
    pair : Pair
    sizes : pair of (int, int)
        Width and height of the photos. [px]
    solve : callable, optional
        Solves points that are given by pixels; default `solve_points` of the pair.

    Returns
    -------
    WallPrecision or None
        None where the photos show nothing together or no sigma is known.
    """
    solve = solve or (lambda points: solve_points(pair, points))
    nodes, inside = _nodes(pair, sizes, NODES)
    if not inside.any():
        return None
    sigma = np.full(len(inside), np.nan)
    sigma[inside] = solve(_points(nodes, inside))["sigma_r"]
    columns, rows = nodes[0].T
    usable = np.isfinite(sigma)
    middle = usable.copy()
    for values in (columns, rows):
        low, high = np.percentile(values[inside], [33, 67])
        middle &= (values >= low) & (values <= high)
    places = places_sigma(pair, sizes, solve)
    if not (middle.any() and (usable & ~middle).any() and len(places)):
        return None
    place = float(np.percentile(places, 90))
    holds = [scale for scale in SCALES if place <= (PRINT.tolerance(scale) or 0.0)]
    return WallPrecision(
        middle=float(np.median(sigma[middle])),
        rim=float(np.median(sigma[usable & ~middle])),
        place=place,
        scale=holds[0] if holds else None,
    )


def _nodes(
    pair: Pair, sizes: Sizes, longer: int
) -> tuple[tuple[FloatArray, FloatArray], BoolArray]:
    """Return nodes over photo 1 by their pixels in both, and which of them both show."""
    width, height = sizes[0]
    step = max(width, height) / longer
    column, row = (
        (np.arange(max(2, round(side / step))) + 0.5) * side / max(2, round(side / step)) - 0.5
        for side in (width, height)
    )
    far = np.stack(np.meshgrid(column, row), axis=-1).reshape(-1, 2)
    near = pair.image2.pixels_from_plane(pair.image1.plane_from_pixels(far))
    inside = np.all((near > -0.5) & (near < np.array(sizes[1]) - 0.5), axis=1)
    return (far, near), np.asarray(inside)


def _points(nodes: tuple[FloatArray, FloatArray], inside: BoolArray) -> PointObservations:
    count = int(inside.sum())
    return PointObservations(
        ids=tuple(map(str, range(count))), pixels1=nodes[0][inside], pixels2=nodes[1][inside],
        use=np.ones(count, dtype=bool), code=("",) * count, note=("",) * count,
    )  # fmt: skip


def places_sigma(
    pair: Pair, sizes: Sizes, solve: Callable[[PointObservations], ReliefTable]
) -> FloatArray:
    """Return sigma of places over the wall, X and Y together, within the survey's own frame. [m]"""
    table = solve(_points(*_nodes(pair, sizes, PLACES)))
    count = len(table)
    joint = table.joint_covariance(range(count))
    if joint is None or not count:
        return np.empty(0)
    blocks = joint.reshape(count, 3, count, 3)[:, :2, :, :2]
    finite = np.isfinite(np.einsum("iaia->i", blocks))
    blocks = blocks[finite][:, :, finite]
    blocks = blocks - blocks.mean(axis=0, keepdims=True)
    blocks = blocks - blocks.mean(axis=2, keepdims=True)
    return np.asarray(np.sqrt(np.maximum(np.einsum("iaia->i", blocks), 0.0)))
