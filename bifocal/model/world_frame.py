"""Where a wall's plane frame lies in the frame of a total station: E, N, H."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import InputError

#: Its key in pair files and sets.
IN_PAIR = "world"
#: Cosine of the angle from which a plane is neither upright nor level: 15 degrees off.
_OFF = float(np.sin(np.deg2rad(15)))
#: A plane is spread at least so wide across, of its length; else its points are on a line.
_ON_LINE = 0.02
#: What may lie beside the line of a wall in plan and still tell where it is. [m]
_BESIDE = 0.003
_ROUNDS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldFrame:
    """The vertical or level plane of control points, from which X, Y, r count.

    Attributes
    ----------
    east, north, height : float
        Where X = Y = r = 0 lies; of an upright wall height 0. [m]
    azimuth : float
        Of the X axis, clockwise from north; 90 degrees for a level plane. [rad]
    is_upright : bool
        Whether Y is the height and r points out of the wall; else X, Y are E, N and r is H.
    """

    east: float
    north: float
    height: float
    azimuth: float
    is_upright: bool = True

    @property
    def axes(self) -> FloatArray:
        """X, Y and r as directions in E, N, H, one a row, shape (3, 3)."""
        if not self.is_upright:
            return np.eye(3)
        along = np.array([np.sin(self.azimuth), np.cos(self.azimuth), 0.0])
        outwards = np.array([along[1], -along[0], 0.0])
        return np.array([along, [0.0, 0.0, 1.0], outwards])

    @property
    def origin(self) -> FloatArray:
        """E, N, H of X = Y = r = 0, shape (3,). [m]"""
        return np.array([self.east, self.north, self.height])

    def exchanged(self) -> WorldFrame:
        """Return the frame where E and N stood in each other's column; r then counts inwards."""
        azimuth = np.pi / 2 - self.azimuth
        return replace(self, east=self.north, north=self.east, azimuth=azimuth)

    def to_plane(self, world: FloatArray) -> FloatArray:
        """Return X, Y, r of E, N, H, shape (n, 3). [m]"""
        return np.asarray((world - self.origin) @ self.axes.T)

    def to_world(self, plane: FloatArray) -> FloatArray:
        """Return E, N, H of X, Y, r, shape (n, 3). [m]"""
        return np.asarray(plane @ self.axes + self.origin)

    def to_json(self) -> dict[str, object]:
        """Return what a pair file holds of it."""
        return {
            "E": self.east, "N": self.north, "H": self.height,
            "azimuth_deg": float(np.rad2deg(self.azimuth)), "upright": self.is_upright,
        }  # fmt: skip

    @classmethod
    def of(cls, extra: Mapping[str, object]) -> WorldFrame | None:
        """Return the frame of a pair or set by the keys of its file; None where it has none.

        Raises
        ------
        InputError
            If it is damaged.
        """
        stated = extra.get(IN_PAIR)
        if stated is None:
            return None
        if not isinstance(stated, Mapping):
            raise InputError(remark("pair.damaged_world", error=repr(stated)))
        try:
            return cls.from_json(stated)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(remark("pair.damaged_world", error=repr(error))) from None

    @classmethod
    def from_json(cls, stated: Mapping[str, Any]) -> WorldFrame:
        """Return what a pair file holds.

        Raises
        ------
        KeyError, TypeError, ValueError
            If a number is missing or none.
        """
        east, north, height, azimuth = (float(stated[k]) for k in ("E", "N", "H", "azimuth_deg"))
        return cls(
            east=east, north=north, height=height, azimuth=float(np.deg2rad(azimuth)),
            is_upright=bool(stated["upright"]),
        )  # fmt: skip


def world_entry(frame: WorldFrame | None) -> dict[str, object]:
    """Return what a pair file or set holds of a frame, nothing where there is none."""
    return {} if frame is None else {IN_PAIR: frame.to_json()}


def lies_how(world: FloatArray) -> str:
    """Return how the plane of points lies: ``upright``, ``level``, ``sloping`` or ``line``."""
    _, spread, axes = np.linalg.svd(world - world.mean(axis=0), full_matrices=False)
    if len(spread) < 3 or spread[1] < _ON_LINE * spread[0]:
        return "line"
    lean = abs(float(axes[2, 2]))
    return "upright" if lean < _OFF else "level" if lean > np.sqrt(1 - _OFF**2) else "sloping"


def frame_of(world: FloatArray, picks: Sequence[FloatArray]) -> WorldFrame | None:
    """Return the frame of an upright wall as photos show it, or of a level plane.

    Parameters
    ----------
    world : ndarray, shape (n, 3)
        E, N, H, as `lies_how` finds them upright or level. [m]
    picks : sequence of ndarray, shape (n, 2)
        The same points in each photo; NaN where not picked. [px]

    Returns
    -------
    WorldFrame or None
        X runs so that the photos show the wall from its front, whichever way they are turned; None
        where too few picks tell.
    """
    if lies_how(world) == "level":
        height = float(np.round(world[:, 2].mean(), 1))
        return WorldFrame(east=0.0, north=0.0, height=height,
                          azimuth=np.pi / 2, is_upright=False)  # fmt: skip
    middle, along = _wall_in_plan(world[:, :2])
    flat = np.column_stack([(world[:, :2] - middle) @ along, world[:, 2] - world[:, 2].mean()])
    turns = [
        _turn(flat[rows], pixels[rows]) for pixels in picks if (rows := _both(pixels)).sum() > 2
    ]
    front = sum(turns)
    if front == 0:
        return None
    along = -along if front > 0 else along
    start = ((world[:, :2] - middle) @ along).min()
    east, north = middle + start * along
    azimuth = float(np.arctan2(along[0], along[1])) % (2 * np.pi)
    return WorldFrame(east=float(east), north=float(north), height=0.0, azimuth=azimuth)


def _wall_in_plan(plan: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a place and the direction of the line on which most of the points lie, in plan."""
    rows = np.ones(len(plan), dtype=bool)
    for _ in range(_ROUNDS):
        middle = plan[rows].mean(axis=0)
        along = np.linalg.svd(plan[rows] - middle, full_matrices=False)[2][0]
        beside = np.abs((plan - middle) @ [-along[1], along[0]])
        near = beside <= _BESIDE + 2 * np.median(beside)
        if near.sum() < 3 or (near == rows).all():
            break
        rows = near
    return middle, along


def _both(pixels: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(pixels).all(axis=1))


def _turn(flat: FloatArray, pixels: FloatArray) -> float:
    """Return the sign of how pixels, rows down, turn against places: negative from the front."""
    design = np.column_stack([flat, np.ones(len(flat))])
    rates = np.linalg.lstsq(design, pixels, rcond=None)[0][:2]
    return float(np.sign(np.linalg.det(rates)))
