"""What waves do to points that are corrected as if the water were flat."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from multimedia.bathymetry.refracted_rays import intersect_refracted_rays
from multimedia.media import Interfaces, WaveSurface, aim_rays
from photocore.arrays import FloatArray, IntArray, as_points
from photocore.errors import InputError

#: Positions of the wave train that are tried: enough for 0.1 % of a root mean square.
PHASES = 32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WaveEffect:
    """Errors of points under a sinusoidal wave, treated as under flat water.

    Attributes
    ----------
    errors : ndarray, shape (phases, n, 3)
        Computed minus true position, one per position of the wave. [m]
    mean, rms, largest : ndarray, shape (n, 3)
        Over the phases: what averaging many photos would leave, what one set of photos has, and
        the worst. [m] Of the phases at which rays reach both cameras.
    left_out : ndarray of int, shape (n,)
        Phases at which they do not, as behind a crest.
    """

    errors: FloatArray

    @property
    def mean(self) -> FloatArray:
        """Mean error over the phases."""
        return np.nanmean(self.errors, axis=0)

    @property
    def rms(self) -> FloatArray:
        """Root mean square error over the phases."""
        return np.sqrt(np.nanmean(self.errors**2, axis=0))

    @property
    def largest(self) -> FloatArray:
        """Largest absolute error over the phases."""
        return np.nanmax(np.abs(self.errors), axis=0)

    @property
    def left_out(self) -> IntArray:
        """Number of phases that the figures leave out."""
        return np.isnan(self.errors).any(axis=-1).sum(axis=0)


def wave_effect(
    points: ArrayLike,
    cameras: ArrayLike,
    *,
    water_level: float,
    refractive_index: float,
    wave: WaveSurface,
    phases: int = PHASES,
) -> WaveEffect:
    """Return the errors of bottom points when a wave is taken for flat water.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        True points under water. [m]
    cameras : array_like, shape (m, 3)
        At least two projection centres, all photos taken at one instant. [m]
    water_level : float
        Height of the flat water that is assumed. [m]
    refractive_index : float
        Refractive index of the water relative to the air.
    wave : WaveSurface
        The real surface; its phases are shifted through a full turn.
    phases : int
        Positions of the wave that are tried.

    Returns
    -------
    WaveEffect
        Errors per phase, with mean, root mean square and largest.

    Raises
    ------
    InputError
        If there are fewer than two cameras.

    Notes
    -----
    The rays that really reach the camera through the wave (`aim_rays`) are refracted at the flat
    surface and intersected, as in a survey that knows only the mean water height. Okamoto (1982)
    derives the same effect in closed approximation: it grows with the slope of the wave, 2 pi
    amplitude / wavelength, and with the depth, and hardly with the height of the wave.

    Examples
    --------
    One centimetre of swell 1 m long, over 2 m of depth, seen from two drones 20 m up. By hand: a
    slope of 0.0628 turns the ray by 0.0628 (1 - 1 / 1.34) = 0.0159, 32 mm at 2 m, 23 mm r.m.s.

    >>> swell = WaveSurface.sinusoid(0.0, amplitude=0.01, wavelength=1.0)
    >>> effect = wave_effect([[0, 0, -2.0]], [[-5, 0, 20], [5, 0, 20]],
    ...                      water_level=0.0, refractive_index=1.34, wave=swell)
    >>> print(effect.rms.round(3))
    [[0.    0.023 0.003]]
    """
    true = as_points(points, "points", dimension=3).reshape(-1, 3)
    centres = as_points(cameras, "cameras", dimension=3).reshape(-1, 3)
    if len(centres) < 2:
        raise InputError("cameras: at least two are needed to see the effect on a point in space.")
    origins = np.broadcast_to(centres, (len(true), *centres.shape))
    errors = np.empty((phases, len(true), 3))
    for number in range(phases):
        moved = replace(wave, phase=wave.phase + 2 * np.pi * number / phases)
        real = Interfaces(surfaces=(moved,), indices=(1.0, refractive_index))
        rays = aim_rays(centres, true[:, None], real).directions[..., 0, :]
        points_seen = intersect_refracted_rays(
            origins, rays, water_level=water_level, refractive_index=refractive_index
        )
        errors[number] = points_seen.xyz - true
    return WaveEffect(errors=errors)
