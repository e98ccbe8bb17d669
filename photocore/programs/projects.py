"""A finished project of any program that is known."""

from __future__ import annotations

from pathlib import Path

from photocore.errors import InputError
from photocore.programs.alicevision import read_alicevision, read_openmvg
from photocore.programs.bundler import read_bundler
from photocore.programs.colmap import count_images, is_colmap, read_colmap_project
from photocore.programs.json_values import JsonValue
from photocore.programs.metashape import read_metashape_project
from photocore.programs.model import ForeignProject, chosen_part
from photocore.programs.nerf import read_nerf
from photocore.programs.opensfm import read_opensfm
from photocore.programs.photos import PhotoFinder
from photocore.programs.realitycapture import holds_xmp, read_reality_table, read_reality_xmp
from photocore.programs.visualsfm import read_visualsfm
from photocore.textfile import check_file, check_name

#: Where programs leave their results below a project's folder.
_PLACES = (
    ".", "sparse", "reconstruction.json", "opensfm/reconstruction.json",
    "sfm_data.json", "cameras.sfm", "sfm.sfm", "bundle.out", "bundle/bundle.out",
    "transforms.json",
)  # fmt: skip
_KNOWN = (
    "COLMAP (cameras.txt or .bin, images, points3D), Metashape (cameras as .xml), OpenSfM or "
    "OpenDroneMap (reconstruction.json), AliceVision or Meshroom (.sfm), OpenMVG (sfm_data.json), "
    "Bundler (bundle.out), RealityCapture or RealityScan (XMP or CSV), VisualSFM (.nvm), NeRF "
    "(transforms.json)"
)
#: What to do with a program's own files that only it can read.
_EXPORT = {
    ".abc": "In Meshroom, add a ConvertSfMFormat node with the format sfm.",
    ".psx": "In Metashape, File, Export, Export Cameras, Agisoft XML.",
    ".psz": "In Metashape, File, Export, Export Cameras, Agisoft XML.",
}


def read_foreign_project(
    path: Path, photos: PhotoFinder, part: str | None = None
) -> ForeignProject:
    """Return cameras and points of a project, told by its name and content.

    Parameters
    ----------
    path : path
        File or folder.
    photos : PhotoFinder
        Of this project.
    part : str, optional
        Which of its models, chunks, components.  [default: the largest]

    Raises
    ------
    InputError
        If it is of no program known here, or naming what in it cannot be used.
    """
    check_name(path)
    if path.is_dir():
        if models := _models(path):
            name, remarks = chosen_part(
                {name: count_images(place) for name, place in models.items()}, part, path
            )
            return read_colmap_project(models[name])._replace(remarks=remarks)
        places = [*map(path.joinpath, _PLACES), *sorted(path.glob("*.nvm"))]
        found = [place for place in places if _is_model(place)]
        if not found and (caches := _meshroom(path)):
            sizes = {name: count for name, (_, count) in caches.items()}
            name, remarks = chosen_part(sizes, part, path)
            read = read_alicevision(caches[name][0], JsonValue.read(caches[name][0]))
            return read._replace(remarks=(*remarks, *read.remarks))
        if not found and holds_xmp(path):
            return read_reality_xmp(path, photos)
        if not found:
            raise InputError(f"{path}: holds no project known here: {_KNOWN}.")
        path = found[0]
    if path.is_dir():
        return read_colmap_project(path)
    ending = path.suffix.lower()
    if ending == ".mg" and _meshroom(path.parent):
        return read_foreign_project(path.parent, photos, part)
    check_file(path, "project")
    if ending in (".txt", ".bin") and (is_colmap(path.parent) or is_colmap(path.parent, ".bin")):
        return read_colmap_project(path.parent)
    if ending == ".xml":
        return read_metashape_project(path, part)
    if ending == ".nvm":
        return read_visualsfm(path, photos, part)
    if ending == ".xmp":
        return read_reality_xmp(path.parent, photos)
    if ending == ".csv":
        return read_reality_table(path, photos)
    if ending == ".out":
        return read_bundler(path, photos.size)
    if ending in (".json", ".sfm"):
        value = JsonValue.read(path)
        if isinstance(value.value, list):
            return read_opensfm(path, value, part)
        if "sfm_data_version" in value or "extrinsics" in value:
            return read_openmvg(path, value)
        if "frames" in value:
            return read_nerf(path, value, photos)
        if "views" in value:
            return read_alicevision(path, value)
    raise InputError(f"{path}: is no project known here: {_EXPORT.get(ending, _KNOWN + '.')}")


def _models(path: Path) -> dict[str, Path]:
    """Return the numbered models of a COLMAP project's folder."""
    folder = path / "sparse" if (path / "sparse").is_dir() else path
    return {
        place.relative_to(path).as_posix(): place
        for place in sorted(folder.iterdir())
        if place.name.isdigit() and (is_colmap(place) or is_colmap(place, ".bin"))
    }


def _meshroom(path: Path) -> dict[str, tuple[Path, int]]:
    """Return the scenes with poses in Meshroom's cache, the newest first, and their counts."""
    cache = path / "MeshroomCache" if (path / "MeshroomCache").is_dir() else path
    places = sorted(cache.glob("*/*/*.sfm"), key=lambda place: -place.stat().st_mtime_ns)
    counts = {
        place.parent.relative_to(cache).as_posix(): (
            place, len(list(JsonValue.read(place).get("poses", []).each()))
        )
        for place in places
    }  # fmt: skip
    return {name: held for name, held in counts.items() if held[1]}


def _is_model(place: Path) -> bool:
    return place.is_file() or is_colmap(place) or is_colmap(place, ".bin")
