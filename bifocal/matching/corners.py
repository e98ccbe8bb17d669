"""A corner as the crossing of its two edges."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from bifocal.matching.tuning import CORNERS
from photocore.arrays import Float32Array, FloatArray


class Edge(NamedTuple):
    """A straight edge: the points p with ``normal . p = offset``.

    Attributes
    ----------
    normal : ndarray, shape (2,)
        Unit vector towards the brighter side.
    offset : float
        [px]
    sigma_offset, sigma_angle : float
        Precision at `centre`, and of the direction. [px, radians]
    centre : ndarray, shape (2,)
        Middle of what was read of it. [px]
    """

    normal: FloatArray
    offset: float
    sigma_offset: float
    sigma_angle: float
    centre: FloatArray

    def sigma_at(self, place: FloatArray) -> float:
        """Return how precisely the edge is known next to a place. [px]"""
        along = float((place - self.centre) @ (-self.normal[1], self.normal[0]))
        return float(np.hypot(self.sigma_offset, along * self.sigma_angle))


def crossing(grey: Float32Array, start: FloatArray) -> tuple[FloatArray, float] | None:
    """Return where two straight edges cross, and how precisely that is known.

    Parameters
    ----------
    grey : ndarray, shape (h, w), float32
        Little smoothed. [grey levels]
    start : ndarray, shape (2,)
        Column and row of the corner, to about 2 px. [px]

    Returns
    -------
    tuple of ndarray, shape (2,), and float, or None
        The crossing and the standard deviation of its worse axis [px]; None where two edges of at
        least `shortest` px do not meet.

    Notes
    -----
    Blur draws the point of a corner into its inside, by 0.2 to 0.7 px at 60 to 90 degrees, and the
    least squares of Förstner and Gülch (1987), which `cv2.cornerSubPix` is made from, go with it.
    Blur leaves straight edges where they are. The scatter of each edge about its line is what the
    precision comes from: worn stone counts as it is.
    """
    from scipy.ndimage import spline_filter

    place, coefficients = start, spline_filter(grey.astype(np.float64))
    for _ in range(3):
        edges = _edges(grey, coefficients, place)
        if edges is None:
            return None
        across = np.linalg.inv([edge.normal for edge in edges])
        place = across @ [edge.offset for edge in edges]
        if np.linalg.norm(place - start) > CORNERS.nearest + 0.5:
            return None
        spread = across * [edge.sigma_at(place) for edge in edges]
    return place, float(np.linalg.norm(spread, 2))


def _edges(
    grey: Float32Array, coefficients: FloatArray, place: FloatArray
) -> tuple[Edge, Edge] | None:
    """Return the two strongest edges that run into a place; None if there are no two."""
    reach = int(CORNERS.farthest) + 1
    column, row = np.round(place).astype(int)
    low = np.maximum([column - reach, row - reach], 0)
    part = grey[low[1] : row + reach + 1, low[0] : column + reach + 1].astype(np.float64)
    if min(part.shape) < reach:
        return None
    down, across = np.gradient(part)
    slope = np.stack([across, down], axis=-1)
    rows, columns = np.mgrid[0 : part.shape[0], 0 : part.shape[1]]
    points = np.stack([columns + low[0], rows + low[1]], axis=-1).astype(np.float64)
    strength = np.linalg.norm(slope, axis=-1)
    away = points - place
    distance = np.linalg.norm(away, axis=-1)
    strong = (distance > CORNERS.nearest) & (distance < CORNERS.farthest)
    if not strong.any():
        return None
    strong &= strength > CORNERS.least_gradient * strength[strong].max()
    # The line through the pixel, along its edge, must run into the corner.
    missed = np.abs((slope * away).sum(axis=-1)) / np.maximum(strength, 1e-9)
    strong &= missed < CORNERS.half_width / 2
    # An edge is told by the side it runs to, and by the side that is brighter.
    side = np.degrees(np.arctan2(away[..., 1], away[..., 0]))[strong]
    first = _strongest(side, strength[strong] ** 2)
    turned = np.abs((side - first + 180) % 360 - 180)
    second_side = (turned > CORNERS.least_angle) & (turned < 180 - CORNERS.least_angle)
    if not second_side.any():
        return None
    second = _strongest(side[second_side], strength[strong][second_side] ** 2)
    between = np.radians(abs((second - first + 180) % 360 - 180))
    # From there on the other edge is far enough from the strip along this one.
    nearest = max(
        CORNERS.nearest,
        float((CORNERS.nearest + CORNERS.half_width * np.cos(between)) / np.sin(between)),
    )
    if nearest > CORNERS.farthest - CORNERS.shortest:
        return None
    lines = [_line(coefficients, place, np.radians(side), nearest) for side in (first, second)]
    if lines[0] is None or lines[1] is None:
        return None
    cosine = abs(float(lines[0].normal @ lines[1].normal))
    return (lines[0], lines[1]) if cosine < np.cos(np.radians(CORNERS.least_angle)) else None


def _strongest(side: FloatArray, weight: FloatArray) -> float:
    """Return the side to which most of the weight lies. [degrees]"""
    counts = np.histogram(side % 360, bins=72, range=(0, 360), weights=weight)[0]
    smooth = cv2.GaussianBlur(np.tile(counts, 3)[None], (0, 0), 2.0)[0, 72:144]
    return float(np.argmax(smooth)) * 5.0 + 2.5


def _line(coefficients: FloatArray, place: FloatArray, side: float, nearest: float) -> Edge | None:
    """Return the edge that runs from a place to a side, by profiles across it; None without one."""
    direction = np.array([np.cos(side), np.sin(side)])
    centre = place + direction * (nearest + CORNERS.farthest) / 2
    across = np.arange(-CORNERS.half_width, CORNERS.half_width + 0.1, 0.25)
    window = np.cos(across / (CORNERS.half_width + 0.25) * np.pi / 2) ** 2
    for _ in range(8):
        normal = np.array([-direction[1], direction[0]])
        reach = float((centre - place) @ direction)
        along = np.arange(nearest, CORNERS.farthest + 0.1) - reach
        places = centre + along[:, None, None] * direction + across[:, None] * normal
        profiles = at_places(coefficients, places.reshape(-1, 2)).reshape(len(along), -1)
        # Each is the mean of all, moved: profile = a + b mean(x - off) to first order.
        mean_profile = profiles.mean(axis=0)
        slope = np.gradient(mean_profile, across)
        weight = slope**2 * window
        middle = float(weight @ across / max(weight.sum(), 1e-9))
        design = np.stack([np.ones_like(across), mean_profile - mean_profile.mean(), slope], axis=1)
        _, likeness, moved = np.linalg.lstsq(design, profiles.T, rcond=None)[0]
        read = likeness > CORNERS.least_likeness
        if read.sum() < CORNERS.shortest:
            return None
        off = middle - np.clip(
            moved[read] / likeness[read], -CORNERS.half_width, CORNERS.half_width
        )
        where = along[read]
        mean = float(where.mean())
        square = float(((where - mean) ** 2).sum())
        tilt = float(((where - mean) * off).sum()) / square
        shift = float(off.mean())
        rest = off - shift - tilt * (where - mean)
        centre = centre + mean * direction + shift * normal
        direction = direction + tilt * normal
        direction /= np.linalg.norm(direction)
    scatter = float(np.sqrt(CORNERS.pixels_per_reading * (rest @ rest) / (len(rest) - 2)))
    normal = np.array([-direction[1], direction[0]])
    return Edge(
        normal=normal,
        offset=float(normal @ centre),
        sigma_offset=scatter / np.sqrt(len(rest)),
        sigma_angle=scatter / np.sqrt(square),
        centre=centre,
    )


def at_places(coefficients: FloatArray, places: FloatArray) -> FloatArray:
    """Return a picture, given by its spline, at places, shape (n, 2).

    Not by cv2.remap: it rounds places to 1/32 px.
    """
    from scipy.ndimage import map_coordinates

    values = map_coordinates(coefficients, places.T[::-1], order=3, mode="nearest", prefilter=False)
    return np.asarray(values)
