"""Orthophotos or relief maps in, one of the whole wall out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bifocal.model.doubts import METRES
from bifocal.model.geotiff import RasterReader, check_relief, create_raster
from bifocal.model.grid import Bounds, Grid
from bifocal.model.surface import MapSurface
from bifocal.orthophotos.mosaic_blending import (
    SeamPlan,
    Seen,
    common_grid,
    mosaic_window,
    plan_mosaic,
)
from bifocal.orthophotos.tiles import RasterResult, write_tiles
from bifocal.orthophotos.tuning import BLENDING, COMPOSE
from bifocal.remarks import remark
from photocore.arrays import Float32Array, IntArray
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.output import check_ending, check_not_input, check_writable

#: Numbers of inputs must fit the 8-bit source band.
_MOST_INPUTS = 255


class _FileLayer:
    """A raster file as a layer of a mosaic; its source band is left out."""

    def __init__(self, reader: RasterReader) -> None:
        self.reader = reader
        self.kept = [i for i, name in enumerate(reader.names, start=1) if name != "source"]
        self.grid: Grid = reader.grid

    @property
    def is_relief(self) -> bool:
        """Whether it holds values rather than colours."""
        return self.reader.dtype.kind == "f"

    def read(self, column: int, row: int, width: int, height: int) -> Seen:
        """Return a window and its validity."""
        size = (column, row, width, height)
        if self.is_relief:
            values = self.reader.read(*size, bands=self.kept, fill=np.nan)
            values[:, :, 0] = self.reader.read_floats(*size)
            return values, np.isfinite(values[:, :, 0])
        valid = self.reader.read(*size, mask=True) > 0
        return self.reader.read(*size, bands=self.kept), valid

    def reduced(self, width: int, height: int) -> Seen:
        """Return the whole raster shrunk."""
        image, valid = self.reader.read_reduced(width, height, bands=self.kept)
        return image, valid & np.isfinite(image[:, :, 0])


def make_mosaic(
    inputs: Sequence[Path],
    out: Path,
    *,
    gsd: float | None = None,
    bounds: Bounds | None = None,
    relief: Sequence[Path] = (),
    priority: bool = False,
    gain: bool = True,
    blend: bool = True,
    overviews: bool = True,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> RasterResult:
    """Join orthophotos, or relief maps, of one wall.

    Parameters
    ----------
    gsd, bounds
        Pixel size and box; by default the finest input's and the box around all. [m]
    relief : sequence of Path
        Relief maps: seams keep away from their edges.
    priority : bool
        Earlier files cover later ones instead of seams being sought.
    gain : bool
        Make the exposure of the inputs equal to the first one's.
    blend : bool
        Blend over the seams (colours only; relief values are never mixed).

    Raises
    ------
    InputError
        If inputs are missing, differ in kind, show different things on their overlap, or the
        output cannot be written.
    """
    check_ending(out, "a mosaic is written as GeoTIFF; name it .tif.", ".tif", ".tiff")
    check_not_input(out, *inputs, *relief)
    check_writable(out, overwrite=overwrite)
    if len(inputs) < 2:
        raise InputError("a mosaic needs two rasters or more.")
    if len(inputs) > _MOST_INPUTS:
        raise InputError(f"a mosaic takes up to {_MOST_INPUTS} rasters; join them in groups.")
    with ExitStack() as stack:
        layers = [_FileLayer(stack.enter_context(RasterReader(path))) for path in inputs]
        _check_alike(layers)
        values = layers[0].is_relief
        grid = common_grid(layers, gsd=gsd, bounds=bounds)
        edges = partial(_relief_of, relief, stack) if relief else None
        seams = plan_mosaic(layers, grid, priority=priority, gain=gain and not values, relief=edges)
        first = layers[0].reader
        names = [first.names[i - 1] for i in layers[0].kept]

        def tiles() -> Iterator[tuple[int, int, NDArray[Any], IntArray]]:
            for column, row, window in grid.tiles(COMPOSE.tile):
                image, owner = mosaic_window(layers, seams, window, blend=blend)
                yield column, row, image, owner + 1

        with create_raster(
            out,
            grid,
            bands=len(names) + 1,
            dtype=first.dtype,
            overwrite=overwrite,
            names=[*names, "source"],
            colour=not values and len(names) == 3,
            nodata=float("nan") if values else None,
            tags={
                "BIFOCAL_UNIT": _unit_of(layers[0]),
                **{f"BIFOCAL_INPUT_{i}": path.name for i, path in enumerate(inputs, start=1)},
            },
            overviews=overviews,
        ) as writer:
            counts = write_tiles(
                writer, tiles(), sources=len(layers) + 1, masked=not values, progress=progress,
                what="mosaic",
            )  # fmt: skip
            if not counts[1:].any():
                raise InputError("none of the rasters shows anything within the bounds.")
        remarks = _remarks(layers, seams, grid, values=values)
    names = ["none", *(f"{i} {path.name}" for i, path in enumerate(inputs, start=1))]
    shares = dict(zip(names, (counts / counts.sum()).tolist(), strict=True))
    return RasterResult(path=out, grid=grid, shares=shares, remarks=tuple(remarks))


def _check_alike(layers: Sequence[_FileLayer]) -> None:
    first, count = layers[0].reader, len(layers[0].kept)
    for layer in layers[1:]:
        if layer.reader.dtype != first.dtype or len(layer.kept) != count:
            raise InputError(
                f"{layer.reader.path} ({len(layer.kept)} bands of {layer.reader.dtype}) and "
                f"{first.path} ({count} of {first.dtype}) cannot be joined: give only orthophotos "
                "of the same kind, or only relief maps."
            )
        if _unit_of(layer) != _unit_of(layers[0]):
            names = {"path": layer.reader.path, "first": first.path}
            raise InputError(remark("mosaic.two_units", **names))
        if layer.reader.crs != first.crs:
            raise InputError(remark("mosaic.two_systems", path=layer.reader.path, first=first.path))


def _unit_of(layer: _FileLayer) -> str:
    """Return the unit of a raster's lengths: ``m``, or ``none`` where nothing gave a scale."""
    return layer.reader.tags.get("BIFOCAL_UNIT", METRES)


def _relief_of(paths: Sequence[Path], stack: ExitStack, coarse: Grid) -> Float32Array:
    """Return the first known relief of several maps on the coarse grid."""
    relief = np.full(coarse.shape, np.nan, np.float32)
    for path in paths:
        reader = stack.enter_context(RasterReader(path))
        check_relief(reader)
        part = MapSurface(reader.grid, reader.read_floats).window(coarse)
        if np.isnan(part).all():
            raise InputError(f"{path}: knows no relief anywhere in the mosaic; see its X and Y.")
        relief = np.where(np.isnan(relief), part, relief)
    return relief


def _remarks(
    layers: Sequence[_FileLayer], seams: SeamPlan, grid: Grid, *, values: bool
) -> list[str]:
    """Return what the user should know of how the inputs fit."""
    remarks: list[str] = []
    if _unit_of(layers[0]) != METRES:
        remarks.append(remark("projects.no_scale"))
    paths = [layer.reader.path for layer in layers]
    alone = len({path.name for path in paths}) == len(paths)
    names = [path.name if alone else str(path) for path in paths]
    moved = [
        name
        for name, layer in zip(names, layers, strict=True)
        if abs(layer.grid.gsd / grid.gsd - 1) > 1e-9
        or max(abs(x - round(x)) for x in grid.offset_in(layer.grid)) > 0.01
    ]
    if moved:
        remarks.append(remark("mosaic.resampled", names=", ".join(moved)))
    if not seams.differences:
        remarks.append(remark("mosaic.no_overlap"))
    for (i, j), difference in seams.differences.items():
        if values and abs(difference) > BLENDING.relief_step:
            gap = 1000 * abs(difference)
            where = "before" if difference > 0 else "behind"
            remarks.append(
                remark("mosaic.step", name=names[i], gap=gap, where=where, other=names[j])
            )
    for (i, j), likeness in seams.likeness.items():
        if likeness < BLENDING.weak:
            words = remark("mosaic.little_alike", name=names[i], other=names[j], likeness=likeness)
            remarks.append(words)
    if not values:
        for name, gains in zip(names, seams.gains, strict=True):
            if np.abs(gains - 1).max() > 0.02:
                factors = ", ".join(f"{g:.2f}" for g in gains)
                remarks.append(remark("mosaic.gains", name=name, factors=factors))
    return remarks
