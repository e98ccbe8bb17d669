"""Glass and water before both cameras, as typed on the page: fields -> media of the adjustment."""

from __future__ import annotations

from collections.abc import Mapping

from bifocal.orientation.pair_media import PairMedia
from photocore.adjustment.priors import LEAST_INDEX, MOST_INDEX
from photocore.errors import InputError

#: Fields of the set-up that say what lies between the cameras and the wall: indices of refraction,
#: lengths in metres. Beginning with air; glass may be absent.
INDICES = ("glass_index", "water_index")
MEDIA = (*INDICES, "glass_thickness", "sigma_water_index", "port", "depth")
AIR = 1.0

Setup = Mapping[str, float | None]


def check_index(name: str, value: float | None) -> None:
    """Refuse what no medium bends.

    Raises
    ------
    InputError
    """
    if value is not None and not LEAST_INDEX <= value <= MOST_INDEX:
        raise InputError(
            f"{name}: {value:g} is no refractive index; water has about 1.34, glass 1.46 to 1.6."
        )


def lacking(setup: Setup) -> str:
    """Return what the typed media lack: ``water``, ``glass``, ``place`` or ``""``; that in air.

    ``place`` is where the first interface lies: either the port's distance from the camera, or how
    deep the wall lies behind what stays with it.
    """
    typed = {name for name in MEDIA if setup.get(name) is not None}
    if not typed:
        return ""
    if "water_index" not in typed:
        return "water"
    if len(typed & {"glass_index", "glass_thickness"}) == 1:
        return "glass"
    return "" if len(typed & {"port", "depth"}) == 1 else "place"


def media_of(setup: Setup) -> PairMedia | None:
    """Return the media that are typed; None in air, and while something is lacking.

    With a sigma of its index the water's is an unknown, known so well beforehand.
    """
    water = setup.get("water_index")
    if water is None or lacking(setup):
        return None
    glass, thickness = setup.get("glass_index"), setup.get("glass_thickness")
    indices, thicknesses = [AIR, water], []
    if glass is not None and thickness is not None:
        indices, thicknesses = [AIR, glass, water], [thickness]
    port, sigma = setup.get("port"), setup.get("sigma_water_index")
    priors = {} if sigma is None else {f"index{len(indices)}": sigma}
    return PairMedia.stated(
        indices, thicknesses, ports=(port, port), depth=setup.get("depth"), priors=priors
    )
