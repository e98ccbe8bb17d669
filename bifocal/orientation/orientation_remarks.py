"""What the user should be told of an oriented pair: what does not fit, what is weak or assumed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal.orientation.adjustment.pair_observations import PairObservations
from bifocal.orientation.alignment import standard_deviations, wall_relief
from bifocal.orientation.control_points import Control, SiteMeasures
from bifocal.orientation.orientation_stages import OrientedPair
from bifocal.orientation.repetition import Repetition
from bifocal.orientation.tuning import BEND, ORDER, REMARKS
from bifocal.orientation.walls.wall_shape import WallShape, shape_in_words
from bifocal.remarks import remark


def model_remarks(pair: OrientedPair, site: SiteMeasures) -> list[str]:
    """Return where photos and what was given contradict each other, with the likely reason."""
    observations, adjusted = pair.observations, pair.adjusted
    tapes = _contradicted_tapes(pair, site)
    remarks = [_shape_of(observations, pair.shape, tape=bool(tapes))]
    unit = max(observations.interiors[0].image_size) / 3000
    sigma = observations.sigma_tie
    if observations.tie_used.sum() >= 20 and sigma > REMARKS.worst_fit * unit:
        lens_clause = "_lens_known" * _with_lens(observations)
        cause = "tape" if tapes else f"misses{lens_clause}"
        reason = remark(f"orientation.reason_{cause}")
        remarks.append(remark("orientation.misses_lines", sigma=sigma, reason=reason))
    remarks.extend(tapes)
    lenses = observations.interiors
    changes = [
        float(np.log(camera.matrix[0, 0] / interior.focal))
        for interior, camera in zip(lenses, adjusted.cameras, strict=True)
    ]
    limits = [
        np.inf if lens.is_assumed else REMARKS.contradicts * lens.sigma_focal for lens in lenses
    ]
    pulled = np.flatnonzero(np.abs(changes) > limits)
    both = len(pulled) == 2 and changes[0] * changes[1] < 0  # one wrong lens pulls both
    for n in pulled:
        change, lens = changes[n], lenses[n]
        shares = {
            "change": 100 * np.expm1(change),
            "alone": 100 * np.expm1(change - changes[1 - n]),
        }
        about = {"number": int(n) + 1, "source": lens.source, **shares}
        key = f"orientation.focal_contradicts{'_both' if both else ''}"
        remarks.append(remark(key, sigmas=abs(change) / lens.sigma_focal, **about))
    return [text for text in remarks if text]


def _contradicted_tapes(pair: OrientedPair, site: SiteMeasures) -> list[str]:
    """Return which distances measured on site the adjusted ones contradict."""
    remarks: list[str] = []
    for name, camera, taped in zip(
        ("far", "near"), pair.adjusted.cameras, (site.distance1, site.distance2), strict=True
    ):
        off = float(camera.centre[2]) - (taped or 0.0)
        if taped and abs(off) > REMARKS.contradicts * site.sigma:
            sigmas, key = abs(off) / site.sigma, f"orientation.distance_contradicts_{name}"
            remarks.append(remark(key, off=off, given=taped, sigmas=sigmas))
    return remarks


def _with_lens(observations: PairObservations) -> bool:
    """Whether the lenses were calibrated, or estimated from the photos."""
    return any(i.is_calibrated or i.sigma_radial > 0 for i in observations.interiors)


def _shape_of(observations: PairObservations, shape: WallShape, *, tape: bool = False) -> str:
    """Return that the wall is bent, if it certainly is."""
    return shape_in_words(
        shape,
        with_lens=_with_lens(observations),
        through_media=bool(observations.media),
        left_out=not observations.pick_used.all(),
        tape=tape,
    )


def hopeless_shape(observations: PairObservations, shape: WallShape) -> str:
    """Return that the wall is bent, if that is certainly by more than an honest lens does."""
    return _shape_of(observations, shape) if shape.px > BEND.strongly_curved else ""


def order_remarks(order: float, names: tuple[str, str]) -> list[str]:
    """Return that the photos do not tell which of them is the near one."""
    if order > ORDER.sure:
        return []
    return [remark("orientation.near_unsure", name=names[1])]


def repeated_in_words(pair: OrientedPair, repeated: Repetition) -> OrientedPair:
    """Return the pair of a wall that repeats itself, with how far its photos may lie aside."""
    period = float(np.linalg.norm(repeated.ends[1] - repeated.ends[0]))
    note = remark(f"orientation.{'repeats' if repeated.is_certain else 'aside'}", period=period)
    if repeated.is_certain:
        return pair.told(note)
    return replace(pair, remarks=(note, *pair.remarks), aside=repeated.ends)


def wall_remarks(pair: OrientedPair) -> list[str]:
    """Return where the wall was found, if not all over the photo; where no plane is given."""
    if not pair.observations.free_datum or pair.observations.media:
        return []
    zones = sorted(wall_relief(pair), key=lambda zone: -zone["points"])
    if not zones:
        return [remark("orientation.no_wall")]
    held = np.cumsum([zone["points"] for zone in zones])
    most = int(np.searchsorted(held, REMARKS.most_of_wall * held[-1])) + 1
    if most > REMARKS.few_zones:
        return []
    named = ", ".join(zone["zone"] for zone in zones[:most])
    count = {"count": int(held[most - 1]), "all": int(held[-1])}
    return [remark("orientation.wall_in_part", zones=named, **count)]


def tilt_remarks(pair: OrientedPair) -> list[str]:
    """Return that cameras tilted as no bifocal pair's are may have cropped photos."""
    lenses, cameras = pair.observations.interiors, pair.adjusted.cameras
    if not pair.observations.free_datum or any(lens.is_calibrated for lens in lenses):
        return []
    tilts = [float(np.rad2deg(np.arctan(np.hypot(*camera.tilt)))) for camera in cameras]
    if max(tilts) < REMARKS.asked_tilt:
        return []
    return [remark("orientation.tilted", far=tilts[0], near=tilts[1])]


def control_remarks(control: Control, pair: OrientedPair) -> list[str]:
    """Return what the control points lack."""
    tests = pair.adjusted.control_test
    remarks: list[str] = [
        remark("orientation.gross_control", name=control.ids[index], sigmas=tests[index])
        for index in np.flatnonzero(~pair.observations.pick_used)
    ]
    count = int(control.positioned.sum())
    if 0 < count < 4:
        remarks.append(remark("orientation.few_control", count=count))
    if 4 <= count < 9:
        remarks.append(remark("orientation.cipa_nine", count=count))
    return remarks


def distance_remarks(pair: OrientedPair) -> list[str]:
    """Return which distances are poorly determined, and what that does to relief."""
    remarks: list[str] = []
    share = standard_deviations(pair.adjusted)["relief_scale"]
    if not pair.observations.measured and share > REMARKS.worst_scale:
        remarks.append(remark("orientation.no_tape", share=100 * share, size=1000 * share))
    for number, camera in enumerate(pair.adjusted.cameras, start=1):
        distance, sigma = float(camera.centre[2]), pair.adjusted.sigma("Z", number)
        if sigma > 0.03 * distance:
            about = {"number": number, "distance": distance, "sigma": sigma}
            remarks.append(remark("orientation.poor_distance", **about))
    return remarks


def assumptions(observations: PairObservations, site: SiteMeasures) -> list[str]:
    """Return what only the prior holds."""
    out: list[str] = []
    for number, interior in enumerate(observations.interiors, start=1):
        if interior.is_assumed:
            out.append(remark("orientation.assumed_focal", number=number, source=interior.source))
        if not interior.is_calibrated:
            sigma = interior.sigma_centre
            out.append(remark("orientation.assumed_centre", number=number, sigma=sigma))
    uncorrected = [i for i in observations.interiors if not i.is_calibrated and not i.sigma_radial]
    if uncorrected:
        out.append(remark("orientation.assumed_no_distortion"))
    if site.parallel:
        out.append(remark("orientation.assumed_parallel"))
    if observations.sigma_zoom is not None:
        out.append(remark("orientation.assumed_one_lens"))
    return out
