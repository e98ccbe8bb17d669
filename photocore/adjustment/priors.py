"""How well media are known before they are measured, and what may be believed of them after."""

from __future__ import annotations

from photocore.errors import InputError

#: A medium adjusted by more than this many of its prior sigmas is another one, or nonsense.
FARTHEST = 5.0
#: Media unknowns whose sigma keeps this share of the prior's are not carried by the data.
UNCARRIED = 0.9
#: Correlations from which two unknowns can hardly be told apart.
ALIKE = 0.95
#: How well an index is known (water from 0 to 40 degrees and fresh to sea differs by 0.01 in all,
#: glass of one kind by less), and the share to which a thickness or a radius is.
SIGMA_INDEX, SIGMA_SHARE = 0.005, 0.1
#: No transparent medium in front of a camera has an index beyond these.
LEAST_INDEX, MOST_INDEX = 1.0, 3.0


def typical_sigma(name: str, start: float) -> float:
    """Return how well an index, or else a length, is known before it is measured.

    Examples
    --------
    >>> typical_sigma("index3", 1.33), typical_sigma("thickness1", 6.0)
    (0.005, 0.6000000000000001)
    """
    return SIGMA_INDEX if name.startswith("index") else SIGMA_SHARE * abs(start)


def is_possible(value: float, *, start: float, sigma: float, least: float, most: float) -> bool:
    """Tell whether an adjusted value may be that of the medium named.

    Parameters
    ----------
    value : float
        As adjusted.
    start, sigma : float
        What was given, and its standard deviation; infinite: anything that physics allows.
    least, most : float
        What physics allows.

    Examples
    --------
    >>> is_possible(1.026, start=1.337, sigma=0.005, least=LEAST_INDEX, most=MOST_INDEX)
    False
    """
    reach = FARTHEST * sigma
    return max(least, start - reach) < value < min(most, start + reach)


def parse_prior(text: str) -> tuple[str, float]:
    """Return label and standard deviation of ``label=sigma``.

    Raises
    ------
    InputError
        If it has another form.
    """
    label, _, sigma = text.rpartition("=")
    try:
        return label.strip(), float(sigma)
    except ValueError:
        raise InputError(
            f"--prior {text}: expected label=sigma, e.g. tank:offset=0.002, or label=inf"
        ) from None
