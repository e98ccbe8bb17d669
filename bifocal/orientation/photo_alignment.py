"""Two photos and what was measured on site in, an oriented pair out: in memory, no files."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bifocal.files import greys_through_water
from bifocal.model import Interior, PairMedia, as_grey
from bifocal.orientation.absolute_orientation import orient_pair
from bifocal.orientation.alignment import Alignment, make_alignment
from bifocal.orientation.as_set_up import pair_as_set_up
from bifocal.orientation.control_points import Control, SiteMeasures
from bifocal.orientation.orientation_stages import PhotoInput
from photocore.arrays import as_points
from photocore.errors import InputError


def align(
    image1: NDArray[np.generic] | None,
    image2: NDArray[np.generic] | None,
    *,
    interiors: tuple[Interior | None, Interior | None] = (None, None),
    control: Control | None = None,
    site: SiteMeasures | None = None,
    line: tuple[Literal["level", "upright"], ArrayLike] | None = None,
    as_set_up: bool = False,
    media: PairMedia | None = None,
) -> Alignment:
    r"""Orient a pair of photos: where both cameras stood, how they looked, at which scale.

    Parameters
    ----------
    image1, image2 : ndarray of uint8 or uint16, shape (height, width[, 3]), or None
        Far and near photo as taken, upright. None where ``control`` alone is to orient it.
    interiors : pair of Interior, optional
        What is known of each lens; None: a normal lens, principal distance within a factor of
        1.65. Required where there is no photo.
    control : Control, optional
        Points measured on the wall and their pixels: X, Y, r [m] and (column, row) [px]. Four in
        both photos suffice, one of them off the plane by 0.3 m or more unless the lenses are
        calibrated.
    site : SiteMeasures, optional
        Distances to the wall [m], and whether the cameras were square to it (``parallel``, counts
        where nothing stands out from the wall).
    line : ("level" or "upright", array_like of shape (2, 2)), optional
        Two pixels of the far photo on such a line of the wall, for the direction of X and Y where
        no control points give it. [px]
    as_set_up : bool
        Whether distances and principal distances are taken exactly as they are given: cameras
        square to the wall, nadirs in the principal points, nothing registered. The distances'
        ``site.sigma`` goes into the pair; ``interiors`` must tell both principal distances.
    media : PairMedia, optional
        Plane-parallel media that both cameras look through, with what is unknown of them
        (`PairMedia.stated`): with ``control`` of four points and more, ``as_set_up``, or photos
        with known lenses and one distance or length.

    Returns
    -------
    Alignment
        ``.pair``, a `Pair` ready for every other function, with standard deviations, residuals of
        the control points, homologous points and remarks. If the near photo was given first,
        image 1 of the pair is ``image2``, and a remark says so.

    Raises
    ------
    InputError
        If an image or a line is unusable, a photo and its interior are both missing, or a set-up
        to be taken as it is lacks a distance or a principal distance.
    GeometryError
        If photos and measurements do not make a pair; the message says why and what to do.

    Notes
    -----
    Each control point and homologous point gives collinearity equations in both photos, adjusted
    together by least squares for both cameras; the reference plane is the wall of the control
    points or the dominant plane. A relative scale error of the photos shifts all relief by
    :math:`B = d_1 d_2 / (d_1 - d_2)` times that error.

    Examples
    --------
    Six points of a wall seen by cameras at 17.5 m and 9.5 m, 10 mm a pixel:

    >>> from bifocal import Control, Interior, Pair, Photo
    >>> scale = [[0.01, 0, -2.0], [0, -0.01, 1.5], [0, 0, 1]]
    >>> far = Photo(plane_from_pixel=scale, nadir=(0, 0), distance=17.5)
    >>> near = Photo(plane_from_pixel=scale, nadir=(0, 0), distance=9.5)
    >>> wall = np.array([[-1.5, -1, 0], [1.5, -1, 0.2], [1.4, 1.1, 0], [-1.5, 1, 0.1],
    ...                  [0.3, 0.2, -0.3], [-0.4, 0.5, 0.35]])
    >>> pixels1, pixels2 = Pair(image1=far, image2=near).project(wall)
    >>> control = Control(ids=tuple("ABCDEF"), xyz=wall, sigma=np.full((6, 3), 0.001),
    ...                   pixels1=pixels1, pixels2=pixels2)
    >>> lenses = [Interior.from_focal(focal, image_size=(401, 301), sigma=5e-4, source="board")
    ...           for focal in (1750, 950)]
    >>> pair = align(None, None, interiors=tuple(lenses), control=control).pair
    >>> round(pair.image1.distance, 3), round(pair.image2.distance, 3)
    (17.5, 9.5)
    """
    if line is not None and line[0] not in ("level", "upright"):
        raise InputError(f"line: expected level or upright and two pixels, got {line[0]!r}.")
    site, media = site or SiteMeasures(), media or PairMedia.none()
    if media and image1 is not None and image2 is not None:
        image1, image2 = greys_through_water(image1, image2)
    photos = (
        photo_input(image1, interiors[0], "image1"),
        photo_input(image2, interiors[1], "image2"),
    )
    direction = line and (as_points(line[1], "line", dimension=2), line[0] == "upright")
    if as_set_up:
        if control is not None or line is not None:
            raise InputError("as_set_up registers nothing: leave out control and line.")
        return make_alignment(pair_as_set_up(photos, site, media), photos, way="as set up")
    oriented = orient_pair(photos, control=control or Control(), site=site, media=media)
    way = "control" if control is not None else "site" if site.parallel else "auto"
    ordered = (photos[1], photos[0]) if oriented.exchanged else photos
    return make_alignment(oriented, ordered, way=way, direction=direction)


def photo_input(
    image: NDArray[np.generic] | None, interior: Interior | None, name: str
) -> PhotoInput:
    """Return a photo and what is known of its lens."""
    if image is None:
        if interior is None:
            raise InputError(f"{name}: give the photo, or its interior orientation.")
        return PhotoInput(grey=None, interior=interior, name=name)
    grey = as_grey(image, name)
    size = (grey.shape[1], grey.shape[0])
    if interior is not None and interior.image_size != size:
        raise InputError(
            f"{name}: is {size[0]} x {size[1]} px, its interior orientation is for "
            f"{interior.image_size[0]} x {interior.image_size[1]} px."
        )
    return PhotoInput(grey=grey, interior=interior or Interior.unknown(size), name=name)
