"""What each figure shows, as text: limits, labels, curves, marks, colours, against golden lines.

.venv/bin/python -m tests.test_figures     writes them anew, to be looked through as a change
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from bifocal import Pair, Quality, ReliefMap
from bifocal.relief_maps import relief_files
from bifocal.reports import figures
from multimedia import Camera, ImagePoints, ObjectPoints, Sensor
from multimedia.adjustment import report_figures
from multimedia.design import design_files
from multimedia.orientation import epipolar_picture

GOLDEN = Path(__file__).parent / "golden/figures.txt"


def say(key: str, **blanks: object) -> str:
    return " ".join([key, *(f"{name}={value}" for name, value in blanks.items())])


def short(value: Any) -> str:
    """Return a value with four digits; of many numbers how many, and what tells them apart."""
    if isinstance(value, str) or value is None:
        return str(value)
    numbers = np.ma.filled(np.ma.asarray(value, dtype=float), np.nan).ravel()
    if len(numbers) > 6:
        finite = numbers[np.isfinite(numbers)]
        weights = np.arange(1, len(finite) + 1)
        facts = (*np.percentile(finite, [0, 50, 100]), finite @ weights / weights.sum())
        return f"{len(numbers)} ({len(finite)}): " + " ".join(f"{n:.4g}" for n in facts)
    return " ".join(f"{number + 0.0:.4g}" for number in numbers)


def described(figure: Any) -> Iterator[str]:
    """Yield what a figure shows, a line for each thing."""
    yield f"figure {short(figure.get_size_inches())}"
    is_free = figure.get_layout_engine() is None
    for axes in figure.axes:
        place = short(axes.get_position().bounds) if is_free else ""
        yield f"axes {place} x {short(axes.get_xlim())} y {short(axes.get_ylim())}"
        words = axes.get_title(), axes.get_xlabel(), axes.get_ylabel()
        yield f"  {' | '.join(words)} | {axes.get_aspect()} {axes.axison}"
        for image in axes.images:
            yield (
                f"  image {short(image.get_array())} at {short(image.get_extent())} "
                f"{image.get_cmap().name} {short(image.get_clim())} {image.get_alpha()}"
            )
        for line in axes.lines:
            yield (
                f"  line {short(line.get_xdata())} / {short(line.get_ydata())} "
                f"{to_hex(line.get_color())} {line.get_linestyle()} {short(line.get_linewidth())} "
                f"{line.get_marker()} {short(line.get_markersize())} "
                f"{to_hex(line.get_markeredgecolor())} {short(line.get_markeredgewidth())} "
                f"{line.get_label().partition('_')[0]}"
            )
        for marks in axes.collections:
            yield (
                f"  {type(marks).__name__} {short(marks.get_offsets())} "
                f"{short(marks.get_array())} {short(marks.get_linewidths())} "
                f"{short(marks.get_facecolor())} {short(getattr(marks, 'U', None))} "
                f"{short(getattr(marks, 'V', None))} {short(getattr(marks, 'width', None))}"
            )
        for patch in axes.patches:
            yield f"  patch {short(patch.get_path().get_extents().bounds)} {patch.get_hatch()}"
        for text in axes.texts:
            yield (
                f"  text {text.get_text()!r} at {short(getattr(text, 'xy', ()))} "
                f"{short(text.get_position())} {short(text.get_rotation())} "
                f"{short(text.get_fontsize())} {text.get_ha()} {text.get_va()} "
                f"{to_hex(text.get_color())}"
            )


def content() -> SimpleNamespace:
    """Return what a report of a pair holds: a wall of 6 x 4 m with five compared points."""
    rng = np.random.default_rng(3)
    size = (60, 40)
    pair = Pair.ideal(
        d1=17.5, d2=9.5, c1=35.0, c2=19.0, pixel_size=0.2, nadir1=(29.5, 19.5), nadir2=(31.0, 18.0)
    )
    xyz = np.array([[-2.0, 1, 0.1], [1.5, -1.2, 0], [0.3, 0.8, -0.2], [2.2, 1.1, 0.4], [9, 9, 0]])
    errors = rng.normal(0, 0.004, (5, 3))
    errors[1, 2] = np.nan
    pixels = [photo.project(xyz) for photo in (pair.image1, pair.image2)]
    pixels[0][2] = np.nan
    r = np.add.outer(np.linspace(-0.2, 0.3, 40), np.linspace(0, 0.1, 60)).astype(np.float32)
    r[:5, :7] = np.nan
    quality = np.full(r.shape, Quality.MEASURED, np.uint8)
    quality[20:, 40:] = Quality.INTERPOLATED
    sigma = np.linspace(0.001, 0.02, r.size, dtype=np.float32).reshape(r.shape)
    matrix = np.array([[0.1, 0, -3], [0, -0.1, 2], [0, 0, 1.0]])
    relief = ReliefMap(r=r, sigma=sigma, quality=quality, plane_from_pixel=matrix)
    check = SimpleNamespace(solved=xyz, errors=errors)
    photos = tuple(
        SimpleNamespace(
            picture=np.full((20, 30), 9 * k, np.uint8), reduction=2.0, photo=photo, size=size
        )
        for k, photo in enumerate((pair.image1, pair.image2), start=1)
    )
    rows = [[2, 1, 20, 0.2, 0.4], [0, 0, 5, 0.1, 0.7]]
    cells = [{"side": 8, "rows": rows}, {"side": 8, "rows": rows[:1]}]
    return SimpleNamespace(
        pair=pair, cameras=(pair.image1, pair.image2), names=lambda _: ("far", "near"),
        photos=photos, control_ids={"A", "C"}, relief=relief,
        ortho=(np.full((8, 12, 3), 7), (-3.0, -2.0, 3.0, 2.0)),
        solution=SimpleNamespace(
            table=_Table(xyz), points=SimpleNamespace(pixels=pixels), check=check
        ),
        setup={"common_points": {"cells": cells}}, orientation=None,
    )  # fmt: skip


class _Table:
    """Points that know how many they are."""

    def __init__(self, xyz: np.ndarray) -> None:
        self.xyz, self.ids = xyz, "ABCDE"

    def __len__(self) -> int:
        return len(self.ids)


def of_a_pair() -> Iterator[tuple[str, Any]]:
    whole = content()
    for name, more in (
        ("ortho", ()), ("plan", (say,)), ("photo", (whole.photos[0], 1)), ("ties", (say,)),
        ("relief", (say,)), ("sigma", (say, 0.01)), ("errors", (say,)), ("histogram", (say,)),
    ):  # fmt: skip
        figure = Figure(figsize=(6, 4))
        getattr(figures, f"draw_{name}")(figure, whole, *more)
        yield f"pair {name}", figure


def of_an_adjustment() -> Iterator[tuple[str, Any]]:
    rng = np.random.default_rng(4)
    count = 60
    image = rng.uniform(-4, 4, (2 * count, 2))
    residuals = rng.normal(0, 0.0004, (2 * count, 2))
    residuals[3], residuals[7] = (0.004, 0.002), np.nan
    names = [f"cam{number}" for number in (1, 2)]
    sensor = Sensor(width=400, height=300, pixel_size=[0.025, 0.025], origin=[199.5, 149.5])
    cameras = [
        Camera(name=name, principal_distance=8.0, centre=(x, 0, 500), rotation=np.eye(3),
               sensor=sensor if x < 0 else None)
        for name, x in zip(names, (-100, 100), strict=True)
    ]  # fmt: skip
    ids = tuple(f"{number}" for number in range(count))
    xyz = np.column_stack([rng.uniform(-200, 200, (count, 2)), rng.uniform(-200, 0, count)])
    points = ObjectPoints(ids=ids, xyz=xyz, groups=("plate", "wand") * (count // 2))
    measured = ImagePoints(
        cameras=tuple(name for name in names for _ in ids), ids=ids * 2, image=image
    )
    result = SimpleNamespace(
        project=SimpleNamespace(
            cameras=cameras, image_points=measured, object_points=points, unit="mm"
        ),
        residuals=residuals, names=["X", "Y $", "c"],
        correlations=np.array([[1, 0.9, 0.2], [0.9, 1, -0.75], [0.2, -0.75, 1]]),
    )  # fmt: skip
    for name, more in (("vectors", (cameras, say)), ("depth", (say,)), ("correlations", (say,))):
        figure = Figure(figsize=(6, 4))
        getattr(report_figures, f"draw_{name}")(figure, result, *more)
        yield f"adjustment {name}", figure


def kept(monkeypatch: pytest.MonkeyPatch, module: Any, draw: Any, *values: Any, **more: Any) -> Any:
    """Return the figure that is written, in place of the file."""
    figures_drawn = []
    monkeypatch.setattr(
        module, "write_figure", lambda _, figure, **__: figures_drawn.append(figure)
    )
    draw(*values, **more)
    (figure,) = figures_drawn
    return figure


def of_files(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, Any]]:
    out = Path("o.png")
    relief = content().relief
    yield "preview", kept(monkeypatch, relief_files, relief_files.write_preview, out, relief)
    x = np.linspace(0, 100, 11)
    curves = [np.column_stack([x, 40 + 0.1 * x]), np.column_stack([40 + 0.05 * x, x / 2])]
    yield "epipolar", kept(
        monkeypatch, epipolar_picture, epipolar_picture.draw_epipolar, out, curves, ["a", "b"],
        np.array([[50.0, 45.0], [60.0, 46.0]]), size=(120, 80), depths=[-x / 50, -x / 40],
        title="cam1 to cam2",
    )  # fmt: skip
    by_depth = np.column_stack([
        np.linspace(0.02, 0.2, 5), *np.outer([1e-5, 2e-5, 4e-5], np.linspace(1, 2, 5)),
        np.linspace(60, 50, 5), np.linspace(70, 62, 5),
    ])  # fmt: skip
    placements = tuple(
        SimpleNamespace(half_angle=np.radians(a), sigma=(2e-5, 2e-5, 1e-3 / a))
        for a in (10, 20, 30)
    )
    waves = [
        SimpleNamespace(kind="waves", wavelength=w, size=0.001, shift=(w, w / 2, w / 3))
        for w in (0.1, 0.2)
    ]
    waves.append(SimpleNamespace(kind="bend", wavelength=0.0, size=0.002, shift=(0.01, 0.02, 0.03)))
    design = SimpleNamespace(by_depth=by_depth, unit="m", placements=placements, planarity=waves)
    yield "design", kept(monkeypatch, design_files, design_files.write_design_plot, out, design)


def test_every_figure_shows_what_it_did(monkeypatch):
    """A scale, a limit or a place that is wrong is seen by nobody who does not know the data."""
    blocks = [
        "\n".join([f"[{name}]", *described(figure)])
        for name, figure in (*of_a_pair(), *of_an_adjustment(), *of_files(monkeypatch))
    ]
    golden = GOLDEN.read_text("utf-8").strip().split("\n\n") if GOLDEN.exists() else []
    if __name__ == "__main__":
        GOLDEN.write_text("\n\n".join(blocks) + "\n", "utf-8")
    else:
        assert blocks == golden, "On purpose? .venv/bin/python -m tests.test_figures"


if __name__ == "__main__":
    with pytest.MonkeyPatch.context() as patch:
        test_every_figure_shows_what_it_did(patch)
