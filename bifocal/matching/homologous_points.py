"""The same details of the wall in both photos of a pair: in memory, no files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bifocal.files import greys_of_pair
from bifocal.matching.matches import Matches
from bifocal.matching.matching import MatchSettings, match_pair
from bifocal.model import Pair


def match(
    pair: Pair,
    image1: NDArray[np.generic],
    image2: NDArray[np.generic],
    *,
    settings: MatchSettings | None = None,
) -> Matches:
    """Return homologous points: natural detail matched along radial lines, and survey targets.

    Parameters
    ----------
    pair : Pair
        Oriented, e.g. by `align`.
    image1, image2 : ndarray of uint8 or uint16, shape (height, width[, 3])
        Far and near photo as taken.
    settings : MatchSettings, optional
        How many points, features or targets, least and greatest relief. [m]

    Returns
    -------
    Matches
        ``.pixels1`` and ``.pixels2``, shape (n, 2), (column, row) in the photos as taken, with
        ``.sigma`` along the line and ``.misfit`` across it. [px] `Pair.intersect` turns them into
        X, Y, r.

    Raises
    ------
    InputError
        If an image is unusable.
    GeometryError
        If hardly anything matches: photos and pair do not belong together.

    Notes
    -----
    A point of photo 1 lies on photo 2 on the line from the centre of zoom through it, at a place
    that depends on its relief alone, Eq. (5); the error across that line is free of relief and so
    tells a good point from a blunder.

    Examples
    --------
    A flat wall at equal scale looks the same on both photos:

    >>> import cv2
    >>> scale = [[0.01, 0, -1.0], [0, -0.01, 0.75], [0, 0, 1]]
    >>> from bifocal import MatchSettings, Photo
    >>> pair = Pair(image1=Photo(plane_from_pixel=scale, nadir=(0, 0), distance=17.5),
    ...             image2=Photo(plane_from_pixel=scale, nadir=(0, 0), distance=9.5))
    >>> noise = np.random.default_rng(1).integers(0, 255, (50, 67), np.uint8)
    >>> photo = cv2.resize(noise, (201, 151), interpolation=cv2.INTER_CUBIC)
    >>> points = match(pair, photo, photo, settings=MatchSettings(count=50, targets=False))
    >>> bool(np.abs(points.pixels1 - points.pixels2).max() < 0.001)
    True
    """
    return match_pair(pair, greys_of_pair(pair, image1, image2), settings)
