"""The stages of a pair's orientation: control, ties, lens, wall, refinement.

Each stage takes the pair as oriented so far and returns it better, with what is to be told of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bifocal.matching import Features
from bifocal.model import SIGMA_RADIAL, Cameras, Images, Interior, WorldFrame
from bifocal.orientation import facade_lines, validation
from bifocal.orientation.adjustment.frame_turn import family_test, line_test
from bifocal.orientation.adjustment.pair_adjustment import (
    AdjustedPair,
    adjust,
    evaluated,
    pair_equations,
)
from bifocal.orientation.adjustment.pair_observations import PairObservations, PairUnknowns, at
from bifocal.orientation.area_points import even_points
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.starts.relative_orientation import Ties
from bifocal.orientation.tie_points import (
    refine_ties,
    tie_positions,
    wall_roughness,
    wall_test,
    with_support,
    with_ties,
    with_wall,
    without_gross_ties,
)
from bifocal.orientation.tuning import BEND, LINES, STAGES, WALLS
from bifocal.orientation.walls.reference_plane import (
    WallFace,
    choose_wall,
    onto_plane,
    rivals_in_words,
)
from bifocal.orientation.walls.wall_planes import (
    likely_wall,
    planes_of_any_direction,
    steep_rivals_in_words,
)
from bifocal.orientation.walls.wall_shape import WallShape
from bifocal.remarks import remark
from photocore.adjustment.outliers import robust_sigma
from photocore.arrays import ByteArray, FloatArray
from photocore.camera import plane_transfer
from photocore.errors import GeometryError

#: "Image plane parallel to the wall" when nothing contradicts it. [rad]
SIGMA_PARALLEL = np.deg2rad(0.3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhotoInput:
    """One photo to be oriented.

    Attributes
    ----------
    grey : ndarray, shape (h, w), uint8, or None
        None where only control points are to be used.
    interior : Interior
    name : str
        For messages.
    features : Features, optional
        Of the photo as it is.  [default: looked for]
    """

    grey: ByteArray | None
    interior: Interior
    name: str
    features: Features | None = None


Photos = tuple[PhotoInput, PhotoInput]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OrientedPair:
    """Cameras of both photos, far one first, with everything that led to them.

    Attributes
    ----------
    observations, adjusted : PairObservations, AdjustedPair
    exchanged : bool
        Whether the photos were given the other way round.
    assumed : tuple of str
        What nothing but an assumption determines.
    remarks : tuple of str
    faces : tuple of WallFace
        Where no control points define the plane: the wall, and the planes parallel to it.
    wall_named : bool
        Whether the user said which of them is the wall.
    tolerance : pair of float
        How far the wall may lie from the reference plane [m] and slope against it [m/m].
    bend : WallShape
        How far the wall is from a plane between the photos.
    lines_off : bool
        Whether lines of the façade come out of the wall by more than they may.
    aside : ndarray, shape (n, 2), or None
        A place of the far photo, and those as far away as the photos may lie aside of each other,
        on a wall that repeats itself. [ideal px]
    frame : WorldFrame or None
        Where the plane frame lies in E, N, H, if the control points say.
    """

    observations: PairObservations
    adjusted: AdjustedPair
    exchanged: bool = False
    assumed: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    faces: tuple[WallFace, ...] = ()
    wall_named: bool = False
    tolerance: tuple[float, float] = STAGES.free
    shape: WallShape = field(default_factory=WallShape)
    lines_off: bool = False
    aside: FloatArray | None = None
    frame: WorldFrame | None = None

    def readjusted(self, start: PairUnknowns | None = None, **changes: Any) -> OrientedPair:
        """Return the pair adjusted with changed observations, from here or another start."""
        observations = replace(self.observations, **changes)
        adjusted = adjust(observations, start or self.adjusted)
        return replace(self, observations=observations, adjusted=adjusted)

    def told(self, *remarks: str) -> OrientedPair:
        """Return the pair with remarks added."""
        return replace(self, remarks=(*self.remarks, *remarks))

    def settled(self, rounds: int = 2) -> OrientedPair:
        """Return the pair after its gross ties and its wall are settled."""
        pair = self
        for _ in range(rounds):
            sigma = robust_sigma(pair.adjusted.tie_misfit[pair.observations.tie_used])
            ties = without_gross_ties(pair.observations, pair.adjusted, sigma=sigma)
            if ties.free_datum:
                ties = with_wall(ties, pair.adjusted, pair.tolerance)
            pair = replace(pair, observations=ties).readjusted()
        return pair


def oriented_in_stages(
    observations: PairObservations,
    start: PairUnknowns,
    photos: Photos,
    site: SiteMeasures,
    *,
    with_control: bool,
) -> OrientedPair:
    """Return the pair after ties, lens, wall and refinement are settled.

    Ties carry the relative orientation and nothing else: they only have to lie on their epipolar
    lines. The plane is found afterwards, and comes from the control points where there are some.
    """
    images = photos[0].grey, photos[1].grey
    named, in_media = site.wall is not None, bool(start.media)
    if with_control:
        pair = control_alone(observations, start, named)
    else:
        # Distances count from the wall, and which face that is shows only in the relative model.
        few = _relative_measures(observations)
        first = with_wall(replace(observations, measured=few), start, STAGES.free, known=True)
        pair = OrientedPair(
            observations=first, adjusted=adjust(first, start), wall_named=named
        ).settled()
    if len(observations.tie1):
        pair = _with_ties(pair, observations) if with_control else pair
        pair = pair if in_media else _unbent(pair)
        if images[0] is not None and images[1] is not None:
            pair = _refined(pair, (images[0], images[1]), photos)
            if not with_control:
                pair = pair if in_media else _facing_the_wall(pair, site)
                pair = _on_the_wall(pair, (images[0], images[1]), site)
                pair = pair if in_media else _with_lines(pair, (images[0], images[1]))
        if with_control:
            pair = _with_named_wall(pair)
    if not with_control:
        pair = pair.readjusted(measured=observations.measured).settled()
        if observations.free_datum and observations.sigma_tilt is None and not in_media:
            pair = _parallel_if_so(pair, np.inf if site.parallel else np.deg2rad(1.5))
    return pair


def control_alone(observations: PairObservations, start: PairUnknowns, named: bool) -> OrientedPair:
    """Return the pair oriented by control points alone, the lens as undistorted as scanned."""
    none = np.zeros(len(observations.tie1), dtype=bool)
    first, second = (replace(i, sigma_radial=0.0) for i in observations.interiors)
    alone = replace(observations, tie_used=none, wall=none, interiors=(first, second))
    pair = OrientedPair(observations=alone, adjusted=adjust(alone, start), wall_named=named)
    return _one_zoom(pair)


def _with_ties(pair: OrientedPair, observations: PairObservations) -> OrientedPair:
    """Return a pair oriented by control points with its ties, on their epipolar lines only."""
    # Control leaves the epipolar lines uncertain by some pixels: the majority shows by how much.
    sigma = max(robust_sigma(pair.adjusted.tie_misfit), observations.sigma_tie)
    # Distortions of two lenses are not told apart by ties: they stay as they are.
    one_lens = pair.observations.sigma_zoom is not None
    interiors = observations.interiors if one_lens else pair.observations.interiors
    ties = replace(pair.observations, interiors=interiors)
    ties = without_gross_ties(ties, pair.adjusted, sigma=sigma)
    return replace(pair, observations=ties).readjusted().settled()


def with_refracted_ties(pair: OrientedPair, ties: Ties) -> OrientedPair:
    """Return a pair oriented by control points through media with ties whose bent rays meet."""
    base = with_ties(pair.observations, ties.fewer(STAGES.most_bent_ties))
    adjusted = evaluated(base, pair.adjusted)
    for _ in range(3):
        # Control leaves the rays uncertain by some pixels: the majority shows by how much.
        sigma = robust_sigma(adjusted.tie_misfit[base.tie_used])
        base = without_gross_ties(base, adjusted, sigma=sigma)
        if base.tie_used.sum() < STAGES.fewest_ties:
            return pair.told(remark("orientation.hardly_through_media"))
        adjusted = adjust(base, adjusted)
    height = np.abs(tie_positions(base, adjusted)[:, 2])
    on_wall = base.tie_used & (height < BEND.band * adjusted.cameras[0].centre[2])
    return replace(pair, observations=replace(base, wall=on_wall), adjusted=adjusted)


def _refined(pair: OrientedPair, images: Images, photos: Photos) -> OrientedPair:
    """Return the pair with its ties matched to a tenth of a pixel and supported by neighbours."""
    for _ in range(2):  # the second pass searches around better places
        moved, good = refine_ties(pair.observations, pair.adjusted, images)
        ties = pair.observations
        used = ties.tie_used & good
        if used.sum() < 20:
            raise GeometryError(
                f"{photos[0].name} and {photos[1].name} match only roughly: one is blurred, or "
                "they show different states of the wall. Take sharper photos."
            )
        ties = replace(ties, tie2=np.where(good[:, None], moved, ties.tie2), tie_used=used)
        ties = with_support(ties, pair.adjusted)
        pair = replace(pair, observations=ties).readjusted().settled()
    return pair


def _relative_measures(observations: PairObservations) -> dict[str, tuple[float, float]]:
    """Return one distance for the scale; all where an unknown lens needs their ratio."""
    measured = observations.measured
    if any(interior.is_assumed for interior in observations.interiors) or len(measured) < 2:
        return measured
    return dict(list(measured.items())[:1])


def _one_zoom(pair: OrientedPair) -> OrientedPair:
    """Return the pair with one principal distance if both photos' are the same.

    Two lenses of a bifocal pair differ by a third and more; if the focal lengths agree to within
    their precision and 3 %, the lens was not changed.
    """
    interiors, adjusted = pair.observations.interiors, pair.adjusted
    if min(i.sigma_focal for i in interiors) < 0.02 or pair.observations.sigma_body is None:
        return pair
    difference = float(np.log(adjusted.cameras[0].matrix[0, 0] / adjusted.cameras[1].matrix[0, 0]))
    sigma = float(np.hypot(adjusted.sigma("focal length", 1), adjusted.sigma("focal length", 2)))
    if abs(difference) > min(3 * sigma, 0.03) or sigma > 0.05:
        return pair
    return pair.readjusted(sigma_zoom=STAGES.one_lens)


def _unbent(pair: OrientedPair) -> OrientedPair:
    """Return the pair with the lens distortion that its photos show, said if there is some."""
    observations = pair.observations
    interiors, misfit = observations.interiors, pair.adjusted.tie_misfit
    if any(i.is_calibrated for i in interiors):
        return pair
    wide = max(interiors[0].image_size) / 2
    if not interiors[0].sigma_radial:
        before = robust_sigma(misfit[observations.tie_used])
        bent = pair.readjusted(
            interiors=tuple(replace(i, sigma_radial=SIGMA_RADIAL) for i in interiors),
            tie_used=np.abs(misfit) < 8 * before,
        )
        after = robust_sigma(bent.adjusted.tie_misfit[bent.observations.tie_used])
        if after > 0.85 * before or _corner(bent) < 3.0 * wide / 1500:
            return pair
        pair = bent.settled()
    for radial, interior in zip(pair.adjusted.radial, interiors, strict=True):
        validation.check_distortion(radial, interior)
    corner = _corner(pair)
    if corner < 1.0 * wide / 1500:
        return pair
    values = ", ".join(f"{k1:.4f} {k2:+.4f}" for k1, k2 in pair.adjusted.radial)
    return pair.told(remark("orientation.distortion_estimated", corner=corner, values=values))


def _corner(pair: OrientedPair) -> float:
    """Return how far the estimated distortion moves the middle of the photos' short edge. [px]"""
    out = []
    for radial, interior in zip(pair.adjusted.radial, pair.observations.interiors, strict=True):
        wide = max(interior.image_size) / 2
        square = (wide / interior.focal) ** 2
        out.append(abs(square * (radial[0] + square * radial[1])) * wide)
    return max(out)


def _facing_the_wall(pair: OrientedPair, site: SiteMeasures) -> OrientedPair:
    """Return the pair in the frame of the likely wall, where that has quite another direction."""
    ties, adjusted = pair.observations, pair.adjusted
    xyz = tie_positions(ties, adjusted)
    used = ties.tie_used & np.isfinite(xyz).all(axis=1)
    centres = adjusted.cameras[0].centre, adjusted.cameras[1].centre
    cell = np.floor(ties.tie1[used] / (0.03 * max(ties.interiors[0].image_size)))
    _, place, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    ties_raw = ties.interiors[0].raw(ties.tie1[used])
    planes = planes_of_any_direction(xyz[used], 1.0 / count[place.ravel()], centres)
    wall = likely_wall(planes, ties_raw, centres, site, sigma_ratio=_sigma_ratio(pair))
    if wall is None:
        return pair
    question = steep_rivals_in_words(planes, wall, ties_raw, site)
    pair = pair.told(question) if question else pair
    if wall.slope <= WALLS.face_slope:
        return pair
    cameras = onto_plane(
        adjusted.cameras, np.array([wall.offset, *-wall.normal[:2]]) / wall.normal[2]
    )
    far, near = cameras
    taped = ties.measured.get("distance1")
    scale = 1.0 if taped is None else taped[0] / float(far.centre[2])
    cameras = far._replace(centre=scale * far.centre), near._replace(centre=scale * near.centre)
    start = evaluated(ties, replace(adjusted, cameras=cameras))
    return (
        replace(pair, observations=with_wall(ties, start, STAGES.free)).readjusted(start).settled()
    )


def _on_the_wall(pair: OrientedPair, images: Images, site: SiteMeasures) -> OrientedPair:
    """Return the pair in the frame of the face that is the wall, with points from its whole area.

    Features crowd on mouldings; points of the whole area show which face is the largest.
    """
    old, adjusted = pair.observations, pair.adjusted
    raw1, raw2 = even_points(old, adjusted, images)
    extra = len(raw1)
    even = np.arange(len(old.tie1) + extra) >= len(old.tie1)
    ties = replace(
        old,
        tie1=np.concatenate([old.tie1, old.interiors[0].ideal(raw1)]),
        tie2=np.concatenate([old.tie2, old.interiors[1].ideal(raw2)]),
        tie_used=np.concatenate([old.tie_used, np.ones(extra, dtype=bool)]),
        wall=np.concatenate([old.wall, np.zeros(extra, dtype=bool)]),
        wall_rows=np.concatenate([old.wall_rows, np.zeros((3, extra))], axis=1),
    )
    # What the flow suggests is no observation until the patches agree.
    moved, good = refine_ties(ties, adjusted, images)
    ties = replace(
        ties,
        tie2=np.where((good & even)[:, None], moved, ties.tie2),
        tie_used=ties.tie_used & (good | ~even),
    )
    ties = with_support(ties, adjusted)
    ties = without_gross_ties(ties, evaluated(ties, adjusted), sigma=old.sigma_tie)
    xyz = tie_positions(ties, adjusted)
    d1 = float(adjusted.cameras[0].centre[2])
    fair = ties.tie_used & even & (np.abs(xyz[:, 2]) < 0.1 * d1)
    if fair.sum() < 200:
        fair = ties.tie_used & (np.abs(xyz[:, 2]) < 0.1 * d1)
    if fair.sum() < 20:
        return replace(pair, observations=ties).readjusted().settled()
    ties_raw = ties.interiors[0].raw(ties.tie1[fair])
    plane, faces = choose_wall(
        xyz[fair], ties_raw, adjusted.cameras, ties.interiors, site, sigma_ratio=_sigma_ratio(pair)
    )
    pair = replace(pair, faces=tuple(faces))
    pair = pair.told(*(text for text in [rivals_in_words(faces, site)] if text))
    start = evaluated(ties, replace(adjusted, cameras=onto_plane(adjusted.cameras, plane)))
    ties = with_wall(ties, start, STAGES.free)
    return replace(pair, observations=ties).readjusted(start).settled()


def lines_tested(
    pair: OrientedPair, images: Images
) -> list[tuple[facade_lines.FacadeDirection, float]]:
    """Return the façade's lines, each with how far it comes out of the wall, in sigma."""
    ties, adjusted = pair.observations, pair.adjusted
    bent = ties.radial_models(adjusted.radial)
    lines = facade_lines.lines_of_photos(images, adjusted.cameras, ties.interiors, bent)
    return [(line, line_test(line, adjusted, adjusted.covariance)) for line in lines]


def _with_lines(pair: OrientedPair, images: Images) -> OrientedPair:
    """Return the pair with its plane turned by the façade's uprights and levels.

    Those that contradict the wall found by the ties are told of and not used.
    """
    old, adjusted = pair.observations, pair.adjusted
    tested = lines_tested(pair, images)
    for line, test in tested:
        if test > STAGES.wall_limit:
            words = facade_lines.contradiction_in_words(line, adjusted.cameras, test)
            pair = replace(pair.told(words), lines_off=True)
    kept = tuple(line for line, test in tested if test <= STAGES.wall_limit)
    for name in ("upright", "level") if old.lines_bend_nothing else ():
        family = [line for line in kept if line.name == name]
        if family and family_test(family, old, adjusted, pair_equations) > STAGES.family_limit:
            kept = tuple(line for line in kept if line.name != name)
            pair = pair.told(facade_lines.family_in_words(family, adjusted.cameras))
    try:
        turned = pair.readjusted(lines=kept).settled() if kept else pair
    except GeometryError:  # no tie was left on the wall
        return pair.told(remark("orientation.lines_off_wall"))
    stays = turned.observations.wall.sum() >= LINES.wall_kept * old.wall.sum()
    return turned if stays else pair.told(remark("orientation.lines_off_wall"))


def _sigma_ratio(pair: OrientedPair) -> float:
    """Return the standard deviation of ln(d1 / d2); infinite where both tapes are in already."""
    if len(pair.observations.measured) > 1:
        return np.inf
    row = np.zeros(len(pair.adjusted.covariance))
    for number, (camera, sign) in enumerate(zip(pair.adjusted.cameras, (1.0, -1.0), strict=True)):
        row[at("Z", number + 1)] = sign / camera.centre[2]
    return float(np.sqrt(row @ pair.adjusted.covariance @ row))


def _with_named_wall(pair: OrientedPair) -> OrientedPair:
    """Return a pair oriented by control points with the wall that some of them say they lie on.

    Both planes are averaged by their covariances: the control points' own, and that of the wall's
    ties, which lies on the former as closely as the points and the wall's roughness allow. Where
    they contradict each other, control decides alone.
    """
    observations = pair.observations
    control = observations.control
    height, sigma = control.xyz[:, 2], control.sigma[:, 2]
    with np.errstate(invalid="ignore"):
        on = (
            control.positioned & observations.pick_used & (np.abs(height) <= STAGES.on_wall * sigma)
        )
    if on.sum() < 3:
        return pair
    spread = np.linalg.svd(control.xyz[on, :2] - control.xyz[on, :2].mean(axis=0))[1]
    if spread[1] < 0.1 * spread[0]:
        return pair
    # Points said to be on the wall, not measured against it, leave its roughness alone.
    noise = float(np.median(sigma[on])) if height[on].any() else 0.0
    usual = float(np.hypot(noise, wall_roughness(observations, pair.adjusted)))
    tolerance = (usual / float(np.sqrt(on.sum())), usual / float(spread[1]))
    walled = with_wall(observations, pair.adjusted, tolerance)
    if not walled.wall.any():
        return pair.told(remark("orientation.little_on_control_plane"))
    test = wall_test(walled, pair.adjusted)
    if test > STAGES.wall_limit:
        return pair.told(remark("orientation.other_plane", test=test))
    return replace(pair, observations=walled).readjusted()


def _parallel_if_so(pair: OrientedPair, most: float) -> OrientedPair:
    """Return the pair with image planes taken as parallel, if nothing contradicts it, up to `most`.

    Photos alone give the tilt to the wall to 0.1° to 0.5°; a camera that was set up square to the
    wall with care stands better than that.
    """
    for number, camera in enumerate(pair.adjusted.cameras, start=1):
        size = float(np.linalg.norm(camera.tilt))
        turns = [pair.adjusted.sigma(name, number) for name in ("turn X", "turn Y")]
        limit = 3 * float(np.linalg.norm([*turns, SIGMA_PARALLEL]))
        if size > min(limit, most):
            return pair
    sigma = _care(pair.adjusted.cameras)
    changes: dict[str, Any] = {"sigma_tilt": sigma}
    if sigma < SIGMA_PARALLEL / 2:
        # Better than any wall is flat: the reference plane is then parallel to the image planes
        # and touches the wall, which may slope against it.
        tolerance = (1e-4, STAGES.uneven)
        pair = replace(pair, tolerance=tolerance)
        observations = with_wall(pair.observations, pair.adjusted, tolerance)
        changes["wall_rows"], changes["wall"] = observations.wall_rows, observations.wall
    note = remark("orientation.parallel_to_wall", angle=np.rad2deg(sigma))
    return replace(pair, assumed=(*pair.assumed, note)).readjusted(**changes)


def _care(cameras: Cameras) -> float:
    """Return how carefully the cameras seem to have been set up, from photo against photo. [rad]

    Over the wall, photo 2 is a turned and keystoned photo 1. Set up independently to an accuracy
    sigma, turn and keystone between the photos scatter by about sigma; photos turned by less than
    0.02° against each other, and keystoned no more than an uneven wall explains, were not set up
    to 0.3°.
    """
    far, near = cameras
    corner = [np.eye(3), np.eye(3)]  # pixels from the principal point to those from the corner
    for shift, camera in zip(corner, cameras, strict=True):
        shift[:2, 2] = camera.matrix[:2, 2]
    centred = np.linalg.inv(corner[1]) @ plane_transfer(far, near, np.zeros(3)) @ corner[0]
    centred /= centred[2, 2]
    focal = 1.0 / np.hypot(1.0 / far.matrix[0, 0], 1.0 / near.matrix[0, 0])
    keystone = float(np.abs(centred[2, :2]).max() * focal)
    turn = abs(float(np.arctan2(centred[1, 0] - centred[0, 1], centred[0, 0] + centred[1, 1])))
    if keystone > STAGES.uneven:
        return SIGMA_PARALLEL
    return float(np.clip(1.5 * turn, np.deg2rad(0.02), SIGMA_PARALLEL))
