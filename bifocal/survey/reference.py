"""Points known from outside: check points on the wall and control points in the world."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from bifocal.model import WorldFrame
from bifocal.remarks import remark
from bifocal.survey.tolerances import Verdict
from bifocal.survey.transformation_precision import TransformationPrecision
from photocore.arrays import BoolArray, FloatArray, IntArray, as_floats
from photocore.camera import Similarity
from photocore.errors import InputError
from photocore.names import meant
from photocore.series import check_index


class NamedPoints(Protocol):
    """Anything with names and coordinates, shape (n, 3)."""

    @property
    def ids(self) -> tuple[str, ...]:
        """Names."""

    @property
    def xyz(self) -> FloatArray:
        """Coordinates. [m]"""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownPoints:
    """Names with coordinates; NaN where a cell was blank.

    Attributes
    ----------
    ids : tuple of str, length n
        Names, as in the table of measured points.
    xyz : ndarray, shape (n, 3)
        X, Y, Z on the wall, or E, N, H in the world. [m]
    use : ndarray of bool, shape (n,)
        False for points that are listed but take no part.
    """

    ids: tuple[str, ...] = ()
    xyz: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    use: BoolArray | None = None

    def __post_init__(self) -> None:
        n = len(self.ids)
        xyz = np.array(self.xyz, dtype=np.float64).reshape(-1, 3)
        use = np.ones(n, dtype=bool) if self.use is None else np.array(self.use, dtype=bool)
        if len(xyz) != n or len(use) != n:
            raise InputError(f"{n} names, {len(xyz)} points and {len(use)} marks do not match.")
        object.__setattr__(self, "xyz", xyz)
        object.__setattr__(self, "use", use)

    @classmethod
    def from_columns(cls, columns: Mapping[str, Any], axes: str) -> KnownPoints:
        """Return the points of columns by key: ``id`` and one of shape (n,) for each axis. [m]"""
        check_index("points", *columns.values())
        names = tuple(map(str, columns.get("id", ())))
        blank = np.full(len(names), np.nan)
        xyz = [as_floats(columns.get(axis, blank), axis) for axis in axes]
        uneven = [
            axis for axis, column in zip(axes, xyz, strict=True) if column.shape != blank.shape
        ]
        if uneven:
            raise InputError(f"{uneven[0]}: expected {len(names)} values, one for each id.")
        return cls(ids=names, xyz=np.stack(xyz, axis=-1))

    def __len__(self) -> int:
        return len(self.ids)

    def rows_in(self, points: NamedPoints) -> IntArray:
        """Return the row of each name among other points, -1 where it is not there, shape (n,)."""
        place = {name: row for row, name in enumerate(points.ids)}
        return np.array([place.get(name, -1) for name in self.ids], dtype=np.int64)

    def coordinates_in(self, points: NamedPoints) -> FloatArray:
        """Return the coordinates of the same names among other points, NaN if absent, (n, 3)."""
        with_blank = np.vstack([points.xyz, np.full((1, 3), np.nan)])
        return np.asarray(with_blank[self.rows_in(points)])

    def missing_in(self, points: NamedPoints) -> tuple[str, ...]:
        """Return the names that are not among other points."""
        names = set(points.ids)
        return tuple(name for name in self.ids if name not in names)

    def called_as(self, names: Collection[str]) -> KnownPoints:
        """Return the same points under these names where leading zeros or capitals differ."""
        ids = meant(self.ids, names)
        return self if len(set(ids)) < len(ids) else replace(self, ids=tuple(ids))

    def without(self, names: Collection[str]) -> KnownPoints:
        """Return the same points, those of these names listed but not used."""
        kept = np.array([name not in names for name in self.ids], dtype=bool)
        return self if kept.all() else replace(self, use=self.used & kept)

    @property
    def used(self) -> BoolArray:
        """`use` as an array, shape (n,)."""
        assert self.use is not None
        return self.use


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisErrors:
    """Statistics of the errors of one axis; NaN where there is none. [m]"""

    n: int
    rmse: float
    mean: float
    max_abs: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CheckResult:
    """Errors at check points.

    Attributes
    ----------
    ids : tuple of str, length n
        Names in the order of the `Check` sheet.
    solved : ndarray, shape (n, 3)
        Solved X, Y, Z; NaN where the point was not measured. [m]
    errors : ndarray, shape (n, 3)
        Found minus known; NaN where either is missing or the point is not used. [m]
    axes : mapping of str to AxisErrors
        Statistics for ``"X"``, ``"Y"``, ``"Z"``.
    verdicts : tuple of Verdict
        The largest RMSE of the axes against every rule and scale; empty without check points.
    missing : tuple of str
        Check points that were not measured.
    flagged : mapping of str to str
        Check points that are not counted for their flag: name to flag.
    standardised : ndarray, shape (n, 3)
        Errors over the standard deviations of the solved coordinates; NaN where either is missing.
    """

    ids: tuple[str, ...]
    solved: FloatArray
    errors: FloatArray
    axes: Mapping[str, AxisErrors]
    verdicts: tuple[Verdict, ...]
    missing: tuple[str, ...]
    flagged: Mapping[str, str] = field(default_factory=dict)
    standardised: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the user should know about the names, and points that are not counted."""
        sentences: list[str] = []
        if self.missing:
            sentences.append(remark("survey.no_such_check", names=", ".join(self.missing[:10])))
        if self.flagged:
            named = ", ".join(f"{name} ({flag})" for name, flag in list(self.flagged.items())[:10])
            sentences.append(remark("survey.flagged_check", count=len(self.flagged), names=named))
        return tuple(sentences)

    @property
    def accuracy(self) -> float:
        """The largest RMSE of the three axes; NaN without check points. [m]"""
        values = [axis.rmse for axis in self.axes.values() if axis.n]
        return max(values, default=float("nan"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Georeference:
    """A wall placed in the world.

    Attributes
    ----------
    ids : tuple of str, length n
        Control points in the order given.
    world_from_wall : Similarity
        X, Y, Z on the wall to E, N, H.
    model : str
        ``"2D"``, ``"levelled"`` or ``"3D"``; ``"frame"``: the pair's own control points were E, N,
        H.
    residuals : ndarray, shape (n, 3)
        Known minus computed E, N, H, also of points left out; NaN where unknown. [m]
    solved : ndarray, shape (n, 3)
        Solved X, Y, Z of the control points. [m]
    used : ndarray of bool, shape (n,)
        Points the transformation rests on.
    bad : tuple of str
        Points the program left out because they contradict the others.
    sigma0 : float
        Standard deviation of a coordinate from the residuals; NaN without redundancy. [m]
    error_ratio : float
        Residuals over what the picks' precision lets expect; NaN where that or redundancy lacks.
    redundancy : int
        Observations minus parameters.
    origin, offset : ndarray, shape (3,)
        Whole-metre origin of the world coordinates and where the centre lies from it: with them
        differences of large coordinates lose no digits. [m]
    covariance : ndarray, shape (n, 3, 3), or None
        Of X, Y, Z of the control points, as solved. [m²]
    near : ndarray, shape (n, 3)
        E, N, H of the control points about ``origin``; H is 0 for the model 2D. [m]
    precision : TransformationPrecision or None
        What the transformation is worth.
    """

    ids: tuple[str, ...]
    world_from_wall: Similarity
    model: str
    residuals: FloatArray
    solved: FloatArray
    used: BoolArray
    bad: tuple[str, ...]
    sigma0: float
    redundancy: int
    origin: FloatArray
    offset: FloatArray
    error_ratio: float = float("nan")
    covariance: FloatArray | None = None
    near: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    precision: TransformationPrecision | None = None

    @classmethod
    def of_frame(cls, frame: WorldFrame) -> Georeference:
        """Return the place of a wall whose plane frame was made of E, N, H; it rests on no fit."""
        none, whole = np.zeros((0, 3)), np.floor(frame.origin)
        place = Similarity(
            scale=1.0, rotation=frame.axes.T, source_centre=np.zeros(3), target_centre=frame.origin
        )
        return cls(
            ids=(), world_from_wall=place, model="frame", residuals=none, solved=none,
            used=np.zeros(0, dtype=bool), bad=(), sigma0=np.nan, redundancy=0, origin=whole,
            offset=frame.origin - whole,
        )  # fmt: skip

    def covariance_of(
        self,
        xyz: FloatArray,
        covariance: FloatArray,
        *,
        ids: Sequence[str] = (),
        effect: FloatArray | None = None,
    ) -> FloatArray:
        """Return the covariance of E, N, H of points on the wall, shape (n, 3, 3). [m²]

        Parameters
        ----------
        xyz : ndarray, shape (n, 3)
            Points on the wall. [m]
        covariance : ndarray, shape (n, 3, 3)
            Of X, Y, Z, independent from point to point: of the picks. [m²]
        ids : sequence of str, length n, optional
            Their names: a point that the transformation rests on shares its error with it.
        effect : ndarray, shape (n, 3, k), optional
            What independent errors common to all points move them by. [m]

        Notes
        -----
        With A the derivative of a placed point by the transformation and K its covariance, the
        result is ``C + A K A'``, for control points ``C - A K A'``. The control points count as
        exact. H of the model 2D is relief at the scale of the plan.
        """
        turn = self.world_from_wall.scale * self.world_from_wall.rotation
        near = self.near_of(xyz)
        if self.precision is None:
            return np.asarray(turn @ covariance @ turn.T)
        added = self.precision.of_points(near)
        rests_on = {name for name, used in zip(self.ids, self.used, strict=True) if used}
        controls = np.array([name in rests_on for name in ids], dtype=bool)
        if controls.any():
            flat = self.model == "2D"
            added[controls] *= np.where(np.outer([0, 0, flat], [0, 0, flat]), 1.0, -1.0)
        out = turn @ covariance @ turn.T + added
        if effect is not None:
            out += self.common(near, effect)
        return np.asarray(out)

    def near_of(self, xyz: FloatArray) -> FloatArray:
        """Return E, N, H of points on the wall from `origin`, shape (n, 3). [m]"""
        turn = self.world_from_wall.scale * self.world_from_wall.rotation
        return np.asarray(self.offset + (xyz - self.world_from_wall.source_centre) @ turn.T)

    def common(self, near: FloatArray, effect: FloatArray) -> FloatArray:
        """Return what errors common to all points still add once placed, shape (n, 3, 3). [m²]

        Parameters
        ----------
        near : ndarray, shape (n, 3)
            E, N, H about `origin`. [m]
        effect : ndarray, shape (n, 3, k)
            What they move the points by on the wall. [m]
        """
        assert self.precision is not None
        turn = self.world_from_wall.scale * self.world_from_wall.rotation
        moved = turn @ effect - self.precision.moved_by_orientation(near)
        return np.asarray(moved @ moved.transpose(0, 2, 1))
