"""What is to be told of the media of a pair, and what is not to be believed of them."""

from __future__ import annotations

import numpy as np

from bifocal.model import PairMedia
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.remarks import remark
from photocore.adjustment import correlations
from photocore.adjustment.priors import (
    ALIKE,
    LEAST_INDEX,
    MOST_INDEX,
    UNCARRIED,
    is_possible,
    typical_sigma,
)
from photocore.errors import GeometryError


def media_in_words(adjusted: AdjustedPair, stated: PairMedia) -> tuple[str, ...]:
    """Return what lies between cameras and wall, and what of it was estimated, in sentences."""
    media = adjusted.media
    if not media:
        return ()
    indices = ", ".join(f"{n:.4g}" for n in media.layers.indices)
    layers = ", ".join(f"{1000 * t:.4g} mm" for t in media.layers.thicknesses)
    z0 = [media.z0(number, camera) for number, camera in enumerate(adjusted.cameras)]
    how = "with the camera" if media.depth is None else "and stays with the wall"
    about = {"indices": indices, "far": z0[0], "near": z0[1], "how": how}
    key = f"orientation.media{'_between' if layers else ''}"
    words = [remark(key, layers=layers, **about)]
    for row, name in _estimated(adjusted, media):
        sigma = float(np.sqrt(adjusted.of_unknowns[row, row]))
        numbers = {"value": media.value(name), "sigma": sigma, "start": stated.value(name)}
        numbers |= {"prior": stated.sigmas[name]}
        shown = {what: _shown(name, number) for what, number in numbers.items()}
        words.append(remark("orientation.media_found", name=name, **shown))
    return tuple(words)


def media_remarks(adjusted: AdjustedPair, stated: PairMedia) -> tuple[str, ...]:
    """Return which unknowns of the media the data do not carry, or cannot tell from others."""
    media = adjusted.media
    remarks = []
    factor = max(adjusted.sigma0, 1.0)
    for row, name in _estimated(adjusted, media):
        prior, sigma = stated.sigmas[name], float(np.sqrt(adjusted.of_unknowns[row, row]))
        if sigma > UNCARRIED * prior * factor:
            remarks.append(_hardly_carried(name, stated.value(name), prior))
        if (twin := _twin(adjusted, media, row)) and twin[1] > ALIKE:
            about = {"name": name, "twin": twin[0], "correlation": twin[1]}
            remarks.append(remark("orientation.hardly_told_apart", **about))
    return tuple(remarks)


def refuse_impossible_media(adjusted: AdjustedPair, stated: PairMedia) -> None:
    """Refuse indices and lengths that the medium named cannot have.

    Raises
    ------
    GeometryError
        Naming the unknown, its value and what it cannot be told apart from.
    """
    media = adjusted.media
    for row, name in _estimated(adjusted, media):
        start, value = stated.value(name), media.value(name)
        sigma = stated.sigmas[name]
        least, most = 1e-6 * start, np.inf
        if name.startswith("index"):
            least, most = LEAST_INDEX, MOST_INDEX
        elif name.startswith("lean"):
            least = -np.inf
        if is_possible(value, start=start, sigma=sigma, least=least, most=most):
            continue
        own, twin = float(np.sqrt(adjusted.of_unknowns[row, row])), _twin(adjusted, media, row)
        option, typical = name, typical_sigma(name, start)
        if name.startswith("lean"):
            option, typical = f"lean{name[-1]}", 1.0
            value, own, start = np.degrees([value, own, start]).tolist()
        about = {"name": name, "value": value, "own": own, "start": start, "option": option}
        if twin and twin[1] > ALIKE / 2:
            alike = {"twin": twin[0], "correlation": twin[1]}
            words = remark("refused.media_value_alike", typical=typical, **about, **alike)
            raise GeometryError(words)
        raise GeometryError(remark("refused.media_value", typical=typical, **about))


def _estimated(adjusted: AdjustedPair, media: PairMedia) -> list[tuple[int, str]]:
    """Return where in the unknowns the media's stand, and their names; none where all is typed."""
    if not adjusted.of_unknowns.size:
        return []
    first = len(media.names) - len(media.sigmas)
    return list(enumerate(media.sigmas, start=first))


def _twin(adjusted: AdjustedPair, media: PairMedia, row: int) -> tuple[str, float] | None:
    """Return the unknown that goes with one of the media's the most, and their correlation."""
    others = np.nan_to_num(np.abs(correlations(adjusted.of_unknowns)[row]))
    others[row] = 0.0
    twin = int(others.argmax())
    return None if not others[twin] else (media.names[twin], float(others[twin]))


def _shown(name: str, value: float) -> str:
    """Return an index, a lean in degrees, or a length in millimetres."""
    if not np.isfinite(value):
        return "anything"
    if name.startswith("lean"):
        return f"{np.degrees(value):.2f}°"
    return f"{value:.4f}" if name.startswith("index") else f"{1000 * value:.1f} mm"


def _hardly_carried(name: str, start: float, sigma: float) -> str:
    """Return that an unknown rests on its prior alone; a lean is told in degrees."""
    if name.startswith("lean"):
        start, sigma = np.degrees([start, sigma]).tolist()
        return remark("orientation.lean_hardly_carried", label=name, start=start, sigma=sigma)
    return remark("adjustment.hardly_carried", label=name, start=start, sigma=sigma)
