"""Options that more than one place takes, each said once.

An option here is at once the command's, a key of survey files and of `bifocal facade`, and what the
step behind is given by its name. Where a command means its own by it, `Option.but` says so.
"""

from __future__ import annotations

from photocore.options import (
    COG,
    FILE,
    FOCAL,
    NOT_NEGATIVE,
    Length,
    Names,
    Numbers,
    Option,
    Scale,
    choice,
    number,
    switch,
)

_AXIS = Numbers(3, word="axis")
_LINE = Numbers(4)


def _flag(name: str, text: str) -> Option:
    return Option(name, is_flag=True, help=text)


def _file(name: str, text: str) -> Option:
    return Option(name, type=FILE, help=text)


CONTROL = _file("--control", "Table of control points: id, X, Y, r [m] and pixels.")
CHECK = _file(
    "--check", "Table of independent check points, like --control: the accuracy is judged by them."
)
UNIT = choice("--unit", "m|cm|mm", "Unit of the coordinates.  [default: the headings', else m]")
LANGUAGE = choice("--language", "en|it|de", "Of report, workbook and sheets.", default="en")
BOUNDS = number(
    "--bounds", "XMIN,YMIN,XMAX,YMAX", "Part of the wall [m].  [default: all that is known]",
    type=Numbers(4),
)  # fmt: skip
SIGMA_CONTROL = number(
    "--sigma-control", "M", "Precision of a control coordinate [m].", default=0.003
)
SIGMA_PICK = number("--sigma-pick", "PX", "Precision of a pick [px].", default=0.5)
SIGMA_TIE = number(
    "--sigma-tie", "PX", "Precision of a point found automatically [px].", default=0.5
)
#: What holds for all pairs where they are adjusted in one frame.
JOINT = (UNIT, SIGMA_CONTROL, SIGMA_PICK, SIGMA_TIE)

#: What lies between the cameras and the wall.
MEDIA = (
    Option(
        "--indices", type=Numbers(), metavar="N,N,...",
        help="Refractive indices from the camera to the wall, where photos look through media.",
    ),
    Option(
        "--thicknesses", type=Numbers(), metavar="T,...",
        help="Thicknesses of the media between the first and the last [m].",
    ),
    number(
        "--port", "M", "Camera centre to the first interface, where that moves with the camera "
        "[m].", type=NOT_NEGATIVE,
    ),
    number("--depth", "M", "Wall behind the glass or surface that stays with it [m]."),
)  # fmt: skip
#: The same of a pair: also ports of their own, and what is not known of the media.
MEDIA_OF_PAIR = (
    *MEDIA,
    number("--port1", "M", "As --port, far photo only [m].", type=NOT_NEGATIVE),
    number("--port2", "M", "As --port, near photo only [m].", type=NOT_NEGATIVE),
    number(
        "--port-normal", "axis|X,Y,R",
        "A port that leans: square to the camera's optical axis, or its normal in the plane frame, "
        "towards the camera.  [default: parallel to the wall]", type=_AXIS,
    ),
    number("--port-normal1", "axis|X,Y,R", "The same, far photo only.", type=_AXIS),
    number("--port-normal2", "axis|X,Y,R", "The same, near photo only.", type=_AXIS),
    Option(
        "--estimate", default="", type=Names(), metavar="LIST",
        help="Unknowns of the media, of index1,..., thickness1,..., port, port1, port2, lean1, "
        "lean2 (how a port leans), depth; known beforehand as --prior says, indices else to 0.005, "
        "lengths to a tenth, leans to 1 degree.  [default: none]",
    ),
    Option(
        "--prior", multiple=True, metavar="NAME=SIGMA",
        help="Standard deviation of what is given of an unknown of the media [-, m, leans: "
        "degrees]; inf: not known at all; repeat it.",
    ),
)  # fmt: skip

#: How a pair is set up, besides its control points.
ALIGN = (
    _flag(
        "--as-set-up", "Take the set-up exactly as typed (distances, focal lengths, nadir in the "
        "photo's middle, square to the wall); nothing is registered anew.",
    ),
    _flag("--auto", "From the photos alone; needs one distance or length."),
    number("--distance1", "M", "Far camera to the wall [m]."),
    number("--distance2", "M", "Near camera to the wall [m]."),
    number("--delta-d", "M", "Difference of the two distances [m]."),
    number("--focal1", "MM", "Focal length, far photo [mm].  [default: EXIF]", type=FOCAL),
    number("--focal2", "MM", "Focal length, near photo [mm].  [default: EXIF]", type=FOCAL),
    number("--sensor-width", "MM", "Longer side of the sensor, both photos [mm]."),
    number("--sensor-width1", "MM", "The same, far photo only [mm]."),
    number("--sensor-width2", "MM", "The same, near photo only [mm]."),
    number("--pixel-size", "MM", "Instead of the sensor width: one pixel, both photos [mm]."),
    number("--pixel-size1", "MM", "The same, far photo only [mm]."),
    number("--pixel-size2", "MM", "The same, near photo only [mm]."),
    _file("--lens", "Lens file of both photos."),
    _file("--lens1", "Lens file of the far photo."),
    _file("--lens2", "Lens file of the near photo."),
    _file("--lengths", "Table of lengths between control points: from, to, length, sigma [m]."),
    number(
        "--length", "COL,ROW,COL,ROW,M",
        "A length on the wall: two points of the far photo [px] and metres.", type=Numbers(5),
    ),
    number(
        "--wall", "COL,ROW",
        "A spot of the wall in the far photo, where several planes compete [px].", type=Numbers(2),
    ),
    number(
        "--horizontal", "COL,ROW,COL,ROW",
        "Two points of the far photo on a level line of the wall [px].", type=_LINE,
    ),
    number(
        "--vertical", "COL,ROW,COL,ROW",
        "Two points of the far photo on an upright line of the wall [px].", type=_LINE,
    ),
    *MEDIA_OF_PAIR, UNIT, SIGMA_PICK, SIGMA_CONTROL,
    number("--sigma-distance", "M", "Precision of the measured distances [m].", default=0.02),
)  # fmt: skip

#: How the relief map is measured.
RELIEF = (
    number(
        "--relief-gsd", "M",
        "Side of a pixel of the relief map on the plane [m] or 5mm, 0.2 at most; a coarse one is "
        "also matched more coarsely.  [default: that of the far photo]", type=Length(above=0),
    ),
    BOUNDS,
    choice(
        "--quality", "fast|standard|best",
        "Of the relief map; fast: a quarter of the time, from half the resolution; best: full "
        "resolution also above 9 megapixels.", default="standard",
    ),
    number(
        "--relief-range", "LOW,HIGH",
        "Least and greatest relief to expect [m].  [default: -36 % and +22 % of d2]",
        type=Numbers(2),
    ),
)  # fmt: skip

#: How an orthophoto is made from the photos.
PICTURE = (
    choice(
        "--image", "1|2|both",
        "Photo that gives the colours: 1 far, 2 near, both: 1 where it sees the wall, else 2.",
        default="1",
    ),
    BOUNDS,
    choice(
        "--interpolation", "cubic|linear|nearest|lanczos", "Between the pixels of the photo.",
        default="cubic",
    ),
    switch("mask", "Leave empty what relief hides from the camera, or show what hides it."),
    _flag("--fill", "Close holes with the colours around them."),
    _flag(
        "--complete", "A whole picture: unknown relief is interpolated, far from all else the "
        "plane; what is not measured says so in the last band. Closes holes, too.",
    ),
    switch("match", "With --image both: bring photo 2 to the colours of photo 1."),
    Option(
        "--vignetting", default="", metavar="cos4|K1,K2,K3",
        help="Undo the fall-off of light to the corners.  [default: off]",
    ),
    _flag("--chromatic", "Measure and undo red and blue fringes."),
    number(
        "--feather", "PX", "Width of the transition between the photos [px].", type=NOT_NEGATIVE,
        default=8.0,
    ),
    Option(
        "--overviews/--no-overviews", default=None,
        help="Reduced copies in the file.  [default: above 50 megapixels]",
    ),
    _flag("--any-size", "Do not ask back about an unusual size."),
)  # fmt: skip
GSD = number(
    "--gsd", "M", "Pixel of the orthophoto [m], or with its unit: 5mm.  [default: that of the "
    "relief map or the photo]", type=Length(above=0),
)  # fmt: skip
SCALE = Option("--scale", type=Scale(), help="Scale of the drawing 1:N, e.g. 1:50.")

#: What a drawing holds besides the orthophoto.
DRAWING = (
    SCALE,
    number(
        "--dpi", "N", "Pixels per inch of paper of a drawing; at 1:50 and 254 dpi a pixel is "
        "5.00 mm.", default=254.0,
    ),
    choice(
        "--paper", "A4|A3|A2|A1|A0", "Sheet of paper.  [default: the smallest that fits]",
        case_sensitive=False, metavar="[A4|A3|A2|A1|A0]",
    ),
    Option(
        "--section", "sections", multiple=True, metavar="x=M|y=M|'X,Y X,Y ...'",
        help="Section of the relief as DXF and SVG [m], beside a drawing; repeat it.",
    ),
    number(
        "--contours", "M", "Between contour lines [m].  [default: by relief]",
        type=Length(above=0),
    ),
    _file("--mark", "Table of points to draw.  [default: those that give the relief]"),
)  # fmt: skip

#: What the lens database is asked by.
OF_DATABASE = (
    Option("--camera-name", default="", help="With the database: camera, if EXIF lacks it."),
    Option("--lens-name", default="", help="With the database: lens, if EXIF lacks it."),
    number(
        "--focal", "MM", "With the database: focal length [mm], if EXIF lacks it.", type=FOCAL
    ).but("--focal", "focal_length"),
)

#: Every option of a pair, by the key that survey files know it by.
OF_PAIR = {
    option.name: option
    for option in (
        CONTROL, CHECK, *ALIGN, *RELIEF, *PICTURE, GSD, *DRAWING, *JOINT, LANGUAGE, COG,
    )
}  # fmt: skip
#: Files of a pair besides its photos.
FILES = tuple(name for name, option in OF_PAIR.items() if option.is_file)


def names_of(*options: Option) -> tuple[str, ...]:
    """Return the keys of options."""
    return tuple(option.name for option in options)
