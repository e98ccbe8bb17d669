"""World coordinates from control points: roto-translation with scale, one bad point found out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bifocal.survey.reference import Georeference, KnownPoints, NamedPoints
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import GeometryError, InputError
from photocore.similarity import Similarity, fit_levelled, fit_plane, fit_similarity, round_origin

#: Chance of calling a good set of points bad, shared out over the points.
ALPHA = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class TransformationModel:
    """A kind of transformation: how many parameters, how many points it needs, how it is found."""

    name: str
    parameters: int
    needed: int
    axes: int
    fit: Callable[[FloatArray, FloatArray], Similarity]


MODELS: Mapping[str, TransformationModel] = {
    "2D": TransformationModel(name="2D", parameters=4, needed=2, axes=2, fit=fit_plane),
    "levelled": TransformationModel(
        name="levelled", parameters=5, needed=2, axes=3, fit=fit_levelled
    ),
    "3D": TransformationModel(name="3D", parameters=7, needed=3, axes=3, fit=fit_similarity),
}


def georeference(
    points: NamedPoints | Mapping[str, Any],
    control: KnownPoints | Mapping[str, Any],
    *,
    model: str = "auto",
) -> Georeference:
    """Find the roto-translation with scale from the wall to the world.

    Parameters
    ----------
    points : NamedPoints or mapping
        Solved points, e.g. the ``table`` of `bifocal.solve`, or columns ``id X Y Z`` of shape
        (n,). [m]
    control : KnownPoints or mapping
        Control points, names as in ``points``: columns ``id E N H`` of shape (m,); H may be blank
        everywhere for the model ``2D``. [m]
    model : {"auto", "levelled", "3D", "2D"}
        ``auto`` takes 2D without heights, else ``levelled`` (Y upright: the photos were levelled),
        unless the residuals say that it does not fit and three or more points allow ``3D``.

    Returns
    -------
    Georeference
        ``world_from_wall(xyz)`` gives E, N, H of shape (n, 3) [m]; with residuals, sigma0 and the
        names of points left out.

    Raises
    ------
    InputError
        If the model is unknown or columns differ in length.
    GeometryError
        If there are fewer points than the model needs, or they lie too badly.

    Notes
    -----
    A point is called bad when leaving it out lowers the sum of squares by more than chance allows
    (F test of the point's own coordinates against the rest, 1 % shared out over the points), worst
    first, and as long as the rest is still redundant.

    Examples
    --------
    A wall facing south, its origin at E 100 m, N 200 m, H 50 m:

    >>> wall = {"id": ["A", "B", "C"], "X": [0, 4, 4], "Y": [0, 0, 3], "Z": [0, 0, 0.5]}
    >>> known = {"id": ["A", "B", "C"], "E": [100, 104, 104], "N": [200, 200, 199.5],
    ...          "H": [50, 50, 53]}
    >>> placed = georeference(wall, known)
    >>> placed.model, (placed.world_from_wall([2, 1, 0]).round(6) + 0.0).tolist()
    ('levelled', [102.0, 200.0, 51.0])
    """
    if model != "auto" and model not in MODELS:
        raise InputError(f"georeference: model {model!r} is none of auto, {', '.join(MODELS)}.")
    if isinstance(points, Mapping):
        points = KnownPoints.from_columns(points, "XYZ")
    if isinstance(control, Mapping):
        control = KnownPoints.from_columns(control, "ENH")
    wall = control.coordinates_in(points)
    flat = bool(np.isnan(control.xyz[:, 2]).all())
    simplest = ("2D",) if flat else ("levelled", "3D")
    names = simplest if model == "auto" else (model,)
    usable = {
        name: control.used
        & ~np.isnan(wall).any(axis=1)
        & ~np.isnan(control.xyz[:, : MODELS[name].axes]).any(axis=1)
        for name in names
    }
    first = MODELS[names[0]]
    if usable[names[0]].sum() < first.needed:
        missing = control.missing_in(points)
        hint = f" Not among the measured points: {', '.join(missing[:5])}." if missing else ""
        raise GeometryError(
            f"Georeference: {int(usable[names[0]].sum())} usable control point(s), the model "
            f"{first.name} needs at least {first.needed} with relief and world coordinates.{hint}"
        )
    fuller = len(names) > 1 and usable["3D"].sum() >= MODELS["3D"].needed
    try:
        best = _robust(first, wall, control, usable[first.name])
    except GeometryError:
        if not fuller:
            raise
        best = _robust(MODELS["3D"], wall, control, usable["3D"])
    else:
        best = _fuller_if_better(best, wall, control, usable["3D"]) if fuller else best
    chosen, transformation, used, squares, redundancy = best
    flat_world = chosen.axes == 2
    origin = round_origin(
        np.where(flat_world, np.nan_to_num(control.xyz) * [1, 1, 0], control.xyz)[used]
    )
    origin = np.where(np.isnan(origin), 0.0, origin)
    near = np.where(flat_world, control.xyz * [1, 1, np.nan], control.xyz) - origin
    offset = near[used].mean(axis=0)
    if flat_world:
        offset[2] = transformation.target_centre[2]
    return Georeference(
        ids=control.ids,
        world_from_wall=transformation,
        model=chosen.name,
        residuals=residuals(transformation, wall, near, offset),
        solved=wall,
        used=used,
        bad=tuple(
            name
            for name, was, now in zip(control.ids, usable[chosen.name], used, strict=True)
            if was and not now
        ),
        sigma0=float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan"),
        redundancy=redundancy,
        origin=origin,
        offset=offset,
    )


_Fit = tuple[TransformationModel, Similarity, BoolArray, float, int]


def _fit(model: TransformationModel, wall: FloatArray, world: FloatArray, used: BoolArray) -> _Fit:
    """Return the fit to the chosen points with its sum of squares and redundancy."""
    target = world.copy()
    if model.axes == 2:
        target[:, 2] = 0.0
    transformation = model.fit(wall[used], target[used])
    # About a round origin, so that the sum of squares is not one of rounding errors.
    origin = round_origin(target[used])
    offset = (target[used] - origin).mean(axis=0)
    left = residuals(transformation, wall[used], target[used] - origin, offset)[:, : model.axes]
    redundancy = model.axes * int(used.sum()) - model.parameters
    return model, transformation, used, float((left**2).sum()), redundancy


def residuals(
    transformation: Similarity, wall: FloatArray, near: FloatArray, offset: FloatArray
) -> FloatArray:
    """Return known minus computed coordinates near an origin from which the centre lies offset."""
    turned = (wall - transformation.source_centre) @ transformation.rotation.T
    return np.asarray(near - (offset + transformation.scale * turned))


def _robust(
    model: TransformationModel, wall: FloatArray, control: KnownPoints, used: BoolArray
) -> _Fit:
    """Return the fit without the points that contradict the others."""
    best = _fit(model, wall, control.xyz, used)
    size = float(np.abs(control.xyz[used]).max())
    while True:
        *_, squares, redundancy = best
        left = redundancy - model.axes
        # Rounding noise of large coordinates is no contradiction.
        if left < 1 or np.sqrt(squares) < 1e-9 * size:
            return best
        trials = []
        for row in np.flatnonzero(best[2]):
            without = best[2].copy()
            without[row] = False
            try:
                trials.append(_fit(model, wall, control.xyz, without))
            except GeometryError:
                continue
        if not trials:
            return best
        lightest = min(trials, key=lambda trial: trial[3])
        floor = max(lightest[3], (1e-9 * size) ** 2)
        ratio = (squares - lightest[3]) / model.axes / (floor / left)
        if ratio < _limit(model.axes, left, ALPHA / len(trials)):
            return best
        best = lightest


def _fuller_if_better(
    simple: _Fit, wall: FloatArray, control: KnownPoints, used: BoolArray
) -> _Fit:
    """Return the 3D fit if it explains significantly more than the levelled one."""
    try:
        full = _robust(MODELS["3D"], wall, control, used)
    except GeometryError:
        return simple
    if simple[2].sum() < full[2].sum():
        return full  # the simple model had to throw out points that the fuller one keeps
    left = full[4]
    if left < 1:
        return simple
    extra = full[0].parameters - simple[0].parameters
    noise = (1e-9 * float(np.abs(control.xyz[used]).max())) ** 2
    ratio = (simple[3] - full[3]) / extra / max(full[3] / left, noise)
    return full if ratio > _limit(extra, left, ALPHA) else simple


def _limit(observations: int, redundancy: int, chance: float) -> float:
    """Return the F ratio that honest errors exceed with the given chance."""
    from scipy.special import fdtri  # a tenth of a second that only control points need

    return float(fdtri(observations, redundancy, 1 - chance))
