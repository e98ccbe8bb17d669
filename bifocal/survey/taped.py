"""One distance taped on site between two points: the cheapest check of a survey's scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.remarks import remark
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.remarks import SCALE_SHARE
from photocore.names import meant

#: Names of the cells it is typed in: both points, and how long. [m]
TAPE = ("tape_from", "tape_to", "tape_typed")
#: A scale is wrong by more than chance where the distances differ by more sigmas than this.
TAPED_SIGMAS = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TapedDistance:
    """A distance measured on site.

    Attributes
    ----------
    ends : tuple of str
        Names of the two points.
    length : float
        As taped. [m]
    """

    ends: tuple[str, str]
    length: float

    def compared(self, table: ReliefTable) -> TapedCheck:
        """Return the same distance as solved.

        The sigma counts the errors of both points as independent, those of a common orientation
        too, as the workbook does.
        """
        rows = {name: row for row, name in enumerate(table.ids)}
        blank = TapedCheck(tape=self, solved=np.nan, sigma=np.nan)
        ends = meant(self.ends, table.ids)
        if not all(name in rows for name in ends):
            return blank
        first, second = (rows[name] for name in ends)
        way = table.xyz[second] - table.xyz[first]
        solved, sigma = float(np.linalg.norm(way)), np.nan
        if table.covariance is not None and solved > 0:
            both = table.covariance[first] + table.covariance[second]
            sigma = float(np.sqrt(way @ both @ way)) / solved
        return TapedCheck(tape=self, solved=solved, sigma=sigma)


@dataclass(frozen=True, slots=True, kw_only=True)
class TapedCheck:
    """A taped distance beside the solved one.

    Attributes
    ----------
    tape : TapedDistance
        As measured on site.
    solved, sigma : float
        The same as solved, and its standard deviation; NaN where a point has no coordinates. [m]
    """

    tape: TapedDistance
    solved: float
    sigma: float

    @property
    def scale(self) -> float:
        """The solved distance over the taped one."""
        return self.solved / self.tape.length

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the user should know: a point that is none, a scale that is wrong."""
        about = {"first": self.tape.ends[0], "second": self.tape.ends[1]}
        if np.isnan(self.solved):
            return (remark("survey.tape_nowhere", **about),)
        off, beyond = self.solved - self.tape.length, TAPED_SIGMAS * np.nan_to_num(self.sigma)
        if abs(self.scale - 1) <= SCALE_SHARE or abs(off) <= beyond:
            return ()
        lengths = {"typed": self.tape.length, "solved": self.solved, "scale": self.scale}
        return (remark("survey.tape_off", **about, **lengths),)
