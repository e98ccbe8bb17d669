"""A design study as a workbook and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from multimedia.design.studies import best_placement
from multimedia.projects import fill_sheet
from photocore.reports import write_figure
from photocore.workbook import new_workbook, save_book

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from multimedia.design.studies import Design


def write_design_workbook(path: Path | str, design: Design, *, overwrite: bool = False) -> None:
    """Write precision per depth, sensitivities, placements and calibration costs as .xlsx."""
    from openpyxl import Workbook
    from openpyxl.chart import LineChart, Reference

    book = Workbook()
    sheet = book.active
    sheet.title = "Precision"
    unit = design.unit
    sigmas, errors = ([f"{what}{axis} [{unit}]" for axis in "XYZ"] for what in ("sigma ", "d"))
    headings = (f"depth [{unit}]", *sigmas, "angle [deg]", "in air [deg]")
    fill_sheet(sheet, headings, design.by_depth.tolist())
    chart = LineChart()
    chart.title = f"Expected sigma, to first order [{design.unit}]"
    last = 1 + len(design.by_depth)
    chart.add_data(
        Reference(sheet, min_col=2, max_col=4, min_row=1, max_row=last), titles_from_data=True
    )
    chart.set_categories(Reference(sheet, min_col=1, min_row=2, max_row=last))
    chart.x_axis.delete = chart.y_axis.delete = False
    sheet.add_chart(chart, "H2")
    fill_sheet(
        book.create_sheet("Sensitivity"), ("unknown", "step", *errors),
        [(name, step, *moved) for name, step, moved in design.sensitivities],
    )  # fmt: skip
    fill_sheet(
        book.create_sheet("Placement"),
        ("half angle [deg]", *sigmas, "ray angle [deg]"),
        [(np.degrees(p.half_angle), *p.sigma, np.degrees(p.angle)) for p in design.placements],
    )
    if design.costs is not None:
        costs = design.costs
        fill_sheet(
            book.create_sheet("Calibration"),
            ("case", *(f"mu {axis} [{unit}]" for axis in "XYZ"), "sigma0 [mm]"),
            [
                ("I air, calibrated in air", *costs.air, costs.sigma0[0]),
                ("II water, calibrated in air", *costs.air_calibration_in_water, costs.sigma0[1]),
                ("III water, calibrated in water", *costs.water, costs.sigma0[2]),
            ],
        )  # fmt: skip
    fill_sheet(
        book.create_sheet("Models"), ("model", f"RMS [{unit}]", f"largest [{unit}]"),
        [*design.models, ("colour seam in the image, mm", design.seam, design.seam)],
    )  # fmt: skip
    if design.planarity:
        columns = (
            "deviation", f"size [{unit} sag, rad]", f"wavelength [{unit}]", *errors,
            f"largest [{unit}]", f"size as noise [{unit} sag, rad]",
        )  # fmt: skip
        fill_sheet(
            book.create_sheet("Flatness"), columns,
            [
                (d.kind, d.size, None if d.kind != "waves" else d.wavelength, *d.shift, d.largest,
                 d.allowed)
                for d in design.planarity
            ],
        )  # fmt: skip
    for item in book.worksheets:
        for cell in item[1]:
            item.column_dimensions[cell.column_letter].width = 18
    with new_workbook(path, overwrite=overwrite) as temporary:
        save_book(book, temporary)


def write_design_plot(path: Path | str, design: Design, *, overwrite: bool = False) -> None:
    """Draw precision over depth, ray angles in air and water, and placements (.png, .svg, .pdf)."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    parts = [_draw_precision, _draw_angles]
    parts += [_draw_placements] if design.placements else []
    parts += [_draw_flatness] if design.planarity else []
    figure = Figure(figsize=(4 * len(parts), 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, draw in zip(figure.subplots(1, len(parts)), parts, strict=True):
        draw(axes, design)
        axes.grid(alpha=0.3)
        axes.legend()
    with mpl.rc_context():
        write_figure(path, figure, overwrite=overwrite, dpi=130)


#: Curves that coincide, as X and Y of a symmetric ring do, stay visible: a wide line below a
#: narrow broken one, hollow markers around full ones.
_STYLES: dict[str, dict[str, Any]] = {
    "X": {"marker": "o", "markersize": 9, "markerfacecolor": "none", "linewidth": 4, "alpha": 0.5},
    "Y": {"marker": "s", "markersize": 4, "linestyle": "--", "linewidth": 1.5},
    "Z": {"marker": "^", "markersize": 6},
}


#: Steps from a unit to a smaller one, in which small values are shown.
_SMALLER = {"m": ("mm", "µm"), "mm": ("µm",)}


def _shown(values: Sequence[float], unit: str) -> tuple[float, str]:
    """Return factor and unit in which the largest of values has a digit before the point."""
    factor = 1.0
    for smaller in _SMALLER.get(unit, ()):
        if max(values) * factor >= 1.0:
            break
        factor, unit = 1000 * factor, smaller
    return factor, unit


def _draw_precision(axes: Axes, design: Design) -> None:
    """Draw standard deviations over depth."""
    depth, sigmas = design.by_depth[:, 0], design.by_depth[:, 1:4]
    factor, unit = _shown([float(sigmas.max())], design.unit)
    for sigma, (name, style) in zip(sigmas.T, _STYLES.items(), strict=True):
        axes.plot(depth, factor * sigma, label=f"sigma {name}", **style)
    axes.set(xlabel=f"depth [{design.unit}]", ylabel=f"[{unit}]", title="Precision, to first order")
    axes.set_ylim(0, 1.15 * factor * float(sigmas.max()))
    axes.locator_params(axis="x", nbins=5)


def _draw_angles(axes: Axes, design: Design) -> None:
    """Draw the angles of rays over depth, in water and with the tank empty."""
    depth, water, air = design.by_depth[:, [0, 4, 5]].T
    axes.plot(depth, water, marker="o", markersize=9, markerfacecolor="none", label="through water")
    axes.plot(depth, air, marker="s", markersize=5, linestyle="--", label="tank empty")
    axes.set(xlabel=f"depth [{design.unit}]", ylabel="[deg]", title="Intersection angle")
    axes.set_ylim(0, 1.15 * float(np.nanmax(design.by_depth[:, 4:6])))
    axes.locator_params(axis="x", nbins=5)


def _draw_placements(axes: Axes, design: Design) -> None:
    """Draw standard deviations over the opening of the cone of cameras, and the best of them."""
    angles = [np.degrees(p.half_angle) for p in design.placements]
    sigmas = np.array([p.sigma for p in design.placements])
    factor, unit = _shown([float(sigmas.min(axis=0).max())], design.unit)
    for sigma, (name, style) in zip(sigmas.T, _STYLES.items(), strict=True):
        axes.plot(angles, factor * sigma, label=f"sigma {name}", **style)
    best, open_end = best_placement(design.placements)
    label = "best tried" if open_end else "best"
    axes.axvline(np.degrees(best.half_angle), color="grey", linestyle=":", label=label)
    axes.set(xlabel="half opening in air [deg]", ylabel=f"[{unit}]", title="Placement")
    axes.set_ylim(0, 1.15 * factor * float(sigmas.max()))


def _draw_flatness(axes: Axes, design: Design) -> None:
    """Draw what waves cost over their length, with bend and wedge as lines across."""
    waves = [d for d in design.planarity if d.kind == "waves"]
    lengths = [d.wavelength for d in waves]
    highest = max(float(np.linalg.norm(d.shift)) for d in design.planarity)
    factor, unit = _shown([highest], design.unit)
    for axis, (name, style) in enumerate(_STYLES.items()):
        axes.plot(
            lengths, [factor * d.shift[axis] for d in waves],
            label=f"d{name}, waves of {waves[0].size * 1000:g} mrad", **style,
        )  # fmt: skip
    for one, dashes in zip((d for d in design.planarity if d.kind != "waves"), ("-.", ":"),
                           strict=False):  # fmt: skip
        total = factor * float(np.linalg.norm(one.shift))
        size = f"{one.size:g} {design.unit}" if one.kind == "bend" else f"{one.size * 1000:g} mrad"
        axes.axhline(total, color="black", linestyle=dashes, label=f"{one.kind} of {size}, total")
    axes.set(
        xscale="log", ylim=(0, 1.7 * factor * highest), title="Faces that are not plane",
        xlabel=f"length of the waves [{design.unit}]", ylabel=f"RMS error [{unit}]",
    )  # fmt: skip
    axes.set_xticks(lengths, labels=[f"{v:.2g}" for v in lengths])
    axes.minorticks_off()
