"""Surveyed points as they leave the survey: names, coordinates, precision, flags."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress
from typing import Any, NamedTuple

import numpy as np

from photocore.arrays import BoolArray, FloatArray, as_floats
from photocore.errors import InputError
from photocore.plots import Drawable
from photocore.tables.csvwrite import Columns

#: Columns of each array of a set of points; 0 for one number per point.
_WIDTHS = {
    "xyz": 3, "world": 3, "sigma_r": 0, "sigma_xy": 2, "sigma_world": 3, "cov_xy": 0, "cov_en": 0
}  # fmt: skip
#: The error ellipse of one sigma: half axes [m], direction of the longer, clockwise from +Y [deg].
_ELLIPSE = ("ellipse_a", "ellipse_b", "ellipse_azimuth")


class PointLine(NamedTuple):
    """A polyline on a layer of the drawing: through points by their names, or through places."""

    name: str
    layer: str
    ids: tuple[str, ...]
    closed: bool = False
    places: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points(Drawable):
    """Points of a wall with their precision: what `solve`, `intersect` and tables give.

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
    sigma_xy, sigma_world : ndarray, shape (n, 2) and (n, 3), or None
        Standard deviations of X, Y and of E, N, H; NaN or None where unknown. [m]
    cov_xy, cov_en : ndarray, shape (n,), or None
        Covariance of X with Y and of E with N. [m²]
    name : str
        Where they come from, for messages.
    """

    ids: tuple[str, ...]
    xyz: FloatArray
    world: FloatArray | None = None
    sigma_r: FloatArray
    flags: tuple[str, ...]
    notes: tuple[str, ...]
    sigma_xy: FloatArray | None = None
    sigma_world: FloatArray | None = None
    cov_xy: FloatArray | None = None
    cov_en: FloatArray | None = None
    name: str = "points"

    def __post_init__(self) -> None:
        count = len(self.ids)
        for name, width in _WIDTHS.items():
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

    def ellipses(self, *, world: bool = False) -> FloatArray:
        """Return the error ellipses in X, Y, or in E, N, shape (n, 3).

        Returns
        -------
        ndarray, shape (n, 3)
            Half axes of one sigma, the longer first [m], and the direction of the longer, clockwise
            from +Y or north [deg]; NaN where it is not known.
        """
        sigma = self.sigma_world if world else self.sigma_xy
        mixed = self.cov_en if world else self.cov_xy
        if sigma is None or mixed is None:
            return np.full((len(self), 3), np.nan)
        xx, yy = sigma[:, 0] ** 2, sigma[:, 1] ** 2
        middle, spread = (xx + yy) / 2, np.hypot((xx - yy) / 2, mixed)
        # Where a circle's direction is anybody's, north is as good as any.
        direction = np.degrees(np.arctan2(2 * mixed, yy - xx)) / 2 % 180
        long = np.sqrt(middle + spread)
        # Errors along one line leave a short axis of rounding, which must not make it vanish.
        short = np.sqrt(np.maximum(middle - spread, (1e-5 * long) ** 2))
        return np.stack([long, short, direction], axis=-1)

    @property
    def sigmas(self) -> dict[str, FloatArray]:
        """The standard deviations by name, ``sigma_X`` to ``sigma_H``; NaN where unknown. [m]"""
        blank = np.full((len(self), 3), np.nan)
        xy = blank if self.sigma_xy is None else self.sigma_xy
        world = blank if self.sigma_world is None else self.sigma_world
        columns = {f"sigma_{axis}": xy[:, i] for i, axis in enumerate("XY")}
        columns["sigma_r"] = self.sigma_r
        return columns | {f"sigma_{axis}": world[:, i] for i, axis in enumerate("ENH")}

    def to_dataframe(self) -> Any:
        """Return a table with a row for each point, as pandas knows it. [m]

        Columns ``X Y r``, of a georeferenced survey ``E N H``, the standard deviations that are
        known, ``flag`` and ``note``; the index are the names.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise InputError("pandas is not installed: pip install pandas") from None
        columns: Columns = dict(zip(("X", "Y", "r"), self.xyz.T, strict=True))
        if self.world is not None:
            columns |= dict(zip("ENH", self.world.T, strict=True))
        columns |= {key: values for key, values in self.sigmas.items() if np.isfinite(values).any()}
        columns |= {"flag": self.flags, "note": self.notes}
        return pandas.DataFrame(columns, index=pandas.Index(self.ids, name="id"))

    def to_geojson(self, *, world: bool = False) -> dict[str, object]:
        """Return a GeoJSON FeatureCollection in metres (a local frame, not longitudes).

        Parameters
        ----------
        world : bool
            E, N, H in place of X, Y, r.

        Raises
        ------
        InputError
            If the points have no world coordinates, or one lacks its place.
        """
        coordinates = self.world if world else self.xyz
        if coordinates is None:
            raise InputError(f"{self.name}: has no world coordinates; leave out world=True.")
        placed: BoolArray = np.asarray(np.isfinite(coordinates).all(axis=1))
        ellipses = self.ellipses(world=world)
        numbers = {
            "relief": self.xyz[:, 2],
            **self.sigmas,
            **{key: ellipses[:, i] for i, key in enumerate(_ELLIPSE)},
        }
        features = [
            {
                "type": "Feature",
                "id": self.ids[i],
                "geometry": {"type": "Point", "coordinates": place} if placed[i] else None,
                "properties": {
                    "id": self.ids[i],
                    **{
                        key: float(values[i]) if np.isfinite(values[i]) else None
                        for key, values in numbers.items()
                    },
                    "flag": self.flags[i],
                    "note": self.notes[i],
                },
            }
            for i, place in enumerate(np.round(coordinates, 6).tolist())
        ]
        # GeoJSON knows only longitude and latitude; the older "crs" member says these are not.
        crs = {"type": "name", "properties": {"name": "local engineering frame, metres"}}
        return {"type": "FeatureCollection", "crs": crs, "features": features}

    def _draw(self, axes: Any) -> None:
        drawn = axes.scatter(*self.xyz[:, :2].T, c=self.xyz[:, 2], s=12)
        axes.set(xlabel="X [m]", ylabel="Y [m]", aspect="equal")
        axes.figure.colorbar(drawn, ax=axes, label="r [m]")

    def take(self, keep: BoolArray) -> Points:
        """Return the points where ``keep`` is true."""
        kept: dict[str, Any] = {name: getattr(self, name) for name in _WIDTHS}
        kept = {name: None if v is None else v[keep] for name, v in kept.items()}
        return Points(
            ids=tuple(compress(self.ids, keep)),
            **kept,
            flags=tuple(compress(self.flags, keep)),
            notes=tuple(compress(self.notes, keep)),
            name=self.name,
        )
