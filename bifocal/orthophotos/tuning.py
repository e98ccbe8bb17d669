"""The tuned numbers of orthophotos, a class a stage; one without evidence is a plain choice."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ComposeTuning:
    """Windows of an orthophoto, and the choice among photos."""

    #: Side of the windows an orthophoto is made in; larger ones repeat less of their surroundings,
    #: smaller ones need less memory. [px]
    tile: int = 1024
    #: How far around a window colours are sought to fill holes. [px]
    fill_reach: int = 128
    #: Places a side of a window at which photos of a set are judged.
    places: int = 17
    #: How much a slope of one of a photo's rays counts against a pixel's side, in pixels of the
    #: orthophoto: an error of relief of two pixels shifts what it shows by two.
    slope: float = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GapsTuning:
    """When the near photo closes a gap of the far one."""

    #: Breadth of the rim that is judged. [px]
    rim: int = 4
    #: What stands this much before the gap hides it, and is no part of the rim. [m]
    before: float = 0.05
    #: Share of the rim that must have been measured.
    #: Evidence: castles and churches: 0 to 11 gaps are closed, 33 to 1011 are not; not backed by
    #: a rim 72 to 97 % of what the near photo paints on rendered scenes is wrong.
    measured: float = 0.5
    #: Both photos are blurred by this before they are compared, in far photo pixels. [px]
    blur: float = 1.2
    #: They are alike where half of the rim differs by less than this share of white.
    differ: float = 0.086


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedTuning:
    """Things that moved between two photos."""

    #: Pixels of the grid on which they are sought, in far photo pixels.
    pixels: float = 2.0
    #: Blur before the photos are compared. [px]
    blur: float = 1.25
    #: They differ by more than this in the middle of a thing. [of 255]
    #: Evidence: castle_A's parked machine; without the test of likeness every pane is a thing.
    core: float = 28.0
    #: And by more than this up to its rim. [of 255]
    rim: float = 12.0
    #: Smaller things are left. [m2]
    area: float = 0.05
    #: Where more of it was measured both photos show one thing.
    measured: float = 0.6
    #: Where half of the blocks correlate by more, too: it is mirrored, or misplaced.
    #: Evidence: castle_B: panes and displaced ornaments 0.77 and more, a parked machine 0.55.
    likeness: float = 0.65
    #: Side of the blocks. [px]
    block: int = 15
    #: So many of them are enough, about.
    blocks: int = 100
    #: How far they are sought. [px]
    reach: int = 5
    #: Blocks of less spread show nothing. [of 255]
    contrast: float = 6.0
    #: What a nat of rarity of its colours on the wall counts beside that share.
    #: Evidence: castle_B's machine, whose edges alone do not decide (0.44).
    strange: float = 0.25
    #: Share of the edges that says in which photo the thing is.
    #: Evidence: castle_A's machine on good relief 0.7 and more, on bad 0.35 to 0.59.
    sure: float = 0.65


@dataclass(frozen=True, slots=True, kw_only=True)
class HolesTuning:
    """What no photo sees."""

    #: Larger holes stay paper white. [m2]
    largest: float = 0.05
    #: But for their fringe, parts of them narrower than this. [m]
    narrow: float = 0.06
    #: Their outline is smoothed by this share of that, which keeps the narrowest of them.
    smooth: float = 0.6
    #: Holes of no more take the mean colour of their rim, unseen on paper. [px]
    speck: int = 25
    #: Breadth of the rim at which a copy must fit. [px]
    rim: int = 6
    #: What stands this much before the hole is no part of its rim. [m]
    before: float = 0.05
    #: A rim of fewer pixels says nothing. [px]
    fewest: int = 6
    #: How far around a hole texture is sought, at least. [m]
    reach: float = 0.25
    #: Holes in larger windows take the colours at their rim. [px]
    most: int = 6_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ContoursTuning:
    """Contour lines."""

    #: Relief detail worth drawing, on paper. [mm]
    detail: float = 0.4
    #: Half windows of the smoothing, counted in such details: features of 3 mm and more stay.
    windows: tuple[int, int] = (2, 4)
    #: More contour levels than this are a mistake of unit.
    most_levels: int = 2000
    #: Side of the largest raster contours are drawn from. [px]
    largest: int = 4000
    #: Relief is compared so far to both sides of a line, on paper. [mm]
    aside: float = 2.0
    #: On average over so much of it: a line that wanders over a flat wall has nothing higher on its
    #: one side. [mm]
    stretch: float = 8.0
    #: And so far, where as much less will do: on a flat strip that is narrower than twice `aside` a
    #: line of its own level would lean on the steps at both its edges. [mm]
    near: float = 0.8
    #: What must lie between both sides of a line, in standard deviations of one pixel. The sigma of
    #: a relief map is that of a pixel and rather too large; the mean of a stretch is far better
    #: known. [sigma]
    clear: float = 1.0
    #: And in intervals: where the next line would be 40 mm away on paper, this one says nothing,
    #: and on a wall at its own level it follows the last tenth of a millimetre. [intervals]
    slope: float = 0.1
    #: And this share of it on either side.
    either: float = 0.25
    #: Lines shorter than this are no form of the wall, on paper. [mm]
    shortest: float = 8.0
    #: Between points of a line, on paper. [mm]
    spacing: float = 0.5
    #: Every so many levels a thick line.
    each: int = 5
    #: Height of labels, on paper. [mm]
    label_size: float = 1.8
    #: The line that a label needs, on paper. [mm]
    room: float = 14.0
    #: Between labels of a line, on paper. [mm]
    between: float = 110.0
    #: A shorter line does without a label where one of its level stands nearby: joints and stones
    #: of one level would be labelled each. On paper. [mm]
    short: float = 60.0
    #: Nearby, on paper. [mm]
    neighbour: float = 40.0
    #: More contour levels than this are made only where their interval is asked for.
    most_automatic: int = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetTuning:
    """The print sheet."""

    #: White to the left of the frame, for binding. [mm]
    left: float = 20.0
    #: White around the frame elsewhere. [mm]
    margin: float = 10.0
    #: Room between the frame and the picture for the numbers of the grid. [mm]
    band: float = 9.0
    #: From the edge of the picture to the letter of a section, outside of the grid's numbers. [mm]
    beyond: float = 6.8
    #: Height of the strip with title, scale bar and level mark. [mm]
    strip: float = 34.0
    #: Strokes of a section line repeat after this, on paper. [mm]
    cut: float = 8.6
    #: Labels stand so far above their contour lines, on paper. [mm]
    above: float = 0.6
    #: From the end of a section within the picture to its letter. [mm]
    within: float = 3.0
    #: Size of the letters. [mm]
    letter: float = 3.0
    #: More points than this are drawn smaller, and their names further apart.
    many: int = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileTuning:
    """The drawing of a section."""

    #: Between values of the axis along the wall, about, on paper. [mm]
    along: float = 20.0
    #: Between values of the axes of the relief, to the right and upwards, about, on paper. [mm]
    across: tuple[float, float] = (10.0, 5.0)
    #: White around the profile, for the values. [mm]
    margin: float = 10.0
    #: White below it, for name and scale bar. [mm]
    foot: float = 19.0
    #: Points of a section that are looked up together.
    together: int = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class TidyingTuning:
    """What of a mask is too small to be a shadow."""

    #: Parts of fewer pixels are neither masked nor left unmasked by themselves: at 1:50 they are a
    #: quarter of a millimetre. [px]
    #: Evidence: of 2450 holes of an oblique church photo 2200 were smaller.
    least_area: int = 25
    #: Of a whole picture, shadows nowhere wider than this many pixels of the photo are drawn. [px]
    sliver: float = 1.5
    #: A part of the mask reaches no farther than this: a window with such a margin is tidied as a
    #: whole picture would be. [px]
    margin: int = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendingTuning:
    """Seams and exposure of mosaics."""

    #: Sides of the rasters on which seams and exposure are worked out, as a part of the mosaic's
    #: own, so that the work grows with it.
    coarse_share: float = 1 / 3
    #: But no less than this. [px]
    coarse_least: int = 400
    #: And no more than this. [px]
    coarse_most: int = 1600
    #: Levels of the blending pyramid; colours fade over about 2^(levels + 1) px, detail over two.
    levels: int = 5
    #: Seams keep this far from holes, which lie behind steps of the relief. [coarse px]
    shy: float = 6.0
    #: Relief that changes by more than this is an edge to a seam. [m/m]
    edge_slope: float = 0.5
    #: Smaller overlaps fit no exposure. [coarse px]
    least_overlap: int = 50
    #: An overlap that tells whether layers show one wall. [px]
    telling: int = 5000
    #: The least that varies on it, share of the range of colours, or metres.
    contrast: float = 0.02
    #: The least correlation of what varies, near zero for pictures of different things.
    alike: float = 0.1
    #: A relief map that differs from its neighbour by more is pointed out. [m]
    relief_step: float = 0.005
    #: Inputs less alike on their overlap are asked about.
    #: Evidence: two churches' pairs have +0.76 to +0.88 (orthophotos), +0.30 to +0.78 (relief
    #: maps); a façade moved along by 1.3 m has +0.05 to +0.30.
    weak: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelsTuning:
    """Sizes that cannot be meant, and what is worth a remark."""

    #: A pixel this many times the photo's own is too fine and asked back about.
    finest: float = 0.0625
    #: A pixel this many times the photo's own is too coarse and asked back about.
    coarsest: float = 40.0
    #: So is one of this many times the photo's own that makes so many pixels that it takes minutes.
    fine: float = 2 / 11
    #: So many pixels. [px]
    many: int = 25_000_000
    #: So are orthophotos of more pixels than this. [px]
    most: int = 4_000_000_000
    #: Orthophotos of more pixels get reduced copies inside the file, for fast display. [px]
    overviews_from: int = 50_000_000
    #: A picture more of which lies on the plane is a rectified photo.
    rectified: float = 0.5
    #: An empty share of a picture from which ways to fill it are named.
    worth_a_remark: float = 0.1
    #: A pixel finer than the photo's by this factor shows no more, and that is said.
    said: float = 0.67


@dataclass(frozen=True, slots=True, kw_only=True)
class ColoursTuning:
    """Colours of one photo brought to those of another."""

    #: Halvings of the picture; holes up to 2^8 px wide are closed.
    halvings: int = 8
    #: Side of the grid on which two photos are compared. [px]
    compare: int = 400
    #: Fewer common pixels than this say nothing about colours. [px]
    least_common: int = 500
    #: Exponents between the tones of two photos beyond these are no photo's: only gain is fitted.
    gamma: tuple[float, float] = (0.4, 2.5)
    #: Rows corrected at a time. [px]
    rows: int = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class RectificationTuning:
    """Distortion of a photo, tabulated."""

    #: Distortion is tabulated every so many ideal pixels and interpolated linearly in between. [px]
    #: Evidence: a 19 mm zoom, 44 px in the corner: true to 0.001 px.
    lens_step: int = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadingTuning:
    """Colours and lines of the relief sheet."""

    #: How pale the colours of relief that was not measured become.
    pale: float = 0.45
    #: How dark its lines are.
    lines: float = 0.55
    #: Distance of the lines, on paper. [mm]
    period: float = 1.5
    #: Width of the lines, on paper. [mm]
    stroke: float = 0.2
    #: What is narrower than this is not paler, either, on paper. [mm]
    narrow: float = 1.0
    #: What is narrower than that bears no lines, which would be a rash of dashes. On paper. [mm]
    lined: float = 2.5


@dataclass(frozen=True, slots=True, kw_only=True)
class TrianglesTuning:
    """Relief between measured points."""

    #: Times a breakline is halved where the triangles still cross it; 2^10 pieces are finer than
    #: any orthophoto.
    halvings: int = 10
    #: Points closer than this to another are the same. [m]
    same: float = 1e-06


@dataclass(frozen=True, slots=True, kw_only=True)
class VisibilityTuning:
    """What relief hides from a camera."""

    #: What is narrower, and displaced by more than this, has nothing beneath it: rays pass below a
    #: rail. [m]
    #: Evidence: balcony of façade 1011 (balconies), mask's precision and recall: never 0.48 and
    #: 0.84, 0.06 m 0.74 and 0.75, 0.08 m 0.71 and 0.76; with the exact relief 0.52 and 0.96, 0.06 m
    #: 0.98 and 0.83.
    thin: float = 0.06
    #: Whether rays pass below thin things is decided in windows of this side. [px]
    #: Evidence: the same balcony: 31 px 0.74 and 0.75, 61 px 0.77 and 0.72.
    seen_past: int = 31
    #: They do where both photos measured more than this share of what the space below would hide.
    #: Evidence: the same balcony: 0.25 0.60 and 0.79, 0.1 0.74 and 0.75, 0.03 0.76 and 0.72.
    share_seen: float = 0.1
    #: A pixel of the buffer is a candidate when another on its ray lies this much farther in. [px]
    margin: float = 1.0
    #: On surfaces that are seen at a grazing angle neighbours this far apart share a cell. [px]
    sure: float = 5.0
    #: Shadows shorter than this cannot be told from the half pixel to which steps are known. [px]
    least_shadow: float = 0.35
    #: A step lies anywhere between two pixel centres; shadows are taken this much longer than from
    #: the middle. [px]
    #: Evidence: rendered walls: finds 99 % of the hidden pixels at 0.27 % false alarms.
    rim: float = 0.5
    #: A rise of this many times the ray's own within a pixel is a step.
    steep: float = 1.0
    #: Where a ray is compared with the relief: distances from the pixel. [px]
    beside: tuple[float, float] = (1.25, 1.75)
    #: And distances from its occluder. [px]
    around: tuple[float, ...] = (-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0)
    #: Windows with surroundings of more pixels are halved. [px]
    largest: int = 2_000_000
    #: They are halved down to this side. [px]
    smallest: int = 200
    #: Through media neighbours on a flat part lie up to this much farther apart than on the axis.
    bent: float = 1.3
    #: No more than this many points are inserted between two neighbours.
    most_steps: int = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeTuning:
    """Relief where none is measured."""

    #: Pixels of the sheet, at most. [px]
    most: int = 30_000_000
    #: Relaxations of the sheet at each level but the finest two, which get a third.
    sweeps: int = 12
    #: Distance from known relief, as a share of the picture's longer side, from which the sheet
    #: goes over into the plane: a wall goes on, a porch does not.
    near: float = 0.03
    #: Such a distance at which it has.
    far: float = 0.1
    #: But from no nearer than this. [px]
    seam: float = 24.0
    #: Rays no more oblique than this are judged as if they were.
    least_slope: float = 0.03
    #: Crumbs of interpolated relief are left out where that moves the picture by less than this
    #: share of the photo's pixel.
    #: Evidence: balconies, painted more than 2 px off: kept 5.5 %, left out within 10 mm 6.0, 30 mm
    #: 7.1; castle_B, points beyond 20 mm: kept 0.85 %, left out within 30 mm 0.51.
    bound: float = 0.5
    #: Smaller parts that would move it by more are left out, too. [m2]
    piece: float = 0.002
    #: Side of the square of which a share must be measured, lest measured pixels be crumbs. [m]
    around: float = 0.2
    #: That share.
    dense: float = 0.5
    #: Parts of this area that are even are no crumbs. [m2]
    broad: float = 0.1
    #: Relief is even that moves the picture by less from pixel to pixel. [m]
    even: float = 0.008
    #: What goes on beside what is kept, by no more than that of relief a pixel, is kept, too, so
    #: far: the rims of raised parts are interpolated. [px]
    #: Evidence: wrongly hidden on loggia 201: 0 px 0.314 %, 1 px 0.296, 3 px 0.291, 8 px 0.289.
    rim: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class HatchTuning:
    """Lines over what is not measured."""

    #: Distance of the lines over what is not measured, on paper. [mm]
    period: float = 3.0
    #: How opaque they are.
    #: Evidence: castle_B, of which half is hatched: at 0.5 and 2.2 mm the lines are seen before the
    #: wall is.
    share: float = 0.3
    #: Below this lines are white, else black. [grey levels]
    dark: int = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class SpotsTuning:
    """Spot heights."""

    #: Side of the fields of a sheet that get a spot height each, on paper. [mm]
    field: float = 40.0
    #: The relief around a spot is measured and even over so much, on paper. [mm]
    even: float = 3.0
    #: Relief that a spot may be rougher for lying in the middle of its field, not at its edge. [px]
    middle: float = 4.0
    #: Height of their numbers, on paper. [mm]
    size: float = 1.9


COMPOSE = ComposeTuning()
GAPS = GapsTuning()
MOVED = MovedTuning()
HOLES = HolesTuning()
CONTOURS = ContoursTuning()
SHEET = SheetTuning()
PROFILE = ProfileTuning()
TIDYING = TidyingTuning()
BLENDING = BlendingTuning()
PIXELS = PixelsTuning()
COLOURS = ColoursTuning()
RECTIFICATION = RectificationTuning()
SHADING = ShadingTuning()
TRIANGLES = TrianglesTuning()
VISIBILITY = VisibilityTuning()
WHOLE = WholeTuning()
HATCH = HatchTuning()
SPOTS = SpotsTuning()
