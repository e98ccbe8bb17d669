"""Epipolar curves of a project's image points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NotRequired, TypedDict

import numpy as np

from multimedia.media import Camera
from multimedia.orientation.epipolar_curves import epipolar_candidates, epipolar_curve
from multimedia.orientation.epipolar_picture import draw_epipolar
from multimedia.orientation.intersection import intersect_pairs
from multimedia.projects import SHOWN, Project, project_files, read_project, write_columns
from photocore.arrays import FloatArray
from photocore.errors import GeometryError, InputError
from photocore.output import all_or_none, check_all_writable, check_not_input
from photocore.tables.csvwrite import Columns

#: The depth range without --z-range: that of the object points, this share of it wider.
_MARGIN = 0.25


class Curve(TypedDict):
    """A curve as plain data: its vertices in the image [mm], in the object and in pixels."""

    id: str
    image: FloatArray
    points: FloatArray
    pixels: NotRequired[FloatArray]


class Candidate(TypedDict):
    """An image point near a curve, and the object point that both would give."""

    id: str
    target: str
    distance: float
    X: float
    Y: float
    Z: float


@dataclass(frozen=True, slots=True, kw_only=True)
class EpipolarResult:
    """Curves and candidates as plain data.

    Attributes
    ----------
    curves : list of dict
        ``id``, ``vertices`` (image [mm], pixel [px] and object point of each).
    candidates : list of dict
        ``id``, ``target``, ``distance`` [mm] and the object point.
    z_range : tuple of float
        Depth range used. [unit]
    unit : str
        Of object coordinates.
    remarks : tuple of str
        What the user should know.
    """

    curves: list[Curve]
    candidates: list[Candidate]
    z_range: tuple[float, float]
    unit: str
    remarks: tuple[str, ...]


@all_or_none()
def epipolar_project(
    path: Path,
    *,
    camera: str,
    other: str,
    ids: Sequence[str] = (),
    at: tuple[float, float] | None = None,
    z_range: tuple[float, float] | None = None,
    chord_error: float = 5e-4,
    vertices: int | None = None,
    tolerance: float = 0.01,
    out: Path | None = None,
    picture: Path | None = None,
    photo: Path | None = None,
    overwrite: bool = False,
) -> EpipolarResult:
    """Return the epipolar curves of points of ``camera`` in the image of ``other``.

    Parameters
    ----------
    path : path
        Project file.
    camera, other : str
        Names of the cameras.
    ids : sequence of str
        Image points of ``camera``; all of them if neither ``ids`` nor ``at`` is given.
    at : tuple of float, optional
        (column, row) of a point instead. [px]
    z_range : tuple of float, optional
        Depth range; by default that of the object points and a little more.
    chord_error, vertices
        As for `epipolar_curve`. [mm]
    tolerance : float
        Half width of the band in which candidates are looked for. [mm]
    out, picture : path, optional
        Table of vertices; picture of the curves.
    photo : path, optional
        Image of ``other``, under the picture.
    overwrite : bool
        Replace existing files.
    """
    for written in (out, picture):
        check_not_input(written, *project_files(path), photo)
    check_all_writable(out, picture, overwrite=overwrite)
    project = read_project(path)
    one, two = project.camera_index(camera), project.camera_index(other)
    if one == two:
        raise InputError("--camera and --to name the same camera; an epipolar curve needs two.")
    first, second = project.cameras[one], project.cameras[two]
    media = (project.interface_of(one), project.interface_of(two))
    names, image = _points(project, first, ids, at)
    depths, remarks = _depths(project, z_range)
    polygons = epipolar_curve(
        first, image, second, media, z_range=depths, chord_error=chord_error, vertices=vertices,
    )  # fmt: skip
    rows = project.image_points.of_camera(other)
    targets = project.image_points.image[rows]
    near = epipolar_candidates(polygons, targets, tolerance=tolerance)
    parts = zip(names, polygons.image, polygons.points, polygons.counts, strict=True)
    curves = [
        _curve(name, second, vertex[:count], point[:count]) for name, vertex, point, count in parts
    ]
    lost = [c["id"] for c in curves if not np.isfinite(c["image"]).all()]
    if not any(np.isfinite(c["image"]).any() for c in curves):
        raise GeometryError(
            f"{other} sees nothing of the rays of {camera} between Z {depths[0]:g} and "
            f"{depths[1]:g} {project.unit}. Check --z-range, which must lie on the object's side "
            "of the interface, and that --at names a pixel of the photo."
        )
    if lost:
        remarks.append(
            f"{other} cannot see the whole ray of {', '.join(lost[:SHOWN])}: is the depth range "
            "on the object's side of the interface?"
        )
    image_pairs = np.stack([image[near.curves], targets[near.targets]])
    exact = intersect_pairs((first, second), image_pairs, media)[0]
    candidates = [
        Candidate(
            id=names[curve],
            target=project.image_points.ids[rows[target]],
            distance=distance,
            X=point[0],
            Y=point[1],
            Z=point[2],
        )
        for curve, target, distance, point in zip(
            near.curves, near.targets, near.distance, exact, strict=True
        )
    ]
    if out is not None:
        write_columns(out, _columns(curves, project.unit), overwrite=overwrite)
    if picture is not None:
        if second.sensor is None:
            raise InputError(f"--picture: camera {other} has no sensor, so no pixels to draw in.")
        draw_epipolar(
            picture, [c["pixels"] for c in curves], [c["id"] for c in curves],
            second.sensor.pixel_from_image(targets[near.targets]),
            size=(second.sensor.width, second.sensor.height), photo=photo,
            depths=[c["points"][:, 2] for c in curves],
            title=f"Epipolar curves of {camera} in {other}", overwrite=overwrite,
        )  # fmt: skip
    return EpipolarResult(
        curves=curves, candidates=candidates, z_range=depths,
        unit=project.unit, remarks=(*project.remarks, *remarks),
    )  # fmt: skip


def _columns(curves: Sequence[Curve], unit: str) -> Columns:
    """Return the vertices of all curves as columns."""
    image = np.concatenate([c["image"] for c in curves])
    points = np.concatenate([c["points"] for c in curves])
    columns: Columns = {
        "id": [c["id"] for c in curves for _ in c["image"]],
        "vertex": [k for c in curves for k in range(1, len(c["image"]) + 1)],
    }
    columns |= dict(zip(("x [mm]", "y [mm]"), image.T, strict=True))
    if all("pixels" in c for c in curves):
        pixels = np.concatenate([c["pixels"] for c in curves])
        columns |= dict(zip(("col [px]", "row [px]"), pixels.T, strict=True))
    return columns | {f"{axis} [{unit}]": points[:, k] for k, axis in enumerate("XYZ")}


def _curve(name: str, camera: Camera, image: FloatArray, points: FloatArray) -> Curve:
    curve = Curve(id=name, image=image, points=points)
    if camera.sensor is not None:
        curve["pixels"] = camera.sensor.pixel_from_image(image)
    return curve


def _points(
    project: Project, camera: Camera, ids: Sequence[str], at: tuple[float, float] | None
) -> tuple[list[str], FloatArray]:
    """Return names and image points to draw curves for."""
    if at is not None:
        if camera.sensor is None:
            raise InputError(f"--at: camera {camera.name} has no sensor, so no pixels.")
        return [f"{at[0]:g},{at[1]:g}"], camera.sensor.image_from_pixel([at])
    images = project.image_points
    rows = {images.ids[row]: row for row in images.of_camera(camera.name)}
    missing = [name for name in ids if name not in rows]
    if missing:
        raise InputError(
            f"camera {camera.name} has no image point called {', '.join(missing[:SHOWN])}."
        )
    names = list(ids) or list(rows)
    if not names:
        raise InputError(f"camera {camera.name} has no image points; give --at COL,ROW.")
    return names, images.image[[rows[name] for name in names]]


def _depths(
    project: Project, z_range: tuple[float, float] | None
) -> tuple[tuple[float, float], list[str]]:
    """Return the depth range, and how it was chosen."""
    if z_range is not None:
        return z_range, []
    if not project.object_points.ids:
        raise InputError("give the depth range of the object with --z-range ZMIN,ZMAX.")
    z = project.object_points.xyz[:, 2]
    margin = _MARGIN * float(z.max() - z.min()) or 0.05 * (abs(float(z[0])) or 1.0)
    low, high = float(z.min()) - margin, float(z.max()) + margin
    return (low, high), [
        f"depth range {low:.4g} to {high:.4g} {project.unit}, from the object points; --z-range "
        "sets another."
    ]
