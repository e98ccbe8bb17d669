"""One photo alone, to scale on the plane of its wall, with what relief does to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bifocal.model import (
    FARTHEST_WALL,
    Bounds,
    FlatSurface,
    Grid,
    Interior,
    PhotoAlone,
    Points,
    as_grey,
    as_photo,
)
from bifocal.orientation import (
    CONTROL,
    Control,
    KnownLens,
    OrientedPhoto,
    check_inside,
    interior_of_photo,
    one_photo,
    read_control,
)
from bifocal.orthophotos import (
    DeliverTask,
    Delivery,
    Orthophoto,
    OrthoTask,
    RasterResult,
    deliver,
    make_ortho,
    orthophoto,
    planned_grid,
)
from bifocal.remarks import in_language, remark
from photocore.adjustment import OUTLIER_LIMIT
from photocore.arrays import FloatArray, as_points
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.images import image_info, read_image
from photocore.output import check_not_input

#: A line of a drawing. [m on paper]
LINE = 0.00018
#: A picture is doubted where it is less certain than this share of its size.
UNCERTAIN = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rectification:
    """One photo on the plane of its wall.

    Attributes
    ----------
    ortho : Orthophoto or RasterResult
        The picture: in memory, or its file.
    photo : OrientedPhoto
        Camera, covariance, and each control point held against all others.
    bound : tuple of float
        By how much what stands out is displaced at worst, and the standard deviation of that. [m]
    words : tuple of str
        What relief does first, then how precise the plane is.
    remarks : tuple of str
    delivery : Delivery, optional
        Files written into a folder.
    """

    ortho: Orthophoto | RasterResult
    photo: OrientedPhoto
    bound: tuple[float, float]
    words: tuple[str, ...]
    remarks: tuple[str, ...]
    delivery: Delivery | None = None

    def to_dict(self) -> dict[str, object]:
        """Return it for ``--json``."""
        photo, points = self.photo, ("id", "error", "sigma", "test")
        left_out = zip(photo.ids, photo.left_out, photo.sigma_left_out, photo.test, strict=True)
        picture = self.ortho.to_dict() if isinstance(self.ortho, RasterResult) else {}
        return picture | {
            "displacement": {"most": self.bound[0], "sigma": self.bound[1]},
            "distance": photo.camera.centre[2],
            "nadir": photo.camera.centre[:2],
            "focal_px": photo.camera.matrix[0, 0],
            "sigma0": photo.sigma0,
            "left_out": [dict(zip(points, row, strict=True)) for row in left_out],
            "words": self.words,
            "remarks": self.remarks,
        }


def rectify(
    image: NDArray[np.generic],
    *,
    control: Control | None = None,
    rectangle: tuple[tuple[float, float], ArrayLike] | None = None,
    length: tuple[ArrayLike, float] | None = None,
    interior: Interior | None = None,
    sigma_pick: float = 0.5,
    sigma_control: float = 0.003,
    stands_out: float = 0.2,
    gsd: float | None = None,
    bounds: Bounds | None = None,
) -> Rectification:
    """Return one photo to scale on the plane of its wall, with what relief does to it.

    Parameters
    ----------
    image : ndarray of uint8 or uint16, shape (height, width[, 3])
        As taken, upright.
    control : Control, optional
        Four points of the wall or more; ``pixels1`` are their picks.
    rectangle : ((float, float), array_like of shape (4, 2)), optional
        Instead: width and height of a rectangle of the wall [m], and its corners in the photo, from
        the upper left one clockwise [px].
    length : (array_like of shape (2, 2), float), optional
        Instead: two pixels of the wall and the metres between them; the façade's upright and level
        lines tell the rest. The first pixel becomes X = Y = 0.
    interior : Interior, optional
        What is known of the lens.
    sigma_pick : float
        Precision of a pick. [px]
    sigma_control : float
        That of the rectangle's sides and of the length. [m]
    stands_out : float
        Relief whose displacement is told; negative: lies back. [m]
    gsd : float, optional
        Pixel of the orthophoto. [m]
    bounds : tuple of float, optional
        Part of the wall. [m]

    Returns
    -------
    Rectification
        ``.ortho`` is an `Orthophoto`.

    Raises
    ------
    InputError, GeometryError
        If image or points are unusable, or do not fit; a slip is named.

    Examples
    --------
    A photo square to the wall, 10 mm a pixel, on which a rectangle of 3 x 2 m was picked:

    >>> photo = np.zeros((301, 401), np.uint8)
    >>> lens = Interior.from_focal(1200, image_size=(401, 301), sigma=1e-3, source="board")
    >>> picks = [[50, 50], [350, 50], [350, 250], [50, 250]]
    >>> done = rectify(photo, rectangle=((3, 2), picks), interior=lens)
    >>> round(done.ortho.gsd, 5), round(float(done.photo.camera.centre[2]), 2)
    (0.01, 12.0)
    """
    height, width = as_photo(image).shape[:2]
    interior = interior or Interior.unknown((width, height))
    if interior.image_size != (width, height):
        raise InputError(f"image: is {width} x {height} px, its interior is of another size.")
    photo = _oriented(
        lambda: image, interior, control=control, rectangle=rectangle, length=length,
        sigma_pick=sigma_pick, sigma=sigma_control,
    )  # fmt: skip
    ortho = orthophoto(photo.as_pair(), image, gsd=gsd, bounds=bounds)
    return _told(photo, ortho, stands_out)


def rectify_photo(
    path: Path,
    out: Path | None,
    given: Mapping[str, Any],
    *,
    folder: Path | None = None,
    overwrite: bool = False,
    world_file: bool = False,
    progress: Progress = no_progress,
) -> Rectification:
    """Rectify one photo into a GeoTIFF, or into a folder with everything a drawing needs.

    Parameters
    ----------
    given : mapping
        Options by the names of the command's.

    Raises
    ------
    InputError, GeometryError
        If files or options are at fault.
    """
    check_not_input(out, path, given["control"])
    info, corners, length, control = image_info(path), given["corners"], given["length"], None
    if given["control"] is not None:
        control = read_control(
            given["control"], sigma=given["sigma_control"], sigma_plane=CONTROL.sigma_on_wall,
            unit=given["unit"] or "", columns=given["columns"], photos=1,
            names=(str(path),), with_places=given["rectangle"] is None,
        )  # fmt: skip
        check_inside(control.ids, control.pixels1, info.size, path.name)
    reading = () if control is None else control.remarks
    rectangle = given["rectangle"]
    if rectangle is not None:
        picks = np.reshape(corners, (-1, 2)) if control is None else control.pixels1
        rectangle, control = (rectangle, picks), None
    lens = KnownLens(**{key: given[key] for key in ("lens", "focal", "pixel_size", "sensor_width")})
    photo = _oriented(
        lambda: read_image(path, grey=True), interior_of_photo(info, lens), control=control,
        rectangle=rectangle, length=length and (np.reshape(length[:4], (2, 2)), length[4]),
        sigma_pick=given["sigma_pick"], sigma=given["sigma_control"],
    )  # fmt: skip
    away = float(photo.camera.centre[2])
    if away > FARTHEST_WALL and not given["unit"]:
        raise InputError(remark("rectify.far_away", of=path.name, distance=away))
    pair = photo.as_pair(str(path.resolve()))
    keys = ("gsd", "bounds", "interpolation", "overviews", "any_size", "scale")
    task = OrthoTask.from_given({key: given[key] for key in keys})
    relief, scale, done = given["stands_out"], given["scale"], None
    # What can be refused is, before the work.
    words = photo.bound_in_words(relief, _places(pair, planned_grid(pair, FlatSurface(0.0), task)))
    if folder is None:
        ortho = make_ortho(
            pair, out or Path("ortho.tif"), task, overwrite=overwrite, world_file=world_file,
            progress=progress,
        )  # fmt: skip
    else:
        wish = DeliverTask(
            title=given["title"] or path.stem, camera=in_language(words, given["language"]),
            control=_drawn(control), hashes=True,
            **{key: given[key] for key in ("scale", "dpi", "paper", "mark", "language")},
        )  # fmt: skip
        done = deliver(
            pair, folder, task, wish, out=out, world_file=world_file, overwrite=overwrite,
            progress=progress,
        )  # fmt: skip
        ortho = done.ortho
    rectified = _told(photo, ortho, relief, scale)
    return replace(rectified, delivery=done, remarks=(*reading, *rectified.remarks))


def _drawn(control: Control | None) -> Points | None:
    """Return control points as a drawing takes them."""
    if control is None:
        return None
    blank, sigma = ("",) * len(control.ids), control.sigma[:, 2]
    return Points(ids=control.ids, xyz=control.xyz, sigma_r=sigma, flags=blank, notes=blank)


def _oriented(
    image: Callable[[], NDArray[np.generic]], interior: Interior, *, control: Control | None,
    rectangle: tuple[tuple[float, float], ArrayLike] | None,
    length: tuple[ArrayLike, float] | None, sigma_pick: float, sigma: float,
) -> OrientedPhoto:  # fmt: skip
    """Return the photo oriented by what is given; only lines need to see it."""
    if sum(way is not None for way in (control, rectangle, length)) == 1:
        if control is not None:
            return one_photo.by_control(control, interior, sigma_pick=sigma_pick)
        precision = {"sigma_pick": sigma_pick, "sigma": sigma}
        if rectangle is not None:
            corners = as_points(rectangle[1], "corners", dimension=2)
            return one_photo.by_rectangle(rectangle[0], corners, interior, **precision)
        if length is not None:
            ends, grey = as_points(length[0], "length", dimension=2), as_grey(image(), "image")
            return one_photo.by_lines(grey, interior, ends, length[1], **precision)
    raise InputError("give one of control, rectangle and length.")


def _told(
    photo: OrientedPhoto, ortho: Orthophoto | RasterResult, relief: float,
    scale: float | None = None,
) -> Rectification:  # fmt: skip
    """Return the picture with what is to be known of it, what relief does to it first."""
    places = _places(photo.as_pair(), ortho.grid)
    centre = np.round(photo.camera.centre, 2) + 0.0  # no -0.00
    value, sigma = photo.displacement(relief, places)
    words, sigmas = [photo.bound_in_words(relief, places)], 1000 * photo.sigma_at(places)
    if scale is not None:
        line = LINE * scale
        flat = {"line": 1000 * line, "relief": 100 * abs(relief) * line / (value + 2 * sigma)}
        words.append(remark("rectify.near_plane", scale=f"1:{scale:g}", **flat))
    about = {**dict(zip("xyz", centre, strict=True)), "median": np.median(sigmas)}
    words.append(remark("rectify.camera", **about, most=sigmas.max()))
    notes = [*photo.remarks, *(ortho.remarks if isinstance(ortho, RasterResult) else ())]
    if len(photo.ids) > 4 and np.isfinite(photo.test).any():
        parts = (photo.left_out, photo.sigma_left_out)
        errors, expected = (1000 * np.sqrt(np.nanmean(part**2, axis=0)) for part in parts)
        both = dict(zip(("x", "y", "expected_x", "expected_y"), (*errors, *expected), strict=True))
        words.append(remark("rectify.left_out", count=len(photo.ids), **both))
        worst = int(np.nanargmax(photo.test))
        if (times := float(photo.test[worst])) > OUTLIER_LIMIT:
            error = 1000 * float(np.hypot(*photo.left_out[worst]))
            notes.append(remark("rectify.outlier", name=photo.ids[worst], error=error, times=times))
    if sigmas.max() > 1000 * UNCERTAIN * np.ptp(places, axis=0).max():
        notes.append(remark("rectify.uncertain", sigma=float(sigmas.max())))
    notes.extend(filter(None, [photo.interior.doubt]))
    if not photo.interior.is_calibrated:
        notes.append(remark("rectify.no_lens"))
    return Rectification(
        ortho=ortho, photo=photo, bound=(value, sigma), words=tuple(words), remarks=tuple(notes)
    )


def _places(pair: PhotoAlone, grid: Grid) -> FloatArray:
    """Return places all over an orthophoto that the photo shows, shape (n, 2). [m]

    Raises
    ------
    InputError
        If there are none.
    """
    photo, (xmin, ymin, xmax, ymax) = pair.image1, grid.bounds
    mesh = np.meshgrid(np.linspace(xmin, xmax, 41), np.linspace(ymin, ymax, 41))
    places, size = np.stack(mesh, axis=-1).reshape(-1, 2), np.array(photo.image_size)
    pixels = photo.pixels_from_plane(places)
    inside = ((pixels >= -0.5) & (pixels <= size - 0.5)).all(axis=1)
    inside &= photo.sees_ahead(places, tuple(size[::-1]))
    if not inside.any():
        raise InputError(remark("ortho.nothing_in_common"))
    return places[inside]
