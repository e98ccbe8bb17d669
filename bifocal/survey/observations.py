"""Measured points as the user typed them: names, coordinates on both photos, use, notes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from photocore.arrays import BoolArray, FloatArray
from photocore.errors import InputError

#: Codes that mark a point as lying on the reference plane (r = 0), for the set-up check.
PLANE_CODES = ("PLANE", "PIANO", "EBENE")


#: Stands for columns that were not given; replaced by blanks when the object is made.
_ABSENT: Any = None


def _blank(points: int, columns: int) -> FloatArray:
    return np.full((points, columns), np.nan)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointObservations:
    """Points measured on both photos; NaN where a cell was blank.

    A point is given in one of three ways: image coordinates on both photos, radial distances with
    a direction, or raw pixels of both photos (for a pair file).

    Attributes
    ----------
    ids : tuple of str, length n
        Names of the points.
    xy1, xy2 : ndarray, shape (n, 2)
        Image coordinates in the unit of `Setup`. [mm or px]
    polar : ndarray, shape (n, 3)
        s1, s2 [mm] and theta, clockwise from +y. [deg]
    pixels1, pixels2 : ndarray, shape (n, 2)
        Raw (column, row). [px]
    use : ndarray of bool, shape (n,)
        False for points that are listed but take no part.
    code, note : tuple of str, length n
        The user's own words; a code of `PLANE_CODES` marks a point of the reference plane.
    r_measured : ndarray, shape (n,)
        Relief measured on site, to check against. [m]
    """

    ids: tuple[str, ...]
    xy1: FloatArray = _ABSENT
    xy2: FloatArray = _ABSENT
    polar: FloatArray = _ABSENT
    pixels1: FloatArray = _ABSENT
    pixels2: FloatArray = _ABSENT
    use: BoolArray = _ABSENT
    code: tuple[str, ...] = ()
    note: tuple[str, ...] = ()
    r_measured: FloatArray = _ABSENT

    def __post_init__(self) -> None:
        n, set_ = len(self.ids), object.__setattr__
        shapes = {"xy1": 2, "xy2": 2, "polar": 3, "pixels1": 2, "pixels2": 2}
        for name, columns in shapes.items():
            value = getattr(self, name)
            array = _blank(n, columns) if value is None else np.array(value, dtype=np.float64)
            if array.shape != (n, columns):
                raise InputError(f"{name}: expected shape ({n}, {columns}), found {array.shape}.")
            array.setflags(write=False)
            set_(self, name, array)
        measured = _blank(n, 1)[:, 0] if self.r_measured is None else self.r_measured
        set_(self, "r_measured", np.array(measured, dtype=np.float64))
        set_(self, "use", np.ones(n, bool) if self.use is None else np.array(self.use, dtype=bool))
        for name in ("code", "note"):
            set_(self, name, tuple(getattr(self, name)) or ("",) * n)
        if any(len(getattr(self, name)) != n for name in ("use", "code", "note", "r_measured")):
            raise InputError(f"use, code, note and r_measured must have one value per id ({n}).")

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def is_cartesian(self) -> BoolArray:
        """Which points have any image coordinate, shape (n,)."""
        given: BoolArray = ~np.isnan(np.hstack([self.xy1, self.xy2])).all(axis=1)
        return given

    @property
    def has_pixels(self) -> BoolArray:
        """Which points have any raw pixel, shape (n,)."""
        given: BoolArray = ~np.isnan(np.hstack([self.pixels1, self.pixels2])).all(axis=1)
        return given

    @property
    def on_plane(self) -> BoolArray:
        """Which used points the user marks as lying on the reference plane, shape (n,)."""
        marked = [word.strip().upper() in PLANE_CODES for word in self.code]
        return np.array(marked, dtype=bool) & self.use

    def exchanged(self) -> PointObservations:
        """Return the observations with images 1 and 2 exchanged."""
        return replace(
            self,
            xy1=self.xy2,
            xy2=self.xy1,
            pixels1=self.pixels2,
            pixels2=self.pixels1,
            polar=self.polar[:, [1, 0, 2]],
        )

    def take(self, rows: Sequence[int] | BoolArray) -> PointObservations:
        """Return the chosen rows."""
        index = np.arange(len(self))[np.asarray(rows)]
        arrays = ("xy1", "xy2", "polar", "pixels1", "pixels2", "use", "r_measured")
        words = ("ids", "code", "note")
        chosen: dict[str, Any] = {name: getattr(self, name)[index] for name in arrays}
        chosen |= {name: tuple(getattr(self, name)[i] for i in index) for name in words}
        return replace(self, **chosen)
