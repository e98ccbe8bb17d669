"""The tuned numbers of orientation, a class a stage; one without evidence is a plain choice."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class TieTuning:
    """Tie points of two photos."""

    #: Fewer than this and any two photos may seem to match by chance.
    fewest_matches: int = 40
    #: A plane that holds a smaller share of the common points is not "the wall".
    fewest_on_plane: float = 0.12
    #: So many of the strongest features are compared with each other first.
    first_tried: int = 8000
    #: All are compared if fewer than this agree.
    enough: int = 400
    #: More ties than this, spread evenly, tell nothing more: their errors are common to stretches.
    most: int = 6000
    #: How far along its line a partner is looked for around the plane, of the width.
    along: float = 0.2
    #: Neighbours asked for support.
    neighbours: int = 8
    #: How many neighbours must move alike against the plane.
    #: Evidence: six real pairs: of 22 to 54 wrong ties 0 to 22 stayed.
    supporters: int = 2
    #: Neighbours move alike within this, at 3000 px of width. [px]
    alike: float = 4.0
    #: Principal distances tried where one unknown lens took both photos, of the longer side.
    #: Evidence: church_1, church_2, berlin_1: the adjustment converges from the nearest of them.
    focals: tuple[float, ...] = (0.7, 0.82, 0.95, 1.1, 1.3, 1.6, 2.0, 2.5)
    #: Radial distortions tried where the lens is unknown: from, to, how many.
    scanned: tuple[float, float, int] = (-0.25, 0.2, 10)
    #: Truncation of their cost. [px]
    truncated: float = 0.7
    #: A scanned distortion is believed if it lowers the cost to this share of that of none.
    believed: float = 0.9
    #: Ties are never believed to be more precise than this. [px]
    best: float = 0.03
    #: Fewer ties than this, counted by their chances, are no wall.
    fewest_on_wall: int = 20
    #: Ties in fewer tenths of the photo are no wall.
    fewest_cells: int = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class WallTuning:
    """Which plane the wall is, and which ties lie on it."""

    #: Half the thickness of a face, as a share of the far distance.
    face_band: float = 0.0012
    #: The same before the faces are told apart: real façades are rough.
    rough_band: float = 0.005
    #: A face whose points lie spread over less than this share of the area of all is not taken for
    #: the wall where another is spread wider.
    #: Evidence: a castle whose face of 1.1 mm roughness, 550 of 558 points in the left third
    #: (0.33), moved the zero of a wall of 16 mm by 11 mm.
    confined: float = 0.4
    #: Cells along the longer side of the picture in which points of a face are counted.
    cells: int = 10
    #: The present plane is a face of the same wall: others slope less than this against it. [m/m]
    face_slope: float = 0.02
    #: A face with this share of the points of the chosen, or the largest, may as well be the wall;
    #: at one scale it is preferred.
    comparable: float = 0.5
    #: A face whose chance by the measured distances is this share of the chosen one's is none.
    unlikely: float = 0.01
    #: With this share of the largest face's points a face may be chosen by the measured distances.
    fair: float = 0.25
    #: It is if it fits them within this, and the next does not. [sigma]
    face_fits: float = 2.0
    #: Nominal scales this close mean that the photos were planned for one scale.
    one_scale: float = 0.02
    #: Faces nearer than this are one face, unevenly built. [bands]
    faces_apart: float = 3.0
    #: Shallow relief scatters by at least so many times the wall's own roughness.
    wider: float = 2.0
    #: A plane of another direction is taken for the wall if it holds so many times as much as the
    #: fullest one of nearly the present direction.
    fuller: float = 1.5
    #: One of nearly the present direction is given up for the measured distances' sake if it is off
    #: by this: the deviations of the first, rough model are too small. [sigma]
    #: Evidence: four rendered façades: the wall was 1.0 to 2.3 of them off; on one a plane through
    #: plinth and cornices, with a quarter as many points, only 0.8 off and 14.7 degrees wrong.
    plane_contradicted: float = 4.0
    #: Planes looked for.
    most_planes: int = 5
    #: Triples tried for each plane.
    triples: int = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class BendTuning:
    """Whether the wall is bent, by refraction or a wrong lens."""

    #: Beyond this it is refraction or a strong lens for certain; `MOST_BENT` is the limit of an
    #: honest pair. [px]
    #: Evidence: set after they were seen: rendered façades 0.006 px, church_1 and church_2 0.10;
    #: rendered ones seen through half a metre of water in 17 m 0.22 and 0.43.
    strongly_curved: float = 1.0
    #: A face is what lies within this share of the far distance from its plane.
    band: float = 0.0025
    #: Where a face holds fewer ties the wall itself is bent.
    fewest_on_face: int = 100
    #: So it is where a face holds a smaller part of what a bent surface through all ties would
    #: hold.
    #: Evidence: six rendered façades: flat faces hold 1.03 to 1.4 times as many as the best bent
    #: surface, walls bent by 1.8 to 14 px 0.1 to 0.6.
    face_holds: float = 0.8
    #: Faces tried.
    most_faces: int = 3
    #: Residuals that count less and less, at 3000 px of width. The last tell one bent wall from
    #: parallel faces, which a bent surface meets along lines only. [px]
    widths: tuple[float, ...] = (8.0, 5.0, 3.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.3)
    #: Prior of the bend.
    sigma: float = 0.05
    #: A bend so small that what it does is proportional to it.
    small: float = 1e-3
    #: Ties used.
    ties: int = 2500
    #: Side of the cells whose ties err alike, over half the diagonal.
    cell: float = 0.17
    #: Draws of the cameras and media as uncertain as they are.
    draws: int = 24
    #: The bend that counts, in what the draws bend the wall by.
    beyond: float = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlTuning:
    """What is assumed of control, lens and distances, and when they do not fit."""

    #: Distances that control through media leaves so uncertain are not found from common points
    #: either, without focal lengths.
    #: Evidence: 44 % ends at 10 %.
    hopeless: float = 0.6
    #: Photos without common points of which so many control points are wrong show different walls.
    #: Evidence: of a church's far photo beside a near one of another, 3 of 9 were.
    of_another_wall: float = 0.25
    #: A wall point given without r lies on the plane to this. [m]
    sigma_on_wall: float = 0.005
    #: Logarithms of a ratio of distances so far apart contradict each other; tilted cameras change
    #: the scale over the wall.
    unlike: float = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class AreaTuning:
    """Points spread evenly over what both photos show."""

    #: Pixels of the rectified photos. [px]
    pixels: float = 1.0e6
    #: Points asked of the whole area.
    points: int = 3000


@dataclass(frozen=True, slots=True, kw_only=True)
class LineTuning:
    """The façade's uprights and levels."""

    #: Lines farther than this from the photo's own upright are not asked for the axes. [deg]
    widest: float = 20.0
    #: With a smaller share of their length along its axes the photo's lines are no façade's.
    least_in_line: float = 0.25
    #: Photos are searched for lines at this size. [px]
    searched: float = 1.5e6
    #: Lines that feed the tilt are no shorter than this share of the photo's width.
    shortest: float = 0.02
    #: They lie no farther than this from upright or level. [deg]
    astray: float = 12.0
    #: They are so many at least.
    fewest: int = 40
    #: Directions tried for their common direction. [deg]
    tried: float = 4.0
    #: One photo alone is tried looking so far up, down and to the sides of the wall. [deg]
    turned: float = 44.0
    #: The width in which lines agree on it. [deg]
    agree: float = 0.25
    #: Lines within the same of so many by so many parts of a photo err together.
    parts: int = 5
    #: Lines that turn the plane off more of the wall's details than this are not the wall's.
    #: Evidence: berlin_1, a bumpy wall of a phone's photos: of the 457 details they left 27 and
    #: then none.
    wall_kept: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class RemarkTuning:
    """From where a weakness is worth a remark."""

    #: Common points that fit their lines no better than this, at 3000 px of width, do not fit. [px]
    #: Evidence: clean pairs reach 0.19, a phone pair with its lens estimated 0.4.
    worst_fit: float = 0.6
    #: Relief whose size is known no better than this calls for a tape.
    #: Evidence: nine points with 0.45 m of relief and no lens give 2 to 4 %, a tape of 2 cm 0.4 %.
    worst_scale: float = 0.01
    #: The wall is found in a part of the photo only if so much of it lies in few zones.
    most_of_wall: float = 0.95
    #: Few zones, of nine.
    few_zones: int = 3
    #: Beyond this an adjusted value contradicts what was given. [sigma]
    contradicts: float = 3.0
    #: Cameras tilted by more may have cropped photos.
    #: Evidence: cut by 15 % off the middle, the sample's come out tilted by 2 to 18 degrees. [deg]
    asked_tilt: float = 8.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StageTuning:
    """From the first cameras to the last adjustment."""

    #: A wall's face slopes by this against the plane it was meant to be. [m/m]
    uneven: float = 0.004
    #: Control points of so small a relief say that they lie on the wall. [sigma]
    on_wall: float = 4.0
    #: It is believed if its plane is no further from theirs. [sigma]
    wall_limit: float = 3.0
    #: Upright or level lines of both photos that come out of the wall of the ties by more are not
    #: used: sills and cornices are not level, and some belong to other faces. [sigma]
    #: Evidence: a church whose level lines stay 0.4 and 0.64 deg out of its wall.
    family_limit: float = 2.0
    #: The wall is the reference plane itself: sigmas of its offset and slopes. [m, m/m]
    free: tuple[float, float] = (1e-5, 1e-6)
    #: Relative standard deviation with which two photos of one lens have one principal distance.
    one_lens: float = 1e-3
    #: Common points that take part, where each costs more than in air.
    most_bent_ties: int = 1000
    #: Fewer common points say nothing.
    fewest_ties: int = 20
    #: How often pixels are freed of refraction anew, at the distances found, at most.
    freed_rounds: int = 3
    #: Distances found this near to those supposed (logarithm) free pixels well enough.
    freed_enough: float = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipTuning:
    """Slips of a typed set-up that are tried."""

    #: What was typed is doubted where it misses by so many times what it may.
    #: Evidence: clean control of church_1, church_2 and semireal_church comes to 0.7 to 1.7, with a
    #: slip to 4 and more.
    doubted: float = 2.0
    #: A slip is believed that fits so many times better.
    better: float = 3.0
    #: And to this.
    fits: float = 3.0
    #: A mirror image that lays the camera on its side, and a focal length of any size, are believed
    #: if nothing fits nearly so well.
    clearly: float = 1.3
    #: Beyond this control points contradict a focal length. [sigma]
    certain: float = 4.0
    #: A point that misses by more says no more. [sigma]
    most: float = 10.0
    #: A distance that changes by more (logarithm) if photos were cropped is worth a doubt.
    elsewhere: float = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderTuning:
    """Which photo was taken from nearer."""

    #: Longer side of the pictures that are compared. [px]
    side: int = 1500
    #: Blocks a side for the scatter.
    blocks: int = 10
    #: Steps of parallax are looked for between places so far apart. [px]
    reach: float = 6.0
    #: Steps above this count. [px]
    step: float = 2.0
    #: So much is believed. [sigma]
    #: Evidence: the rendered church 9, church_1 4; the sample 2.6 and church_2, seen from 18
    #: degrees beside the axis, -1.5 tell nothing.
    sure: float = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ResectionTuning:
    """The first camera of a photo from its control points."""

    #: Picks that miss by more than this share of the image width are gross, whatever the lens.
    gross_share: float = 0.006
    #: Rounds in which points are put where they seem to be.
    #: Evidence: it settles in three to six.
    rounds: int = 12
    #: Then the camera moves by less than this share of its distance.
    settled: float = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationTuning:
    """Why two photos do not make a bifocal pair."""

    #: Below this a photo is blurred.
    #: Evidence: sharp photos: 0.3 to 0.6; blurred by 3 px: below 0.17.
    blurred: float = 0.15
    #: Soft photos of more pixels are judged at half their size, and again while they are as large:
    #: features are sought in fewer. Phones and small sensors enlarge theirs to 24 to 108 MP. [px]
    large: float = 24e6
    #: The distances must differ by this share; relief errors grow with its inverse.
    least_change: float = 0.03
    #: Lenses for façades bend less than this in the corner, as a share of the half diagonal.
    #: Evidence: compact cameras reach 11 %.
    most_distortion: float = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class RepetitionTuning:
    """Whether a wall repeats itself, and where its photos belong together then.

    Evidence: church_1, church_2, castle_B and berlin_1 are like themselves by 0.17 at most,
    rendered fronts of windows all alike by 0.95 and more. Of these the grain of the plaster (0.3
    to 1 grey level under noise of 1.5) correlates by 0.11 to 0.60 at the true place, 7 to 23
    sigma, and by 0.08, 5 sigma, at most anywhere else. What stands out correlates by 0.75 to 0.85
    where a door is, by 0.38 to 0.55 everywhere where nothing is.
    """

    #: Pixels of the rectified photos. [px]
    pixels: float = 2.0e5
    #: Of the wall so much to either side is looked at, of the far distance.
    reach: float = 1.2
    #: What is seen of it is no narrower than this share of its length.
    narrowest: float = 0.01
    #: Least share of the smaller picture that is common to both.
    overlap: float = 0.25
    #: Radius from which on grey values are shading, not pattern, of the picture's side.
    ground: float = 0.03
    #: Radius from which on they are no grain of the plaster, of the same.
    grain: float = 0.015
    #: Rows of windows are askew by no more than this. [m/m]
    cone: float = 0.06
    #: Two windows are no repetition: a period is no longer than this, of the picture's side.
    #: Evidence: rendered façades with a window to either side of the door are like themselves over
    #: 0.55 of it; their common points never lay aside.
    longest: float = 0.34
    #: Peaks of the wall's likeness to itself stand out by this.
    stands_out: float = 0.2
    #: The first of those this good is the period, of the highest.
    as_good: float = 0.85
    #: A wall that is less like itself does not repeat itself.
    repeats: float = 0.5
    #: Share of the picture, of the gentlest slopes, that is plaster.
    calm: float = 0.5
    #: The place of the photos is certain if its peak is so many sigma high.
    sure: float = 6.0
    #: And so many times as high as any other.
    clearly: float = 1.4


TIES = TieTuning()
REPETITION = RepetitionTuning()
WALLS = WallTuning()
BEND = BendTuning()
CONTROL = ControlTuning()
AREA = AreaTuning()
LINES = LineTuning()
REMARKS = RemarkTuning()
STAGES = StageTuning()
SLIPS = SlipTuning()
ORDER = OrderTuning()
RESECTION = ResectionTuning()
VALIDATION = ValidationTuning()
