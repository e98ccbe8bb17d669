"""What an adjustment lacks: every extension by one step, ranked by what it would explain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f as fisher

from multimedia.adjustment.bundle import bundle_adjust
from multimedia.adjustment.bundle_equations import Bundle
from multimedia.adjustment.bundle_start import prepare
from multimedia.adjustment.interior_choice import choose_interior, with_interior
from multimedia.adjustment.start_poses import with_poses
from multimedia.adjustment.unknowns import AUTO, Unknowns
from multimedia.media import Camera
from multimedia.projects import Project
from photocore.adjustment.network import NetworkState
from photocore.errors import PhotogrammetryError

#: Terms of the lens that only make sense together, or each alone.
_LENS = (("c",), ("xh", "yh"), ("k1",), ("k2",), ("k3",), ("k4",), ("p1", "p2"), ("scale",),
         ("shear",))  # fmt: skip
#: The same of media; what else they have stands alone.
_TOGETHER = (("tilt1", "tilt2"), ("shift1", "shift2"), ("centreX", "centreY", "centreZ"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Extension:
    """What one more step of the model would bring.

    Attributes
    ----------
    what : str
        In words: ``plate p2 free``, ``k1``, ``index3``.
    option : str
        How the command line says it.
    unknowns : int
        How many it adds.
    sigma0 : float
        To which it would lower sigma0, to first order. [mm]
    chance : float
        How likely chance alone lowers the square sum as much (F test).
    """

    what: str
    option: str
    unknowns: int
    sigma0: float
    chance: float


def diagnose(project: Project, unknowns: Unknowns | None = None) -> tuple[float, list[Extension]]:
    """Rank what would lower the residuals of an adjustment most.

    Parameters
    ----------
    project : Project
    unknowns : Unknowns, optional
        What the adjustment estimates.

    Returns
    -------
    sigma0 : float
        As it is. [mm]
    extensions : list of Extension
        The best first; those that the data do not determine are left out.

    Raises
    ------
    InputError, GeometryError, ConvergenceError
        As `bundle_adjust`.

    Notes
    -----
    Score tests (Rao 1948): the residuals at the solution and the derivatives by the new unknowns
    tell, to first order, how far the square sum falls, without adjusting anew. Each is tried
    alone: two that explain the same stand both high, and after the first is taken the others have
    to be ranked again.
    """
    unknowns = unknowns or Unknowns()
    if unknowns.interior == AUTO:
        chosen = choose_interior(project, unknowns, bundle_adjust)
        unknowns = with_interior(unknowns, chosen)
    project, _ = with_poses(project, unknowns)
    bundle, _ = prepare(project, unknowns)
    fitted = bundle.network.solve(bundle.start)
    cost = float(fitted.residuals @ fitted.residuals)
    unit = float(np.sqrt(np.mean(bundle.observations.sigma**2)))
    trials = []
    for what, option, wider in _candidates(project, unknowns):
        try:
            tried, _ = prepare(project, wider)
        except PhotogrammetryError:  # it does not make sense for this project
            continue
        more = len(tried.columns.labels) - len(bundle.columns.labels)
        linear = tried.network.equations(_at_solution(bundle, fitted.state, tried))
        redundancy = fitted.redundancy - more
        if (
            more < 1
            or linear is None
            or redundancy < 1
            or linear.undetermined([*tried.columns.labels, *tried.network.names])
        ):
            continue
        rest = linear.residuals + linear.change(linear.step(0.0))
        cost_left = min(float(rest @ rest), cost)
        ratio = (cost - cost_left) / more / max(cost_left / redundancy, 1e-300)
        trials.append(
            Extension(
                what=what, option=option, unknowns=more,
                sigma0=unit * float(np.sqrt(cost_left / redundancy)),
                chance=float(fisher.sf(ratio, more, redundancy)),
            )
        )  # fmt: skip
    return fitted.sigma0 * unit, sorted(trials, key=lambda extension: extension.sigma0)


def _candidates(project: Project, unknowns: Unknowns) -> Iterator[tuple[str, str, Unknowns]]:
    """Yield what may be added, how the command line says it, and the unknowns with it."""
    groups = Counter(group for group in project.object_points.groups if group)
    for name, count in groups.items():
        if name not in unknowns.plates and count >= 3:
            wider = (*unknowns.plates, name)
            yield f"plate {name} free", f"--plate {name}", replace(unknowns, plates=wider)
    lens = {name for camera in project.cameras for name in camera.interior_names}
    for terms in _LENS:
        if set(terms) <= lens - set(unknowns.interior):
            interior = (*unknowns.interior, *terms)
            words = ",".join(terms)
            yield words, f"--interior {words}", replace(unknowns, interior=interior)
    estimated = {label.rpartition(":")[2] for label in unknowns.media}
    parameters = dict.fromkeys(
        name for m in project.media.values() if m for name in m.parameter_names
    )
    pairs: list[tuple[str, ...]] = [names for names in _TOGETHER if set(names) <= set(parameters)]
    alone: list[tuple[str, ...]] = [
        (name,) for name in parameters if not any(name in names for names in pairs)
    ]
    for names in pairs + alone:
        # The first medium is the air, or the camera's own.
        if not estimated & set(names) and names != ("index1",):
            words = ",".join(names)
            yield words, f"--media {words}", replace(unknowns, media=(*unknowns.media, *names))


def _at_solution(bundle: Bundle, state: NetworkState, tried: Bundle) -> NetworkState:
    """Return the state of a wider network in which nothing has moved yet."""
    plates = dict(zip(bundle.unknowns.plates, state.blocks["plate"].values(), strict=True))
    # The points of a plate that is freed are where they were: no turn, no shift.
    still = Camera(centre=np.zeros(3), rotation=np.eye(3), principal_distance=1.0)
    poses = {k: plates.get(name, still) for k, name in enumerate(tried.unknowns.plates)}
    drift = dict(zip(bundle.columns.labels, state.drift.tolist(), strict=True))
    return replace(
        tried.start, points=state.points,
        blocks={"camera": state.blocks["camera"], "media": state.blocks["media"], "plate": poses},
        drift=np.array([drift.get(label, 0.0) for label in tried.columns.labels]),
    )  # fmt: skip
