"""A pair set up without a scale gets it from one measure: exactly what an adjustment with it gives.

Two photos alone determine everything but the scale, so one length or distance cannot contradict
them: it multiplies all lengths, and nothing has to be adjusted anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bifocal.model import (
    CAMERA,
    LENGTHS,
    MISFITS,
    NAMES,
    RIVALS,
    Pair,
    PairMedia,
    doubts_of,
    length_on_wall,
    pinhole,
)
from bifocal.orientation.alignment import aside, deviations_of
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.orientation_report import orientation_in_words
from bifocal.orientation.walls.reference_plane import WallFace, rivals_in_words, zero_sigma
from photocore.arrays import FloatArray, positive


def scaled_by_distance(pair: Pair, number: int, distance: float, *, sigma: float) -> Pair:
    """Return a pair whose camera 1 or 2 stands at a distance from the wall.

    Parameters
    ----------
    pair : Pair
        In air, oriented by the photos alone, at any scale.
    number : int
    distance, sigma : float
        [m]

    Returns
    -------
    Pair
        All its lengths multiplied, covariance, diagnostics and sentences too.

    Raises
    ------
    InputError
        If a length is not positive.
    """
    positive(distance, "distance", unit="m")
    now = pair.photo(number).distance
    by_orientation = np.zeros(len(NAMES))
    by_orientation[NAMES.index(f"Z {number}")] = 1.0 / now
    return _scaled(pair, distance / now, by_orientation, sigma / distance)


def scaled_by_length(
    pair: Pair, number: int, ends: FloatArray, length: float, *, sigma: float
) -> Pair:
    """Return a pair in which two pixels of photo 1 or 2 are a length apart on the wall.

    Parameters
    ----------
    pair, number
        As for `scaled_by_distance`.
    ends : ndarray, shape (2, 2)
        Both on the wall's plane. [px]
    length, sigma : float
        [m]

    Raises
    ------
    InputError
        If the length is not positive.
    GeometryError
        If the ends coincide.
    """
    positive(length, "length", unit="m")
    now, by_orientation, of_ends = length_on_wall(pair, number, ends)
    relative = float(np.hypot(sigma / length, of_ends / now))
    return _scaled(pair, length / now, by_orientation, relative)


def _scaled(pair: Pair, factor: float, by_orientation: FloatArray, relative: float) -> Pair:
    """Return a pair with all lengths multiplied.

    Parameters
    ----------
    by_orientation : ndarray, shape (24,)
        Derivative of the logarithm of what was measured by the orientation.
    relative : float
        Standard deviation of the measure over itself.

    Notes
    -----
    ``p' = S(m / m(p)) p``: derivative ``S (I - v gᵀ)`` by p, v by the measure's logarithm, where v
    holds the cameras' places and g is ``by_orientation``. The scale that p had drops out.
    """
    photos = [
        replace(
            photo,
            plane_from_pixel=np.diag([factor, factor, 1.0]) @ photo.plane_from_pixel,
            nadir=np.asarray(photo.nadir) * factor,
            distance=photo.distance * factor,
        )
        for photo in (pair.image1, pair.image2)
    ]
    covariance = pair.orientation
    if covariance is not None:
        scales, places = np.ones(len(NAMES)), np.zeros(len(NAMES))
        for number, photo in enumerate((pair.image1, pair.image2)):
            first = number * len(CAMERA) + CAMERA.index("X")
            scales[first : first + 3] = factor
            places[first : first + 3] = [*photo.nadir, photo.distance]
        moves = scales[:, None] * (np.eye(len(NAMES)) - np.outer(places, by_orientation))
        covariance = moves @ covariance @ moves.T + relative**2 * np.outer(
            scales * places, scales * places
        )
    scaled = replace(pair, image1=photos[0], image2=photos[1], orientation=covariance)
    return replace(scaled, extra={**pair.extra, "setup": _setup(scaled, factor)})


def _setup(pair: Pair, factor: float) -> dict[str, Any]:
    """Return the diagnostics of a scaled pair: its lengths multiplied, its sentences new."""
    old = pair.extra.get("setup")
    setup: dict[str, Any] = dict(old) if isinstance(old, Mapping) else {}
    planes = [{**plane, "offset": factor * plane["offset"]} for plane in setup.get("planes", [])]
    faces = [WallFace(plane["offset"], plane["share"], tuple(plane["pixel"])) for plane in planes]
    zones = [
        {**zone, "median": factor * zone["median"], "spread": factor * zone["spread"]}
        for zone in setup.get("wall_relief_mm", [])
    ]
    cameras = pinhole(pair.image1), pinhole(pair.image2)
    covariance = np.zeros((len(NAMES),) * 2) if pair.orientation is None else pair.orientation
    deviations = deviations_of(cameras, covariance, PairMedia.none())
    before = setup.get("standard_deviations", {})
    if {"aside_x", "aside_y"} <= before.keys():
        deviations = aside(deviations, factor * before["aside_x"], factor * before["aside_y"])
    if "relief_offset" in setup.get("standard_deviations", {}) and faces:
        deviations["relief_offset"] = zero_sigma(faces)
    question = rivals_in_words(faces, SiteMeasures()) if faces else ""
    doubts = [*map(str, setup.get("doubts", ()))]
    stale = doubts_of(LENGTHS, doubts)  # of the scale that is given up
    doubts = [text for text in doubts if text not in stale]
    setup.pop("length_checks", None)
    if question:
        stale = doubts_of(RIVALS, doubts)
        doubts = [question if text in stale else text for text in doubts]
    sigma = max(setup.get("common_points", {}).get("sigma_px", 0.0), 0.05)
    words = orientation_in_words(
        cameras, deviations, sigma_px=sigma,
        fits=not doubts_of(MISFITS, doubts),
    )  # fmt: skip
    return setup | {
        "standard_deviations": deviations, "planes": planes, "wall_relief_mm": zones,
        "doubts": doubts, "words": list(words),
    }  # fmt: skip
