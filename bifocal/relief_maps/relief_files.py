"""A picture of a relief map: colours with hill shade."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bifocal.model.relief_map import TOLD, ReliefMap
from photocore.arrays import Float32Array, FloatArray
from photocore.output import check_ending
from photocore.reports.figure_file import write_figure

#: Longer side of a preview. [px]
PREVIEW_SIDE = 2000


def write_preview(path: Path | str, relief: ReliefMap, *, overwrite: bool = False) -> None:
    """Write a picture of the relief: colours with hill shade, colour bar, axes in metres."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    path = Path(path)
    check_ending(path, "the preview is written as .png.", ".png")
    step = max(1, -(-max(relief.shape) // PREVIEW_SIDE))
    r = relief.r[::step, ::step]
    finite = np.isfinite(r)
    low, high = (float(v) for v in np.percentile(r[finite], [0.5, 99.5]))
    scale = ScalarMappable(Normalize(low, max(high, low + 1e-3)), "viridis")
    picture = shaded(scale.to_rgba(r)[..., :3], r, relief.gsd * step)
    guessed = finite & ~np.isin(relief.quality[::step, ::step], TOLD)
    picture = hatched(picture, guessed)
    picture[~finite] = 1.0
    height, width = r.shape
    size = 12.0 if width >= height else 12.0 * width / height + 2.5
    figure = Figure(figsize=(size, size * height / width * 0.82 + 1.0), dpi=150)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    x_min, y_min, x_max, y_max = relief.bounds
    axes.imshow(picture, extent=(x_min, x_max, y_min, y_max), interpolation="antialiased")
    axes.set_xlabel("X [m]")
    axes.set_ylabel("Y [m]")
    guess = ~np.isin(relief.quality, TOLD) & relief.known
    if guess.any():
        axes.set_title(
            f"hatched grey: not measured but interpolated or hidden, {guess.mean():.0%} of the map",
            fontsize=9,
        )
    bar = figure.colorbar(scale, ax=axes, fraction=0.035, pad=0.02)
    bar.set_label("relief r [m], positive towards the cameras")
    write_figure(path, figure, overwrite=overwrite, bbox_inches="tight")


def hatched(colours: NDArray[np.floating], where: NDArray[np.bool_]) -> FloatArray:
    """Return colours greyed and hatched where relief is not measured, shape (h, w, 3)."""
    rows, columns = np.nonzero(where)
    result = np.array(colours, dtype=np.float64)
    stripe = (rows + columns) % 8 < 2
    result[where] = 0.2 * result[where] + np.where(stripe, 0.4, 0.62)[:, None]
    return result


def shaded(colours: NDArray[np.floating], r: Float32Array, gsd: float) -> FloatArray:
    """Return colours darkened and lightened by light from the upper left, shape (h, w, 3)."""
    filled = np.where(np.isfinite(r), r, np.nanmedian(r)).astype(np.float64)
    down, across = np.gradient(filled, gsd)
    # Slopes are halved: steps of a façade are steep, and its surfaces should not turn black.
    normal = np.stack([-0.5 * across, 0.5 * down, np.ones_like(filled)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    light = np.array([-0.45, 0.5, 0.74])
    shade = np.clip(normal @ light / light[2], 0.25, 1.6)
    return np.clip(colours * shade[..., None] ** 0.8, 0, 1)
