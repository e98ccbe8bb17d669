"""What may be said of a pair, by groups of fields.

A field is at once the command's option, a key of survey files and of `bifocal facade`, and what
the step behind is given by its name.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Annotated, Literal

import click

from photocore.option_types import (
    FOCAL,
    NOT_NEGATIVE,
    POSITIVE,
    Checked,
    Length,
    Names,
    Numbers,
    Scale,
)
from photocore.options import Typed, options_of
from photocore.shared_options import CogOption

#: How vignetting is described; lenses have coefficients of some tenths.
VIGNETTING = Checked(
    Numbers(3, word="cos4", least=-100, most=100).typed,
    "cos4 or three numbers k1,k2,k3 from -100 to 100",
)


def section_corners(text: str) -> tuple[str, tuple[float, ...]]:
    """Return x, y or line, and where that section lies: one number, or X, Y of its corners. [m]

    Raises
    ------
    ValueError
        If it is none of these.
    """
    packed = text.replace(" ", "").lower()
    kind = packed[0] if packed.startswith(("x=", "y=")) else "line"
    words = [packed[2:]] if kind != "line" else text.replace(",", " ").replace(";", " ").split()
    numbers = tuple(map(float, words))
    corners = kind != "line" or (len(numbers) >= 4 and len(numbers) % 2 == 0)
    if not (corners and all(map(isfinite, numbers))):
        raise ValueError(text)
    return kind, numbers


SECTION = Checked(section_corners, 'x=1.5, y=2 or the corners of a line, "0,1 4,1"')

ControlOption = Annotated[
    Path | None, Typed(text="Table of control points: id, X, Y, r [m] and pixels.")
]
CheckOption = Annotated[
    Path | None,
    Typed(
        text="Table of independent check points, like --control: the accuracy is judged by them."
    ),
]
FacesOption = Annotated[
    Path | None,
    Typed(
        text="Faces, break lines and occluders that relief and orthophoto obey: GeoJSON or DXF; "
        "none: not those kept beside the pair.  [default: PAIR.faces.geojson beside it]"
    ),
]
UnitOption = Annotated[
    Literal["m", "cm", "mm"] | None,
    Typed(text="Unit of the coordinates.  [default: the headings', else m]"),
]
LanguageOption = Annotated[
    Literal["en", "it", "de"],
    Typed(flag="--language --lang", text="Of report, workbook and sheets."),
]
BoundsOption = Annotated[
    tuple[float, float, float, float] | None,
    Typed(
        Numbers(4, rising=True),
        "XMIN,YMIN,XMAX,YMAX",
        text="Part of the wall [m].  [default: all that is known]",
    ),
]
SigmaControlOption = Annotated[
    float, Typed(POSITIVE, "M", text="Precision of a control coordinate [m].")
]
SigmaPickOption = Annotated[float, Typed(POSITIVE, "PX", text="Precision of a pick [px].")]
GsdOption = Annotated[
    float | None,
    Typed(
        Length(above=0),
        "M",
        text="Pixel of the orthophoto [m], or with its unit: 5mm.  [default: that of the relief "
        "map or the photo]",
    ),
]
ScaleOption = Annotated[float | None, Typed(Scale(), text="Scale of the drawing 1:N, e.g. 1:50.")]
ColumnsOption = Annotated[
    str | None,
    Typed(
        unit="MAP",
        text='Which column of the tables is which: "id=A,X=East" or '
        '"id,X,Y,r,col1,row1,col2,row2" for tables without headings.  [default: found by '
        "heading]",
    ),
]
ReliefGsdOption = Annotated[
    float | None,
    Typed(
        Length(above=0),
        "M",
        text="Side of a pixel of the relief map on the plane [m] or 5mm, 0.2 at most; a coarse "
        "one is also matched more coarsely.  [default: that of the far photo]",
    ),
]
QualityOption = Annotated[
    Literal["fast", "standard", "best"],
    Typed(
        text="Of the relief map; fast: a quarter of the time, from half the resolution; best: "
        "full resolution also above 9 megapixels."
    ),
]
ReliefRangeOption = Annotated[
    tuple[float, float] | None,
    Typed(
        Numbers(2, rising=True),
        "LOW,HIGH",
        text="Least and greatest relief to expect [m].  [default: -36 % and +22 % of d2]",
    ),
]
InterpolationOption = Annotated[
    Literal["cubic", "linear", "nearest", "lanczos"], Typed(text="Between the pixels of the photo.")
]
OverviewsOption = Annotated[
    bool | None, Typed(text="Reduced copies in the file.  [default: above 50 megapixels]")
]
AnySizeOption = Annotated[bool, Typed(text="Do not ask back about an unusual size.")]
DpiOption = Annotated[
    float,
    Typed(
        POSITIVE,
        "N",
        text="Pixels per inch of paper of a drawing; at 1:50 and 254 dpi a pixel is 5.00 mm.",
    ),
]
PaperOption = Annotated[
    str | None,
    Typed(
        click.Choice(["A4", "A3", "A2", "A1", "A0"], case_sensitive=False),
        "[A4|A3|A2|A1|A0]",
        text="Sheet of paper.  [default: the smallest that fits]",
    ),
]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class JointOptions:
    """How all pairs of one wall are adjusted together."""

    unit: UnitOption = None
    columns: ColumnsOption = None
    sigma_control: SigmaControlOption = 0.003
    sigma_pick: SigmaPickOption = 0.5
    sigma_tie: Annotated[float, Typed(POSITIVE, "PX")] = 0.5
    """Precision of a point found automatically [px]."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MediaOptions:
    """What lies between cameras and wall."""

    indices: Annotated[tuple[float, ...] | None, Typed(Numbers(), "N,N,...")] = None
    """Refractive indices from the camera to the wall, where photos look through media."""
    thicknesses: Annotated[tuple[float, ...] | None, Typed(Numbers(), "T,...")] = None
    """Thicknesses of the media between the first and the last [m]."""
    port: Annotated[float | None, Typed(NOT_NEGATIVE, "M")] = None
    """Camera centre to the first interface, where that moves with the camera [m]."""
    depth: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Wall behind the glass or surface that stays with it [m]."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PairMediaOptions:
    """The same, of a camera each, and what of it is estimated."""

    media: MediaOptions = field(default_factory=MediaOptions)
    port1: Annotated[float | None, Typed(NOT_NEGATIVE, "M")] = None
    """As --port, far photo only [m]."""
    port2: Annotated[float | None, Typed(NOT_NEGATIVE, "M")] = None
    """As --port, near photo only [m]."""
    port_normal: Annotated[
        tuple[float, float, float] | str | None, Typed(Numbers(3, word="axis"), "axis|X,Y,R")
    ] = None
    """A port that leans: square to the camera's optical axis, or its normal in the plane frame,
    towards the camera.  [default: parallel to the wall]"""
    port_normal1: Annotated[
        tuple[float, float, float] | str | None, Typed(Numbers(3, word="axis"), "axis|X,Y,R")
    ] = None
    """The same, far photo only."""
    port_normal2: Annotated[
        tuple[float, float, float] | str | None, Typed(Numbers(3, word="axis"), "axis|X,Y,R")
    ] = None
    """The same, near photo only."""
    estimate: Annotated[tuple[str, ...], Typed(Names(), "LIST")] = ()
    """Unknowns of the media, of index1,..., thickness1,..., port, port1, port2, lean1, lean2 (how a
    port leans), depth; known beforehand as --prior says, indices else to 0.005, lengths to a tenth,
    leans to 1 degree.  [default: none]"""
    prior: Annotated[tuple[str, ...], Typed(unit="NAME=SIGMA")] = ()
    """Standard deviation of what is given of an unknown of the media [-, m, leans: degrees]; inf:
    not known at all; repeat it."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SetUpOptions:
    """How a pair is set up."""

    as_set_up: bool = False
    """Take the set-up exactly as typed (distances, focal lengths, nadir in the photo's middle,
    square to the wall); nothing is registered anew."""
    auto: bool = False
    """From the photos alone; needs one distance or length."""
    one_lens: bool = False
    """One lens took both photos; where no EXIF tells its focal length, the photos do."""
    distance1: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Far camera to the wall [m]."""
    distance2: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Near camera to the wall [m]."""
    delta_d: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Difference of the two distances [m]."""
    focal: Annotated[float | None, Typed(FOCAL, "MM")] = None
    """Focal length of each photo that nothing else is said of [mm].  [default: EXIF]"""
    focal1: Annotated[float | None, Typed(FOCAL, "MM")] = None
    """Focal length, far photo [mm].  [default: EXIF]"""
    focal2: Annotated[float | None, Typed(FOCAL, "MM")] = None
    """Focal length, near photo [mm].  [default: EXIF]"""
    sensor_width: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """Longer side of the sensor, both photos [mm]."""
    sensor_width1: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """The same, far photo only [mm]."""
    sensor_width2: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """The same, near photo only [mm]."""
    pixel_size: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """Instead of the sensor width: one pixel, both photos [mm]."""
    pixel_size1: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """The same, far photo only [mm]."""
    pixel_size2: Annotated[float | None, Typed(POSITIVE, "MM")] = None
    """The same, near photo only [mm]."""
    lens: Path | None = None
    """Lens file of both photos."""
    lens1: Path | None = None
    """Lens file of the far photo."""
    lens2: Path | None = None
    """Lens file of the near photo."""
    lengths: Path | None = None
    """Table of lengths between control points: from, to, length, sigma [m]."""
    length: Annotated[tuple[tuple[float, ...], ...], Typed(Numbers(5), "COL,ROW,COL,ROW,M")] = ()
    """A length on the wall: two points of the far photo [px] and metres. Repeat it: the first gives
    the scale, the others check it."""
    wall: Annotated[tuple[float, float] | None, Typed(Numbers(2), "COL,ROW")] = None
    """A spot of the wall in the far photo, where several planes compete [px]."""
    horizontal: Annotated[
        tuple[float, float, float, float] | None, Typed(Numbers(4), "COL,ROW,COL,ROW")
    ] = None
    """Two points of the far photo on a level line of the wall [px]."""
    vertical: Annotated[
        tuple[float, float, float, float] | None, Typed(Numbers(4), "COL,ROW,COL,ROW")
    ] = None
    """Two points of the far photo on an upright line of the wall [px]."""
    media_of_pair: PairMediaOptions = field(default_factory=PairMediaOptions)
    unit: UnitOption = None
    sigma_pick: SigmaPickOption = 0.5
    sigma_control: SigmaControlOption = 0.003
    sigma_distance: Annotated[float, Typed(POSITIVE, "M")] = 0.02
    """Precision of the measured distances [m]."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MapOptions:
    """How relief is measured."""

    relief_gsd: ReliefGsdOption = None
    bounds: BoundsOption = None
    quality: QualityOption = "standard"
    relief_range: ReliefRangeOption = None
    cloud: Literal["ply", "las", "laz"] | None = None
    """Also a coloured point cloud of this kind, beside the relief map."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PictureOptions:
    """How the orthophoto is made."""

    image: Literal["1", "2", "both"] | None = None
    """Photo that gives the colours: 1 far, 2 near, both: 1 where it sees the wall, 2 in gaps whose
    rim is measured and alike in both.  [default: both; with --measured-only 1]"""
    measured_only: bool = False
    """Leave empty what is not measured or hidden. Otherwise the picture is whole: unknown relief is
    interpolated, far from all else the plane, what no photo sees white; the last band says so of
    each pixel."""
    bounds: BoundsOption = None
    interpolation: InterpolationOption = "cubic"
    mask: bool = True
    """Leave empty what relief hides from the camera, or show what hides it."""
    fill: bool = False
    """With --measured-only: close holes with texture from beside them."""
    complete: Annotated[bool, Typed(hidden=True)] = False
    """Whole pictures are the default."""
    match: bool = True
    """With --image both: bring photo 2 to the colours of photo 1."""
    vignetting: Annotated[str, Typed(VIGNETTING, "cos4|K1,K2,K3")] = ""
    """Undo the fall-off of light to the corners.  [default: off]"""
    chromatic: bool = False
    """Measure and undo red and blue fringes."""
    feather: Annotated[float, Typed(NOT_NEGATIVE, "PX")] = 4.0
    """Width of the transition between the photos [px]."""
    overviews: OverviewsOption = None
    any_size: AnySizeOption = False


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class DrawingOptions:
    """How it is drawn."""

    scale: ScaleOption = None
    dpi: DpiOption = 254.0
    paper: PaperOption = None
    hatch: bool = True
    """Lines over what is not measured; which ones mean what stands in the legend."""
    sections: Annotated[
        tuple[str, ...], Typed(SECTION, "x=M|y=M|'X,Y X,Y ...'", flag="--section")
    ] = ()
    """Section of the relief as DXF and SVG [m], beside a drawing; repeat it."""
    contours: Annotated[float | None, Typed(Length(least=1e-4), "M")] = None
    """Between contour lines [m].  [default: by relief]"""
    layers: Literal["language", "bifocal", "ncs"] = "language"
    """Names of the layers of DXF drawings: in the language (English BIFOCAL_POINTS, Italian
    RIL_PUNTI, German VERM_PUNKTE), always English, or those of the U.S. National CAD Standard
    (V-NODE)."""
    mark: Path | None = None
    """Table of points to draw.  [default: those that give the relief]"""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SurveyOptions:
    """What a report says of the survey as a project."""

    client: str | None = None
    """For whom the survey is made: in the report."""
    place: str | None = None
    """What and where the wall is."""
    surveyor: str | None = None
    """Who measured."""
    survey_date: str | None = None
    """When it was measured, which is seldom the day the files are made."""
    instrument: str | None = None
    """What control and distances were measured with."""
    coordinate_system: str | None = None
    """In which X, Y, r or E, N, H are given."""
    times: bool | None = None
    """State in the report how long each step took; its bytes then differ from run to
    run.  [default: facade yes, survey files no]"""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LensDatabaseOptions:
    """What is asked of the database of lenses."""

    camera_name: str = ""
    """With the database: camera, if EXIF lacks it."""
    lens_name: str = ""
    """With the database: lens, if EXIF lacks it."""
    focal_length: Annotated[float | None, Typed(FOCAL, "MM", flag="--focal")] = None
    """With the database: focal length [mm], if EXIF lacks it."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PairOptions:
    """Every option of a pair, by the key that survey files know it by."""

    control: ControlOption = None
    check: CheckOption = None
    faces: FacesOption = None
    set_up: SetUpOptions = field(default_factory=SetUpOptions)
    map: MapOptions = field(default_factory=MapOptions)
    picture: PictureOptions = field(default_factory=PictureOptions)
    gsd: GsdOption = None
    drawing: DrawingOptions = field(default_factory=DrawingOptions)
    joint: JointOptions = field(default_factory=JointOptions)
    language: LanguageOption = "en"
    project: SurveyOptions = field(default_factory=SurveyOptions)
    cog: CogOption = False


#: Every option of a pair, by the key that survey files know it by.
OF_PAIR = options_of(PairOptions)
#: Files of a pair besides its photos.
FILES = tuple(name for name, option in OF_PAIR.items() if option.is_file)

#: How a pair is set up, its relief measured, its orthophoto made and drawn, all pairs adjusted,
#: and what the report says of the project.
SET_UP, MAP, PICTURE, DRAWING, JOINT, PROJECT = (
    tuple(options_of(group))
    for group in (
        SetUpOptions,
        MapOptions,
        PictureOptions,
        DrawingOptions,
        JointOptions,
        SurveyOptions,
    )
)
#: What each step of a pair asks for.
OF_STEP = {
    "align": ("control", "columns", *SET_UP),
    "relief": ("faces", *MAP, "cog"),
    "points": ("control", "check", "columns", "unit", "language"),
    "ortho": ("faces", *PICTURE, "gsd", "cog"),
    "drawing": ("control", "check", "columns", "faces", *DRAWING, *PICTURE, "language", "cog"),
    "view": ("language",),
    "report": ("control", "check", "columns", "language", "unit", "scale", *PROJECT),
}


def typed(options: Mapping[str, object], *, in_file: bool = False) -> Iterator[str]:
    """Yield options as they are typed on the command line, or as keys of a survey file."""
    for name, value in options.items():
        if name in OF_PAIR:
            yield from OF_PAIR[name].typed_as(value, in_file=in_file)


def defaults_of(step: str, options: Mapping[str, object]) -> dict[str, object]:
    """Return the values a step takes where nothing was said; what depends on the photos is none.

    Examples
    --------
    >>> defaults_of("relief", {}), defaults_of("relief", {"quality": "fast"})
    ({'quality': 'standard', 'cog': False}, {'cog': False})
    """
    unsaid = {name: OF_PAIR[name].fixed_default for name in OF_STEP.get(step, ())}
    return {
        name: value for name, value in unsaid.items() if value is not None and name not in options
    }
