"""A pair taken exactly as it was set up: typed distances and focal lengths, nothing registered."""

from __future__ import annotations

import numpy as np

from bifocal.model import NAMES, SCALE_TOLERANCE, Cameras, PairMedia
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.adjustment.pair_observations import PairObservations, at
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.orientation_stages import OrientedPair, Photos
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import Pinhole
from photocore.errors import InputError


def pair_as_set_up(photos: Photos, site: SiteMeasures, media: PairMedia) -> OrientedPair:
    """Return the pair whose cameras stand square to the wall, one behind the other, as typed.

    Parameters
    ----------
    photos : pair of PhotoInput
        Far photo first; their interior orientations are taken as they are.
    site : SiteMeasures
        Both distances. [m]
    media : PairMedia
        What lies between cameras and wall; nothing of it is estimated, the sigmas of its unknowns
        go into the pair's covariance.

    Raises
    ------
    InputError
        If a distance or a focal length is missing, the far camera is the nearer, or the media leave
        no room.
    """
    d1, d2 = site.distances
    if not (d1 and d2):
        raise InputError(remark("refused.typed_distances"))
    if d1 <= d2:
        raise InputError(remark("refused.far_first", d1=d1, d2=d2))
    for number, photo in enumerate(photos, start=1):
        if photo.interior.is_assumed:
            raise InputError(remark("refused.typed_focal", name=photo.name, number=number))
    scales = [p.interior.focal / d for p, d in zip(photos, (d1, d2), strict=True)]
    pitches = [p.interior.pixel_size for p in photos if p.interior.pixel_size is not None]
    if len(pitches) == 2:  # as sensors show it, of whatever size the photos were saved
        scales = [s * pitch for s, pitch in zip(scales, pitches, strict=True)]
    apart = scales[0] / scales[1] - 1.0
    if abs(apart) > SCALE_TOLERANCE and not media:
        unit = {"apart": 100 * abs(apart), "most": 100 * SCALE_TOLERANCE}
        raise InputError(remark("refused.scales", d1=d1, d2=d2, meant=d1 * (1 + apart), **unit))
    square_on = np.diag([1.0, -1.0, -1.0])
    first, second = (
        Pinhole(photo.interior.matrix, square_on, np.array([0.0, 0.0, distance]))
        for photo, distance in zip(photos, (d1, d2), strict=True)
    )
    check_room(media, (first, second))
    nothing = np.zeros((0, 4))
    adjusted = AdjustedPair(
        cameras=(first, second),
        media=media,
        covariance=_of_typed(media, (first, second), site.sigma),
        sigma0=1.0,
        control_residuals=nothing,
        control_test=np.zeros(0),
        tie_misfit=np.zeros(0),
        wall_misfit=np.zeros(0),
    )
    interiors = photos[0].interior, photos[1].interior
    return OrientedPair(
        observations=PairObservations(interiors=interiors, media=media),
        adjusted=adjusted,
        assumed=(
            remark(f"orientation.as_typed{'_media' if media else ''}", within=1000 * site.sigma),
        ),
    )


def check_room(media: PairMedia, cameras: Cameras) -> None:
    """Refuse media that begin before a camera, or end behind the wall.

    Raises
    ------
    InputError
    """
    for number, camera in enumerate(cameras):
        path = media.path(number, camera)
        if not path:
            return
        about: dict[str, object] = {"number": number + 1, "distance": path.distance}
        if path.z0 < 0:
            about |= {"depth": media.depth, "thick": media.layers.thickness}
            raise InputError(remark("refused.depth_room", **about))
        if not path.holds(np.zeros(2), np.zeros(())):
            raise InputError(remark("refused.port_room", depth=path.last_interface, **about))


def _of_typed(media: PairMedia, cameras: Cameras, sigma: float) -> FloatArray:
    """Return the covariance of typed distances and media at scales that are exact.

    The scale on the wall near the axis is the principal distance over `PairMedia.near_axis`: that
    is what an error of the distance leaves as it is.
    """
    out = np.zeros((len(media.names), len(media.names)))
    for number, camera in enumerate(cameras):
        row = np.zeros(len(media.names))
        row[at("Z", number + 1)] = 1.0
        apparent, rate = media.near_axis(number, camera)
        row[at("focal length", number + 1)] = 1.0 / (apparent / rate)
        out += sigma**2 * np.outer(row, row)
    for place, name in enumerate(media.names[len(NAMES) :], start=len(NAMES)):
        stated = media.sigmas[name]
        out[place, place] = stated**2 if np.isfinite(stated) else 0.0
    by = media.by_unknowns()
    return by @ out @ by.T
