"""Orthophotos or relief maps in, one of the whole wall out."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bifocal.files.geotiff import RasterReader, check_relief, create_raster
from bifocal.model.grid import Grid
from bifocal.model.surface import MapSurface
from bifocal.orthophotos.mosaic_blending import (
    Plan,
    coarse_grid,
    common_grid,
    mosaic_window,
    plan_mosaic,
)
from photocore.arrays import BoolArray
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.output import check_writable

#: Side of the windows the mosaic is made in. [px]
_TILE = 1024
#: A relief map that differs from its neighbour by more is pointed out. [m]
_RELIEF_STEP = 0.005
#: Numbers of inputs must fit the 8-bit source band.
_MOST_INPUTS = 255


@dataclass(frozen=True, slots=True, kw_only=True)
class MosaicResult:
    """What was made.

    Attributes
    ----------
    path : Path
    grid : Grid
    shares : dict of str to float
        Part of the mosaic that each input fills, and ``none``.
    remarks : tuple of str
    """

    path: Path
    grid: Grid
    shares: dict[str, float]
    remarks: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the result for ``--json``."""
        return {
            "file": str(self.path),
            "gsd": self.grid.gsd,
            "width": self.grid.width,
            "height": self.grid.height,
            "bounds": list(self.grid.bounds),
            "shares": self.shares,
            "remarks": list(self.remarks),
        }


class _FileLayer:
    """A raster file as a layer of a mosaic; its source band is left out."""

    def __init__(self, reader: RasterReader) -> None:
        self.reader = reader
        names = reader.names
        kept = [i for i in range(1, reader.bands + 1) if names[i - 1] != "source"]
        self.kept = kept
        self.grid: Grid = reader.grid

    @property
    def is_relief(self) -> bool:
        """Whether it holds values rather than colours."""
        return self.reader.dtype.kind == "f"

    def read(
        self, column: int, row: int, width: int, height: int
    ) -> tuple[NDArray[Any], BoolArray]:
        """Return a window and its validity."""
        size = (column, row, width, height)
        if self.is_relief:
            values = self.reader.read(*size, bands=self.kept, fill=np.nan)
            values[:, :, 0] = self.reader.read_floats(*size)
            return values, np.isfinite(values[:, :, 0])
        valid = self.reader.read(*size, mask=True) > 0
        return self.reader.read(*size, bands=self.kept), valid

    def reduced(self, width: int, height: int) -> tuple[NDArray[Any], BoolArray]:
        """Return the whole raster shrunk."""
        image, valid = self.reader.read_reduced(width, height, bands=self.kept)
        return image, valid & np.isfinite(image[:, :, 0])


def make_mosaic(
    inputs: Sequence[Path],
    out: Path,
    *,
    gsd: float | None = None,
    bounds: tuple[float, float, float, float] | None = None,
    relief: Sequence[Path] = (),
    priority: bool = False,
    gain: bool = True,
    blend: bool = True,
    overviews: bool = True,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> MosaicResult:
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
        Make the exposure of the inputs equal.
    blend : bool
        Blend over the seams (colours only; relief values are never mixed).

    Raises
    ------
    InputError
        If inputs are missing, differ in kind, or the output cannot be written.
    """
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
        coarse = coarse_grid(grid)
        edges = _relief_of(relief, coarse, stack) if relief else None
        plan = plan_mosaic(
            layers, grid, priority=priority, gain=gain and not values, relief=edges, coarse=coarse
        )
        remarks = _remarks(layers, plan, grid, values=values)
        first = layers[0].reader
        names = [first.names[i - 1] for i in layers[0].kept]
        bands = len(names) + 1
        counts = np.zeros(len(layers) + 1, np.int64)
        total = grid.width * grid.height
        with create_raster(
            out,
            grid,
            bands=bands,
            dtype=first.dtype,
            overwrite=overwrite,
            names=[*names, "source"],
            colour=not values and len(names) == 3,
            nodata=float("nan") if values else None,
            tags={f"BIFOCAL_INPUT_{i}": path.name for i, path in enumerate(inputs, start=1)},
            overviews=overviews,
        ) as writer:
            done = 0
            for column, row, window in grid.tiles(_TILE):
                image, owner = mosaic_window(layers, plan, window, blend=blend)
                source = (owner + 1).astype(first.dtype)
                block = np.concatenate([image, source[:, :, None]], axis=2)
                mask = None if values else owner >= 0
                writer.write(block, column=column, row=row, mask=mask)
                counts += np.bincount((owner + 1).ravel(), minlength=len(counts))
                done += owner.size
                progress(done, total, "mosaic")
            if counts[0] == total:
                raise InputError("none of the rasters shows anything within the bounds.")
    shares = {"none": counts[0] / total}
    shares |= {f"{i} {path.name}": counts[i] / total for i, path in enumerate(inputs, start=1)}
    return MosaicResult(path=out, grid=grid, shares=shares, remarks=tuple(remarks))


def _check_alike(layers: Sequence[_FileLayer]) -> None:
    first = layers[0]
    for layer in layers[1:]:
        same = layer.reader.dtype == first.reader.dtype and len(layer.kept) == len(first.kept)
        if not same:
            raise InputError(
                f"{layer.reader.path} ({len(layer.kept)} bands of {layer.reader.dtype}) and "
                f"{first.reader.path} ({len(first.kept)} of {first.reader.dtype}) cannot be "
                "joined: give only orthophotos of the same kind, or only relief maps."
            )


def _relief_of(paths: Sequence[Path], coarse: Grid, stack: ExitStack) -> NDArray[np.float32]:
    """Return the first known relief of several maps on the coarse grid."""
    found = np.full(coarse.shape, np.nan, np.float32)
    for path in paths:
        reader = stack.enter_context(RasterReader(path))
        check_relief(reader)
        part = MapSurface(reader.grid, reader.read_floats).window(coarse)
        found = np.where(np.isnan(found), part, found)
    return found


def _remarks(layers: Sequence[_FileLayer], plan: Plan, grid: Grid, *, values: bool) -> list[str]:
    """Return what the user should know of how the inputs fit."""
    remarks = []
    names = [layer.reader.path.name for layer in layers]
    moved = [
        name
        for name, layer in zip(names, layers, strict=True)
        if abs(layer.grid.gsd / grid.gsd - 1) > 1e-9
        or max(abs(x - round(x)) for x in grid.offset_in(layer.grid)) > 0.01
    ]
    if moved:
        remarks.append(
            f"resampled, their pixels lie between those of the mosaic: {', '.join(moved)}"
        )
    if not plan.differences:
        remarks.append("the rasters do not overlap: exposure and fit could not be compared.")
    for (i, j), difference in plan.differences.items():
        if values and abs(difference) > _RELIEF_STEP:
            remarks.append(
                f"{names[i]} lies {difference * 1000:+.0f} mm before {names[j]} on their overlap."
            )
    if not values:
        for name, gains in zip(names, plan.gains, strict=True):
            if np.abs(gains - 1).max() > 0.02:
                remarks.append(f"{name}: colours times {', '.join(f'{g:.2f}' for g in gains)}")
    return remarks
