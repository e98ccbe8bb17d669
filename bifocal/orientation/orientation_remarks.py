"""What the user should be told of an oriented pair: what does not fit, what is weak or assumed."""

from __future__ import annotations

import numpy as np

from bifocal.model.doubts import MISFIT
from bifocal.orientation.adjustment.pair_observations import PairObservations
from bifocal.orientation.alignment import standard_deviations, wall_relief
from bifocal.orientation.control_points import Control, SiteMeasures
from bifocal.orientation.orientation_stages import OrientedPair
from bifocal.orientation.starts.photo_order import SURE
from bifocal.orientation.tuning import TUNING
from bifocal.orientation.walls.bend import WallBend, bend_in_words

#: Common points that fit their lines no better than this, at 3000 px of width, do not fit. Clean
#: pairs reach 0.19, a phone pair with its lens estimated 0.4. [px]
WORST_FIT = 0.6
#: Relief whose size is known no better than this calls for a tape: nine points with 0.45 m of
#: relief and no lens give 2 to 4 %, a tape of 2 cm 0.4 %.
WORST_SCALE = 0.01
#: The wall is found in a part of the photo only if so much of it lies in so few of nine zones.
MOST_OF_WALL, FEW_ZONES = 0.95, 3
#: Beyond this many standard deviations an adjusted value contradicts what was given.
CONTRADICTS = 3.0


def model_remarks(pair: OrientedPair, site: SiteMeasures) -> list[str]:
    """Return where photos and what was given contradict each other, with the likely reason."""
    observations, adjusted = pair.observations, pair.adjusted
    remarks = [_bend_of(observations, pair.bend)]
    unit = max(observations.interiors[0].image_size) / 3000
    sigma = observations.sigma_tie
    if observations.tie_used.sum() >= 20 and sigma > WORST_FIT * unit:
        remarks.append(
            f"{MISFIT}: common points miss their lines by {sigma:.2f} px, good pairs "
            "by 0.1 to 0.2. The likely reason is lens distortion (calibrate, give --lens), motion "
            "in the scene, or two photos of different states."
        )
    lenses = observations.interiors
    changes = [
        float(np.log(camera.matrix[0, 0] / interior.focal))
        for interior, camera in zip(lenses, adjusted.cameras, strict=True)
    ]
    limits = [np.inf if lens.is_assumed else CONTRADICTS * lens.sigma_focal for lens in lenses]
    pulled = np.flatnonzero(np.abs(changes) > limits)
    for n in pulled:
        change, lens = changes[n], lenses[n]
        text = (
            f"The focal length of photo {n + 1} came out {100 * np.expm1(change):+.1f} % from "
            f"the one given ({lens.source}), {abs(change) / lens.sigma_focal:.0f} of its standard "
            "deviations: check it, the lens distortion and the distances."
        )
        if len(pulled) == 2 and changes[0] * changes[1] < 0:  # one wrong lens pulls both
            alone = 100 * np.expm1(change - changes[1 - n])
            text += f" If the other photo's is right, it is {alone:+.0f} % off."
        remarks.append(text)
    for name, camera, given in zip(
        ("far", "near"), adjusted.cameras, (site.distance1, site.distance2), strict=True
    ):
        off = float(camera.centre[2]) - (given or 0.0)
        if given and abs(off) > CONTRADICTS * site.sigma:
            remarks.append(
                f"The {name} camera's distance came out {off:+.3f} m from the one measured "
                f"({given:g} m), {abs(off) / site.sigma:.0f} of its standard deviations: check the "
                "tape, the plane it was measured to, the focal lengths and the lens distortion."
            )
    return [remark for remark in remarks if remark]


def _bend_of(observations: PairObservations, bend: WallBend) -> str:
    """Return that the wall is bent, if it certainly is."""
    return bend_in_words(
        bend,
        with_lens=any(i.is_calibrated or i.sigma_radial > 0 for i in observations.interiors),
        through_media=bool(observations.media),
        left_out=not observations.pick_used.all(),
    )


def hopeless_bend(observations: PairObservations, bend: WallBend) -> str:
    """Return that the wall is bent, if that is certainly by more than an honest lens does."""
    return _bend_of(observations, bend) if bend.px > TUNING.strongly_bent else ""


def order_remarks(order: float, names: tuple[str, str]) -> list[str]:
    """Return that the photos do not tell which of them is the near one."""
    if order > SURE:
        return []
    return [
        f"Which photo was taken from near cannot be told from what is known; {names[1]} was taken "
        "for it, as given. If what stands out comes out as lying back, exchange the photos."
    ]


def wall_remarks(pair: OrientedPair) -> list[str]:
    """Return where the wall was found, if not all over the photo; where no plane is given."""
    if not pair.observations.free_datum or pair.observations.media:
        return []
    zones = sorted(wall_relief(pair), key=lambda zone: -zone["points"])
    if not zones:
        return [
            "NO WALL FOUND: hardly any common points gather on one plane, and relief counts from "
            "one that is known no better than sigma_r says. Name a spot of the wall in the far "
            "photo (--wall COL,ROW), or give control points."
        ]
    held = np.cumsum([zone["points"] for zone in zones])
    most = int(np.searchsorted(held, MOST_OF_WALL * held[-1])) + 1
    if most > FEW_ZONES:
        return []
    named = ", ".join(zone["zone"] for zone in zones[:most])
    return [
        f"The wall was found in a part of the far photo only ({named}: {held[most - 1]} of "
        f"{held[-1]} points on it). Its plane is carried on from there; check that it is the wall "
        "you mean (green in the picture), or give control points (--control)."
    ]


def control_remarks(control: Control, pair: OrientedPair) -> list[str]:
    """Return what the control points lack."""
    remarks = [
        f"Control point {control.ids[index]} is a gross error "
        f"({pair.adjusted.control_test[index]:.0f} standard deviations) and was left out. Check "
        "its coordinates and its picks."
        for index in np.flatnonzero(~pair.observations.pick_used)
    ]
    count = int(control.positioned.sum())
    if 0 < count < 4:
        remarks.append(
            f"{count} of at least 4 control points: they give scale and place, the photos the "
            "rest. Four or more, spread over the photo, fix the plane."
        )
    if 4 <= count < 9:
        remarks.append(
            f"{count} control points; CIPA advises nine, spread over the photo, so that an error "
            "in one is found."
        )
    return remarks


def distance_remarks(pair: OrientedPair) -> list[str]:
    """Return which distances are poorly determined, and what that does to relief."""
    remarks = []
    share = standard_deviations(pair.adjusted)["relief_scale"]
    if not pair.observations.measured and share > WORST_SCALE:
        remarks.append(
            f"Without a taped distance the size of relief is known only to {100 * share:.1f} % "
            f"({1000 * share:.0f} mm of a metre): tape one distance from a camera to the wall "
            "(--distance1 or --distance2)."
        )
    for number, camera in enumerate(pair.adjusted.cameras, start=1):
        distance, sigma = float(camera.centre[2]), pair.adjusted.sigma("Z", number)
        if sigma > 0.03 * distance:
            remarks.append(
                f"The distance of camera {number} is poorly determined ({distance:.2f} ± "
                f"{sigma:.2f} m). Give the focal lengths, the distances, or more points off the "
                "wall."
            )
    return remarks


def assumptions(observations: PairObservations, site: SiteMeasures) -> list[str]:
    """Return what only the prior holds."""
    out = []
    for number, interior in enumerate(observations.interiors, start=1):
        if interior.is_assumed:
            out.append(f"focal length of photo {number}: {interior.source}")
        if not interior.is_calibrated:
            out.append(
                f"principal point of photo {number} in its centre "
                f"(within {interior.sigma_centre:.0f} px)"
            )
    uncorrected = [i for i in observations.interiors if not i.is_calibrated and not i.sigma_radial]
    if uncorrected:
        out.append("photos free of lens distortion (else calibrate and give --lens)")
    if site.parallel:
        out.append("image planes parallel to the wall within 0.3°")
    if observations.sigma_zoom is not None:
        out.append("one focal length for both photos (they agree)")
    return out
