"""OpenPTV folders in and out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from multimedia.media import Camera
from multimedia.openptv.experiment import (
    NO_TARGETS,
    Experiment,
    particle_points,
    read_experiment,
    write_experiment,
)
from multimedia.openptv.openptv_files import DetectedTargets
from multimedia.openptv.plane_matching import PlaneMatch, choose_sets
from multimedia.openptv.target_matching import FIRST_RADIUS, is_chance, match_targets
from multimedia.orientation import resect
from multimedia.projects import (
    ImagePoints,
    ObjectPoints,
    Project,
    place_name,
    read_project,
    write_project,
)
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
    project = replace(project, object_points=_with_planes(experiment, control))
    matched = tuple(len(one.ids) for one in control)
    _, particles = particle_points(experiment)
    images = ImagePoints(
        cameras=(*np.repeat(project.camera_names, matched).tolist(), *particles.cameras),
        ids=(*(name for one in control for name in one.ids), *particles.ids),
        image=np.concatenate([*(one.image for one in control), particles.image]),
        groups=("control",) * sum(matched) + ("particles",) * len(particles.ids),
    )
    of_planes = [c.name for c, one in zip(project.cameras, control, strict=True) if one.planes]
    remarks_kept = [
        text for text in project.remarks if text not in map(NO_TARGETS.format, of_planes)
    ]
    remarks = (*remarks_kept, *(text for one in control for text in one.remarks))
    project = replace(project, image_points=images, remarks=remarks)
    files = () if out is None else tuple(write_project(out, project, overwrite=overwrite))
    return Import(
        project=project, matched=matched, particles=len(experiment.particles), files=files
    )


def export_openptv(
    project: Path, folder: Path, *, overwrite: bool = False
) -> tuple[Project, tuple[str, ...]]:
    """Write a project as an OpenPTV experiment folder; return it, and what is not exact there."""
    content = read_project(project)
    return content, write_experiment(folder, content, overwrite=overwrite)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _CameraControl:
    """Control points of one camera: ids, image coordinates, where from, and remarks."""

    ids: Sequence[str] = ()
    image: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    remarks: Sequence[str] = ()
    planes: PlaneMatch | None = None


def _control(experiment: Experiment, k: int, least_pixels: int, radius: float) -> _CameraControl:
    """Return the control points of a camera: of the planes if listed, else found among targets."""
    listed = any(experiment.planes[k].positions)
    targets = _CameraControl() if listed else _from_targets(experiment, k, least_pixels, radius)
    if targets.ids or not (listed or experiment.planes[k].together):
        return targets
    project = experiment.project
    camera = project.cameras[k]
    planes = choose_sets(camera, experiment.planes[k], project.interface_of(k))
    notes = [*targets.remarks, *(f"{camera.name}: {text}" for text in planes.remarks)]
    if not planes.labels and listed:
        targets = _from_targets(experiment, k, least_pixels, radius)
        return replace(targets, remarks=(*notes, *targets.remarks))
    ids = [place_name(place) for place in planes.xyz]
    return _CameraControl(ids=ids, image=planes.image, remarks=notes, planes=planes)


def _with_planes(experiment: Experiment, control: Sequence[_CameraControl]) -> ObjectPoints:
    """Return the points of all planes, and those of the body where a camera was matched to it."""
    body = experiment.project.object_points
    planes = [(one.ids, one.planes) for one in control if one.planes is not None]
    if not planes:
        return body
    points: dict[str, tuple[str, FloatArray]] = {}
    if len(planes) < len(control):
        points |= {name: ("", place) for name, place in zip(body.ids, body.xyz, strict=True)}
    for ids, plane in planes:
        for name, label, place in zip(ids, plane.labels, plane.xyz, strict=True):
            points.setdefault(name, (label, place))
    labels, xyz = zip(*points.values(), strict=True)
    return ObjectPoints(ids=tuple(points), xyz=np.array(xyz), groups=labels)


def _from_targets(
    experiment: Experiment, k: int, least_pixels: int, radius: float
) -> _CameraControl:
    """Return the control points found among the targets of one calibration image."""
    project, targets = experiment.project, experiment.targets[k]
    camera, body = project.cameras[k], project.object_points
    if targets is None or not body.ids or camera.sensor is None:
        return _CameraControl()
    remarks = []

    def matched(start: Camera, least_pixels: int) -> IntArray:
        """Return the target of each control point in the file's numbering, -1 for none."""
        large = np.flatnonzero(targets.counts >= least_pixels)
        medium = project.interface_of(k)
        partner = match_targets(start, body.xyz, targets.pixels[large], medium, radius=radius)
        return np.where(partner >= 0, large[partner], -1) if len(large) else partner

    best = matched(camera, least_pixels)
    others = [(camera, 1, f"targets below {least_pixels} px were needed too.")]
    if (best >= 0).sum() < 0.5 * len(body.ids):
        clicked = _from_clicks(experiment, k)
        if clicked is not None:
            note = "started from the points clicked by hand (man_ori)."
            others += [(clicked, size, note) for size in (least_pixels, 1)]
    for start, size, note in others:
        again = matched(start, size)
        # A few more may be noise that happens to lie near; a better start finds many.
        if (again >= 0).sum() > 1.1 * (best >= 0).sum():
            best = again
            remarks.append(f"{camera.name}: {note}")
    rows = np.flatnonzero(best >= 0)
    if len(rows) < _FEWEST or _by_chance(project, k, targets, best):
        remarks.append(
            f"{camera.name}: its control points were not found: only {len(rows)} of "
            f"{len(body.ids)} lie near one of the {len(targets.pixels)} targets, no more than by "
            "chance; none was taken. The stored orientation may be far off (--radius), or belong "
            "to another image."
        )
        return _CameraControl(remarks=remarks)
    if len(rows) < len(body.ids):
        missing = [body.ids[row] for row in np.flatnonzero(best < 0)]
        more = f" and {len(missing) - 10} more" if len(missing) > 10 else ""
        shown = ", ".join(missing[:10])
        remarks.append(f"{camera.name}: no target for control points {shown}{more}.")
    image = camera.sensor.image_from_pixel(targets.pixels[best[rows]])
    return _CameraControl(ids=[body.ids[row] for row in rows], image=image, remarks=remarks)


def _by_chance(project: Project, k: int, targets: DetectedTargets, best: IntArray) -> bool:
    """Whether the targets found are no more than chance would bring."""
    large = np.flatnonzero(targets.counts >= targets.counts[best[best >= 0]].min())
    place = np.full(len(targets.counts), -1)
    place[large] = np.arange(len(large))
    partner = np.where(best >= 0, place[best], -1)
    control, medium = project.object_points.xyz, project.interface_of(k)
    return is_chance(project.cameras[k], control, targets.pixels[large], partner, medium)


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
