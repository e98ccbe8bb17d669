"""``multimedia waterlevel``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from photocore.cli import print_result
from photocore.option_types import POSITIVE, TABLE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class WaterlevelCommand:
    """The options of ``multimedia waterlevel``, and examples.

    multimedia waterlevel tiepoints.csv
    multimedia waterlevel tiepoints.ply --tilted --out water.json
    multimedia bathymetry dem.tif --water-level water.json --index 1.337 --out bed.tif
    """

    source: Annotated[Path, Argument(TABLE, "POINTS")]
    tilted: bool = False
    """Fit a tilted plane instead of a height. [off]"""
    spread: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Expected standard deviation of a surface point, waves included [m]. [default: from the
    data]"""
    target: Annotated[Path | None, Typed(flag="--out")] = None
    """Write the level as .json, for `multimedia bathymetry`. [default: none]"""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(WaterlevelCommand)
def command(options: WaterlevelCommand) -> None:
    """Estimate the mean water height from tie points, some of them on the water surface.

    POINTS is a table or point cloud (.csv .txt .xyz .ply .las .laz). The surface is the highest
    group of points of about one height; points on the bottom and blunders are rejected.
    """
    from multimedia.bathymetry import fit_water_level

    fitted = fit_water_level(
        options.source,
        tilted=options.tilted,
        spread=options.spread,
        target=options.target,
        overwrite=options.overwrite,
    )
    water = fitted.water
    lines = [
        f"water level   {water.level:.5f} m, standard deviation {water.sigma:.2g} m",
        f"single point  {water.spread:.2g} m (measurement and waves)",
        f"points        {int(water.used.sum())} on the surface, {water.below} below and "
        f"{water.above} above rejected",
    ]
    if options.tilted:
        lines.append(
            f"slope         {1000 * water.slope[0]:+.4g} mm/m in X, {1000 * water.slope[1]:+.4g} "
            f"mm/m in Y (sd {1000 * water.slope_sigma[0]:.2g}, {1000 * water.slope_sigma[1]:.2g})"
        )
    print_result(fitted.as_dict(), lines, as_json=options.as_json, remarks=fitted.remarks)
