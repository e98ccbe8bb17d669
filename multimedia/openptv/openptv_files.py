"""The single files of OpenPTV: .ori, .addpar, ptv.par, _targets, calibration body, rt_is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from multimedia.media import Camera, FlatInterface, Sensor, brown_of
from multimedia.refraction import Layers
from multimedia.remarks import remark
from photocore.arrays import FloatArray, IntArray, floats_of_words
from photocore.camera import (
    Brown,
    Convention,
    checked_rotation,
    nearest_rotation,
    world_from_camera,
)
from photocore.errors import InputError
from photocore.textfile import read_text

#: A printed matrix has 7 decimals; angles and matrix of one camera differ by a few of the last.
MATRIX_ROUNDING = 1e-5
KIND = "file of OpenPTV"


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlParameters:
    """What ptv.par says.

    Attributes
    ----------
    images, calibration_images : tuple of str
        Base name of the sequence and the calibration image of each camera.
    sensor : Sensor
        Its origin is OpenPTV's: (width / 2, height / 2).
    field : int
        0 for whole frames, 1 or 2 for the odd or even lines of interlaced video.
    indices : tuple of float
        Air, glass, water as the file says.
    thickness : float
        Of the glass. [mm]
    orientations : tuple of str
        The .ori file of each camera; none: named after the calibration images.
    body : str
        File of the calibration body; "": beside it, or of a usual name.
    stems : tuple of str
        Of the file names of the positions of a body moved from plane to plane.
    manual : tuple of (list of str, ndarray)
        Points clicked by hand in each calibration image: ids and pixels.
    """

    images: tuple[str, ...]
    calibration_images: tuple[str, ...]
    sensor: Sensor
    field: int
    indices: tuple[float, ...]
    thickness: float
    orientations: tuple[str, ...] = ()
    body: str = ""
    stems: tuple[str, ...] = ()
    manual: tuple[tuple[list[str], FloatArray], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectedTargets:
    """Detected targets of one image.

    Attributes
    ----------
    pixels : ndarray, shape (n, 2)
        Column and row. [px]
    counts : ndarray of int, shape (n,)
        Pixels of each target.
    numbers : ndarray of int, shape (n,)
        Correspondence numbers.
    """

    pixels: FloatArray
    counts: IntArray
    numbers: IntArray


def read_control(path: Path) -> ControlParameters:
    """Read ptv.par.

    Raises
    ------
    InputError
        If a line is missing or not what it should be; the message names the line.
    """
    lines = [line.strip() for line in read_text(path, KIND).rstrip().splitlines()]
    count = _count(path, lines, "number of cameras")
    if not 1 <= count <= 64:
        raise InputError(f"{path}, line 1: {count} cameras; expected 1 to 64.")
    names = lines[1 : 1 + 2 * count]
    first = 1 + 2 * count
    what = ("high-pass flag", "all-camera flag", "TIFF flag", "image width", "image height",
            "pixel width", "pixel height", "field flag", "index of air", "index of glass",
            "index of water", "glass thickness")  # fmt: skip
    values = [_number(path, lines, first + k, name) for k, name in enumerate(what)]
    width, height, side = int(values[3]), int(values[4]), values[5:7]
    if max(side) > 0.2:
        raise InputError(
            f"{path}, line {first + 6}: a pixel of {side[0]:g} x {side[1]:g} mm is no camera's; "
            "expected some 0.002 to 0.03 mm. Is it in micrometres?"
        )
    return ControlParameters(
        images=tuple(names[0::2]),
        calibration_images=tuple(names[1::2]),
        sensor=Sensor(
            width=width,
            height=height,
            pixel_size=np.array(side),
            origin=np.array([width, height]) / 2,
        ),
        field=int(values[7]),
        indices=tuple(values[8:11]),
        thickness=values[11],
    )


def read_camera(path: Path, *, sensor: Sensor, name: str) -> tuple[Camera, FloatArray, list[str]]:
    """Read an .ori file and the .addpar beside it.

    Returns
    -------
    camera : Camera
        With OpenPTV's distortion convention.
    glass : ndarray, shape (3,)
        From the origin to the foot on the water side of the glass; towards the camera. [mm]
    remarks : list of str
        What is odd about the files.

    Raises
    ------
    InputError
        If numbers are missing or angles and matrix contradict each other.
    """
    values = _numbers(path, 3 + 3 + 9 + 2 + 1, "X0 Y0 Z0, angles, matrix, xh yh, c")
    rotation, notes = _rotation(path, values[3:6], values[6:15].reshape(3, 3))
    remarks = [*notes]
    glass = values[18:21] if len(values) >= 21 else np.zeros(3)
    if not np.any(glass):
        remarks.append(f"{path.name}: no glass vector; the camera looks through no interface.")
    c, point = float(values[17]), values[15:17]
    terms = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    added = path.with_name(path.name.removesuffix(".ori") + ".addpar")
    if added.exists():
        terms = _numbers(added, 7, "k1 k2 k3 p1 p2 scale shear")[:7]
    else:
        remarks.append(f"{path.name}: no {added.name} beside it; taken as free of distortion.")
    # OpenPTV's scale stretches both axes, after the distortion: the same image as a longer
    # principal distance with smaller coefficients. Ours is that of x against y.
    s = float(terms[5])
    if not 0.5 < s < 2:
        raise InputError(f"{added}: the scale is {s:g}; expected a value near 1.")
    k1, k2, k3, p1, p2 = terms[:5] / [s**2, s**4, s**6, s, s]
    distortion = Brown(
        k1=k1, k2=k2, k3=k3, p1=p1, p2=p2, shear=float(terms[6]), convention=Convention.OPENPTV
    )
    if not 5.0 < c < 2000.0:
        remarks.append(f"{path.name}: principal distance {c:g} mm; is it in mm?")
    camera = Camera(
        centre=values[:3], rotation=rotation, principal_distance=c * s, principal_point=point * s,
        distortion=distortion, sensor=sensor, name=name,
    )  # fmt: skip
    return camera, glass, remarks


def glass_interface(
    glass: FloatArray, indices: tuple[float, ...], thickness: float
) -> FlatInterface:
    """Return the interface that a glass vector describes: its tip is on the water side."""
    layers = Layers(indices=indices, thicknesses=(thickness,))
    return FlatInterface(layers=layers, point=glass, normal=glass)


def read_targets(path: Path, *, field: int = 0) -> DetectedTargets:
    """Read a _targets file: number, column, row, pixels, width, height, grey sum, correspondence.

    Raises
    ------
    InputError
        If the count in the first line does not fit the lines that follow.
    """
    first, *rest = read_text(path, KIND).split() or [""]
    count = _count(path, [first], "number of targets")
    if len(rest) != 8 * count:
        raise InputError(remark("openptv.targets_cut", of=path, count=count, size=len(rest)))
    table = floats_of_words(rest, path, "value {} of the targets").reshape(-1, 8)
    pixels = table[:, 1:3].copy()
    if field in (1, 2):
        # Half frames: the file counts every other line.
        pixels[:, 1] = 2 * pixels[:, 1] + (field == 1)
    return DetectedTargets(
        pixels=pixels, counts=table[:, 3].astype(np.int64), numbers=table[:, 7].astype(np.int64)
    )


def read_blobs(path: Path) -> dict[int, FloatArray]:
    """Read MyPTV's blobs: lines of row, column, two sides, area, frame; pixels by frame.

    Raises
    ------
    InputError
        If a line has other than six numbers, or a frame is no whole one.
    """
    lines = [line for line in read_text(path, "file of MyPTV").splitlines() if line.strip()]
    for number, line in enumerate(lines, start=1):
        if len(line.split()) != 6:
            raise InputError(remark("tracks.blobs", of=path, line=number, size=len(line.split())))
    values = floats_of_words(" ".join(lines).split(), path, "value {}")
    table = values.reshape(-1, 6)
    frames = table[:, 5].astype(np.int64)
    if (frames != table[:, 5]).any():
        number = int(np.argmax(frames != table[:, 5])) + 1
        raise InputError(f"{path}, line {number}: the frame must be a whole number.")
    return {int(frame): table[frames == frame, 1::-1] for frame in np.unique(frames)}


def targets_text(pixels: FloatArray, counts: IntArray, extents: IntArray, sums: FloatArray) -> str:
    """Return the content of a _targets file.

    Parameters
    ----------
    pixels : ndarray, shape (n, 2)
        Column and row, counted as those will who read it: OpenPTV counts from the corner of the
        image, half a pixel more than from pixel centres.
    counts : ndarray of int, shape (n,)
        Pixels of each.
    extents : ndarray of int, shape (n, 2)
        Columns and rows that it takes.
    sums : ndarray, shape (n,)
        Of its grey values.
    """
    lines = [f"{len(pixels)}"]
    for k, (column, row) in enumerate(pixels):
        numbers = (counts[k], *extents[k], round(float(sums[k])))
        words = " ".join(f"{number:5d}" for number in numbers)
        lines.append(f"{k:4d} {column:9.4f} {row:9.4f} {words} {-1:5d}")
    return "\n".join(lines) + "\n"


def read_body(path: Path) -> tuple[list[str], FloatArray]:
    """Read a calibration body: lines of number X Y Z.

    Raises
    ------
    InputError
        If a line has other than four numbers; the message names it.
    """
    ids, points = [], []
    for number, line in enumerate(read_text(path, KIND).splitlines(), start=1):
        fields = line.replace(",", " ").split()
        if not fields or fields[0].startswith("#"):
            continue
        if len(fields) != 4:
            raise InputError(
                f"{path}, line {number}: found {len(fields)} values, expected number X Y Z."
            )
        ids.append(fields[0])
        points.append(floats_of_words(fields[1:], path, f"line {number}"))
    if not ids:
        raise InputError(f"{path}: no points; expected lines of number X Y Z.")
    return ids, np.array(points)


def read_manual(points: Path, pixels: Path) -> tuple[list[str], FloatArray]:
    """Read man_ori.par and man_ori.dat: the points clicked by hand in all calibration images.

    Returns
    -------
    ids : list of str
        Numbers of the control points, those of the first camera first.
    pixels : ndarray, shape (n, 2)
        Their columns and rows.

    Raises
    ------
    InputError
        If the two files do not belong together.
    """
    ids = read_text(points, KIND).split()
    values = floats_of_words(read_text(pixels, KIND).split(), pixels, "man_ori")
    if values.size != 2 * len(ids):
        raise InputError(
            f"{pixels}: holds {values.size} numbers for the {len(ids)} points of {points.name}; "
            "expected column and row of each."
        )
    return ids, values.reshape(-1, 2)


def read_correspondences(path: Path) -> tuple[FloatArray, IntArray]:
    """Read an rt_is file: positions, shape (n, 3) [mm], and target numbers, shape (n, cameras).

    -1 where a camera did not see the particle; a frame without particles has no columns of numbers.

    Raises
    ------
    InputError
        If the count in the first line does not fit the lines that follow.
    """
    lines = [line for line in read_text(path, KIND).splitlines() if line.strip()]
    count = _count(path, lines, "number of particles")
    rows = [line.split() for line in lines[1:]]
    widths = {len(row) for row in rows}
    if len(rows) != count or len(widths) > 1 or (widths and min(widths) < 6):
        raise InputError(remark("openptv.particles_cut", of=path, count=count, size=len(rows)))
    if not rows:
        return np.empty((0, 3)), np.empty((0, 0), dtype=np.int64)
    table = np.array([floats_of_words(row, path, f"line {k}") for k, row in enumerate(rows, 2)])
    return table[:, 1:4].copy(), table[:, 4:].astype(np.int64)


def rt_is_text(xyz: FloatArray, numbers: IntArray) -> str:
    """Return the content of an rt_is file: number from 1, X, Y, Z [mm], targets of four cameras."""
    blank = np.full((len(numbers), max(0, 4 - numbers.shape[1])), -1, dtype=np.int64)
    rows = np.hstack([numbers, blank])
    line = "%4d %9.3f %9.3f %9.3f" + " %4d" * rows.shape[1] + "\n"
    places = zip(xyz.tolist(), rows.tolist(), strict=True)
    lines = [line % (k, *place, *row) for k, (place, row) in enumerate(places, start=1)]
    return f"{len(xyz)}\n" + "".join(lines)


def ori_text(camera: Camera, glass: FloatArray) -> str:
    """Return the content of an .ori file."""
    x, m = camera.centre, camera.rotation
    rows = "\n".join("    " + " ".join(f"{v:.17g}" for v in row) for row in m)
    return (
        f"{x[0]:.15g} {x[1]:.15g} {x[2]:.15g}\n"
        f"    {' '.join(f'{v:.16g}' for v in camera.angles)}\n\n{rows}\n\n"
        f"    {camera.principal_point[0]:.17g} {camera.principal_point[1]:.17g}\n"
        f"    {camera.principal_distance:.17g}\n\n"
        f"    {glass[0]:.17g} {glass[1]:.17g} {glass[2]:.17g}\n"
    )


def addpar_text(camera: Camera, scale: float) -> str:
    """Return the content of an .addpar file: distortion of OpenPTV's convention, and ``scx``."""
    d = brown_of(camera, "OpenPTV")
    terms = (d.k1, d.k2, d.k3, d.p1, d.p2, scale, d.shear)
    return " ".join(f"{v:.17g}" for v in terms) + "\n"


def _rotation(
    path: Path, angles: FloatArray, matrix: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the rotation from angles and printed matrix, which must agree, and remarks."""
    by_angles = world_from_camera(*(float(a) for a in angles))
    if not np.any(matrix) or np.abs(by_angles - matrix).max() < MATRIX_ROUNDING:
        return by_angles, ()
    if np.abs(world_from_camera(*np.radians(angles)) - matrix).max() < MATRIX_ROUNDING:
        odd = "the angles are in degrees, though OpenPTV wants radians; its matrix tells, and "
        odd += "is used."
    else:
        checked_rotation(matrix, f"{path}: the 3 x 3 matrix", tolerance=1e-3)
        odd = "angles and matrix disagree; the matrix is used."
    return nearest_rotation(matrix), (f"{path.name}: {odd}",)


def _number(path: Path, lines: list[str], index: int, what: str) -> float:
    if index >= len(lines):
        raise InputError(f"{path}: ends before line {index + 1} ({what}).")
    words = lines[index].split()[:1] or [""]
    return float(floats_of_words(words, path, f"line {index + 1} ({what})")[0])


def _count(path: Path, lines: list[str], what: str) -> int:
    """Return how many things the first line announces."""
    number = _number(path, lines, 0, what)
    if number != int(number):
        raise InputError(f"{path}, line 1 ({what}): expected a whole number, found {number:g}.")
    return int(number)


def _numbers(path: Path, least: int, what: str) -> FloatArray:
    values = floats_of_words(read_text(path, KIND).split(), path, "value {}")
    if len(values) < least:
        raise InputError(f"{path}: {len(values)} numbers, expected at least {least}: {what}.")
    return values
