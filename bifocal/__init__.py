"""Relief, coordinates and orthophotos from bifocal pairs of photos.

Two photos of a wall along one line, image 1 from afar with a long lens, image 2 from near with a
short one, at the same scale: what stands out or lies back is shifted, and the shift gives the
relief. X runs right, Y up, relief r towards the cameras [m]; pixels are (column, row).

By hand, the equations
    relief                    r from the radial distances of a point on both photos, Eq. (6)
    relief_from_displacement, relief_displacement   of one photo, Eqs. (2) and (1)
    relief_displacements, plane_coordinates   those on both, Eq. (5); x, y of one, Eq. (7)
The pair
    Pair, Photo               both cameras; read and write pair files, intersect and project points
    PhotoSet                  two or more photos of one wall; a pair is the set of two
    photos_from_project, write_colmap   a set from another program's project, and one for COLMAP
    read_image, write_image, open_photo   photos as arrays, upright as seen; a large one by windows
    Lens                      principal distance, principal point and distortion of a lens
    calibrate, Calibration    a lens from photos of a board
    align, align_set, length_check   a pair, or a set of photos, from them and lengths taped on site
    Control, Interior, SiteMeasures, PairMedia, read_control   what `align` is told
Points
    solve, SolvedSurvey, Points   relief, coordinates, precision, check of measured points
    Taking, Measuring, ReadOptions   lenses, distances, precision, columns that `solve` is told
    georeference, Georeference   wall coordinates to world coordinates by control points
    match, Matches, MatchSettings   homologous points found automatically, with their precision
The whole wall
    dense_relief, DenseRelief measured relief with its precision, pixel by pixel
    ReliefMap, Quality        relief on a grid, its GeoTIFF, and where each pixel's comes from
    orthophoto, Orthophoto, OrthoOptions, Source   the photo to scale, moved by its relief
    rectify, compare          one photo alone to scale; two dates of a wall compared
    mosaic, Mosaic, MosaicOptions   several orthophotos or relief maps made one
    relief_view               the relief in three dimensions, as a page of HTML
The page
    pick                      orient, pick and draw in the browser, as the command `bifocal pick`
    page_server, PageServer, Session   the same without a browser, for programs that drive it
    recording, changed_photos   what outputs say made them; changed photos taken, within it
Sample pairs                  SAMPLE, WATER_SAMPLE: folders of photos with exact truth

What they take and give: Alignment, Bounds, BreakLine, ChangedRegion, CheckResult, Comparison, Face,
Faces, FlagLimits, FlatSurface, Foot, Grid, Intersection, KnownPoints, LargePhoto, Layers,
LengthCheck, MapSurface, MediaPath, NamedPoints, Occluder, OrientationCheck, Pinhole, PlanePicks,
PointObservations, Progress, ProjectedPoints, ProjectOptions, ProjectPhotos, RadialDivision,
RankedPair, Rectification, Registration, ReliefTable, SetAlignment, SetIntersection, Similarity,
suggest_faces, Surface, SurveyInput, SurveyMedia, SurveySetup, TapedCheck, TapedDistance,
ToleranceRule, TransformationPrecision, Window, WorldFrame, WorldPoints.

Errors are one family with one message each that says what is wrong, where, and how to mend it:
PhotogrammetryError > InputError (a ValueError) > CellError, WorkbookError, MissingExtraError;
GeometryError (a ValueError); ConvergenceError. Files in, files out: the command `bifocal`.
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
