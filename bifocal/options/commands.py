"""Options of commands that are cells of the workbook, fields of the page and keys of files, too."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from bifocal.options import (
    AnySizeOption,
    BoundsOption,
    ColumnsOption,
    DpiOption,
    GsdOption,
    InterpolationOption,
    LanguageOption,
    OverviewsOption,
    PaperOption,
    ScaleOption,
    SigmaControlOption,
    SigmaPickOption,
    UnitOption,
)
from photocore.option_types import FOCAL, NEW_TABLE, POSITIVE, TABLE, Length, Numbers
from photocore.options import Argument, Typed
from photocore.shared_options import JsonOption, OverwriteOption, RasterCogOption


@dataclass(frozen=True, kw_only=True)
class SolveCommand:
    """The options of ``bifocal solve``, and examples.

    bifocal solve survey.xlsx --out result.xlsx
    bifocal solve points.csv --pair wall.pair.json --json
    bifocal solve picks.csv --pair wall.photos.json --json
    bifocal solve far.dxf near.dxf --pair setup.xlsx --out result.xlsx
    bifocal solve distances.csv --d1 17.5 --d2 9.5 --c1 35 --c2 19 --out result.csv
    bifocal solve survey.xlsx --control station_pair.csv --out survey.xlsx --overwrite
    bifocal solve old.xlsx --columns "id=A,s1=distance far,s2=D" --d1 17.5 --d2 9.5
    """

    survey: Annotated[tuple[Path, ...], Argument(TABLE, "SURVEY...")]
    out: Annotated[Path | None, Typed(NEW_TABLE, "FILE")] = None
    """Result: a workbook (.xlsx, .xlsm), a text table (.csv), or - (stdout).  [default: none]"""
    pair: Annotated[Path | None, Typed(unit="PAIR.pair.json")] = None
    """File of the pair, or of a set of photos, for points in raw pixels, or a survey workbook for
    its set-up.  [default: the workbook's own set-up]"""
    control: Annotated[Path | None, Typed(TABLE, "LIST")] = None
    """Points from the field, a table or list of an instrument (GSI, ...): id with E, N, H fills
    Georeference, with X, Y, Z or r [m] Check.  [default: what stands there]"""
    control_order: Annotated[str | None, Typed(unit="MAP")] = None
    """Columns of a list without headings: PNEZD, PENZD, "id,E,N,H".  [default: found by heading]"""
    as_json: JsonOption = False
    columns: Annotated[str | None, Typed(unit="MAP")] = None
    """Which column is which: "id=A,s1=My heading" or "id,x1,y1,x2,y2" for tables without
    headings.  [default: found by heading]"""
    sheet: Annotated[str | None, Typed(unit="NAME")] = None
    """Sheet of the points.  [default: found]"""
    decimal: Literal["point", "comma"] | None = None
    """Decimal separator of numbers typed as text.  [default: found]"""
    visible_only: bool = False
    """Leave out hidden and filtered rows."""
    d1: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Distance of camera 1 [m].  [default: Setup]"""
    d2: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Distance of camera 2 [m].  [default: Setup]"""
    c1: Annotated[float | None, Typed(FOCAL, "MM")] = None
    """Principal distance of image 1 [mm].  [default: Setup]"""
    c2: Annotated[float | None, Typed(FOCAL, "MM")] = None
    """Principal distance of image 2 [mm].  [default: Setup]"""
    enlargement1: Annotated[float | None, Typed(POSITIVE, "X")] = None
    """Print 1, if measured: size over the sensor's.  [default: Setup]"""
    enlargement2: Annotated[float | None, Typed(POSITIVE, "X")] = None
    """The same of print 2; 1 = measured on the sensor.  [default: Setup]"""
    pitch: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """Size of a pixel [mm].  [default: Setup]"""
    unit: Literal["mm", "px"] | None = None
    """Unit of x1 y1 x2 y2.  [default: as headings or Setup say, else mm]"""
    sigma_s: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """Precision of an image coordinate [mm].  [default: Setup, else 0.5 px]"""
    sigma_px: Annotated[float | None, Typed(POSITIVE, "PX")] = None
    """Precision of a raw pixel [px].  [default: the pair file's, else from the misfits of 20 or
    more points, else 0.5]"""
    sigma_r_max: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Sigma of r beyond which a point is UNCERTAIN [m].  [default: 2 % of d2]"""
    adjust_setup: bool = False
    """Correct the set-up by points of the reference plane (code PLANE, r = 0)."""
    model: Annotated[
        Literal["auto", "levelled", "3D", "2D"] | None, Typed(flag="--georeference")
    ] = None
    """Model of the roto-translation.  [default: the workbook's, else auto]"""
    scale_tolerance: Annotated[float, Typed(POSITIVE, "SHARE")] = 0.02
    """Share by which the scales of both photos may differ."""
    rules: Annotated[tuple[str, ...], Typed(unit="RULE", flag="--tolerance-rule")] = ()
    """Rule for the verdict: line-0.18, print-0.25, eckstein, a number of mm at scale (0.2mm) or
    fixed cm (2cm); repeat it.  [default: the three named]"""
    language: Annotated[Literal["en", "it", "de"] | None, Typed(flag="--lang --language")] = None
    """Language of a new workbook.  [default: the survey's, else en]"""
    overwrite: OverwriteOption = False


@dataclass(frozen=True, kw_only=True)
class RectifyCommand:
    """The options of ``bifocal rectify``, and examples.

    bifocal rectify far.jpg --control points.csv --out ortho.tif
    bifocal rectify far.jpg --control points.csv --lens lens35.json --scale 1:50 --deliver drawing
    bifocal rectify far.jpg --rectangle 10.9,3.15 --corners 14,110,753,110,753,323,14,323
                  --gsd 2cm --out picture.tif
    bifocal rectify far.jpg --lines --length 14,110,753,110,10.9 --lens lens35.json
                  --out lines.tif
    """

    photo: Annotated[Path, Argument()]
    out: Path | None = None
    """GeoTIFF to write."""
    control: Path | None = None
    """Table of four points of the wall or more: id, X, Y [m], col, row [px]; with --rectangle only
    its corners' col, row."""
    columns: ColumnsOption = None
    unit: UnitOption = None
    rectangle: Annotated[tuple[float, float] | None, Typed(Numbers(2), "W,H")] = None
    """Width and height of a rectangle on the wall [m]."""
    corners: Annotated[tuple[float, ...] | None, Typed(Numbers(8), "COL,ROW,...")] = None
    """Its four corners in the photo, from the upper left one clockwise [px]."""
    lines: bool = False
    """The façade's upright and level lines tell the plane; needs --length."""
    length: Annotated[
        tuple[float, float, float, float, float] | None, Typed(Numbers(5), "COL,ROW,COL,ROW,M")
    ] = None
    """With --lines: two points of the wall [px] and the metres between; the first is X = Y = 0."""
    stands_out: Annotated[float, Typed(Length(), "M")] = 0.2
    """Relief whose displacement is told [m]; negative: lies back."""
    lens: Path | None = None
    """Lens file."""
    focal: Annotated[float | None, Typed(FOCAL, "MM")] = None
    """Focal length [mm].  [default: EXIF]"""
    sensor_width: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """Longer side of the sensor [mm]."""
    pixel_size: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """Instead of the sensor width: one pixel [mm]."""
    sigma_pick: SigmaPickOption = 0.5
    sigma_control: SigmaControlOption = 0.003
    gsd: GsdOption = None
    bounds: BoundsOption = None
    interpolation: InterpolationOption = "cubic"
    overviews: OverviewsOption = None
    any_size: AnySizeOption = False
    folder: Annotated[Path | None, Typed(unit="DIR", flag="--deliver")] = None
    """Write GeoTIFF, PNG, DXF and PDF into a folder. Needs --scale."""
    scale: ScaleOption = None
    dpi: DpiOption = 254.0
    paper: PaperOption = None
    mark: Path | None = None
    """Table of points to draw."""
    language: LanguageOption = "en"
    """Of sheets."""
    title: str = ""
    """Title of the drawing.  [default: the photo's name]"""
    tfw: bool = False
    """Also write the world file beside it."""
    cog: RasterCogOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@dataclass(frozen=True, kw_only=True)
class MosaicCommand:
    """The options of ``bifocal mosaic``, and examples.

    bifocal mosaic left.tif middle.tif right.tif --out facade.tif
    bifocal mosaic left.tif right.tif --relief left_r.tif --relief right_r.tif --out facade.tif
    bifocal mosaic left_r.tif right_r.tif --out facade_relief.tif

    The last band of the result says which input every pixel comes from: 1, 2, ... in the order
    given.
    """

    rasters: Annotated[tuple[Path, ...], Argument(unit="ORTHO.tif...")]
    out: Path
    """GeoTIFF to write."""
    gsd: Annotated[float | None, Typed(Length(above=0))] = None
    """Pixel [m] or 5mm.  [default: that of the finest]"""
    bounds: BoundsOption = None
    """Part of the wall [m].  [default: all of it]"""
    relief: tuple[Path, ...] = ()
    """Relief map: seams keep away from its edges; repeat it."""
    priority: bool = False
    """Earlier files cover later ones; no seam is sought."""
    gain: bool = True
    """Make the exposure equal to the first file's."""
    blend: bool = True
    """Blend over the seams; relief maps are never mixed."""
    overviews: bool = True
    """Reduced copies in the file, for fast display."""
    cog: RasterCogOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False
