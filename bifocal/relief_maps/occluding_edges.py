"""The outer rims of raised parts, drawn in to the edge that photo 1 shows.

Camera 2 sees nothing of the wall right behind a rim, so nothing there can be matched: flow goes on
with the raised part, which comes out too fat, by 1 to 5 px in the median and in waves (façade 71,
loggia 301), and its shadow with it. What is measured ends 2 to 3 px before the true rim. Between
the two photo 1 shows the rim as an edge, and that runs straight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps.forward_projection import MapBands, shown_by_first
from bifocal.relief_maps.frame import Frame
from photocore.arrays import BoolArray, ByteArray, Float32Array, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class RimTuning:
    """Rims drawn in to edges of photo 1."""

    #: How far inwards of the map's rim the true one is sought. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / -0.01, plaster facade -0.00 / +0.00,
    #: church -0.01 / -0.00.
    reach: int = 16
    #: Steps that hide less from camera 1 are left alone. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.02 / -0.01, plaster facade +0.00 / +0.00,
    #: church +0.00 / -0.01.
    least_shadow: float = 1.0
    #: Relief within this share of the step from that of the rim is the raised part's.
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.00 / +0.00, plaster facade +0.00 / +0.00,
    #: church -0.01 / +0.01.
    same: float = 0.35
    #: Directions that the edge may have, from that of the map's step. [deg]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.01 / +0.01, plaster facade -0.00 / -0.00,
    #: church -0.04 / +0.03.
    turns: tuple[float, float, float] = (-16.0, 0.0, 16.0)
    #: Weaker edges are texture. [grey levels]
    #: Evidence: façade 71, steps wrong beyond 3 cm, recall and precision of hidden pixels: without
    #: 1.225 %, 0.605 and 0.827; with 2, 1.267 %, 0.665 and 0.916; 6, 1.249 %, 0.664 and 0.911; 10,
    #: 1.240 %, 0.661 and 0.905; 15, 1.232 %, 0.654 and 0.894.
    least_edge: float = 10.0
    #: A rim cannot stand farther in than what camera 2 cannot see is wide, but for so much. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.00 / +0.01, plaster facade +0.00 / +0.00,
    #: church -0.02 / +0.02.
    doubt: float = 1.0
    #: A pixel is lowered from here on beyond the edge. [px]
    #: Evidence: façade 71: 0.25 px take 0.05 px out of the waves of the mask and put 0.007 % more
    #: of the map and the orthophoto on the wrong surface.
    beyond: float = 0.5
    #: Standard deviation of the blur in which the direction of a step is read. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.01 / -0.00, plaster facade +0.00 / -0.00,
    #: church +0.01 / +0.01.
    blur: float = 1.25
    #: Pixels of the map that are one there. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / -0.01, plaster facade -0.00 / -0.00,
    #: church +0.01 / +0.04.
    coarser: int = 4


RIMS = RimTuning()
#: The edge is averaged along the step, at places so far from its middle. [px]
ALONG = np.arange(-12, 13, 3, dtype=np.float32)


class _Rims(NamedTuple):
    """Pixels of the map from which relief falls outwards and on which nothing is measured."""

    column: IntArray
    row: IntArray
    u: Float32Array  # outwards from the nadir, along columns and rows
    v: Float32Array
    own: Float32Array  # relief [m]
    behind: Float32Array  # relief that it falls to [m]
    reach: Float32Array  # how far inwards the true rim may stand [px]

    def places(self, inwards: float) -> tuple[IntArray, IntArray]:
        """Return row and column of the pixels so far inwards."""
        row = np.rint(self.row - np.float32(inwards) * self.v).astype(np.intp)
        return row, np.rint(self.column - np.float32(inwards) * self.u).astype(np.intp)

    def only(self, where: BoolArray | IntArray) -> _Rims:
        """Return some of them."""
        kept: list[Any] = [values[where] for values in self]
        return _Rims(*kept)


def drawn_in(frame: Frame, bands: MapBands, grid: Grid) -> MapBands:
    """Give what lies outside the edges that photo 1 shows the relief behind them (in place).

    Parameters
    ----------
    frame : Frame
    bands : MapBands
        Map, its strips filled; measured pixels stay as they are.
    grid : Grid
        Of the map.
    """
    rims = _falling(frame, bands, grid)
    rims, raised = _measured_inwards(bands, rims)
    across, down = _directions(bands.r, rims)
    clear = across * rims.u + down * rims.v > 0  # others cast no shadow
    if clear.any():
        rims, normal = rims.only(clear), (across[clear], down[clear])
        _lower(bands, rims, _edges(frame, grid, rims, raised[clear], normal), normal)
    return bands


def _falling(frame: Frame, bands: MapBands, grid: Grid) -> _Rims:
    """Return the rims of the map; how far the true ones may be follows from camera 2."""
    distance, nadir = np.float32(frame.foot(1).distance), grid.pixel_of(frame.foot(1).nadir)
    relief = np.where(np.isfinite(bands.r), bands.r, np.float32(1e3))
    fall = relief - cv2.erode(relief, np.ones((5, 5), np.uint8))
    farthest = np.hypot(*np.maximum(np.abs(nadir), np.abs(nadir - grid.shape[::-1])))
    least = RIMS.least_shadow * (float(distance) - float(np.nanmax(bands.r))) / float(farthest)
    high = (fall > np.float32(least)) & (bands.quality != Quality.MEASURED) & (relief < 1e3)
    margin = RIMS.reach + 2
    row, column = np.nonzero(high[margin:-margin, margin:-margin])
    row, column = row + margin, column + margin
    x, y = (column - nadir[0]).astype(np.float32), (row - nadir[1]).astype(np.float32)
    rho = np.maximum(np.sqrt(x * x + y * y), np.float32(1))
    top = relief[row, column]
    rims = _Rims(column, row, x / rho, y / rho, top, top, rho)
    behind = np.fmin.reduce([relief[rims.places(-step)] for step in (2.0, 3.0, 4.0)])
    fall = top - behind
    falls = fall * rho > np.float32(RIMS.least_shadow) * (distance - top)
    falls &= top - relief[rims.places(-1.0)] > np.float32(0.5) * fall
    # What camera 2 cannot see, by Eq. (1); 1e-6 keeps a camera that touches the relief finite.
    unseen = fall * rho / np.maximum(np.float32(frame.foot(2).distance) - behind, np.float32(1e-6))
    reach = np.minimum(unseen + np.float32(RIMS.doubt), np.float32(RIMS.reach))
    return rims._replace(behind=behind, reach=reach).only(falls)


def _measured_inwards(bands: MapBands, rims: _Rims) -> tuple[_Rims, Float32Array]:
    """Return the rims with measured relief inwards of them that is theirs, and that relief."""
    raised, nearest = rims.own.copy(), np.zeros(len(rims.row), np.float32)
    open_rows, part, fall = np.arange(len(rims.row)), rims, rims.own - rims.behind
    for step in range(1, RIMS.reach + 1):
        places = part.places(step)
        relief = bands.r[places]
        measured = bands.quality[places] == Quality.MEASURED
        measured &= np.abs(relief - part.own) < RIMS.same * fall
        raised[open_rows[measured]], nearest[open_rows[measured]] = relief[measured], step
        search = ~measured & (relief > part.behind + RIMS.same * fall)
        open_rows, part, fall = open_rows[search], part.only(search), fall[search]
    rims = rims._replace(reach=np.minimum(rims.reach, nearest))
    return rims.only(nearest > 0), raised[nearest > 0]


def _directions(relief: Float32Array, rims: _Rims) -> tuple[Float32Array, Float32Array]:
    """Return the unit vectors along columns and rows in which relief falls most at the rims."""
    small = np.nan_to_num(relief[:: RIMS.coarser, :: RIMS.coarser])
    small = cv2.GaussianBlur(small, (0, 0), RIMS.blur)
    row = (rims.row // RIMS.coarser).clip(0, small.shape[0] - 1)
    column = (rims.column // RIMS.coarser).clip(0, small.shape[1] - 1)
    across = -cv2.Sobel(small, cv2.CV_32F, 1, 0, ksize=3)[row, column]
    down = -cv2.Sobel(small, cv2.CV_32F, 0, 1, ksize=3)[row, column]
    length = np.sqrt(across * across + down * down) + np.float32(1e-9)
    return across / length, down / length


def _edges(
    frame: Frame,
    grid: Grid,
    rims: _Rims,
    raised: Float32Array,
    normal: tuple[Float32Array, Float32Array],
) -> Float32Array:
    """Return how far inwards of the map's rims photo 1 shows the strongest edge, 0 for none. [px]

    Candidates lie a pixel apart along the radius, from one outside the map's rim on; those of all
    rims are kept in one line, those of a rim side by side.
    """
    count = np.floor(rims.reach).astype(np.int64) + 2
    first = np.cumsum(count) - count
    rim = np.repeat(np.arange(len(count)), count)
    inwards = (np.arange(len(rim)) - first[rim] - 1).astype(np.float32)
    x, y = _seen(frame, grid, rims.column, rims.row, raised)
    x1, y1 = _seen(frame, grid, rims.column - rims.u, rims.row - rims.v, raised)
    at = x[rim] + (x1 - x)[rim] * inwards, y[rim] + (y1 - y)[rim] * inwards
    strength = _strength(frame.image1, at, (normal[0][rim], normal[1][rim]))
    most = np.maximum.reduceat(strength, first)
    best = np.flatnonzero(strength >= most[rim])[::-1]
    chosen = np.zeros(len(count), np.int64)
    chosen[rim[best]] = best  # the outermost of several
    before = strength[np.maximum(chosen - 1, 0)]
    after = strength[np.minimum(chosen + 1, len(rim) - 1)]
    bend = np.maximum(2 * most - before - after, np.float32(1e-6))
    edge = inwards[chosen] + np.clip(0.5 * (after - before) / bend, -0.5, 0.5)
    return np.where(most > RIMS.least_edge, edge, np.float32(0)).astype(np.float32)


def _seen(
    frame: Frame, grid: Grid, column: Any, row: Any, relief: Float32Array
) -> tuple[Float32Array, Float32Array]:
    """Return where photo 1 shows pixels of the map with given relief. [px]"""
    nadir, ratio = grid.pixel_of(frame.foot(1).nadir), grid.gsd / frame.grid.gsd
    away = np.stack([column - nadir[0], row - nadir[1]], axis=-1) * ratio
    shown = shown_by_first(frame, away.astype(np.float32), relief)
    return shown[..., 0], shown[..., 1]


def _strength(
    image: ByteArray,
    at: tuple[Float32Array, Float32Array],
    normal: tuple[Float32Array, Float32Array],
) -> Float32Array:
    """Return the slope of an image across lines through places, averaged along them.

    [grey levels a pixel]
    """
    height, width = image.shape
    slopes = [cv2.Sobel(image, cv2.CV_16S, *axis, ksize=3).ravel() for axis in ((1, 0), (0, 1))]
    best = np.zeros(len(at[0]), np.float32)
    for turn in np.radians(RIMS.turns):
        cosine, sine = np.float32(np.cos(turn)), np.float32(np.sin(turn))
        u, v = normal[0] * cosine - normal[1] * sine, normal[0] * sine + normal[1] * cosine
        across, down = np.zeros((2, len(u)), np.int32)
        for along in ALONG:
            column = np.clip(at[0] - v * along + np.float32(0.5), 0, width - 1).astype(np.int32)
            row = np.clip(at[1] + u * along + np.float32(0.5), 0, height - 1).astype(np.int32)
            place = row * np.int32(width) + column
            across += slopes[0][place]
            down += slopes[1][place]
        best = np.maximum(best, np.abs(across * u + down * v))
    return best / np.float32(8 * len(ALONG))


def _lower(
    bands: MapBands,
    rims: _Rims,
    edge: Float32Array,
    normal: tuple[Float32Array, Float32Array],
) -> None:
    """Give unmeasured pixels between the edges and the map's rims the relief behind (in place)."""
    lowest = np.full(bands.r.shape, np.inf, np.float32)
    x, y = rims.column - edge * rims.u, rims.row - edge * rims.v
    for step in range(2 * RIMS.reach):
        some = np.flatnonzero(edge > 0.5 * step - 0.5)
        part = rims.only(some)
        row, column = part.places(0.5 * step)
        beyond = (column - x[some]) * normal[0][some] + (row - y[some]) * normal[1][
            some
        ] > RIMS.beyond
        np.minimum.at(lowest, (row[beyond], column[beyond]), part.behind[beyond])
    lowered = np.isfinite(lowest) & (bands.quality != Quality.MEASURED)
    bands.r[lowered] = lowest[lowered]
    bands.quality[lowered] = Quality.HIDDEN
