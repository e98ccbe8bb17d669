"""What lies between cameras and wall, as options state it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bifocal.model import LEANS, Normal, PairMedia
from bifocal.options import PairMediaOptions
from bifocal.remarks import remark
from photocore.adjustment.priors import parse_prior
from photocore.errors import InputError
from photocore.options import options_of


def media_of(options: Mapping[str, Any]) -> PairMedia:
    """Return media as options name them (``indices``, ``thicknesses``, ``port`` ...); none in air.

    Raises
    ------
    InputError
        If they do not describe media.
    """
    if options.get("indices") is None:
        media = options_of(PairMediaOptions).values()
        lost = [option for option in media if options.get(option.name) not in (None, ())]
        if lost:
            raise InputError(remark("media.without_indices", flag=lost[0].flag))
        return PairMedia.none()
    ports, normals = (
        (_own(options, name, 1), _own(options, name, 2)) for name in ("port", "port_normal")
    )
    return PairMedia.stated(
        options["indices"], options.get("thicknesses") or (), ports=ports,
        depth=options.get("depth"), normals=(_normal(normals[0]), _normal(normals[1])),
        estimate=options.get("estimate") or (),
        priors=dict(_prior(text) for text in options.get("prior") or ()),
    )  # fmt: skip


def _prior(text: str) -> tuple[str, float]:
    """Return the name and standard deviation of an option: leans are typed in degrees."""
    name, sigma = parse_prior(text)
    return name, float(np.radians(sigma)) if name in LEANS else sigma


def _own(options: Mapping[str, object], name: str, number: int) -> Any:
    """Return an option of one camera, or else that of both."""
    of_photo = options.get(f"{name}{number}")
    return options.get(name) if of_photo is None else of_photo


def _normal(stated: tuple[float, ...] | str | None) -> Normal:
    """Return the normal that an option states: "axis", or X, Y, r towards the camera."""
    if stated is None or isinstance(stated, str):
        return stated
    normal = np.array(stated)
    if not normal[2] > 0.1 * np.linalg.norm(normal):
        raise InputError(remark("media.port_normal", stated=",".join(map(str, stated))))
    return normal
