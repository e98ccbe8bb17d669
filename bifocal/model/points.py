"""Surveyed points as they leave the survey: names, coordinates, precision, flags."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress
from typing import NamedTuple

import numpy as np

from photocore.arrays import BoolArray, FloatArray, as_floats
from photocore.errors import InputError


class PointLine(NamedTuple):
    """A polyline through surveyed points, by their names, on a layer of the drawing."""

    name: str
    layer: str
    ids: tuple[str, ...]
    closed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurveyPoints:
    """Points of one survey.

    Attributes
    ----------
    ids : tuple of str, length n
    xyz : ndarray, shape (n, 3)
        X, Y on the reference plane and relief; NaN where undefined. [m]
    world : ndarray, shape (n, 3), or None
        E, N, H, where the survey is georeferenced. [m]
    sigma_r : ndarray, shape (n,)
        Standard deviation of the relief; NaN where unknown. [m]
    flags, notes : tuple of str, length n
    """

    ids: tuple[str, ...]
    xyz: FloatArray
    world: FloatArray | None = None
    sigma_r: FloatArray
    flags: tuple[str, ...]
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        count = len(self.ids)
        for name, width in (("xyz", 3), ("world", 3), ("sigma_r", 0)):
            value = getattr(self, name)
            if value is None:
                continue
            array = np.array(as_floats(value, name))
            if array.shape != ((count, width) if width else (count,)):
                raise InputError(f"{name}: shape {array.shape} does not fit {count} points.")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        for name in ("flags", "notes"):
            if len(getattr(self, name)) != count:
                raise InputError(f"{name}: {len(getattr(self, name))} for {count} points.")

    def __len__(self) -> int:
        return len(self.ids)

    def take(self, keep: BoolArray) -> SurveyPoints:
        """Return the points where ``keep`` is true."""
        return SurveyPoints(
            ids=tuple(compress(self.ids, keep)),
            xyz=self.xyz[keep],
            world=None if self.world is None else self.world[keep],
            sigma_r=self.sigma_r[keep],
            flags=tuple(compress(self.flags, keep)),
            notes=tuple(compress(self.notes, keep)),
        )
