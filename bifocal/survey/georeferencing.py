"""World coordinates from control points: roto-translation with scale, one bad point found out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bifocal.survey.reference import Georeference, KnownPoints, NamedPoints
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.transformation_precision import TransformationPrecision, precision_of
from bifocal.survey.weighted_similarity import WeightedFit, weighted_fit, weights_of
from photocore.arrays import BoolArray, FloatArray, as_floats
from photocore.camera import Similarity, fit_levelled, fit_plane, fit_similarity, round_origin
from photocore.errors import GeometryError, InputError

#: Chance of calling an upright wall leaning.
ALPHA = 0.01
#: Chance of calling a good point bad, shared out over the points: names are blamed last.
ALPHA_POINT = 0.001


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
    points: NamedPoints | Mapping[str, Sequence[Any] | FloatArray],
    control: KnownPoints | Mapping[str, Sequence[Any] | FloatArray],
    *,
    model: str = "auto",
    covariance: FloatArray | None = None,
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
        unless a test says that it does not fit and three or more points allow ``3D``.
    covariance : ndarray, shape (n, 3, 3), optional
        Of the points' X, Y, Z, independent from point to point; default that of the picks of the
        solved ``table``, else all points weigh the same. Points without it take no part. [m²]

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
    Each point weighs by its full covariance: next to the nadir, or where the two lenses are nearly
    alike, relief is far less precise than X and Y, and a point UNCERTAIN in relief still says
    where the wall stands. The control points count as exact. What the photos' orientation itself
    is worth moves all points together and most of it is taken up by the fit: it weighs nothing, but
    is in the precision of every point placed.

    What does not fit is explained by one thing after the other, as long as an F test calls it
    significant and the rest is redundant: that the wall leans (at 1 %; ``auto`` only, 3D for
    levelled), or that one point is bad (at 0.1 %, shared out over the points: geometry is blamed
    before names). Of several explanations the one that chance explains least is taken.

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
    measured = _measured_control(points, control, covariance)
    flat = bool(np.isnan(measured.world[:, 2]).all())
    simplest = ("2D",) if flat else ("levelled", "3D")
    names = simplest if model == "auto" else (model,)
    first = MODELS[names[0]]
    usable = {name: measured.usable(MODELS[name]) for name in names}
    if usable[first.name].sum() < first.needed:
        hint = f" Not among the measured points: {', '.join(measured.missing[:5])}."
        raise GeometryError(
            f"Georeference: {int(usable[first.name].sum())} usable control point(s), the model "
            f"{first.name} needs at least {first.needed} with relief and world coordinates."
            f"{hint if measured.missing else ''}"
        )
    fuller = len(names) > 1 and usable["3D"].sum() >= MODELS["3D"].needed
    try:
        best = _fit(measured, first, usable[first.name])
    except GeometryError:
        if not fuller:
            raise
        best, fuller = _fit(measured, MODELS["3D"], usable["3D"]), False
    best = _explained(measured, best, fuller=fuller)
    return _as_georeference(measured, best, usable[best.model.name])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _MeasuredControl:
    """Control points on the wall and in the world, shape (n, 3), with weights or without."""

    ids: tuple[str, ...]
    wall: FloatArray
    world: FloatArray
    covariance: FloatArray | None
    effect: FloatArray | None
    used: BoolArray
    missing: tuple[str, ...]

    def usable(self, model: TransformationModel) -> BoolArray:
        """Return which points have all that the model needs."""
        complete: BoolArray = self.used & ~np.isnan(self.wall).any(axis=1)
        complete &= ~np.isnan(self.world[:, : model.axes]).any(axis=1)
        if self.covariance is not None:
            complete &= np.isfinite(self.covariance[:, : model.axes, : model.axes]).all(axis=(1, 2))
        return complete


def _measured_control(
    points: NamedPoints | Mapping[str, Sequence[Any] | FloatArray],
    control: KnownPoints | Mapping[str, Sequence[Any] | FloatArray],
    covariance: FloatArray | None,
) -> _MeasuredControl:
    """Return what was measured and what is known of the same names."""
    solved = points if isinstance(points, ReliefTable) and covariance is None else None
    if solved is not None:
        covariance = solved.own_covariance
    if isinstance(points, Mapping):
        points = KnownPoints.from_columns(points, "XYZ")
    if isinstance(control, Mapping):
        control = KnownPoints.from_columns(control, "ENH")
    if covariance is not None:
        covariance = as_floats(covariance, "covariance")
        if covariance.shape != (len(points.ids), 3, 3):
            raise InputError(
                f"covariance: shape {covariance.shape}, expected ({len(points.ids)}, 3, 3)."
            )
        blank = np.full((1, 3, 3), np.nan)
        covariance = np.concatenate([covariance, blank])[control.rows_in(points)]
    wall = control.coordinates_in(points)
    return _MeasuredControl(
        ids=control.ids,
        wall=wall,
        world=control.xyz,
        covariance=covariance,
        effect=None if solved is None else solved.effect_of_orientation(control.rows_in(points)),
        used=control.used,
        missing=control.missing_in(points),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _FittedTransformation:
    """A transformation with the points it rests on, and how well it fits them."""

    model: TransformationModel
    used: BoolArray
    transformation: Similarity
    origin: FloatArray
    offset: FloatArray
    squares: float
    noise: float
    redundancy: int
    weighted: WeightedFit | None = None


def _fit(
    measured: _MeasuredControl, model: TransformationModel, used: BoolArray
) -> _FittedTransformation:
    """Return the fit to the chosen points with its weighted sum of squares and redundancy."""
    wall, target = measured.wall[used], measured.world[used].copy()
    if model.axes == 2:
        target[:, 2] = 0.0
    fit = model.fit(wall, target)
    # About a round origin, so that the sum of squares is not one of rounding errors.
    origin = round_origin(target)
    near = target - origin
    offset = near.mean(axis=0)
    weighted: WeightedFit | None = None
    if model.axes == 2:
        offset[2] = fit.target_centre[2]
    # Rounding noise of large coordinates is no contradiction.
    noise = (1e-9 * float(np.abs(target).max())) ** 2
    redundancy = model.axes * int(used.sum()) - model.parameters
    if measured.covariance is None:
        rest = residuals(fit, wall, near, offset)[:, : model.axes]
        squares = float((rest**2).sum())
    else:
        weights = weights_of(measured.covariance[used], flat=model.axes == 2)
        about = wall - fit.source_centre
        weighted = weighted_fit(about, weights, near, fit, model=model.name)
        fit, offset = weighted.similarity(fit.source_centre, origin), weighted.offset
        rest = residuals(fit, wall, near, offset) @ fit.rotation / fit.scale
        squares = float(np.einsum("ni,nij,nj->", rest, weights, rest))
        noise *= float(np.trace(weights.mean(axis=0))) / model.axes
    return _FittedTransformation(
        model=model, used=used, transformation=fit, origin=origin, offset=offset,
        squares=squares, noise=noise, redundancy=redundancy, weighted=weighted,
    )  # fmt: skip


def residuals(
    transformation: Similarity, wall: FloatArray, near: FloatArray, offset: FloatArray
) -> FloatArray:
    """Return known minus computed coordinates near an origin from which the centre lies offset."""
    turned = (wall - transformation.source_centre) @ transformation.rotation.T
    return np.asarray(near - (offset + transformation.scale * turned))


def _explained(
    measured: _MeasuredControl, best: _FittedTransformation, *, fuller: bool
) -> _FittedTransformation:
    """Return the fit after what contradicts it: a wall that leans, bad points."""
    while best.redundancy > 0 and best.squares > best.noise:
        trials: list[tuple[float, _FittedTransformation]] = []
        if fuller and best.model.name != "3D":
            trials += [(1 / ALPHA, trial) for trial in _tried(measured, MODELS["3D"], best.used)]
        rows = np.flatnonzero(best.used)
        for row in rows:
            without = best.used.copy()
            without[row] = False
            tried = _tried(measured, best.model, without)
            trials += [(len(rows) / ALPHA_POINT, trial) for trial in tried]
        # In shares of what is allowed; argmin takes the first of equals, the geometry.
        chances = [share * _chance(best, trial) for share, trial in trials]
        if not chances or min(chances) >= 1.0:
            return best
        best = trials[int(np.argmin(chances))][1]
    return best


def _tried(
    measured: _MeasuredControl, model: TransformationModel, used: BoolArray
) -> list[_FittedTransformation]:
    """Return the fit if there is one that leaves redundancy."""
    if model.axes * int(used.sum()) - model.parameters < 1:
        return []
    try:
        return [_fit(measured, model, used)]
    except GeometryError:
        return []


def _chance(simple: _FittedTransformation, full: _FittedTransformation) -> float:
    """Return how probable it is that honest errors alone make the fuller fit so much better."""
    from scipy.special import fdtrc  # a tenth of a second that only control points need

    extra = simple.redundancy - full.redundancy
    floor = max(full.squares, full.noise) / full.redundancy
    return float(
        fdtrc(extra, full.redundancy, max(simple.squares - full.squares, 0.0) / extra / floor)
    )


def _as_georeference(
    measured: _MeasuredControl, best: _FittedTransformation, usable: BoolArray
) -> Georeference:
    """Return the fit with the residuals of all control points."""
    flat = best.model.axes == 2
    near = np.where(flat, measured.world * [1, 1, np.nan], measured.world) - best.origin
    rest = residuals(best.transformation, measured.wall, near, best.offset)
    squares = float((rest[best.used][:, : best.model.axes] ** 2).sum())
    sigma0 = float(np.sqrt(squares / best.redundancy)) if best.redundancy > 0 else float("nan")
    flattened = _flattened(measured.world - best.origin, flat=flat)
    precision, expected = _precision(measured, best, flattened, sigma0)
    weighted = best.redundancy > 0 and measured.covariance is not None
    return Georeference(
        ids=measured.ids,
        world_from_wall=best.transformation,
        model=best.model.name,
        residuals=rest,
        solved=measured.wall,
        used=best.used,
        bad=tuple(
            name
            for name, was, now in zip(measured.ids, usable, best.used, strict=True)
            if was and not now
        ),
        sigma0=sigma0,
        error_ratio=float(np.sqrt(best.squares / expected)) if weighted else float("nan"),
        redundancy=best.redundancy,
        origin=best.origin,
        offset=best.offset,
        covariance=measured.covariance,
        near=flattened,
        precision=precision,
    )


def _precision(
    measured: _MeasuredControl, best: _FittedTransformation, near: FloatArray, sigma0: float
) -> tuple[TransformationPrecision | None, float]:
    """Return what the fit is worth, and the weighted sum of squares to be expected."""
    used, fit, weighted = best.used, best.transformation, best.weighted
    effect = None if measured.effect is None else measured.effect[used]
    expected = float(best.redundancy)
    if weighted is None:
        # All points alike: as good as the residuals say, which say nothing without redundancy.
        if not sigma0 > 0:
            return None, expected
        alike = np.tile(np.eye(3) * (sigma0 / fit.scale) ** 2, (int(used.sum()), 1, 1))
        weights = weights_of(alike, flat=best.model.axes == 2)
        about = measured.wall[used] - fit.source_centre
        weighted = weighted_fit(about, weights, near[used], fit, model=best.model.name)
    precision = precision_of(best.model.name, fit, weighted, near[used], effect)
    if effect is not None:
        moved = precision.moved_by_orientation(near[used])
        unexplained = effect - np.einsum("ba,nbk->nak", fit.rotation, moved) / fit.scale
        expected += float(np.einsum("nak,nab,nbk->", unexplained, weighted.weights, unexplained))
    return precision, expected


def _flattened(near: FloatArray, *, flat: bool) -> FloatArray:
    """Return coordinates with zero heights where heights play no part."""
    return np.where([False, False, flat], 0.0, near)
