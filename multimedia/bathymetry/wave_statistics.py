"""What waves of any direction and length cost, and how many frames take it away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from multimedia.bathymetry.waves import wave_effect
from multimedia.media import FlatInterface, OpticalMedia, WaveSurface
from multimedia.remarks import remark
from photocore.arrays import FloatArray, as_points, positive
from photocore.errors import InputError

#: Directions of the waves from the longest base of the cameras, and positions of each wave. [deg]
DIRECTIONS, PHASES = (0.0, 45.0, 90.0), 16
#: Acceleration of gravity. [m/s^2]
GRAVITY = 9.81
#: Upward part of the normal of level water, and points of a set-up that are traced.
LEVEL, MOST = 1.0 - 1e-9, 32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WaveCase:
    """What one wave does to points that are taken for flat water's.

    Attributes
    ----------
    wavelength : float
        [m]
    period : float
        In deep water. [s]
    from_base : float
        Direction of travel from the longest base of the cameras. [deg]
    rms : ndarray, shape (3,)
        Of X, Y, Z in one frame, over all points and positions of the wave. [m]
    mean : ndarray, shape (3,)
        What the mean of any number of frames keeps, root mean square over the points. [m]
    frames : float
        Frames, at moments independent of each other, whose mean is within the goal; infinite
        where no number is.
    """

    wavelength: float
    period: float
    from_base: float
    rms: FloatArray
    mean: FloatArray
    frames: float


class SeenPoints(Protocol):
    """Points of a study: where, seen by how many cameras, and how precise they will be."""

    @property
    def points(self) -> FloatArray:
        """Positions, shape (n, 3)."""

    @property
    def seen_by(self) -> FloatArray:
        """Cameras that see each."""

    @property
    def rms_sigma(self) -> FloatArray:
        """Precision of X, Y, Z over all."""


def waves_over(
    media: OpticalMedia | None, centres: FloatArray, seen: SeenPoints, waves: Sequence[float],
    *, unit: str,
) -> tuple[WaveCase, ...]:  # fmt: skip
    """Return `wave_statistics` of a planned set-up, its own precision being the goal.

    Parameters
    ----------
    media : OpticalMedia or None
        What all cameras look through.
    centres : ndarray, shape (m, 3)
    seen : SeenPoints
    waves : sequence of float
        Amplitude, then lengths. [m]
    unit : str
        Of the set-up.

    Raises
    ------
    InputError
        If the cameras are not above open, level water, or the unit is not m.
    """
    open_water = (
        isinstance(media, FlatInterface) and len(media.indices) == 2
        and not media.moves_with_camera and abs(media.normal[2]) > LEVEL and len(centres) > 1
    )  # fmt: skip
    if len(waves) < 2 or not open_water or unit != "m":
        raise InputError(remark("bathymetry.waves"))
    assert isinstance(media, FlatInterface)
    points = seen.points[seen.seen_by >= 2]
    return wave_statistics(
        points[:: 1 + len(points) // MOST], centres, water_level=float(media.point[2]),
        refractive_index=media.indices[-1] / media.indices[0], amplitude=waves[0],
        wavelengths=waves[1:], goal=float(np.linalg.norm(seen.rms_sigma)),
    )  # fmt: skip


def wave_statistics(
    points: ArrayLike,
    cameras: ArrayLike,
    *,
    water_level: float,
    refractive_index: float,
    amplitude: float,
    wavelengths: Sequence[float],
    goal: float,
) -> tuple[WaveCase, ...]:
    """Return what waves cost along, aslant and across the base of the cameras.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        True points under water. [m]
    cameras : array_like, shape (m, 3)
        At least two projection centres, all photos of a frame taken at one instant. [m]
    water_level, refractive_index
        As for `wave_effect`.
    amplitude : float
        Half the height from trough to crest. [m]
    wavelengths : sequence of float
        [m]
    goal : float
        Error in space that the mean of the frames may have. [m]

    Returns
    -------
    tuple of WaveCase
        By wavelength, then direction.

    Notes
    -----
    Each case is traced (`wave_effect`) at positions of the wave through a full turn. With bias b
    and variance v of one frame, the mean of n has b^2 + v / n; frames are independent if they are
    not taken in step with the wave: over several periods, at odd intervals.

    Examples
    --------
    A swell of one centimetre, one metre long, over two metres: it costs 23 mm across where it runs
    across the base, and most in height where it runs along it.

    >>> across = wave_statistics(
    ...     [[0, 0, -2.0]], [[-5, 0, 20], [5, 0, 20]], water_level=0.0, refractive_index=1.34,
    ...     amplitude=0.01, wavelengths=[1.0], goal=0.01)
    >>> [(case.from_base, case.rms.round(3).tolist()) for case in across[::2]]
    [(0.0, [0.013, 0.0, 0.118]), (90.0, [0.0, 0.023, 0.003])]
    """
    true = as_points(points, "points", dimension=3).reshape(-1, 3)
    centres = as_points(cameras, "cameras", dimension=3).reshape(-1, 3)
    positive(goal, "goal", unit="m")
    apart = centres[:, None, :2] - centres[None, :, :2]
    length = np.hypot(apart[..., 0], apart[..., 1])
    base = apart[np.unravel_index(int(length.argmax()), length.shape)]
    azimuth = float(np.arctan2(base[0], base[1]))
    cases = []
    for wavelength in wavelengths:
        for turn in DIRECTIONS:
            wave = WaveSurface.sinusoid(
                water_level, amplitude=amplitude, wavelength=wavelength,
                direction=azimuth + np.radians(turn),
            )  # fmt: skip
            effect = wave_effect(
                true, centres, water_level=water_level, refractive_index=refractive_index,
                wave=wave, phases=PHASES,
            )  # fmt: skip
            rms = np.sqrt(np.nanmean(effect.rms**2, axis=0))
            mean = np.sqrt(np.nanmean(effect.mean**2, axis=0))
            bias2, spread2 = float(mean @ mean), float(rms @ rms - mean @ mean)
            room = goal**2 - bias2
            cases.append(WaveCase(
                wavelength=wavelength, period=float(np.sqrt(2 * np.pi * wavelength / GRAVITY)),
                from_base=turn, rms=rms, mean=mean,
                frames=float(np.ceil(max(spread2, 0.0) / room)) if room > 0 else np.inf,
            ))  # fmt: skip
    return tuple(cases)
