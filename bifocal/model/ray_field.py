"""A camera's rays through media over a part of the reference plane, tabulated for whole images.

In air a ray over the plane position A is ``A + r S`` with ``S = -(A - N) / d``. Through media S is
hardly different from that of a straight camera at another place (`bifocal.rays.straight`); the
difference, smooth and small, is tabulated. Interfaces may lean: nothing is radial here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from bifocal import rays
from bifocal.model.grid import Bounds, Grid, bounds_of
from photocore.arrays import Float32Array, FloatArray

#: Cells along the longer side of a table: what is interpolated is right to 1e-5 m per metre of
#: relief. More would cost more than they gain.
CELLS = 256
#: Steps from a point down its ray; each leaves a hundredth of the error or less.
STEPS = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RayField:
    """Slopes of rays over the reference plane.

    Attributes
    ----------
    foot : Foot
        The straight camera that they are compared with. [m]
    grid : Grid
        Of the table.
    excess : ndarray of float32, shape (height, width, 2)
        What its slope lacks, along X and Y. [m per metre of relief]
    """

    foot: rays.Foot
    grid: Grid
    excess: Float32Array

    @classmethod
    def over(cls, camera: rays.Foot, bounds: Bounds, reliefs: tuple[float, float]) -> RayField:
        """Return the field for points within bounds and between two reliefs.

        Parameters
        ----------
        camera : Foot
            With media.
        bounds : tuple of float
            Xmin, ymin, xmax, ymax of the points. [m]
        reliefs : tuple of float
            Least and greatest relief of the points. [m]
        """
        straight = rays.straight(camera)
        box = _grown(camera, bounds, reliefs)
        step = max(box[2] - box[0], box[3] - box[1]) / CELLS
        grid = Grid.from_bounds(box, gsd=step)
        places = np.stack(np.meshgrid(grid.columns_x, grid.rows_y), axis=-1)
        bent = rays.object_rays(rays.apparent_of_plane(places, camera), camera).slope
        # Where no ray leads (beyond the interfaces) nothing is seen either.
        excess = np.nan_to_num(bent + (places - straight.nadir) / straight.distance)
        return cls(foot=straight, grid=grid, excess=excess.astype(np.float32))

    def slopes(self, x: Any, y: Any) -> tuple[Float32Array, Float32Array]:
        """Return the slopes of rays that meet the plane at offsets from the foot's nadir.

        Parameters
        ----------
        x, y : ndarray of float32, shape (height, width), broadcastable
            Offsets along X and Y. [m]

        Returns
        -------
        ndarray of float32, shape (height, width)
            Change of X and of Y per metre of relief.
        """
        x, y = np.broadcast_arrays(x, y)
        more = self._excess(x, y)
        share = np.float32(-1 / self.foot.distance)
        return more[..., 0] + share * x, more[..., 1] + share * y

    def through(
        self, x: Any, y: Any, relief: Any
    ) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array]:
        """Return where rays through points meet the plane, and their slopes there.

        Parameters
        ----------
        x, y : ndarray of float32, shape (height, width), broadcastable
            Offsets of the points from the foot's nadir. [m]
        relief : ndarray of float32
            Of the points. [m]

        Returns
        -------
        ndarray of float32, shape (height, width)
            Offsets of the places along X and Y [m]; slopes as of `slopes`.

        Notes
        -----
        ``A = (P - r E(A)) d / (d - r)`` with the excess E: by fixed point, since E hardly changes.
        """
        x, y = np.broadcast_arrays(x, y)
        if x.ndim == 1:  # cv2.remap counts rows and columns in 16 bits
            folded = (_folded(np.broadcast_to(v, x.shape)) for v in (x, y, relief))
            u, v, along_x, along_y = (a.ravel()[: len(x)] for a in self.through(*folded))
            return u, v, along_x, along_y
        relief = np.asarray(relief, np.float32)
        factor = rays.magnification(relief, np.float32(self.foot.distance))
        at = x * factor, y * factor
        for _ in range(STEPS):
            more = self._excess(*at)
            at = (x - relief * more[..., 0]) * factor, (y - relief * more[..., 1]) * factor
        share = np.float32(-1 / self.foot.distance)
        return *at, more[..., 0] + share * at[0], more[..., 1] + share * at[1]

    def _excess(self, x: Float32Array, y: Float32Array) -> Float32Array:
        """Return the excess of slope at places; that of the table's rim beyond it."""
        column, row = self.grid.pixel_of(self.foot.nadir)
        share = np.float32(1 / self.grid.gsd)
        maps = x * share + np.float32(column), np.float32(row) - y * share
        columns, rows = (np.nan_to_num(m, nan=-1e4, posinf=1e4, neginf=-1e4) for m in maps)
        count = columns.size if columns.ndim == 1 else None
        if count is not None:  # OpenCV takes no side of 32768 pixels
            columns, rows = _folded(columns), _folded(rows)
        excess = cv2.remap(
            self.excess, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        if count is not None:
            excess = excess.reshape(-1, *excess.shape[2:])[:count]
        return np.asarray(excess, dtype=np.float32)


def _folded(values: Float32Array) -> Float32Array:
    """Return a list of values in rows, the last one filled up with zeros."""
    width = 4096
    return np.pad(values, (0, -len(values) % width)).reshape(-1, width)


def _grown(camera: rays.Foot, bounds: Bounds, reliefs: tuple[float, float]) -> Bounds:
    """Return bounds grown to where the rays through their points meet the plane."""
    x = np.linspace(bounds[0], bounds[2], 9)
    y = np.linspace(bounds[1], bounds[3], 9)
    places: list[FloatArray] = []
    for relief in (0.0, *reliefs):
        xyz = np.stack(np.broadcast_arrays(*np.meshgrid(x, y), relief), axis=-1)
        met = rays.object_rays(rays.plane_position(xyz, camera), camera).position.reshape(-1, 2)
        places.append(met[np.isfinite(met).all(-1)])
    return bounds_of(np.concatenate([*places, np.reshape(bounds, (2, 2))]))
