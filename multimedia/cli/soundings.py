"""``multimedia soundings``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from photocore.cli import print_result, tell_written, text_table
from photocore.options import declared


@declared
def command(surface: Path, soundings: Path, as_json: bool, **options: Any) -> None:
    """Hold a corrected DEM or point cloud against soundings or check points, by depth.

    SURFACE is a .tif or a point cloud (.csv .txt .xyz .ply .las .laz), best the result of
    `multimedia bathymetry` with its sigmas; SOUNDINGS is a table or cloud X, Y, Z and, if there,
    sigma_Z. Offsets are sounding minus surface.
    """
    from multimedia.bathymetry.soundings_workflow import check_soundings

    check = check_soundings(surface, soundings, **options)
    found = check.offsets
    columns = {
        "mean": "mean [m]", "mean_sigma": "its sigma", "median": "median", "spread": "spread",
        "robust": "robust", "rmse": "RMSE", "expected": "expected",
    }  # fmt: skip
    rows = [
        (f"{of.shallow:g} to {of.deep:g}", of.count, of.gross,
         *(f"{getattr(of, key):+.4f}".replace("+nan", "-") for key in columns))
        for of in (*found.classes, found.total)
    ]  # fmt: skip
    headings = ("depth [m]", "n", "gross", *columns.values())
    lines = [text_table(headings, rows), f"{check.count} soundings, {check.outside} beside it"]
    trend = found.trend
    if trend is not None:
        lines.append(
            f"over depth: {trend.at_surface:+.4f} m ± {trend.at_surface_sigma:.4f} at the surface, "
            f"{1000 * trend.per_metre:+.2f} mm ± {1000 * trend.per_metre_sigma:.2f} per metre of "
            "depth (an index too small by 0.001 makes -0.75, a level 1 cm too low -3 mm throughout)"
        )
    data = {
        "classes": [asdict(of) for of in found.classes], "all": asdict(found.total),
        "trend": None if trend is None else asdict(trend),
        "soundings": check.count, "outside": check.outside,
    }  # fmt: skip
    print_result(data, lines, as_json=as_json, remarks=check.remarks)
    tell_written(options["target"])
