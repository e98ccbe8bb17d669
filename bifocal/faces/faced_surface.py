"""Relief that obeys faces, break lines and occluders, on whatever grid it is asked for."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import cv2
import numpy as np

from bifocal.faces.face_planes import placed
from bifocal.faces.faces import BreakLine, Faces, Occluder, inside
from bifocal.faces.tuning import EDGES
from bifocal.model import (
    Bounds,
    Grid,
    MapSurface,
    Quality,
    ReliefMap,
    Surface,
    bounds_of,
    measured_on,
)
from bifocal.rays import Foot
from photocore.arrays import BoolArray, Float32Array, FloatArray, IntArray

_Map = TypeVar("_Map", bound=ReliefMap)


class FacedSurface:
    """A surface on which faces are planes with straight edges, and occluders have no relief.

    Beside an edge relief is that of its side: what within some pixels of the map has that of the
    other side, or of the ramp between, gets what lies farther out. All else is as it was.

    Parameters
    ----------
    surface : Surface
        Relief as it is known.
    faces : Faces
    measured : Surface, optional
        What of it was measured: planes that are not given are found there.

    Attributes
    ----------
    placed : tuple of PlacedFace
        The faces that have a plane.
    unplaced : tuple of str
        Names of those without: no relief is known within.
    """

    def __init__(self, surface: Surface, faces: Faces, measured: Surface | None = None) -> None:
        self.surface, self.faces = surface, faces
        pairs = [(face, placed(face, surface, measured)) for face in faces.faces]
        self.placed = tuple(one for _, one in pairs if one is not None)
        self.unplaced = tuple(face.name or "?" for face, one in pairs if one is None)
        surface_grid = getattr(surface, "grid", None)
        self.reach = 0.0 if surface_grid is None else EDGES.reach * surface_grid.gsd
        self._shapes = [
            *(ring for one in self.placed for ring in one.face.rings),
            *(edge.line[:, :2] for edge in faces.breaks),
            *(ring for one in faces.occluders for ring in one.rings),
        ]

    def window(self, grid: Grid) -> Float32Array:
        """Return relief at the pixel centres of a grid; NaN where unknown or occluded. [m]"""
        margin = math.ceil(3 * self.reach / grid.gsd) + 2
        wide = grid.window(-margin, -margin, grid.width + 2 * margin, grid.height + 2 * margin)
        if not any(_touch(bounds_of(shape), wide.bounds) for shape in self._shapes):
            return self.surface.window(grid)
        relief = np.array(self.surface.window(wide), np.float32)
        reach = self.reach / grid.gsd
        if reach >= 1:
            for edge in self.faces.breaks:
                _break(relief, wide, edge, reach)
        label, plane = self._planes(wide)
        if reach >= 1:
            _without_ramps(relief, label, plane, reach, self.reach / EDGES.reach)
        np.copyto(relief, plane, where=label > 0)
        relief[self.occluded(wide)] = np.nan
        core = np.s_[margin : margin + grid.height, margin : margin + grid.width]
        return np.ascontiguousarray(relief[core])

    def measured(self, grid: Grid) -> BoolArray | None:
        """Return which pixels of a grid both photos measured, faces aside."""
        return measured_on(self.surface, grid)

    def extremes(self, bounds: Bounds) -> tuple[float, float]:
        """Return the extremes over a box of the surface and of the faces that touch it."""
        values = [v for v in self.surface.extremes(bounds) if not math.isnan(v)]
        for one in self.placed:
            corners = np.concatenate(one.face.rings)
            if _touch(bounds_of(corners), bounds):
                r = one.plane[0] + corners @ one.plane[1:]
                values += [float(r.min()), float(r.max())]
        return (min(values), max(values)) if values else (math.nan, math.nan)

    def occluded(self, grid: Grid) -> BoolArray:
        """Return the pixels of a grid that occluders cover in photo 1."""
        mask = np.zeros(grid.shape, bool)
        for one in self.faces.occluders:
            mask |= inside(one.rings, grid)
        return mask

    def occluded_in(self, grid: Grid, foot: Foot, first: Foot) -> BoolArray:
        """Return the pixels that occluders of known relief cover in another photo than photo 1.

        A point of an occluder is seen by photo 1 before the wall at P, by the other at P':
        both lie on its rays, N + (Q - N) (d - r) / (d - h) with the occluder's relief h, the wall's
        r, and Q where the occluder stands.
        """
        mask = np.zeros(grid.shape, bool)
        for one in self.faces.occluders:
            if one.relief is None:
                continue
            wall = self._wall_around(one)
            share = (first.distance - one.relief) / (first.distance - wall)
            back = (foot.distance - wall) / (foot.distance - one.relief)
            rings = tuple(
                foot.nadir + (first.nadir + (ring - first.nadir) * share - foot.nadir) * back
                for ring in one.rings
            )
            mask |= inside(rings, grid)
        return mask

    def _wall_around(self, one: Occluder) -> float:
        """Return the relief of the wall around an occluder, 0 where none is known. [m]"""
        left, bottom, right, top = bounds_of(np.concatenate(one.rings))
        x, y = (right - left) / 4, (top - bottom) / 4
        step = max(right - left, top - bottom) / EDGES.places
        around = Grid.from_bounds((left - x, bottom - y, right + x, top + y), gsd=step)
        relief = self.surface.window(around)[~inside(one.rings, around)]
        finite = relief[np.isfinite(relief)]
        return float(np.median(finite)) if finite.size else 0.0

    def labels(self, grid: Grid) -> IntArray:
        """Return which face of `placed` a grid's pixels lie on, counted from 1; 0 for none."""
        label = np.zeros(grid.shape, np.int64)
        for number, one in enumerate(self.placed, start=1):
            if _touch(bounds_of(np.concatenate(one.face.rings)), grid.bounds):
                label[inside(one.face.rings, grid)] = number
        return label

    def _planes(self, grid: Grid) -> tuple[IntArray, Float32Array]:
        """Return the faces of a grid's pixels, and their relief. [m]"""
        label = self.labels(grid)
        plane = np.full(grid.shape, np.nan, np.float32)
        for number in np.unique(label[label > 0]).tolist():
            mask = label == number
            plane[mask] = self.placed[number - 1].relief(grid)[mask]
        return label, plane


def beneath(surface: Surface) -> Surface:
    """Return the surface that faces were drawn on, or the surface itself."""
    return surface.surface if isinstance(surface, FacedSurface) else surface


def faced(relief: _Map, faces: Faces | None) -> tuple[_Map, FacedSurface | None]:
    """Return a relief map that obeys faces, `Quality.DRAWN` on them, and the surface that does.

    Where no face is near nothing changes. Sigma of a face is that of its plane.
    """
    if not faces:
        return relief, None
    grid = relief.grid
    map_surface = MapSurface.of_array(relief.r, grid)
    measured: Surface | None = None
    if (relief.quality == Quality.MEASURED).any():
        only = np.where(relief.quality == Quality.MEASURED, relief.r, np.float32(np.nan))
        measured = MapSurface.of_array(only, grid)
    surface = FacedSurface(map_surface, faces, measured)
    r, sigma, quality = np.array(relief.r), np.array(relief.sigma), np.array(relief.quality)
    for column, row, part in grid.tiles(EDGES.tile):
        cut = np.s_[row : row + part.height, column : column + part.width]
        before, label = relief.r[cut], surface.labels(part)
        r[cut] = after = surface.window(part)
        changed = (after != before) & ~(np.isnan(after) & np.isnan(before))
        quality[cut][changed] = Quality.INTERPOLATED
        for number in np.unique(label[label > 0]).tolist():
            mask, one = label == number, surface.placed[number - 1]
            noise = _noise(relief.sigma[cut][mask]) if one.by_relief else 0.0
            sigma[cut][mask] = np.hypot(one.sigma(part)[mask], np.float32(noise))
            quality[cut][mask] = Quality.DRAWN
        unknown = np.isnan(after)
        sigma[cut][unknown], quality[cut][unknown] = np.nan, Quality.UNKNOWN
    return replace(relief, r=r, sigma=sigma, quality=quality), surface


def _noise(sigma: Float32Array) -> float:
    """Return what the best of the pixels within a face are known to, orientation included."""
    finite = sigma[np.isfinite(sigma)]
    return float(np.quantile(finite, EDGES.best)) if finite.size else 0.0


def _touch(first: Bounds, second: Bounds) -> bool:
    return (
        first[0] <= second[2]
        and first[2] >= second[0]
        and first[1] <= second[3]
        and first[3] >= second[1]
    )


def _nearest(values: Float32Array, clean: BoolArray) -> tuple[Float32Array, Float32Array]:
    """Return the value of the nearest clean pixel of every pixel, and how far that is. [px]"""
    if not clean.any():
        return np.full_like(values, np.nan), np.full(values.shape, np.inf, np.float32)
    away, label = cv2.distanceTransformWithLabels(
        (~clean).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    table = np.zeros(int(label.max()) + 1, np.float32)
    table[label[clean]] = values[clean]
    return table[label], away


def _of_other_side(
    relief: Float32Array, own: Float32Array, other: Float32Array, least: float
) -> BoolArray:
    """Return the pixels whose relief leads from that of their own side to the other's."""
    step = other - own
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(step) > least) & ((relief - own) * step > EDGES.mixed * step**2))


def _without_ramps(
    relief: Float32Array, label: IntArray, plane: Float32Array, reach: float, least: float
) -> None:
    """Give pixels around faces that have a face's relief, or a ramp to it, that farther out."""
    face = label > 0
    if not face.any():
        return
    beside, away = _nearest(plane, face)
    outside = ~face & np.isfinite(relief)
    nearest, distance = _nearest(relief, outside & (away > reach))
    band = outside & (away <= reach) & (distance <= 2 * reach + 2)
    ramp = band & _of_other_side(relief, nearest, beside, least)
    relief[ramp] = nearest[ramp]


def _break(relief: Float32Array, grid: Grid, edge: BreakLine, reach: float) -> None:
    """Keep the two sides of a break line apart, in place."""
    away, side, level = _beside(edge.line, grid, 3 * reach)
    least = grid.gsd * reach / EDGES.reach
    finite = np.isfinite(relief)
    near = {s: _nearest(relief, (side == s) & (away > reach) & finite)[0] for s in (-1, 1)}
    result = relief.copy()
    for s in (-1, 1):
        near_side, far_side = near[s], near[-s]
        band = (side == s) & (away <= reach) & finite
        mixed = band & _of_other_side(relief, near_side, far_side, least)
        result[mixed] = near_side[mixed]
        # Of a given relief of the edge the side that is nearer to it runs up to it.
        with np.errstate(invalid="ignore"):
            runs_up = band & (np.abs(level - near_side) < np.abs(level - far_side))
        rise = (level - near_side) * (1 - away / np.float32(reach))
        result[runs_up] = (near_side + rise)[runs_up]
    np.copyto(relief, result)


def _beside(
    line: FloatArray, grid: Grid, most: float
) -> tuple[Float32Array, IntArray, Float32Array]:
    """Return distance to a line [px], side (1 left, -1 right, 0 beyond its ends) and its relief."""
    away = np.full(grid.shape, np.inf, np.float32)
    side = np.zeros(grid.shape, np.int64)
    level = np.full(grid.shape, np.nan, np.float32)
    corners = grid.pixel_of(line[:, :2])
    y, x = np.mgrid[: grid.height, : grid.width]
    last = len(line) - 2
    for number in range(last + 1):
        start, along = corners[number], corners[number + 1] - corners[number]
        length = float(np.hypot(*along))
        if length == 0:
            continue
        share = ((x - start[0]) * along[0] + (y - start[1]) * along[1]) / length**2
        held = np.clip(share, 0, 1)
        gap = np.hypot(x - start[0] - held * along[0], y - start[1] - held * along[1])
        across = (y - start[1]) * along[0] - (x - start[0]) * along[1]
        use = (gap < away) & (gap <= most)
        use &= (share >= 0) if number == 0 else True
        use &= (share <= 1) if number == last else True
        away[use], side[use] = gap[use], np.where(across[use] > 0, -1, 1)
        ends = line[number, 2], line[number + 1, 2]
        level[use] = (ends[0] + held * (ends[1] - ends[0]))[use]
    return away, side, level
