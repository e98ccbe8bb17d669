"""Planning: wishes in, stations out, as text, JSON or workbook."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bifocal.planning.camera_plan import CameraSensor, Plan
from bifocal.planning.plan_workbook import write_plan
from bifocal.planning.stations import plan_stations
from photocore.output import check_ending
from photocore.workbook import check_new_workbook


def make_plan(
    focal_lengths: Sequence[float],
    sensor: CameraSensor,
    *,
    out: Path | None = None,
    language: str = "en",
    overwrite: bool = False,
    **wishes: Any,
) -> Plan:
    """Return a plan, and write it as a workbook when a path is given.

    ``wishes`` are the keyword arguments of `bifocal.planning.stations.plan_stations`.
    """
    check_ending(out, "a plan is written as a workbook; name it .xlsx.", ".xlsx")
    if out is not None:
        check_new_workbook(out, overwrite=overwrite)
    plan = plan_stations(focal_lengths, sensor, **wishes)
    if out is not None:
        write_plan(out, plan, language=language, overwrite=overwrite)
    return plan


def plan_as_dict(plan: Plan) -> dict[str, object]:
    """Return a plan as plain data for ``--json``."""
    x, y, sigma = plan.sigma_grid(plan.best)
    return {
        "stations": [asdict(station) for station in plan.stations],
        "sigma_px": plan.sigma_px,
        "rests_on": plan.basis,
        "sigma_r_max": plan.sigma_r_max,
        "third_photo": plan.third_photo(plan.best)._asdict(),
        "sigma_r_over_frame": {"x": x, "y": y, "sigma_r": sigma},
    }
