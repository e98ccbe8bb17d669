"""``bifocal relief``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from bifocal.options import (
    BoundsOption,
    FacesOption,
    QualityOption,
    ReliefGsdOption,
    ReliefRangeOption,
)
from photocore.cli import print_result, progress_bar
from photocore.options import Argument, Typed, declared
from photocore.shared_options import (
    ChangedPhotosOption,
    JsonOption,
    OverwriteOption,
    RasterCogOption,
)


@dataclass(frozen=True, kw_only=True)
class ReliefCommand:
    """The options of ``bifocal relief``, and examples.

    bifocal relief wall.pair.json --out relief.tif --preview relief.png
    bifocal relief wall.pair.json --out relief.tif --gsd 0.005 --bounds -5,-3,5,3 --cloud wall.laz
    bifocal relief survey.xlsx --out relief.tif
    bifocal relief porch.photos.json --out relief.tif
    bifocal relief wall.pair.json --out quick.tif --quality fast --json

    Bands of the GeoTIFF: relief [m], NaN where unknown; its sigma [m]; quality (1 measured in both
    photos, 2 interpolated, 3 hidden from a camera, 4 drawn, 0 unknown; of a set 1 in two photos or
    more, 3 seen by fewer than two).
    """

    pair_file: Annotated[Path, Argument(unit="PAIR.pair.json")]
    out: Path
    """Relief map to write (.tif)."""
    gsd: ReliefGsdOption = None
    bounds: BoundsOption = None
    """Part of the wall [m].  [default: all that both photos see]"""
    quality: QualityOption = "standard"
    relief_range: ReliefRangeOption = None
    faces: FacesOption = None
    suggested: Annotated[Path | None, Typed(flag="--suggest-faces")] = None
    """Also faces that would mend what is not measured, to be looked at (.geojson)."""
    preview: Path | None = None
    """Also a shaded picture (.png)."""
    cloud: Path | None = None
    """Also a coloured point cloud (.ply, .las, .laz)."""
    cog: RasterCogOption = False
    changed_photos: ChangedPhotosOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(ReliefCommand)
def command(pair_file: Path, as_json: bool, **wishes: Any) -> None:
    """Measure the relief of the whole wall from the photos of a pair, a set or survey workbook.

    Every pixel of the map gets its relief and the standard deviation of it, which comes from the
    photos themselves: points can only move along the radius, so what moves across it is error.
    Of a set every pair that promises relief is measured: what one cannot see another fills, and
    where they differ the photos decide.
    """
    from bifocal.faces import faces_path, keep_faces
    from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair
    from bifocal.workbook import is_workbook, read_pair

    faces = wishes["faces"]
    wishes["faces"] = faces_path(faces, pair_file)
    with progress_bar("Relief", quiet=as_json) as progress:
        source = read_pair(pair_file) if is_workbook(pair_file) else pair_file
        summary, remarks = relief_of_pair(source, ReliefJob(**wishes), progress=progress)
    remarks = (*remarks, *keep_faces(faces, pair_file))
    data = summary | {"remarks": list(remarks)}
    print_result(data, _lines(summary), as_json=as_json, remarks=remarks)


def _lines(summary: dict[str, Any]) -> Iterator[str]:
    """Yield the figures of the map and the files written."""
    width, height = summary["size"]
    shares, relief = summary["shares"], summary["relief"]
    yield f"Map       {width} x {height} px of {1000 * summary['gsd']:.2f} mm"
    yield f"Relief    {relief['min']:.3f} to {relief['max']:.3f} m, median {relief['median']:.3f} m"
    yield (
        f"Pixels    {shares['measured']:.0%} measured, {shares['interpolated']:.0%} interpolated, "
        f"{shares['hidden']:.0%} hidden, {shares['unknown']:.0%} unknown"
        + (f", {shares['drawn']:.0%} drawn" if shares["drawn"] else "")
    )
    if summary["sigma_median"] is not None:
        yield f"Sigma     {1000 * summary['sigma_median']:.1f} mm (median of the measured)"
        yield summary["rests_on"]
    if "pairs" in summary:
        yield f"Pairs     {', '.join(' + '.join(names) for names in summary['pairs'])}"
    for path in summary["written"]:
        yield f"Written   {path}"
