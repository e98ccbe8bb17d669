"""Points to be shifted radially, and what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multimedia.refraction import Layers, radial_shift_ratio
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError

#: Columns that points given by their radius do not have.
IN_PLANE = ("X", "Y", "Z", "Xbar", "Ybar")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShiftSetup:
    """The camera above its media.

    Attributes
    ----------
    layers : Layers
        The media.
    z0 : float
        Camera centre to the first interface. [unit of all lengths]
    nadir : (float, float)
        X and Y of the camera.
    """

    layers: Layers
    z0: float
    nadir: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def from_camera(cls, camera: tuple[float, float, float], layers: Layers) -> ShiftSetup:
        """Return the set-up of a camera at (X, Y, Z), Z = 0 being the interface on the water side.

        Raises
        ------
        InputError
            If the camera is not above all media.
        """
        z0 = camera[2] - layers.thickness
        if z0 < 0:
            raise InputError(
                remark("shift.camera_too_low", z=camera[2], thickness=layers.thickness)
            )
        return cls(layers=layers, z0=z0, nadir=(camera[0], camera[1]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShiftPoints:
    """Points under the media.

    Attributes
    ----------
    ids : tuple of str
        Names.
    radius, depth : ndarray, shape (n,)
        Horizontal distance from the camera's nadir, and depth under the last interface.
    xy : ndarray, shape (n, 2)
        Coordinates; NaN for points given by radius.
    """

    ids: tuple[str, ...]
    radius: FloatArray
    depth: FloatArray
    xy: FloatArray

    def shifted(self, setup: ShiftSetup) -> ShiftResult:
        """Return the points as straight rays see them."""
        ratio = radial_shift_ratio(self.radius, z0=setup.z0, zp=self.depth, layers=setup.layers)
        nadir = np.asarray(setup.nadir)
        return ShiftResult(
            radius_bar=self.radius * ratio,
            xy_bar=nadir + (self.xy - nadir) * ratio[:, None],
            flags=tuple("NO-RAY" if missing else "OK" for missing in np.isnan(ratio)),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShiftResult:
    """Shifted points.

    Attributes
    ----------
    radius_bar : ndarray, shape (n,)
        Shifted radius; NaN where no ray exists.
    xy_bar : ndarray, shape (n, 2)
        Shifted coordinates; NaN for points given by radius.
    flags : tuple of str
        ``OK`` or ``NO-RAY``.
    """

    radius_bar: FloatArray
    xy_bar: FloatArray
    flags: tuple[str, ...]

    def columns(
        self, points: ShiftPoints, *, every: bool = False
    ) -> dict[str, Sequence[str] | FloatArray]:
        """Return the columns of tables; `IN_PLANE` too of points given by radius if ``every``."""
        columns: dict[str, Sequence[str] | FloatArray] = {
            "id": points.ids,
            "X": points.xy[:, 0],
            "Y": points.xy[:, 1],
            "Z": 0.0 - points.depth,
            "R": points.radius,
            "ZP": points.depth,
            "Rbar": self.radius_bar,
            "dR": self.radius_bar - points.radius,
            "Xbar": self.xy_bar[:, 0],
            "Ybar": self.xy_bar[:, 1],
            "flag": self.flags,
        }
        bare = not every and bool(np.isnan(points.xy).all())
        return {k: v for k, v in columns.items() if not (bare and k in IN_PLANE)}
