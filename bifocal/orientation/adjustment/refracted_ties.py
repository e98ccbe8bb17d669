"""Common points of photos taken through media: their rays meet, and nothing else is asked."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from bifocal.model import rates_of
from bifocal.orientation.adjustment.observed_points import views_of
from bifocal.orientation.adjustment.pair_observations import (
    Equations,
    PairObservations,
    PairUnknowns,
)
from photocore.arrays import BoolArray, FloatArray

#: Steps to the point nearest to both rays; the first is good to a thousandth of the misfit.
STEPS = 2


def meeting_equations(
    observations: PairObservations, state: PairUnknowns, which: BoolArray
) -> Equations:
    """Return how far ties are from pixels whose refracted rays meet, signed, shape (m,). [px]

    With the derivatives by the unknowns, shape (m, u).

    Notes
    -----
    Four pixels and three unknown coordinates: what the nearest point leaves of the pixels has one
    direction, square to all that moving the point can do. The point being nearest, neither it nor
    that direction needs a derivative.
    """
    met = _met(observations, state)
    return met.along[which, 3], met.along_by[which, 3]


def height_equations(
    observations: PairObservations, state: PairUnknowns, which: BoolArray
) -> Equations:
    """Return how high above the reference plane the refracted rays of ties meet, (m,). [px]

    With the derivatives by the unknowns, shape (m, u). A pixel is what `relief_per_pixel` says.
    """
    met = _met(observations, state)
    by = np.linalg.solve(met.triangle[which], met.along_by[which, :3])[:, 2]
    metres = relief_per_pixel(observations, state)[which]
    return met.xyz[which, 2] / metres, by / metres[:, None]


def relief_per_pixel(observations: PairObservations, state: PairUnknowns) -> FloatArray:
    """Return the relief of a pixel between the two photos at the ties, shape (m,). [m/px]"""
    with np.errstate(divide="ignore"):
        # Of the inverse of an upper triangle the last row is the last diagonal element alone: the
        # sigma of relief from pixels of sigma 1 / sqrt(2).
        return np.asarray(1.0 / np.abs(_met(observations, state).triangle[:, 2, 2]) / np.sqrt(2.0))


class _Met(NamedTuple):
    """Points nearest to both rays of ties, and what they leave of the pixels.

    Attributes
    ----------
    xyz : ndarray, shape (m, 3)
        [m]
    along, along_by : ndarray, shapes (m, 4) and (m, 4, u)
        Observed minus computed pixels, turned so that a move of the point changes the first three
        alone, and their derivatives by the unknowns at the point held. [px]
    triangle : ndarray, shape (m, 3, 3)
        How a move of the point changes those three. [px/m]
    """

    xyz: FloatArray
    along: FloatArray
    along_by: FloatArray
    triangle: FloatArray


@lru_cache(maxsize=1)
def _met(observations: PairObservations, state: PairUnknowns) -> _Met:
    """Return where refracted rays of ties meet, and what is left of their pixels.

    Misfits and heights are asked for in turn of one state: it is solved once.
    """
    models = observations.radial_models(state.radial)
    raw = observations.tie1, observations.tie2
    straight = [model.undistort(x) for model, x in zip(models, raw, strict=True)]
    pixels, xyz = np.concatenate(straight, axis=1), state.media.meeting(state.cameras, *straight)
    for _ in range(STEPS):
        views = views_of(state, xyz)
        design = np.concatenate([one.by_point for one in views], axis=1)
        lost = ~np.isfinite(design).all(axis=(1, 2))
        design[lost] = np.eye(4, 3)
        off = pixels - np.concatenate([one.pixels for one in views], axis=1)
        base, triangle = np.linalg.qr(design, mode="complete")
        turn = base.transpose(0, 2, 1)
        along = (turn @ off[..., None])[..., 0]
        xyz = xyz + np.linalg.solve(triangle[:, :3], along[:, :3, None])[..., 0]
    rates = [
        rates_of(one, -model.undistorted_by_k(x), number)
        for number, (one, model, x) in enumerate(zip(views, models, raw, strict=True))
    ]
    by = state.media.rates_by_unknowns(-(turn @ np.concatenate(rates, axis=1)))
    return _Met(xyz, along, by, triangle[:, :3])
