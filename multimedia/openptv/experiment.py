"""OpenPTV experiment folders: read into a project, write back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from multimedia.media import Camera, FlatInterface, Sensor
from multimedia.openptv.openptv_cameras import (
    NO_MISFIT,
    OpenptvCamera,
    common_sensor,
    glass_vector,
    in_openptvs_terms,
    wall_of,
)
from multimedia.openptv.openptv_files import (
    ControlParameters,
    DetectedTargets,
    addpar_text,
    glass_interface,
    ori_text,
    read_body,
    read_camera,
    read_control,
    read_correspondences,
    read_manual,
    read_targets,
)
from multimedia.openptv.plane_files import find_sets, read_stems
from multimedia.openptv.plane_sets import PlaneCandidates
from multimedia.openptv.yaml_parameters import ENDINGS, PATTERN, read_yaml_parameters
from multimedia.orientation import intersect, known_misses
from multimedia.projects import METRES, SHOWN, ImagePoints, ObjectPoints, Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray, IntArray
from photocore.errors import InputError
from photocore.output import atomic_folder
from photocore.textfile import check_name

#: OpenPTV's usual places, in the order of search.
_PARAMETERS = ("", "parameters", "parametersRun1", "parametersMultiPlane")
#: A text file with fewer lines of four numbers is no calibration body.
_FEWEST = 6
#: Said of a camera.
NO_TARGETS = "{}: no _targets file of its calibration image was found."
_BODIES = ("target_on_a_side.txt", "calblock.txt", "calibration_target.txt", "target_file.txt")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experiment:
    """What an OpenPTV folder holds.

    Attributes
    ----------
    project : Project
        Cameras, media and calibration body; no image points yet.
    targets : tuple of DetectedTargets or None
        Detections of each camera's calibration image.
    particles, particle_targets : ndarray
        Stored positions, shape (n, 3), and target numbers per camera, of the first ``rt_is``
        frame found; empty without one.
    frame_targets : tuple of DetectedTargets or None
        Detections of that frame.
    manual : tuple of (list of str, ndarray)
        Points clicked by hand in each calibration image: ids and pixels; may be empty.
    planes : tuple of PlaneCandidates
        Sets of points of a multi-plane calibration, per camera; may be empty.
    """

    project: Project
    targets: tuple[DetectedTargets | None, ...]
    particles: FloatArray
    particle_targets: IntArray
    frame_targets: tuple[DetectedTargets | None, ...]
    manual: tuple[tuple[list[str], FloatArray], ...] = ()
    planes: tuple[PlaneCandidates, ...] = ()


def read_experiment(folder: Path | str, *, swap_indices: bool = False) -> Experiment:
    """Read an OpenPTV experiment folder.

    Parameters
    ----------
    folder : path
        Holding ptv.par, or a folder ``parameters`` that does; ``cal`` and ``img`` beside it. Or
        pyptv's parameters*.yaml there, or that file itself.
    swap_indices : bool
        Exchange the indices of glass and water.

    Returns
    -------
    Experiment
        Its project, targets and particles.

    Raises
    ------
    InputError
        If a file the experiment needs is missing or damaged; the message names it.
    """
    folder = Path(folder)
    check_name(folder)
    is_run = folder.is_file() and folder.suffix.lower() in ENDINGS
    if not folder.is_dir() and not is_run:
        raise InputError(f"{folder}: is no folder; give the folder of an OpenPTV experiment.")
    control_path = folder if is_run else _control_path(folder)
    folder = folder.parent if is_run else folder
    is_yaml = control_path.suffix.lower() in ENDINGS
    control = (read_yaml_parameters if is_yaml else read_control)(control_path)
    home = folder.parent if control_path.parent == folder and _is_of_parameters(folder) else folder
    roots = list(dict.fromkeys([control_path.parent, folder, home]))
    remarks: list[str] = []
    runs = [] if is_yaml else sorted(home.glob(PATTERN))
    if runs:
        remarks.append(remark("openptv.both_kinds", of=control_path, file=runs[0].name))
    if control_path.parent.name not in _PARAMETERS and control_path.parent != folder:
        remarks.append(f"{folder}: has no ptv.par of its own; read {control_path}.")
    indices, odd = _checked_indices(control, control_path.name, swap_indices)
    cameras, media, media_of, odd_cameras = _cameras(control, roots, indices)
    body, source = _body(roots, control.body)
    remarks += [*odd, *odd_cameras]
    if not source:
        remarks.append("no calibration body (cal_ori.par names it) was found: no object points.")
    shown = control.calibration_images
    targets = tuple(_targets(roots, [f"{name}_targets"], control.field) for name in shown)
    unseen = [c.name for c, detected in zip(cameras, targets, strict=True) if detected is None]
    remarks += map(NO_TARGETS.format, unseen)
    particles, numbers, frame, odd_frame = _particles(roots, control)
    manual, odd_manual = (control.manual, ()) if is_yaml else _manual(roots, len(cameras))
    listed = _find(roots, "multi_planes.par")
    stems = read_stems(listed) if listed is not None and not is_yaml else list(control.stems)
    planes, odd_planes = find_sets(home, stems, control.calibration_images, control.sensor)
    remarks += [*odd_frame, *odd_manual, *odd_planes]
    project = Project(
        cameras=tuple(cameras),
        media=media,
        media_of=media_of,
        object_points=body,
        sigma_image=0.5 * float(control.sensor.pixel_size.mean()),
        unit="mm",
        name=folder.resolve().name,
        extra={"source": f"OpenPTV {control_path.name}, {source}" if source else "OpenPTV"},
        remarks=tuple(remarks),
    )
    return Experiment(
        project=project,
        targets=targets,
        particles=particles,
        particle_targets=numbers,
        frame_targets=frame,
        manual=manual,
        planes=planes,
    )


def write_experiment(
    folder: Path | str, project: Project, *, overwrite: bool = False
) -> tuple[str, ...]:
    """Write cal/*.ori, *.addpar, *_targets, the calibration body and parameters/ptv.par.

    Lengths are written in mm, whatever the unit of the project.

    Parameters
    ----------
    folder : path
        New, or an existing one.
    project : Project
        What is written.
    overwrite : bool
        Whether existing files may be replaced.

    Returns
    -------
    tuple of str
        What is not exactly as in the project, e.g. distortion that OpenPTV has no terms for.

    Raises
    ------
    InputError
        If OpenPTV cannot hold the project: curved or more than three media, media that differ
        between cameras, no sensor, or distortion that it cannot come near.
    """
    factor = METRES[project.unit] / METRES["mm"]
    sensor = common_sensor(project.cameras)
    lines, inexact = [str(len(project.cameras))], list[str]()
    files: dict[str, str] = {}
    views: list[tuple[OpenptvCamera, FlatInterface]] = []
    layers = None
    for number, camera in enumerate(project.cameras):
        wall = wall_of(camera, project.interface_of(number))
        if layers is not None and wall.layers != layers:
            raise InputError(remark("openptv.other_media", name=camera.name))
        layers = wall.layers
        base = f"cal/{camera.name}.tif"
        glass = glass_vector(camera, wall) * factor
        xyz = project.object_points.xyz
        ours = in_openptvs_terms(camera, sensor, points=xyz, media=wall)
        if ours.misfit > NO_MISFIT:
            where = " (at the object points)" if ours.at_points else ""
            inexact.append(f"{camera.name} {ours.misfit:.3g} px{where}")
        views.append((ours, wall))
        moved = replace(ours.camera, centre=ours.camera.centre * factor)
        files |= {f"{base}.ori": ori_text(moved, glass)}
        files |= {f"{base}.addpar": addpar_text(moved, ours.scale)}
        lines += [f"img/{camera.name}.", base]
        rows = project.image_points.of_camera(camera.name)
        if rows:
            files[f"{base}_targets"] = _targets_text(project, camera, rows)
    assert layers is not None  # a project has at least one camera
    thickness = layers.thicknesses[0] * factor
    lines += ["1", "0", "1", str(sensor.width), str(sensor.height)]
    lines += [f"{v:.17g}" for v in (*sensor.pixel_size, 0, *layers.indices, thickness)]
    files["parameters/ptv.par"] = "\n".join(lines) + "\n"
    if project.object_points.ids:
        files["cal/calblock.txt"] = "".join(
            f"{k} {x:.17g} {y:.17g} {z:.17g}\n"
            for k, (x, y, z) in enumerate(project.object_points.xyz * factor, start=1)
        )
    with atomic_folder(folder, overwrite=overwrite) as temporary:
        for name, text in files.items():
            (temporary / name).parent.mkdir(parents=True, exist_ok=True)
            (temporary / name).write_text(text, encoding="utf-8", newline="\n")
    if not inexact:
        return ()
    return (
        "OpenPTV has no terms for this distortion as it is; it was written with those that come "
        f"nearest. Image points move by at most: {', '.join(inexact)}.",
        *_cost(project, sensor, views),
        'To lose nothing, calibrate with convention = "openptv" in [camera.distortion] of every '
        "camera (as an import of OpenPTV's files has it) and without scale.",
    )


def _cost(
    project: Project, sensor: Sensor, views: Sequence[tuple[OpenptvCamera, FlatInterface]]
) -> list[str]:
    """Return what the cameras as written do to the points that the project's cameras measured."""
    ids = project.image_points.names
    if len(views) < 2 or not ids:
        return []
    image, _ = project.image_points.grid(project.camera_names, ids)
    pixels = [
        camera.described_sensor().pixel_from_image(seen)
        for camera, seen in zip(project.cameras, image, strict=True)
    ]
    scales = np.array([ours.scale for ours, _ in views])
    moved_image = sensor.image_from_pixel(pixels) / scales[:, None, None]
    original = intersect(project.cameras, image, project.interfaces).xyz
    media = [None if len(set(wall.indices)) == 1 else wall for _, wall in views]
    moved = intersect([ours.camera for ours, _ in views], moved_image, media).xyz
    miss = np.linalg.norm(moved - original, axis=1)
    if not np.isfinite(miss).any():
        return []
    checks = zip(
        known_misses(project, ids, original), known_misses(project, ids, moved), strict=False
    )
    return [
        f"Points in space move by {np.sqrt(np.nanmean(miss**2)):.3g} {project.unit} (RMS), "
        f"{np.nanmax(miss):.3g} at most."
        + "".join(f" Here {ours}; as written for OpenPTV {theirs}." for ours, theirs in checks)
    ]


def _targets_text(project: Project, camera: Camera, rows: Sequence[int]) -> str:
    """Return a _targets file; the last number is the row of the point in the calibration body."""
    assert camera.sensor is not None  # common_sensor has looked
    pixels = camera.sensor.pixel_from_image(project.image_points.image[list(rows)])
    place = project.object_points.rows([project.image_points.ids[row] for row in rows])
    lines = (
        f"{k:4d} {x:.9f} {y:.9f} 20 5 5 1000 {number}\n"
        for k, ((x, y), number) in enumerate(zip(pixels, place, strict=True))
    )
    return f"{len(rows)}\n" + "".join(lines)


def _control_path(folder: Path) -> Path:
    """Return where ptv.par is, or pyptv's file of all parameters."""
    for name in _PARAMETERS:
        path = folder / name / "ptv.par"
        if path.is_file():
            return path
    others = sorted(folder.glob("*/ptv.par"))
    if len(others) == 1:
        return others[0]
    if others:
        shown = ", ".join(str(path.parent) for path in others[:SHOWN])
        raise InputError(f"{folder}: holds several experiments; name one of {shown}.")
    runs = sorted([*folder.glob(PATTERN), *(folder / "parameters").glob(PATTERN)])
    if len(runs) == 1:
        return runs[0]
    if runs:
        shown = ", ".join(map(str, runs[:SHOWN]))
        raise InputError(remark("openptv.many_runs", of=folder, names=shown))
    raise InputError(remark("openptv.no_parameters", of=folder))


def _is_of_parameters(folder: Path) -> bool:
    """Whether a folder is one of parameters only, the data lying beside it."""
    return folder.name.lower().startswith("parameters") and not (folder / "cal").is_dir()


def _find(roots: Sequence[Path], name: str) -> Path | None:
    """Return a file that OpenPTV calls ``name``: there, or of that name beside the others."""
    # Folders recorded under Windows have backslashes.
    name = name.replace("\\", "/").strip()
    for root in roots:
        for candidate in (root / name, root / Path(name).name, root / "cal" / Path(name).name):
            check_name(candidate)
            if candidate.is_file():
                return candidate
    return None


def _checked_indices(
    control: ControlParameters, file: str, swap: bool
) -> tuple[tuple[float, ...], list[str]]:
    """Return the indices, and what is odd about them."""
    remarks = []
    air, glass, water = control.indices
    if swap:
        remarks.append(f"{file}: indices of glass and water exchanged, as asked.")
        air, glass, water = air, water, glass
    if glass < water:
        remarks.append(
            f"{file}: glass has index {glass:g} and water {water:g}; real glass (1.46 to 1.9) is "
            "denser than water (1.33 to 1.36), so the two are most likely interchanged. Used as "
            "they are; --swap-indices (swap_indices=True) exchanges them."
        )
    if control.thickness == 0:
        remarks.append(f"{file}: the glass has no thickness.")
    if 0 < control.thickness < 0.1:
        remarks.append(
            f"{file}: glass of {control.thickness:g} mm; OpenPTV's lengths are in mm, is this in m?"
        )
    return (air, glass, water), remarks


def _cameras(
    control: ControlParameters, roots: Sequence[Path], indices: tuple[float, ...]
) -> tuple[list[Camera], dict[str, FlatInterface], tuple[str, ...], list[str]]:
    """Return cameras, the different glass walls, the wall of each camera, and remarks."""
    remarks: list[str] = []
    cameras: list[Camera] = []
    media: dict[str, FlatInterface] = {}
    media_of: list[str] = []
    named = control.orientations or tuple(f"{image}.ori" for image in control.calibration_images)
    for number, image in enumerate(control.calibration_images, start=1):
        path = _find(roots, named[number - 1])
        if path is None:
            raise InputError(remark("openptv.no_ori", of=roots[0], image=image, number=number))
        name = Path(image.replace("\\", "/")).name.split(".")[0] or f"cam{number}"
        if name in {camera.name for camera in cameras}:
            name = f"{name}_{number}"
        camera, glass, notes = read_camera(path, sensor=control.sensor, name=name)
        remarks += notes
        cameras.append(camera)
        if not np.any(glass) or len(set(indices)) == 1:  # of one index all is one medium
            media_of.append("")
            continue
        wall = glass_interface(glass, indices, control.thickness)
        place = [wall.point, wall.normal]
        same = [
            k for k, medium in media.items() if np.allclose(place, [medium.point, medium.normal])
        ]
        if not same:
            same = [f"wall{len(media) + 1}"]
            media[same[0]] = wall
        media_of.append(same[0])
        height = float(wall.normal @ (camera.centre - wall.point))
        if height < control.thickness:
            remarks.append(remark("openptv.inside_glass", of=path.name, height=height))
    return cameras, media, tuple(media_of), remarks


def _body(roots: Sequence[Path], file: str) -> tuple[ObjectPoints, str]:
    """Return the calibration body that cal_ori.par names or of a usual name, and its file."""
    names = [file, *_BODIES]
    listed = None if file else _find(roots, "cal_ori.par")
    if listed is not None:
        first = listed.read_text(encoding="utf-8", errors="replace").splitlines()[:1]
        names = [*first, *names]
    for name in names:
        path = _find(roots, name) if name.strip() else None
        if path is not None:
            ids, xyz = read_body(path)
            return ObjectPoints(ids=tuple(ids), xyz=xyz), path.name
    for root in roots:
        for path in sorted([*root.glob("*.txt"), *(root / "cal").glob("*.txt")]):
            try:
                ids, xyz = read_body(path)
            except InputError:
                # Some other text; the next may be the body.
                continue
            if len(ids) >= _FEWEST:
                return ObjectPoints(ids=tuple(ids), xyz=xyz), path.name
    return ObjectPoints(), ""


def _manual(
    roots: Sequence[Path], cameras: int
) -> tuple[tuple[tuple[list[str], FloatArray], ...], tuple[str, ...]]:
    """Return the points clicked by hand in each calibration image, if kept; and remarks."""
    points, pixels = _find(roots, "man_ori.par"), _find(roots, "man_ori.dat")
    if points is None or pixels is None:
        return (), ()
    try:
        ids, places = read_manual(points, pixels)
    except InputError as error:
        # Only a help for poor start values: an experiment is complete without it.
        return (), (f"left out: {error}",)
    each = len(ids) // cameras
    parts = [slice(k * each, (k + 1) * each) for k in range(cameras)]
    return tuple((ids[part], places[part]) for part in parts), ()


def _targets(roots: Sequence[Path], names: Sequence[str], field: int) -> DetectedTargets | None:
    path = next((path for name in names if (path := _find(roots, name)) is not None), None)
    return None if path is None else read_targets(path, field=field)


def _particles(
    roots: Sequence[Path], control: ControlParameters
) -> tuple[FloatArray, IntArray, tuple[DetectedTargets | None, ...], tuple[str, ...]]:
    """Return the first stored frame: positions, target numbers, the targets; and remarks."""
    nothing = np.empty((0, 3)), np.empty((0, len(control.images)), dtype=np.int64), ()
    folders = (*(root / "res" for root in roots), *roots)
    path = next((path for place in folders for path in sorted(place.glob("rt_is.*"))), None)
    if path is None:
        return *nothing, ()
    frame = path.suffix.lstrip(".")
    positions, numbers = read_correspondences(path)
    if not len(positions):
        return *nothing, (f"{path.name}: holds no particles.",)
    if numbers.shape[1] < len(control.images):
        raise InputError(
            f"{path}: {numbers.shape[1]} target columns for {len(control.images)} cameras."
        )
    numbers = numbers[:, : len(control.images)]
    # pyptv writes rt_is.1 and cam1.0001_targets.
    words = (frame, f".{frame}", f".{frame:0>4}")
    frames = tuple(
        _targets(roots, [f"{image}{word}_targets" for word in words], control.field)
        for image in control.images
    )
    if any(targets is None for targets in frames):
        return *nothing, (f"{path.name}: its _targets files were not all found; frame left out.",)
    return positions, numbers, frames, ()


def particle_points(experiment: Experiment) -> tuple[ObjectPoints, ImagePoints]:
    """Return the stored particles of a frame and their image points, ids p1, p2, ...

    Raises
    ------
    InputError
        If a particle refers to a target that does not exist.
    """
    ids = tuple(f"p{k}" for k in range(1, len(experiment.particles) + 1))
    cameras, names, image = list[str](), list[str](), list[FloatArray]([np.empty((0, 2))])
    for k, targets in enumerate(experiment.frame_targets):
        camera = experiment.project.cameras[k]
        if targets is None or camera.sensor is None:
            continue
        number = experiment.particle_targets[:, k]
        if (number >= len(targets.pixels)).any():
            raise InputError(
                f"rt_is: target {int(number.max())} of {camera.name} does not exist; its _targets "
                f"file holds {len(targets.pixels)}. Positions and targets are of other frames."
            )
        rows = np.flatnonzero(number >= 0)
        cameras += [camera.name] * len(rows)
        names += [ids[row] for row in rows]
        image.append(camera.sensor.image_from_pixel(targets.pixels[number[rows]]))
    images = ImagePoints(cameras=tuple(cameras), ids=tuple(names), image=np.concatenate(image))
    return ObjectPoints(ids=ids, xyz=experiment.particles), images
