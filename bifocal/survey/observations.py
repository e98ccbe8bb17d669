"""Measured points as the user typed them: names, coordinates on both photos, use, notes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray, as_floats
from photocore.errors import InputError
from photocore.series import check_index

#: Columns of numbers and of texts, by key.
NUMBERS = (
    *("x1", "y1", "x2", "y2", "s1", "s2", "theta"),
    *("col1", "row1", "col2", "row2", "r_measured"),
)
TEXTS = ("id", "code", "note")
#: Codes that mark a point as lying on the reference plane (r = 0), for the set-up check.
PLANE_CODES = ("PLANE", "PIANO", "EBENE")
#: What a code begins with where a pick was accepted in doubt: its relief may be any.
DOUBT_CODES = ("DOUBTFUL", "DUBBIO", "ZWEIFELHAFT")


def pixel_keys(number: int) -> tuple[str, str]:
    """Return the keys of the columns of raw pixels of a photo, counted from 1."""
    return f"col{number}", f"row{number}"


#: Stands for columns that were not given; replaced by blanks when the object is made.
_ABSENT: Any = None


def _blank(points: int, columns: int) -> FloatArray:
    return np.full((points, columns), np.nan)


def _any_given(*columns: FloatArray) -> BoolArray:
    """Return which rows hold any number, shape (n,)."""
    return np.asarray(~np.isnan(np.hstack(columns)).all(axis=1))


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
    others : ndarray, shape (n, k, 2)
        Raw (column, row) in the third photo and more of a set. [px]
    other_xy : ndarray, shape (n, k, 2)
        Image coordinates in the third photo and more beside an ideal pair, as ``xy1``. [mm or px]
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
    others: FloatArray = _ABSENT
    other_xy: FloatArray = _ABSENT

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
        for name in ("others", "other_xy"):
            value = getattr(self, name)
            others = np.empty((n, 0, 2)) if value is None else np.array(value, float)
            if others.ndim != 3 or others.shape[::2] != (n, 2):
                raise InputError(f"{name}: expected shape ({n}, k, 2), found {others.shape}.")
            set_(self, name, others)
        measured = _blank(n, 1)[:, 0] if self.r_measured is None else self.r_measured
        set_(self, "r_measured", np.array(measured, dtype=np.float64))
        set_(self, "use", np.ones(n, bool) if self.use is None else np.array(self.use, dtype=bool))
        for name in ("code", "note"):
            set_(self, name, tuple(getattr(self, name)) or ("",) * n)
        if any(len(getattr(self, name)) != n for name in ("use", "code", "note", "r_measured")):
            raise InputError(f"use, code, note and r_measured must have one value per id ({n}).")

    @classmethod
    def from_columns(cls, columns: Mapping[str, Any]) -> PointObservations:
        """Return the observations of columns by key, each of shape (n,); see `bifocal.solve`.

        Raises
        ------
        InputError
            If a key is unknown, a column is no list of values, or columns differ in length.
        """
        more = [int(key[3:]) for key in columns if re.fullmatch(r"(col|row)([3-9]|[1-9]\d+)", key)]
        numbers = range(3, max(more, default=2) + 1)
        pixels = [key for number in numbers for key in pixel_keys(number)]
        unknown = [key for key in columns if key not in (*NUMBERS, *TEXTS, *pixels, "use")]
        if unknown:
            names = ", ".join((*TEXTS, *NUMBERS, "use"))
            raise InputError(f"points: there is no column {unknown[0]!r}; known are {names}.")
        shapes = {key: np.shape(column) for key, column in columns.items()}
        flawed = [key for key, shape in shapes.items() if len(shape) != 1]
        if flawed:
            raise InputError(remark("survey.no_list", of=flawed[0], shape=shapes[flawed[0]]))
        (n,) = next(iter(shapes.values()), (0,))
        uneven = [key for key, shape in shapes.items() if shape != (n,)]
        if uneven:
            raise InputError(f"{uneven[0]}: has {shapes[uneven[0]][0]} values, expected {n}.")
        check_index("points", *columns.values())
        blank = np.full(n, np.nan)

        def stacked(*keys: str) -> FloatArray:
            return np.stack([as_floats(columns.get(key, blank), key) for key in keys], axis=-1)

        return cls(
            ids=tuple(map(str, columns.get("id", range(1, n + 1)))),
            xy1=stacked("x1", "y1"),
            xy2=stacked("x2", "y2"),
            polar=stacked("s1", "s2", "theta"),
            pixels1=stacked("col1", "row1"),
            pixels2=stacked("col2", "row2"),
            others=stacked(*pixels).reshape(n, -1, 2) if pixels else _ABSENT,
            r_measured=as_floats(columns.get("r_measured", blank), "r_measured"),
            use=columns.get("use", np.ones(n, dtype=bool)),
            code=tuple(columns.get("code", ())),
            note=tuple(columns.get("note", ())),
        )

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def unused(self) -> frozenset[str]:
        """Names of the points that are listed but not used."""
        return frozenset(name for name, use in zip(self.ids, self.use, strict=True) if not use)

    @property
    def is_cartesian(self) -> BoolArray:
        """Which points have any image coordinate, shape (n,)."""
        return _any_given(self.xy1, self.xy2)

    @property
    def has_pixels(self) -> BoolArray:
        """Which points have any raw pixel, shape (n,)."""
        return _any_given(
            self.pixels1, self.pixels2, self.others.reshape(len(self), 2 * self.others.shape[1])
        )

    @property
    def pixels(self) -> tuple[FloatArray, ...]:
        """Raw (column, row) in every photo, each of shape (n, 2). [px]"""
        return (self.pixels1, self.pixels2, *self.others.transpose(1, 0, 2))

    @property
    def is_polar(self) -> BoolArray:
        """Which points have any radial distance, shape (n,)."""
        return _any_given(self.polar[:, :2])

    def polar_xy(self) -> tuple[FloatArray, FloatArray]:
        """Return the radial distances as x and y on both photos, each of shape (n, 2). [mm]"""
        angle = np.radians(self.polar[:, 2])
        direction = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
        return self.polar[:, :1] * direction, self.polar[:, 1:2] * direction

    def all_xy(self) -> tuple[FloatArray, FloatArray]:
        """Return x and y of all points, radial distances turned into them, each (n, 2). [mm]"""
        cartesian = self.is_cartesian[:, None]
        first, second = self.polar_xy()
        return np.where(cartesian, self.xy1, first), np.where(cartesian, self.xy2, second)

    @property
    def on_plane(self) -> BoolArray:
        """Which used points the user marks as lying on the reference plane, shape (n,)."""
        marked = [word.strip().upper() in PLANE_CODES for word in self.code]
        return np.array(marked, dtype=bool) & self.use

    @property
    def in_doubt(self) -> BoolArray:
        """Which points were accepted in doubt, shape (n,)."""
        marked = [word.strip().upper().startswith(DOUBT_CODES) for word in self.code]
        return np.array(marked, dtype=bool)

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
