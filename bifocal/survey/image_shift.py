"""Where points would be on photo 1 without relief, and how far that is from where they are."""

from __future__ import annotations

import numpy as np

from bifocal.model import Photo, apply_homography
from bifocal.rays import apparent_of_plane
from bifocal.survey.observations import PointObservations
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import SurveySetup
from photocore.arrays import FloatArray


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
        measured = setup.in_millimetres(points)
        polar = measured.polar[:, 0]
        move = radius - np.where(measured.is_cartesian, np.hypot(*measured.xy1.T), polar)
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
