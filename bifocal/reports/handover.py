"""One file to hand over: photos, orthophoto, relief, points of a wall, to look at and measure."""

from __future__ import annotations

import base64
import html
import json
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, TypedDict

import cv2
import numpy as np

from bifocal.files import MadeFrom, check_maps, photo_info, photos_of, read_survey_points
from bifocal.model import Bounds, Grid, MapSurface, Pair, Points, ReliefMap
from bifocal.orthophotos import colour_limits, shaded
from bifocal.remarks import remark
from bifocal.reports.content import ortho_thumbnail
from photocore.arrays import ByteArray
from photocore.errors import InputError
from photocore.images import read_image, to_eight_bit
from photocore.jsonfile import plain
from photocore.output import atomic_path, check_ending, check_writable
from photocore.provenance import program, today
from photocore.reports import provenance_text, words_of

#: What goes by mail: the file is never larger. [bytes]
MOST = 24_000_000
#: Longer sides of orthophoto, photos and relief as long as that is kept. [px]
ORTHO, PHOTO, RELIEF = 6000, 3000, 1400
#: Quality of the pictures, and by how much they shrink where the file is too large.
JPEG, SHRINK = 84, 0.8
#: Step in which relief is told. [m]
UNIT = 0.0005


@dataclass(frozen=True, slots=True, kw_only=True)
class HandoverTask:
    """What a file to hand over shows besides the photos.

    Attributes
    ----------
    relief, ortho : Path, optional
        Relief map and orthophoto.
    points : Path, optional
        Solved workbook or table.
    title, language : str
    """

    relief: Path | None = None
    ortho: Path | None = None
    points: Path | None = None
    title: str = ""
    language: str = "en"


class HandedOver(TypedDict):
    """What was written: bytes, pixels of the orthophoto in the file, and remarks."""

    bytes: int
    pixels: list[int] | None
    remarks: tuple[str, ...]


def write_handover(
    source: Path, out: Path, task: HandoverTask, *, overwrite: bool = False
) -> HandedOver:
    """Write one HTML file that shows a wall and measures on it, without network or program.

    Parameters
    ----------
    source : Path
        Pair file.
    out : Path
        ``.html``; 24 MB at most, the pictures are made smaller for it.
    task : HandoverTask
    overwrite : bool

    Returns
    -------
    HandedOver

    Raises
    ------
    InputError
        If a file is missing or is not what it should be, neither orthophoto nor relief is given, or
        ``out`` cannot be written.
    """
    check_ending(out, "the file to hand over is written as .html.", ".html", ".htm")
    check_writable(out, overwrite=overwrite)
    if task.relief is None and task.ortho is None:
        raise InputError(remark("reports.nothing_to_hand_over"))
    pair = Pair.read(source)
    remarks = check_maps(MadeFrom.of(photos_of(pair)), relief=task.relief, ortho=task.ortho)
    shown = _Shown.read(pair, task)
    if shown.points is not None and not np.isfinite(shown.points.xyz).all(axis=1).any():
        remarks = (*remarks, remark("reports.no_points_to_show", path=task.points))
    factor = 1.0
    while len(page := _page(shown, task, source, factor).encode()) > MOST:
        factor *= SHRINK
    with atomic_path(out, overwrite=overwrite) as temporary:
        temporary.write_bytes(page)
    side = None if shown.ortho is None else _side(shown.ortho[0], factor * ORTHO)
    return {"bytes": len(page), "pixels": side, "remarks": remarks}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Shown:
    """All that is shown, as large as it is read."""

    photos: list[tuple[str, ByteArray, float]]
    ortho: tuple[ByteArray, Bounds] | None
    relief: ReliefMap | None
    points: Points | None
    pair: Pair

    @classmethod
    def read(cls, pair: Pair, task: HandoverTask) -> _Shown:
        photos = []
        for path in (photo_info(pair, k).path for k in (1, 2) if pair.photo(k).file):
            image = to_eight_bit(read_image(path))
            photos.append((path.name, _reduced(image, PHOTO), float(image.shape[1])))
        return cls(
            photos=photos,
            ortho=None if task.ortho is None else ortho_thumbnail(task.ortho, side=ORTHO)[0],
            relief=None if task.relief is None else ReliefMap.read(task.relief),
            points=None if task.points is None else read_survey_points(task.points)[0],
            pair=pair,
        )


def _page(shown: _Shown, task: HandoverTask, source: Path, factor: float) -> str:
    """Return the page with its pictures reduced by a factor."""
    say = words_of("bifocal.reports", task.language)
    title = task.title or source.name.removesuffix(".json").removesuffix(".pair")
    layers: list[dict[str, Any]] = []
    data: dict[str, Any] = {"layers": layers, "points": _points(shown)}
    if shown.ortho is not None:
        picture, bounds = shown.ortho
        layers.append(_layer(say("overview"), _reduced(picture, factor * ORTHO), bounds))
    if shown.relief is not None:
        data["relief"], picture = _relief(shown.relief, factor)
        layers.append(_layer(say("relief_map"), picture, data["relief"]["bounds"]))
    for number, (name, image, width) in enumerate(shown.photos, start=1):
        reduced = _reduced(image, factor * PHOTO)
        layers.append(_layer(f"{say('handover_photo')} {number} · {name}", reduced, None))
        layers[-1]["scale"] = reduced.shape[1] / width
        layers[-1]["photo"] = number
    texts = {
        key: say(f"handover_{key}")
        for key in ("measure", "clear", "help", "points", "distance", "width", "height", "relief")
    }
    texts |= {
        "title": title, "language": task.language, "provenance": provenance_text(),
        "made": say("made", program=program(), date=today()),
    }  # fmt: skip
    page = files("bifocal.reports").joinpath("handover.html").read_text(encoding="utf-8")
    escaped = {key: html.escape(text) for key, text in texts.items()}
    content = json.dumps(plain(data)).replace("<", "\\u003c")
    return Template(page).safe_substitute(escaped, data=content)


def _layer(name: str, picture: ByteArray, bounds: Bounds | None) -> dict[str, object]:
    """Return a picture for the page; ``bounds`` on the plane where it lies there. [m]"""
    height, width = picture.shape[:2]
    bgr = picture if picture.ndim == 2 else picture[..., ::-1]
    _, packed = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG])
    address = f"data:image/jpeg;base64,{base64.b64encode(packed.tobytes()).decode()}"
    return {"name": name, "image": address, "width": width, "height": height, "bounds": bounds}


def _relief(relief: ReliefMap, factor: float) -> tuple[dict[str, object], ByteArray]:
    """Return relief as numbers in a picture (red, green: steps of `UNIT`), and shaded."""
    step = max(1, -(-max(relief.shape) // round(factor * RELIEF)))
    r = np.ascontiguousarray(relief.r[::step, ::step])
    fine = relief.grid
    height, width = r.shape
    grid = Grid(x0=fine.x0, y0=fine.y0, gsd=fine.gsd * step, width=width, height=height)
    finite = np.isfinite(r)
    least = float(np.nanmin(r)) if finite.any() else 0.0
    levels = np.where(finite, np.rint((np.nan_to_num(r) - least) / UNIT) + 1, 0)
    levels = np.clip(levels, 0, 65535).astype(np.uint16)
    coded = np.dstack([np.zeros_like(levels), levels & 255, levels >> 8]).astype(np.uint8)
    packed = cv2.imencode(".png", coded)[1].tobytes()
    limits, _ = colour_limits(r)
    picture, _ = shaded(MapSurface.of_array(r, grid), grid, limits=limits)
    numbers = {
        "image": f"data:image/png;base64,{base64.b64encode(packed).decode()}", "width": width,
        "height": height, "bounds": list(grid.bounds), "least": least, "unit": UNIT,
    }  # fmt: skip
    return numbers, picture


def _points(shown: _Shown) -> list[dict[str, object]]:
    """Return the points with their places in both photos."""
    points = shown.points
    if points is None:
        return []
    finite = np.isfinite(points.xyz).all(axis=1)
    projected = shown.pair.project(points.xyz[finite])
    return [
        {"name": name, "X": xyz[0], "Y": xyz[1], "r": xyz[2], "sigma": sigma, "photos": [one, two]}
        for name, xyz, sigma, one, two in zip(
            np.array(points.ids)[finite].tolist(), points.xyz[finite].tolist(),
            np.asarray(points.sigma_r)[finite].tolist(), *(pixels.tolist() for pixels in projected),
            strict=True,
        )
    ]  # fmt: skip


def _side(picture: ByteArray, most: float) -> list[int]:
    """Return width and height of a picture that is no longer than allowed."""
    factor = min(1.0, most / max(picture.shape[:2]))
    return [max(1, round(n * factor)) for n in picture.shape[1::-1]]


def _reduced(picture: ByteArray, most: float) -> ByteArray:
    size = _side(picture, most)
    if size == list(picture.shape[1::-1]):
        return picture
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
