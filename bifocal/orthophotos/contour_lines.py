"""Contour lines of a relief: smoothed at its precision, without noise and scraps, labelled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.surface import Surface
from bifocal.orthophotos.canvas import text_width
from bifocal.orthophotos.drawing import Contour, multiples, signed
from bifocal.orthophotos.tuning import CONTOURS
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.errors import InputError
from photocore.shrinkage import shrink_noise


class ContourLabel(NamedTuple):
    """A level written on its line: middle of the base line [m], and its angle [deg]."""

    place: tuple[float, float]
    angle: float
    words: str


def contours(
    surface: Surface, grid: Grid, *, interval: float, scale: float,
    sigma: Surface | None = None, guessed: BoolArray | None = None,
) -> tuple[Contour, ...]:  # fmt: skip
    """Return contour lines of a relief.

    Parameters
    ----------
    surface : Surface
    grid : Grid
        Where.
    interval : float
        Between levels. [m]
    scale : float
        1:scale, which says what can be drawn.
    sigma : Surface, optional
        Standard deviation of the relief; None: it is exact. [m]
    guessed : ndarray of bool, optional
        Of `contour_grid`'s shape: relief not worth a line.

    Notes
    -----
    The relief is smoothed where it varies no more than sigma explains (`shrink_noise`). A line is
    kept where the relief beside it differs from side to side: on a flat wall the contour of the
    wall's own level wanders through noise, and is left out.
    """
    from contourpy import contour_generator

    coarse = contour_grid(grid, scale)
    relief = surface.window(coarse)
    if guessed is not None:
        relief = np.where(guessed, np.float32(np.nan), relief)
    if min(relief.shape) < 2 or not np.isfinite(relief).any():
        return ()
    spread = np.zeros_like(relief) if sigma is None else np.nan_to_num(sigma.window(coarse))
    if sigma is not None:
        relief = shrink_noise(relief, spread, CONTOURS.windows)
    low, high = float(np.nanmin(relief)), float(np.nanmax(relief))
    if (high - low) / interval > CONTOURS.most_levels:
        raise InputError(
            f"contours every {interval:g} m make {(high - low) / interval:.0f} levels; choose a "
            "larger interval."
        )
    paper = scale / 1000.0  # metres on the wall per millimetre on paper
    generator = contour_generator(z=np.ma.masked_invalid(relief), name="serial")
    least = np.maximum(CONTOURS.clear * spread, np.float32(CONTOURS.slope * interval))
    lines = []
    for level in multiples(low, high, interval).tolist():
        index = round(level / interval) % CONTOURS.each == 0
        for line in generator.lines(level):
            even = _evenly(np.asarray(line), paper / coarse.gsd)
            for part in _clear_parts(even, relief, least, paper / coarse.gsd):
                place = [coarse.x0, coarse.y0] + part * [coarse.gsd, -coarse.gsd]
                lines.append(Contour(level=level, line=place, index=index))
    return tuple(lines)


def contour_grid(grid: Grid, scale: float) -> Grid:
    """Return the grid contour lines are drawn from: the finest detail worth drawing."""
    largest = max(grid.shape) * grid.gsd / CONTOURS.largest
    return Grid.from_bounds(grid.bounds, gsd=max(grid.gsd, CONTOURS.detail / 1000 * scale, largest))


def contour_labels(lines: Sequence[Contour], scale: float) -> list[ContourLabel]:
    """Return the labels of the thick lines, each where its line is straightest."""
    paper = scale / 1000.0
    labels: list[ContourLabel] = []
    labelled, levels = np.empty((0, 2)), np.empty(0)
    thick = [line for line in lines if line.index]
    digits = _digits([line.level for line in thick])
    for contour in sorted(thick, key=lambda one: -len(one.line)):
        line = contour.line / paper
        along = _lengths(line)
        words = signed(contour.level, digits)
        need = text_width(words, CONTOURS.label_size) + 1.0
        if along[-1] < max(CONTOURS.room, 2 * need):
            continue
        count = max(1, round(along[-1] / CONTOURS.between))
        for number in range(count):
            ends = along[-1] * np.array([number, number + 1]) / count
            middle, angle = _straightest(
                line, along, (ends[0] + need / 2, ends[1] - need / 2), need
            )
            gaps = np.hypot(*(labelled - middle).T)
            alike = (levels == contour.level) & (gaps < CONTOURS.neighbour)
            if (gaps < need + 1.0).any() or (along[-1] < CONTOURS.short and alike.any()):
                continue
            labelled, levels = np.vstack([labelled, middle]), np.append(levels, contour.level)
            # On the line, not above it: down by half the height of a digit.
            turn = math.radians(angle)
            base = middle + 0.36 * CONTOURS.label_size * np.array([math.sin(turn), -math.cos(turn)])
            place = float(base[0] * paper), float(base[1] * paper)
            labels.append(ContourLabel(place, angle, words))
    return labels


def _digits(levels: Sequence[float]) -> int:
    """Return how many decimals show all levels as they are: two, or up to four."""
    return next((n for n in (2, 3) if all(abs(round(v, n) - v) < 1e-6 for v in levels)), 4)


def _straightest(
    line: FloatArray, along: FloatArray, window: tuple[float, float], need: float
) -> tuple[FloatArray, float]:
    """Return the place whose surroundings are nearest to a chord, and that chord's direction."""
    start = np.arange(window[0], max(window[1], window[0]) + 1e-9, 2.0)

    def at(places: FloatArray) -> FloatArray:
        return np.stack([np.interp(places, along, line[:, k]) for k in (0, 1)], axis=-1)

    chords = at(start + need / 2) - at(start - need / 2)
    best = int(np.argmax(np.hypot(*chords.T)))
    across, up = chords[best]
    angle = math.degrees(math.atan2(up, across))
    if not -90 < angle <= 90:
        angle += 180 if angle <= -90 else -180
    return at(start[best : best + 1])[0], angle


def _lengths(line: FloatArray) -> FloatArray:
    """Return the distance of every point of a line along it."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def _evenly(line: FloatArray, factor: float) -> FloatArray:
    """Return a line with points at equal distances; factor: pixels per millimetre on paper."""
    along = _lengths(line)
    count = max(2, math.ceil(along[-1] / (CONTOURS.spacing * factor)) + 1)
    places = np.linspace(0, along[-1], count)
    return np.stack([np.interp(places, along, line[:, k]) for k in (0, 1)], axis=-1)


def _clear_parts(
    line: FloatArray, relief: Float32Array, least: Float32Array, factor: float
) -> list[FloatArray]:
    """Return the parts of a line, in pixels, that are long enough and between unequal sides."""
    shortest = round(CONTOURS.shortest / CONTOURS.spacing)
    if len(line) <= shortest:
        return []
    direction = np.gradient(line, axis=0)
    direction /= np.maximum(np.hypot(*direction.T), 1e-9)[:, None]
    normal = factor * np.stack([-direction[:, 1], direction[:, 0]], axis=-1)
    level, needed = _looked_up(relief, line), np.nan_to_num(_looked_up(least, line))
    clear = np.ones(len(line), bool)
    for aside, stretch in ((CONTOURS.aside, CONTOURS.stretch), (CONTOURS.near, 4 * CONTOURS.near)):
        left, right = (_looked_up(relief, line + way * aside * normal) for way in (1, -1))
        clear &= _rises(left, right, level, needed * aside / CONTOURS.aside, stretch)
    bounds = [0, *(np.flatnonzero(np.diff(clear)) + 1).tolist(), len(clear)]
    return [line[a:b] for a, b in pairwise(bounds) if clear[a] and b - a > shortest]


def _rises(
    left: Float32Array, right: Float32Array, level: Float32Array, target: Float32Array,
    stretch: float,
) -> BoolArray:  # fmt: skip
    """Return where the relief beside a line differs from side to side by more than is wanted."""
    side = max(3, round(stretch / CONTOURS.spacing))
    padded = (side // 2, side - 1 - side // 2)

    def averaged(rise: Float32Array, instead: Float32Array) -> FloatArray:
        """Return the mean rise along the line; beside unknown relief the other side's."""
        whole = np.nan_to_num(np.where(np.isnan(rise), instead, rise))
        kernel = np.ones(side) / side
        return np.convolve(np.pad(whole, padded, mode="edge"), kernel, "valid")

    up, down = averaged(left - level, level - right), averaged(level - right, left - level)
    way = np.sign(up + down)
    # A line at the foot of a step follows what the flat wall does at its own level.
    either = np.minimum(up * way, down * way) > CONTOURS.either * target
    return np.asarray((np.abs(up + down) > target) & either)


def _looked_up(field: Float32Array, places: FloatArray) -> Float32Array:
    """Return a field at (column, row) places, shape (n,); NaN outside and beside unknown pixels."""
    x, y = (np.ascontiguousarray(places[None, :, k], np.float32) for k in (0, 1))
    # Rows of more than 32 767 places are too long for OpenCV.
    parts = [
        cv2.remap(
            field, x[:, k : k + 30000], y[:, k : k + 30000], cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT, borderValue=float("nan"),
        )[0]
        for k in range(0, len(places), 30000)
    ]  # fmt: skip
    return np.asarray(np.concatenate(parts), np.float32)
