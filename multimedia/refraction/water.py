r"""Refractive index of water: three empirical formulas, their derivatives, inverses and ranges.

Wavelength in nm, temperature in °C, salinity in per cent (sea water 3.5, not 35 per mille), depth
in m, everywhere. The formulas differ by up to 0.004: `HOEHLE` is the one the multimedia papers
use, `QUAN_FRY` fits the best laboratory data, `PARRISH` is the polynomial of the bathymetry
community. Every formula is a sum of terms :math:`c\,\lambda^i T^j S^k d^l`, kept as a table, so
that index, derivatives and inverses come from the same coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_floats
from photocore.errors import InputError

Range = tuple[float, float]


class Term(NamedTuple):
    """One term of a formula.

    Attributes
    ----------
    coefficient : float
        In units of the powers.
    wavelength, temperature, salinity, depth : int
        Powers of each, in nm, °C, per cent and m.
    """

    coefficient: float
    wavelength: int = 0
    temperature: int = 0
    salinity: int = 0
    depth: int = 0


class WaterIndexDerivatives(NamedTuple):
    """Refractive index and its derivatives.

    Attributes
    ----------
    refractive_index : ndarray, shape (...)
        [-]
    d_wavelength, d_temperature, d_salinity, d_depth : ndarray, shape (...)
        Per nm, per °C, per per cent, per m.
    """

    refractive_index: FloatArray
    d_wavelength: FloatArray
    d_temperature: FloatArray
    d_salinity: FloatArray
    d_depth: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class WaterFormula:
    """A published formula for the refractive index of water.

    Parameters
    ----------
    name : str
        As on the command line.
    citation : str
        Where it was published.
    terms : tuple of Term
        The formula.
    wavelength_nm, temperature_c, salinity_percent, depth : (float, float)
        Range of the data behind it.
    """

    name: str
    citation: str
    terms: tuple[Term, ...]
    wavelength_nm: Range = (400.0, 700.0)
    temperature_c: Range = (0.0, 30.0)
    salinity_percent: Range = (0.0, 4.0)
    depth: Range = (0.0, 0.0)

    def remarks(
        self,
        *,
        wavelength_nm: ArrayLike,
        temperature_c: ArrayLike,
        salinity_percent: ArrayLike,
        depth: ArrayLike,
    ) -> tuple[str, ...]:
        """Return what lies outside the range of the formula's data; empty when nothing does."""
        state = _checked(wavelength_nm, temperature_c, salinity_percent, depth)
        allowed = (self.wavelength_nm, self.temperature_c, self.salinity_percent, self.depth)
        names = ("wavelength", "temperature", "salinity", "depth")
        outside = []
        for name, unit, values, (low, high) in zip(
            names, ("nm", "°C", "%", "m"), state, allowed, strict=True
        ):
            if name == "depth" and not any(term.depth for term in self.terms):
                if (values > 10).any():
                    outside.append(
                        f"{self.name} has no term for depth: the value is that of the surface, "
                        f"about {1.4e-6 * float(values.max()):.1g} too low."
                    )
            elif ((values < low) | (values > high)).any():
                outside.append(
                    f"{name} is outside the range of {self.name}, {low:g} to {high:g} {unit}."
                )
        return tuple(outside)


#: Maas 2015, Eq. (4), with the signs that the web text lost (docs/errata.md), multiplied out:
#: 1.338 + 4e-5 (486 - wavelength + 0.003 depth + 50 salinity - temperature).
HOEHLE = WaterFormula(
    name="hoehle",
    citation=(
        "Höhle, Zur Theorie und Praxis der Unterwasser-Photogrammetrie, DGK C 163, 1971; "
        "Eq. (4) of Maas, Sensors 15(8), 2015"
    ),
    terms=(
        Term(1.338 + 4e-5 * 486),
        Term(-4e-5, wavelength=1),
        Term(-4e-5, temperature=1),
        Term(4e-5 * 50, salinity=1),
        Term(4e-5 * 0.003, depth=1),
    ),
    depth=(0.0, 11000.0),
)

#: Eq. (3) of the paper; its salinity is per mille, hence the factors of ten. Relative to air.
QUAN_FRY = WaterFormula(
    name="quan-fry",
    citation="Quan and Fry, Applied Optics 34(18), 1995, 3477-3480",
    terms=(
        Term(1.31405),
        Term(1.779e-4 * 10, salinity=1),
        Term(-1.05e-6 * 10, temperature=1, salinity=1),
        Term(1.6e-8 * 10, temperature=2, salinity=1),
        Term(-2.02e-6, temperature=2),
        Term(15.868, wavelength=-1),
        Term(0.01155 * 10, wavelength=-1, salinity=1),
        Term(-0.00423, wavelength=-1, temperature=1),
        Term(-4382.0, wavelength=-2),
        Term(1.1455e6, wavelength=-3),
    ),
    salinity_percent=(0.0, 4.3),
)

_FRESH = (1.389193029374634, -1.978124999e-6, -8.58124999e-6, 1.03223477e-7, -1.5483369209e-4)
_SEA = (1.398067112092424, -1.5015625e-6, -4.2759374989e-5, 1.07084865e-7, -1.60475520686e-4)

#: Published for fresh water and for 3.5 % salt; in between linearly, which Quan and Fry show to be
#: right. Each is constant, T², T, wavelength², wavelength.
PARRISH = WaterFormula(
    name="parrish",
    citation=(
        "Parrish, Index of refraction of seawater and freshwater as a function of wavelength and "
        "temperature, Oregon State University, 2020 (fit to Austin and Halikas, 1976)"
    ),
    terms=tuple(
        Term(coefficient, wavelength=i, temperature=j, salinity=k)
        for (i, j), fresh, sea in zip(
            ((0, 0), (0, 2), (0, 1), (2, 0), (1, 0)), _FRESH, _SEA, strict=True
        )
        for k, coefficient in ((0, fresh), (1, (sea - fresh) / 3.5))
    ),
    salinity_percent=(0.0, 3.5),
)

#: By name, in the order of the command line's help.
WATER_FORMULAS: dict[str, WaterFormula] = {f.name: f for f in (HOEHLE, QUAN_FRY, PARRISH)}


def water_refractive_index(
    *,
    wavelength_nm: ArrayLike,
    temperature_c: ArrayLike,
    salinity_percent: ArrayLike,
    depth: ArrayLike,
    formula: WaterFormula = HOEHLE,
) -> FloatArray:
    r"""Refractive index of water.

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
    formula : WaterFormula
        `HOEHLE`, `QUAN_FRY` or `PARRISH`; ``formula.remarks(...)`` tells what is out of range.

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
    `HOEHLE` is Eq. (4) of Maas 2015 with its signs restored (docs/errata.md):

    .. math:: n_w = 1.338 + 4\cdot10^{-5}\,(486 - \lambda + 0.003\,d + 50\,S - T)

    Examples
    --------
    Green light in a tank of tap water:

    >>> tank = dict(wavelength_nm=520, temperature_c=22.2, salinity_percent=0, depth=0.15)
    >>> round(float(water_refractive_index(**tank)), 5)
    1.33575
    >>> round(float(water_refractive_index(**tank, formula=QUAN_FRY)), 5)
    1.33533
    """
    values = _checked(wavelength_nm, temperature_c, salinity_percent, depth)
    return _sum_of_terms(formula.terms, values)


def water_index_derivatives(
    *,
    wavelength_nm: ArrayLike,
    temperature_c: ArrayLike,
    salinity_percent: ArrayLike,
    depth: ArrayLike,
    formula: WaterFormula = HOEHLE,
) -> WaterIndexDerivatives:
    """Refractive index of water with its derivatives.

    Parameters
    ----------
    wavelength_nm, temperature_c, salinity_percent, depth, formula
        As in `water_refractive_index`.

    Returns
    -------
    WaterIndexDerivatives

    Raises
    ------
    InputError
        As `water_refractive_index`.

    Examples
    --------
    Maas 2015, Sect. 5: 0.002 per per cent of salt, 0.00004 per degree.

    >>> d = water_index_derivatives(
    ...     wavelength_nm=520, temperature_c=20, salinity_percent=0, depth=0
    ... )
    >>> round(float(d.d_salinity), 6), round(float(d.d_temperature), 6)
    (0.002, -4e-05)
    """
    values = _checked(wavelength_nm, temperature_c, salinity_percent, depth)
    slopes = _slopes(formula, values)
    return WaterIndexDerivatives(_sum_of_terms(formula.terms, values), *slopes)


def _slopes(formula: WaterFormula, given: tuple[FloatArray, ...]) -> Iterator[FloatArray]:
    """Yield the derivatives by wavelength, temperature, salinity and depth."""
    for variable in range(4):
        terms = []
        for coefficient, *powers in formula.terms:
            power = powers[variable]
            if power:
                powers[variable] = power - 1
                terms.append(Term(coefficient * power, *powers))
        yield _sum_of_terms(terms, given)


def water_index_sigma(
    *,
    wavelength_nm: ArrayLike,
    temperature_c: ArrayLike,
    salinity_percent: ArrayLike,
    depth: ArrayLike,
    sigma_wavelength_nm: ArrayLike = 0.0,
    sigma_temperature_c: ArrayLike = 0.0,
    sigma_salinity_percent: ArrayLike = 0.0,
    sigma_depth: ArrayLike = 0.0,
    formula: WaterFormula = HOEHLE,
) -> FloatArray:
    """Return the standard deviation of the index from those of what it was computed from.

    Parameters
    ----------
    wavelength_nm, temperature_c, salinity_percent, depth, formula
        As in `water_refractive_index`.
    sigma_wavelength_nm, sigma_temperature_c, sigma_salinity_percent, sigma_depth : array_like
        Standard deviations, in the units of the values.

    Returns
    -------
    sigma : ndarray, shape (...)
        [-]

    Raises
    ------
    InputError
        As `water_refractive_index`.

    Examples
    --------
    A thermometer good to 0.5 °C and salt known to 0.1 %:

    >>> sigma = water_index_sigma(
    ...     wavelength_nm=520, temperature_c=20, salinity_percent=3.5, depth=0,
    ...     sigma_temperature_c=0.5, sigma_salinity_percent=0.1,
    ... )
    >>> round(float(sigma), 6)
    0.000201
    """
    slopes = _slopes(formula, _checked(wavelength_nm, temperature_c, salinity_percent, depth))
    sigmas = (sigma_wavelength_nm, sigma_temperature_c, sigma_salinity_percent, sigma_depth)
    variance = np.zeros(())
    for (name, *_), slope, sigma in zip(_LIMITS, slopes, sigmas, strict=True):
        spread = as_floats(sigma, f"sigma_{name}")
        if (spread < 0).any():
            raise InputError(f"sigma_{name}: a standard deviation cannot be negative.")
        variance = variance + (slope * spread) ** 2
    return np.asarray(np.sqrt(variance))


def salinity_from_index(
    refractive_index: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    temperature_c: ArrayLike,
    depth: ArrayLike,
    formula: WaterFormula = HOEHLE,
) -> FloatArray:
    """Salinity of water whose index was measured, for instance by a bundle adjustment.

    Parameters
    ----------
    refractive_index : array_like, shape (...)
        Refractive index. [-]
    wavelength_nm, temperature_c, depth, formula
        As in `water_refractive_index`.

    Returns
    -------
    salinity_percent : ndarray, shape (...)
        May come out slightly negative for fresh water: that is the error of the index. [%]

    Raises
    ------
    InputError
        As `water_refractive_index`.

    Examples
    --------
    Maas 2015, Sect. 5: an index good to 0.00015 gives the salinity to better than 0.1 %.

    >>> fresh, salt = salinity_from_index(
    ...     [1.33584, 1.33599], wavelength_nm=520, temperature_c=20, depth=0
    ... )
    >>> round(float(salt - fresh), 3)
    0.075
    """
    values = _checked(wavelength_nm, temperature_c, 0.0, depth)
    constant, slope, _ = _powers_of(2, formula, values)
    return np.asarray((as_floats(refractive_index, "refractive_index") - constant) / slope)


def temperature_from_index(
    refractive_index: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    salinity_percent: ArrayLike,
    depth: ArrayLike,
    formula: WaterFormula = HOEHLE,
) -> FloatArray:
    """Temperature of water whose index was measured.

    Parameters
    ----------
    refractive_index : array_like, shape (...)
        Refractive index. [-]
    wavelength_nm, salinity_percent, depth, formula
        As in `water_refractive_index`.

    Returns
    -------
    temperature_c : ndarray, shape (...)
        NaN where no temperature gives so high an index. [°C]

    Raises
    ------
    InputError
        As `water_refractive_index`.

    Notes
    -----
    `QUAN_FRY` and `PARRISH` are quadratic in T with their maximum near 0 °C; the root on the warm
    side is returned.

    Examples
    --------
    >>> t = temperature_from_index(
    ...     1.335752, wavelength_nm=520, salinity_percent=0, depth=0.15
    ... )
    >>> round(float(t), 1)
    22.2
    """
    values = _checked(wavelength_nm, 0.0, salinity_percent, depth)
    constant, slope, bend = _powers_of(1, formula, values)
    rest = constant - as_floats(refractive_index, "refractive_index")
    with np.errstate(invalid="ignore"):
        # Citardauq's form of the warm root: no cancellation, and no special case where bend = 0.
        return np.asarray(2 * rest / (-slope + np.sqrt(slope**2 - 4 * bend * rest)))


def _powers_of(
    variable: int, formula: WaterFormula, given: tuple[FloatArray, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the coefficients of the powers 0, 1, 2 of one variable, the others given."""
    name = Term._fields[1 + variable]
    first, second, third = (
        [term._replace(**{name: 0}) for term in formula.terms if term[1 + variable] == power]
        for power in range(3)
    )
    return _sum_of_terms(first, given), _sum_of_terms(second, given), _sum_of_terms(third, given)


def _sum_of_terms(terms: Iterable[Term], given: tuple[FloatArray, ...]) -> FloatArray:
    """Return the sum of the terms in the shape all variables broadcast to."""
    total = np.zeros(np.broadcast_shapes(*(g.shape for g in given)))
    for coefficient, *powers in terms:
        value = np.asarray(coefficient)
        for base, power in zip(given, powers, strict=True):
            if power:
                value = value * base**power
        total = total + value
    return np.asarray(total)


#: What can be meant: name, lowest, highest, meaning.
_LIMITS = (
    ("wavelength_nm", 180, 1200, "is light in nm; 0.52 µm is 520 nm"),
    ("temperature_c", -5, 100, "is liquid water in °C; 295 K is 22 °C"),
    ("salinity_percent", 0, 30, "is salt in per cent; sea water is 3.5, not 35"),
    ("depth", 0, 11000, "is a depth in m, positive downwards"),
)


def _checked(*given: ArrayLike) -> tuple[FloatArray, ...]:
    """Return wavelength, temperature, salinity and depth as arrays.

    Raises
    ------
    InputError
        If a value cannot be meant in its unit; the message says what the argument means.
    """
    arrays = []
    for value, (name, low, high, meaning) in zip(given, _LIMITS, strict=True):
        values = as_floats(value, name)
        wrong = (values < low) | (values > high)
        if wrong.any():
            raise InputError(
                f"{name}: found {values[wrong].flat[0]:g}; only {low:g} to {high:g} {meaning}."
            )
        arrays.append(values)
    return tuple(arrays)
