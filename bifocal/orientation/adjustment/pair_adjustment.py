"""Least-squares adjustment of the two cameras of a pair from everything that is known of them.

Control points, tie points, wall points, taped distances and what is known of the lenses all enter
one adjustment with their standard deviations; what an observation does not reach is held by the
prior, and the covariance says so.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtrc, ndtri

from bifocal.model import NAMES, rates_of
from bifocal.orientation.adjustment.frame_turn import line_equations, turned_by_lines
from bifocal.orientation.adjustment.observed_points import known_points, views_of
from bifocal.orientation.adjustment.pair_observations import (
    Equations,
    PairObservations,
    PairUnknowns,
    at,
)
from bifocal.orientation.adjustment.refracted_ties import height_equations, meeting_equations
from bifocal.remarks import remark
from photocore.adjustment.network import Network, NetworkState, Rows
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import (
    PARAMETERS,
    fundamental_with_jacobian,
    homogeneous,
    plane_transfer_with_jacobian,
    skew,
)
from photocore.errors import GeometryError

#: Rounding error of pixels and metres, as a share of their standard deviations.
ROUNDING = 1e-9
#: Relative standard deviation with which one camera body has one aspect.
SIGMA_ASPECT = 2e-4
#: Two photos of one lens have one distortion.
SAME_LENS = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AdjustedPair(PairUnknowns):
    """Adjusted cameras.

    Attributes
    ----------
    covariance : ndarray, shape (k, k)
        Of all `NAMES`, through media of all that `bifocal.model.orientation_precision.names_of`
        counts; zero where held.
    of_unknowns : ndarray, shape (u, u)
        Of `PairObservations.names`, zero where held; the same in air.
    sigma0 : float
        Standard deviation of unit weight.
    control_residuals : ndarray, shape (n, 4)
        [px]
    control_test : ndarray, shape (n,)
        Misfit of a point over its standard deviation, allowing for its leverage.
    tie_misfit : ndarray, shape (m,)
        Epipolar distance of all ties. [px]
    wall_misfit : ndarray, shape (m,)
        Distance of all ties from where the wall plane puts them, along the line. [px]
    """

    covariance: FloatArray
    of_unknowns: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    sigma0: float
    control_residuals: FloatArray
    control_test: FloatArray
    tie_misfit: FloatArray
    wall_misfit: FloatArray

    def sigma(self, name: str, camera: int) -> float:
        """Return the standard deviation of a parameter of camera 1 or 2."""
        index = at(name, camera)
        return float(np.sqrt(self.covariance[index, index]))


def adjust(observations: PairObservations, start: PairUnknowns) -> AdjustedPair:
    """Return the adjusted cameras.

    Parameters
    ----------
    observations : PairObservations
    start : PairUnknowns
        Approximate cameras and distortion.

    Raises
    ------
    GeometryError
        If the observations leave a parameter undetermined.
    """
    free, names = np.flatnonzero(observations.estimated), observations.names
    columns = np.arange(len(free))

    def everything(state: NetworkState, rows: Rows) -> bool:
        residuals, by = pair_equations(observations, state.blocks["pair"][0])
        rows.by_label(rows.add(residuals)[:, None], columns, by[:, free])
        return True

    network = Network(
        labels=[names[k] for k in free],
        columns={"pair": {0: dict(zip(free.tolist(), columns, strict=True))}},
        terms=[everything],
        step=lambda pair, at, step: pair.stepped(np.bincount(at, step, len(names))),
        what="the pair",
        rounding=ROUNDING,
    )
    try:
        fit = network.solve(NetworkState(blocks={"pair": {0: start}}))
    except GeometryError:
        raise GeometryError(remark("align.undetermined")) from None
    redundancy = max(fit.redundancy, 1)
    sigma0 = float(np.sqrt((fit.residuals @ fit.residuals) / redundancy))
    cofactor: FloatArray = np.zeros((len(names), len(names)))
    cofactor[np.ix_(free, free)] = fit.linear.cofactor
    state: PairUnknowns = fit.state.blocks["pair"][0]
    if observations.lines and observations.lines_bend_nothing:
        rates = pair_equations(observations, state)[1]

        def known_of(moves: FloatArray) -> FloatArray:
            moved = rates @ moves
            return np.asarray(moved.T @ moved)

        frame, cofactor = turned_by_lines(
            observations.lines, state.cameras, observations.estimated, cofactor, known_of
        )
        first, second = (camera.carried(frame) for camera in state.cameras)
        state = replace(state, cameras=(first, second))
    covariance = cofactor * max(sigma0, 1.0) ** 2
    by = state.media.by_unknowns()
    return AdjustedPair(
        cameras=state.cameras,
        radial=state.radial,
        media=state.media,
        covariance=by @ covariance @ by.T,
        of_unknowns=covariance,
        sigma0=sigma0,
        control_residuals=_control_residuals(observations, state),
        control_test=_control_test(observations, state, cofactor),
        tie_misfit=tie_misfit(observations, state),
        wall_misfit=wall_misfit(observations, state),
    )


def tie_misfit(observations: PairObservations, state: PairUnknowns) -> FloatArray:
    """Return the signed distance of all ties from their epipolar lines, shape (m,). [px]"""
    return _tie_equations(observations, state, np.ones(len(observations.tie1), dtype=bool))[0]


def _tie_equations(
    observations: PairObservations, state: PairUnknowns, which: BoolArray
) -> Equations:
    """Return by how much rays of ties miss each other: `_epipolar`, `meeting_equations`. [px]"""
    rows_of = meeting_equations if state.media else _epipolar
    return rows_of(observations, state, which)


def wall_misfit(observations: PairObservations, state: PairUnknowns) -> FloatArray:
    """Return how far all ties lie from the wall plane's transfer, shape (m,). [px]

    Through media, where the plane is no homography, how far off it their rays meet.
    """
    return _wall_ties(observations, state, np.ones(len(observations.tie1), dtype=bool))[0]


def _wall_ties(observations: PairObservations, state: PairUnknowns, which: BoolArray) -> Equations:
    """Return how far ties are off the wall plane: `_transfer`, `height_equations`. [px]"""
    rows_of = height_equations if state.media else _transfer
    return rows_of(observations, state, which)


def evaluated(observations: PairObservations, adjusted: AdjustedPair) -> AdjustedPair:
    """Return an adjusted pair with the misfits of other observations' ties, not adjusted."""
    return replace(
        adjusted,
        tie_misfit=tie_misfit(observations, adjusted),
        wall_misfit=wall_misfit(observations, adjusted),
    )


def pair_equations(observations: PairObservations, state: PairUnknowns) -> Equations:
    """Return everything observed against computed in standard deviations, and derivatives."""
    used, wall = observations.tie_used, observations.wall
    parts = [_priors(observations, state)]
    if used.any():
        values, by = _tie_equations(observations, state, used)
        parts.append((values / observations.sigma_ties, by / observations.sigma_ties))
    if wall.any() and (observations.wall_rows.any() or not state.media):
        parts.append(wall_equations(observations, state))
    if observations.lines and not observations.lines_bend_nothing:
        parts.append(line_equations(observations.lines, state.cameras))
    if observations.control.ids:
        control = _control(observations, state)
        by = control.by_unknowns
        parts.append((control.misfit.ravel(), by.reshape(-1, by.shape[-1])))
        parts.append(_lengths(observations, state, control))
    residuals = np.concatenate([values for values, _ in parts])
    jacobian = np.concatenate([by for _, by in parts])
    lost = ~np.isfinite(residuals)
    residuals[lost], jacobian[lost] = 1e3, 0.0
    return residuals, jacobian


def wall_equations(observations: PairObservations, state: PairUnknowns) -> Equations:
    """Return what the wall's ties tell of the reference plane: height and slopes, in sigma."""
    on_wall = observations.wall_rows.any(axis=0) & observations.tie_used
    values, by = _wall_ties(observations, state, on_wall)
    rows = observations.wall_rows[:, on_wall]
    return rows @ values, rows @ by


def _priors(observations: PairObservations, state: PairUnknowns) -> Equations:
    """Return what is known of lenses, media, distances and tilts: all but the tilts are linear."""
    names, media = observations.names, observations.media
    zoom, body = observations.sigma_zoom, observations.sigma_body
    priors: list[tuple[dict[str, float], float, float | None]] = []
    tilts, by_tilts = [], []
    for number, (interior, camera) in enumerate(
        zip(observations.interiors, state.cameras, strict=True), start=1
    ):
        of_cameras = {
            "focal length": (np.log(interior.focal), interior.sigma_focal),
            "aspect": (np.log(interior.aspect), interior.sigma_aspect),
            "column": (interior.centre[0], interior.sigma_centre),
            "row": (interior.centre[1], interior.sigma_centre),
            "k1": (0.0, interior.sigma_radial),
            "k2": (0.0, interior.sigma_radial),
        }
        priors += [({f"{name} {number}": 1.0}, *measure) for name, measure in of_cameras.items()]
        if observations.sigma_tilt is not None:
            axis, turn = camera.rotation[2], at("turn X", number)
            turned = skew(axis)
            by = np.zeros((2, len(names)))
            by[:, turn : turn + 3] = -(turned[:2] + np.outer(camera.tilt, turned[2])) / axis[2]
            tilts.append(camera.tilt / observations.sigma_tilt)
            by_tilts.append(by / observations.sigma_tilt)
    lens = SAME_LENS if zoom is not None and observations.estimated[at("k1", 1)] else None
    aspect = None if body is None else SIGMA_ASPECT
    same = {"focal length": zoom, "column": body, "row": body, "aspect": aspect}
    same |= {"k1": lens, "k2": lens}
    priors += [({f"{name} 1": 1.0, f"{name} 2": -1.0}, 0.0, sigma) for name, sigma in same.items()]
    far, near = {"Z 1": 1.0}, {"Z 2": 1.0}
    distances = {"distance1": far, "distance2": near, "delta_d": {"Z 1": 1.0, "Z 2": -1.0}}
    priors += [(distances[name], *measure) for name, measure in observations.measured.items()]
    priors += [({k: 1.0}, media.value(k), s) for k, s in media.sigmas.items() if np.isfinite(s)]
    rows = [(terms, value, sigma) for terms, value, sigma in priors if sigma]
    means, sigmas = np.array([row[1:] for row in rows]).reshape(-1, 2).T
    jacobian = np.zeros((len(rows), len(names)))
    for row, (terms, *_) in enumerate(rows):
        jacobian[row, [names.index(name) for name in terms]] = list(terms.values())
    values = np.array([*state.values(), *(state.media.value(name) for name in media.sigmas)])
    return (
        np.concatenate([(jacobian @ values - means) / sigmas, *tilts]),
        np.concatenate([jacobian / sigmas[:, None], *by_tilts]),
    )


def _straight(
    observations: PairObservations, state: PairUnknowns, which: BoolArray
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Return ties freed of the radial distortion, homogeneous, and derivatives by k (m, 2, 2)."""
    models = observations.radial_models(state.radial)
    ties = (observations.tie1[which], observations.tie2[which])
    straight = [homogeneous(m.undistort(x)) for m, x in zip(models, ties, strict=True)]
    by_k = [m.undistorted_by_k(x) for m, x in zip(models, ties, strict=True)]
    return (straight[0], straight[1]), (by_k[0], by_k[1])


def _epipolar(observations: PairObservations, state: PairUnknowns, which: BoolArray) -> Equations:
    """Return the signed (Sampson) distance of ties from their epipolar lines, by `NAMES`. [px]

    Notes
    -----
    ``e = x2ᵀ F x1 / |(F x1, Fᵀ x2)|``, of the lines' first two components.
    """
    (x1, x2), (x1_by_k, x2_by_k) = _straight(observations, state, which)
    matrix, by_cameras = fundamental_with_jacobian(*state.cameras)
    line2, line1 = (x1 @ matrix.T)[:, :2], (x2 @ matrix)[:, :2]
    length = np.sqrt(np.maximum((line2**2).sum(1) + (line1**2).sum(1), 1e-300))[:, None]
    misfit = ((x2 @ matrix) * x1).sum(1) / length[:, 0]
    # e = s / n, so de = (ds - e dn) / n, with dn = (line . d line) / n.
    share2, share1 = misfit[:, None] * line2 / length, misfit[:, None] * line1 / length
    left, right = x2.copy(), x1.copy()
    left[:, :2] -= share2
    by_matrix = left[:, :, None] * right[:, None, :]
    by_matrix[:, :, :2] -= x2[:, :, None] * share1[:, None, :]
    by_matrix /= length[:, :, None]
    by = np.zeros((len(x1), len(NAMES)))
    by[:, _CAMERAS] = by_matrix.reshape(-1, 9) @ by_cameras.reshape(-1, 9).T
    by_x1, by_x2 = line1 - share2 @ matrix[:2, :2], line2 - share1 @ matrix[:2, :2].T
    by[:, _RADIAL[0]] = (by_x1[:, :, None] * x1_by_k).sum(1) / length
    by[:, _RADIAL[1]] = (by_x2[:, :, None] * x2_by_k).sum(1) / length
    return misfit, by


def _transfer(observations: PairObservations, state: PairUnknowns, which: BoolArray) -> Equations:
    """Return how far ties lie from the plane's transfer along the line, by `NAMES`. [px]"""
    (x1, x2), (x1_by_k, x2_by_k) = _straight(observations, state, which)
    matrix, by_cameras = fundamental_with_jacobian(*state.cameras)
    transfer, by_transfer = plane_transfer_with_jacobian(*state.cameras, np.zeros(3))
    by_transfer = by_transfer[: len(_CAMERAS)]
    line = (x1 @ matrix.T)[:, :2]
    carried = x1 @ transfer.T
    with np.errstate(divide="ignore", invalid="ignore"):
        mapped = carried[:, :2] / carried[:, 2:]
        length = np.hypot(line[:, 0], line[:, 1])[:, None]
        along = np.column_stack([-line[:, 1], line[:, 0]]) / length
        shift = x2[:, :2] - mapped
        misfit = (shift * along).sum(1)
        by_line = np.column_stack([shift[:, 1], -shift[:, 0]]) - misfit[:, None] * line / length
        by_line /= length
        by_carried = -np.column_stack([along, -(along * mapped).sum(1)]) / carried[:, 2:]
    by = np.zeros((len(x1), len(NAMES)))
    by_matrix = (by_line[:, :, None] * x1[:, None, :]).reshape(-1, 6)
    by[:, _CAMERAS] = by_matrix @ by_cameras[:, :2].reshape(-1, 6).T
    by_matrix = (by_carried[:, :, None] * x1[:, None, :]).reshape(-1, 9)
    by[:, _CAMERAS] += by_matrix @ by_transfer.reshape(-1, 9).T
    by_x1 = (by_line @ matrix[:2] + by_carried @ transfer)[:, :2]
    by[:, _RADIAL[0]] = (by_x1[:, :, None] * x1_by_k).sum(1)
    by[:, _RADIAL[1]] = (along[:, :, None] * x2_by_k).sum(1)
    return misfit, by


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _AdjustedControl:
    """Control points of one state.

    Attributes
    ----------
    misfit : ndarray, shape (n, 4)
        What picks and coordinates contradict each other, in four independent directions; zero in
        those of picks that are missing or not used. [standard deviations]
    by_unknowns : ndarray, shape (n, 4, 24)
    xyz : ndarray, shape (n, 3)
        Adjusted points. [m]
    xyz_by_unknowns : ndarray, shape (n, 3, 24)
    """

    misfit: FloatArray
    by_unknowns: FloatArray
    xyz: FloatArray
    xyz_by_unknowns: FloatArray


def _control(
    observations: PairObservations, state: PairUnknowns, used: BoolArray | None = None
) -> _AdjustedControl:
    """Return adjusted points, what their picks leave of misfit, and derivatives.

    Four picks and three measured coordinates meet in the point's three unknowns, which are
    eliminated: so a metre known to 3 mm pulls less than a pick known to half a pixel.

    Notes
    -----
    An orthogonal turn of the seven equations leaves four without the point. The point minimises
    the square sum of its part, so that its derivative by the cameras is that at the point held.
    """
    control, sigma_pick = observations.control, observations.sigma_pick
    used = observations.pick_used if used is None else used
    models = observations.radial_models(state.radial)
    raw = (control.pixels1, control.pixels2)
    picks = np.concatenate([m.undistort(x) for m, x in zip(models, raw, strict=True)], axis=1)
    coordinates, sigma = known_points(observations, state, picks)
    xyz = coordinates
    picked = np.isfinite(picks) & used[:, None]
    held = np.eye(3) / sigma[:, :, None]
    for _ in range(3):
        views = views_of(state, xyz)
        rows = np.concatenate([view.by_point for view in views], axis=1) / sigma_pick
        misfit = (picks - np.concatenate([view.pixels for view in views], axis=1)) / sigma_pick
        rows = np.where(picked[:, :, None], np.nan_to_num(rows), 0.0)
        misfit = np.where(picked, np.nan_to_num(misfit, nan=1e4), 0.0)
        base, triangle = np.linalg.qr(np.concatenate([rows, held], axis=1), mode="complete")
        turn, triangle = base.transpose(0, 2, 1), triangle[:, :3]
        split = turn @ np.concatenate([misfit, (coordinates - xyz) / sigma], axis=1)[..., None]
        xyz = xyz + np.linalg.solve(triangle, split[:, :3])[..., 0]
    rates = [
        rates_of(seen_by, -model.undistorted_by_k(x), number)
        for number, (seen_by, model, x) in enumerate(zip(views, models, raw, strict=True))
    ]
    by = state.media.rates_by_unknowns(-np.concatenate(rates, axis=1))
    split_by = turn[:, :, :4] @ np.where(picked[:, :, None], np.nan_to_num(by / sigma_pick), 0.0)
    return _AdjustedControl(
        misfit=split[:, 3:, 0],
        by_unknowns=split_by[:, 3:],
        xyz=xyz,
        xyz_by_unknowns=np.linalg.solve(triangle, split_by[:, :3]),
    )


def _control_residuals(observations: PairObservations, state: PairUnknowns) -> FloatArray:
    """Return picks minus the projection of the control points as given, shape (n, 4). [px]"""
    control = observations.control
    if not control.ids:
        return np.zeros((0, 4))
    xyz = np.where(np.isfinite(control.xyz), control.xyz, _control(observations, state).xyz)
    parts = [
        model.undistort(pixels) - view.pixels
        for model, pixels, view in zip(
            observations.radial_models(state.radial), (control.pixels1, control.pixels2),
            views_of(state, xyz), strict=True,
        )
    ]  # fmt: skip
    return np.concatenate(parts, axis=1)


def _lengths(
    observations: PairObservations, state: PairUnknowns, control: _AdjustedControl
) -> Equations:
    """Return the taped distances' residuals; the picks' own noise is part of their weight."""
    used, far, points = observations.pick_used, state.cameras[0], observations.control
    spread = points.sigma_lengths or (np.nan,) * len(points.lengths)
    lengths = [
        (a, b, c, s)
        for (a, b, c), s in zip(points.lengths, spread, strict=True)
        if used[a] and used[b]
    ]
    if not lengths:
        return np.zeros(0), np.zeros((0, len(observations.names)))
    first, second, taped, sigmas = (np.array(column) for column in zip(*lengths, strict=True))
    between = control.xyz[first] - control.xyz[second]
    between_by = control.xyz_by_unknowns[first] - control.xyz_by_unknowns[second]
    # Where no ray of an end meets the wall, on the way to a solution, it is nowhere.
    length = np.maximum(np.linalg.norm(between, axis=1), 1e-9)
    pick = 1.41 * far.centre[2] / far.matrix[0, 0] * observations.sigma_pick
    sigma = np.hypot(np.where(np.isnan(sigmas), points.sigma.min(initial=0.003), sigmas), pick)
    misfit = (length - taped) / sigma
    by = np.einsum("ni,nik->nk", between / length[:, None], between_by) / sigma[:, None]
    # A pixel on the wall is distance over principal distance; so is the picks' share of sigma.
    by[:, at("Z", 1)] -= misfit * (pick / sigma) ** 2 / far.centre[2]
    by[:, at("focal length", 1)] += misfit * (pick / sigma) ** 2
    return misfit, by


def _control_test(
    observations: PairObservations, state: PairUnknowns, cofactor: FloatArray
) -> FloatArray:
    """Return each control point's misfit in standard deviations, as if it had been left out.

    With residual block w, its Jacobian A and the cofactor Q of the parameters,
    ``T² = wᵀ (I - A Q Aᵀ)⁻¹ w``, of as many values as are seen, and the standard deviations of one
    value that are as unlikely; unused points are tested against the others.
    """
    control, out = observations.control, np.zeros(len(observations.control.ids))
    if not control.ids:
        return out
    adjusted = _control(observations, state)
    others = _control(observations, state, np.ones(len(control.ids), dtype=bool)).misfit
    missing = np.isnan(np.concatenate([control.pixels1, control.pixels2], axis=1)).sum(axis=1)
    for index in np.flatnonzero(missing < 4):
        if not observations.pick_used[index]:
            out[index] = as_one(float((others[index] ** 2).sum()), int(4 - missing[index]))
            continue
        block = adjusted.by_unknowns[index]
        # A point that alone determines something has no redundancy: its test says nothing.
        values, vectors = np.linalg.eigh(np.eye(4) - block @ cofactor @ block.T)
        parts = (vectors.T @ adjusted.misfit[index]) ** 2
        usable = values > 0.02
        count = int(usable.sum() - missing[index])
        if count > 0:
            out[index] = as_one(float((parts[usable] / values[usable]).sum()), count)
    return out


def as_one(square: float, count: int) -> float:
    """Return how many standard deviations of one value are as unlikely as a square sum of many."""
    chance = float(chdtrc(count, square))
    return -float(ndtri(chance / 2)) if chance > 1e-300 else float(np.sqrt(square))


#: Where the cameras' `PARAMETERS` and the distortions stand in `NAMES`.
_CAMERAS = [at(name, number) for number in (1, 2) for name in PARAMETERS]
_RADIAL = [[at(name, number) for name in ("k1", "k2")] for number in (1, 2)]
