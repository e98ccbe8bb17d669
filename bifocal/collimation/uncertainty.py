"""Where on the wall relief is precise: contour lines of its sigma, and the area of uncertainty."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from bifocal.collimation.live_results import LiveResults
from bifocal.collimation.pictures import Pictures
from bifocal.survey.observations import PointObservations
from bifocal.survey.tolerances import RULES, SCALES
from photocore.arrays import BoolArray, FloatArray

#: Longer sides of the computed grid and of the picture. [px]
COMPUTED, SHOWN = 256, 1024
#: Longer side of the grid on which it is said in a line how good relief is.
COARSE = 40
#: Longer side of the grid of places whose common precision is told.
FEW = 12
PRINT = next(rule for rule in RULES if rule.key == "print-0.25")
#: Contour lines of sigma of r. [mm]
LEVELS = (1, 2, 5, 10, 20, 50, 100, 200, 500)
_SHADE = (60, 60, 220, 110)  # BGRA
#: Shorter lines are specks. [points of the computed grid]
_SHORTEST = 6


def relief_sigma(pictures: Pictures, results: LiveResults, computed: int = COMPUTED) -> FloatArray:
    """Return sigma of the relief of points on the wall, shape (h, w), over the wall's grid. [m]

    NaN where not both photos show the wall.
    """
    pair = pictures.needed_pair()
    (height, width), projected, inside = _common(pictures, computed)
    sigma = np.full(len(inside), np.nan)
    if inside.any():
        solved = pair.intersect(
            projected[0][inside], projected[1][inside], sigma_px=results.sigma_px
        )
        sigma[inside] = solved.sigma[:, 2]
    return sigma.reshape(height, width)


def _common(pictures: Pictures, longer: int) -> tuple[tuple[int, int], list[FloatArray], BoolArray]:
    """Return a grid over the wall of so many nodes along its longer side.

    Its height and width, the pixels of its nodes in both photos, and which nodes both show.
    """
    pair, grid = pictures.needed_pair(), pictures.grid
    assert grid is not None
    step = max(grid.width, grid.height) / longer
    width, height = (max(2, round(side / step)) for side in (grid.width, grid.height))
    xmin, ymin, xmax, ymax = grid.bounds
    x = xmin + (np.arange(width) + 0.5) * (xmax - xmin) / width
    y = ymax - (np.arange(height) + 0.5) * (ymax - ymin) / height
    plane = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    projected = [pair.photo(number).pixels_from_plane(plane) for number in (1, 2)]
    inside = np.ones(len(plane), dtype=bool)
    for pixels, info in zip(projected, pictures.infos, strict=True):
        inside &= (pixels > -0.5).all(axis=1) & (pixels < np.array(info.size) - 0.5).all(axis=1)
    return (height, width), projected, inside


def places_sigma(pictures: Pictures, results: LiveResults) -> FloatArray:
    """Return sigma of places on the wall, X and Y together, within the survey's own frame. [m]

    Where the frame as a whole lies is in no drawing: what moves all places alike is taken out.
    """
    _, projected, inside = _common(pictures, FEW)
    first, second = (pixels[inside] for pixels in projected)
    count = len(first)
    _, joint = results.joint_of(
        PointObservations(
            ids=tuple(map(str, range(count))), pixels1=first, pixels2=second,
            use=np.ones(count, dtype=bool), code=("",) * count, note=("",) * count,
        )
    )  # fmt: skip
    blocks = joint.reshape(count, 3, count, 3)[:, :2, :, :2]
    blocks = blocks - blocks.mean(axis=0, keepdims=True)
    blocks = blocks - blocks.mean(axis=2, keepdims=True)
    variances = np.einsum("iaia->i", blocks)
    known = variances[np.isfinite(variances)]
    return np.sqrt(np.maximum(known, 0.0))


def how_good(pictures: Pictures, results: LiveResults) -> dict[str, Any] | None:
    """Return how good relief and places are, and the finest drawing scale that holds.

    ``middle`` and ``rim``: the median sigma of relief over the middle ninth of what both photos
    show of the wall, and over the rest [m]. ``place``: within it nine tenths of all places on the
    wall are known [m]; a ``scale`` holds where that is the tolerance of a print. None where the
    photos show nothing together.
    """
    sigma = relief_sigma(pictures, results, COARSE)
    rows, columns = np.nonzero(np.isfinite(sigma))
    if not len(rows):
        return None
    values = sigma[rows, columns]
    middle = np.ones(len(rows), dtype=bool)
    for indices in (rows, columns):
        low, high = np.percentile(indices, [33, 67])
        middle &= (indices >= low) & (indices <= high)
    places = places_sigma(pictures, results)
    place = float(np.percentile(places, 90)) if len(places) else None
    holds = [] if place is None else [n for n in SCALES if place <= (PRINT.tolerance(n) or 0.0)]
    return {
        "middle": float(np.median(values[middle])) if middle.any() else None,
        "rim": float(np.median(values[~middle])) if not middle.all() else None,
        "place": place,
        "scale": holds[0] if holds else None,
    }


def uncertainty_picture(pictures: Pictures, results: LiveResults) -> bytes:
    """Return the shaded area of uncertainty over the wall, PNG."""
    sigma = relief_sigma(pictures, results)
    limit = results.limits.relief_limit(pictures.needed_pair().d2)
    height, width = sigma.shape
    factor = SHOWN / max(height, width)
    size = (round(width * factor), round(height * factor))
    finite = np.isfinite(sigma)
    filled = np.where(finite, sigma, np.nanmax(sigma) if finite.any() else 1.0)
    smooth = cv2.resize(np.log(filled), size, interpolation=cv2.INTER_CUBIC)
    shown = cv2.resize(finite.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    picture = np.zeros((size[1], size[0], 4), np.uint8)
    picture[(smooth > np.log(limit)) & shown] = _SHADE
    return cv2.imencode(".png", picture)[1].tobytes()


def precision_contours(pictures: Pictures, results: LiveResults) -> list[dict[str, Any]]:
    """Return lines of equal sigma of r: ``sigma_mm`` and ``line``, pixels of the wall, (n, 2)."""
    from contourpy import contour_generator

    sigma, grid = relief_sigma(pictures, results), pictures.grid
    assert grid is not None
    step = np.array([grid.width, grid.height]) / sigma.shape[::-1]
    contours = contour_generator(z=np.ma.masked_invalid(np.log(sigma)))
    return [
        {"sigma_mm": level, "line": ((np.asarray(line) + 0.5) * step - 0.5).round(1).tolist()}
        for level in LEVELS
        for line in contours.lines(np.log(level / 1000))
        if len(line) >= _SHORTEST
    ]
