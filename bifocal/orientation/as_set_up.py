"""A pair taken exactly as it was set up: typed distances and focal lengths, nothing registered."""

from __future__ import annotations

import numpy as np

from bifocal.model.orientation_precision import of_distances
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.orientation_stages import OrientedPair, Photos
from bifocal.orientation.pair_adjustment import AdjustedPair
from bifocal.orientation.pair_observations import PairObservations
from photocore.camera import Pinhole
from photocore.errors import InputError


def pair_as_set_up(photos: Photos, site: SiteMeasures) -> OrientedPair:
    """Return the pair whose cameras stand square to the wall, one behind the other, as typed.

    Parameters
    ----------
    photos : pair of PhotoInput
        Far photo first; their interior orientations are taken as they are.
    site : SiteMeasures
        Both distances. [m]

    Raises
    ------
    InputError
        If a distance or a focal length is missing, or the far camera is the nearer.
    """
    d1, d2 = site.distances
    if not (d1 and d2):
        raise InputError(
            "--as-set-up takes the set-up as typed: give --distance1 and --distance2, or one of "
            "them and --delta-d."
        )
    if d1 <= d2:
        raise InputError(
            f"--distance1 {d1:g} m is not larger than --distance2 {d2:g} m: the far photo comes "
            "first."
        )
    for number, photo in enumerate(photos, start=1):
        if photo.interior.is_assumed:
            raise InputError(
                f"--as-set-up needs the focal length of {photo.name}, which its EXIF data do not "
                f"tell: give --focal{number} with --sensor-width or --pixel-size, or "
                f"--lens{number}."
            )
    square_on = np.diag([1.0, -1.0, -1.0])
    first, second = (
        Pinhole(photo.interior.matrix, square_on, np.array([0.0, 0.0, distance]))
        for photo, distance in zip(photos, (d1, d2), strict=True)
    )
    nothing = np.zeros((0, 4))
    adjusted = AdjustedPair(
        cameras=(first, second),
        covariance=of_distances(d1, d2, site.sigma),
        sigma0=1.0,
        control_residuals=nothing,
        control_test=np.zeros(0),
        tie_misfit=np.zeros(0),
        wall_misfit=np.zeros(0),
    )
    interiors = photos[0].interior, photos[1].interior
    return OrientedPair(
        observations=PairObservations(interiors=interiors),
        adjusted=adjusted,
        assumed=(
            "the set-up exactly as typed: square to the wall, nadirs in the principal points, both "
            f"photos at the typed scales; distances within {1000 * site.sigma:.0f} mm",
        ),
    )
