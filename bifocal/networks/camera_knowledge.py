"""What is known of the cameras of a set of photos beside their rays, as terms of its network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from bifocal.model import CAMERA, Interior
from bifocal.orientation import FacadeDirection, line_equations
from photocore.adjustment.network import NetworkState, Rows
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import Pinhole, skew

#: What is interior, by its place in `CAMERA`; what of it is one unknown for all photos of a lens.
#: Focus, stabiliser and crop move the principal point from photo to photo.
INTERIOR, SHARED = (0, 1, 2, 3, 10, 11), (0, 1, 10, 11)
Taped = tuple[int, int, float, float]
_TURN, _Z, _CENTRE = CAMERA.index("turn X"), CAMERA.index("Z"), [2, 3]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraKnowledge:
    """What is known of the cameras of a set beside their rays.

    Attributes
    ----------
    interiors : tuple of Interior
        Of each camera.
    lens : tuple of int
        Of each camera, the first that has the same lens: they share `SHARED`.
    held : mapping of int to tuple of str
        By camera, which of `CAMERA` are held.
    sigma_body : float or None
        How closely principal points agree where one body took all photos. [px]
    distances : tuple of (mapping of int to float, float, float)
        Taped: how often each camera's distance counts, the sum of these, its sigma. [m]
    lengths : tuple of (int, int, float, float)
        Taped between two points, and their sigmas. [m]
    lines : tuple of FacadeDirection
        Directions along the wall; their cameras count from 1.
    sigma_tilts : mapping of int to float
        Cameras set up square to the wall. [rad]
    by_wall : bool
        Whether points of the wall, not control alone, hold the frame.
    """

    interiors: tuple[Interior, ...]
    lens: tuple[int, ...]
    held: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    sigma_body: float | None = None
    distances: tuple[tuple[Mapping[int, float], float, float], ...] = ()
    lengths: tuple[Taped, ...] = ()
    lines: tuple[FacadeDirection, ...] = ()
    sigma_tilts: Mapping[int, float] = field(default_factory=dict)
    by_wall: bool = False

    @property
    def free(self) -> BoolArray:
        """Which of `CAMERA` are unknown, shape (m, 12)."""
        out = np.ones((len(self.interiors), len(CAMERA)), dtype=bool)
        for row, interior in zip(out, self.interiors, strict=True):
            row[CAMERA.index("aspect")] = interior.sigma_aspect > 0
            row[-2:] = interior.sigma_radial > 0
        for camera, names in self.held.items():
            out[camera, [CAMERA.index(name) for name in names]] = False
        return out

    def off(
        self, camera: int, pinhole: Pinhole, radial: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return how far a lens is from what was known of it, as `INTERIOR`, and its sigmas."""
        interior, matrix = self.interiors[camera], pinhole.matrix
        ratios = np.log(
            [matrix[0, 0] / interior.focal, matrix[1, 1] / matrix[0, 0] / interior.aspect]
        )
        off = np.concatenate([ratios, matrix[:2, 2] - interior.centre, radial])
        sigmas = (
            interior.sigma_focal,
            interior.sigma_aspect,
            interior.sigma_centre,
            interior.sigma_centre,
        )
        return off, np.array([*sigmas, interior.sigma_radial, interior.sigma_radial])

    def observe(
        self, state: NetworkState, rows: Rows, column: IntArray, lengths: tuple[Taped, ...]
    ) -> None:
        """Add all of it to the rows of a network, of the lengths those given.

        ``column`` is that of each camera's unknowns, shape (m, 12).
        """
        cameras = state.blocks["camera"]
        for k, camera in cameras.items():
            off, sigmas = self.off(k, camera, state.blocks["radial"][k])
            free = column[k, INTERIOR] >= 0
            if self.lens[k] != k:  # what it shares is told once
                free &= ~np.isin(INTERIOR, SHARED)
            rows.known(column[k, INTERIOR][free], off[free], sigmas[free])
        for one, following in pairwise(cameras):
            if self.sigma_body is None:
                break
            apart = cameras[one].matrix[:2, 2] - cameras[following].matrix[:2, 2]
            line = rows.add(apart / self.sigma_body)
            for k, sign in ((one, 1.0), (following, -1.0)):
                rows.by_label(line, column[k, _CENTRE], sign / self.sigma_body)
        for shares, metres, sigma in self.distances:
            total = sum(share * cameras[k].centre[2] for k, share in shares.items())
            line = rows.add(np.array([(total - metres) / sigma]))
            for k, share in shares.items():
                rows.by_label(line, column[k, _Z], share / sigma)
        for a, b, metres, sigma in lengths:
            between = (state.points[a] - state.points[b])[None]
            length = float(np.linalg.norm(between))
            line = rows.add(np.array([(length - metres) / sigma]))
            rows.by_points(line, np.array([a]), between / length / sigma)
            rows.by_points(line, np.array([b]), -between / length / sigma)
        if self.lines:
            values, by = line_equations(self.lines, list(cameras.values()))
            rows.by_label(rows.add(values)[:, None], column.ravel(), by)
        for k, sigma in self.sigma_tilts.items():
            axis = cameras[k].rotation[2]
            line = rows.add(cameras[k].tilt / sigma)
            by = -(skew(axis)[:2] + np.outer(cameras[k].tilt, skew(axis)[2])) / axis[2] / sigma
            rows.by_label(line[:, None], column[k, _TURN : _TURN + 3], by)
