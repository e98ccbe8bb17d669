"""What the file of a pair or of a set says under ``setup``: how its cameras were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from photocore.arrays import FloatArray


class WallZone(TypedDict):
    """Relief of a ninth of the far photo: how many points of the wall, median, spread. [mm]"""

    zone: str
    points: int
    median: float
    spread: float


class TieCells(TypedDict):
    """Of a photo: side of a square cell [px]; its column and row, ties, mean and RMS of misfits."""

    side: float
    rows: list[list[float]]


class CommonPoints(TypedDict, total=False):
    """The ties: how many, how many on the wall, and their misfits. [px]"""

    count: int
    rays: int
    on_wall: int
    sigma_px: float
    rms_px: float
    largest_px: float
    cells: list[TieCells]


class ControlResidual(TypedDict, total=False):
    """How a control point fits: in the photos [px] or on the wall of a set [m], and its test."""

    id: str
    residual_px: Sequence[float | None] | FloatArray
    off: Sequence[float | None]
    test: float | None
    used: bool


class CheckedLength(TypedDict):
    """A length that checks an orientation. [m]"""

    name: str
    taped: float
    measured: float
    sigma: float
    agrees: bool


class Diagnostics(TypedDict, total=False):
    """Standard deviations are by name for a pair, of a set a list with those of each camera."""

    way: str
    standard_deviations: Any
    sigma0: float
    focal_px: list[float]
    focal_given_px: list[float]
    principal_point_px: list[FloatArray]
    interior: list[str]
    common_points: CommonPoints
    radial: Any
    planes: list[dict[str, object]]
    facade_lines: list[dict[str, object]]
    wall_bend_px: float | None
    wall_bend_sigma_px: float | None
    wall_relief_mm: list[WallZone]
    assumed: Sequence[str]
    doubts: list[str]
    words: list[str]
    control: list[ControlResidual]
    lengths: list[Mapping[str, Any]]
    length_checks: list[CheckedLength]


def deviations_by_photo(setup: Diagnostics) -> list[dict[str, float | None]]:
    """Return the standard deviations that a pair's file states as a set's file names them."""
    keys = {"distance": "distance{}", "nadir": "nadir{}", "tilt_deg": "tilt{}_deg",
            "focal_px": "focal{}"}  # fmt: skip
    sigmas: Any = setup.get("standard_deviations", {})
    return [{key: sigmas.get(name.format(n)) for key, name in keys.items()} for n in (1, 2)]
