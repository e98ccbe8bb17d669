r"""Refractive index of water: three empirical formulas, their derivatives and ranges.

Wavelength in nm, temperature in °C, salinity in per cent (sea water 3.5, not 35 per mille), depth
in m, everywhere. The formulas differ by up to 0.005: `water_refractive_index` is the one the
multimedia papers use, `quan_fry_index` fits the best laboratory data, `parrish_index` is the
handy polynomial of the bathymetry community.

References
----------
.. [1] Höhle, "Zur Theorie und Praxis der Unterwasser-Photogrammetrie", DGK C 163, 1971; printed
   as Eq. (4) of Maas, "On the accuracy potential in underwater/multimedia photogrammetry",
   Sensors 2015, where the web text has lost the signs.
.. [2] Quan and Fry, "Empirical equation for the index of refraction of seawater", Applied Optics
   34(18), 1995, 3477-3480.
.. [3] Parrish, "Index of refraction of seawater and freshwater as a function of wavelength and
   temperature", Oregon State University, 2020; a fit to Austin and Halikas, 1976.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_floats
from photocore.errors import InputError


def water_refractive_index(
    *,
    wavelength_nm: ArrayLike,
    temperature_c: ArrayLike,
    salinity_percent: ArrayLike,
    depth: ArrayLike,
) -> FloatArray:
    r"""Refractive index of water after Höhle, the formula of the multimedia papers.

    Parameters
    ----------
    wavelength_nm : array_like, shape (...)
        Wavelength of the light. [nm]
    temperature_c : array_like, shape (...)
        Water temperature. [°C]
    salinity_percent : array_like, shape (...)
        Salinity; sea water 3.5. [%]
    depth : array_like, shape (...)
        Water depth. [m]

    Returns
    -------
    n_w : ndarray, shape (...)
        [-]

    Raises
    ------
    InputError
        If a value cannot be meant in that unit (0.52 for a wavelength in nm, 35 for per cent).

    Notes
    -----
    Eq. (4) of Maas 2015 [1]_ with its signs restored (docs/errata.md):

    .. math:: n_w = 1.338 + 4\cdot10^{-5}\,(486 - \lambda + 0.003\,d + 50\,S - T)

    Meant for visible light (400 to 700 nm), 0 to 30 °C, 0 to 4 % salt.

    Examples
    --------
    Green light, a tank of tap water:

    >>> n_w = water_refractive_index(
    ...     wavelength_nm=520, temperature_c=22.2, salinity_percent=0, depth=0.15
    ... )
    >>> round(float(n_w), 5)
    1.33575
    """
    nm, celsius, percent, metres = _checked(wavelength_nm, temperature_c, salinity_percent, depth)
    return np.asarray(1.338 + 4e-5 * (486 - nm + 0.003 * metres + 50 * percent - celsius))


def _checked(
    wavelength_nm: ArrayLike,
    temperature_c: ArrayLike,
    salinity_percent: ArrayLike,
    depth: ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the four as arrays, refusing what cannot be meant in their units."""
    nm = as_floats(wavelength_nm, "wavelength_nm")
    celsius = as_floats(temperature_c, "temperature_c")
    percent = as_floats(salinity_percent, "salinity_percent")
    metres = as_floats(depth, "depth")
    _within(nm, "wavelength_nm", 180, 1200, "is light in nm; 0.52 µm is 520 nm")
    _within(celsius, "temperature_c", -5, 100, "is liquid water in °C; 295 K is 22 °C")
    _within(percent, "salinity_percent", 0, 30, "is salt in per cent; sea water is 3.5, not 35")
    _within(metres, "depth", 0, 11000, "is a depth in m, positive downwards")
    return nm, celsius, percent, metres


def _within(values: FloatArray, name: str, low: float, high: float, meaning: str) -> None:
    """Raise InputError if a value is outside, saying what the argument means."""
    wrong = (values < low) | (values > high)
    if wrong.any():
        raise InputError(
            f"{name}: found {values[wrong].flat[0]:g}; only {low:g} to {high:g} {meaning}."
        )
