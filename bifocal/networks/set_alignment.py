"""From photos oriented together to a set of photos: axes, lenses, covariance, words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bifocal.model import (
    CAMERA,
    Diagnostics,
    Interior,
    PairMedia,
    PhotoSet,
    deviations_by_photo,
    moved,
)
from bifocal.networks.photo_influence import dragging_photo
from bifocal.networks.set_orientation import OrientedSet, orient_set
from bifocal.orientation import REMARKS, Control, PhotoInput, SiteMeasures, zero_sigma
from bifocal.orientation.alignment import Alignment, facade_axes, lens_of, photo_of, radial_units
from bifocal.orientation.photo_alignment import align, photo_input
from bifocal.remarks import remark
from photocore.adjustment import OUTLIER_LIMIT
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.remarks import alarms_in


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SetAlignment:
    """A set of photos oriented, with what stands behind it.

    Attributes
    ----------
    photos : PhotoSet
        In the order given, with the covariance of all.
    way : str
        ``control``, ``site`` or ``auto``.
    setup : mapping
        Diagnostics for the file; of two photos those of their pair.
    deviations : sequence of mapping
        Standard deviations of each camera: ``distance``, ``nadir`` [m], ``tilt_deg``, ``focal_px``.
    words : tuple of str
        The set-up in sentences.
    remarks : tuple of str
        What the user should be warned of.
    """

    photos: PhotoSet
    way: str
    setup: Diagnostics
    deviations: Sequence[Mapping[str, float | None]]
    words: tuple[str, ...]
    remarks: tuple[str, ...]

    @classmethod
    def of_pair(cls, alignment: Alignment) -> Self:
        """Return two photos as their pair has them, in the order in which they were given."""
        order = (1, 0) if alignment.exchanged else (0, 1)
        deviations = deviations_by_photo(alignment.setup)
        return cls(
            photos=PhotoSet.from_pair(alignment.pair).only(order), way=alignment.way,
            setup=alignment.setup, deviations=[deviations[k] for k in order],
            words=alignment.words, remarks=alignment.remarks,
        )  # fmt: skip


def align_set(
    images: Sequence[NDArray[np.generic]],
    *,
    interiors: Sequence[Interior],
    control: Control | None = None,
    site: SiteMeasures | None = None,
) -> SetAlignment:
    """Orient photos of one wall together: where all cameras stood and looked, at which scale.

    Parameters
    ----------
    images : sequence of ndarray of uint8 or uint16, shape (height, width[, 3])
        Two photos or more, upright, in any order: which is the far one is found.
    interiors : sequence of Interior
        What is known of each photo's lens.
    control : Control, optional
        Points measured on the wall, with their pixels in the photos in this order (``pixels1``,
        ``pixels2``, ``more``); four that two photos show hold the frame.
    site : SiteMeasures, optional
        ``distance1`` is that of the first photo, ``distance2`` of the second. [m]

    Returns
    -------
    SetAlignment
        ``.photos``, a `PhotoSet` with the covariance of all its cameras.

    Raises
    ------
    InputError
        If an image is unusable, or interiors or picks are not one for each.
    GeometryError
        If a photo shares too little with the others, or no two of them make a pair.

    Notes
    -----
    Two photos are what `align` makes of them. Of more the best pair is oriented as by `align`,
    further photos by space resection; then control points, distances, lengths, the wall, the
    lenses and the rays of points that two or more photos share enter one least-squares
    adjustment. Photos of one lens share its unknowns.
    """
    if len(images) != len(interiors) or len(images) < 2:
        raise InputError(f"{len(images)} images and {len(interiors)} interiors: one for each.")
    if len(images) == 2:
        lenses = interiors[0], interiors[1]
        pair = align(images[0], images[1], interiors=lenses, control=control, site=site)
        return SetAlignment.of_pair(pair)
    control, site = control or Control(), site or SiteMeasures()
    both = enumerate(zip(images, interiors, strict=True), start=1)
    photos = [photo_input(image, interior, f"image{k}") for k, (image, interior) in both]
    return set_alignment(orient_set(photos, control=control, site=site), photos)


def set_alignment(
    oriented: OrientedSet,
    photos: Sequence[PhotoInput],
    direction: tuple[FloatArray, bool] | None = None,
) -> SetAlignment:
    """Return the set of adjusted cameras with its diagnostics; photo files are not yet named.

    Parameters
    ----------
    oriented : OrientedSet
    photos : sequence of PhotoInput
        As oriented.
    direction : (pixels (2, 2), is_vertical), optional
        Two points of the first photo on a level or upright line of the wall.
    """
    adjusted, first = oriented.adjusted, oriented.first
    cameras, covariance = adjusted.cameras, adjusted.of_cameras.copy()
    radial = adjusted.radial
    assumed: tuple[str, ...] = ()
    if oriented.free_frame:
        lead = first.far if direction is None else 0
        axes, note = facade_axes(cameras[lead], photos[lead], direction)
        origin = cameras[first.far].centre * [1.0, 1.0, 0.0]
        cameras = tuple(camera.moved(axes, origin) for camera in cameras)
        covariance, assumed = moved(covariance, axes, len(cameras)), (note,)
    unit = np.ones((len(cameras), len(CAMERA)))
    unit[:, -2:] = radial_units(cameras, first.interiors)
    covariance *= np.outer(unit, unit)
    heights = np.arange(len(cameras)) * len(CAMERA) + CAMERA.index("Z")
    # Another face that may be the wall moves all cameras alike.
    offset = 0.0 if first.pair.wall_named else zero_sigma(first.pair.faces)
    covariance[np.ix_(heights, heights)] += offset**2
    aligned = tuple(
        photo_of(camera, interior, lens_of(interior, k), (PairMedia.none(), 0))
        for camera, interior, k in zip(cameras, first.interiors, radial, strict=True)
    )
    sigma = np.sqrt(np.diag(covariance)).reshape(-1, len(CAMERA))
    words, remarks = _words(oriented, sigma), _remarks(oriented)
    used = adjusted.observations
    wrong = {b.point: b.test for b in adjusted.blunders if b.where == "control"}
    setup: Diagnostics = {
        "way": oriented.way, "sigma0": adjusted.sigma0, "assumed": list(assumed),
        "focal_px": [float(camera.matrix[0, 0]) for camera in cameras],
        "principal_point_px": [camera.matrix[:2, 2] for camera in cameras],
        "radial": radial * unit[:, -2:] if radial.any() else None,
        "interior": [interior.source for interior in first.interiors],
        "standard_deviations": [
            {"distance": s[9], "nadir": float(np.hypot(*s[7:9]) / np.sqrt(2)),
             "tilt_deg": float(np.rad2deg(np.hypot(*s[4:6]) / np.sqrt(2))), "focal_px": s[0] * f}
            for s, f in zip(sigma, (c.matrix[0, 0] for c in cameras), strict=True)
        ],
        "common_points": {
            "count": len(np.unique(used.point)), "rays": len(used.point),
            "on_wall": oriented.on_wall, "sigma_px": oriented.sigma_tie,
        },
        "control": [
            {"id": name, "off": off, "used": name not in wrong, "test": wrong.get(name)}
            for name, off in zip(oriented.control.ids, adjusted.control.tolist(), strict=False)
        ],
        "doubts": alarms_in(remarks),
        "words": list(words),
    }  # fmt: skip
    return SetAlignment(
        photos=PhotoSet(photos=aligned, orientation=covariance), way=oriented.way, setup=setup,
        deviations=setup["standard_deviations"], words=words, remarks=remarks,
    )  # fmt: skip


def _words(oriented: OrientedSet, sigma: FloatArray) -> tuple[str, ...]:
    """Return the set-up in sentences; ``sigma`` are those of `CAMERA`, shape (m, 12)."""
    adjusted, network = oriented.adjusted, oriented.adjusted.observations
    words = [
        remark(
            "photo_set.adjusted", photos=len(network.names), points=len(np.unique(network.point)),
            rays=len(network.point), sigma=oriented.sigma_tie, sigma0=adjusted.sigma0,
            far=network.names[oriented.first.far], near=network.names[oriented.first.near],
        )
    ]  # fmt: skip
    rays = np.bincount(network.camera, minlength=len(network.names))
    for k, (name, camera) in enumerate(zip(network.names, adjusted.cameras, strict=True)):
        tilt = float(np.rad2deg(np.arctan(np.hypot(*camera.tilt))))
        about = {"distance": float(camera.centre[2]), "sigma": 1000 * float(sigma[k, 9])}
        words.append(remark("photo_set.station", name=name, tilt=tilt, rays=int(rays[k]), **about))
    return tuple(words)


def _remarks(oriented: OrientedSet) -> tuple[str, ...]:
    """Return doubts of the first pair, gross errors, and what was taped wrong or is missing."""
    adjusted, remarks = oriented.adjusted, list(oriented.first.pair.remarks)
    names = adjusted.observations.names
    for blunder in (*adjusted.blunders, *adjusted.left_in):
        if blunder.point not in oriented.control.ids:
            continue
        if blunder.where == "control":
            about = {"name": blunder.point, "sigmas": blunder.test}
            remarks.append(remark("orientation.gross_control", **about))
        else:
            about = {"name": blunder.point, "photo": blunder.where, "sigmas": blunder.test}
            remarks.append(remark("photo_set.gross_pick", **about))
    knowledge = adjusted.observations.cameras
    assert knowledge is not None
    for shares, metres, sigma in knowledge.distances:
        places = {k * len(CAMERA) + CAMERA.index("Z"): share for k, share in shares.items()}
        row = np.array(list(places.values()))
        off = sum(share * adjusted.cameras[k].centre[2] for k, share in shares.items()) - metres
        spread = float(row @ adjusted.of_cameras[np.ix_(list(places), list(places))] @ row)
        test = abs(off) / np.sqrt(max(sigma**2 - spread, 1e-4 * sigma**2))
        if test > OUTLIER_LIMIT and abs(off) > sigma:
            about = {"off": float(off), "given": metres, "sigmas": float(test)}
            name = " - ".join(names[k] for k in shares)
            remarks.append(remark("photo_set.distance_contradicts", name=name, **about))
    for k, camera in enumerate(adjusted.cameras):
        spread = float(np.sqrt(adjusted.of_cameras[k * len(CAMERA) + 9, k * len(CAMERA) + 9]))
        if spread > REMARKS.worst_scale * camera.centre[2]:
            about = {"distance": float(camera.centre[2]), "sigma": spread}
            remarks.append(remark("photo_set.poor_distance", name=names[k], **about))
    if (dragging := dragging_photo(adjusted)) is not None:
        about = {"times": dragging.test, "moved": 1000 * dragging.moved}
        remarks.append(remark("photo_set.drags", name=dragging.name, **about))
    return tuple(dict.fromkeys(remarks))
