"""Which unknown of a bundle adjustment is which column, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multimedia.adjustment.media_unknowns import OF_MATERIAL, media_unknowns
from multimedia.adjustment.unknowns import Unknowns
from multimedia.media import ANY_INTERIOR, EXTERIOR, Camera
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.arrays import BoolArray, IntArray
from photocore.errors import InputError

#: Columns by the name of the parameter.
Places = Mapping[str, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BundleColumns:
    """Place of every unknown that is not eliminated.

    Attributes
    ----------
    labels : tuple of str
        One per column.
    cameras : tuple of mapping of str to int
        Columns of each camera's exterior and interior parameters; cameras may share some.
    media : mapping of str to mapping of str to int
        Columns of the parameters of each media.
    plates : tuple of mapping of str to int
        Columns of each plate's pose.
    points : ndarray of int, shape (p, 3)
        Column of a coordinate that is not eliminated (ends of scale bars), else -1.
    priors : mapping of int to float
        Standard deviation of a column's start value.
    """

    labels: tuple[str, ...]
    cameras: tuple[Places, ...]
    media: Mapping[str, Places]
    plates: tuple[Places, ...]
    points: IntArray
    priors: Mapping[int, float]


def place_columns(
    project: Project, unknowns: Unknowns, ids: Sequence[str], movable: BoolArray
) -> BundleColumns:
    """Return the place of every unknown; refuse names that the project does not have.

    Raises
    ------
    InputError
        Naming an unknown camera, media, media parameter, prior or scale-bar end.
    """
    labels: dict[str, int] = {}

    def places(group: str, names: Sequence[str]) -> dict[str, int]:
        return {name: labels.setdefault(f"{group}:{name}", len(labels)) for name in names}

    strange = set(unknowns.fixed_cameras) - set(project.camera_names)
    if strange:
        raise InputError(f"fixed_cameras: there is no camera {', '.join(sorted(strange))}.")
    exterior = [
        places(name, () if name in unknowns.fixed_cameras else EXTERIOR)
        for name in project.camera_names
    ]
    interior = [
        places(interior_group(camera.name, unknowns.shared_interior), names)
        for camera, names in zip(project.cameras, _interior_names(project, unknowns), strict=True)
    ]
    media = _media_columns(project, unknowns.media, labels)
    alike = {f"plate {plate}" for plate in unknowns.plates} & set(project.camera_names)
    if alike:
        raise InputError(remark("adjust.named_like_plate", name=min(alike)))
    plates = tuple(places(f"plate {plate}", EXTERIOR) for plate in unknowns.plates)
    points = np.full((len(ids), 3), -1, dtype=np.int64)
    row_of = {name: row for row, name in enumerate(ids)}
    for bar in unknowns.scale_bars:
        for end in (bar.first, bar.second):
            if end not in row_of:
                raise InputError(f"scale bar {bar.first}-{bar.second}: no point is called {end}.")
            moving = movable[row_of[end]]
            axes = [axis for axis, moves in zip("XYZ", moving, strict=True) if moves]
            points[row_of[end], moving] = list(places(f"point {end}", axes).values())
    return BundleColumns(
        labels=tuple(labels), cameras=tuple(a | b for a, b in zip(exterior, interior, strict=True)),
        media=media, plates=plates, points=points,
        priors=_prior_columns(project, unknowns, labels, media),
    )  # fmt: skip


def _interior_names(project: Project, unknowns: Unknowns) -> list[tuple[str, ...]]:
    """Return the interior unknowns of each camera: those wanted that its lens model has.

    Raises
    ------
    InputError
        If no camera has a parameter, or cameras of different lens models share a set.
    """
    names = [
        tuple(name for name in unknowns.interior if name in camera.interior_names)
        for camera in project.cameras
    ]
    lacking = sorted(set(unknowns.interior) - {name for interior in names for name in interior})
    if lacking:
        raise InputError(
            f"interior: no camera's lens model has {', '.join(lacking)}; camera "
            f"{project.cameras[0].name} has {', '.join(project.cameras[0].interior_names)}."
        )
    model: dict[str, Camera] = {}
    for camera in project.cameras if unknowns.interior else ():
        first = model.setdefault(interior_group(camera.name, unknowns.shared_interior), camera)
        if type(first.distortion) is not type(camera.distortion):
            raise InputError(remark("adjust.two_lens_models", name=first.name, other=camera.name))
    return names


def _prior_columns(
    project: Project, unknowns: Unknowns, labels: Mapping[str, int], media: Mapping[str, Places]
) -> dict[int, float]:
    """Return the standard deviations of start values by column: those given, then typical ones."""
    missing: list[str] = []
    priors: dict[int, float] = {}
    # What is said of one unknown counts more than what is said of all alike.
    for label, sigma in sorted(unknowns.priors.items(), key=lambda prior: prior[0] in labels):
        every = [name for name in labels if name.rpartition(":")[2] == label in ANY_INTERIOR]
        members = [label] if label in labels else every
        missing += [] if members else [label]
        priors |= {labels[name]: sigma for name in members}
    if missing:
        shown = ", ".join(list(labels)[:40])
        raise InputError(f"priors: {', '.join(missing)} is not estimated; unknowns are {shown}.")
    if unknowns.typical_priors:
        for item in media_unknowns(project, tuple(labels), media):
            priors.setdefault(item.column, item.typical)
    return {column: sigma for column, sigma in priors.items() if np.isfinite(sigma)}


def interior_group(camera: str, shared: bool | Mapping[str, str]) -> str:
    """Return the name of a camera's set of interior parameters."""
    if isinstance(shared, bool):
        return "interior" if shared else camera
    return shared.get(camera, camera)


def _media_columns(
    project: Project, parameters: Sequence[str], labels: dict[str, int]
) -> dict[str, Places]:
    """Append the media unknowns to labels and return the columns of each media."""
    used = [name for name in dict.fromkeys(project.media_of) if name]
    if parameters and not used:
        raise InputError("media: no camera looks through anything; there is nothing to estimate.")
    columns: dict[str, dict[str, int]] = {}
    for item in parameters:
        who, _, parameter = item.rpartition(":")
        for owner in [who] if who else used:
            if owner not in project.media:
                raise InputError(f"media: there are no media {owner!r}, only {', '.join(used)}.")
            allowed = project.media[owner].parameter_names
            if parameter not in allowed:
                hint = " For a gradient write gradient = 0 into its section."
                raise InputError(
                    f"media: {owner} has no {parameter!r}; its parameters are {', '.join(allowed)}."
                    + hint * (parameter == "gradient")
                )
            of_medium = columns.setdefault(owner, {})
            if parameter in of_medium:
                raise InputError(f"media: {', '.join(parameters)} names the same unknown twice.")
            common = not who and parameter.startswith(OF_MATERIAL)
            label = parameter if common else f"{owner}:{parameter}"
            of_medium[parameter] = labels.setdefault(label, len(labels))
    return dict(columns)


def with_common_values(project: Project, unknowns: Unknowns) -> Project:
    """Return the project with one start value, the mean, for what media or cameras have in common.

    Cameras that share a set of interior parameters have those in common that are estimated.
    """
    media = dict(project.media)
    for item in (n for n in unknowns.media if n.startswith(OF_MATERIAL) and ":" not in n):
        used = {k: m for k, m in media.items() if k in project.media_of}
        media |= _alike({k: m for k, m in used.items() if item in m.parameter_names}, item)
    cameras = dict(enumerate(project.cameras))
    groups: dict[str, list[int]] = {}
    for k, camera in cameras.items():
        groups.setdefault(interior_group(camera.name, unknowns.shared_interior), []).append(k)
    for group in groups.values():
        interiors = [cameras[k].interior_names for k in group]
        for item in set(unknowns.interior).intersection(*interiors):
            cameras |= _alike({k: cameras[k] for k in group}, item)
    return replace(project, media=media, cameras=tuple(cameras.values()))


def _alike(blocks: dict[Any, Any], item: str) -> dict[Any, Any]:
    """Return cameras or media with the mean of their values of a parameter."""
    values = {name: block.value(item) for name, block in blocks.items()}
    if len(set(values.values())) < 2:
        return blocks
    mean = float(np.mean(list(values.values())))
    return {k: block.stepped([item], [mean - values[k]]) for k, block in blocks.items()}
