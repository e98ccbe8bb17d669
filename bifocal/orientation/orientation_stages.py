"""The stages of a pair's orientation: control, ties, lens, wall, refinement, gross errors.

Each stage takes the pair as oriented so far and returns it better, with what is to be told of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bifocal.orientation import validation
from bifocal.orientation.area_points import even_points
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.interior_orientation import Cameras, Images, Interior
from bifocal.orientation.pair_adjustment import AdjustedPair, adjust, evaluated
from bifocal.orientation.pair_observations import PairObservations, PairUnknowns
from bifocal.orientation.reference_plane import Face, choose_wall, rivals_in_words
from bifocal.orientation.tie_points import ROUGHNESS, classify, refine_ties, robust_sigma
from photocore.arrays import ByteArray, FloatArray
from photocore.camera import plane_transfer, triangulate
from photocore.errors import GeometryError
from photocore.rotation import rotation_from_vector

#: "Image plane parallel to the wall" when nothing contradicts it. [rad]
SIGMA_PARALLEL = np.deg2rad(0.3)
#: A wall's own face may slope by this against the plane it was meant to be. [m/m]
UNEVEN = 0.004
#: A control point's misfit beyond this many standard deviations is a gross error.
GROSS_LIMIT = 4.0
#: Ties within about this share of d1 of the control points' plane are taken for the wall at first.
PLANE_SHARE = 0.003


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
    """

    grey: ByteArray | None
    interior: Interior
    name: str


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
    faces : tuple of Face
        Where no control points define the plane: the wall, and the planes parallel to it.
    wall_named : bool
        Whether the user said which of them is the wall.
    """

    observations: PairObservations
    adjusted: AdjustedPair
    exchanged: bool = False
    assumed: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    faces: tuple[Face, ...] = ()
    wall_named: bool = False

    def readjusted(self, start: PairUnknowns | None = None, **changes: Any) -> OrientedPair:
        """Return the pair adjusted with changed observations, from here or another start."""
        observations = replace(self.observations, **changes)
        adjusted = adjust(observations, start or self.adjusted)
        return replace(self, observations=observations, adjusted=adjusted)

    def told(self, *remarks: str) -> OrientedPair:
        """Return the pair with remarks added."""
        return replace(self, remarks=(*self.remarks, *remarks))

    def settled(self, shares: tuple[float, ...] = ROUGHNESS) -> OrientedPair:
        """Return the pair after the wall and the gross ties are settled."""
        pair = self
        for share in shares:
            sigma = max(robust_sigma(pair.adjusted.tie_misfit[pair.observations.tie_used]), 0.03)
            ties = classify(pair.observations, pair.adjusted, share=share, sigma=sigma)
            pair = replace(pair, observations=ties).readjusted()
        return pair


def oriented_in_stages(
    observations: PairObservations,
    cameras: Cameras,
    photos: Photos,
    site: SiteMeasures,
    *,
    with_control: bool,
) -> OrientedPair:
    """Return the pair after ties, wall, lens assumptions and refinement are settled."""
    images = photos[0].grey, photos[1].grey
    remarks: tuple[str, ...] = ()
    if with_control:
        observations, cameras, remarks = _control_first(observations, cameras)
    pair = OrientedPair(
        observations=observations,
        adjusted=adjust(observations, PairUnknowns(cameras=cameras)),
        remarks=remarks,
        wall_named=site.wall is not None,
    )
    if with_control:
        pair = _one_zoom(pair)
    if len(observations.tie1) and images[0] is not None and images[1] is not None:
        pictures = images[0], images[1]
        pair = _with_even_points(_unbent(pair.settled()), pictures, site)
        for _ in range(2):  # the second pass searches around better places
            moved, good = refine_ties(pair.observations, pair.adjusted, pictures)
            ties = pair.observations
            used = ties.tie_used & good
            if used.sum() < 20:
                raise GeometryError(
                    f"{photos[0].name} and {photos[1].name} match only roughly: one is blurred, or "
                    "they show different states of the wall. Take sharper photos."
                )
            tie2 = np.where(good[:, None], moved, ties.tie2)
            pair = pair.readjusted(tie2=tie2, tie_used=used, wall=ties.wall & good)
            pair = pair.settled(ROUGHNESS[1:])
    if pair.observations.free_datum and pair.observations.sigma_tilt is None:
        pair = _parallel_if_so(pair)
    return pair


def _control_first(
    observations: PairObservations, cameras: Cameras
) -> tuple[PairObservations, Cameras, tuple[str, ...]]:
    """Return the observations with the ties that fit the control's cameras, those, remarks."""
    none = np.zeros(len(observations.tie1), dtype=bool)
    start = PairUnknowns(cameras=cameras)
    alone = adjust(replace(observations, tie_used=none, wall=none), start)
    if not len(observations.tie1):
        return observations, alone.cameras, ()
    # Control leaves the epipolar lines uncertain by some pixels: the majority shows by how much.
    sigma = max(robust_sigma(alone.tie_misfit), observations.sigma_tie)
    joined = classify(observations, alone, share=PLANE_SHARE, sigma=sigma)
    if joined.wall.sum() < 20:
        remark = (
            "Hardly any detail lies on the control points' plane; relief counts from the control "
            "points alone."
        )
        return replace(joined, wall=none), alone.cameras, (remark,)
    control = observations.control
    flat = control.sigma[np.abs(np.nan_to_num(control.xyz[:, 2])) < 0.05, 2]
    tight = max(float(np.median(flat)) if len(flat) else 0.003, 0.001)
    slope = 2 * tight / float(alone.cameras[0].centre[2])
    return replace(joined, sigma_plane=tight, sigma_slope=slope), alone.cameras, ()


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
    return pair.readjusted(sigma_zoom=5e-4)


def _unbent(pair: OrientedPair) -> OrientedPair:
    """Return the pair with estimated lens distortion where the photos clearly show some."""
    interiors, misfit = pair.observations.interiors, pair.adjusted.tie_misfit
    if any(i.is_calibrated for i in interiors):
        return pair
    before = robust_sigma(misfit)
    bent = pair.readjusted(
        interiors=tuple(replace(i, sigma_radial=0.1) for i in interiors),
        tie_used=np.abs(misfit) < 8 * before,
    )
    wide = max(interiors[0].image_size) / 2
    radial = bent.adjusted.radial
    corner = max(
        abs(k) * (wide / i.focal) ** 2 * wide for k, i in zip(radial, interiors, strict=True)
    )
    if robust_sigma(bent.adjusted.tie_misfit) > 0.85 * before or corner < 3.0:
        return pair
    for k, interior in zip(radial, interiors, strict=True):
        validation.check_distortion(k, interior)
    bent = bent.settled()
    return bent.told(
        f"The photos show lens distortion of about {corner:.0f} px at the edge; it was estimated "
        "from the common points (k = "
        + ", ".join(f"{k:.4f}" for k in bent.adjusted.radial)
        + "). A calibrated lens (`bifocal calibrate`, --lens) is more reliable."
    )


def _with_even_points(pair: OrientedPair, images: Images, site: SiteMeasures) -> OrientedPair:
    """Return the pair with points from the whole area, on the face that is the wall.

    Where control points define the plane, the frame stays theirs.
    """
    old, adjusted = pair.observations, pair.adjusted
    count = len(old.tie1)
    raw1, raw2 = even_points(old, adjusted, images)
    extra = len(raw1)
    ties = replace(
        old,
        tie1=np.concatenate([old.tie1, old.interiors[0].ideal(raw1)]),
        tie2=np.concatenate([old.tie2, old.interiors[1].ideal(raw2)]),
        tie_used=np.concatenate([old.tie_used, np.ones(extra, dtype=bool)]),
        wall=np.concatenate([old.wall, np.zeros(extra, dtype=bool)]),
        sigma_wall=np.concatenate([old.sigma_wall, np.ones(extra)]),
    )
    # What the flow suggests is no observation until the patches agree.
    moved, good = refine_ties(ties, adjusted, images)
    even = np.arange(len(good)) >= count
    ties = replace(
        ties,
        tie2=np.where((good & even)[:, None], moved, ties.tie2),
        tie_used=ties.tie_used & (good | ~even),
    )
    if not ties.free_datum:
        sigma = max(robust_sigma(adjusted.tie_misfit[old.tie_used]), 0.03)
        held = ties.wall.any()
        ties = classify(ties, evaluated(ties, adjusted), share=ROUGHNESS[1], sigma=sigma)
        return replace(pair, observations=ties).readjusted(wall=ties.wall & held)
    xyz = triangulate(*adjusted.cameras, *ties.straight_ties(adjusted.radial))
    d1 = float(adjusted.cameras[0].centre[2])
    fair = ties.tie_used & even & (np.abs(xyz[:, 2]) < 0.1 * d1)
    if fair.sum() < 200:
        return replace(pair, observations=ties).readjusted()
    seen = ties.interiors[0].raw(ties.tie1[fair])
    plane, faces = choose_wall(xyz[fair], seen, adjusted.cameras, ties.interiors, site)
    pair = replace(pair, faces=tuple(faces))
    pair = pair.told(*(text for text in [rivals_in_words(faces, site)] if text))
    start = evaluated(ties, replace(adjusted, cameras=_onto_plane(adjusted.cameras, plane)))
    sigma = max(robust_sigma(start.tie_misfit[ties.tie_used]), 0.03)
    ties = classify(ties, start, share=ROUGHNESS[1], sigma=sigma)
    return replace(pair, observations=ties).readjusted(start).settled(ROUGHNESS[1:])


def _onto_plane(cameras: Cameras, plane: FloatArray) -> Cameras:
    """Return cameras in the frame of the plane z = a + b X + c Y, X and Y all but kept."""
    normal = np.array([-plane[1], -plane[2], 1.0])
    normal /= np.linalg.norm(normal)
    # The rotation that takes the normal to the new Z axis, about their common perpendicular.
    turn = rotation_from_vector([normal[1], -normal[0], 0.0])
    origin = np.array([0.0, 0.0, plane[0]])
    return cameras[0].moved(turn, origin), cameras[1].moved(turn, origin)


def _parallel_if_so(pair: OrientedPair) -> OrientedPair:
    """Return the pair with image planes taken as parallel, if nothing contradicts it.

    Photos alone give the tilt to the wall to 0.1° to 0.5°; a camera that was set up square to the
    wall with care stands better than that.
    """
    for number, camera in enumerate(pair.adjusted.cameras, start=1):
        size = float(np.linalg.norm(camera.tilt))
        turns = [pair.adjusted.sigma(name, number) for name in ("turn X", "turn Y")]
        limit = 3 * float(np.linalg.norm([*turns, SIGMA_PARALLEL]))
        if size > min(limit, np.deg2rad(1.5)):
            return pair
    sigma = _care(pair.adjusted.cameras)
    changes: dict[str, Any] = {"sigma_tilt": sigma}
    if sigma < SIGMA_PARALLEL / 2:
        # Better than any wall is flat: the reference plane is then parallel to the image planes
        # and touches the wall, which may slope against it.
        changes |= {"sigma_plane": 1e-4, "sigma_slope": UNEVEN}
    note = (
        f"image planes parallel to the wall within {np.rad2deg(sigma):.2g}° (as they are to each "
        "other)"
    )
    return replace(pair, assumed=(*pair.assumed, note)).readjusted(**changes)


def _care(cameras: Cameras) -> float:
    """Return how carefully the cameras seem to have been set up, from photo against photo. [rad]

    Over the wall, photo 2 is a turned and keystoned photo 1. Set up independently to an accuracy
    sigma, turn and keystone between the photos scatter by about sigma; photos turned by less than
    0.02° against each other, and keystoned no more than an uneven wall explains, were not set up
    to 0.3°.
    """
    far, near = cameras
    matrix = plane_transfer(far, near, np.zeros(3))
    corner = [np.eye(3), np.eye(3)]  # pixels from the principal point to those from the corner
    for shift, camera in zip(corner, cameras, strict=True):
        shift[:2, 2] = camera.matrix[:2, 2]
    centred = np.linalg.inv(corner[1]) @ matrix @ corner[0]
    centred /= centred[2, 2]
    focal = 1.0 / np.hypot(1.0 / far.matrix[0, 0], 1.0 / near.matrix[0, 0])
    keystone = float(np.abs(centred[2, :2]).max() * focal)
    turn = abs(float(np.arctan2(centred[1, 0] - centred[0, 1], centred[0, 0] + centred[1, 1])))
    if keystone > UNEVEN:
        return SIGMA_PARALLEL
    return float(np.clip(1.5 * turn, np.deg2rad(0.02), SIGMA_PARALLEL))


def without_gross(pair: OrientedPair) -> OrientedPair:
    """Return the pair without gross control points, taking out the worst one by one."""
    count = len(pair.observations.control.ids)
    dropped: list[int] = list(np.flatnonzero(~pair.observations.pick_used))
    for _ in range(max(count // 3, 1) if count > 4 else 0):
        used = pair.observations.pick_used.copy()
        test = np.where(used, pair.adjusted.control_test, 0.0)
        usual = max(1.0, float(np.median(test[used])) if used.any() else 1)
        worst = int(test.argmax())
        if test[worst] < GROSS_LIMIT * usual or used.sum() <= 4:
            break
        used[worst] = False
        dropped.append(worst)
        pair = pair.readjusted(pick_used=used)
    # A point thrown out by the first, rough fit may be good after all.
    back = [i for i in dropped if pair.adjusted.control_test[i] < GROSS_LIMIT]
    if back:
        used = pair.observations.pick_used.copy()
        used[back] = True
        pair = pair.readjusted(pick_used=used)
    return pair
