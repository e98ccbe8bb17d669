"""OpenPTV folders in and out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from multimedia.media.camera import Camera
from multimedia.openptv.experiment import (
    Experiment,
    particle_points,
    read_experiment,
    write_experiment,
)
from multimedia.openptv.openptv_files import Targets
from multimedia.openptv.target_matching import FIRST_RADIUS, match_targets
from multimedia.orientation.resection import resect
from multimedia.projects.model import ImagePoints, Project
from multimedia.projects.project_file import read_project, write_project
from photocore.arrays import FloatArray
from photocore.errors import PhotogrammetryError
from photocore.output import check_writable

#: Fewer control points than this cannot be called matched.
_FEWEST = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Import:
    """What was made of a folder.

    Attributes
    ----------
    project : Project
        Cameras, media, control points, and the image points found.
    matched : tuple of int
        Control points found in each camera's calibration image.
    particles : int
        Particles of the stored frame.
    files : tuple of Path
        Files written.
    """

    project: Project
    matched: tuple[int, ...]
    particles: int
    files: tuple[Path, ...]


def import_openptv(
    folder: Path,
    *,
    out: Path | None,
    overwrite: bool = False,
    swap_indices: bool = False,
    least_pixels: int = 15,
    radius: float = FIRST_RADIUS,
) -> Import:
    """Read an experiment, find its control points among the targets, write a project.

    Parameters
    ----------
    folder : path
        OpenPTV experiment.
    out : path or None
        Project file to write.
    overwrite : bool
        Whether existing files may be replaced.
    swap_indices : bool
        Exchange the indices of glass and water.
    least_pixels : int
        Smaller targets are no dots of the calibration body. [px]
    radius : float
        Farthest a target may lie from where the stored orientation expects it. [px]
    """
    if out is not None:
        check_writable(out, overwrite=overwrite)
    # The stored orientation belongs to the indices as stored, whatever is thought of them.
    experiment = read_experiment(folder)
    project = (
        read_experiment(folder, swap_indices=True).project if swap_indices else (experiment.project)
    )
    remarks = list(project.remarks)
    found: list[tuple[list[str], list[str], FloatArray]] = []
    matched: list[int] = []
    for k, camera in enumerate(project.cameras):
        ids, image = _control(experiment, k, least_pixels, radius, remarks)
        matched.append(len(ids))
        found.append(([camera.name] * len(ids), ids, image))
    _, particles = particle_points(experiment)
    images = ImagePoints(
        cameras=tuple(c for part in found for c in part[0]) + particles.cameras,
        ids=tuple(p for part in found for p in part[1]) + particles.ids,
        image=np.concatenate([*(part[2] for part in found), particles.image]),
        groups=("control",) * sum(matched) + ("particles",) * len(particles.ids),
    )
    project = replace(project, image_points=images, remarks=tuple(remarks))
    files = () if out is None else tuple(write_project(out, project, overwrite=overwrite))
    return Import(
        project=project, matched=tuple(matched), particles=len(experiment.particles), files=files
    )


def export_openptv(project: Path, folder: Path, *, overwrite: bool = False) -> Project:
    """Write a project as an OpenPTV experiment folder."""
    found = read_project(project)
    write_experiment(folder, found, overwrite=overwrite)
    return found


def _control(
    experiment: Experiment, k: int, least_pixels: int, radius: float, remarks: list[str]
) -> tuple[list[str], FloatArray]:
    """Return the control points found in one calibration image, and where."""
    project, targets = experiment.project, experiment.targets[k]
    camera, body = project.cameras[k], project.object_points
    if targets is None or not body.ids or camera.sensor is None:
        return [], np.empty((0, 2))
    best = _matched(project, camera, k, targets, least_pixels, radius)
    others = [(camera, 1, f"targets below {least_pixels} px were needed too.")]
    if (best >= 0).sum() < 0.5 * len(body.ids):
        clicked = _from_clicks(experiment, k)
        if clicked is not None:
            said = "started from the points clicked by hand (man_ori)."
            others += [(clicked, size, said) for size in (least_pixels, 1)]
    for start, size, said in others:
        again = _matched(project, start, k, targets, size, radius)
        # A few more may be noise that happens to lie near; a better start finds many.
        if (again >= 0).sum() > 1.1 * (best >= 0).sum():
            best = again
            remarks.append(f"{camera.name}: {said}")
    seen = np.flatnonzero(best >= 0)
    if len(seen) < _FEWEST:
        remarks.append(
            f"{camera.name}: only {len(seen)} of {len(body.ids)} control points were found among "
            f"{len(targets.pixels)} targets. The stored orientation may be far off (--radius), or "
            "belong to another image."
        )
    elif len(seen) < len(body.ids):
        missing = [body.ids[row] for row in np.flatnonzero(best < 0)]
        remarks.append(f"{camera.name}: no target for control points {_listed(missing)}.")
    image = camera.sensor.image_from_pixel(targets.pixels[best[seen]])
    return [body.ids[row] for row in seen], image


def _from_clicks(experiment: Experiment, k: int) -> Camera | None:
    """Return the camera oriented from the points clicked by hand, None where that fails."""
    project = experiment.project
    camera, body = project.cameras[k], project.object_points
    if not experiment.manual or camera.sensor is None:
        return None
    ids, pixels = experiment.manual[k]
    place = np.array(body.rows(ids), dtype=np.int64)
    known = place >= 0
    try:
        found = resect(
            camera, body.xyz[place[known]], camera.sensor.image_from_pixel(pixels[known]),
            project.interface_of(k),
        )  # fmt: skip
    except PhotogrammetryError:
        # Clicks of another image, or too few: the stored orientation remains.
        return None
    return found.camera


def _matched(
    project: Project, camera: Camera, k: int, targets: Targets, least_pixels: int, radius: float
) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """Return the target of each control point in the file's numbering, -1 for none."""
    large = np.flatnonzero(targets.counts >= least_pixels)
    found = match_targets(
        camera,
        project.object_points.xyz,
        targets.pixels[large],
        project.interface_of(k),
        radius=radius,
    )
    if not len(large):
        return found
    return np.where(found >= 0, large[found], -1)


def _listed(names: Sequence[str], most: int = 10) -> str:
    """Return names, the first few of many."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
