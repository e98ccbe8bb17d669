"""What can be said about an intersected point."""

from __future__ import annotations

from photocore.labelled import LabelledCode


class PointStatus(LabelledCode):
    """Why a point is missing or doubtful; written to tables by its label."""

    OK = 0, "ok"
    ONE_RAY = 1, "seen by one camera only"
    NO_RAY = 2, "not seen"
    BEHIND = 3, "rays meet before the interface or behind a camera"
    NOT_CONVERGED = 4, "not converged"
    WEAK = 5, "rays nearly parallel"
    GROSS_ERROR = 6, "rays do not meet"
