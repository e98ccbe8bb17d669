"""``multimedia soundings``."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from photocore.cli import print_result, tell_written, text_table
from photocore.option_types import NOT_NEGATIVE, TABLE, Numbers
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class SoundingsCommand:
    """The options of ``multimedia soundings``, and examples.

    multimedia soundings bed.tif multibeam.xyz --water-level 102.4
    multimedia soundings cloud.las check.xlsx --water-level 102.4 --classes 0,1,2,4
                         --out offsets.csv
    """

    surface: Annotated[Path, Argument(TABLE)]
    soundings: Annotated[Path, Argument(TABLE)]
    water_level: Annotated[str, Typed(unit="Z|FILE")]
    """Height of the water from which depths count [m], or its surface, as for bathymetry."""
    edges: Annotated[tuple[float, ...] | None, Typed(Numbers(), "D,D,...", flag="--classes")] = None
    """Bounds of the classes of depth [m].  [default: up to eight of a round width]"""
    sigma: Annotated[float, Typed(NOT_NEGATIVE, "M")] = 0.0
    """Standard deviation of a sounding without a sigma_Z of its own [m]."""
    target: Annotated[Path | None, Typed(flag="--out")] = None
    """Table (.csv) of every sounding with its offset and sigma.  [default: none]"""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(SoundingsCommand)
def command(options: SoundingsCommand) -> None:
    """Hold a corrected DEM or point cloud against soundings or check points, by depth.

    SURFACE is a .tif or a point cloud (.csv .txt .xyz .ply .las .laz), best the result of
    `multimedia bathymetry` with its sigmas; SOUNDINGS is a table or cloud X, Y, Z and, if there,
    sigma_Z. Offsets are sounding minus surface.
    """
    from multimedia.bathymetry import check_soundings

    check = check_soundings(
        options.surface,
        options.soundings,
        water_level=options.water_level,
        edges=options.edges,
        sigma=options.sigma,
        target=options.target,
        overwrite=options.overwrite,
    )
    offsets = check.offsets
    columns = {
        "mean": "mean [m]", "mean_sigma": "its sigma", "median": "median", "spread": "spread",
        "robust": "robust", "rmse": "RMSE", "expected": "expected",
    }  # fmt: skip
    rows = [
        (f"{of.shallow:g} to {of.deep:g}", of.count, of.gross,
         *(f"{getattr(of, key):+.4f}".replace("+nan", "-") for key in columns))
        for of in (*offsets.classes, offsets.total)
    ]  # fmt: skip
    headings = ("depth [m]", "n", "gross", *columns.values())
    lines = [text_table(headings, rows), f"{check.count} soundings, {check.outside} beside it"]
    trend = offsets.trend
    if trend is not None:
        lines.append(
            f"over depth: {trend.at_surface:+.4f} m ± {trend.at_surface_sigma:.4f} at the surface, "
            f"{1000 * trend.per_metre:+.2f} mm ± {1000 * trend.per_metre_sigma:.2f} per metre of "
            "depth (an index too small by 0.001 makes -0.75, a level 1 cm too low -3 mm throughout)"
        )
    data = {
        "classes": [asdict(of) for of in offsets.classes], "all": asdict(offsets.total),
        "trend": None if trend is None else asdict(trend),
        "soundings": check.count, "outside": check.outside,
    }  # fmt: skip
    print_result(data, lines, as_json=options.as_json, remarks=check.remarks)
    tell_written(options.target)
