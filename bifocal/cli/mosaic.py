"""``bifocal mosaic``."""

from __future__ import annotations

from bifocal.options.commands import MosaicCommand
from photocore.cli import print_result, progress_bar
from photocore.options import declared


@declared(MosaicCommand)
def command(options: MosaicCommand) -> None:
    """Join orthophotos, or relief maps, of one wall.

    Seams run where the rasters agree, away from edges of the relief and from hidden places;
    exposure becomes that of the first file and colours fade into each other. Sizes are not limited.
    """
    from bifocal.orthophotos import make_mosaic

    with progress_bar("mosaic", quiet=options.as_json) as progress:
        result = make_mosaic(
            options.rasters,
            options.out,
            progress=progress,
            gsd=options.gsd,
            bounds=options.bounds,
            relief=options.relief,
            priority=options.priority,
            gain=options.gain,
            blend=options.blend,
            overviews=options.overviews,
            overwrite=options.overwrite,
        )
    grid = result.grid
    lines = [f"{options.out}: {grid.width} x {grid.height} px of {grid.gsd * 1000:g} mm"]
    lines += [f"  {100 * share:5.1f} %  {name}" for name, share in result.shares.items()]
    print_result(result.to_dict(), lines, as_json=options.as_json, remarks=result.remarks)
