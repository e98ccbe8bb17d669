"""A design study as a workbook and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from multimedia.design.studies import best_placement
from multimedia.projects.point_tables import fill_sheet
from photocore.reports.figure_file import write_figure
from photocore.workbook.newbook import new_workbook, save_book

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
    headings = ("depth", "sigma X", "sigma Y", "sigma Z", "angle deg", "in air deg")
    fill_sheet(sheet, headings, design.by_depth.tolist())
    chart = LineChart()
    chart.title = f"Expected sigma over depth [{design.unit}]"
    last = 1 + len(design.by_depth)
    chart.add_data(
        Reference(sheet, min_col=2, max_col=4, min_row=1, max_row=last), titles_from_data=True
    )
    chart.set_categories(Reference(sheet, min_col=1, min_row=2, max_row=last))
    chart.x_axis.delete = chart.y_axis.delete = False
    sheet.add_chart(chart, "H2")
    fill_sheet(
        book.create_sheet("Sensitivity"), ("unknown", "step", "dX", "dY", "dZ"),
        [(name, step, *moved) for name, step, moved in design.sensitivities],
    )  # fmt: skip
    fill_sheet(
        book.create_sheet("Placement"),
        ("half angle deg", "sigma X", "sigma Y", "sigma Z", "ray angle deg"),
        [
            (np.degrees(p.half_angle), *p.sigma, np.degrees(p.angle))
            for p in design.placements
        ],
    )  # fmt: skip
    if design.costs is not None:
        costs = design.costs
        fill_sheet(
            book.create_sheet("Calibration"), ("case", "mu X", "mu Y", "mu Z", "sigma0 mm"),
            [
                ("I air, calibrated in air", *costs.air, costs.sigma0[0]),
                ("II water, calibrated in air", *costs.air_calibration_in_water, costs.sigma0[1]),
                ("III water, calibrated in water", *costs.water, costs.sigma0[2]),
            ],
        )  # fmt: skip
    fill_sheet(
        book.create_sheet("Models"), ("model", "RMS", "largest"),
        [*design.models, ("colour seam in the image, mm", design.seam, design.seam)],
    )  # fmt: skip
    if design.planarity:
        columns = ("deviation", "size", "wavelength", "dX", "dY", "dZ", "largest",
                    "size as noise")  # fmt: skip
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

    count = 4 if design.planarity else 3
    figure = Figure(figsize=(4 * count, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    left, middle, right, *more = figure.subplots(1, count)
    depth = design.by_depth[:, 0]
    for column, (name, style) in enumerate(_STYLES.items(), start=1):
        left.plot(depth, design.by_depth[:, column], label=f"sigma {name}", **style)
    left.set(xlabel=f"depth [{design.unit}]", ylabel=f"[{design.unit}]", title="Expected precision")
    middle.plot(depth, design.by_depth[:, 4], marker="o", label="through water")
    middle.plot(depth, design.by_depth[:, 5], marker="s", label="tank empty")
    middle.set(xlabel=f"depth [{design.unit}]", ylabel="[deg]", title="Intersection angle")
    if design.placements:
        angles = [np.degrees(p.half_angle) for p in design.placements]
        for axis, (name, style) in enumerate(_STYLES.items()):
            sigma = [p.sigma[axis] for p in design.placements]
            right.plot(angles, sigma, label=f"sigma {name}", **style)
        best, open_end = best_placement(design.placements)
        label = "best tried" if open_end else "best"
        right.axvline(np.degrees(best.half_angle), color="grey", linestyle=":", label=label)
    right.set(xlabel="half opening in air [deg]", ylabel=f"[{design.unit}]", title="Placement")
    for axes in more:
        _draw_flatness(axes, design)
    for axes in (left, middle, right, *more):
        axes.grid(alpha=0.3)
        axes.set_ylim(bottom=0)
        if axes.lines:
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


def _draw_flatness(axes: Axes, design: Design) -> None:
    """Draw what waves cost over their length, with bend and wedge as lines across."""
    waves = [d for d in design.planarity if d.kind == "waves"]
    lengths = [d.wavelength for d in waves]
    for axis, (name, style) in enumerate(_STYLES.items()):
        axes.plot(
            lengths, [d.shift[axis] for d in waves],
            label=f"d{name}, waves of {waves[0].size * 1000:g} mrad", **style,
        )  # fmt: skip
    for one, dashes in zip((d for d in design.planarity if d.kind != "waves"), ("-.", ":"),
                           strict=False):  # fmt: skip
        total = float(np.linalg.norm(one.shift))
        size = f"{one.size:g} {design.unit}" if one.kind == "bend" else f"{one.size * 1000:g} mrad"
        axes.axhline(total, color="black", linestyle=dashes, label=f"{one.kind} of {size}, total")
    highest = max(float(np.linalg.norm(d.shift)) for d in design.planarity)
    axes.set(
        xscale="log", ylim=(0, 1.7 * highest), title="Faces that are not plane",
        xlabel=f"length of the waves [{design.unit}]", ylabel=f"RMS error [{design.unit}]",
    )  # fmt: skip
    axes.set_xticks(lengths, labels=[f"{v:.2g}" for v in lengths])
    axes.minorticks_off()
