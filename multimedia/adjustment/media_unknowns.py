"""What is known of media before they are measured: typical priors, and what physics allows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multimedia.projects import Project
from photocore.adjustment.priors import LEAST_INDEX, MOST_INDEX, SIGMA_INDEX, SIGMA_SHARE

#: Unknowns that are properties of a material: one value for all media unless named.
OF_MATERIAL = ("index", "thickness", "gradient")
#: Unknowns that have a value of their own; the others count from the start.
WITH_VALUE = (*OF_MATERIAL, "radius", "centre")
#: Unknowns of which something is known before.
_KNOWN = (*WITH_VALUE, "shift")


@dataclass(frozen=True, slots=True, kw_only=True)
class MediaUnknown:
    """An unknown of media of which something is known before it is measured.

    Attributes
    ----------
    label, name : str
        As in the result; of the parameter.
    column : int
    start : float
        Value given.
    typical : float
        Standard deviation of it, if the user says nothing: 0.005 for an index, a tenth for a
        thickness or a radius, a tenth of the radius for a centre or an axis, 0.005 over the depth
        of the points for a gradient.
    least, most : float
        What physics allows.
    """

    label: str
    name: str
    column: int
    start: float
    typical: float
    least: float
    most: float


def media_unknowns(
    project: Project, labels: Sequence[str], media: Mapping[str, Mapping[str, int]]
) -> Iterator[MediaUnknown]:
    """Yield the unknowns of indices, thicknesses, radii, centres, axes and gradients, once each.

    Parameters
    ----------
    project : Project
        With the start values.
    labels : sequence of str
        Of all columns.
    media : mapping of str to mapping of str to int
        Columns of the parameters of each media.
    """
    named = set()
    for owner, places in media.items():
        for name, column in places.items():
            if name.startswith(_KNOWN) and column not in named:
                named.add(column)
                yield _unknown(project, owner, name, labels[column], column)


def _unknown(project: Project, owner: str, name: str, label: str, column: int) -> MediaUnknown:
    """Return what is known of one parameter."""
    interface = project.media[owner]
    start = float(interface.value(name))
    least, most, typical = -np.inf, np.inf, SIGMA_SHARE * abs(start)
    if name.startswith("index"):
        least, most, typical = LEAST_INDEX, MOST_INDEX, SIGMA_INDEX
    elif name.startswith(("thickness", "radius")):
        least = 1e-6 * start
    elif name.startswith("gradient"):
        depth = _depth_of(project)
        typical = SIGMA_INDEX / depth
        index = interface.indices[-1]
        least, most = (LEAST_INDEX - index) / depth, (MOST_INDEX - index) / depth
    else:
        _, at, body = name.partition("@")
        typical = SIGMA_SHARE * float(interface.value(f"radius{at}{body}"))
    return MediaUnknown(
        label=label, name=name, column=column, start=start, typical=typical, least=least, most=most
    )


def _depth_of(project: Project) -> float:
    """Return the depth in which points lie, as far as it is known; else that of the cameras."""
    z = project.object_points.xyz[:, 2]
    depth = float(np.ptp(z)) if len(z) else 0.0
    if depth > 0:
        return depth
    heights = [float(camera.centre[2]) for camera in project.cameras]
    return float(np.ptp(heights)) or 1.0
