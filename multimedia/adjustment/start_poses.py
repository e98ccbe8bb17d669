"""Poses to start an adjustment from where a project states none."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from multimedia.adjustment.unknowns import ScaleBar, Unknowns, bars_of
from multimedia.orientation import names_of, stands_still, stray_rows, without_rows
from multimedia.orientation.relative_orientation import relative_orientation
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.errors import InputError


def with_poses(project: Project, unknowns: Unknowns) -> tuple[Project, tuple[str, ...]]:
    """Return a project whose cameras have poses, and a remark where they were found here.

    Distances are those of scale bars and, on plates, between the points farthest apart.

    Raises
    ------
    InputError
        If some cameras have poses, control points would give them, or nothing gives the scale.
    GeometryError
        As `relative_orientation`.
    """
    if not project.without_pose:
        return project, ()
    if len(project.without_pose) < len(project.cameras):
        raise InputError(remark("orient.some_posed", names=", ".join(project.without_pose)))
    control = project.object_points
    if any(group not in unknowns.plates for group in control.groups):
        raise InputError(remark("orient.control"))
    is_fixed = any(stands_still(media) for media in project.interfaces)
    if len(project.cameras) == 1:
        if is_fixed:
            raise InputError(remark("orient.one_camera"))
        return replace(project, without_pose=()), ()
    distances = [(bar.first, bar.second, bar.length) for bar in bars_for(project, unknowns)]
    distances += [each for plate in unknowns.plates if (each := _across(project, plate))]
    posed = relative_orientation(project, distances)
    is_stray = stray_rows(posed, distances=distances)
    name = "bundle.posed_before_faces" if is_fixed else "bundle.posed_by_camera"
    remarks = [remark(name, count=len(distances))]
    if is_stray.any():
        remarks.append(remark("bundle.strays", **names_of(posed.image_points, is_stray)))
    return without_rows(posed, is_stray), tuple(remarks)


def bars_for(project: Project, unknowns: Unknowns) -> tuple[ScaleBar, ...]:
    """Return the scale bars, those of a wand for each place whose ends can be determined."""
    rays = Counter(project.image_points.ids)
    control = set(project.object_points.ids)
    usable = [name for name, count in rays.items() if count > 1 or name in control]
    return bars_of(unknowns.scale_bars, usable)


def _across(project: Project, plate: str) -> tuple[str, str, float] | None:
    """Return the points of a plate seen by two cameras that are farthest apart, and how far."""
    rays = Counter(project.image_points.ids)
    control = project.object_points
    on = [k for k, (name, group) in enumerate(zip(control.ids, control.groups, strict=True))
          if group == plate and rays[name] > 1]  # fmt: skip
    if len(on) < 2:
        return None
    apart = np.linalg.norm(control.xyz[on][:, None] - control.xyz[on], axis=2)
    first, second = np.unravel_index(int(apart.argmax()), apart.shape)
    return control.ids[on[first]], control.ids[on[second]], float(apart.max())
