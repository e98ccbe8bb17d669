"""The sheet `Setup` and the bent ray as formulas, for pairs that look through media.

On the measured side every ray is known, so a spreadsheet follows it layer by layer without
iterating: see `bifocal.media`, whose notation this is.
"""

from __future__ import annotations

from bifocal.model.pair import Pair
from bifocal.rays import seen_distance, straight
from bifocal.survey.survey_media import SurveyMedia
from photocore.workbook.changing.cells import CellValue

#: What may be typed as refractive index: vacuum to germanium.
INDEX_LIMITS = (1.0, 4.1)
#: Unit normals of both cameras' interfaces, of which `NORMALS` may be of any length.
UNIT_NORMALS = tuple(tuple(f"axis_{axis}_{image}" for axis in "xyr") for image in "12")


def _used(media: int) -> tuple[str, ...]:
    return tuple(f"n_used_{number}" for number in range(1, media + 1))


def calculated_names(media: int, *, is_pair: bool, leaning: bool) -> tuple[str, ...]:
    """Return the cells of `Setup` that follow from those of the media."""
    if not media:
        return ()
    units = ("n_least", *UNIT_NORMALS[0], *UNIT_NORMALS[1]) if leaning else ()
    rays = () if is_pair else ("c_rays_1", "c_rays_2", "mm_1", "m_seen")
    both = tuple(f"{name}_{image}" for name in ("behind", "seen", "reach") for image in "12")
    return (*_used(media), *units, *both, "r_top", *rays)


def setup_values(
    media: SurveyMedia | None, pair: Pair | None, *, as_given: bool, is_pair: bool
) -> dict[str, CellValue]:
    """Return the numbers of the cells of media, typed and calculated; none without such cells.

    Parameters
    ----------
    media : SurveyMedia or None
        What is typed.
    pair : Pair or None
        As solved, through the same media; None in an empty template.
    as_given : bool
        Whether the workbook has the photos in the order in which an exchanged pair was given.
    is_pair : bool
        Whether the points are raw pixels of a general pair.
    """
    if media is None:
        return {}
    used = dict(zip(_used(media.media), media.used, strict=True))
    cells: dict[str, CellValue] = {**media.cells, **used}
    cells |= {"mm_1": 1, "n_least": min(media.used)}
    if pair is None:
        return cells
    photos = pair.as_given if as_given else (pair.image1, pair.image2)
    stretch, reach = media.used[-1] / media.used[0], []
    for image, (photo, z0) in enumerate(zip(photos, media.z0, strict=True), start=1):
        thick = sum(value or 0.0 for value in media.thicknesses)
        seen, c = seen_distance(photo.foot), photo.principal_distance
        behind = photo.distance - (z0 or 0.0) - thick
        if media.normals and photo.media:
            seen, behind = straight(photo.foot).distance / stretch, photo.media.highest
            cells |= dict(zip(UNIT_NORMALS[image - 1], photo.towards_camera.tolist(), strict=True))
        reach.append(seen * stretch)
        cells |= {
            f"behind_{image}": behind,
            f"reach_{image}": reach[-1],
            f"seen_{image}": seen,
            f"c_rays_{image}": photo.distance if c is None else c,
        }
    d1, d2 = reach
    cells |= {"r_top": pair.highest_relief, "b_lever": d1 * d2 / (d1 - d2)}
    first, second = photos
    seen1, seen2 = (seen_distance(photo.foot) for photo in photos)
    c1, c2 = first.principal_distance, second.principal_distance
    if c1 is not None:
        cells["m_seen"] = 1000 * seen1 / c1
    if c1 is not None and c2 is not None and not is_pair:
        cells |= {"mm_1": c1 / first.distance, "k_12": (seen2 / c2) / (seen1 / c1)}
    return cells
