"""Project in, adjusted project and report out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.adjustment.bundle import bundle_adjust
from multimedia.adjustment.extensions import Extension, diagnose
from multimedia.adjustment.report import write_adjustment_report
from multimedia.adjustment.unknowns import Adjustment, ScaleBar, Unknowns
from multimedia.projects import Project, read_project, write_project
from multimedia.refraction import salinity_from_index, water_index_derivatives
from multimedia.remarks import remark
from photocore.errors import InputError
from photocore.output import all_or_none, check_all_writable, check_ending
from photocore.reports import check_report, words_of

#: Every group of object points is a plate.
ALL = ("all",)


@all_or_none()
def adjust_project(
    source: Path,
    unknowns: Unknowns,
    *,
    out: Path | None = None,
    report: Path | None = None,
    language: str = "en",
    overwrite: bool = False,
) -> tuple[Adjustment, tuple[str, ...]]:
    """Adjust a project file; write the adjusted project and the report where asked.

    Plates `ALL` are all groups of its object points.

    Returns
    -------
    result : Adjustment
    remarks : tuple of str
    """
    check_all_writable(out, report, overwrite=overwrite)
    check_ending(out, "a project is written as .toml.", ".toml")
    check_report(report)
    project = read_project(source, posed=False)
    result = bundle_adjust(project, _with_all_plates(source, project, unknowns))
    if out is not None:
        write_project(out, result.project, overwrite=overwrite)
    if report is not None:
        title = words_of("multimedia.adjustment", language)(
            "title", name=project.name or source.name
        )
        write_adjustment_report(
            report, result, title=title, language=language, notes=project.remarks,
            overwrite=overwrite,
        )  # fmt: skip
    return result, (*project.remarks, *result.remarks)


def diagnose_project(source: Path, unknowns: Unknowns) -> tuple[float, list[Extension]]:
    """Return sigma0 of a project file and what would lower it most; see `diagnose`."""
    project = read_project(source, posed=False)
    return diagnose(project, _with_all_plates(source, project, unknowns))


def _with_all_plates(source: Path, project: Project, unknowns: Unknowns) -> Unknowns:
    """Return the unknowns with all groups of object points in the place of `ALL`."""
    groups = dict.fromkeys(group for group in project.object_points.groups if group)
    if unknowns.plates != ALL or ALL[0] in groups:
        return unknowns
    if not groups:
        raise InputError(remark("adjust.no_groups", of=source))
    return replace(unknowns, plates=tuple(groups))


def parse_scale_bar(text: str) -> ScaleBar:
    """Return the scale bar of ``first,second,length,sigma``.

    Raises
    ------
    InputError
        If it has another form.
    """
    parts = [part.strip() for part in text.split(",")]
    try:
        first, second, length, sigma = parts
        return ScaleBar(first=first, second=second, length=float(length), sigma=float(sigma))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(remark("adjust.scale_bar_text", text=text)) from None


def salinity_of(
    result: Adjustment, *, wavelength_nm: float, temperature_c: float, depth: float
) -> tuple[float, float] | None:
    """Return the salinity that follows from an adjusted index of water, and its sigma. [%].

    None if the last medium's index was not estimated.
    """
    media = [interface for interface in result.project.interfaces if interface is not None]
    last = f"index{len(media[0].indices)}" if media else ""
    names = [name for name in result.names if name.rpartition(":")[2] == last]
    if not names:
        return None
    water: dict[str, Any] = {
        "wavelength_nm": wavelength_nm,
        "temperature_c": temperature_c,
        "depth": depth,
    }
    salinity = float(salinity_from_index(result.value(names[0]), **water))
    # Within the error of the index fresh water may come out slightly below zero.
    rates = water_index_derivatives(**water, salinity_percent=min(max(salinity, 0.0), 30.0))
    return salinity, result.sigma(names[0]) / abs(float(rates.d_salinity))


def as_dict(result: Adjustment) -> dict[str, object]:
    """Return an adjustment as plain data for ``--json``."""
    points = result.project.object_points
    sigma = np.asarray(points.sigma)
    return {
        "unit": result.project.unit,
        "unit_of_angles": "rad",
        "sigma0_mm": result.sigma0,
        "sigma0_mm_of": dict(result.sigma0_of),
        "model_error": result.model_error,
        "redundancy": result.redundancy,
        "iterations": result.iterations,
        "unknowns": {
            name: {"value": result.values[k], "sigma": result.sigma(name)}
            for k, name in enumerate(result.names)
        },
        "correlations": result.correlations,
        "points": [
            {"id": name, "xyz": points.xyz[j], "sigma": sigma[j]}
            for j, name in enumerate(points.ids)
        ],
        "suspects": result.suspects(),
        "remarks": result.remarks,
    }
