"""What a pair is oriented from: what is given, its common points, and cameras to start from."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from bifocal.matching import Features, PickVerdict, find_features, held_against_photos
from bifocal.model import Cameras, Interiors, PairMedia
from bifocal.orientation import validation
from bifocal.orientation.adjustment.pair_observations import PairObservations
from bifocal.orientation.control_points import Control, SiteMeasures
from bifocal.orientation.orientation_stages import SIGMA_PARALLEL, Photos
from bifocal.orientation.repetition import Repetition, repetition
from bifocal.orientation.starts.photo_order import first_is_far
from bifocal.orientation.starts.relative_orientation import (
    Ties,
    epipolar_distance,
    find_ties,
    first_cameras,
    plane_scale,
    sought_focal,
)
from bifocal.orientation.starts.space_resection import resect
from bifocal.orientation.tie_points import with_ties
from bifocal.orientation.tuning import CONTROL
from bifocal.remarks import remark
from photocore.adjustment.outliers import robust_sigma
from photocore.arrays import BoolArray
from photocore.camera import Similarity, fit_plane, fundamental, ray_on_plane
from photocore.errors import GeometryError, located


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Given:
    """What `orient_pair` is given.

    Attributes
    ----------
    photos, control, site, media
    settled : bool
        Where no slip is to be looked for any more.
    exchanged : bool
        Whether the photos are the other way round than they were named.
    """

    photos: Photos
    control: Control
    site: SiteMeasures
    media: PairMedia = field(default_factory=PairMedia.none)
    settled: bool = False
    exchanged: bool = False

    @property
    def pick_verdict(self) -> PickVerdict:
        """What the photos say of the control points' picks; nothing where there are no photos."""
        first, second = (photo.grey for photo in self.photos)
        if first is None or second is None:
            return PickVerdict(likeness=np.zeros(0))
        picks = self.control.pixels1, self.control.pixels2
        return held_against_photos((first, second), *picks)

    @property
    def turned(self) -> Given:
        """The same with the photos' names, not what was typed, the other way round."""
        first, second = self.photos
        one, two = (
            replace(photo, grey=of.grey, name=of.name)
            for photo, of in ((first, second), (second, first))
        )
        return replace(self, photos=(one, two), exchanged=not self.exchanged)

    @property
    def names(self) -> tuple[str, str]:
        """Names of the photos."""
        return self.photos[0].name, self.photos[1].name

    @property
    def interiors(self) -> Interiors:
        """Interior orientations of the photos."""
        return self.photos[0].interior, self.photos[1].interior

    def with_interiors(self, interiors: Interiors) -> Given:
        """Return the same with other interior orientations."""
        both = zip(self.photos, interiors, strict=True)
        first, second = (replace(photo, interior=interior) for photo, interior in both)
        return replace(self, photos=(first, second))

    @property
    def enough(self) -> bool:
        """Whether control points alone orient both cameras."""
        positioned, control = self.control.positioned, self.control
        return all(
            (positioned & np.isfinite(pixels).all(axis=1)).sum() >= 4
            for pixels in (control.pixels1, control.pixels2)
        )


def order_of(inputs: Given, ties: Ties) -> float:
    """Return by how many standard deviations the first photo is the far one.

    Focal lengths and distances that were typed tell nothing of the photos' order, unless the scale
    on the wall fits them in one order only, or both lenses are alike; unknown lenses neither.
    """
    first, second = inputs.interiors
    assumed = first.is_assumed or second.is_assumed
    alike = first.image_size == second.image_size and first.focal != second.focal
    silent = assumed or (alike and (first.is_typed or second.is_typed))
    far, near = (photo.grey for photo in inputs.photos)
    if inputs.site.ordered or not silent or far is None or near is None:
        return np.inf
    # Logarithms of the distances' ratio by lenses and scale in either order, against the taped one.
    ratio, scale = first.focal / second.focal, plane_scale(ties, first.image_size)
    d1, d2 = inputs.site.distances
    taped = abs(np.log(d1 / d2)) if d1 and d2 else 0.0
    either = (np.log([ratio * scale, ratio / scale]) - taped).tolist()
    if not (d1 and d2):  # the far camera is any farther
        either = [min(off, 0.0) for off in either]
    as_given, turned = (assumed or abs(off) < CONTROL.unlike for off in either)
    if not turned:
        return np.inf
    return first_is_far((far, near), ties) if as_given else -np.inf


def contradiction(cameras: Cameras, ties: Ties) -> float:
    """Return how far the common points are from the cameras' epipolar lines. [px]"""
    return robust_sigma(epipolar_distance(fundamental(*cameras), ties.pixels1, ties.pixels2))


def check_picks(cameras: Cameras, ties: Ties, interiors: Interiors) -> None:
    """Refuse control points that the photos contradict."""
    if contradiction(cameras, ties) > 0.012 * max(interiors[0].image_size):
        raise GeometryError(remark("align.picks_misfit"))


def features_of(inputs: Given) -> tuple[Features, Features]:
    """Return the features of both photos, refusing photos that are missing, blurred or the same."""
    far, near = inputs.photos[0].grey, inputs.photos[1].grey
    if far is None or near is None:
        raise GeometryError(remark("refused.through_media"))
    for name, image in zip(inputs.names, (far, near), strict=True):
        validation.check_sharp(name, image)
    validation.check_different(*inputs.names, (far, near))
    first, second = (photo.features for photo in inputs.photos)
    return first or find_features(far), second or find_features(near)


def ties_of(inputs: Given, *, needed: bool) -> tuple[Ties | None, tuple[str, ...]]:
    """Return the photos' common points and remarks; none only if control points suffice."""
    if any(photo.grey is None for photo in inputs.photos):
        return None, ()
    try:
        return find_ties(*features_of(inputs), inputs.interiors, inputs.names), ()
    except GeometryError as error:
        if needed or isinstance(error, validation.SamePhotoError):
            raise
        return None, (remark("orientation.control_alone", why=error),)


def laid_together(inputs: Given, ties: Ties) -> tuple[Ties, Repetition | None]:
    """Return common points where the photos belong together, if the wall repeats itself."""
    far, near = (photo.grey for photo in inputs.photos)
    if far is None or near is None:
        return ties, None
    with suppress(GeometryError):
        cameras, _, interiors = approximate_cameras(inputs, ties, False)
        repeated = repetition((far, near), interiors, cameras[0], ties)
        if repeated is not None:
            around = repeated.surrounding
            ties = find_ties(*features_of(inputs), inputs.interiors, inputs.names, around)
        return ties, repeated
    return ties, None


def approximate_cameras(
    inputs: Given, ties: Ties | None, enough: bool
) -> tuple[Cameras, BoolArray, Interiors]:
    """Return approximate cameras, the control points that agree, and the interiors used."""
    control, interiors = inputs.control, inputs.interiors
    agree = np.ones(len(control.ids), dtype=bool)
    if enough:
        cameras = []
        picks = zip((control.pixels1, control.pixels2), inputs.photos, strict=True)
        for number, (pixels, photo) in enumerate(picks):
            picked = control.positioned & np.isfinite(pixels).all(axis=1)
            xyz, ideal = np.nan_to_num(control.xyz[picked]), photo.interior.ideal(pixels[picked])
            with located(photo.name):
                camera, fits = resect(xyz, ideal, photo.interior, inputs.media, number)
            cameras.append(camera)
            agree[np.flatnonzero(picked)[~fits]] = False
        return (cameras[0], cameras[1]), agree, interiors
    if ties is None:
        raise GeometryError("too few control points, and no common points to go with them.")
    interiors = plausible_focals(interiors, ties, inputs.site)
    if all(interior.is_sought for interior in interiors):
        interiors = sought_focal(ties, interiors)
    return scaled(first_cameras(ties, interiors), inputs, interiors), agree, interiors


def plausible_focals(interiors: Interiors, ties: Ties, site: SiteMeasures) -> Interiors:
    """Return interiors whose unknown focal length follows from the distances and the scale."""
    first, second = interiors
    if not (first.is_assumed or second.is_assumed):
        return interiors
    d1, d2 = site.distances
    assert d1 is not None
    assert d2 is not None
    # On the wall photo 2 is s times as large: s = (f2 / d2) / (f1 / d1).
    ratio = plane_scale(ties, first.image_size) * d2 / d1
    if second.is_assumed:
        return first, replace(second, focal=first.focal * ratio)
    return replace(first, focal=second.focal / ratio), second


def scaled(cameras: Cameras, inputs: Given, interiors: Interiors) -> Cameras:
    """Return cameras of far distance 1 brought to metres and, where known, to X and Y."""
    control, site = inputs.control, inputs.site
    near, scale = cameras[1].centre[2], 0.0
    positions = ray_on_plane(cameras[0], interiors[0].ideal(control.pixels1))
    points = np.flatnonzero(control.positioned & np.isfinite(positions).all(axis=1))
    if len(points) >= 2:
        on_wall = control.xyz[points] * [1.0, 1.0, 0.0]
        metres = fit_plane(positions[points], np.nan_to_num(on_wall))
    elif site.distance1:
        scale = site.distance1
    elif site.distance2:
        scale = site.distance2 / near
    elif site.delta_d:
        scale = site.delta_d / (1.0 - near)
    elif control.lengths:
        by_near = ray_on_plane(cameras[1], interiors[1].ideal(control.pixels2))
        positions = np.where(np.isfinite(positions), positions, by_near)
        ratios = [
            length / np.linalg.norm(positions[a] - positions[b]) for a, b, length in control.lengths
        ]
        scale = float(np.median(ratios))
    else:
        raise GeometryError(remark("align.no_scale"))
    if scale:
        nowhere = np.zeros(3)
        metres = Similarity(
            scale=scale, rotation=np.eye(3), source_centre=nowhere, target_centre=nowhere
        )
    first, second = (camera.carried(metres) for camera in cameras)
    return first, second


def observations_of(
    inputs: Given, interiors: Interiors, ties: Ties | None, agree: BoolArray
) -> PairObservations:
    """Return everything observed, ideal pixels throughout."""
    control, site = inputs.control, inputs.site
    pixels1, pixels2 = interiors[0].ideal(control.pixels1), interiors[1].ideal(control.pixels2)
    measured = {
        name: (value, site.sigma)
        for name in ("distance1", "distance2", "delta_d")
        if (value := getattr(site, name)) is not None
    }
    base = PairObservations(
        interiors=interiors,
        control=replace(control, pixels1=pixels1, pixels2=pixels2),
        pick_used=agree,
        sigma_pick=site.sigma_pick,
        measured=measured,
        sigma_tilt=SIGMA_PARALLEL if site.parallel else None,
        free_datum=control.positioned.sum() < 2,
        sigma_body=_same_body(interiors),
        media=inputs.media,
    )
    return base if ties is None else with_ties(base, ties)


def _same_body(interiors: Interiors) -> float | None:
    """Return how closely the principal points agree, if both may be of one camera body. [px]"""
    first, second = interiors
    # With one photo upright and one lying the axes differ.
    if first.is_calibrated or second.is_calibrated or first.image_size != second.image_size:
        return None
    if first.is_part or second.is_part:
        return None
    return 0.002 * float(np.hypot(*first.image_size))
