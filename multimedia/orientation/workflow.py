"""Projection, intersection and resection of a project: path in, result and path out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.media import EXTERIOR, projection_status
from multimedia.media import project as project_points
from multimedia.orientation.calibration_covariance import with_calibration
from multimedia.orientation.intersection import (
    IntersectedPoints,
    intersect,
    intersect_pairs,
    intersect_rays,
)
from multimedia.orientation.point_status import PointStatus
from multimedia.orientation.resection import Resection, resect
from multimedia.projects import (
    SHOWN,
    ImagePoints,
    ObjectPoints,
    Project,
    project_files,
    read_image_points,
    read_object_points,
    read_project,
    write_columns,
    write_project,
)
from multimedia.remarks import remark
from photocore.arrays import FloatArray, IntArray
from photocore.errors import InputError
from photocore.output import all_or_none, check_all_writable, check_ending, check_not_input
from photocore.tables.csvwrite import Columns
from photocore.workbook import check_new_workbook

METHODS = ("rigorous", "rays", "pairs")


@dataclass(frozen=True, slots=True, kw_only=True)
class PointTable:
    """Columns to print or write, with what to say about them."""

    columns: Columns
    remarks: tuple[str, ...] = ()
    summary: tuple[str, ...] = ()

    def records(self) -> list[dict[str, object]]:
        """Return one mapping per row."""
        names = list(self.columns)
        return [
            dict(zip(names, row, strict=True)) for row in zip(*self.columns.values(), strict=True)
        ]


def project_project(
    path: Path, *, points: Path | None, out: Path | None, overwrite: bool = False
) -> PointTable:
    """Project the object points of a project, or of another table, into all its cameras."""
    if out is not None:
        check_not_input(out, *project_files(path), points)
        check_new_workbook(out, overwrite=overwrite)
    project = read_project(path)
    objects, remarks = _objects(project, points)
    views = list(zip(project.cameras, project.interfaces, strict=True))
    images = [project_points(camera, objects.xyz, media) for camera, media in views]
    pixels = [
        camera.sensor.pixel_from_image(image)
        for camera, image in zip(project.cameras, images, strict=True)
        if camera.sensor is not None
    ]
    columns: Columns = {
        "camera": np.repeat(project.camera_names, len(objects.ids)).tolist(),
        "id": list(objects.ids) * len(views),
    }
    columns |= dict(zip("xy", np.concatenate(images).T, strict=True))
    if len(pixels) == len(views):
        columns |= dict(zip(("col", "row"), np.concatenate(pixels).T, strict=True))
    columns["status"] = [
        text for camera, media in views for text in projection_status(camera, objects.xyz, media)
    ]
    units = {"x": "mm", "y": "mm", "col": "px", "row": "px"}
    _write(out, columns, units, overwrite)
    return PointTable(columns=columns, remarks=(*project.remarks, *remarks))


def intersect_project(
    path: Path,
    *,
    points: Path | None,
    out: Path | None,
    method: str = "rigorous",
    overwrite: bool = False,
) -> PointTable:
    """Intersect the image points of a project, or of another table, by one of ``METHODS``."""
    if method not in METHODS:
        raise InputError(f"method: {method!r} is not one of {', '.join(METHODS)}.")
    if out is not None:
        check_not_input(out, *project_files(path), points)
        check_new_workbook(out, overwrite=overwrite)
    project = read_project(path)
    images, remarks = _images(project, points)
    ids = images.names
    image, sigma = images.grid(project.camera_names, ids)
    sigma = np.where(np.isnan(sigma), project.sigma_image, sigma)
    u = project.unit
    if method == "rigorous":
        solved = intersect(project.cameras, image, project.interfaces, sigma=sigma)
        solved, odd = with_calibration(project, solved, sigma)
        remarks = [*remarks, *odd]
        columns, units, summary = _intersection_columns(project, solved, u)
        status = _labels(solved)
        xyz = solved.xyz
    else:
        extra: Columns = {}
        if method == "rays":
            xyz = intersect_rays(project.cameras, image, project.interfaces)
        else:
            xyz, extra["ray_distance"] = intersect_pairs(project.cameras, image, project.interfaces)
        rays = np.isfinite(image).all(axis=-1).sum(axis=0)
        lost = [PointStatus.NO_RAY, PointStatus.ONE_RAY]
        status = [
            PointStatus.OK.label if good else (lost[n] if n < 2 else PointStatus.WEAK).label
            for good, n in zip(np.isfinite(xyz[:, 0]), rays.tolist(), strict=True)
        ]
        columns = dict(zip("XYZ", xyz.T, strict=True)) | extra | {"rays": rays, "status": status}
        units = dict.fromkeys(("X", "Y", "Z", "ray_distance"), u)
        summary = [
            f"{int(np.isfinite(xyz[:, 0]).sum())} points from {len(images.ids)} image points"
        ]
    columns = {"id": list(ids), **columns}
    summary += known_misses(project, ids, xyz)
    remarks = [*remarks, *_suspicious(project, status)]
    _write(out, columns, units, overwrite)
    return PointTable(columns=columns, remarks=(*project.remarks, *remarks), summary=tuple(summary))


def _labels(solved: IntersectedPoints) -> list[str]:
    """Return the status of every point in words."""
    return [PointStatus(code).label for code in solved.status.tolist()]


def _intersection_columns(
    project: Project, solved: IntersectedPoints, unit: str
) -> tuple[Columns, dict[str, str], list[str]]:
    """Return the columns of a rigorous intersection, their units, and a summary."""
    doubtful = solved.status == PointStatus.GROSS_ERROR
    columns: Columns = {
        **dict(zip("XYZ", solved.xyz.T, strict=True)),
        **dict(zip(("sigma_X", "sigma_Y", "sigma_Z"), solved.sigma.T, strict=True)),
        "rays": solved.rays,
        "angle": np.degrees(solved.angle),
        "sigma0": solved.sigma0,
        "suspect": [
            project.cameras[camera].name if bad and camera >= 0 else ""
            for camera, bad in zip(solved.worst_camera.tolist(), doubtful.tolist(), strict=True)
        ],
        "status": _labels(solved),
    }
    units = dict.fromkeys(("X", "Y", "Z", "sigma_X", "sigma_Y", "sigma_Z"), unit) | {"angle": "deg"}
    good = np.isfinite(solved.xyz[:, 0])
    summary = [f"{int(good.sum())} points"]
    controlled = np.isfinite(solved.sigma0)
    if controlled.any():
        weights = np.maximum(2 * solved.rays[controlled] - 3, 1)
        overall = np.sqrt((solved.sigma0[controlled] ** 2 * weights).sum() / weights.sum())
        summary[0] += (
            f", sigma0 {overall:.3g} (1 expected with image coordinates of "
            f"{project.sigma_image * 1000:g} um)"
        )
    for code in PointStatus:
        count = int((solved.status == code).sum())
        if count and code != PointStatus.OK:
            summary.append(f"{count} points: {code.label}")
    return columns, units, summary


@dataclass(frozen=True, slots=True, kw_only=True)
class Resected:
    """Resections of the cameras of a project."""

    project: Project
    results: dict[str, Resection]
    used: dict[str, tuple[str, ...]]
    remarks: tuple[str, ...]


@all_or_none()
def resect_project(
    path: Path,
    *,
    estimate: Sequence[str],
    cameras: Sequence[str] = (),
    out: Path | None = None,
    residuals: Path | None = None,
    overwrite: bool = False,
) -> Resected:
    """Orient the cameras of a project, each on its own, from its control points.

    ``("all",)`` estimates every interior parameter of the camera's lens model.
    """
    check_ending(out, "a project is written as .toml.", ".toml")
    check_not_input(residuals, *project_files(path))
    check_all_writable(out, residuals, overwrite=overwrite)
    project = read_project(path, posed=False)
    unknown = [name for name in cameras if name not in project.camera_names]
    if unknown:
        have = ", ".join(project.camera_names)
        raise InputError(remark("resect.no_camera", names=", ".join(unknown), have=have))
    objects = project.object_points
    if not objects.ids:
        raise InputError(f"{path}: names no object_points; a resection needs control points.")
    remarks = list(project.remarks)
    results: dict[str, Resection] = {}
    used: dict[str, tuple[str, ...]] = {}
    for k, name in enumerate(project.camera_names):
        if not cameras or name in cameras:
            results[name], used[name], odd = _resected(project, k, estimate)
            remarks += [f"{name}: {text}" for text in odd]
    adjusted = [results[c.name].camera if c.name in results else c for c in project.cameras]
    rest = tuple(name for name in project.without_pose if name not in results)
    project = replace(project, cameras=tuple(adjusted), without_pose=rest)
    if residuals is not None:
        _write(residuals, residual_columns(results, used), {"vx": "mm", "vy": "mm"}, overwrite)
    if out is not None:
        write_project(out, project, overwrite=overwrite)
    return Resected(project=project, results=results, used=used, remarks=tuple(remarks))


def _resected(
    project: Project, k: int, estimate: Sequence[str]
) -> tuple[Resection, tuple[str, ...], list[str]]:
    """Return the resection of one camera, the points it used, and remarks."""
    images, objects, remarks = project.image_points, project.object_points, []
    rows = np.array(images.of_camera(project.camera_names[k]), dtype=np.int64)
    place = np.array(objects.rows([images.ids[row] for row in rows]), dtype=np.int64)
    strange = [images.ids[row] for row in rows[place < 0]]
    if strange:
        more = " ..." if len(strange) > SHOWN else ""
        remarks.append(
            f"{len(strange)} image points have no object point of their name and were left out: "
            f"{', '.join(strange[:SHOWN])}{more}"
        )
    rows, place = rows[place >= 0], place[place >= 0]
    parameters = project.cameras[k].interior_names if tuple(estimate) == ("all",) else estimate
    result = resect(
        project.cameras[k], objects.xyz[place], images.image[rows], project.interface_of(k),
        estimate=parameters, sigma=_image_sigma(project, rows),
    )  # fmt: skip
    remarks.extend(result.remarks)
    names = tuple(objects.ids[at] for at in place)
    suspects = [name for name, bad in zip(names, result.suspects, strict=True) if bad]
    if suspects:
        remarks.append(f"gross errors? points {', '.join(suspects[:SHOWN])}")
    return result, names, remarks


def residual_columns(results: dict[str, Resection], used: dict[str, tuple[str, ...]]) -> Columns:
    """Return the residuals of all cameras as columns."""
    names = list(results)
    if not names:
        return {}
    v = np.concatenate([results[name].residuals for name in names])
    w = np.concatenate([results[name].standardised for name in names])
    return {
        "camera": [name for name in names for _ in used[name]],
        "id": [point for name in names for point in used[name]],
        **dict(zip(("vx", "vy", "wx", "wy"), np.hstack([v, w]).T, strict=True)),
    }


def resected_as_dict(resected: Resected) -> dict[str, Any]:
    """Return resections as plain data for ``--json``; angles in degrees."""
    cameras = []
    for name, result in resected.results.items():
        values = {
            p: _shown(p, result.camera.value(p)) for p in EXTERIOR + result.camera.interior_names
        }
        sigmas = {p: _shown(p, s) for p, s in result.sigmas.items()}
        cameras.append(
            {
                "name": name,
                "sigma0": result.sigma0,
                "sigma0_um": result.sigma0 * 1000.0,
                "points": len(resected.used[name]),
                "redundancy": result.redundancy,
                "iterations": result.iterations,
                "estimated": list(result.names),
                **values,
                "sigma": sigmas,
                "correlations": result.correlations,
                "suspects": [
                    p for p, bad in zip(resected.used[name], result.suspects, strict=True) if bad
                ],
            }
        )
    return {"unit": resected.project.unit, "cameras": cameras, "remarks": list(resected.remarks)}


def _shown(name: str, value: float) -> float:
    return float(np.degrees(value)) if name in EXTERIOR[3:] else value


def _image_sigma(project: Project, rows: IntArray) -> FloatArray | None:
    """Return standard deviations of image points, None if all are alike."""
    stated = project.image_points.sigma[rows]
    if np.isnan(stated).all():
        return None
    return np.where(np.isnan(stated), project.sigma_image, stated)


def _objects(project: Project, points: Path | None) -> tuple[ObjectPoints, list[str]]:
    if points is not None:
        return read_object_points(points, unit=project.unit)
    if not project.object_points.ids:
        raise InputError("the project names no object_points; give a table with --points.")
    return project.object_points, []


def _images(project: Project, points: Path | None) -> tuple[ImagePoints, list[str]]:
    if points is not None:
        return read_image_points(points, project.cameras)
    if not project.image_points.ids:
        raise InputError("the project names no image_points; give a table with --points.")
    return project.image_points, []


def _suspicious(project: Project, status: Sequence[str]) -> list[str]:
    """Return a guess why most points failed."""
    good = sum(text == PointStatus.OK.label for text in status)
    if 2 * good >= len(status):
        return []
    hints = ["were the cameras oriented (`multimedia resect`)?"]
    angles = np.array([camera.angles for camera in project.cameras])
    if (np.abs(np.degrees(angles)) < 3.2).all() and np.any(angles):
        hints.append("are the angles of the project file in radians? It wants degrees.")
    if sum(text == PointStatus.GROSS_ERROR.label for text in status) > good:
        hints.append(
            "do the media and lenses of the cameras contradict each other (`multimedia adjust`)? "
            "Positions stored by OpenPTV are means of pairs of rays whatever the rays do: compare "
            "them with --method pairs."
        )
    hints = [hint[0].upper() + hint[1:] for hint in hints]
    return [f"{len(status) - good} of {len(status)} points fail. " + " Or: ".join(hints)]


def known_misses(project: Project, ids: Sequence[str], xyz: FloatArray) -> list[str]:
    """Return how well intersected points agree with the object points of the same name."""
    place = project.object_points.rows(ids)
    rows = [k for k, at in enumerate(place) if at >= 0 and np.isfinite(xyz[k, 0])]
    if not rows:
        return []
    miss = xyz[rows] - project.object_points.xyz[[place[k] for k in rows]]
    rms = np.sqrt((miss**2).mean(axis=0))
    return [
        f"against {len(rows)} known points: RMS X {rms[0]:.4g}, Y {rms[1]:.4g}, Z {rms[2]:.4g}, "
        f"3D {np.sqrt((miss**2).sum(axis=1).mean()):.4g} {project.unit}"
    ]


def _write(out: Path | None, columns: Columns, units: dict[str, str], overwrite: bool) -> None:
    """Write columns with their units in the headings."""
    if out is None:
        return
    headed = {f"{k} [{units[k]}]" if k in units else k: v for k, v in columns.items()}
    write_columns(out, headed, overwrite=overwrite)
