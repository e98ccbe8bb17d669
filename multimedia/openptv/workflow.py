"""OpenPTV folders in and out."""

from __future__ import annotations

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
from multimedia.openptv.openptv_files import DetectedTargets
from multimedia.openptv.target_matching import FIRST_RADIUS, match_targets
from multimedia.orientation.resection import resect
from multimedia.projects.model import ImagePoints, Project
from multimedia.projects.project_file import read_project, write_project
from photocore.arrays import FloatArray, IntArray
from photocore.errors import PhotogrammetryError
from photocore.output import check_all_writable, check_ending

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
    check_ending(out, "a project is written as .toml.", ".toml")
    check_all_writable(out, overwrite=overwrite)
    # The stored orientation belongs to the indices as stored, whatever is thought of them.
    experiment = read_experiment(folder)
    project = experiment.project
    if swap_indices:
        project = read_experiment(folder, swap_indices=True).project
    control = [_control(experiment, k, least_pixels, radius) for k in range(len(project.cameras))]
    matched = tuple(len(ids) for ids, _, _ in control)
    _, particles = particle_points(experiment)
    images = ImagePoints(
        cameras=(*np.repeat(project.camera_names, matched).tolist(), *particles.cameras),
        ids=(*(name for ids, _, _ in control for name in ids), *particles.ids),
        image=np.concatenate([*(image for _, image, _ in control), particles.image]),
        groups=("control",) * sum(matched) + ("particles",) * len(particles.ids),
    )
    remarks = (*project.remarks, *(text for _, _, said in control for text in said))
    project = replace(project, image_points=images, remarks=remarks)
    files = () if out is None else tuple(write_project(out, project, overwrite=overwrite))
    return Import(
        project=project, matched=matched, particles=len(experiment.particles), files=files
    )


def export_openptv(project: Path, folder: Path, *, overwrite: bool = False) -> Project:
    """Write a project as an OpenPTV experiment folder."""
    content = read_project(project)
    write_experiment(folder, content, overwrite=overwrite)
    return content


def _control(
    experiment: Experiment, k: int, least_pixels: int, radius: float
) -> tuple[list[str], FloatArray, list[str]]:
    """Return the control points found in one calibration image, where, and remarks."""
    project, targets = experiment.project, experiment.targets[k]
    camera, body = project.cameras[k], project.object_points
    if targets is None or not body.ids or camera.sensor is None:
        return [], np.empty((0, 2)), []
    remarks = []
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
        more = f" and {len(missing) - 10} more" if len(missing) > 10 else ""
        shown = ", ".join(missing[:10])
        remarks.append(f"{camera.name}: no target for control points {shown}{more}.")
    image = camera.sensor.image_from_pixel(targets.pixels[best[seen]])
    return [body.ids[row] for row in seen], image, remarks


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
        image = camera.sensor.image_from_pixel(pixels[known])
        return resect(camera, body.xyz[place[known]], image, project.interface_of(k)).camera
    except PhotogrammetryError:
        # Clicks of another image, or too few: the stored orientation remains.
        return None


def _matched(
    project: Project,
    camera: Camera,
    k: int,
    targets: DetectedTargets,
    least_pixels: int,
    radius: float,
) -> IntArray:  # fmt: skip
    """Return the target of each control point in the file's numbering, -1 for none."""
    large = np.flatnonzero(targets.counts >= least_pixels)
    control, medium = project.object_points.xyz, project.interface_of(k)
    partner = match_targets(camera, control, targets.pixels[large], medium, radius=radius)
    return np.where(partner >= 0, large[partner], -1) if len(large) else partner
