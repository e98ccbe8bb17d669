"""Figures of an adjustment's report: residuals on the images and over depth, correlations."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from multimedia.adjustment.unknowns import Adjustment
from multimedia.media import Camera, Sensor
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.reports import Words

#: Cameras drawn beside one another.
COLUMNS = 2
#: Vectors that are all drawn; of more about so many, one of each plate in each cell.
MOST_ARROWS = 400
#: Colours of plates.
PLATES = ["#1f4e79", "#2e7d32", "#b8860b", "#6a3d9a", "#00838f", "#5d4037"]
#: Residuals this many times the median are drawn in another line.
_LARGE = 4.0
#: Classes of depth whose mean residual is drawn.
_CLASSES = 8


def measured_rows(result: Adjustment, camera: Camera) -> IntArray:
    """Return the rows of a camera's image points that have a residual."""
    rows = np.asarray(result.project.image_points.of_camera(camera.name), dtype=np.int64)
    good: IntArray = rows[np.isfinite(result.residuals[rows, 0])]
    return good


def vector_zoom(result: Adjustment) -> float:
    """Return by how much residuals are enlarged: a round number that shows the usual ones."""
    lengths = np.hypot(*result.residuals.T)
    typical = float(np.nanmedian(lengths)) if np.isfinite(lengths).any() else 0.0
    reach = max(_reach(result, camera) for camera in result.project.cameras)
    return float(10 ** np.round(np.log10(reach / 15 / max(typical, 1e-9))))


def _reach(result: Adjustment, camera: Camera) -> float:
    """Return the half side of the square that shows a camera's image. [mm]"""
    if camera.sensor is not None:
        sides = np.array([camera.sensor.width, camera.sensor.height]) * camera.sensor.pixel_size
        return 0.55 * float(sides.max())
    place = result.project.image_points.image[measured_rows(result, camera)]
    return 1.1 * float(np.abs(place).max(initial=1e-3))


def draw_vectors(figure: Any, result: Adjustment, cameras: Sequence[Camera], say: Words) -> None:
    """Draw the residual vectors of cameras on their images, with axes and a vector to scale."""
    lines = -(-len(cameras) // COLUMNS)
    grid = figure.add_gridspec(
        lines, COLUMNS, left=0.09, right=0.98, bottom=0.3 / (2.4 * lines) * 0.8, top=0.97,
        hspace=0.26, wspace=0.22,
    )  # fmt: skip
    zoom = vector_zoom(result)
    typical = float(np.nanmedian(np.hypot(*result.residuals.T)))
    for number, camera in enumerate(cameras):
        axes = figure.add_subplot(grid[number // COLUMNS, number % COLUMNS])
        rows, reach = measured_rows(result, camera), _reach(result, camera)
        place, miss = result.project.image_points.image[rows], result.residuals[rows]
        large: BoolArray = np.asarray(np.hypot(*miss.T) > _LARGE * typical)
        plate = _plates(result, rows)
        usual = ~large & _thinned(place, plate, reach)
        shades = ["black"] if plate.max(initial=0) == 0 else PLATES
        drawn = [
            (usual & (plate % len(shades) == k), shade, 0.004) for k, shade in enumerate(shades)
        ]
        for chosen, colour, width in (*drawn, (large, "#b00020", 0.008)):
            axes.quiver(
                *place[chosen].T, *(miss[chosen] * zoom).T, angles="xy", scale_units="xy",
                scale=1, width=width, color=colour,
            )  # fmt: skip
        axes.set(aspect="equal", xlim=(-reach, reach), ylim=(-reach, reach))
        axes.axhline(0, color="0.7", lw=0.6, zorder=0)
        axes.axvline(0, color="0.7", lw=0.6, zorder=0)
        if camera.sensor is not None:
            _draw_outline(axes, camera.sensor)
        axes.set_title(_plain(camera.name), fontsize=8)
        axes.set_xlabel("x [mm]", fontsize=7)
        axes.set_ylabel("y [mm]", fontsize=7)
        axes.tick_params(labelsize=6)
        # A bar as long as a residual of a round size.
        size = float(10 ** np.floor(np.log10(0.5 * reach / zoom * 1000)))
        left, low = -0.94 * reach, -0.9 * reach
        axes.plot([left, left + size * zoom / 1000], [low, low], color="black", lw=2.5)
        axes.annotate(
            say("residual_bar", size=f"{size:g}"), (left, low), (0, 3),
            textcoords="offset points", fontsize=6,
        )  # fmt: skip


def _plates(result: Adjustment, rows: IntArray) -> IntArray:
    """Return the number of the group, plate or other, that each image point belongs to."""
    points = result.project.object_points
    group = dict(zip(points.ids, points.groups, strict=True))
    names = [group.get(result.project.image_points.ids[row], "") for row in rows.tolist()]
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return np.array([number[name] for name in names], dtype=np.int64)


def _thinned(place: FloatArray, plate: IntArray, reach: float) -> BoolArray:
    """Return which vectors are drawn: all, or of many the first of each plate in each cell."""
    kept: BoolArray = np.ones(len(place), dtype=bool)
    if len(place) > MOST_ARROWS:
        across = np.sqrt(MOST_ARROWS / (plate.max() + 1))
        cell = np.floor((place / reach + 1.0) * 0.5 * across).astype(np.int64)
        keys = np.column_stack([cell, plate])
        kept[:] = False
        kept[np.unique(keys, axis=0, return_index=True)[1]] = True
    return kept


def _draw_outline(axes: Any, sensor: Sensor) -> None:
    """Draw the rim of the sensor: how much of the image the points fill."""
    rim = np.array([[0, 0], [sensor.width, 0], [sensor.width, sensor.height], [0, sensor.height]])
    corners = sensor.image_from_pixel(rim - 0.5)
    axes.fill(*corners.T, facecolor="0.97", edgecolor="0.4", lw=0.8, zorder=-1)


def depth_and_radial(result: Adjustment) -> tuple[FloatArray, FloatArray]:
    """Return for each image point its depth before the camera and its radial residual.

    Returns
    -------
    depth : ndarray, shape (n,)
        Along the camera's axis; NaN where the point has no place or no residual. [object unit]
    radial : ndarray, shape (n,)
        Away from the principal point positive. [mm]
    """
    project = result.project
    images, points = project.image_points, project.object_points
    rows = np.asarray(points.rows(images.ids), dtype=np.int64)
    xyz = np.where((rows >= 0)[:, None], points.xyz[rows], np.nan)
    depth, radial = np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    for camera in project.cameras:
        mine = measured_rows(result, camera)
        # The camera looks along -z of its own frame.
        depth[mine] = -camera.vectors_to(xyz[mine])[:, 2]
        away = images.image[mine] - camera.principal_point
        length = np.maximum(np.hypot(*away.T), 1e-12)
        radial[mine] = (result.residuals[mine] * away).sum(axis=1) / length
    return depth, radial


def draw_depth(figure: Any, result: Adjustment, say: Words) -> None:
    """Draw radial residuals over depth, and the mean of each class with its standard deviation."""
    depth, radial = depth_and_radial(result)
    good = np.isfinite(depth) & np.isfinite(radial)
    axes = figure.add_axes((0.1, 0.16, 0.87, 0.8))
    axes.axhline(0, color="black", lw=0.8)
    axes.plot(depth[good], radial[good] * 1000, ".", color="0.6", ms=3, rasterized=good.sum() > 5e3)
    edges = np.unique(np.quantile(depth[good], np.linspace(0, 1, _CLASSES + 1)))
    for low, high in pairwise(edges):
        inside = good & (depth >= low) & (depth <= high)
        if inside.sum() > 2:
            values = radial[inside] * 1000
            axes.errorbar(
                depth[inside].mean(), values.mean(), fmt="s",
                yerr=2 * values.std(ddof=1) / len(values) ** 0.5, color="black", ms=5, capsize=3,
            )  # fmt: skip
    axes.set_xlabel(say("depth_axis", unit=result.project.unit), fontsize=8)
    axes.set_ylabel(say("radial_axis"), fontsize=8)
    axes.tick_params(labelsize=7)


def draw_correlations(figure: Any, result: Adjustment, say: Words) -> None:
    """Draw the matrix of correlations; strong ones bear their value in per cent."""
    matrix, names = result.correlations, [_plain(name) for name in result.names]
    count = len(names)
    axes = figure.add_axes((0.17, 0.02, 0.7, 0.81))
    shown = np.where(np.tri(count, dtype=bool), matrix, np.nan)
    image = axes.imshow(shown, cmap="RdBu_r", vmin=-1, vmax=1, interpolation="nearest")
    size = min(7.0, 190 / max(count, 1))
    axes.set_xticks(range(count), names, rotation=90, fontsize=size)
    axes.xaxis.tick_top()
    axes.set_yticks(range(count), names, fontsize=size)
    for spine in axes.spines.values():
        spine.set_visible(False)
    for row, column in zip(*np.nonzero(np.abs(np.tril(matrix, -1)) > 0.7), strict=True):
        value = float(matrix[row, column])
        axes.annotate(
            f"{100 * value:.0f}", (column, row), ha="center", va="center", fontsize=0.75 * size,
            color="white",
        )  # fmt: skip
    bar = figure.colorbar(image, cax=figure.add_axes((0.9, 0.1, 0.02, 0.6)))
    bar.set_label(say("correlation_axis"), fontsize=8)
    bar.ax.tick_params(labelsize=7)


def _plain(text: str) -> str:
    """Return a text of which matplotlib makes no formula."""
    return text.replace("$", r"\$")
