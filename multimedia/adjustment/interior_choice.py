"""Which interior parameters the geometry of a project carries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from multimedia.adjustment.plausibility import significance
from multimedia.adjustment.unknowns import Adjustment, Unknowns
from multimedia.projects.model import Project
from photocore.errors import ConvergenceError, GeometryError

#: Tried in this order, from what matters most in an ordinary lens; those in one group together.
GROUPS = (("c",), ("xh", "yh"), ("k1",), ("k2",), ("p1", "p2"), ("scale",), ("shear",), ("k3",))
#: Risk of taking a parameter that is not needed; each of the eight groups is a trial.
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
        Its ``interior`` is not looked at.
    adjust : callable
        Adjusts a project.
    """
    taken: tuple[str, ...] = ()
    for group in GROUPS:
        trial = (*taken, *group)
        try:
            result = adjust(project, replace(unknowns, interior=trial))
        except (GeometryError, ConvergenceError):
            continue
        if _needed(project, result, group):
            taken, last = trial, result
    for group in reversed(GROUPS):
        if set(group) <= set(taken) and not _needed(project, last, group):
            taken = tuple(name for name in taken if name not in group)
            last = adjust(project, replace(unknowns, interior=taken))
    return taken


def _needed(project: Project, result: Adjustment, group: tuple[str, ...]) -> bool:
    """Return whether a parameter of the group differs from its start values beyond chance."""
    for name in group:
        labels = [label for label in result.names if label.rpartition(":")[2] == name]
        starts = [_start(project, label) for label in labels]
        if labels and significance(result, labels, starts) < RISK:
            return True
    return False


def _start(project: Project, label: str) -> float:
    """Return the start value of an interior parameter; that of a shared one is the first's."""
    owner, _, name = label.rpartition(":")
    number = project.camera_index(owner) if owner in project.camera_names else 0
    return float(project.cameras[number].value(name))
