"""A set-up in, its expected accuracy out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.design.accuracy import (
    STEPS,
    calibration_costs,
    compare_placements,
    kind_of,
    object_grid,
    ring_of_cameras,
    study_setup,
)
from multimedia.design.design_files import write_design_plot, write_design_workbook
from multimedia.design.dispersion import layers_per_colour, seam_width
from multimedia.design.planarity import Deviation, planarity_study
from multimedia.design.simplified_models import agrafiotis, lavest, telem
from multimedia.design.studies import Design, Placement, Study
from multimedia.media import Camera, FlatInterface
from multimedia.projects import read_project
from multimedia.refraction import Layers
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import GeometryError, InputError
from photocore.output import all_or_none, check_all_writable, check_ending
from photocore.workbook import check_new_workbook

#: A millimetre in the units that projects use.
MILLIMETRE = {"m": 1e-3, "cm": 0.1, "mm": 1.0}
#: No object space is larger, in distances of the cameras: it would be seen at no angle.
FARTHEST = 1000.0


def design_ring(
    *,
    count: int,
    distance: float,
    half_angle: float,
    principal_distance: float,
    indices: Sequence[float],
    thicknesses: Sequence[float],
    extent: tuple[float, float],
    depths: tuple[float, float],
    sigma_image: float,
    seed: int = 1,
    unit: str = "m",
    flatness: bool = False,
) -> Design:
    """Study cameras on a cone above a water surface or a glass.

    Arguments as in `Layers`, `ring_of_cameras`, `object_grid` and `study_setup`; ``seed`` is that
    of the noise in the simulated calibrations, ``flatness`` asks for `planarity_study`.
    """
    if not 0 <= depths[0] < depths[1]:
        raise InputError(remark("design.depths", least=depths[0], most=depths[1], unit=unit))
    if max(*extent, depths[1]) > FARTHEST * distance:
        raise InputError(remark("design.extent", farthest=FARTHEST, distance=distance, unit=unit))
    interface = FlatInterface(layers=Layers(indices=tuple(indices), thicknesses=tuple(thicknesses)))
    points = object_grid(extent, depths)
    cameras = ring_of_cameras(
        count, distance, half_angle, interface=interface, target=points.mean(axis=0),
        principal_distance=principal_distance,
    )  # fmt: skip
    placements = compare_placements(
        count, distance, interface=interface, points=points,
        principal_distance=principal_distance, sigma_image=sigma_image,
    )  # fmt: skip
    return _design(
        cameras, [interface] * count, points, sigma_image, ("media",) * count, placements, seed,
        unit, (), flatness,
    )  # fmt: skip


def design_project(source: Path, *, seed: int = 1, flatness: bool = False) -> Design:
    """Study the cameras of a project file at its object points."""
    project = read_project(source)
    if not project.object_points.ids:
        raise InputError(remark("design.no_points", of=source))
    return _design(
        project.cameras, project.interfaces, project.object_points.xyz, project.sigma_image,
        project.media_of, (), seed, project.unit, project.remarks, flatness,
    )  # fmt: skip


def _design(
    cameras: Sequence[Camera], media: Sequence[Any], points: FloatArray, sigma_image: float,
    names: Sequence[str], placements: tuple[Placement, ...], seed: int, unit: str,
    remarks: tuple[str, ...], flatness: bool,
) -> Design:  # fmt: skip
    """Run all studies of one set-up."""
    study = study_setup(
        cameras, media, points, sigma_image=sigma_image, names=names,
        millimetre=MILLIMETRE.get(unit, 1e-3),
    )  # fmt: skip
    notes = list(remarks)
    blind = int((study.seen_by < 2).sum())
    if blind:
        notes.append(f"{blind} of {len(points)} points are seen by fewer than two cameras.")
    costs = None
    interface = media[0]
    if isinstance(interface, FlatInterface) and all(item is interface for item in media):
        rng = np.random.default_rng(seed)
        try:
            costs = calibration_costs(
                cameras, interface, points[study.seen_by == len(cameras)], rng=rng,
                sigma_image=sigma_image,
            )  # fmt: skip
        except (GeometryError, InputError) as error:
            notes.append(f"calibration not simulated: {error}")
    else:
        notes.append(remark("design.not_simulated"))
    sensitivities = tuple(
        (name, STEPS[kind_of(name)][1], tuple(moved.tolist()))
        for name, moved in study.sensitivity.items()
    )
    planarity: tuple[Deviation, ...] = ()
    if flatness:
        planarity = planarity_study(
            cameras, media, points[study.seen_by >= 2][::_every(points)],
            expected=float(np.linalg.norm(study.rms_sigma)), millimetre=MILLIMETRE.get(unit, 1e-3),
        )  # fmt: skip
        notes += [
            f"flatness, {one.kind}: {one.left_out} sights of points are no longer seen by two "
            "cameras; the figures leave them out."
            for one in planarity if one.left_out
        ]  # fmt: skip
    models, seam = _simplified(cameras[0], interface, points)
    return Design(
        study=study, by_depth=_by_depth(study), sensitivities=sensitivities,
        placements=placements, costs=costs, models=models, seam=seam, unit=unit,
        remarks=tuple(notes), planarity=planarity,
        centres=np.array([camera.centre for camera in cameras]),
        media=interface if all(item is interface for item in media) else None,
    )  # fmt: skip


def _every(points: FloatArray) -> int:
    """Return the step in which points are taken for ray tracing: some hundred tell as much."""
    return 1 + len(points) // 128


def _simplified(
    camera: Camera, interface: Any, points: FloatArray
) -> tuple[tuple[tuple[str, float, float], ...], float]:
    """Return what simplified models get wrong for one camera, and the width of its colour seams.

    Both hold for a camera square to the media: only its height and its nadir enter.
    """
    if not isinstance(interface, FlatInterface):
        return (), float("nan")
    layers, normal = interface.layers, interface.normal
    height = float(normal @ (camera.centre - interface.point))
    depth = -(points - interface.point) @ normal
    offset = points - camera.centre
    radius = np.linalg.norm(offset - np.outer(offset @ normal, normal), axis=1)
    z0, c = height - layers.thickness, camera.principal_distance
    models = []
    for name, model in (
        ("Lavest: f times n", lavest),
        ("Agrafiotis: shares of air and water", agrafiotis),
        ("Telem: absorbed by c, k1, k2, k3", telem),
    ):
        wrong = np.abs(
            model(radius, z0=z0, zp=depth, layers=layers, principal_distance=c).object_error
        )
        models.append((name, float(np.sqrt(np.mean(wrong**2))), float(wrong.max())))
    # Quan and Fry's water at 20 degrees for blue and red, in place of the last medium.
    colours = [
        replace(layers, indices=(*layers.indices[:-1], of_colour.indices[-1]))
        for of_colour in layers_per_colour(wavelengths_nm=(650.0, 450.0))
    ]
    seam = seam_width(
        radius, z0=z0, zp=depth, colours=colours, principal_distance=c, pixel_size=1.0
    )
    return tuple(models), float(np.max(seam))


def _by_depth(study: Study) -> FloatArray:
    """Return RMS precision and mean angles per depth level (at most 12 levels)."""
    depth = -study.points[:, 2]
    levels = np.unique(depth)
    if len(levels) > 12:
        edges = np.quantile(depth, np.linspace(0, 1, 13))
        group = np.clip(np.searchsorted(edges, depth, side="right") - 1, 0, 11)
    else:
        group = np.searchsorted(levels, depth)
    rows = []
    for k in np.unique(group):
        members = (group == k) & np.isfinite(study.sigma[:, 0])
        if members.any():
            sigma = np.sqrt(np.mean(study.sigma[members] ** 2, axis=0))
            angles = [
                float(np.degrees(np.mean(a[members]))) for a in (study.angle, study.angle_in_air)
            ]
            rows.append([float(depth[members].mean()), *sigma.tolist(), *angles])
    return np.array(rows)


def check_outputs(out: Path | None, plot: Path | None, *, overwrite: bool) -> None:
    """Refuse what `write_design` could not write; call it before the work."""
    check_ending(out, "a study is written as .xlsx.", ".xlsx")
    check_ending(plot, "a study is drawn as .png, .svg or .pdf.", ".png", ".svg", ".pdf")
    if out is not None:
        check_new_workbook(out, overwrite=overwrite)
    check_all_writable(out, plot, overwrite=overwrite)


@all_or_none()
def write_design(design: Design, *, out: Path | None, plot: Path | None, overwrite: bool) -> None:
    """Write the workbook and the picture where asked."""
    check_outputs(out, plot, overwrite=overwrite)
    if out is not None:
        write_design_workbook(out, design, overwrite=overwrite)
    if plot is not None:
        write_design_plot(plot, design, overwrite=overwrite)


def as_dict(design: Design) -> dict[str, object]:
    """Return a design as plain data for ``--json``."""
    x, y, z = design.study.rms_sigma.tolist()
    costs = design.costs
    return {
        "unit": design.unit,
        "sigma_rms": {"X": x, "Y": y, "Z": z},
        "by_depth": [
            dict(
                zip(("depth", "sigma_X", "sigma_Y", "sigma_Z", "angle_deg", "angle_in_air_deg"),
                    row, strict=True)
            )
            for row in design.by_depth.tolist()
        ],
        "sensitivity": [
            {"unknown": name, "step": step, "shift": moved}
            for name, step, moved in design.sensitivities
        ],
        "placements": [
            {"half_angle_deg": float(np.degrees(p.half_angle)), "sigma": p.sigma,
             "angle_deg": float(np.degrees(p.angle))}
            for p in design.placements
        ],
        "calibration": None if costs is None else {
            "I_air": costs.air, "II_air_calibration_in_water": costs.air_calibration_in_water,
            "III_water": costs.water, "sigma0_mm": costs.sigma0,
        },
        "simplified_models": [
            {"model": name, "rms": rms, "largest": largest} for name, rms, largest in design.models
        ],
        "colour_seam_mm": design.seam,
        "planarity": [asdict(deviation) for deviation in design.planarity],
        "remarks": design.remarks,
    }  # fmt: skip
