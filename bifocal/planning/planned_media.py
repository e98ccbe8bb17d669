"""Media that planned photos look through, and where the cameras then stand at equal scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.model.pair import Pair
from bifocal.model.photo import Photo
from multimedia import Layers
from photocore.arrays import FloatArray, not_negative, positive
from photocore.errors import GeometryError, InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedMedia:
    """Plane-parallel media before a wall, and what of them stays when the camera moves.

    Attributes
    ----------
    layers : Layers
    port : float or None
        Camera centre to the first interface, where that moves with the camera. [m]
    depth : float or None
        Last interface to the reference plane, where that stays with the object: the water between
        the glass of a tank, or the surface, and the wall. [m]
    """

    layers: Layers
    port: float | None = None
    depth: float | None = None

    def __post_init__(self) -> None:
        if (self.port is None) == (self.depth is None):
            raise InputError(
                "media: give the port's distance from the camera (--port), or how deep the object "
                "lies behind the glass or surface that stays with it (--depth); one of the two."
            )
        if self.port is not None:
            not_negative(self.port, "port")
        if self.depth is not None:
            positive(self.depth, "depth", unit="m")

    def placed(self, apparent: float, c: float) -> tuple[float, float]:
        """Return distance and z0 of the camera that shows the wall's middle from afar.

        Parameters
        ----------
        apparent : float
            Distance from which a camera without media shows the middle at the wanted scale. [m]
        c : float
            Principal distance, for the message. [mm]

        Raises
        ------
        GeometryError
            If the media leave no room at that scale.

        Notes
        -----
        Near the axis a layer of thickness h and index n seems ``h n1 / n`` thick, so the scale is
        ``c / (z0 + sum(t n1 / n) + H n1 / nm)``: that sum, not d, is proportional to c.
        """
        first, *inner, last = self.layers.indices
        glass = zip(self.layers.thicknesses, inner, strict=True)
        rest = apparent - sum(t * first / n for t, n in glass)
        if self.port is not None:
            z0, behind = self.port, (rest - self.port) * last / first
        else:
            assert self.depth is not None
            z0, behind = rest - self.depth * first / last, self.depth
        if z0 < 0 or behind <= 0:
            raise GeometryError(
                f"the {c:g} mm lens would have to stand inside the glass or the water: the object "
                f"would seem {apparent:.2f} m away. Choose a smaller scale, or a longer lens."
            )
        return z0 + self.layers.thickness + behind, z0

    def pair(
        self, d: tuple[float, float], c: tuple[float, float], *, pitch: float, sigma_px: float
    ) -> Pair:
        """Return the planned pair, square to the wall, its pixels counted from the middle."""
        photos = []
        for distance, principal in zip(d, c, strict=True):
            metres = pitch * distance / principal
            photos.append(
                Photo(
                    plane_from_pixel=np.diag([metres, -metres, 1.0]),
                    nadir=np.zeros(2),
                    distance=distance,
                    layers=self.layers,
                    z0=distance - self._behind(distance),
                    sigma_pixel=sigma_px,
                )
            )
        return Pair(image1=photos[0], image2=photos[1])

    def _behind(self, distance: float) -> float:
        """Return the way from the first interface to the wall of a camera so far away. [m]"""
        if self.port is not None:
            return distance - self.port
        assert self.depth is not None
        return self.depth + self.layers.thickness


def sigma_at(pair: Pair, radius: FloatArray) -> FloatArray:
    """Return the sigma of relief on the plane at radii from the nadir, NaN at the nadir. [m]"""
    flat = radius.reshape(-1)
    xyz = np.column_stack([flat, np.zeros_like(flat), np.zeros_like(flat)])
    found = pair.intersect(*pair.project(xyz)).sigma[:, 2]
    return np.where(flat > 0, found, np.nan).reshape(radius.shape)
