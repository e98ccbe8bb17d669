"""Two photos become a pair: cameras from control points, site distances or the photos alone.

One adjustment serves all three ways; they differ in what is observed. See docs/align.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bifocal.model import CERTAIN, PairMedia, with_one_lens
from bifocal.orientation import validation
from bifocal.orientation.adjustment.pair_observations import PairObservations, PairUnknowns
from bifocal.orientation.approximate_orientation import (
    Given,
    approximate_cameras,
    check_picks,
    contradiction,
    features_of,
    laid_together,
    observations_of,
    order_of,
    ties_of,
)
from bifocal.orientation.as_set_up import check_room
from bifocal.orientation.control_groups import weighed_by_control
from bifocal.orientation.control_points import Control, SiteMeasures
from bifocal.orientation.media_report import media_remarks, refuse_impossible_media
from bifocal.orientation.orientation_remarks import (
    assumptions,
    control_remarks,
    distance_remarks,
    hopeless_shape,
    model_remarks,
    order_remarks,
    repeated_in_words,
    tilt_remarks,
    wall_remarks,
)
from bifocal.orientation.orientation_stages import (
    OrientedPair,
    Photos,
    control_alone,
    lines_tested,
    oriented_in_stages,
    with_refracted_ties,
)
from bifocal.orientation.repetition import Repetition
from bifocal.orientation.slips import TrialOrientation, TypedOrientation, slip_of
from bifocal.orientation.starts.refracted_start import refracted_start
from bifocal.orientation.starts.relative_orientation import Ties
from bifocal.orientation.tie_points import likely_on_wall
from bifocal.orientation.tuning import BEND, CONTROL, ORDER, REMARKS, SLIPS, STAGES, TIES
from bifocal.orientation.walls.reference_plane import rivals_in_words
from bifocal.orientation.walls.wall_shape import WallShape, shape_between
from bifocal.remarks import remark
from photocore.adjustment import OUTLIER_LIMIT
from photocore.errors import ConvergenceError, GeometryError, PhotogrammetryError


def orient_pair(
    photos: Photos, *, control: Control, site: SiteMeasures, media: PairMedia | None = None
) -> OrientedPair:
    """Return the cameras of a pair.

    Parameters
    ----------
    photos : pair of PhotoInput
        Far photo first; given the other way round they are exchanged.
    control : Control
        Points measured on site; may be empty.
    site : SiteMeasures
        Distances measured on site.
    media : PairMedia, optional
        What lies between cameras and wall.

    Raises
    ------
    GeometryError
        If the photos and measurements do not make a pair; the message says why and what to do.
    """
    media = media or PairMedia.none()
    pair = _oriented(Given(photos=photos, control=control, site=site, media=media))
    return replace(pair, frame=pair.frame or control.frame)


def _oriented(inputs: Given) -> OrientedPair:
    """Return the cameras of a pair; what was mended or exchanged comes here again."""
    site = inputs.site
    lacking = validation.unknown_lenses(inputs.interiors, inputs.names)
    if inputs.media:
        try:
            return _through_media(inputs, lacking)
        except GeometryError as error:
            raise _with_lacking(error, lacking) from error
    interiors, one_lens = with_one_lens(inputs.interiors)
    inputs = inputs.with_interiors(interiors)
    enough = inputs.enough
    if lacking and not enough and None in site.distances:
        raise GeometryError(remark("refused.focal_or_distances", lacking=lacking))
    ties, remarks = ties_of(inputs, needed=not enough)
    if enough and not inputs.settled:
        right = _typed_right(inputs, lambda one: _by_control(one, ties), by_control=True)
        if right is not None:
            return right
        inputs = replace(inputs, settled=True)
    repeated: Repetition | None = None
    if ties is not None and not enough:
        ties, repeated = laid_together(inputs, ties)
        order = order_of(inputs, ties)
        if order < -ORDER.sure:
            return _with_photos_exchanged(inputs, typed_stay=True)
        remarks = (*remarks, *order_remarks(order, inputs.names))
    cameras, agree, interiors = approximate_cameras(inputs, ties, enough)
    if enough and ties is not None:
        check_picks(cameras, ties, interiors)
    if cameras[0].centre[2] < cameras[1].centre[2]:
        return _with_photos_exchanged(inputs)
    if site.far_first is not site:
        d1, d2 = site.distances
        note = remark("orientation.distances_exchanged", d1=d1, d2=d2, name=inputs.names[0])
        return _told(replace(inputs, site=site.far_first), note)
    if enough:
        validation.check_units(cameras, site, lenses_known=not lacking)
    elif ties is not None:
        flat = validation.is_flat(ties, interiors, inputs.names, flat_is_fine=site.parallel)
        # What stands out shows how the cameras stood; a flat wall does not.
        inputs = replace(inputs, site=replace(site, parallel=flat))
    observations = observations_of(inputs, interiors, ties, agree)
    if one_lens:
        observations = replace(observations, sigma_zoom=STAGES.one_lens)
    start = PairUnknowns(cameras=cameras)
    if ties is not None:
        start = replace(start, radial=np.array([[ties.radial, 0.0]] * 2))
    try:
        pair = oriented_in_stages(observations, start, inputs.photos, site, with_control=enough)
    except (GeometryError, ConvergenceError) as error:
        right = _mended_by_ties(inputs, ties, observations)
        if right is not None:
            return right
        # Photos through glass or water may fit no cameras at all: then that is the reason.
        raise _reason(error, observations, start, lacking) from error
    pair = _without_gross(replace(pair, shape=_bend(pair.observations, pair.adjusted)))
    pair = weighed_by_control(pair) if enough else pair
    wrong = int((~pair.observations.pick_used).sum())
    if ties is None and remarks and wrong > CONTROL.of_another_wall * len(inputs.control.ids):
        first, second = inputs.names
        about = {"first": first, "second": second, "count": wrong}
        raise GeometryError(remark("refused.another_wall", why=remarks[0], **about))
    if model_remarks(pair, inputs.site) or pair.lines_off:
        right = _mended_by_ties(inputs, ties, pair.observations)
        if right is not None:
            return right
    certain = pair.shape.px - CERTAIN * pair.shape.sigma > BEND.strongly_curved
    bent = hopeless_shape(pair.observations, pair.shape) if certain and not enough else ""
    if bent and likely_on_wall(pair.observations, pair.adjusted) < TIES.fewest_on_wall:
        raise GeometryError(bent)  # what holds a bent wall by small chances only is none
    if repeated is not None:
        pair = repeated_in_words(pair, repeated)
    return _with_words(pair, inputs, remarks)


def _through_media(inputs: Given, lacking: str) -> OrientedPair:
    """Return the cameras of a pair that looks through media, from control and common points.

    Common points say that their bent rays meet; the plane is that of the control points.
    """
    if inputs.control.positioned.any() and not inputs.enough:
        raise GeometryError(remark("refused.through_media"))
    if not inputs.enough:
        return _by_refracted_ties(inputs, lacking)
    cameras, agree, interiors = approximate_cameras(inputs, None, True)
    if cameras[0].centre[2] < cameras[1].centre[2]:
        return _with_photos_exchanged(inputs)
    validation.check_units(cameras, inputs.site)
    observations = observations_of(inputs, interiors, None, agree)
    start = PairUnknowns(cameras=cameras, media=inputs.media)
    pair = control_alone(observations, start, named=inputs.site.wall is not None)
    shares = [pair.adjusted.sigma("Z", n) / pair.adjusted.cameras[n - 1].centre[2] for n in (1, 2)]
    if lacking and max(shares) > CONTROL.hopeless:
        raise GeometryError(remark("refused.control_alone", lacking=lacking))
    ties, remarks = ties_of(inputs, needed=False)
    note = remark("orientation.assumed_media_control")
    if ties is not None:
        pair, note = with_refracted_ties(pair, ties), remark("orientation.assumed_media")
        every, size = np.ones(len(ties.seen1), dtype=bool), interiors[0].image_size
        bend = shape_between(pair.adjusted, ties.seen1, ties.seen2, every, size)
        pair = replace(pair, shape=bend)
    pair = _without_gross(replace(pair, assumed=(*pair.assumed, note)))
    refuse_impossible_media(pair.adjusted, inputs.media)
    check_room(pair.adjusted.media, pair.adjusted.cameras)
    return _with_words(pair, inputs, remarks)


def _by_refracted_ties(inputs: Given, lacking: str) -> OrientedPair:
    """Return the cameras of a pair that looks through media, from its common points alone."""
    if lacking:
        raise GeometryError(remark("refused.focal_through_media", lacking=lacking))
    if inputs.media.leaning:
        raise GeometryError(remark("refused.port_through_media"))
    start, ties = refracted_start(inputs, features_of(inputs))
    if start.cameras[0].centre[2] < start.cameras[1].centre[2]:
        return _with_photos_exchanged(inputs)
    air, *_, water = inputs.media.layers.indices
    freed = replace(ties, tolerance=ties.tolerance * air / water)  # pixels as small as in water
    validation.is_flat(freed, inputs.interiors, inputs.names, flat_is_fine=False)
    inputs = replace(inputs, site=replace(inputs.site, parallel=False))
    picks = np.ones(len(inputs.control.ids), dtype=bool)
    first, second = (replace(i, sigma_radial=0.0) for i in inputs.interiors)
    observations = observations_of(inputs, (first, second), ties, picks)
    pair = oriented_in_stages(observations, start, inputs.photos, inputs.site, with_control=False)
    rivals = rivals_in_words(pair.faces, inputs.site)
    if rivals and inputs.media.depth is not None:
        raise GeometryError(remark("refused.depth_of_wall", rivals=rivals))
    refuse_impossible_media(pair.adjusted, inputs.media)
    check_room(pair.adjusted.media, pair.adjusted.cameras)
    ties1, ties2 = pair.observations.straight_ties(pair.adjusted.radial)
    bend = shape_between(
        pair.adjusted, ties1, ties2, pair.observations.tie_used, inputs.interiors[0].image_size
    )
    return _with_words(replace(pair, shape=bend), inputs, ())


def _with_words(pair: OrientedPair, inputs: Given, remarks: tuple[str, ...]) -> OrientedPair:
    """Return the pair with all that is to be told of it, doubts first; refuse what is none."""
    validation.check_determined(pair.adjusted)
    validation.check_movement(pair.adjusted)
    sentences = (
        *model_remarks(pair, inputs.site),
        *filter(None, [inputs.pick_verdict.words, *(i.doubt for i in inputs.interiors)]),
        *remarks,
        *pair.remarks,
        *tilt_remarks(pair),
        *wall_remarks(pair),
        *media_remarks(pair.adjusted, inputs.media),
        *control_remarks(inputs.control, pair),
        *distance_remarks(pair),
    )
    assumed = (*pair.assumed, *assumptions(pair.observations, inputs.site))
    return replace(pair, remarks=sentences, assumed=assumed)


def _bend(observations: PairObservations, state: PairUnknowns) -> WallShape:
    """Return how far the wall is from a plane between the photos."""
    straight, size = observations.straight_ties(state.radial), observations.interiors[0].image_size
    return shape_between(state, *straight, observations.tie_used, size)


def _reason(
    error: PhotogrammetryError, observations: PairObservations, state: PairUnknowns, lacking: str
) -> PhotogrammetryError:
    """Return why no cameras were found: that the wall is bent where it strongly is, or the error.

    Features as first found are good to a pixel; only a bend beyond `Tuning.strongly_curved` counts.
    """
    bent = hopeless_shape(observations, _bend(observations, state))
    return GeometryError(bent) if bent else _with_lacking(error, lacking)


def _with_lacking(error: PhotogrammetryError, lacking: str) -> PhotogrammetryError:
    """Return an error with what is ``lacking`` of the lenses, unless it says so itself."""
    if not lacking or "--focal1" in str(error):
        return error
    return GeometryError(remark("refused.likely_reason", error=error, reason=lacking))


def _mended_by_ties(
    inputs: Given, ties: Ties | None, observations: PairObservations
) -> OrientedPair | None:
    """Return the pair with the slip mended that common points show; None without one."""
    if ties is None or inputs.settled:
        return None
    return _typed_right(inputs, lambda one: _by_ties(one, ties, observations), by_control=False)


def _without_gross(pair: OrientedPair) -> OrientedPair:
    """Return the pair without gross control points, the worst first, tested without it."""
    count = len(pair.observations.control.ids)
    dropped: list[int] = list(np.flatnonzero(~pair.observations.pick_used))
    for _ in range(max(count // 3, 1) if count > 4 else 0):
        used = pair.observations.pick_used.copy()
        test = np.where(used, pair.adjusted.control_test, 0.0)
        worst = int(test.argmax())
        if test[worst] < OUTLIER_LIMIT or used.sum() <= 4:
            break
        used[worst] = False
        without = pair.readjusted(pick_used=used)
        usual = max(1.0, float(np.median(without.adjusted.control_test[used])))
        if test[worst] < OUTLIER_LIMIT * usual:
            break
        dropped.append(worst)
        pair = without
    # A point thrown out by the first, rough fit may be good after all.
    back = [i for i in dropped if pair.adjusted.control_test[i] < OUTLIER_LIMIT]
    if back:
        used = pair.observations.pick_used.copy()
        used[back] = True
        pair = pair.readjusted(pick_used=used)
    return pair


def _typed_right(
    inputs: Given, fitted: Callable[[Given], TrialOrientation | None], *, by_control: bool
) -> OrientedPair | None:
    """Return the pair with the slip mended that explains a misfit, saying so; None without one.

    Raises
    ------
    GeometryError
        Naming a slip that only the user can mend.
    """

    def meant(typed: TypedOrientation) -> Given:
        lens = inputs.with_interiors(typed.interiors)
        lens = lens.turned if typed.exchanged else lens
        return replace(lens, control=typed.control, site=typed.site)

    typed = TypedOrientation(interiors=inputs.interiors, control=inputs.control, site=inputs.site)
    slip = slip_of(typed, lambda one: fitted(meant(one)), by_control=by_control)
    if slip is not None and not slip.mended:
        raise GeometryError(slip.words)
    if slip is None:
        return None
    pair = _told(replace(meant(slip.meant), settled=True), slip.words)
    exchanged = pair.exchanged != slip.meant.exchanged
    return replace(pair, exchanged=exchanged, frame=slip.meant.control.frame)


def _told(inputs: Given, note: str) -> OrientedPair:
    """Return the pair of what is given instead of what was typed, saying so."""
    pair = _oriented(inputs)
    return replace(pair, remarks=(note, *pair.remarks))


def _by_control(inputs: Given, ties: Ties | None) -> TrialOrientation | None:
    """Return how well control points, lenses, tapes and common points fit each other.

    Whichever photo is the far one, the longer distance is its. Control points leave the lines of
    common points uncertain by some pixels.
    """
    d1, d2 = inputs.site.distance1, inputs.site.distance2
    try:
        cameras, agree, interiors = approximate_cameras(inputs, None, True)
        z1, z2 = (float(camera.centre[2]) for camera in cameras)
        if d1 and d2 and (d1 < d2) != (z1 < z2):
            d1, d2 = d2, d1
        if any(taped and not 0.5 < taped / z < 2 for taped, z in ((d1, z1), (d2, z2))):
            d1 = d2 = None  # another unit: `validation.check_units` says so
        inputs = replace(inputs, site=replace(inputs.site, distance1=d1, distance2=d2))
        observations = observations_of(inputs, interiors, None, agree)
        pair = control_alone(observations, PairUnknowns(cameras=cameras), named=False)
        pair = _without_gross(pair)
    except (GeometryError, ConvergenceError):
        return None
    adjusted, used = pair.adjusted, pair.observations.pick_used
    test = np.minimum(adjusted.control_test[inputs.control.positioned], SLIPS.most)
    square = float((test**2).mean()) + _pulled(pair) / (4 * len(test))
    if ties is not None:
        cameras = adjusted.cameras[::-1] if inputs.exchanged else adjusted.cameras
        off = contradiction((cameras[0], cameras[1]), ties) / (2 * ties.tolerance)
        square += max(off - 1.0, 0.0) ** 2
    if inputs.pick_verdict.slip is not None:
        square += SLIPS.most**2
    return TrialOrientation(misfit=float(np.sqrt(square)), cameras=adjusted.cameras, lost=~used)


def _by_ties(inputs: Given, ties: Ties, observations: PairObservations) -> TrialOrientation | None:
    """Return how well common points as matched meet, as a share of what they may miss by.

    With how far the façade's lines come out of the wall.
    """
    (far, first), (near, second) = ((p.grey, replace(p, grey=None)) for p in inputs.photos)
    try:
        cameras, _, interiors = approximate_cameras(inputs, ties, False)
        tilt = observations.sigma_tilt if inputs.site.parallel else None
        observations = replace(observations, interiors=interiors, lines=(), sigma_tilt=tilt)
        start = PairUnknowns(cameras=cameras)
        pair = oriented_in_stages(
            observations, start, (first, second), inputs.site, with_control=False
        )
    except (GeometryError, ConvergenceError):
        return None
    fine = REMARKS.worst_fit / 3 * max(interiors[0].image_size) / 3000
    assert far is not None
    assert near is not None
    lines = (
        max((test for _, test in lines_tested(pair, (far, near))), default=0.0) / STAGES.wall_limit
    )
    squares = (
        (pair.observations.sigma_tie / fine) ** 2,
        _pulled(pair) / 2,
        min(lines, SLIPS.most) ** 2,
    )
    misfit = float(np.sqrt(sum(squares)))
    return TrialOrientation(
        misfit=misfit, cameras=pair.adjusted.cameras, lost=~pair.observations.pick_used
    )


def _pulled(pair: OrientedPair) -> float:
    """Return the sum of squares by which focal lengths came out other than known, in sigma."""
    pairs = zip(pair.adjusted.cameras, pair.observations.interiors, strict=True)
    changes = [np.log(c.matrix[0, 0] / i.focal) / i.sigma_focal for c, i in pairs]
    return float(np.sum(np.square(changes)))


def _with_photos_exchanged(inputs: Given, *, typed_stay: bool = False) -> OrientedPair:
    """Return the pair with the photos the other way round, saying so.

    What was typed for the far photo goes with its file, or stays with the far one.
    """
    (near, far), site = inputs.names, inputs.site
    if site.wall is not None:
        raise GeometryError(remark("align.spot_of_near", near=near, far=far))
    its = 1 if site.far_first is site else 2
    site, media = site.far_first, inputs.media.exchanged()
    turned = replace(inputs, photos=inputs.photos[::-1])
    if typed_stay:
        turned, site = turned.with_interiors(inputs.interiors), replace(site, ordered=True)
    control = inputs.control.exchanged()
    pair = _oriented(replace(turned, control=control, site=site, media=media))
    key = f"orientation.photos_exchanged{'_typed' if typed_stay else ''}"
    note = remark(key, near=near, far=far, number=its)
    return replace(pair, exchanged=not pair.exchanged, remarks=(note, *pair.remarks))
