"""Mean water height from a file of tie points."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from multimedia.bathymetry.mean_water_level import WaterLevel, mean_water_level
from multimedia.projects import FORMAT
from multimedia.remarks import remark
from photocore.cloud import open_cloud
from photocore.jsonfile import write_object
from photocore.output import check_all_writable, check_ending

#: A level whose standard deviation exceeds this is no level of a lab or a river: millimetres? [m]
COARSEST = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedLevel:
    """A water level with what the user should know."""

    water: WaterLevel
    remarks: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, object]:
        """Return the numbers, as printed and as written to the file."""
        water = self.water
        return {
            "format": FORMAT,
            "level": water.level,
            "sigma": water.sigma,
            "spread": water.spread,
            "points": int(water.used.sum()),
            "rejected_below": water.below,
            "rejected_above": water.above,
            "slope": water.slope,
            "slope_sigma": water.slope_sigma,
            "centre": water.centre,
        }


def fit_water_level(
    source: Path,
    *,
    tilted: bool = False,
    spread: float | None = None,
    target: Path | None = None,
    overwrite: bool = False,
) -> FittedLevel:
    """Estimate the water level from tie points and write it to a file where asked for.

    Raises
    ------
    InputError, GeometryError
        If the file cannot be read or shows no water surface.
    """
    check_ending(target, "a water level is written as .json.", ".json")
    check_all_writable(target, overwrite=overwrite)
    cloud = open_cloud(source)
    points = np.concatenate([piece.xyz for piece in cloud.pieces()])
    fitted = FittedLevel(
        water=mean_water_level(points, tilted=tilted, spread=spread), remarks=list(cloud.remarks)
    )
    if fitted.water.spread > COARSEST:
        fitted.remarks.append(remark("bathymetry.scatter", spread=fitted.water.spread))
    if fitted.water.larger is not None:
        count, height = fitted.water.larger
        fitted.remarks.append(remark("bathymetry.larger_group", count=count, height=height))
    if target is not None:
        write_object(target, fitted.as_dict(), overwrite=overwrite)
    return fitted
