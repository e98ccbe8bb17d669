"""What can be said about an intersected point."""

from __future__ import annotations

from enum import IntEnum


class PointStatus(IntEnum):
    """Why a point is missing or doubtful; written to tables by its label."""

    OK = 0
    ONE_RAY = 1
    NO_RAY = 2
    BEHIND = 3
    NOT_CONVERGED = 4
    WEAK = 5
    GROSS_ERROR = 6

    @property
    def label(self) -> str:
        """The reason in words."""
        return _LABELS[self]


_LABELS = {
    PointStatus.OK: "ok",
    PointStatus.ONE_RAY: "seen by one camera only",
    PointStatus.NO_RAY: "not seen",
    PointStatus.BEHIND: "rays meet before the interface or behind a camera",
    PointStatus.NOT_CONVERGED: "not converged",
    PointStatus.WEAK: "rays nearly parallel",
    PointStatus.GROSS_ERROR: "rays do not meet",
}
