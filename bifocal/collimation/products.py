"""Relief, orthophoto and drawings of a survey: where they lie, and what the page asks of them."""

from __future__ import annotations

import threading
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict

import cv2
import numpy as np

from bifocal.collimation.project import SurveyFiles
from bifocal.model import TOLD, Grid, MapSurface, RasterReader, ReliefMap
from bifocal.orthophotos import shaded, tints
from bifocal.remarks import remark
from bifocal.reports import ortho_thumbnail
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.output import free_path

#: Longer side of the relief's picture. [px]
OVERLAY_SIDE = 1536
#: Longer side of a product's preview. [px]
PREVIEW = 480
#: Bars of the relief's histogram.
BINS = 96
#: Endings of what a client opens: sheets, drawing with its picture, report, view in 3-D.
FOR_CLIENTS = frozenset({".pdf", "_relief.pdf", ".dxf", ".png", "_report.html", "_3d.html"})
#: Folder of all else in what *Download all* gives.
DATA = "data"
#: Points of a profile, at most.
PROFILE_POINTS = 2000


class FileOffered(TypedDict):
    """A file that is offered for download."""

    name: str
    bytes: int


class Products:
    """Files that the page made in the survey's folder.

    Parameters
    ----------
    files : SurveyFiles
    """

    def __init__(self, files: SurveyFiles) -> None:
        self.folder, self.stem = files.folder, files.stem
        self.made: dict[str, str] = {}
        #: Digests of what each kind was last made from.
        self.causes: dict[str, Mapping[str, str]] = {}
        self._relief: tuple[tuple[str, int], ReliefMap] | None = None
        self._overlay: tuple[object, bytes] | None = None
        self._reading, self._shading = threading.Lock(), threading.Lock()
        self._facts: dict[str, tuple[tuple[str, int], dict[str, object]]] = {}

    def note(
        self, kind: str, names: Sequence[str], causes: Mapping[str, str] | None = None
    ) -> None:
        """Remember that files were made, and from what."""
        self.causes[kind] = causes or {}
        for name in names:
            self.made.pop(name, None)
            self.made[name] = kind

    def place(self, kind: str, ending: str) -> Path:
        """Return where a product goes: over the page's own older one, never over another file."""
        current = self.current(kind)
        path = current or self.folder / f"{self.stem}{ending}"
        if current is not None or not path.exists():
            return path
        return free_path(self.folder, f"{self.stem}-page", ending)

    def is_own(self, path: Path) -> bool:
        """Whether a file was made by the page."""
        return path.name in self.made

    def current(self, kind: str) -> Path | None:
        """Return the last product of a kind that is still there."""
        paths = [self.folder / name for name, what in self.made.items() if what == kind]
        return next((path for path in reversed(paths) if path.is_file()), None)

    def downloads(self, workbook: Path) -> dict[str, Path]:
        """Return the files offered for download by name."""
        names = [
            name for name, kind in self.made.items()
            if kind != "aside" and (self.folder / name).is_file()
        ]  # fmt: skip
        offered = {Path(name).name: self.folder / name for name in names}
        if workbook.is_file():
            offered[workbook.name] = workbook
        return offered

    def listed(self, workbook: Path) -> list[FileOffered]:
        """Return names and sizes of the files offered for download."""
        offered = self.downloads(workbook)
        return [{"name": n, "bytes": p.stat().st_size} for n, p in sorted(offered.items())]

    def bundle(
        self, workbook: Path, more: Mapping[str, Path], stale: Collection[str] = ()
    ) -> dict[str, Path]:
        """Return all that *Download all* holds by its name there: products, workbook, photos.

        What a client opens stands first, all else in the folder ``data``, which is a survey that
        the page opens: with the workbook, which a client wants, too.

        Parameters
        ----------
        workbook : Path
        more : mapping of str to Path
            Further files: photos and what the pair file names.
        stale : collection of str
            Kinds that are out of date and stay out, so that old is never packed with new.
        """
        old = {Path(name).name for name, kind in self.made.items() if kind in stale}
        current = self.downloads(workbook).items()
        files = {name: path for name, path in current if name not in old}
        top = {n: p for n, p in files.items() if n.removeprefix(self.stem) in FOR_CLIENTS}
        rest = {**more, **{name: path for name, path in files.items() if name not in top}}
        top |= {name: path for name, path in files.items() if name == workbook.name}
        return {**top, **{f"{DATA}/{name}": path for name, path in rest.items()}}

    def preview(self, kind: str) -> bytes:
        """Return a small picture of the relief, the orthophoto or the drawing, PNG.

        Raises
        ------
        InputError
            If there is none yet.
        """
        if kind == "relief":
            data = np.frombuffer(self.overlay(), np.uint8)
            return _png(_small(cv2.imdecode(data, cv2.IMREAD_UNCHANGED)))
        path = self.current(kind)
        if path is None:
            raise InputError(remark("page.no_ortho"))
        picture, _ = ortho_thumbnail(path)
        return _png(_small(picture[0][..., ::-1]))

    def facts(self, kind: str) -> dict[str, object] | None:
        """Return size and place of the relief or the orthophoto; None where there is none.

        Of the relief also the ``range`` that its colours span. [m]
        """
        path = self.current(kind)
        if path is None:
            return None
        version = _version(path)
        if kind not in self._facts or self._facts[kind][0] != version:
            facts = _grid_facts(path)
            if kind == "relief":
                facts["range"] = relief_limits(self.relief())
                facts["histogram"] = _histogram(self.relief())
                facts["colours"] = colours()
            self._facts[kind] = version, facts
        return self._facts[kind][1]

    def relief(self) -> ReliefMap:
        """Return the relief map.

        Raises
        ------
        InputError
            If there is none yet.
        """
        path = self.current("relief")
        if path is None:
            raise InputError(remark("page.no_relief"))
        with self._reading:  # the page asks for it from many sides at once
            version = _version(path)
            if self._relief is None or self._relief[0] != version:
                self._relief = version, ReliefMap.read(path)
            return self._relief[1]

    def overlay(
        self, low: float | None = None, high: float | None = None, *, hatched: bool = False
    ) -> bytes:
        """Return the relief as a shaded picture with transparent holes, PNG.

        Parameters
        ----------
        low, high : float, optional
            Relief of the first and the last colour; the middle one is the wall's. [m]
        hatched : bool
            Whether what was not measured is paler and hatched.
        """
        relief = self.relief()
        with self._shading:
            mark = id(relief), low, high, hatched
            if self._overlay is None or self._overlay[0] != mark:
                self._overlay = mark, _shaded(relief, low, high, hatched=hatched)
            return self._overlay[1]

    def value(self, x: float, y: float) -> dict[str, float | None]:
        """Return relief and its standard deviation at a place of the wall. [m]"""
        relief = self.relief()
        place = np.array([[x, y]])
        return {
            "r": _plain(float(relief.sample(place)[0])),
            "sigma": _plain(float(_nearest(relief, place)[0])),
        }

    def profile(self, start: FloatArray, end: FloatArray) -> dict[str, list[float | None]]:
        """Return the relief along a line on the wall. [m]"""
        relief = self.relief()
        length = float(np.linalg.norm(end - start))
        if not np.isfinite(length) or length > 1e5:
            raise InputError(remark("page.two_places"))
        count = int(np.clip(length / relief.gsd, 2, PROFILE_POINTS))
        along = np.linspace(0.0, 1.0, count)
        places = start + along[:, None] * (end - start)
        return {
            "distance": (along * length).tolist(),
            "r": [_plain(value) for value in relief.sample(places).tolist()],
            "sigma": [_plain(value) for value in _nearest(relief, places).tolist()],
        }


def _version(path: Path) -> tuple[str, int]:
    """Return what tells whether a file is still the same."""
    return path.name, path.stat().st_mtime_ns


def _grid_facts(path: Path) -> dict[str, object]:
    """Return name, size and place of a raster."""
    with RasterReader(path) as file:
        grid = file.grid
    return {
        "ready": True,
        "name": path.name,
        "rows": grid.height,
        "cols": grid.width,
        "bounds": grid.bounds,
        "gsd": grid.gsd,
    }


def relief_limits(relief: ReliefMap) -> tuple[float, float]:
    """Return the relief at both ends of the colours. [m]"""
    finite = relief.r[np.isfinite(relief.r)]
    if not len(finite):
        return 0.0, 0.0
    low, high = np.percentile(finite, [0.5, 99.5])
    return float(low), float(high)


def _shaded(relief: ReliefMap, low: float | None, high: float | None, *, hatched: bool) -> bytes:
    """Return the picture of a relief map, see `Products.overlay`."""
    limits = relief_limits(relief)
    span = (limits[0] if low is None else low, limits[1] if high is None else high)
    step = max(1, round(max(relief.shape) / OVERLAY_SIDE))
    r = relief.r[::step, ::step]
    fine = relief.grid
    height, width = r.shape
    grid = Grid(x0=fine.x0, y0=fine.y0, gsd=fine.gsd * step, width=width, height=height)
    measured = None
    if hatched:
        measured_pixels = np.isin(relief.quality[::step, ::step], TOLD)
        if measured_pixels.any():
            measured = MapSurface.of_array(np.where(measured_pixels, r, np.float32("nan")), grid)
    # Lines as on a sheet on which a pixel is a third of a millimetre.
    picture, alpha = shaded(
        MapSurface.of_array(r, grid), grid, limits=span, measured=measured,
        scale=grid.gsd * 3000,
    )  # fmt: skip
    return _png(np.dstack([picture[..., ::-1], alpha]))


def colours() -> list[str]:
    """Return the colours from the farthest back over the wall to what stands out most."""
    rgb = np.rint(tints(np.linspace(-1, 1, 17), (-1.0, 1.0))).astype(int)
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in rgb]


def _histogram(relief: ReliefMap) -> dict[str, object]:
    """Return how often which relief occurs: ``from``, ``to`` [m] and ``counts``."""
    finite = relief.r[np.isfinite(relief.r)]
    if not len(finite):
        return {"from": 0.0, "to": 0.0, "counts": []}
    low, high = (float(value) for value in np.percentile(finite, [0.1, 99.9]))
    low, high = min(low, -0.01), max(high, 0.01)
    counts, _ = np.histogram(finite, bins=BINS, range=(low, high))
    return {"from": low, "to": high, "counts": counts.tolist()}


def _nearest(relief: ReliefMap, places: FloatArray) -> FloatArray:
    """Return the standard deviation at the nearest pixel of places, shape (n,). [m]"""
    pixels = np.rint(relief.grid.pixel_of(places))
    height, width = relief.shape
    inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
    column, row = np.where(inside[:, None], pixels, 0).astype(int).T
    return np.where(inside, relief.sigma[row, column], np.nan)


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _small(picture: Any) -> Any:
    side = max(picture.shape[:2]) / PREVIEW
    size = tuple(max(1, round(n / max(side, 1.0))) for n in picture.shape[1::-1])
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _png(picture: Any) -> bytes:
    return cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes()
