"""Why two photos do not make a bifocal pair, each reason in the user's terms."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.matching.features import sharpness
from bifocal.model.homography import apply_homography
from bifocal.model.interior_orientation import Cameras, Images, Interior, Interiors
from bifocal.model.photo import FARTHEST_WALL
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.starts.relative_orientation import Ties, rotation_only
from photocore.arrays import ByteArray, FloatArray
from photocore.errors import GeometryError, InputError

#: Below this a photo is blurred (sharp photos: 0.3 to 0.6; blurred by 3 px: below 0.17).
BLURRED = 0.15
#: The distances must differ by this share; relief errors grow with its inverse.
LEAST_CHANGE = 0.03
#: Lenses for façades bend less than this in the corner, as a share of the half diagonal: compact
#: cameras reach 11 %.
MOST_DISTORTION = 0.25


class SamePhotoError(GeometryError):
    """Both photos are one and the same."""


def check_sharp(name: str, image: ByteArray) -> None:
    """Refuse a blurred photo."""
    value = sharpness(image)
    if value < BLURRED:
        raise GeometryError(
            f"{name}: the photo is blurred (fine detail {value:.2f}, a sharp photo has 0.3). Take "
            "it again from a tripod, focused on the wall; nothing later can make up for it."
        )


def check_different(name1: str, name2: str, images: Images) -> None:
    """Refuse one photo given twice, also saved again or in another size."""
    small = [
        cv2.resize(image, (96, 64), interpolation=cv2.INTER_AREA).astype(np.float64)
        for image in images
    ]
    a, b = (part - part.mean() for part in small)
    alike = float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-9))
    if alike > 0.9995:
        raise SamePhotoError(
            f"{name1} and {name2} are the same photo. The method needs two photos taken from two "
            "distances: a long lens from afar and a short one from near."
        )


def unknown_lenses(interiors: Interiors, names: tuple[str, str]) -> str:
    """Return of which photos nobody knows the focal length, and what to give; or nothing."""
    unknown = [name for name, i in zip(names, interiors, strict=True) if i.is_assumed]
    if not unknown:
        return ""
    alone = [number for number, i in enumerate(interiors, start=1) if i.is_assumed]
    missing = f"; --focal{alone[0]} is missing" if len(alone) == 1 else ""
    return (
        f"the focal lengths are unknown (no EXIF) of {' and '.join(unknown)}{missing}. Give --lens "
        "or --focal1 and --focal2 with --sensor-width or --pixel-size"
    )


def is_flat(
    ties: Ties, interiors: Interiors, names: tuple[str, str], *, flat_is_fine: bool
) -> bool:
    """Return whether nothing moves against the wall; refuse that where it is no pair then.

    Parameters
    ----------
    flat_is_fine : bool
        Both distances were measured and the camera was square to the wall: a flat wall then is
        no obstacle.
    """
    moving = float((ties.parallax > 2.5 * ties.tolerance).mean())
    height, width = interiors[0].image_size[1], interiors[0].image_size[0]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64)
    moved = apply_homography(ties.homography, corners) - corners
    if moving < 0.03 and np.abs(moved).max() < 2 * ties.tolerance:
        raise SamePhotoError(
            f"{names[0]} and {names[1]} show the same view: one photo twice, or two shots from the "
            "same place. The method needs two distances."
        )
    if moving >= 0.03:
        return False
    if rotation_only(ties, interiors):
        raise GeometryError(
            f"no parallax: {names[0]} and {names[1]} were taken from one place, only the zoom was "
            "changed. A zoom enlarges everything alike, so relief leaves no trace. This is the "
            "classic mistake: change the lens AND walk, long lens from afar, short lens from near."
        )
    if not flat_is_fine:
        raise GeometryError(
            "no parallax: nothing in the photos stands out from the wall or behind it (or only "
            "the zoom was changed, without walking), so the nadir cannot be found. Give four "
            "control points (--control), or both distances with the camera square to the wall "
            "(--distance1, --distance2)."
        )
    return True


def check_units(cameras: Cameras, site: SiteMeasures) -> None:
    """Refuse control points and distances that are not in metres, one beside the other."""
    d1, d2 = (float(camera.centre[2]) for camera in cameras)
    agree = False
    for name, distance, measured in (("1", d1, site.distance1), ("2", d2, site.distance2)):
        if measured is None:
            continue
        agree |= 0.8 < distance / measured < 1.25
        if measured > FARTHEST_WALL and not agree:
            raise InputError(
                f"--distance{name} {measured:g} m is too far for a wall, and the control points "
                f"say {distance:.4g} m: is it in mm? Distances are in metres "
                f"(--distance{name} {measured / 1000:g})."
            )
        for factor, unit in ((1000.0, "mm"), (100.0, "cm")):
            if 0.8 < distance / measured / factor < 1.25:
                raise InputError(
                    f"the control points are in {unit}: they put camera {name} {distance:,.0f} "
                    f"away, --distance{name} says {measured:g} m. Write them in metres, or the "
                    f"unit into the headings (X [{unit}])."
                )
    if max(d1, d2) > FARTHEST_WALL and not agree:
        raise InputError(
            f"the control points put the cameras {d1:,.0f} and {d2:,.0f} m from the wall: they "
            "are in mm or cm. Write them in metres, or the unit into the headings (X [mm])."
        )


def check_distortion(radial: FloatArray, interior: Interior) -> None:
    """Refuse an estimated radial distortion (k1, k2) that no lens for façades has."""
    half = float(np.hypot(*interior.image_size)) / 2
    square = (half / interior.focal) ** 2
    bend = float(square * (radial[0] + square * radial[1]))
    # r / (1 + bend), so that a bend of -1 and below folds the photo over.
    moved = abs(bend / (1 + bend)) if bend > -0.9 else np.inf
    if moved > MOST_DISTORTION and interior.is_assumed:
        raise GeometryError(
            "the focal lengths are not known (no EXIF data), and the photos do not tell them. Give "
            "--focal1 and --focal2 with --sensor-width, e.g. --focal1 35 --focal2 19 "
            "--sensor-width 22.7, or --lens."
        )
    if moved > MOST_DISTORTION:
        raise GeometryError(
            f"the common points fit only if the lens distorted the photo's corners by "
            f"{min(100 * moved, 999):.0f} % of the half diagonal (k1 = {radial[0]:.2f}): the "
            "sensor width or the focal length is probably wrong. Check --sensor-width "
            "(--pixel-size), --focal1 and --focal2; a lens that does distort so much has to be "
            "calibrated (`bifocal calibrate`, --lens)."
        )


def check_movement(adjusted: AdjustedPair) -> None:
    """Refuse a pair whose cameras stand (almost) at one distance."""
    first, second = adjusted.cameras
    d1, d2 = float(first.centre[2]), float(second.centre[2])
    moved = float(np.linalg.norm(first.centre - second.centre))
    if moved < LEAST_CHANGE * d1:
        raise GeometryError(
            f"no parallax: both photos were taken from one place ({moved:.2f} m apart, {d1:.2f} m "
            "from the wall), only the zoom was changed. This is the classic mistake: change the "
            "lens AND walk, long lens from afar, short lens from near."
        )
    if abs(d1 - d2) < LEAST_CHANGE * max(d1, d2):
        raise GeometryError(
            f"hardly any change of distance: {d1:.2f} and {d2:.2f} m. Relief comes from the "
            "difference; go nearer with the short lens, by a third of the distance or more."
        )


def check_determined(adjusted: AdjustedPair) -> None:
    """Refuse a set-up whose distances came out hardly better than guessed."""
    for number, camera in enumerate(adjusted.cameras, start=1):
        distance = float(camera.centre[2])
        sigma = adjusted.sigma("Z", number)
        if sigma < 0.25 * distance:
            continue
        missing = (
            "control points off the wall (a relief of 0.3 m or more), the focal lengths "
            "(--lens, --focal1, --focal2) or the distances (--distance1, --distance2)"
        )
        raise GeometryError(
            f"the distance of camera {number} is not determined: {distance:.2f} ± {sigma:.2f} m. "
            f"A flat wall seen square on does not tell a long lens from a short distance. Give "
            f"{missing}."
        )
