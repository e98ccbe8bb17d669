"""A finished project of another program in, a set of photos out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath

import numpy as np

from bifocal.model import NO_UNIT, TURNS, Lens, Pair, Photo, PhotoSet, lens_of_photo
from bifocal.projects.project_points import chosen, read_points, sparse_points
from bifocal.projects.scale import by_control, of_cameras
from bifocal.projects.wall_frame import (
    ProjectWall,
    beside,
    framed,
    turned_by_lines,
    walls_of,
)
from bifocal.projects.wall_pictures import squared, write_wall_pictures
from bifocal.remarks import remark
from photocore.arrays import ByteArray, FloatArray
from photocore.camera import LensData, Pinhole, Similarity, plane_from_pixel, project
from photocore.errors import InputError
from photocore.images import image_info
from photocore.output import all_or_none, check_not_input, check_writable, relative_name
from photocore.programs import ForeignProject, ForeignView, PhotoFinder, read_foreign_project

#: Length of a unit that a project may be in. [m]
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
#: Points of a wall whose spread across their line is a smaller share say nothing of its plane.
NARROWEST = 0.05
#: Of the wall's points, what a photo must show to belong to the set.
LEAST_SHARE = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectOptions:
    """What is known of a project beside its files.

    Attributes
    ----------
    images : path, optional
        Folder of the photos.  [default: searched about the project]
    cloud : path, optional
        Points in the project's frame, where it has none.
    points : path, optional
        Table of named points: id, photo, col, row; or id, x, y, z.
    wall : tuple of str
        Names of three points of the wall or more, or the number of one of the project's walls;
        none: the largest façade.
    horizontal : tuple of str
        Names of two points on a level line.
    control : path, optional
        Table id, X, Y, r: frame and scale.
    length : tuple of str
        Names of two points and the metres between them.
    sigma_length, sigma_control : float
        Standard deviations. [m]
    unit : str, optional
        Of the project's lengths, a key of `UNITS`.
    part : str, optional
        Which of the project's models, chunks, components.  [default: the largest]
    """

    images: Path | None = None
    cloud: Path | None = None
    points: Path | None = None
    wall: tuple[str, ...] = ()
    horizontal: tuple[str, ...] = ()
    control: Path | None = None
    length: tuple[str, ...] = ()
    sigma_length: float = 0.003
    sigma_control: float = 0.003
    unit: str | None = None
    part: str | None = None

    def __post_init__(self) -> None:
        if len(self.wall) in (1, 2) and not self.number:
            raise InputError(f"--wall: three points or more, found {len(self.wall)}.")
        if self.horizontal and len(self.horizontal) != 2:
            raise InputError(f"--horizontal: two points, found {len(self.horizontal)}.")
        if self.control and (self.length or self.wall or self.horizontal or self.unit):
            raise InputError(remark("projects.control_alone"))
        if self.length and self.unit:
            raise InputError("--length and --unit: both give the scale; leave one out.")
        for option in ("wall", "horizontal", "control", "length"):
            named = getattr(self, option) if option != "wall" or not self.number else ()
            if named and self.points is None:
                raise InputError(f"--{option}: needs --points, the table of the points it names.")

    @property
    def number(self) -> int:
        """Which of the project's walls is asked for by its number; 0: none."""
        return int(self.wall[0]) if len(self.wall) == 1 and self.wall[0].isdecimal() else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectPhotos:
    """A set made from a project.

    Attributes
    ----------
    photos : PhotoSet
    program : str
        Whose project it was.
    scale : str
        What makes its lengths metres.
    walls : tuple of str
        The façades among the project's points with size and share, the largest first, where one
        was looked for; their picture is beside the set where there are several.
    remarks : tuple of str
        What the user should be told.
    """

    photos: PhotoSet
    program: str
    scale: str
    walls: tuple[str, ...]
    remarks: tuple[str, ...]


def photos_from_project(
    project: Path | str,
    out: Path | str,
    options: ProjectOptions | None = None,
    *,
    overwrite: bool = False,
) -> ProjectPhotos:
    """Make a set of photos of a wall from another program's project, and write its file.

    Parameters
    ----------
    project : path
        File or folder of COLMAP, Metashape, OpenSfM or OpenDroneMap, AliceVision or Meshroom,
        OpenMVG, Bundler, RealityCapture or RealityScan, VisualSFM, NeRF.
    out : path
        File of the set, or ``*.pair.json`` for the two photos that promise the best relief; lens
        files are written beside it.
    options : ProjectOptions, optional
        What is known beside the project.
    overwrite : bool
        Whether files that exist may be replaced.

    Returns
    -------
    ProjectPhotos
        The set, what gave its scale, and what to say of it.

    Raises
    ------
    InputError, GeometryError
        Naming what in the project cannot be used, or what is needed beside it.
    """
    project, out, options = Path(project), Path(out), options or ProjectOptions()
    check_not_input(out, project, options.points, options.control)
    check_writable(out, overwrite=overwrite)
    finder = PhotoFinder(project, options.images)
    read = read_foreign_project(project, finder, options.part)
    files = {view.name: finder.find(view.name) for view in read.views}
    names: dict[Path, str] = {}
    for name, file in files.items():
        if file and (first := names.setdefault(file, name)) != name:
            raise InputError(remark("projects.one_file", first=first, second=name, of=file))
    upright = [_upright(view, files[view.name]) for view in read.views]
    read = read._replace(views=tuple(upright))
    frame, wall, covariance, scale, said, walls = _frame(read, options)
    views, left = _of_the_wall(read.views, frame, wall)
    if left:
        said.append(remark("projects.left_out", count=len(left), names=", ".join(left[:5])))
    if len(views) < 2:
        raise InputError(
            f"{project}: {len(views)} of {len(read.views)} photos show the wall from its front; "
            "two are needed. Name three points of the wall with --points and --wall."
        )
    frame, turned = _upright_frame(frame, views, files, read, options)
    said += turned
    if options.number > 1:
        largest = replace(walls[0].frame, scale=frame.scale)
        of_largest = _of_the_wall(read.views, largest, walls[0].points)[0]
        as_held = replace(options, horizontal=())
        frame = beside(_upright_frame(largest, of_largest, files, read, as_held)[0], frame)
    doubts = [remark("projects.no_precision")]
    unit = {} if scale else {"unit": NO_UNIT}
    if not scale:
        scale = remark("projects.no_scale")
        doubts.insert(0, scale)
    with all_or_none():
        photos = _photos(views, frame, files, out, overwrite=overwrite)
        missing = [one.file for one in photos if not (out.parent / one.file).is_file()]
        if missing:
            about = {"count": len(missing), "names": ", ".join(missing[:5])}
            said.append(remark("projects.no_photos", **about))
        setup = {"way": f"project of {read.program}", "scale": scale, "doubts": doubts}
        centres = [np.array([*photo.nadir, photo.distance]) for photo in photos]
        made = PhotoSet(
            photos=tuple(photos), folder=out.parent, extra={"setup": setup, **unit},
            orientation=of_cameras(centres, covariance) if covariance.any() else None,
        )  # fmt: skip
        written: PhotoSet | Pair = made
        if out.name.endswith(".pair.json"):
            if not (ranked := made.pairs()):
                raise InputError(f"{out}: no two photos of the wall tell its relief; write a set.")
            written = made.pair(ranked[0].far, ranked[0].near)
        written.write(out, overwrite=overwrite)
        listed = _listed(walls, frame.scale, " m" if not unit else "")
        if len(walls) > 1:
            picture = out.with_name(f"{_stem(out)}.walls.jpg")
            write_wall_pictures(picture, walls, listed, read.views, files, overwrite=overwrite)
    return ProjectPhotos(
        photos=made, program=read.program, scale=scale, walls=listed,
        remarks=(*read.remarks, *said, *doubts),
    )  # fmt: skip


def project_walls(project: Path) -> list[tuple[str, ByteArray]]:
    """Return the façades of another program's project in words, and their pictures square on.

    Their order is that of `ProjectOptions.number`, from 1.

    Raises
    ------
    InputError
        If it is no project known here, cannot be used, or has no points or façade.
    """
    finder = PhotoFinder(project)
    read = read_foreign_project(project, finder)
    walls = walls_of(read, sparse_points(read, None))
    files = {view.name: finder.find(view.name) for view in read.views}
    words = _listed(walls, 1.0, " m" if read.metres else "")
    return [
        (text, squared(wall, read.views, files)) for text, wall in zip(words, walls, strict=True)
    ]


def _listed(walls: Sequence[ProjectWall], scale: float, unit: str) -> tuple[str, ...]:
    """Return each wall's number, size and share in words."""
    lines = []
    for number, wall in enumerate(walls, start=1):
        left, lower, right, upper = wall.bounds
        width, height = (float(f"{scale * side:.2g}") for side in (right - left, upper - lower))
        about = {"number": number, "count": len(walls), "share": 100 * wall.share}
        lines.append(remark("projects.wall", width=width, height=height, unit=unit, **about))
    return tuple(lines)


def _stem(out: Path) -> str:
    return re.sub(r"(\.photos|\.pair)?\.json$", "", out.name)


def _upright_frame(
    frame: Similarity, views: Sequence[ForeignView], files: Mapping[str, Path | None],
    project: ForeignProject, options: ProjectOptions,
) -> tuple[Similarity, list[str]]:  # fmt: skip
    """Return the frame turned by the façade's lines where nothing else tells what is upright."""
    if options.horizontal or options.control or project.metres:
        return frame, []
    seen = [(_camera(view, frame), Lens(**view.lens._asdict()), path)
            for view in views if (path := files[view.name])]  # fmt: skip
    return turned_by_lines(frame, seen)


def _frame(
    project: ForeignProject, options: ProjectOptions
) -> tuple[Similarity, FloatArray, FloatArray, str, list[str], list[ProjectWall]]:
    """Return the wall's frame, points of it, the frame's covariance, its scale, what to say, walls.

    Walls where one of the project's is taken.
    """
    named = {} if options.points is None else read_points(options.points, project.views)
    if options.control is not None:
        frame, covariance, fits = by_control(
            named, options.control, options.sigma_control, project.views
        )
        places = np.array(list(named.values()))
        return frame, places, covariance, remark("projects.by_control"), [fits], []
    points = sparse_points(project, options.cloud)
    remarks: list[str] = []
    walls: list[ProjectWall] = []
    level = chosen(named, options.horizontal, "--horizontal") if options.horizontal else None
    if options.wall and not options.number:
        points = chosen(named, options.wall, "--wall")
        middle = points.mean(axis=0)
        _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
        if spread[1] <= NARROWEST * spread[0]:
            raise InputError("--wall: its points lie nearly on one line; add one well beside it.")
        frame = framed(project, axes[2], points, level)
    else:
        walls = walls_of(project, points)
        if options.number > len(walls):
            raise InputError(f"--wall {options.number}: {len(walls)} walls are found.")
        wall = walls[max(options.number, 1) - 1]
        frame, points = wall.frame, wall.points
        if level is not None:
            frame = framed(project, frame.rotation[2], points, level)
        if not options.number:
            remarks.append(remark("projects.found", share=100 * wall.share))
    covariance, scale = np.zeros((7, 7)), ""
    if options.length:
        *ends, metres = options.length
        length = _metres(metres, ends)
        one, other = chosen(named, tuple(ends), "--length")
        if not (apart := float(np.linalg.norm(other - one))):
            raise InputError(
                f"--length: {ends[0]} and {ends[1]} are one place in {options.points}."
            )
        frame = replace(frame, scale=length / apart)
        covariance[6, 6] = (options.sigma_length / length) ** 2
        scale = remark("projects.by_length", ends=" - ".join(ends), length=length)
    elif options.unit:
        frame = replace(frame, scale=UNITS[options.unit])
        scale = remark("projects.by_unit", unit=options.unit)
    elif project.metres:
        scale = remark("projects.by_project", by=project.metres)
    return frame, points, covariance, scale, remarks, walls


def _metres(text: str, ends: Sequence[str]) -> float:
    try:
        length = float(text)
    except ValueError:
        length = 0.0
    if len(ends) != 2 or not 0 < length < 1e5 or ends[0] == ends[1]:
        raise InputError("--length: expected two names and metres above zero, e.g. A,B,4.20.")
    return length


def _of_the_wall(
    views: Sequence[ForeignView], frame: Similarity, wall: FloatArray
) -> tuple[list[ForeignView], list[str]]:
    """Return the photos that show the wall from its front, and the names of the others."""
    placed, left, places = [], [], frame(wall)
    for view in views:
        camera = _camera(view, frame)
        size = np.array(view.lens.image_size)
        inside = 0
        if camera.centre[2] > 0 and camera.rotation[2, 2] < 0:
            pixels = project(camera, places)
            inside = int(((pixels > -0.5) & (pixels < size - 0.5)).all(axis=1).sum())
        if inside >= max(1.0, LEAST_SHARE * len(places)):
            placed.append(view)
        else:
            left.append(PurePath(view.name).name)
    return placed, left


def _camera(view: ForeignView, frame: Similarity) -> Pinhole:
    return view.camera.carried(frame)


def _photos(
    views: Sequence[ForeignView], frame: Similarity, files: Mapping[str, Path | None], out: Path, *,
    overwrite: bool,
) -> list[Photo]:  # fmt: skip
    """Return the photos in the wall's frame; write their lenses beside the set."""
    stem = _stem(out)
    written: dict[tuple[object, ...], tuple[Lens, str]] = {}
    photos = []
    for view in views:
        lens, path = Lens(**view.lens._asdict()), files[view.name]
        key = (lens.camera_matrix.tobytes(), lens.coefficients.tobytes(), lens.image_size)
        name = ""
        if lens.coefficients.any() or lens.model == "fisheye":
            if key not in written:
                name = f"{stem}.lens{len(written) + 1}.json"
                lens.write(out.with_name(name), overwrite=overwrite)
                written[key] = lens, name
            lens, name = written[key]
        camera = _camera(view, frame)
        photos.append(
            Photo(
                plane_from_pixel=plane_from_pixel(camera),
                nadir=camera.centre[:2],
                distance=float(camera.centre[2]),
                file=relative_name(path, out.parent) if path else PurePath(view.name).name,
                lens=lens if name else None,
                image_size=lens.image_size,
                extra={"lens": name} if name else {},
            )
        )
    return photos


def _upright(view: ForeignView, path: Path | None) -> ForeignView:
    """Return a photo as its file shows it, turned upright as its EXIF data say.

    Other programs leave that out of account: the size that they state tells.

    Raises
    ------
    InputError
        If it is of another size, or turned so that its size does not tell.
    """
    if path is None:
        return view
    info, size = image_info(path), tuple(map(int, view.lens.image_size))
    orientations = (1,) if size[0] == size[1] else (1, 6, 8)
    if info.size == size and info.orientation in orientations:
        return view
    if info.orientation in orientations[1:] and info.size == size[::-1]:
        lens = lens_of_photo(Lens(**view.lens._asdict()), info.size, orientation=info.orientation)
        rotation, turn = view.rotation.copy(), np.array(TURNS[info.orientation])
        rotation[:2], shear = turn @ rotation[:2], turn @ view.shear @ turn.T
        turned = LensData(*(getattr(lens, name) for name in LensData._fields))
        return view._replace(lens=turned, rotation=rotation, shear=shear)
    hint = f", turned by its EXIF data ({info.orientation})" if info.orientation != 1 else ""
    raise InputError(
        f"{path}: is {info.size[0]} x {info.size[1]} px{hint}, its project says {size[0]:g} x "
        f"{size[1]:g} px. Name the folder of the photos that were processed with --images; save "
        "turned ones upright and process them there again."
    )
