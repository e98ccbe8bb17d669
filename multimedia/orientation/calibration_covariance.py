"""What an adjustment knows of its cameras and media, kept in the project and told to points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from multimedia.media import ANY_INTERIOR, EXTERIOR, project_with_jacobian
from multimedia.orientation.intersection import IntersectedPoints
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError

#: Section of the project file: ``"owner:parameter" = "value and lower triangle of covariances"``.
KEY = "calibration_covariance"
#: More unknowns make a section that nobody's disk should hold.
LARGEST = 400
_OF_CAMERA = EXTERIOR + ANY_INTERIOR


def with_covariance(
    project: Project, columns: Mapping[str, int], covariance: FloatArray
) -> tuple[Project, tuple[str, ...]]:
    """Return a project that carries the covariance of its cameras and media, and remarks.

    Parameters
    ----------
    project : Project
        As adjusted.
    columns : mapping of str to int
        ``camera:parameter`` or ``media:parameter`` to its row; several may share one.
    covariance : ndarray, shape (u, u)
        Angles in rad.
    """
    extra = {key: value for key, value in project.extra.items() if key != KEY}
    rows = list(columns.values())
    part = covariance[np.ix_(rows, rows)]
    if len(rows) > LARGEST or not np.isfinite(part).all():
        why = "too_large" if len(rows) > LARGEST else "unknown"
        return replace(project, extra=extra), (remark(f"bundle.covariance_{why}"),)
    if rows:
        extra[KEY] = {
            name: " ".join(map(repr, [_value(project, name), *part[k, : k + 1].tolist()]))
            for k, name in enumerate(columns)
        }
    return replace(project, extra=extra), ()


def with_calibration(
    project: Project, solved: IntersectedPoints, sigma: FloatArray
) -> tuple[IntersectedPoints, tuple[str, ...]]:
    """Return points whose covariances contain that of the cameras and media, and remarks.

    Parameters
    ----------
    project : Project
    solved : IntersectedPoints
        Of all its cameras.
    sigma : ndarray, shape (cameras, n, 2)
        Standard deviations of the image points. [mm]
    """
    if KEY not in project.extra:
        return solved, ()
    names, values, covariance = _read(project.extra[KEY])
    now = [_value(project, name) for name in names]
    if not np.allclose(now, values, rtol=1e-9, atol=1e-9):
        return solved, (
            f"{KEY} of the project belongs to other cameras or media than it holds now: sigmas "
            "count image noise alone. `multimedia adjust` makes it anew.",
        )
    places = np.flatnonzero(np.isfinite(solved.xyz[:, 0]))
    by_unknowns = np.zeros((len(places), 3, len(names)))
    for k, camera in enumerate(project.cameras):
        mine = np.flatnonzero(np.isfinite(solved.residuals[k, places, 0]))
        rows = places[mine]
        media = project.interface_of(k)
        of_camera = _columns(names, camera.name, _OF_CAMERA)
        of_media = _columns(names, project.media_of[k], media.parameter_names if media else ())
        part = project_with_jacobian(
            camera, solved.xyz[rows], media, camera_names=tuple(of_camera),
            interface_names=tuple(of_media),
        )  # fmt: skip
        by_own = np.concatenate([part.by_camera, part.by_interface], axis=2)
        turns = [at for at, name in enumerate(of_camera) if name in EXTERIOR[3:]]
        if turns:
            by_own[..., turns] = by_own[..., turns] @ np.linalg.inv(camera.angle_rates())
        # What moves the images of a point by b moves the point by minus N^-1 a^T P b.
        weighted = part.by_point / sigma[k][rows][:, :, None] ** 2
        pull = solved.covariance[rows] @ weighted.transpose(0, 2, 1)
        columns = np.array([*of_camera.values(), *of_media.values()], dtype=np.int64)
        by_unknowns[np.ix_(mine, np.arange(3), columns)] -= pull @ by_own
    full = solved.covariance.copy()
    full[places] += by_unknowns @ covariance @ by_unknowns.transpose(0, 2, 1)
    return replace(solved, covariance=full), ()


def _columns(names: Sequence[str], owner: str, parameters: Sequence[str]) -> dict[str, int]:
    """Return the columns of the parameters of a camera or media that were unknown."""
    labels = {p: f"{owner}:{p}" for p in parameters}
    return {p: names.index(label) for p, label in labels.items() if label in names}


def _value(project: Project, name: str) -> float:
    """Return what an unknown is in the project, NaN if it has no such camera or media."""
    owner, _, parameter = name.rpartition(":")
    views = {camera.name: camera for camera in project.cameras}
    try:
        return (views if parameter in _OF_CAMERA else project.media)[owner].value(parameter)
    except (KeyError, ValueError, InputError):
        return float("nan")


def _read(section: object) -> tuple[Sequence[str], FloatArray, FloatArray]:
    """Return names, values and covariance of the section of a project file."""
    wrong = (
        f"{KEY}: expected what `multimedia adjust` writes; take the section out, or adjust again."
    )
    if not isinstance(section, Mapping):
        raise InputError(wrong)
    try:
        rows = [[float(word) for word in str(text).split()] for text in section.values()]
    except ValueError:
        raise InputError(wrong) from None
    if [len(row) for row in rows] != list(range(2, len(rows) + 2)):
        raise InputError(wrong)
    covariance = np.zeros((len(rows), len(rows)))
    for k, row in enumerate(rows):
        covariance[k, : k + 1] = covariance[: k + 1, k] = row[1:]
    return list(section), np.array([row[0] for row in rows]), covariance
