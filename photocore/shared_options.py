"""Options that commands of both packages have."""

from typing import Annotated, Literal

import click

from photocore.option_types import Size
from photocore.options import Typed
from photocore.provenance import changed_photos


def _enter_cog(ctx: click.Context, param: click.Parameter, value: bool) -> None:  # noqa: ARG001
    if value:
        from photocore.raster_places import cloud_optimised

        ctx.with_resource(cloud_optimised())


def _take_changes(ctx: click.Context, param: click.Parameter, value: bool) -> None:  # noqa: ARG001
    ctx.with_resource(changed_photos(taken=value))


JsonOption = Annotated[bool, Typed(flag="--json", text="Print one JSON object.")]
OverwriteOption = Annotated[bool, Typed(text="Replace existing files.")]
CogOption = Annotated[bool, Typed(flag="--cog", text="Write rasters as cloud-optimised GeoTIFF.")]
#: The same for a command that makes rasters itself: it holds while the command runs.
RasterCogOption = Annotated[CogOption, Typed(expose_value=False, callback=_enter_cog)]
ChangedPhotosOption = Annotated[
    bool,
    Typed(
        expose_value=False,
        callback=_take_changes,
        text="Go on with photos and maps that are not those the pair was made from.",
    ),
]
PatternOption = Annotated[
    Literal["chessboard", "circles", "asymmetric-circles", "charuco"],
    Typed(text="What is on the board."),
]
BoardOption = Annotated[
    tuple[int, int],
    Typed(
        Size(least=1, whole=True),
        text="Inner corners of a chessboard, circles of a grid, squares of a ChArUco board, across "
        "x up.",
    ),
]
LanguageOption = Annotated[
    Literal["en", "it", "de"], Typed(flag="--language --lang", text="Of the report.")
]
