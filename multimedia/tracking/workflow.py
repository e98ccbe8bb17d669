"""Targets of all cameras and frames in, tracks of particles out."""

from __future__ import annotations

from collections.abc import Container, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from multimedia.openptv import (
    TOLERANCE,
    ChanceCounts,
    narrower_counts,
    read_blobs,
    read_targets,
    tolerance_remarks,
)
from multimedia.openptv.chance_counts import chance_counts
from multimedia.openptv.correspondences import correspondences
from multimedia.orientation import intersect
from multimedia.projects import METRES, SIGMA_PIXEL, Project, read_project, write_project
from multimedia.remarks import remark
from multimedia.tracking.self_calibration import (
    CAMERAS_OFF,
    SelfCalibration,
    calibrated_on_particles,
)
from multimedia.tracking.track_files import check_tracks_path, openptv_files, write_tracks
from multimedia.tracking.tracks import GAP, SHORTEST, Tracks, track_particles
from photocore.arrays import FloatArray, IntArray
from photocore.errors import InputError
from photocore.machine import cores
from photocore.output import (
    all_or_none,
    atomic_folder,
    check_all_writable,
    check_ending,
    check_not_input,
)

#: What OpenPTV calls the targets of a frame: base, number of the frame, this.
ENDING = "_targets"
#: Frames whose correspondences are held against chance: the first, the middle, the last.
TESTED = 3
#: Frames on which cameras are adjusted, at most: their targets suffice where they are few.
CALIBRATED = 12


@dataclass(frozen=True, slots=True, eq=False)
class TrackedParticles:
    """What was found of a sequence.

    Attributes
    ----------
    project : Project
    tracks : Tracks
    targets : ndarray of int, shape (n, cameras)
        Rows of the targets of each point of the tracks, -1 where a camera did not see it.
    units : tuple of str
        Of lengths and of velocities.
    frames : tuple of int
    sigma_px : float
        A-posteriori standard deviation of an image coordinate. [px]
    found, chance : float
        Particles of the frames that were held against chance, and how many come by it at most.
    remarks : tuple of str
        What to look at: those of the tracks, files that are lost, a tolerance that would do.
    calibration : SelfCalibration or None
        What the particles made of the cameras, if they were adjusted on them.
    """

    project: Project
    tracks: Tracks
    targets: IntArray
    units: tuple[str, str]
    frames: tuple[int, ...]
    sigma_px: float
    found: float
    chance: float
    remarks: tuple[str, ...] = ()
    calibration: SelfCalibration | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _ParticlesOfFrame:
    """Particles of one frame, with the a-posteriori variance factor of each."""

    xyz: FloatArray
    covariance: FloatArray
    targets: IntArray
    factor: FloatArray


def find_tracks(
    project: Path,
    targets: Sequence[Path],
    *,
    first: int | None = None,
    last: int | None = None,
    rate: float | None = None,
    tolerance: float | None = None,
    fewest: int = 3,
    step: float | None = None,
    change: float | None = None,
    gap: int = GAP,
    shortest: int = SHORTEST,
    calibrate: Path | None = None,
    cameras_off: float = CAMERAS_OFF,
    out: Path | None = None,
    folder: Path | None = None,
    overwrite: bool = False,
) -> TrackedParticles:
    """Find the particles of a sequence and follow them.

    Parameters
    ----------
    project : path
        Project file with oriented cameras.
    targets : sequence of path
        Of each camera, in the order of the project: what its target files begin with, as in
        OpenPTV's sequence: ``img/cam1.`` for ``img/cam1.10001_targets`` and so on; or the file of
        all frames that MyPTV writes (``blobs_cam1``).
    first, last : int, optional
        Frames; by default all that every camera has.
    rate : float, optional
        Frames per second; without it velocities are per frame.
    tolerance : float, optional
        Farthest that a target may lie from where its particle is seen; by default 2, or less where
        that keeps the particles and leaves half as much to chance. [px]
    fewest : int
        As for `multimedia.openptv.correspondences.correspondences`.
    step, change, gap, shortest
        As for `track_particles`; lengths in the unit of the project.
    calibrate : path, optional
        Where to write the project with its cameras adjusted on the particles first; the tracks are
        then those of these cameras.
    cameras_off : float
        How far they may be off before. [px]
    out : path, optional
        Table of all points of all tracks, .csv or .xlsx, or HDF5 (.h5).
    folder : path, optional
        Where to write rt_is and ptv_is of every frame, as OpenPTV does. [mm]
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    InputError
        If files are missing, what is found cannot be told from chance, or nothing can be tracked.
    """
    if out is not None:
        check_tracks_path(out)
    check_not_input(calibrate, project)
    check_all_writable(out, calibrate, overwrite=overwrite)
    check_ending(calibrate, "a project is written as .toml.", ".toml")
    content = read_project(project)
    sequences = _sequences(targets, content.camera_names)
    frames = _frames(targets, sequences, first, last)
    files = [path for each in sequences for path in each.values() if isinstance(path, Path)]
    check_not_input(out, project, *targets, *files)
    if folder is not None and folder.is_dir():
        written = [folder / f"{kind}.{frame}" for frame in frames for kind in ("rt_is", "ptv_is")]
        check_all_writable(*written, overwrite=overwrite)

    def places(frame: int) -> list[FloatArray]:
        """Return the targets of each camera in a frame."""
        return [_places(sequence.get(frame)) for sequence in sequences]

    calibration = None
    if calibrate is not None:
        some = [places(frames[k]) for k in _tried_frames(len(frames), CALIBRATED)]
        calibration = calibrated_on_particles(content, some, tolerance=cameras_off)
        content = calibration.project
    tried = [places(frames[k]) for k in _tried_frames(len(frames))]
    first_count = _beyond_chance(project, content, tried, tolerance or TOLERANCE, fewest)
    fewer = narrower_counts(content, tried, first_count, fewest)
    # A tolerance that is stated is kept.
    counted = first_count if tolerance is not None or fewer is None else fewer
    key = "targets.tolerance" if tolerance is not None else "tracks.tolerance"
    with ThreadPoolExecutor(cores()) as pool:
        particles = list(
            pool.map(
                lambda frame: _particles(content, places(frame), counted.tolerance, fewest), frames
            )
        )
    factor = _median_factor([one.factor for one in particles])
    tracks = track_particles(
        [one.xyz for one in particles], frames=frames, rate=rate or 1.0,
        covariances=[one.covariance * factor for one in particles],
        step=step, change=change, gap=gap, shortest=shortest,
    )  # fmt: skip
    if not tracks.count:
        raise InputError(
            f"{project}: {tracks.particles} particles in {len(frames)} frames, and no track of "
            f"{shortest} points. Do the frames follow each other? Particles of unknown velocity "
            f"were sought within {tracks.step:.3g} {content.unit}: give --step."
        )
    at = tracks.frame - frames[0]
    rows = np.array([particles[t].targets[n] for t, n in zip(at, tracks.number, strict=True)])
    result = TrackedParticles(
        content, tracks, rows, (content.unit, f"{content.unit}/{'s' if rate else 'frame'}"),
        tuple(frames), SIGMA_PIXEL * float(np.sqrt(factor)),
        float(counted.found.sum()), float(counted.chance.sum()),
        (*_lost_files(targets, sequences, frames), *tracks.remarks,
         *tolerance_remarks(first_count, fewer, key)), calibration,
    )  # fmt: skip
    _write(result, particles, out, folder, calibrate, overwrite=overwrite)
    return result


def _sequences(targets: Sequence[Path], names: Sequence[str]) -> list[dict[int, Path | FloatArray]]:
    """Return the `_sequence` of every camera, or refuse another number of them."""
    if len(targets) != len(names):
        raise InputError(
            f"{len(targets)} sequence(s) of targets for {len(names)} cameras: give --targets once "
            f"per camera, in the order {', '.join(names)}."
        )
    return [_sequence(base) for base in targets]


def _sequence(base: Path) -> dict[int, Path | FloatArray]:
    """Return the target files of a camera by frame, or the places in its file of all frames."""
    if base.is_file():
        return dict(read_blobs(base))
    names = {path.name[len(base.name) : -len(ENDING)]: path for path in base.parent.glob("*")
             if path.name.startswith(base.name) and path.name.endswith(ENDING)}  # fmt: skip
    # Numbers may have zeros before them; of two files that without counts.
    ordered = sorted((word for word in names if word.isdecimal()), key=len, reverse=True)
    if not ordered:
        raise InputError(remark("tracks.no_files", of=base, name=base.name, ending=ENDING))
    return {int(word): names[word] for word in ordered}


def _places(source: Path | FloatArray | None) -> FloatArray:
    """Return the targets of a camera in a frame; none where nothing tells of any."""
    if source is None:
        return np.empty((0, 2))
    return read_targets(source).pixels if isinstance(source, Path) else source


def _frames(
    targets: Sequence[Path], sequences: Sequence[dict[int, Path | FloatArray]],
    first: int | None, last: int | None,
) -> range:  # fmt: skip
    """Return the frames in a row that all cameras have, or all but a few of them."""
    frames = [set(sequence) for sequence in sequences]
    common = sorted(set.intersection(*frames))
    chosen = [n for n in common if (first is None or n >= first) and (last is None or n <= last)]
    begin = first if first is not None else (chosen or [0])[0]
    end = last if last is not None else (chosen or [0])[-1]
    # The first that is missing, without a list of all numbers up to --last.
    here = {n for n in set.union(*frames) if sum(n in numbers for numbers in frames) >= 2}
    missing = next((n for n in range(begin, end + 1) if n not in here), None)
    if missing is not None or len(chosen) < 3:
        lack = "too few" if missing is None else f"frame {missing} is not there of every camera"
        raise InputError(
            f"{targets[0]}: {len(chosen)} frames from {begin} to {end}, {lack}. Three or more in a "
            "row are needed, of every camera; choose them by --first and --last."
        )
    return range(begin, end + 1)


def _lost_files(
    targets: Sequence[Path], sequences: Sequence[Container[int]], frames: Sequence[int]
) -> list[str]:
    """Say which files are taken for frames without targets.

    A file of blobs has no line for a frame without any: that is no loss.
    """
    names = [
        f"{base.name}{frame}{ENDING}"
        for frame in frames
        for base, sequence in zip(targets, sequences, strict=True)
        if frame not in sequence and not base.is_file()
    ]
    shown = ", ".join(names[:3]) + (" ..." if len(names) > 3 else "")
    return [remark("tracks.lost", count=len(names), names=shown)] if names else []


def _tried_frames(count: int, most: int = TESTED) -> list[int]:
    """Return the numbers of some frames of so many, from the first to the last."""
    return np.unique(np.linspace(0, count - 1, most).astype(int)).tolist()


def _beyond_chance(
    project: Path, content: Project, tried: list[list[FloatArray]], tolerance: float, fewest: int
) -> ChanceCounts:
    """Return what is found in some frames, and how much by chance; refuse what is chance."""
    counted = chance_counts(content, tried, tolerance, fewest)
    found, chance = counted.found, counted.chance
    if counted.is_chance:
        raise InputError(
            f"{project}: {found.sum():.0f} particles would be found in {TESTED} frames, and "
            f"{chance.sum():.0f} where the targets of the cameras have nothing to do with each "
            "other: these are chance. Are the targets in the order of the cameras "
            f"{', '.join(content.camera_names)}? Do the cameras fit them (`multimedia adjust`)? "
            "Fewer come by chance with a smaller --tolerance."
        )
    return counted


def _particles(
    content: Project, places: list[FloatArray], tolerance: float, fewest: int
) -> _ParticlesOfFrame:
    """Return the particles of a frame, intersected rigorously."""
    cameras, media = content.cameras, content.interfaces
    _, numbers, _ = correspondences(cameras, places, media, tolerance=tolerance, fewest=fewest)
    image = np.full((len(cameras), len(numbers), 2), np.nan)
    for k, (camera, positions) in enumerate(zip(cameras, places, strict=True)):
        visible = numbers[:, k] >= 0
        image[k, visible] = camera.described_sensor().image_from_pixel(
            positions[numbers[visible, k]]
        )
    points = intersect(cameras, image, list(media))
    good = np.isfinite(points.xyz).all(axis=1)
    rays = points.rays[good]
    # Of each point's own variance factor, that which is the median of an honest one's.
    share = chi2.ppf(0.5, 2 * rays - 3) / (2 * rays - 3)
    return _ParticlesOfFrame(
        points.xyz[good], points.covariance[good], numbers[good], points.sigma0[good] ** 2 / share
    )


def _median_factor(factors: Sequence[FloatArray]) -> float:
    """Return the variance factor of all points; 1 where there is none."""
    values = np.concatenate(list(factors)) if factors else np.empty(0)
    return float(np.median(values)) if len(values) else 1.0


def _write(
    result: TrackedParticles, particles: Sequence[_ParticlesOfFrame], out: Path | None,
    folder: Path | None, calibrate: Path | None, *, overwrite: bool,
) -> None:  # fmt: skip
    content = result.project
    with all_or_none():
        if calibrate is not None:
            write_project(calibrate, content, overwrite=overwrite)
        if out is not None:
            write_tracks(
                out, result.tracks, result.targets, content.camera_names, result.units,
                overwrite=overwrite,
            )  # fmt: skip
        if folder is not None:
            factor = METRES[content.unit] / METRES["mm"]
            texts = openptv_files(
                result.tracks, result.frames, [one.xyz * factor for one in particles],
                [one.targets for one in particles],
            )  # fmt: skip
            with atomic_folder(folder, overwrite=overwrite) as temporary:
                for name, text in texts.items():
                    (temporary / name).write_text(text, encoding="utf-8")
