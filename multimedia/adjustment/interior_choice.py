"""Which interior parameters the geometry of a project carries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from multimedia.adjustment.bundle_columns import interior_group
from multimedia.adjustment.plausibility import significance
from multimedia.adjustment.unknowns import Adjustment, Unknowns
from multimedia.media import ANY_INTERIOR
from multimedia.projects import Project
from photocore.errors import ConvergenceError, GeometryError

#: Tried in this order, from what matters most in an ordinary lens; those in one group together.
GROUPS = (
    ("c",),
    ("xh", "yh"),
    ("k1",),
    ("k2",),
    ("p1", "p2"),
    ("scale",),
    ("shear",),
    ("k3",),
    ("k4",),
)
#: Risk of taking a parameter that is not needed; each of the nine groups is a trial.
RISK = 0.001


def choose_interior(
    project: Project, unknowns: Unknowns, adjust: Callable[[Project, Unknowns], Adjustment]
) -> tuple[str, ...]:
    """Return the interior parameters that the data determine and need.

    A group is taken if the adjustment with it succeeds with possible media and a member differs
    from the values given by more than chance, by its sigma of that adjustment: what can hardly be
    told apart from another unknown has a large one. In the end groups that the later ones have
    made needless go again, the last first.

    Parameters
    ----------
    project : Project
    unknowns : Unknowns
        Its ``interior`` is not looked at; priors of interior parameters hold where these are tried.
    adjust : callable
        Adjusts a project.
    """
    accepted: tuple[str, ...] = ()
    for group in GROUPS:
        if not any(set(group) <= set(camera.interior_names) for camera in project.cameras):
            continue
        trial = (*accepted, *group)
        try:
            result = adjust(project, with_interior(unknowns, trial))
        except (GeometryError, ConvergenceError):
            continue
        if _needed(project, unknowns, result, group):
            accepted, last = trial, result
    for group in reversed(GROUPS):
        if set(group) <= set(accepted) and not _needed(project, unknowns, last, group):
            accepted = tuple(name for name in accepted if name not in group)
            last = adjust(project, with_interior(unknowns, accepted))
    return accepted


def with_interior(unknowns: Unknowns, interior: tuple[str, ...]) -> Unknowns:
    """Return unknowns with these interior parameters, without the priors of others."""
    left_out = set(ANY_INTERIOR) - set(interior)
    priors = {
        label: sigma
        for label, sigma in unknowns.priors.items()
        if label.rpartition(":")[2] not in left_out
    }
    return replace(unknowns, interior=interior, priors=priors)


def _needed(
    project: Project, unknowns: Unknowns, result: Adjustment, group: tuple[str, ...]
) -> bool:
    """Return whether a parameter of the group differs from its start values beyond chance."""
    for name in group:
        labels = [label for label in result.names if label.rpartition(":")[2] == name]
        starts = [_start(project, unknowns, label) for label in labels]
        if labels and significance(result, labels, starts) < RISK:
            return True
    return False


def _start(project: Project, unknowns: Unknowns, label: str) -> float:
    """Return the start value of an interior parameter; a set that cameras share has the mean."""
    owner, _, name = label.rpartition(":")
    group = [
        camera.value(name)
        for camera in project.cameras
        if interior_group(camera.name, unknowns.shared_interior) == owner
    ]
    return float(np.mean(group))
