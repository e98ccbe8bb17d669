"""Measured points as radial distances: what the columns of the workbook are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from photocore.arrays import BoolArray, FloatArray


class RefractedRays(NamedTuple):
    """What Eqs. (1) to (7) become through media, shape (n,).

    Lengths in mm at the scale of image 1: ``ds``, ``den`` [mm/m], displacements ``e1`` and ``e2``,
    ``place`` (n, 2) of the points from the nadir of camera 1; ``outwards`` (n, 2) by how much ray 1
    leads outwards per metre of relief [mm/m]; ``relief`` in m.
    """

    ds: FloatArray
    den: FloatArray
    relief: FloatArray
    e1: FloatArray
    e2: FloatArray
    place: FloatArray
    outwards: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Radii:
    """Points as radial distances [mm at the scale of image 1] and directions [deg], shape (n,).

    ``s1, s2, theta`` count from the zoom centre, ``own1, own2, own_theta`` from each camera's
    nadir; ``q`` is the misfit across the radius, ``standardised`` in its sigma,
    ``covariance`` that of X, Y and r from the picks, shape (n, 3, 3) [m²]; ``of_pixels`` as in
    `bifocal.survey.relief_table.ReliefTable`.
    """

    scale_number: float
    s1: FloatArray
    s2: FloatArray
    theta: FloatArray
    own1: FloatArray
    own2: FloatArray
    own_theta: FloatArray
    q: FloatArray
    standardised: FloatArray
    at_nadir: BoolArray
    sigma_r: FloatArray
    covariance: FloatArray
    sigma_px: float | None = None
    of_pixels: Mapping[str, FloatArray] = field(default_factory=dict)
    bent: RefractedRays | None = None
