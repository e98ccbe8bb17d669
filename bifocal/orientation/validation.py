"""Why two photos do not make a bifocal pair, each reason in the user's terms."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.matching import sharpness
from bifocal.model import FARTHEST_WALL, Cameras, Images, Interior, Interiors, apply_homography
from bifocal.model.hypotheses import FACTORS, unit_of
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.starts.relative_orientation import Ties, rotation_only
from bifocal.orientation.tuning import VALIDATION
from bifocal.remarks import remark
from photocore.arrays import ByteArray, FloatArray
from photocore.errors import GeometryError, InputError
from photocore.provenance import note_remark


class SamePhotoError(GeometryError):
    """Both photos are one and the same."""


def check_sharp(name: str, image: ByteArray) -> None:
    """Refuse a blurred photo; of a large one that is sharp when reduced, note that it is soft."""
    value = reduced = sharpness(image)
    times, small = 1, image
    while reduced < VALIDATION.blurred and small.size >= VALIDATION.large:
        small = cv2.resize(
            image, None, fx=0.5 / times, fy=0.5 / times, interpolation=cv2.INTER_AREA
        )
        times, reduced = 2 * times, sharpness(small)
    if reduced < VALIDATION.blurred:
        raise GeometryError(remark("align.blurred", of=name, value=value))
    if times > 1:
        note_remark(remark("align.soft", of=name, value=value, times=times))


def check_different(name1: str, name2: str, images: Images) -> None:
    """Refuse one photo given twice, also saved again or in another size."""
    small = [
        cv2.resize(image, (96, 64), interpolation=cv2.INTER_AREA).astype(np.float64)
        for image in images
    ]
    a, b = (part - part.mean() for part in small)
    alike = float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-9))
    if alike > 0.9995:
        raise SamePhotoError(remark("align.same_photo", name1=name1, name2=name2))


def unknown_lenses(interiors: Interiors, names: tuple[str, str]) -> str:
    """Return of which photos nobody knows the focal length, and what to give; or nothing."""
    unknown = [side for side, interior in enumerate(interiors) if interior.is_assumed]
    if len(unknown) == len(names):
        return remark("refused.unknown_focals", first=names[0], second=names[1])
    return "".join(remark("refused.unknown_focal", name=names[k], number=k + 1) for k in unknown)


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
        raise SamePhotoError(remark("refused.same_view", first=names[0], second=names[1]))
    if moving >= 0.03:
        return False
    if rotation_only(ties, interiors):
        raise GeometryError(remark("refused.zoom_only", first=names[0], second=names[1]))
    if not flat_is_fine:
        raise GeometryError(remark("refused.flat"))
    return True


#: Units in which lengths are typed by mistake, parts of a metre.
_UNITS = tuple((FACTORS[unit], unit) for unit in ("mm", "cm"))


def check_units(cameras: Cameras, site: SiteMeasures, *, lenses_known: bool = False) -> None:
    """Refuse control points and distances that are not in metres, one beside the other."""
    d1, d2 = (float(camera.centre[2]) for camera in cameras)
    agree = False
    for name, distance, measured in (("1", d1, site.distance1), ("2", d2, site.distance2)):
        if measured is None:
            continue
        agree |= 0.8 < distance / measured < 1.25
        about = {"number": name, "given": measured, "found": distance}
        if measured > FARTHEST_WALL and not agree:
            nearest = min(_UNITS, key=lambda one: abs(np.log(measured / one[0] / distance)))
            meant = {"unit": nearest[1], "meant": measured / nearest[0]}
            raise InputError(remark("refused.too_far", **meant, **about))
        if unit := unit_of(measured / distance, within=0.1) if lenses_known else "":
            raise InputError(remark("refused.tape_unit", unit=unit, **about))
        if lenses_known and unit_of(distance / measured, within=0.1) == "ft":
            raise InputError(remark("refused.control_unit", unit="ft", **about))
        for factor, unit in _UNITS:
            if 0.8 < distance / measured / factor < 1.25:
                raise InputError(remark("refused.control_unit", unit=unit, **about))
    if max(d1, d2) > FARTHEST_WALL and not agree:
        raise InputError(remark("refused.control_far", d1=d1, d2=d2))


def check_distortion(radial: FloatArray, interior: Interior) -> None:
    """Refuse an estimated radial distortion (k1, k2) that no lens for façades has."""
    half = float(np.hypot(*interior.image_size)) / 2
    square = (half / interior.focal) ** 2
    bend = float(square * (radial[0] + square * radial[1]))
    # r / (1 + bend), so that a bend of -1 and below folds the photo over.
    moved = abs(bend / (1 + bend)) if bend > -0.9 else np.inf
    if moved > VALIDATION.most_distortion and interior.is_assumed:
        raise GeometryError(remark("refused.no_focals"))
    if moved > VALIDATION.most_distortion:
        share = min(100 * moved, 999)
        raise GeometryError(remark("refused.distortion", share=share, k1=radial[0]))


def check_movement(adjusted: AdjustedPair) -> None:
    """Refuse a pair whose cameras stand (almost) at one distance."""
    first, second = adjusted.cameras
    d1, d2 = float(first.centre[2]), float(second.centre[2])
    moved = float(np.linalg.norm(first.centre - second.centre))
    if moved < VALIDATION.least_change * d1:
        raise GeometryError(remark("refused.one_place", apart=moved, distance=d1))
    if abs(d1 - d2) < VALIDATION.least_change * max(d1, d2):
        raise GeometryError(remark("refused.one_distance", d1=d1, d2=d2))


def check_determined(adjusted: AdjustedPair) -> None:
    """Refuse a set-up whose distances came out hardly better than guessed."""
    for number, camera in enumerate(adjusted.cameras, start=1):
        distance = float(camera.centre[2])
        sigma = adjusted.sigma("Z", number)
        if sigma < 0.25 * distance:
            continue
        about = {"number": number, "distance": distance, "sigma": sigma}
        raise GeometryError(remark("refused.undetermined", **about))
