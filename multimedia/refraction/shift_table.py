r"""Look-up table for the radial shift of one camera: Maas's table, and a better one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from multimedia.refraction.layers import Layers
from multimedia.refraction.shift import shift_ratio, shifted_radius
from multimedia.remarks import remark
from photocore.arrays import FloatArray, as_floats, contiguous_rows, positive
from photocore.errors import GeometryError, InputError

#: Points looked up at a time; scratch stays in the cache.
BLOCK = 4096

#: Rows and columns of nodes: fewer than 2000 entries, as Maas asks for.
SHAPE = (44, 44)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShiftTable:
    r"""Ratio :math:`\bar R / R` over depth and radius for one camera, to be interpolated.

    Parameters
    ----------
    z0 : float
        Camera centre to the first interface. [m]
    layers : Layers
        The media.
    max_radius : float
        Largest horizontal distance between camera nadir and point. [m]
    depths : (float, float)
        Smallest and largest depth under the last interface. [m]
    shape : (int, int)
        Nodes over depth and over radius, at least four each.
    degree : int
        1: bilinear in depth and R, as in the paper. 3: bicubic in depth and R², which the ratio is
        a smooth function of.

    Attributes
    ----------
    ratios : ndarray, shape ``shape``
        The table, axis (R = 0) first; exact at the nodes.
    error_bound : float
        Largest error of an interpolated :math:`\bar R`, found when the table was built by
        comparing 36 places in every mesh with the exact value, plus a tenth. [m]

    Raises
    ------
    InputError
        If the depths do not increase, the radius is not positive, or the table has no mesh.
    GeometryError
        If part of the table cannot be seen by the camera.

    Notes
    -----
    Maas 2015 [1]_, Sect. 3: one table per camera, entries (Z_P, R), fewer than 2000 of them. The
    axis holds the finite limit of the ratio, not 1. A table needs memory access where
    `radial_shift` computes; in numpy the exact shift is faster than any table (see
    ``benchmarks/bench_shift.py``), so its use is in following the paper and feeding other programs.

    References
    ----------
    .. [1] Maas, "On the accuracy potential in underwater/multimedia photogrammetry", Sensors 2015.

    Examples
    --------
    A tank of 200 mm, 500 mm from the camera:

    >>> tank = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))
    >>> table = ShiftTable(z0=500.0, layers=tank, max_radius=220.0, depths=(0.0, 200.0))
    >>> table.entries, table.error_bound < 1e-6
    (1936, True)
    >>> round(float(table(100.0, z0=500.0, zp=150.0, layers=tank)), 6)
    106.810794
    """

    z0: float
    layers: Layers
    max_radius: float
    depths: tuple[float, float]
    shape: tuple[int, int] = SHAPE
    degree: int = 3
    ratios: FloatArray = field(init=False, repr=False)
    error_bound: float = field(init=False)
    _meshes: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows, columns = self.shape
        near, far = (float(depth) for depth in self.depths)
        positive(self.max_radius, "max_radius")
        if not np.isfinite(self.z0):
            raise InputError(f"z0: must be a finite number, found {self.z0}.")
        if self.degree not in (1, 3):
            raise InputError(f"degree: 1 (bilinear) or 3 (bicubic in R²), found {self.degree}.")
        if not far > near:
            raise InputError(remark("table.depths", near=near, far=far))
        if min(rows, columns) < 4:
            raise InputError(f"shape: at least 4 by 4 nodes, found {rows} by {columns}.")
        depth = np.linspace(near, far, rows)[:, None]
        steps = np.linspace(0.0, 1.0, columns)
        radius = self.max_radius * (steps if self.degree == 1 else np.sqrt(steps))
        ratios = shift_ratio(radius, self.layers.heights(z0=self.z0, zp=depth), self.layers.indices)
        if np.isnan(ratios).any():
            raise GeometryError(remark("table.max_radius", max_radius=self.max_radius))
        ratios.setflags(write=False)
        object.__setattr__(self, "depths", (near, far))
        object.__setattr__(self, "ratios", ratios)
        meshes = _bilinear(ratios) if self.degree == 1 else _bicubic(ratios)
        object.__setattr__(self, "_meshes", meshes)
        object.__setattr__(self, "error_bound", self._largest_error())

    @property
    def entries(self) -> int:
        """Number of nodes."""
        return int(self.ratios.size)

    def __call__(
        self,
        radius: ArrayLike,
        *,
        zp: ArrayLike,
        z0: ArrayLike | None = None,
        layers: Layers | None = None,
    ) -> FloatArray:
        r"""Look up the shifted radius; call it as `radial_shift`.

        Parameters
        ----------
        radius, zp : array_like, shape (...)
            As in `radial_shift`. [m]
        z0, layers
            May be given so that the table can stand in for `radial_shift`; they must be the
            table's own.

        Returns
        -------
        radius_bar : ndarray, shape (...)
            NaN where radius, z0 or zp is NaN. [m]

        Raises
        ------
        GeometryError
            If a point is outside the table, or z0 or the layers are not the table's.
        """
        if layers is not None and layers != self.layers:
            raise GeometryError("layers: the table was built for other media; build another one.")
        height = as_floats(self.z0 if z0 is None else z0, "z0")
        unknown = np.isnan(height)
        if not (unknown | (height == self.z0)).all():
            raise GeometryError(remark("table.other_camera", z0=self.z0))
        r, depth = as_floats(radius, "radius"), as_floats(zp, "zp")
        if unknown.any():
            r = np.where(unknown, np.nan, r)
        self._refuse_outside(r, "radius", 0.0, self.max_radius)
        self._refuse_outside(depth, "zp", *self.depths)
        result = np.empty(np.broadcast_shapes(r.shape, depth.shape))
        for r_row, depth_row, target in contiguous_rows((r, depth), (result,), size=BLOCK):
            target[...] = r_row * self._ratio(r_row, depth_row)
        return result

    def _ratio(self, radius: FloatArray, depth: FloatArray) -> FloatArray:
        """Return the interpolated ratio of points inside the table."""
        rows, columns = self.shape
        near, far = self.depths
        down = (depth - near) * ((rows - 1) / (far - near))
        share = radius / self.max_radius
        across = (share if self.degree == 1 else share * share) * (columns - 1)
        with np.errstate(invalid="ignore"):  # NaN stays NaN; its mesh does not matter
            row = np.clip(np.nan_to_num(down), 0, rows - 2).astype(np.intp)
            column = np.clip(np.nan_to_num(across), 0, columns - 2).astype(np.intp)
        u, v = down - row, across - column
        mesh = self._meshes[row * (columns - 1) + column]
        # Horner in both directions; meshes hold c[i, j] of u^i v^j, highest powers first.
        width = self.degree + 1
        total = np.zeros(u.shape)
        for i in range(width):
            inner = mesh[:, i * width]
            for j in range(1, width):
                inner = inner * v + mesh[:, i * width + j]
            total = total * u + inner
        return total

    def _largest_error(self) -> float:
        """Compare 6 x 6 places in every mesh with the exact shift; return the largest plus 10 %."""
        rows, columns = self.shape
        places = (np.arange(6) + 0.5) / 6
        down = (np.arange(rows - 1)[:, None] + places).ravel() / (rows - 1)
        across = (np.arange(columns - 1)[:, None] + places).ravel() / (columns - 1)
        depth = self.depths[0] + (self.depths[1] - self.depths[0]) * down[:, None]
        radius = self.max_radius * (across if self.degree == 1 else np.sqrt(across))
        exact = shifted_radius(
            radius, self.layers.heights(z0=self.z0, zp=depth), self.layers.indices
        )
        return 1.1 * float(np.abs(self(radius, zp=depth) - exact).max())

    @staticmethod
    def _refuse_outside(values: FloatArray, name: str, low: float, high: float) -> None:
        """Raise GeometryError when a value is outside the table."""
        wrong = (values < low) | (values > high)
        if wrong.any():
            raise GeometryError(
                f"{name}: {int(wrong.sum())} of {values.size} values lie outside the table, which "
                f"covers {low:g} to {high:g} (first: {values[wrong].flat[0]:g}). Build a larger "
                "table or use radial_shift, which has no limits."
            )


def _bilinear(ratios: FloatArray) -> FloatArray:
    """Return u v, u, v, 1 coefficients of every mesh, shape (meshes, 4)."""
    a, b, c, d = ratios[:-1, :-1], ratios[:-1, 1:], ratios[1:, :-1], ratios[1:, 1:]
    return np.stack([a - b - c + d, c - a, b - a, a], axis=-1).reshape(-1, 4)


def _bicubic(ratios: FloatArray) -> FloatArray:
    """Return the 16 coefficients of every mesh of the bicubic spline through all nodes.

    A cubic spline along each direction in turn (not-a-knot at the borders) is the tensor-product
    spline, because the two operations commute.
    """
    rows, columns = ratios.shape
    down = CubicSpline(np.arange(rows), ratios).c  # (4, rows - 1, columns)
    both = CubicSpline(np.arange(columns), down, axis=2).c  # (4, columns - 1, 4, rows - 1)
    return np.ascontiguousarray(both.transpose(3, 1, 2, 0)).reshape(-1, 16)
