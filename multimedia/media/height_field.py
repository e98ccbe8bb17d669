"""Water surfaces that are no plane: heights over X and Y, from a raster or as a sum of waves."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media.surfaces import Plane, RefractingSurface
from photocore.arrays import BoolArray, FloatArray, as_floats, as_points, positive, read_only
from photocore.errors import InputError

#: Newton reaches the last digit in 4 to 7 steps; bisection from 1 km needs 60.
MOST_STEPS = 80
#: Cubic convolution may leave the range of its samples by 28 % of it (sum of |weights| squared).
OVERSHOOT = 0.3
#: Steepest slope of cubic convolution over the steepest difference of neighbouring samples.
STEEPENING = 1.9
#: Samples per shortest feature when a flat ray may meet a wave more than once.
SAMPLES_PER_FEATURE = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeightField(RefractingSurface):
    """A surface Z = f(X, Y); normals point up. Subclasses say what f is.

    Attributes
    ----------
    lowest, highest : float
        Bounds of f.
    steepest : float
        Bound of its slope.
    feature : float
        Horizontal size of its finest detail.
    """

    lowest: float = field(init=False)
    highest: float = field(init=False)
    steepest: float = field(init=False)
    feature: float = field(init=False)

    def _keep(self, **values: Any) -> None:
        """Set what follows from the given values, once."""
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def middle(self) -> float:
        """Half way between the lowest and the highest point."""
        return (self.lowest + self.highest) / 2

    @abstractmethod
    def heights(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return f and its gradient, shapes (n,) and (n, 2); continued beyond the border."""

    @abstractmethod
    def slopes(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the slope that bends rays and its derivative, shapes (n, 2) and (n, 2, 2)."""

    @abstractmethod
    def covers(self, xy: FloatArray) -> BoolArray:
        """Return whether f is known there, shape (n,)."""

    def height_at(self, xy: ArrayLike) -> FloatArray:
        """Return the height above each position, shape (...); NaN where it is unknown."""
        points = as_points(xy, "xy", dimension=2)
        flat = points.reshape(-1, 2)
        height = np.where(self.covers(flat), self.heights(flat)[0], np.nan)
        return height.reshape(points.shape[:-1])

    def side(self, points: FloatArray) -> FloatArray:
        """Return the height of the points above the surface, negative below."""
        flat = points.reshape(-1, 3)
        height = self.heights(flat[:, :2])[0]
        # Over a hole of the raster only the range of heights is known; cameras are far above it.
        height = np.where(np.isnan(height), self.middle, height)
        return (flat[:, 2] - height).reshape(points.shape[:-1])

    def hop(self, origins: FloatArray, directions: FloatArray, beyond: FloatArray) -> FloatArray:
        """Return the distance to the first meeting with the surface; NaN where there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            to_top = (self.highest - origins[:, 2]) / directions[:, 2]
            to_bottom = (self.lowest - origins[:, 2]) / directions[:, 2]
        enter = np.maximum(np.fmin(to_top, to_bottom), beyond)
        leave = np.fmax(to_top, to_bottom)
        flow = np.hypot(directions[:, 0], directions[:, 1])
        usable = np.isfinite(enter) & np.isfinite(leave) & (leave >= enter)
        result = np.full(len(origins), np.nan)
        # A ray steeper than the steepest wave meets the surface once; a flatter one is searched.
        steep = np.abs(directions[:, 2]) > self.steepest * flow
        once, often = np.flatnonzero(usable & steep), np.flatnonzero(usable & ~steep)
        if once.size:
            result[once] = self._root(origins[once], directions[once], enter[once], leave[once])
        if often.size:
            first, last = self._first_change(
                origins[often], directions[often], enter[often], leave[often]
            )
            result[often] = self._root(origins[often], directions[often], first, last)
        met = np.flatnonzero(np.isfinite(result))
        landed = origins[met, :2] + result[met, None] * directions[met, :2]
        result[met[~self.covers(landed)]] = np.nan
        return result

    def _gap(
        self, origins: FloatArray, directions: FloatArray, distance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the height of the ray above the surface and its rate along the ray."""
        xy = origins[:, :2] + distance[:, None] * directions[:, :2]
        height, gradient = self.heights(xy)
        rate = directions[:, 2] - (gradient * directions[:, :2]).sum(-1)
        return origins[:, 2] + distance * directions[:, 2] - height, rate

    def _first_change(
        self, origins: FloatArray, directions: FloatArray, enter: FloatArray, leave: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the first stretch in which each flat ray changes sides; NaN where none."""
        flow = np.hypot(directions[:, 0], directions[:, 1])
        count = int(np.max((leave - enter) * flow) / self.feature * SAMPLES_PER_FEATURE) + 2
        step = (leave - enter) / min(count, 20_000)
        first = np.full(len(origins), np.nan)
        last = first.copy()
        above = self._gap(origins, directions, enter)[0] > 0
        searching = np.ones(len(origins), dtype=bool)
        for number in range(1, min(count, 20_000) + 1):
            rows = np.flatnonzero(searching)
            if not rows.size:
                break
            here = enter[rows] + number * step[rows]
            changed = (self._gap(origins[rows], directions[rows], here)[0] > 0) != above[rows]
            hit = rows[changed]
            first[hit], last[hit] = here[changed] - step[hit], here[changed]
            searching[hit] = False
        return first, last

    def _root(
        self, origins: FloatArray, directions: FloatArray, low: FloatArray, high: FloatArray
    ) -> FloatArray:
        """Return the root of the gap within each bracket: Newton, kept in bounds by bisection."""
        start_above = self._gap(origins, directions, low)[0] > 0
        low, high = low.copy(), high.copy()
        distance = (low + high) / 2
        rows = np.flatnonzero(np.isfinite(distance))
        smallest = 4 * np.finfo(float).eps * (np.abs(origins).max(initial=0.0) + np.abs(high))
        for _ in range(MOST_STEPS):
            here = distance[rows]
            gap, rate = self._gap(origins[rows], directions[rows], here)
            before = (gap > 0) == start_above[rows]
            low[rows] = np.where(before, here, low[rows])
            high[rows] = np.where(before, high[rows], here)
            with np.errstate(divide="ignore", invalid="ignore"):
                new = here - gap / rate
            inside = (new >= low[rows]) & (new <= high[rows])
            new = np.where(inside, new, (low[rows] + high[rows]) / 2)
            distance[rows] = new
            rows = rows[np.abs(new - here) > smallest[rows]]
            if not rows.size:
                break
        # A bracket that closes without a meeting (a hole, a border) leaves a gap: no meeting.
        finite = np.flatnonzero(np.isfinite(distance))
        gap = np.full(len(origins), np.nan)
        gap[finite] = self._gap(origins[finite], directions[finite], distance[finite])[0]
        tolerance = 1e-9 * (self.highest - self.lowest + self.feature) + smallest
        return np.where(np.abs(gap) <= tolerance, distance, np.nan)

    def normals(self, points: FloatArray) -> FloatArray:
        """Return the upward unit normals above positions, shape (n, 3)."""
        slope = self.slopes(points[:, :2])[0]
        steepness = np.sqrt(1 + (slope * slope).sum(-1))
        return np.column_stack([-slope, np.ones(len(slope))]) / steepness[:, None]

    def curvature(self, points: FloatArray, normals: FloatArray, steps: FloatArray) -> FloatArray:
        """Return the change of the unit normal along tangent steps, shape (n, k, 3)."""
        bend = self.slopes(points[:, :2])[1]
        change = np.zeros_like(steps)
        change[..., :2] = -np.einsum("nij,nkj->nki", bend, steps[..., :2])
        # d(N / |N|) = (dN - n (n . dN)) / |N|, and 1 / |N| is the third component of n.
        along = np.einsum("nki,ni->nk", change, normals)
        return (change - along[..., None] * normals[:, None, :]) * normals[:, None, 2:]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WaveSurface(HeightField):
    """A water surface as a level plus plane sinusoidal waves, with no end.

    Attributes
    ----------
    level : float
        Mean height.
    amplitude : ndarray, shape (k,)
        Half the height from trough to crest of each wave, in the unit of the level.
    wave_vector : ndarray, shape (k, 2)
        2 pi / wavelength times the direction of travel. [rad per unit of length]
    phase : ndarray, shape (k,)
        Phase at X = Y = 0. [rad]
    """

    level: float
    amplitude: FloatArray
    wave_vector: FloatArray
    phase: FloatArray

    def __post_init__(self) -> None:
        amplitude = read_only(np.atleast_1d(self.amplitude), "amplitude")
        count = len(amplitude)
        vector = read_only(np.atleast_2d(self.wave_vector), "wave_vector", shape=(count, 2))
        phase = read_only(np.atleast_1d(self.phase), "phase", shape=(count,))
        number = np.hypot(*vector.T)
        if not (number > 0).all():
            raise InputError("wave_vector: a wave needs a length; the vector must not be zero.")
        # Wider than the waves by more than rounding: a ray to a crest must not end before it.
        reach = float(np.abs(amplitude).sum()) * (1 + 1e-9) + 1e-12 * abs(self.level)
        self._keep(
            amplitude=amplitude,
            wave_vector=vector,
            phase=phase,
            lowest=self.level - reach,
            highest=self.level + reach,
            steepest=float((np.abs(amplitude) * number).sum()),
            feature=float(2 * np.pi / number.max()),
        )

    @classmethod
    def sinusoid(
        cls,
        level: float,
        *,
        amplitude: float,
        wavelength: float,
        direction: float = 0.0,
        phase: float = 0.0,
    ) -> WaveSurface:
        """Return one wave; ``direction`` of travel clockwise from +Y, both angles in rad."""
        number = 2 * np.pi / positive(wavelength, "wavelength")
        vector = (number * np.sin(direction), number * np.cos(direction))
        return cls(level=level, amplitude=amplitude, wave_vector=vector, phase=phase)  # type: ignore[arg-type]

    def _angles(self, xy: FloatArray) -> FloatArray:
        angles: FloatArray = xy @ self.wave_vector.T + self.phase
        return angles

    def heights(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the height and its gradient."""
        angles = self._angles(xy)
        height: FloatArray = self.level + np.cos(angles) @ self.amplitude
        return height, -(np.sin(angles) * self.amplitude) @ self.wave_vector

    def slopes(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gradient and its derivative."""
        angles = self._angles(xy)
        gradient = -(np.sin(angles) * self.amplitude) @ self.wave_vector
        curve = -np.cos(angles) * self.amplitude
        return gradient, np.einsum("nk,ki,kj->nij", curve, self.wave_vector, self.wave_vector)

    def covers(self, xy: FloatArray) -> BoolArray:
        """Return True: the sea has no border here."""
        return np.asarray(np.isfinite(xy).all(-1))

    def shifted(self, vector: ArrayLike) -> WaveSurface:
        """Return the waves moved by a vector."""
        step = as_floats(vector, "vector")
        phase = self.phase - self.wave_vector @ step[:2]
        return replace(self, level=self.level + float(step[2]), phase=phase)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RasterSurface(HeightField):
    """A water surface given as a raster of heights, joined by cubic convolution (Keys 1981).

    Slopes are continuous, quadratic surfaces are reproduced exactly, and a hole (NaN) spoils only
    the two cells around it.

    Attributes
    ----------
    raster : ndarray, shape (rows, columns)
        Heights at cell centres; NaN where unknown. At least 3 x 3.
    xy_from_cell : ndarray, shape (2, 3)
        Affine map from (column, row, 1), integers at cell centres, to (X, Y).
    source : str
        File it was read from; a project file names it.
    """

    raster: FloatArray
    xy_from_cell: FloatArray
    source: str = ""
    _padded: FloatArray = field(init=False, repr=False)
    _cell_from_xy: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        raster = np.array(as_floats(self.raster, "raster"))
        if raster.ndim != 2 or min(raster.shape) < 3:
            raise InputError(
                f"raster: a water surface needs at least 3 x 3 heights, found {raster.shape}."
            )
        raster[~np.isfinite(raster)] = np.nan
        if not np.isfinite(raster).any():
            raise InputError("raster: the water surface holds no height at all, only no-data.")
        raster.setflags(write=False)
        affine = read_only(self.xy_from_cell, "xy_from_cell", shape=(2, 3))
        if abs(np.linalg.det(affine[:, :2])) == 0:
            raise InputError("xy_from_cell: the cells have no area.")
        low, high = float(np.nanmin(raster)), float(np.nanmax(raster))
        margin = OVERSHOOT * (high - low) + 1e-9 * max(1.0, abs(low), abs(high))
        sides = np.hypot(affine[0, :2], affine[1, :2])
        rises = [_steepest_difference(raster, axis) for axis in (1, 0)]
        self._keep(
            raster=raster,
            xy_from_cell=affine,
            _cell_from_xy=np.linalg.inv(affine[:, :2]),
            _padded=_with_ghosts(raster),
            lowest=low - margin,
            highest=high + margin,
            steepest=STEEPENING * float(np.hypot(rises[0] / sides[0], rises[1] / sides[1])),
            feature=float(sides.min()),
        )

    def _cells(self, xy: FloatArray) -> FloatArray:
        cells: FloatArray = (xy - self.xy_from_cell[:, 2]) @ self._cell_from_xy.T
        return cells

    def covers(self, xy: FloatArray) -> BoolArray:
        """Return whether positions lie within the outermost cell centres and off the holes."""
        cells = self._cells(xy)
        last = np.array(self.raster.shape[::-1]) - 1.0
        slack = 1e-9 * (1 + last)
        with np.errstate(invalid="ignore"):
            inside = ((cells >= -slack) & (cells <= last + slack)).all(-1)
        return inside & np.isfinite(self._convolve(cells, (0, 0))[0])

    def _convolve(self, cells: FloatArray, *orders: tuple[int, int]) -> list[FloatArray]:
        """Return derivatives of the surface by (column, row), one per pair of orders."""
        last = np.array(self.raster.shape[::-1]) - 1.0
        with np.errstate(invalid="ignore"):
            clamped = np.clip(cells, 0.0, last)
        finite = np.asarray(np.isfinite(clamped).all(-1))
        clamped = np.where(finite[:, None], clamped, 0.0)
        base = np.minimum(np.floor(clamped), last - 1).astype(np.int64)
        share = clamped - base
        patch = [
            [self._padded[base[:, 1] + row, base[:, 0] + column] for column in range(4)]
            for row in range(4)
        ]
        results = []
        for by_column, by_row in orders:
            across = _keys_weights(share[:, 0], by_column)
            down = _keys_weights(share[:, 1], by_row)
            total = np.zeros(len(cells))
            for weight, line in zip(down, patch, strict=True):
                total += weight * sum(w * p for w, p in zip(across, line, strict=True))
            results.append(np.where(finite, total, np.nan))
        return results

    def heights(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the height and its gradient; the border height goes on outside."""
        height, by_column, by_row = self._convolve(self._cells(xy), (0, 0), (1, 0), (0, 1))
        return height, np.stack([by_column, by_row], axis=-1) @ self._cell_from_xy

    def slopes(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gradient and its derivative."""
        orders = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        by_column, by_row, cc, cr, rr = self._convolve(self._cells(xy), *orders)
        gradient = np.stack([by_column, by_row], axis=-1) @ self._cell_from_xy
        second = np.stack([cc, cr, cr, rr], axis=-1).reshape(-1, 2, 2)
        return gradient, self._cell_from_xy.T @ second @ self._cell_from_xy

    def shifted(self, vector: ArrayLike) -> RasterSurface:
        """Return the raster moved by a vector."""
        step = as_floats(vector, "vector")
        affine = self.xy_from_cell.copy()
        affine[:, 2] += step[:2]
        return replace(self, raster=self.raster + step[2], xy_from_cell=affine, source="")


#: A surface of water that has a height above every place.
WaterSurface = Plane | HeightField


def _keys_weights(share: FloatArray, order: int) -> Sequence[FloatArray]:
    """Return the four cubic convolution weights (a = -1/2), or a derivative of them."""
    t = share
    if order == 0:
        return (
            t * (-0.5 + t * (1 - 0.5 * t)),
            1 + t * t * (-2.5 + 1.5 * t),
            t * (0.5 + t * (2 - 1.5 * t)),
            t * t * (-0.5 + 0.5 * t),
        )
    if order == 1:
        return (
            -0.5 + t * (2 - 1.5 * t),
            t * (-5 + 4.5 * t),
            0.5 + t * (4 - 4.5 * t),
            t * (-1 + 1.5 * t),
        )
    return (2 - 3 * t, -5 + 9 * t, 4 - 9 * t, -1 + 3 * t)


def _with_ghosts(raster: FloatArray) -> FloatArray:
    """Return the raster with a ring of extrapolated cells, 3 f0 - 3 f1 + f2 (Keys)."""
    padded = np.pad(raster, 1, constant_values=np.nan)
    for grid in (padded[1:-1], padded.T):  # views: first the columns, then the rows
        grid[:, 0] = 3 * grid[:, 1] - 3 * grid[:, 2] + grid[:, 3]
        grid[:, -1] = 3 * grid[:, -2] - 3 * grid[:, -3] + grid[:, -4]
    return padded


def _steepest_difference(raster: FloatArray, axis: int) -> float:
    """Return the largest height difference of neighbours along an axis; 0 if all are holes."""
    steps = np.abs(np.diff(raster, axis=axis))
    return float(np.nanmax(steps)) if np.isfinite(steps).any() else 0.0
