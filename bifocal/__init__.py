"""Relief, coordinates and orthophotos from bifocal pairs of photos.

Two photos of a wall along one line, image 1 from afar with a long lens, image 2 from near with a
short one, at the same scale: what stands out or lies back is shifted, and the shift gives the
relief. X runs right, Y up, relief r towards the cameras [m]; pixels are (column, row).

By hand, the equations
    relief                    r from the radial distances of a point on both photos, Eq. (6)
    relief_from_displacement  r from one displacement, Eq. (2)
    relief_displacement       the displacement on one photo, Eq. (1)
    relief_displacements      those on both, from the distances, Eq. (5)
    plane_coordinates         x, y from radial distance and angle, Eq. (7)
The pair
    Pair, Photo               both cameras; read and write pair files, intersect and project points
    Intersection              what `Pair.intersect` returns: X, Y, r, covariance, flags
    Lens                      principal distance, principal point and distortion of a lens
    calibrate, Calibration    a lens from photos of a board
    align, Alignment          a pair from two photos and what was measured on site
    Control, Interior, SiteMeasures, PairMedia   what `align` is told
Points
    solve, SolvedSurvey       relief, coordinates, precision, check of measured points
    Taking, Measuring         distances and lenses, unit and precision that `solve` is told
    ReadOptions               which column of a table is which
    georeference, Georeference   wall coordinates to world coordinates by control points
    match, Matches            homologous points found automatically, with their precision
    MatchSettings             what `match` looks for
The whole wall
    dense_relief, DenseRelief measured relief with its precision, pixel by pixel
    ReliefMap, Quality        relief on a grid, and where each pixel's comes from
    orthophoto, Orthophoto    the photo to scale, moved by its relief
    OrthoOptions              how an orthophoto is rendered
    mosaic, Mosaic            several orthophotos or relief maps made one
    MosaicOptions             how they are joined
    relief_view               the relief in three dimensions, as a page of HTML

The page
    pick                      orient, pick and draw in the browser, as the command `bifocal pick`
    page_server, PageServer   the same without a browser, for programs that drive it

    recording                 what the outputs written within it say made them

Files in, files out: the command `bifocal`. Errors are ValueErrors with one message that says what
is wrong, where, and how to mend it.
"""

from photocore.public_names import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
