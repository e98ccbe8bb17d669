"""A design study as a workbook and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from multimedia.projects.point_tables import fill_sheet
from photocore.reports.figure_file import write_figure
from photocore.workbook.newbook import new_workbook, save_book

if TYPE_CHECKING:
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

    figure = Figure(figsize=(12, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    left, middle, right = figure.subplots(1, 3)
    depth = design.by_depth[:, 0]
    for column, name in ((1, "X"), (2, "Y"), (3, "Z")):
        left.plot(depth, design.by_depth[:, column], marker="o", label=f"sigma {name}")
    left.set(xlabel=f"depth [{design.unit}]", ylabel=f"[{design.unit}]", title="Expected precision")
    middle.plot(depth, design.by_depth[:, 4], marker="o", label="through water")
    middle.plot(depth, design.by_depth[:, 5], marker="s", label="tank empty")
    middle.set(xlabel=f"depth [{design.unit}]", ylabel="[deg]", title="Intersection angle")
    if design.placements:
        angles = [np.degrees(p.half_angle) for p in design.placements]
        for axis, name in enumerate("XYZ"):
            right.plot(angles, [p.sigma[axis] for p in design.placements], label=f"sigma {name}")
    right.set(xlabel="half opening in air [deg]", ylabel=f"[{design.unit}]", title="Placement")
    for axes in (left, middle, right):
        axes.grid(alpha=0.3)
        axes.set_ylim(bottom=0)
        if axes.lines:
            axes.legend()
    with mpl.rc_context():
        write_figure(path, figure, overwrite=overwrite, dpi=130)
