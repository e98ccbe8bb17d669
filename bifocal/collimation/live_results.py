"""Results of the points as they are picked: the survey's own solver, point by point."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bifocal.collimation.records import PickedPoint, Picks
from bifocal.model import FlagLimits, Pair
from bifocal.survey import PointObservations, ReliefTable, SurveySetup, solve_points
from photocore.arrays import FloatArray
from photocore.jsonfile import plain

_KEYS = {"s1": "s1_used", "s2": "s2_used", "delta_s": "ds"} | {
    key: key for key in ("e1", "e2", "r", "X", "Y", "Z", "sigma_X", "sigma_Y", "sigma_r")
}


def observations(points: Iterable[PickedPoint]) -> PointObservations:
    """Return points as the survey's solver takes them; NaN where a photo is not picked."""
    listed = list(points)
    nowhere = (np.nan, np.nan)
    return PointObservations(
        ids=tuple(point.name for point in listed),
        pixels1=np.array([p.picks[0] or nowhere for p in listed]).reshape(-1, 2),
        pixels2=np.array([p.picks[1] or nowhere for p in listed]).reshape(-1, 2),
        # What is picked in one photo only takes no part yet.
        use=np.array([p.use and p.is_complete for p in listed], dtype=bool),
        code=tuple(p.code for p in listed),
        note=tuple(p.note for p in listed),
    )


#: What results follow from.
_Key = tuple[Picks, bool]


def _key(point: PickedPoint) -> _Key:
    return point.picks, point.type == "doubtful"


@dataclass(slots=True, eq=False)
class LiveResults:
    """Results of complete points, kept until their picks change.

    Parameters
    ----------
    pair : Pair
    sigma_px : float or None
        Precision of a pick; default the pair's own, else 0.5. [px]
    limits : FlagLimits
        Where the flags begin.
    setup : SurveySetup or None
        The ideal set-up of a workbook that is the pair itself; it is solved by radial distances.
    """

    pair: Pair
    sigma_px: float | None = None
    limits: FlagLimits = field(default_factory=FlagLimits)
    setup: SurveySetup | None = None
    _rows: dict[_Key, dict[str, Any]] = field(default_factory=dict, init=False)

    def solve(self, points: Iterable[PickedPoint]) -> None:
        """Solve all points whose picks are new, at once."""
        new = list({_key(p): p for p in points if p.is_complete and _key(p) not in self._rows}
                   .values())  # fmt: skip
        if not new:
            return
        table = self.solved(observations(new))
        for row, point in enumerate(new):
            misfit = table.of_pixels.get("misfit_px")
            self._rows[_key(point)] = plain(
                {key: float(table[column][row]) for key, column in _KEYS.items()}
                | {
                    "flag": table.flags[row],
                    "misfit_px": None if misfit is None else float(misfit[row]),
                    "uncertain_area": table.flags[row] in ("UNCERTAIN", "NADIR")
                    and point.type != "doubtful",
                }
            )

    def solved(self, seen: PointObservations) -> ReliefTable:
        """Return points solved that are given by pixels."""
        if self.setup is None:
            return solve_points(self.pair, seen, sigma_px=self.sigma_px, limits=self.limits)
        typed = replace(seen, xy1=seen.pixels1, xy2=seen.pixels2)
        measured = self.setup.in_millimetres(typed)
        return solve_points(self.setup.pair(), measured, limits=self.limits)

    def row(self, point: PickedPoint) -> Mapping[str, Any] | None:
        """Return a point's results: lengths on the photos in mm, on the wall in m."""
        self.solve([point])
        return self._rows.get(_key(point))

    def joint(self, points: Sequence[PickedPoint]) -> tuple[FloatArray, FloatArray]:
        """Return X, Y, r of complete points [m], shape (n, 3), and their covariance together [m²].

        Shape (3 n, 3 n), NaN where it is not known.
        """
        return self.joint_of(observations(points))

    def joint_of(self, points: PointObservations) -> tuple[FloatArray, FloatArray]:
        """Return X, Y, r of picks [m], shape (n, 3), and their covariance together [m²]."""
        table = self.solved(points)
        size = 3 * len(table.xyz)
        joint = table.joint_covariance(range(len(table.xyz)))
        return table.xyz, np.full((size, size), np.nan) if joint is None else joint
