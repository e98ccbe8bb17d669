"""Refractive indices of air and of what ports and tanks are made of, as functions of wavelength.

All relative to vacuum except where air is the unit: water formulas and glass catalogues are
relative to air, and a set-up that puts air at 1.0 is consistent with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_floats
from photocore.errors import InputError
from photocore.textfile import packaged


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    r"""A solid of known dispersion.

    Parameters
    ----------
    name : str
        Trade name.
    citation : str
        Where the coefficients were published.
    sellmeier : tuple of (B, C)
        Terms of :math:`n^2 = 1 + \sum B \lambda^2 / (\lambda^2 - C)`, wavelength in µm, C in µm².
    powers : tuple of (c, p)
        Terms of :math:`n = \sum c \lambda^p` for materials published that way instead.
    wavelength_nm : (float, float)
        Range of the data. [nm]

    Examples
    --------
    >>> round(float(N_BK7.index(587.6)), 5)
    1.5168
    """

    name: str
    citation: str
    sellmeier: tuple[tuple[float, float], ...] = ()
    powers: tuple[tuple[float, int], ...] = ()
    wavelength_nm: tuple[float, float]

    def index(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Return the refractive index at a wavelength. [nm]

        Raises
        ------
        InputError
            If a wavelength is outside the range of the data.
        """
        nm = as_floats(wavelength_nm, "wavelength_nm")
        low, high = self.wavelength_nm
        wrong = ~((nm >= low) & (nm <= high))
        if wrong.any():
            raise InputError(
                f"wavelength_nm: found {nm[wrong].flat[0]:g}; the index of {self.name} is known "
                f"from {low:g} to {high:g} nm."
            )
        square = (nm / 1000) ** 2
        if self.powers:
            return np.asarray(sum(c * square ** (p / 2) for c, p in self.powers))
        return np.asarray(np.sqrt(1 + sum(b * square / (square - c) for b, c in self.sellmeier)))


def _material(*, wavelength_nm: list[float], name: str, citation: str, **terms: Any) -> Material:
    limits = (wavelength_nm[0], wavelength_nm[1])
    pairs = {key: tuple(map(tuple, rows)) for key, rows in terms.items()}
    return Material(name=name, citation=citation, wavelength_nm=limits, **pairs)


_ROWS = packaged("multimedia.refraction", "materials").values()
#: Everything a port or a tank may be made of, from `materials.toml`.
MATERIALS = tuple(_material(**row) for row in _ROWS)
N_BK7, FUSED_SILICA, FLOAT_GLASS, ACRYLIC, POLYCARBONATE, SAPPHIRE = MATERIALS


def air_refractive_index(
    wavelength_nm: ArrayLike, *, temperature_c: ArrayLike = 15.0, pressure_hpa: ArrayLike = 1013.25
) -> FloatArray:
    r"""Refractive index of dry air relative to vacuum.

    Parameters
    ----------
    wavelength_nm : array_like, shape (...)
        [nm]
    temperature_c, pressure_hpa : array_like, shape (...)
        [°C, hPa]

    Returns
    -------
    n : ndarray, shape (...)
        [-]

    Raises
    ------
    InputError
        If a wavelength is outside 230 to 1690 nm.

    Notes
    -----
    Ciddor 1996 [1]_ for 15 °C and 1013.25 hPa; n - 1 in proportion to the density of an ideal gas,
    which is good to 1e-6 between -40 and 50 °C.

    References
    ----------
    .. [1] Ciddor, Applied Optics 35, 1996, 1566-1573.

    Examples
    --------
    >>> round(float(air_refractive_index(589.3)), 7)
    1.0002771
    """
    nm = as_floats(wavelength_nm, "wavelength_nm")
    if not ((nm >= 230) & (nm <= 1690)).all():
        raise InputError("wavelength_nm: the index of air is known from 230 to 1690 nm.")
    wavenumber = (1000 / nm) ** 2
    standard = 0.05792105 / (238.0185 - wavenumber) + 0.00167917 / (57.362 - wavenumber)
    kelvin = as_floats(temperature_c, "temperature_c") + 273.15
    density = as_floats(pressure_hpa, "pressure_hpa") / 1013.25 * 288.15 / kelvin
    return np.asarray(1 + standard * density)
