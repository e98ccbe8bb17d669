"""Projects of other programs in and out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from multimedia.exchange.aquacal_calibration import is_aquacal, read_aquacal, write_aquacal
from multimedia.exchange.colmap_model import read_colmap, write_colmap
from multimedia.exchange.metashape_project import read_metashape, write_metashape
from multimedia.exchange.opencv_calibration import read_opencv, write_opencv
from multimedia.exchange.opencv_camera import PITCH
from multimedia.exchange.ptv_calibrations import is_ptv_calibration, read_ptv_calibration
from multimedia.projects import Project, read_project, write_project
from multimedia.remarks import remark
from photocore.errors import InputError
from photocore.jsonfile import read_object
from photocore.output import check_not_input
from photocore.programs import is_colmap
from photocore.textfile import check_name, read_text

_WRITERS: Mapping[str, Callable[..., tuple[str, ...]]] = {
    "colmap": write_colmap,
    "metashape": write_metashape,
    "opencv": write_opencv,
    "aquacal": write_aquacal,
}
FORMATS = tuple(_WRITERS)
_BY_ENDING = {"": "colmap", ".xml": "metashape", ".yml": "opencv", ".yaml": "opencv"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """What was read and written.

    Attributes
    ----------
    project : Project
        As read.
    source, target : str
        Format of the input and of the output; ``project`` for our own.
    remarks : tuple of str
        What the user should be told.
    """

    project: Project
    source: str
    target: str
    remarks: tuple[str, ...]


def convert(
    source: Path,
    target: Path,
    *,
    form: str | None = None,
    pixel_size: float = PITCH,
    unit: str = "m",
    overwrite: bool = False,
) -> Conversion:
    """Read a project of any known program and write it as another's.

    Parameters
    ----------
    source : path
        Project file (.toml); folder of a COLMAP text model; Metashape's cameras (.xml); OpenCV's
        calibration (.yml, .json, .xml) or a folder of them; AquaCal's calibration (.json); folder
        with the cameras and control points of MyPTV, proPTV or OpenLPT.
    target : path
        .toml for a project file; otherwise ``form`` or the ending tells the format.
    form : str, optional
        One of `FORMATS`; None: by the ending of the target, none being COLMAP's.
    pixel_size : float
        Width of a pixel, which the other programs do not know. [mm]
    unit : str
        Of their lengths, where they do not say.
    overwrite : bool
        Whether existing files may be replaced.

    Returns
    -------
    Conversion
        What was read, what was written, and what could not be kept.

    Raises
    ------
    InputError
        Naming file and place of what cannot be read, or what the target cannot hold.
    """
    check_not_input(target, source)
    if form is not None and target.suffix.lower() == ".toml":
        raise InputError(remark("exchange.project_name", of=target, form=form))
    format_name = "project" if target.suffix.lower() == ".toml" else form
    if format_name is None:
        format_name = _BY_ENDING.get(target.suffix.lower())
    if format_name is None:
        raise InputError(remark("exchange.name_the_format", of=target, formats=", ".join(FORMATS)))
    kind, project = read_any(source, pitch=pixel_size, unit=unit)
    if format_name == "project":
        write_project(target, project, overwrite=overwrite)
        notes: tuple[str, ...] = ()
    else:
        notes = _WRITERS[format_name](target, project, overwrite=overwrite)
    return Conversion(
        project=project, source=kind, target=format_name, remarks=(*project.remarks, *notes)
    )


def read_any(path: Path, *, pitch: float = PITCH, unit: str = "m") -> tuple[str, Project]:
    """Return the format and the project of a file or folder of any known program.

    Raises
    ------
    InputError
        If it is of none of them.
    """
    check_name(path)
    ending = path.suffix.lower()
    if path.is_dir():
        if is_colmap(path):
            return "colmap", read_colmap(path, pitch=pitch, unit=unit)
        if (path / "cameras.bin").is_file():
            raise InputError(remark("exchange.binary_colmap", of=path))
        if is_ptv_calibration(path):
            return "particle tracker", read_ptv_calibration(path, pitch=pitch, unit=unit)
        return "opencv", read_opencv(path, pitch=pitch, unit=unit)
    if ending == ".toml":
        return "project", read_project(path)
    if ending == ".txt" and is_colmap(path.parent):
        return "colmap", read_colmap(path.parent, pitch=pitch, unit=unit)
    if ending == ".json":
        if is_aquacal(read_object(path, what="calibration")):
            return "aquacal", read_aquacal(path, pitch=pitch)
        return "opencv", read_opencv(path, pitch=pitch, unit=unit)
    if ending == ".xml" and "opencv_storage" not in read_text(path, "calibration")[:500]:
        return "metashape", read_metashape(path, pitch=pitch, unit=unit)
    if ending in (".xml", ".yml", ".yaml"):
        return "opencv", read_opencv(path, pitch=pitch, unit=unit)
    raise InputError(remark("exchange.unknown_source", of=path))
