"""Points of a calibration body in one position, as one camera saw them."""

from __future__ import annotations

from dataclasses import dataclass

from photocore.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaneSet:
    """Points of the body in one position, and where one camera saw them.

    Attributes
    ----------
    label : str
        Name of the position; empty where the file is of all positions together.
    source : str
        The files, relative to the experiment.
    image : ndarray, shape (n, 2)
        Measured image coordinates. [mm]
    xyz : ndarray, shape (n, 3)
        [mm]
    """

    label: str
    source: str
    image: FloatArray
    xyz: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneCandidates:
    """What one camera has.

    Attributes
    ----------
    positions : tuple of tuple of PlaneSet
        Sets of each position of the plane, the likeliest first.
    together : tuple of PlaneSet
        Sets of all positions.
    """

    positions: tuple[tuple[PlaneSet, ...], ...]
    together: tuple[PlaneSet, ...]
