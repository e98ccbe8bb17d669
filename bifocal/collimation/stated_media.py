"""Glass and water before both cameras, as typed on the page: fields -> media of the adjustment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from bifocal.model import Pair, PairMedia

#: Fields of the set-up that say what lies between the cameras and the wall: indices of refraction,
#: lengths in metres. Beginning with air; glass may be absent.
INDICES = ("glass_index", "water_index")
MEDIA = (*INDICES, "glass_thickness", "sigma_water_index", "port", "depth")
AIR = 1.0

Setup = Mapping[str, float | None]


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


def media_of(setup: Setup, pair: Pair | None = None) -> PairMedia:
    """Return the media that are typed; none in air, and while something is lacking.

    With a sigma of its index the water's is an unknown, known so well beforehand. Where nothing was
    ever typed, those of the pair that is shown: it may have come with its file.
    """
    if pair is not None and not any(name in setup for name in MEDIA):
        return _of_pair(pair)
    water = setup.get("water_index")
    if water is None or lacking(setup):
        return PairMedia.none()
    glass, thickness = setup.get("glass_index"), setup.get("glass_thickness")
    indices, thicknesses = [AIR, water], []
    if glass is not None and thickness is not None:
        indices, thicknesses = [AIR, glass, water], [thickness]
    port, sigma = setup.get("port"), setup.get("sigma_water_index")
    priors = {} if sigma is None else {f"index{len(indices)}": sigma}
    return PairMedia.stated(
        indices, thicknesses, ports=(port, port), depth=setup.get("depth"), priors=priors
    )


def _of_pair(pair: Pair) -> PairMedia:
    """Return what a pair looks through; ports lean as they do, however the cameras turn."""
    media = PairMedia.of(pair)
    if not media or media.depth:
        return media
    normals = (pair.image1.interface_normal, pair.image2.interface_normal)
    return replace(media, normals=normals, turning=(False, False))
