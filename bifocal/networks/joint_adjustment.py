"""Least-squares adjustment of all pairs of a façade in one frame, from rays to common points.

The unknowns are the exterior orientation of every camera (and its focal length, where that is not
exactly known) and the coordinates of every point; interior orientation else is as the pair files
state it. Points are eliminated, what remains is sparse: `photocore.adjustment.sparse`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from bifocal.model import CAMERA, PairMedia
from bifocal.networks.camera_knowledge import SHARED
from bifocal.networks.joint_observations import JointObservations, with_enough_rays, with_rays
from photocore.adjustment import Fit, huber_weights, outlier_limit, standardised
from photocore.adjustment.blocks import BlockEquations
from photocore.adjustment.network import Network, NetworkState, Rows
from photocore.adjustment.sparse import SparseEquations
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import PARAMETERS, Pinhole
from photocore.errors import GeometryError

#: What is unknown of a camera, by its place in `CAMERA`; the focal length comes first.
ESTIMATED = (0, 4, 5, 6, 7, 8, 9)
#: Rounds in which gross errors are taken out, the worst of every point each time.
ROUNDS = 8
#: Rounds with Huber's weights before these, and rays dropped after them: so many usual misfits.
COARSE, FAR_OFF = 3, 10.0
#: In these rounds control weighs as if so many times less precise: else a wrong point bends the
#: cameras, and the good rays around it look wrong. In `many_pairs` of the tests, with control of
#: 2 mm of which one coordinate is wrong by 0.3 to 1 m, 8 to 22 rays are lost with 1, at most one
#: with 10, 30 or 100, and the point is named.
LOOSE = 100.0
#: In a set points lie off the wall by so much of the nearest camera's distance: with all of it
#: those seen at a small angle wander towards the cameras, and nothing settles.
SHALLOW = 0.1
#: Rounding error of pixels and metres, as a share of their standard deviations.
ROUNDING = 1e-9
#: Redundancy from which rays of one stated precision tell how good they truly are.
ENOUGH = 20.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointUnknowns:
    """Cameras, the points' coordinates (p, 3) [m], and in a set each lens's k1, k2 (m, 2)."""

    cameras: tuple[Pinhole, ...]
    xyz: FloatArray
    radial: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Blunder:
    """A measurement that contradicts the others, and took no part in the end.

    Attributes
    ----------
    point, where : str
        Which point, and in which photo, or ``control``.
    test : float
        Residual over its own standard deviation.
    """

    point: str
    where: str
    test: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointAdjustment(JointUnknowns):
    """Adjusted cameras and points.

    Attributes
    ----------
    observations : JointObservations
        Those that took part.
    covariance : ndarray, shape (p, 3, 3)
        Of the points. NaN where too few rays were left. [m²]
    sigma0 : float
        Standard deviation of unit weight, after the gross errors.
    redundancy, iterations : int
    residuals : ndarray, shape (n, 2)
        Computed minus measured. [px]
    control : ndarray, shape (p, 3)
        Adjusted minus known coordinates, also of what was taken out; NaN elsewhere. [m]
    blunders : tuple of Blunder
    left_in : tuple of Blunder
        What the last round would have taken out: empty unless there were more than `ROUNDS`.
    by_camera : ndarray, shape (m, 7, 7)
        Covariance of the `ESTIMATED` of each camera.
    between : ndarray, shape (k, 7, 7)
        Covariance between the far and the near camera of each pair.
    of_cameras : ndarray, shape (12 m, 12 m)
        Covariance of `CAMERA` of all cameras of a set, one after the other; else empty.
    """

    observations: JointObservations
    covariance: FloatArray
    sigma0: float
    redundancy: int
    iterations: int
    residuals: FloatArray
    control: FloatArray
    blunders: tuple[Blunder, ...]
    left_in: tuple[Blunder, ...]
    by_camera: FloatArray
    between: FloatArray
    of_cameras: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    def orientation(self, pair: int) -> FloatArray:
        """Return the covariance of a pair's cameras as its file states it, shape (k, k).

        24 in air. Through media, which are taken as given, what moves and turns with the cameras
        follows them.
        """
        whole = np.zeros((2 * len(CAMERA), 2 * len(CAMERA)))
        places = [[k * len(CAMERA) + e for e in ESTIMATED] for k in (0, 1)]
        observations = self.observations
        pair_cameras = observations.pairs[pair]
        for place, camera in zip(places, pair_cameras, strict=True):
            whole[np.ix_(place, place)] = self.by_camera[camera]
        whole[np.ix_(*places)] = self.between[pair]
        whole[np.ix_(*places[::-1])] = self.between[pair].T
        media = PairMedia.of_cameras(*(observations.media_of(camera) for camera in pair_cameras))
        by = media.by_unknowns()
        return by @ whole @ by.T if media else whole


def adjust_jointly(observations: JointObservations, start: JointUnknowns) -> JointAdjustment:
    """Return all cameras and points of a façade, and what contradicts the rest.

    Parameters
    ----------
    observations : JointObservations
    start : JointUnknowns
        Approximate cameras and points in one frame.

    Raises
    ------
    GeometryError
        If the measurements leave an orientation open; the message names it.
    """
    blunders: list[Blunder] = []
    rays = with_enough_rays(observations)
    # What was known before of the focal lengths, however often a round begins anew.
    focal = np.array([camera.matrix[0, 0] for camera in start.cameras])
    start, tests, control = _coarse(rays, start, focal)
    blunders += [_of_ray(rays, k, tests[k]) for k in np.flatnonzero(tests >= FAR_OFF).tolist()]
    # A wrong ray moves its own point: what is known of that is judged when the ray is gone.
    control[rays.point[tests >= FAR_OFF]] = 0.0
    blunders += [
        _of_control(rays, k, control[k]) for k in np.flatnonzero(control >= FAR_OFF).tolist()
    ]
    coordinates = np.where((control < FAR_OFF)[:, None], rays.known, np.nan)
    rays = _without(rays, tests < FAR_OFF, coordinates, blunders)
    for remaining in range(ROUNDS, -1, -1):
        system = _System(rays, start, focal)
        fit = system.network.solve(system.start)
        start = _unknowns(fit.state)
        sigma0 = _sigma0(fit, system)
        keep, coordinates, gross = _gross(rays, system, fit, sigma0)
        if not gross or not remaining:
            break
        blunders += gross
        rays = _without(rays, keep, coordinates, gross)
    return _adjusted(observations, rays, system, fit, sigma0, (tuple(blunders), tuple(gross)))


def settled_jointly(
    observations: JointObservations, start: JointUnknowns, rounds: int
) -> tuple[JointObservations, JointUnknowns, FloatArray]:
    """Return rays without those far off, what most of them agree on, and misfits (n, 2) [px].

    Control holds the frame loosely; nothing is said of precision. Weights are renewed in some
    ``rounds``: where it begins near the end one will do.
    """
    rays = with_enough_rays(observations)
    focal = np.array([camera.matrix[0, 0] for camera in start.cameras])
    start, tests, _ = _coarse(rays, start, focal, rounds)
    # Picks of control are judged at the end, when it holds the frame closely.
    picked = np.asarray(np.isfinite(rays.known).any(axis=1))[rays.point]
    rays = with_rays(rays, picked | (tests < FAR_OFF))
    system = _System(rays, start, focal)
    return rays, start, system.rays(system.start)[0]


def _coarse(
    picks: JointObservations, start: JointUnknowns, focal: FloatArray, rounds: int = COARSE
) -> tuple[JointUnknowns, FloatArray, FloatArray]:
    """Return a state that most agree on, and misfits over the usual: of rays (n,), control (p,).

    Huber's weights, renewed a few times: a match with the wrong window must not bend the whole, nor
    a control point with a wrong coordinate. The misfit of a point that is no control is 0.
    """
    fixed = np.isfinite(picks.known).any(axis=1)
    # Nothing else tells where on its ray the end of a length is: loose, it takes the scale along.
    fixed &= ~picks.unchecked
    spread = np.where(fixed[:, None], LOOSE, 1.0) * picks.sigma_known
    for number in range(rounds):
        away = _away(_System(picks, start, focal))
        away = np.nan_to_num(away, nan=1e6)
        if number and fixed.any():  # before, the start is no better than any control point
            off = _off_control(picks, start)[fixed]
            spread[fixed] = LOOSE * picks.sigma_known[fixed]
            spread[fixed] /= np.sqrt(huber_weights(off, 2.0))[:, None]
        weighted = replace(
            picks, sigma=picks.sigma / np.sqrt(huber_weights(away, 2.0)), sigma_known=spread
        )
        system = _System(weighted, start, focal)
        start = _unknowns(system.network.minimise(system.start, most=6).state)
    away = _away(_System(picks, start, focal)) / picks.sigma
    usual = max(float(np.median(away)) / 1.1774, 1.0)  # Rayleigh's median
    off = _off_control(picks, start)
    agreed = max(float(np.median(off[fixed])) / 1.5382, 1.0) if fixed.any() else 1.0  # Maxwell's
    return start, np.nan_to_num(away / usual, nan=np.inf), off / agreed


def _unknowns(state: NetworkState) -> JointUnknowns:
    radial = np.array(list(state.blocks["radial"].values())).reshape(-1, 2)
    cameras = tuple(state.blocks["camera"].values())
    return JointUnknowns(cameras=cameras, xyz=state.points, radial=radial)


def _stepped(block: Any, at: list[int], step: FloatArray) -> Any:
    """Return a camera or a radial distortion after a step of some of `CAMERA`."""
    whole = np.bincount(at, step, len(CAMERA)).astype(np.float64)
    if isinstance(block, Pinhole):
        return block.stepped(whole[: len(PARAMETERS)])
    return block + whole[len(PARAMETERS) :]


def _away(system: _System) -> FloatArray:
    """Return how far points are seen from where they were measured, shape (n,). [px]"""
    return np.linalg.norm(system.rays(system.start)[0], axis=1)


def _off_control(picks: JointObservations, state: JointUnknowns) -> FloatArray:
    """Return how far points lie from what is known, in its standard deviations, shape (p,)."""
    return np.linalg.norm(np.nan_to_num((state.xyz - picks.known) / picks.sigma_known), axis=1)


def _of_ray(picks: JointObservations, ray: int, test: float) -> Blunder:
    return Blunder(
        point=picks.ids[picks.point[ray]], where=picks.names[picks.camera[ray]], test=float(test)
    )


def _of_control(picks: JointObservations, point: int, test: float) -> Blunder:
    return Blunder(point=picks.ids[point], where="control", test=float(test))


def _without(
    picks: JointObservations, keep: BoolArray, known: FloatArray, blunders: list[Blunder]
) -> JointObservations:
    """Return what is left without gross errors.

    Raises
    ------
    GeometryError
        If too little control is left to hold the frame.
    """
    reduced = with_enough_rays(with_rays(replace(picks, known=known), keep))
    if picks.frame_is_known and not reduced.frame_is_known:
        control = {picks.ids[k] for k in np.flatnonzero(np.isfinite(picks.known).all(axis=1))}
        raise GeometryError(
            "the control points contradict each other or their picks: "
            f"{', '.join(sorted(control & {b.point for b in blunders}))}. "
            "Check their coordinates and names."
        )
    return reduced


class _System:
    """The network: two rows for each ray, one for each known coordinate, and what else is believed.

    That is the relief of each other point (it lies before the cameras, a standard deviation of the
    nearest one's distance), and each focal length that is not held.
    """

    def __init__(self, picks: JointObservations, start: JointUnknowns, focal: FloatArray) -> None:
        self.seen, knowledge = picks, picks.cameras
        count, stay = len(picks.names), len(PARAMETERS)
        free = np.zeros((count, len(CAMERA)), dtype=bool)
        free[:, ESTIMATED] = True
        free[:, 0] = picks.sigma_focal > 0
        owner = np.repeat(np.arange(count)[:, None], len(CAMERA), axis=1)
        if knowledge is not None:
            free = knowledge.free
            owner[:, SHARED] = np.array(knowledge.lens)[:, None]
        elif not picks.frame_is_known:
            # Seven are free: the far camera, and for the scale the near one's distance.
            free[0], free[1, CAMERA.index("Z")] = False, False
        self.own_free = free & (owner == np.arange(count)[:, None])
        number = np.where(self.own_free, np.cumsum(self.own_free).reshape(free.shape) - 1, -1)
        self.column = np.where(free, number[owner, np.arange(len(CAMERA))], -1)
        order = np.argsort(picks.camera, kind="stable")
        self.own = np.split(order, np.searchsorted(picks.camera[order], np.arange(1, count)))
        self.fixed = np.argwhere(np.isfinite(picks.known))
        # A point without rays stays where it is, in all three coordinates.
        self.used = np.bincount(picks.point, minlength=len(picks.ids)) > 0
        self.loose = np.flatnonzero(self.used & ~np.isfinite(picks.known[:, 2]))
        self.reach = float(min(camera.centre[2] for camera in start.cameras))
        self.reach *= 1.0 if knowledge is None else SHALLOW
        self.focal = np.flatnonzero(free[:, 0]) if knowledge is None else np.zeros(0, np.int64)
        self.first_focal = np.log(focal)
        labels = [f"{picks.names[i]}: {CAMERA[k]}" for i, k in np.argwhere(self.own_free).tolist()]
        # The ends of a taped length meet in one row and are not eliminated.
        taped = knowledge.lengths if knowledge else ()
        self.lengths = tuple(one for one in taped if self.used[[*one[:2]]].all())
        ends = sorted({k for one in self.lengths for k in one[:2]})
        shape = (len(self.used), 3)
        self.kept = np.full(shape, -1)
        self.kept[ends] = len(labels) + np.arange(3 * len(ends)).reshape(-1, 3)
        labels += [f"{picks.ids[k]}: {axis}" for k in ends for axis in "XYr"]
        eliminated = self.used & (self.kept[:, 0] < 0)
        radial = start.radial if len(start.radial) else np.zeros((count, 2))
        self.start = NetworkState(
            blocks={"camera": dict(enumerate(start.cameras)), "radial": dict(enumerate(radial))},
            points=start.xyz,
            drift=np.zeros(len(labels)),
        )
        self.network = Network(
            labels=labels,
            columns={kind: {
                k: {e: at for e, at in enumerate(unknowns) if at >= 0 and (e < stay) == first}
                for k, unknowns in enumerate(self.column.tolist())
            } for kind, first in (("camera", True), ("radial", False))},
            free=np.broadcast_to(eliminated[:, None], shape), kept=self.kept,
            names=[f"{picks.ids[k]}: {axis}" for k in np.flatnonzero(eliminated) for axis in "XYr"],
            terms=(self._rays, self._known, *([self._cameras] if knowledge else [])),
            step=_stepped, rounding=ROUNDING,
            what="the pairs" if knowledge is None else "the photos",
            kind=SparseEquations if knowledge is None else BlockEquations, largest=0,
        )  # fmt: skip

    def rays(self, state: NetworkState) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return misfits (n, 2) [px], derivatives by the points (n, 2, 3) and cameras (n, 2, 12).

        A ray's misfit is where its point is seen less where it was measured.
        """
        observations, count, knowledge = self.seen, len(self.seen.camera), self.seen.cameras
        misfit, by_point = np.empty((count, 2)), np.empty((count, 2, 3))
        by_camera = np.zeros((count, 2, len(CAMERA)))
        for number, camera in state.blocks["camera"].items():
            rows = self.own[number]
            media, side = observations.media_of(number)
            view = media.view(side, camera, state.points[observations.point[rows]])
            by_point[rows], by_camera[rows, :, : len(PARAMETERS)] = view.by_point, view.by_camera
            straight = observations.pixels[rows]
            if knowledge is not None and self.column[number, -1] >= 0:
                bent = knowledge.interiors[number].radial(*state.blocks["radial"][number])
                by_camera[rows, :, len(PARAMETERS) :] = -bent.undistorted_by_k(straight)
                straight = bent.undistort(straight)
            misfit[rows] = view.pixels - straight
        return misfit, by_point, by_camera

    def _rays(self, state: NetworkState, rows: Rows) -> bool:
        observations = self.seen
        misfit, by_point, by_camera = self.rays(state)
        if not np.isfinite(misfit).all():
            return False
        weight = 1.0 / observations.sigma[:, None, None]
        lines = rows.add(misfit * weight[:, 0])
        rows.by_label(
            lines[..., None], self.column[observations.camera][:, None], by_camera * weight
        )
        rows.by_points(lines, observations.point[:, None], by_point * weight)
        return True

    def _known(self, state: NetworkState, rows: Rows) -> bool:
        observations, at, focal = self.seen, tuple(self.fixed.T), self.focal
        rows.known(
            rows.places[at], (state.points - observations.known)[at], observations.sigma_known[at]
        )
        rows.known(rows.places[self.loose, 2], state.points[self.loose, 2], self.reach)
        lengths = np.array([state.blocks["camera"][k].matrix[0, 0] for k in focal])
        drift = np.log(lengths) - self.first_focal[focal]
        rows.known(self.column[focal, 0], drift, observations.sigma_focal[focal])
        return True

    def _cameras(self, state: NetworkState, rows: Rows) -> bool:
        assert self.seen.cameras is not None
        self.seen.cameras.observe(state, rows, self.column, self.lengths)
        return True


def _sigma0(fit: Fit[NetworkState], system: _System) -> float:
    """Return the standard deviation of unit weight of rays and control; 1 where nothing checks it.

    The weak beliefs about relief have next to no residual and would make it look too good.
    """
    count = 2 * len(system.seen.camera) + len(system.fixed)
    redundancy = float(fit.linear.redundancy_numbers[:count].sum())
    return (
        float(np.sqrt((fit.residuals[:count] ** 2).sum() / redundancy)) if redundancy > 1 else 1.0
    )


def _units(
    residuals: FloatArray, redundancy: FloatArray, sigma: FloatArray, sigma0: float
) -> FloatArray:
    """Return the unit of each residual, by all rays of its stated precision, shape (n,).

    Features that are better than was believed must not make gross errors of honest picks.
    """
    _, group = np.unique(sigma, return_inverse=True)
    squares = np.bincount(group, weights=residuals**2)
    free = np.bincount(group, weights=redundancy)
    units = np.where(free >= ENOUGH, np.sqrt(squares / np.maximum(free, 1.0)), 1.0)
    return np.maximum(units, sigma0)[group]


def _gross(
    picks: JointObservations, system: _System, fit: Fit[NetworkState], sigma0: float
) -> tuple[BoolArray, FloatArray, list[Blunder]]:
    """Return which rays stay, the coordinates that stay known, and what goes: the worst of each.

    A ray is judged by the larger of its two coordinates, by the rays of its own precision, and by
    how many there are: of 350 000 honest ones 160 would pass a limit of 3.5.
    """
    count = 2 * len(picks.camera)
    tests = standardised(fit.residuals, fit.linear.redundancy_numbers)
    tests = np.abs(np.nan_to_num(tests))
    points = np.concatenate([np.repeat(picks.point, 2), system.fixed[:, 0]])
    tests[: len(points)][picks.unchecked[points]] = 0.0
    units = _units(fit.residuals[:count], fit.linear.redundancy_numbers[:count],
                   np.repeat(picks.sigma, 2), sigma0)  # fmt: skip
    rays = (tests[:count] / units).reshape(-1, 2).max(axis=1, initial=0.0)
    # That rays are more precise than they were believed to be says nothing of control.
    coordinates = tests[count:][: len(system.fixed)] / max(sigma0, 1.0)
    worst = np.zeros(len(picks.ids))
    np.maximum.at(worst, picks.point, rays)
    np.maximum.at(worst, system.fixed[:, 0], coordinates)
    bad = (rays >= worst[picks.point]) & (rays > outlier_limit(count))
    wrong = coordinates >= worst[system.fixed[:, 0]]
    wrong &= coordinates > outlier_limit(len(coordinates))
    # A wrong control point bends its neighbours: only the worst of them goes at a time.
    wrong &= coordinates >= coordinates.max(initial=0.0)
    # It bends rays of other points too, which are judged again without it.
    if coordinates[wrong].max(initial=0.0) > rays.max(initial=0.0):
        bad[:] = False
    blunders = [_of_ray(picks, k, rays[k]) for k in np.flatnonzero(bad).tolist()]
    control = picks.known.copy()
    for k in np.flatnonzero(wrong).tolist():
        point = int(system.fixed[k, 0])
        control[point] = np.nan
        blunders.append(_of_control(picks, point, coordinates[k]))
    return ~bad, control, blunders


def _adjusted(
    given: JointObservations,
    picks: JointObservations,
    system: _System,
    fit: Fit[NetworkState],
    sigma0: float,
    blunders: tuple[tuple[Blunder, ...], tuple[Blunder, ...]],
) -> JointAdjustment:
    """Return the result with its precision; blunders taken out, and left in."""
    linear = fit.linear
    assert isinstance(linear, BlockEquations)
    factor = max(sigma0, 1.0) ** 2
    cofactor = csr_matrix(linear.cofactor)

    def part(first: IntArray, second: IntArray) -> FloatArray:
        block = np.zeros((len(first), len(second)))
        a, b = np.flatnonzero(first >= 0), np.flatnonzero(second >= 0)
        if len(a) and len(b):
            block[np.ix_(a, b)] = cofactor[first[a]][:, second[b]].toarray()
        return block

    place, every = system.column[:, ESTIMATED], system.column.ravel()
    by_camera = factor * np.array([part(columns, columns) for columns in place])
    between = factor * np.array([part(place[far], place[near]) for far, near in picks.pairs])
    covariance = factor * linear.block_cofactor
    for k in np.flatnonzero(system.kept[:, 0] >= 0):
        covariance[k] = factor * part(system.kept[k], system.kept[k])
    covariance[~system.used] = np.nan
    last = _unknowns(fit.state)
    xyz = np.where(system.used[:, None], last.xyz, np.nan)
    return JointAdjustment(
        cameras=last.cameras, radial=last.radial, xyz=xyz, observations=picks,
        covariance=covariance, sigma0=sigma0, redundancy=fit.redundancy - len(system.loose),
        iterations=fit.iterations,
        residuals=system.rays(fit.state)[0], control=xyz - given.known,
        blunders=blunders[0], left_in=blunders[1], by_camera=by_camera, between=between,
        of_cameras=factor * part(every, every) if picks.cameras else np.zeros((0, 0)),
    )  # fmt: skip
