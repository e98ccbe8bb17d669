"""Where points would be on photo 1 without relief, and how far that is from where they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bifocal.media import MediaPath
from bifocal.model.homography import apply_homography
from bifocal.model.photo import Photo
from bifocal.rays import apparent_of_plane
from bifocal.survey.observations import PointObservations
from bifocal.survey.refracted_radii import length, level_too
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import SurveySetup
from bifocal.survey.survey_lens import turns_of
from multimedia.refraction.tangent import ratios, ray_sums
from photocore.arrays import FloatArray

#: Turns of Newton to the foot through ports that lean.
_TURNS = 8


def image_shift(
    photo: Photo, setup: SurveySetup | None, points: PointObservations, table: ReliefTable
) -> dict[str, FloatArray]:
    """Return Eq. (7) on photo 1: where the foot of each point on the wall is seen, and the shift.

    Parameters
    ----------
    photo : Photo
        Photo 1, in the order of the points.
    setup : SurveySetup or None
        Of an ideal pair, whose unit is that of the input; None for raw pixels.
    points, table : PointObservations, ReliefTable
        What was measured and what came out.

    Returns
    -------
    dict
        ``x_c y_c``, the corrected image position, and ``dx dy``, from the pick to there; each of
        shape (n,), NaN where undefined. [unit of the input]

    Examples
    --------
    The point 2 m right of the nadir that stands out 1 m, on 35 mm / 17.5 m: s = 35 x 2 / 16.5 mm,
    e = s / 17.5, so it belongs 4 mm from the nadir, 0.2424 mm nearer:

    >>> from bifocal import PointObservations, SurveySetup, Taking
    >>> from bifocal.survey.point_survey import solve_points
    >>> setup = SurveySetup(taking=Taking(d1=17.5, d2=9.5, c1=35, c2=19))
    >>> picks = PointObservations(ids=("P1",), xy1=[[35 * 2 / 16.5, 0]], xy2=[[19 * 2 / 8.5, 0]])
    >>> table, photo = solve_points(setup.pair(), picks), setup.pair().image1
    >>> [v.round(4).tolist() for v in image_shift(photo, setup, picks, table).values()]
    [[4.0], [0.0], [-0.2424], [-0.0]]
    """
    if setup is None:
        corrected, shift = _of_pixels(photo, points.pixels1, table)
    else:
        corrected, shift = _of_radii(photo, setup, points, table)
    return dict(zip(("x_c", "y_c", "dx", "dy"), (*corrected.T, *shift.T), strict=True))


def foot_tangents(photo: Photo, table: ReliefTable) -> dict[str, FloatArray]:
    """Return the turns by which formulas find the tangent of the ray to each foot; none in air.

    ``foot_0`` is that of the pick's arm; each turn of Newton makes the next. Three reach rounding.
    """
    media = photo.media
    if not isinstance(media, MediaPath):
        return {}
    if "down1" in table.formula_cells:
        return _leaning_feet(level_too(media), table.xyz[:, :2] - photo.nadir)
    radius = np.hypot(*(table.xyz[:, :2] - photo.nadir).T)
    tangent, turns = radius / table.formula_cells["arm1"], {}
    for turn in range(4):
        turns[f"foot_{turn}"] = tangent
        way = media.radial_rays(tangent)
        tangent = tangent - (tangent * way.arm - radius) / way.pace
    return turns


def _leaning_feet(media: MediaPath, away: FloatArray) -> dict[str, FloatArray]:
    """Return how the feet of points, (X, Y) from the nadir, are seen through ports that lean.

    ``behind`` is the way of each behind the last interface, ``foot_x foot_y foot_z`` its place
    along the interfaces [m]; ``foot_0`` to ``foot_8`` are turns of Newton for the tangent in the
    thinnest medium, eight reaching rounding up to 80 degrees; ``foot_a`` the arm over that in the
    first, ``foot_tx foot_ty`` the ray there in the plane frame; NaN where no ray is found.
    """
    assert media.rotation is not None
    normal, depth = media.rotation[2], media.last_interface
    behind = media.distance * normal[2] - away @ normal[:2] - depth
    behind = np.where(behind >= 0, behind, np.nan)
    foot = np.column_stack([away, np.full(len(away), -media.distance)])
    foot = foot + (behind + depth)[:, None] * normal
    columns = {"behind": behind, **dict(zip(("foot_x", "foot_y", "foot_z"), foot.T, strict=True))}
    radius, indices = length(foot), media.layers.indices
    least = min(indices)
    reduced = [ratios(index, least) for index in indices]
    heights: list[Any] = [media.z0, *media.layers.thicknesses, behind]
    bent = [(height * k, q) for height, (k, q) in zip(heights, reduced, strict=True)]
    arm, _ = ray_sums(np.zeros(len(away)), 0.0, bent)
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = radius / arm
        for turn in range(_TURNS + 1):
            columns[f"foot_{turn}"] = tangent
            arm, pace = ray_sums(tangent, 0.0, bent)
            off = tangent * arm - radius
            last, tangent = tangent, tangent - off / pace
        k, q = reduced[0]
        arm = np.where(np.abs(off) <= 1e-12 * radius, arm * np.sqrt(1 + q * last**2) / k, np.nan)
        way = foot / arm[:, None] - normal
        seen = np.where(way[:, 2:] < 0, way[:, :2] / -way[:, 2:], np.nan)
    return columns | {"foot_a": arm, "foot_tx": seen[:, 0], "foot_ty": seen[:, 1]}


def lens_turns(
    setup: SurveySetup, points: PointObservations, shift: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return the columns that free picks of lens distortion, and ``grown``, which puts it back.

    Parameters
    ----------
    setup, points : SurveySetup, PointObservations
        As typed.
    shift : mapping
        What `image_shift` found.
    """
    plain, columns = replace(setup, lenses=None, adjusted=(None, None)), dict[str, FloatArray]()
    feet = replace(points, xy1=np.stack([shift["x_c"], shift["y_c"]], axis=-1))
    seen, foot = plain.in_millimetres(points), plain.in_millimetres(feet).xy1
    for image, xy in ((1, seen.xy1), (2, seen.xy2)):
        lens = setup.lens(image)
        if lens is not None:
            columns |= turns_of(lens, xy, image)
            if image == 1:
                columns["grown"] = 1 / turns_of(lens, foot, 1)["lens1"]
    return columns


def _of_pixels(
    photo: Photo, pixels: FloatArray, table: ReliefTable
) -> tuple[FloatArray, FloatArray]:
    """Return corrected raw pixels and the shift to them; small ones keep their digits."""
    inverse = np.linalg.inv(photo.plane_from_pixel)
    free = pixels if photo.lens is None else photo.lens.undistort(pixels)
    foot = apparent_of_plane(table.xyz[:, :2], photo.foot)
    way = (foot - apply_homography(photo.plane_from_pixel, free))[:, :, None]
    rates = inverse[:2, :2] - free[:, :, None] * inverse[2, :2]
    below = foot @ inverse[2, :2] + inverse[2, 2]
    shift = (rates @ way)[:, :, 0] / below[:, None]
    if photo.lens is not None:
        shift = photo.lens.distort(free + shift) - pixels
    return pixels + shift, shift


def _of_radii(
    photo: Photo, setup: SurveySetup, points: PointObservations, table: ReliefTable
) -> tuple[FloatArray, FloatArray]:
    """Return corrected coordinates on an ideal photo, as typed, and the shift to them."""
    angle = np.radians(table["theta_used"])
    radius, move = table["s_c"], -table["e1"]
    if photo.refracted:
        # Only here is s_c a length on the wall, at the scale of the image, and not in the image.
        radius = np.hypot(*photo.pixels_from_plane(table.xyz[:, :2]).T)
        along = table.formula_cells["tan1"] * (photo.principal_distance or photo.distance)
        move = radius - along
    towards = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    corrected, shift = radius[:, None] * towards, move[:, None] * towards
    matrix, lens = setup.adjusted[0], setup.lens(1)
    if matrix is not None:
        corrected = apply_homography(np.linalg.inv(matrix), corrected)
    if lens is not None:
        corrected = lens.distort(corrected)
    unit, nadir = setup.typed_frame(1)
    corrected = corrected / unit + nadir
    is_plain = matrix is None and lens is None
    return corrected, shift / unit if is_plain else corrected - points.xy1
