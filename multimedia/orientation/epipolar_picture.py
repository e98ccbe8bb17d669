"""A picture of epipolar curves and their candidates over the photo."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.projects import read_photo
from photocore.arrays import FloatArray
from photocore.output import check_ending
from photocore.reports import write_figure

#: Curves whose depth marks are named; more would cover the photo.
MOST_NAMED = 3
#: Around a name no other one begins. [dots]
_ROOM = 2.0
#: What takes less than this share of the image is shown enlarged.
_SMALL = 0.25


def draw_epipolar(
    path: Path,
    curves: Sequence[FloatArray],
    labels: Sequence[str],
    targets: FloatArray,
    *,
    size: tuple[int, int],
    depths: Sequence[FloatArray] = (),
    photo: Path | None = None,
    title: str = "",
    overwrite: bool = False,
) -> None:
    """Draw curves in pixels over a photo, or over an empty frame of its size.

    Parameters
    ----------
    path : path
        .png, .svg or .pdf.
    curves : sequence of ndarray, shape (k, 2)
        Vertices (column, row). [px]
    labels : sequence of str
        One per curve.
    targets : ndarray, shape (m, 2)
        Candidates. [px]
    size : tuple of int
        Width and height of the image. [px]
    depths : sequence of ndarray, shape (k,)
        Z of the vertices, for marks at round values; none without it. [object unit]
    photo : path, optional
        The image to draw over.
    title : str
        Heading.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If the photo cannot be read or the ending is unknown.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patheffects import withStroke

    check_ending(path, "a picture is written as .png, .svg or .pdf.", ".png", ".svg", ".pdf")
    figure = Figure(figsize=(9.0, 9.0 * size[1] / size[0] + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    if photo is not None:
        axes.imshow(read_photo(photo), cmap="gray", interpolation="nearest")
    for curve, label in zip(curves, labels, strict=True):
        finite = curve[np.isfinite(curve).all(axis=1)]
        (line,) = axes.plot(finite[:, 0], finite[:, 1], "-", linewidth=1.2)
        if len(finite):
            axes.annotate(
                label, finite[len(finite) // 2], color=line.get_color(), fontsize=9,
                xytext=(4, 4), textcoords="offset points",
                path_effects=[withStroke(linewidth=2.0, foreground="white")],
            )  # fmt: skip
    if len(targets):
        axes.plot(
            targets[:, 0], targets[:, 1], "o", fillstyle="none", markersize=7, color="tab:red",
            label="candidates",
        )  # fmt: skip
        axes.legend(loc="upper right")
    columns, rows = _window([*curves, targets], size)
    axes.set(xlim=columns, ylim=rows[::-1], aspect="equal")
    axes.set(xlabel="column [px]", ylabel="row [px]", title=title)
    if depths:
        figure.draw_without_rendering()  # where marks lie decides which names have room
        _mark_depths(axes, curves, depths)
    write_figure(path, figure, overwrite=overwrite, dpi=150)


def _mark_depths(axes: Any, curves: Sequence[FloatArray], depths: Sequence[FloatArray]) -> None:
    """Mark round values of Z along the curves, named on the first of them."""
    from matplotlib.ticker import MaxNLocator

    low = min(float(np.min(z)) for z in depths)
    high = max(float(np.max(z)) for z in depths)
    values = [v for v in MaxNLocator(5).tick_values(low, high) if low <= v <= high]
    named, boxes = 0, list[Any]()
    for curve, z in zip(curves, depths, strict=True):
        good = np.isfinite(curve).all(axis=1) & np.isfinite(z)
        if good.sum() < 2:
            continue
        order = np.argsort(z[good])
        along, places = z[good][order], curve[good][order]
        inside = [v for v in values if along[0] <= v <= along[-1]]
        marks = np.column_stack([np.interp(inside, along, places[:, k]) for k in (0, 1)])
        # White with a dark rim: seen on dark water and on bright glass.
        axes.plot(
            marks[:, 0], marks[:, 1], "o", markersize=4, markerfacecolor="white",
            markeredgecolor="black", linestyle="none", gid="depth-marks",
        )  # fmt: skip
        if named < MOST_NAMED:
            level = float(np.ptp(places[:, 0])) > float(np.ptp(places[:, 1]))
            named += _name_depths(axes, inside, marks, boxes, level=level)


def _name_depths(
    axes: Any, depths: Sequence[float], marks: FloatArray, boxes: list[Any], *, level: bool
) -> bool:
    """Name the marks of a curve where a name hides no other one; return whether any is named.

    Below the marks of a curve that runs level, else beside them, to the left. The ends come first,
    and lean outwards.
    """
    before = len(boxes)
    last = len(marks) - 1
    for k in sorted(range(len(marks)), key=lambda k: k not in (0, last)):
        place = {"xytext": (-8, 0), "ha": "right", "va": "center"}
        if level:
            outwards = np.sign(marks[k, 0] - marks[last - k, 0]) if k in (0, last) else 0
            side = {-1: "right", 0: "center", 1: "left"}[int(outwards)]
            place = {"xytext": (-3 * outwards, -8), "ha": side, "va": "top"}
        name = axes.annotate(
            f"Z {depths[k]:g}", marks[k], fontsize=7, textcoords="offset points",
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "linewidth": 0.3}, **place,
        )  # fmt: skip
        box = name.get_window_extent().padded(_ROOM)
        if any(box.overlaps(earlier) for earlier in boxes):
            name.remove()
        else:
            boxes.append(box)
    return len(boxes) > before


def _window(
    drawn: Sequence[FloatArray], size: tuple[int, int]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return limits of columns and rows: the whole image, or what is drawn where that is small."""
    whole = (-0.5, size[0] - 0.5), (-0.5, size[1] - 0.5)
    places = np.concatenate([np.zeros((0, 2)), *drawn])
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        return whole
    low, high = places.min(axis=0), places.max(axis=0)
    share = float(np.max((high - low) / size))
    if share > _SMALL:
        return whole
    # Twice as much as is drawn, of the form of the image, and inside it.
    half = max(share, 20 / min(size)) * np.array(size, dtype=float)
    middle = np.clip((low + high) / 2, half - 0.5, np.array(size) - 0.5 - half)
    left, top = (middle - half).tolist()
    right, bottom = (middle + half).tolist()
    return (left, right), (top, bottom)
