"""Particles of one frame: targets of all cameras in, positions and who saw them out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from multimedia.openptv.chance_counts import chance_counts, narrower_counts, tolerance_remarks
from multimedia.openptv.correspondences import TOLERANCE, correspondences
from multimedia.openptv.openptv_files import read_targets, rt_is_text
from multimedia.projects import METRES, Project, read_project, write_columns
from photocore.arrays import FloatArray, IntArray
from photocore.errors import InputError
from photocore.output import atomic_path, check_all_writable, check_not_input
from photocore.tables.csvwrite import Columns


@dataclass(frozen=True, slots=True, eq=False)
class Particles:
    """Particles of one frame.

    Attributes
    ----------
    project : Project
        Whose cameras saw them.
    xyz : ndarray, shape (p, 3)
        [unit of the project]
    numbers : ndarray of int, shape (p, cameras)
        Rows of the targets, from 0; -1 where a camera did not see the particle.
    misfit : ndarray, shape (p,)
        Root mean square distance of its targets from where it is seen. [px]
    targets : tuple of int
        Targets of each camera.
    seen_by, chance : ndarray, shape (cameras + 1,)
        Particles by the number of cameras that saw them, and how many at most come by chance.
    remarks : tuple of str
        A tolerance that would do.
    """

    project: Project
    xyz: FloatArray
    numbers: IntArray
    misfit: FloatArray
    targets: tuple[int, ...]
    seen_by: FloatArray
    chance: FloatArray
    remarks: tuple[str, ...] = ()


def find_particles(
    project: Path,
    targets: Sequence[Path],
    *,
    out: Path | None = None,
    tolerance: float = TOLERANCE,
    fewest: int = 3,
    overwrite: bool = False,
) -> Particles:
    """Find the particles of a frame by the epipolar geometry through the media.

    Parameters
    ----------
    project : path
        Project file with oriented cameras.
    targets : sequence of path
        The ``_targets`` file of each camera, in the order of the project.
    out : path, optional
        ``rt_is.FRAME`` as OpenPTV reads it, in mm; or a table, .csv or .xlsx.
    tolerance : float
        Farthest that a target may lie from where its particle is seen. [px]
    fewest : int
        Cameras that must have seen a particle.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If what is found cannot be told from chance.
    """
    if out is not None:
        check_all_writable(out, overwrite=overwrite)
        check_not_input(out, project, *targets)
        if not out.name.startswith("rt_is") and out.suffix.lower() not in (".csv", ".xlsx"):
            raise InputError(
                f"{out}: particles are written as rt_is.FRAME, or as a table .csv or .xlsx."
            )
    content = read_project(project)
    names = content.camera_names
    if len(targets) != len(names):
        raise InputError(
            f"{len(targets)} file(s) of targets for {len(names)} cameras: give --targets once per "
            f"camera, in the order {', '.join(names)}."
        )
    places = [read_targets(path).pixels for path in targets]
    frame: Any = (content.cameras, places, content.interfaces)
    xyz, numbers, misfit = correspondences(*frame, tolerance=tolerance, fewest=fewest)
    counted = chance_counts(content, [places], tolerance, fewest)
    chance = counted.chance
    if counted.is_chance:
        raise InputError(
            f"{project}: {len(xyz)} particles would be found, and {chance.sum():.0f} where the "
            "targets of the cameras have nothing to do with each other: these are chance. Are the "
            f"targets of one frame, in the order {', '.join(names)}? Do the cameras fit them "
            "(`multimedia adjust`)? Fewer come by chance with a smaller --tolerance"
            + (f" or --fewest {len(names)}." if fewest < len(names) else ".")
        )
    notes = tolerance_remarks(counted, narrower_counts(content, [places], counted, fewest))
    counts = tuple(map(len, places))
    particles = Particles(content, xyz, numbers, misfit, counts, counted.found, chance, notes)
    if out is not None:
        _write(out, particles, overwrite=overwrite)
    return particles


def _write(out: Path, particles: Particles, *, overwrite: bool) -> None:
    unit, names = particles.project.unit, particles.project.camera_names
    if out.name.startswith("rt_is"):
        with atomic_path(out, overwrite=overwrite) as temporary:
            factor = METRES[unit] / METRES["mm"]
            temporary.write_text(
                rt_is_text(particles.xyz * factor, particles.numbers), encoding="utf-8"
            )
        return
    columns: Columns = {"id": [str(k) for k in range(1, len(particles.xyz) + 1)]}
    columns |= {f"{axis} [{unit}]": particles.xyz[:, k] for k, axis in enumerate("XYZ")}
    columns |= {
        f"{name} target": [str(n) if n >= 0 else "" for n in particles.numbers[:, k].tolist()]
        for k, name in enumerate(names)
    }
    columns["misfit [px]"] = particles.misfit
    write_columns(out, columns, overwrite=overwrite)
