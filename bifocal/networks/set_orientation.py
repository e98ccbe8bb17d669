"""Photos of one wall set up together: ties of all, control, tapes and the wall, one adjustment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal.matching import Features, find_features, spread_evenly
from bifocal.networks.camera_knowledge import CameraKnowledge
from bifocal.networks.joint_adjustment import (
    JointAdjustment,
    JointUnknowns,
    adjust_jointly,
    settled_jointly,
)
from bifocal.networks.joint_observations import JointObservations, with_rays
from bifocal.networks.joint_ties import SharedPoints, common_features
from bifocal.networks.set_start import FirstCameras, first_cameras_of, meeting
from bifocal.orientation import (
    INDEPENDENT,
    TIES,
    WALLS,
    Control,
    FacadeDirection,
    PairObservations,
    PairUnknowns,
    PhotoInput,
    SiteMeasures,
    frame_of,
    largest_plane,
    narrow_face,
    refine_ties,
    turned_by_lines,
    validation,
)
from bifocal.remarks import remark
from photocore.adjustment import OUTLIER_LIMIT
from photocore.adjustment.outliers import robust_sigma
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import project_with_jacobian, ray_on_plane
from photocore.cli import Progress, no_progress
from photocore.errors import GeometryError

#: Features of so many photos, of more fewer each: matching all with all takes time in proportion to
#: the photos. And pixels in which they are looked for.
FEATURES, PHOTOS, PIXELS = 8000, 3, 6e6
#: From more photos on pixels are fewer, too, and the first pair takes the features of the set: 20
#: photos of 1.5 megapixels take 27 CPU s for 65, or 16 on one core.
MANY = 6
#: Common points of two photos that are looked at, and rays of a photo that are kept.
MATCHES, RAYS = 600, 300
#: Precision of features as found, of the searched photo, and of patches before they tell it. [px]
FOUND, REFINED = 0.5, 0.2
#: Chance from which a point tells of the wall's plane.
LEAST_CHANCE = 0.05


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OrientedSet:
    """Cameras of all photos, with what led to them.

    Attributes
    ----------
    first : FirstCameras
    adjusted : JointAdjustment
        Points: control in the order of its table, then ties.
    control : Control
    sigma_tie : float
        Precision of a tie's coordinate. [px]
    on_wall : int
        Ties that tell of the wall's plane.
    free_frame : bool
        Whether origin and turn of the frame are free.
    way : str
        ``control``, ``site`` or ``auto``.
    """

    first: FirstCameras
    adjusted: JointAdjustment
    control: Control
    sigma_tie: float
    on_wall: int
    free_frame: bool
    way: str


def orient_set(
    photos: Sequence[PhotoInput],
    *,
    control: Control,
    site: SiteMeasures,
    progress: Progress = no_progress,
) -> OrientedSet:
    """Return the cameras of two or more photos of one wall.

    Parameters
    ----------
    photos : sequence of PhotoInput
        In any order, with their images.
    control : Control
        With the picks of every photo; may be empty.
    site : SiteMeasures
        Distance 1 is that of the first photo, distance 2 of the second.

    Raises
    ------
    GeometryError
        If a photo is blurred or shares too little with the others, or no two make a pair.
    """
    many, share = len(photos) > MANY, min(1.0, PHOTOS / len(photos))
    most, budget = int(FEATURES * share ** (0.7 if many else 0.5)), PIXELS * share**many
    features, searched = [], []
    for k, photo in enumerate(photos):
        progress(k, len(photos) + 2, photo.name)
        assert photo.grey is not None
        validation.check_sharp(photo.name, photo.grey)
        features_of = find_features(photo.grey, limit=most, budget=budget)
        searched.append(replace(photo, features=features_of if many else None))
        features.append(replace(features_of, pixels=photo.interior.ideal(features_of.pixels)))
    progress(len(photos), len(photos) + 2, "matches")
    shared = _seen(photos, features, control)
    first = first_cameras_of(searched, shared, control, site)
    progress(len(photos) + 1, len(photos) + 2, "adjustment")
    observed = _observed(photos, shared, control, site, first)
    is_tie = observed.point >= len(control.ids)
    reduction = np.array([part.reduction for part in features])
    observed = replace(
        observed, sigma=np.where(is_tie, FOUND * reduction[observed.camera], site.sigma_pick)
    )
    state = JointUnknowns(cameras=first.cameras, xyz=first.xyz, radial=first.radial)
    before = [
        (first.xyz[observed.point] - camera.centre) @ camera.rotation[2] > 0
        for camera in first.cameras
    ]
    started = np.array(before)[observed.camera, np.arange(len(is_tie))]
    # Ends of a length that one photo shows lie on the wall: they wait until that is found.
    alone = ~is_tie & (np.bincount(observed.point)[observed.point] == 1)
    waiting = with_rays(
        observed, alone & ~np.asarray(np.isfinite(observed.known).any(axis=1))[observed.point]
    )
    # A tie whose rays run along each other would wander on them.
    observed = with_rays(observed, started & (~is_tie | first.met[observed.point]))
    count = len(control.ids)
    for rounds in (3, 1):  # the second pass searches around better places
        observed, state, _ = settled_jointly(observed, state, rounds)
        observed = _refined(photos, observed, state, first, count)
        observed, state = _met(observed, state, count)
    for _ in range(2):  # a few wrong patches hide each other
        observed, state, misfit = settled_jointly(observed, state, 1)
        observed, sigma = _without_gross(observed, misfit, count)
        observed, state = _met(observed, state, count)
    if not _holds_frame(control):
        state = _levelled(observed, state, first)
    observed, state = _with_ends(observed, state, waiting)
    return _adjusted(observed, state, first, control, site, sigma)


def _levelled(
    observed: JointObservations, state: JointUnknowns, first: FirstCameras
) -> JointUnknowns:
    """Return the state in the frame of the wall on which the first pair stands.

    While nothing but a pair's cameras holds the frame, principal points that move turn the wall in
    it: by 5 mrad on a church seen aslant, 9 cm at its ends.
    """
    band = WALLS.rough_band * float(max(camera.centre[2] for camera in state.cameras))
    near = first.met & (np.abs(first.xyz[:, 2]) < band)
    near &= np.bincount(observed.point, minlength=len(near)) >= 2
    if near.sum() < TIES.fewest_on_wall:
        return state
    turn, origin = frame_of(largest_plane(state.xyz[near], band=band))
    cameras = tuple(camera.moved(turn, origin) for camera in state.cameras)
    return replace(state, cameras=cameras, xyz=(state.xyz - origin) @ turn.T)


def _with_ends(
    observed: JointObservations, state: JointUnknowns, ends: JointObservations
) -> tuple[JointObservations, JointUnknowns]:
    """Return the observations with rays that meet no other, and their points on the wall."""
    xyz = state.xyz.copy()
    for camera, point, pixels in zip(ends.camera, ends.point, ends.pixels, strict=True):
        xyz[point] = ray_on_plane(state.cameras[camera], pixels[None])[0]
    joined = replace(
        observed,
        camera=np.concatenate([observed.camera, ends.camera]),
        point=np.concatenate([observed.point, ends.point]),
        pixels=np.concatenate([observed.pixels, ends.pixels]),
        sigma=np.concatenate([observed.sigma, ends.sigma]),
    )
    return joined, replace(state, xyz=xyz)


def _met(
    observed: JointObservations, state: JointUnknowns, control: int
) -> tuple[JointObservations, JointUnknowns]:
    """Return the rays without ties that wander along them, and ties where their rays meet."""
    shared = SharedPoints(
        photo=observed.camera, point=observed.point, pixels=observed.pixels, count=len(observed.ids)
    )
    places = meeting(dict(enumerate(state.cameras)), shared, shared.pixels)
    met = np.asarray(np.isfinite(places).all(axis=1))
    met[:control] = False
    xyz = np.where(met[:, None], places, state.xyz)
    met[:control] = True
    return with_rays(observed, met[observed.point]), replace(state, xyz=xyz)


def _without_gross(
    observed: JointObservations, misfit: FloatArray, control: int
) -> tuple[JointObservations, float]:
    """Return the rays without those that most ties contradict, and the precision of these. [px]"""
    ties = observed.point >= control
    free = max(1.0 - 1.5 * len(np.unique(observed.point[ties])) / max(ties.sum(), 1), 0.05)
    sigma = max(robust_sigma(misfit[ties].ravel()) / float(np.sqrt(free)), TIES.best)
    kept = ~ties | (np.abs(misfit).max(axis=1) < OUTLIER_LIMIT * sigma)
    stated = np.where(ties, sigma, observed.sigma)
    return with_rays(replace(observed, sigma=stated), kept), sigma


def _seen(
    photos: Sequence[PhotoInput], features: Sequence[Features], control: Control
) -> SharedPoints:
    """Return where control points and then ties are seen, free of the lens files' distortion."""
    shapes = [photo.interior.image_size[::-1] for photo in photos]
    every = common_features(features, shapes, ~np.eye(len(photos), dtype=bool), most=MATCHES)
    ties = _spread(every, shapes)
    count, picks = len(control.ids), control.picks if control.ids else ()
    picked = [np.flatnonzero(np.isfinite(pixels).all(axis=1)) for pixels in picks]
    parts = [photos[k].interior.ideal(picks[k][rows]) for k, rows in enumerate(picked)]
    return SharedPoints(
        photo=np.r_[np.repeat(np.arange(len(picked)), [len(r) for r in picked]), ties.photo]
        .astype(np.int64),
        point=np.concatenate([*picked, ties.point + count]),
        pixels=np.concatenate([*parts, ties.pixels]),
        count=count + ties.count,
    )  # fmt: skip


def _spread(ties: SharedPoints, shapes: Sequence[tuple[int, int]]) -> SharedPoints:
    """Return some hundred rays of each photo, of points that most photos show, evenly spread."""
    count = np.bincount(ties.point, minlength=ties.count)
    keep = np.zeros(len(ties.photo), dtype=bool)
    for k, shape in enumerate(shapes):
        rows = np.flatnonzero(ties.photo == k)
        few = 1.0 / count[ties.point[rows]]
        keep[rows[spread_evenly(ties.pixels[rows], few, shape, RAYS)]] = True
    keep &= (np.bincount(ties.point[keep], minlength=ties.count) >= 2)[ties.point]
    number = np.cumsum(np.bincount(ties.point[keep], minlength=ties.count) > 0) - 1
    return SharedPoints(
        photo=ties.photo[keep], point=number[ties.point[keep]], pixels=ties.pixels[keep],
        count=int(number[-1]) + 1 if len(number) else 0,
    )  # fmt: skip


def _observed(
    photos: Sequence[PhotoInput], points: SharedPoints, control: Control, site: SiteMeasures,
    first: FirstCameras,
) -> JointObservations:  # fmt: skip
    """Return all rays, in the frame of control, or without enough of it of the first pair."""
    coordinates, sigma = np.full((points.count, 3), np.nan), np.ones((points.count, 3))
    held: dict[int, tuple[str, ...]] = {}
    one_body = len({(i.image_size, i.is_calibrated) for i in first.interiors}) == 1
    one_body &= not first.interiors[0].is_calibrated
    centres = 0.002 * float(np.hypot(*first.interiors[0].image_size))
    if _holds_frame(control):
        coordinates[: len(control.ids)], sigma[: len(control.ids)] = control.xyz, control.sigma
    else:
        pose = ("turn X", "turn Y", "turn Z", "X", "Y", "Z")
        held = {first.far: pose, first.near: ("Z",)}
    return JointObservations(
        names=tuple(photo.name for photo in photos), camera=points.photo, point=points.point,
        pixels=points.pixels, sigma=np.full(len(points.photo), site.sigma_pick),
        ids=(*control.ids, *(f"tie {k + 1}" for k in range(points.count - len(control.ids)))),
        known=coordinates, sigma_known=sigma, sigma_focal=np.zeros(len(photos)),
        cameras=CameraKnowledge(
            interiors=first.interiors, lens=first.lens, held=held, by_wall=bool(held),
            sigma_body=centres if one_body else None,
        ),
    )  # fmt: skip


def _holds_frame(control: Control) -> bool:
    """Whether control points alone hold the frame: four that two photos or more show."""
    if not control.ids:
        return False
    shown = sum(np.isfinite(picks).all(axis=1).astype(int) for picks in control.picks)
    return int((control.positioned & (shown >= 2)).sum()) >= 4


def _refined(
    photos: Sequence[PhotoInput], observed: JointObservations, state: JointUnknowns,
    first: FirstCameras, fewest: int,
) -> JointObservations:  # fmt: skip
    """Return ties matched by patches to a tenth of a pixel.

    A tie stays where its first photo shows it; the other photos show it where patches agree.
    """
    is_tie = observed.point >= fewest
    home = np.full(len(observed.ids), len(photos))
    np.minimum.at(home, observed.point[is_tie], observed.camera[is_tie])
    place = np.full((len(observed.ids), 2), np.nan)
    at_home = is_tie & (observed.camera == home[observed.point])
    place[observed.point[at_home]] = observed.pixels[at_home]
    pixels, good = observed.pixels.copy(), ~is_tie | at_home
    greys = [photo.grey for photo in photos if photo.grey is not None]
    for one, first_grey in enumerate(greys):
        for second, grey in enumerate(greys):
            rays = is_tie & (observed.camera == second) & (home[observed.point] == one) & ~at_home
            if rays.any():
                pixels[rays], good[rays] = refine_ties(
                    PairObservations(
                        interiors=(first.interiors[one], first.interiors[second]),
                        tie1=place[observed.point[rays]], tie2=pixels[rays],
                        tie_used=np.ones(int(rays.sum()), dtype=bool),
                    ),
                    PairUnknowns(
                        cameras=(state.cameras[one], state.cameras[second]),
                        radial=state.radial[[one, second]],
                    ),
                    (first_grey, grey),
                )  # fmt: skip
    sigma = np.where(is_tie, REFINED, observed.sigma)
    return with_rays(replace(observed, pixels=pixels, sigma=sigma), good)


def _adjusted(
    observed: JointObservations, state: JointUnknowns, first: FirstCameras, control: Control,
    site: SiteMeasures, sigma_tie: float,
) -> OrientedSet:  # fmt: skip
    """Return everything adjusted once, with control, tapes, lines and the wall.

    Errors of ties are smooth over a photo: they count as `INDEPENDENT` ones.
    """
    ties = observed.point >= len(control.ids)
    crowd = np.bincount(observed.camera[ties], minlength=len(observed.names)) / INDEPENDENT
    sigma = np.where(
        ties, sigma_tie * np.sqrt(np.maximum(crowd, 1.0))[observed.camera], site.sigma_pick
    )
    coordinates, spread = observed.known.copy(), observed.sigma_known.copy()
    knowledge, on_wall = observed.cameras, np.zeros(len(coordinates), dtype=bool)
    assert knowledge is not None
    free_frame = knowledge.by_wall and control.positioned.sum() < 2
    pair = first.pair.observations
    turning: tuple[FacadeDirection, ...] = ()
    if knowledge.by_wall:
        count = len(control.ids)
        coordinates[:count], spread[:count] = control.xyz, control.sigma
        on_wall, rough = _wall(observed, state, count, sigma_tie)
        coordinates[on_wall, 2], spread[on_wall, 2] = 0.0, rough[on_wall]
        held = {first.far: ("turn Z", "X", "Y")} if free_frame else {}
        cameras = {1: first.far, 2: first.near}
        tilts = {} if pair.sigma_tilt is None else dict.fromkeys(cameras.values(), pair.sigma_tilt)
        lines = tuple(replace(line, camera=cameras[line.camera] + 1) for line in pair.lines)
        turning, lines = (lines, ()) if pair.lines_bend_nothing else ((), lines)
        knowledge = replace(knowledge, held=held, sigma_tilts=tilts, lines=lines)
    shares_of = {"distance1": {0: 1.0}, "distance2": {1: 1.0}, "delta_d": {0: 1.0, 1: -1.0}}
    spreads = control.sigma_lengths or (np.nan,) * len(control.lengths)
    usual = float(control.sigma.min(initial=0.003))
    knowledge = replace(
        knowledge,
        distances=tuple(
            (shares, float(getattr(site, name)), site.sigma)
            for name, shares in shares_of.items() if getattr(site, name) is not None
        ),
        lengths=tuple(
            (a, b, metres, usual if np.isnan(s) else s)
            for (a, b, metres), s in zip(control.lengths, spreads, strict=True)
        ),
    )  # fmt: skip
    observed = replace(
        observed, sigma=sigma, known=coordinates, sigma_known=spread, cameras=knowledge
    )
    adjusted = adjust_jointly(observed, state)
    adjusted = turned_set(adjusted, turning) if turning else adjusted
    return OrientedSet(
        first=first, adjusted=adjusted, control=control, sigma_tie=sigma_tie,
        on_wall=int(on_wall.sum()), free_frame=bool(free_frame),
        way="auto" if knowledge.by_wall else "control",
    )  # fmt: skip


def turned_set(adjusted: JointAdjustment, lines: Sequence[FacadeDirection]) -> JointAdjustment:
    """Return cameras and points in a frame that lines turn, as `turned_by_lines` does a pair's."""
    knowledge, factor = adjusted.observations.cameras, max(adjusted.sigma0, 1.0) ** 2
    assert knowledge is not None
    scale = np.sqrt(np.diag(adjusted.of_cameras))
    unit = np.where(scale > 0, scale, np.inf)[:, None]  # as correlations: units differ by far
    inverse = np.linalg.pinv(adjusted.of_cameras / (unit * unit.T), rcond=1e-13, hermitian=True)
    frame, cofactor = turned_by_lines(
        lines, adjusted.cameras, knowledge.free.ravel(), adjusted.of_cameras / factor,
        lambda moves: factor * (moves / unit).T @ inverse @ (moves / unit),
    )  # fmt: skip
    xyz = np.where(np.isfinite(adjusted.xyz), frame(np.nan_to_num(adjusted.xyz)), np.nan)
    return replace(
        adjusted, cameras=tuple(camera.carried(frame) for camera in adjusted.cameras), xyz=xyz,
        control=adjusted.control + xyz - adjusted.xyz, of_cameras=factor * cofactor,
    )  # fmt: skip


def _wall(
    observations: JointObservations, state: JointUnknowns, control: int, sigma_tie: float
) -> tuple[BoolArray, FloatArray]:
    """Return which ties tell of the wall's plane, and by what sigma they lie on it, (p,). [m]

    Roughness is common to stretches of the wall, as in `bifocal.orientation.tie_points.with_wall`.

    Raises
    ------
    GeometryError
        If there is no wall.
    """
    xyz = state.xyz
    camera = max(state.cameras, key=lambda one: float(one.centre[2]))
    normal = np.zeros((len(xyz), 3, 3))
    for k, own in enumerate(state.cameras):
        points = observations.point[observations.camera == k]
        by = project_with_jacobian(own, xyz[points]).by_point / sigma_tie
        np.add.at(normal, points, by.transpose(0, 2, 1) @ by)
    usable = np.isfinite(xyz).all(axis=1) & (np.linalg.eigvalsh(normal)[:, 0] > 1.0)
    usable[:control] = False
    sigma = np.full(len(xyz), np.nan)
    sigma[usable] = np.sqrt(np.linalg.inv(normal[usable])[:, 2, 2])
    face = narrow_face(xyz[usable], sigma[usable], band=WALLS.rough_band * float(camera.centre[2]))
    chance = np.zeros(len(xyz))
    chance[usable] = face.chance
    width = 0.1 * 2 * camera.matrix[0, 2] * camera.centre[2] / camera.matrix[0, 0]
    cells = len(np.unique(np.floor(xyz[chance > LEAST_CHANCE, :2] / width), axis=0))
    if chance.sum() < TIES.fewest_on_wall or cells < TIES.fewest_cells:
        raise GeometryError(remark("set.no_plane", count=len(state.cameras)))
    common = max(float(chance.sum()) / max(cells / 4.0, 3.0), 1.0)
    with np.errstate(divide="ignore"):
        return chance > LEAST_CHANCE, np.hypot(face.roughness, 1e-5) * np.sqrt(common / chance)
