"""The tuned numbers of matching, a class a stage; one without evidence is a plain choice."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class CornerTuning:
    """A corner as the crossing of its two edges."""

    #: Edges are read from this distance from the corner on: nearer, blur has rounded it. [px]
    nearest: float = 3.0
    #: Edges are read up to this distance from the corner. [px]
    farthest: float = 12.0
    #: Half the width of the strip along an edge that is read. [px]
    half_width: float = 3.0
    #: Least length of an edge that is seen. [px]
    shortest: int = 4
    #: Least angle between two edges. [deg]
    least_angle: float = 25.0
    #: Least gradient at an edge, against the strongest about the corner.
    least_gradient: float = 0.25
    #: Least contrast of a profile across an edge against the mean of its profiles.
    least_likeness: float = 0.4
    #: Smoothing leaves about one independent reading in so many pixels of edge. [px]
    #: Evidence: drawn corners.
    pixels_per_reading: float = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureTuning:
    """Features of two photos and which of them match."""

    #: Photos are searched at full resolution up to this; larger ones are reduced to it. [px]
    most_pixels: float = 12e6
    #: SIFT doubles its input: strips of so many pixels need 0.5 GB. [px]
    #: Evidence: memory of SIFT.
    strip_pixels: float = 2e6
    #: Margin of a strip, for what crosses its edge. [px]
    margin: int = 64
    #: Contrast from which a detail counts.
    #: Evidence: church_1: twice the contrast finds 60 % fewer; hardly any on plaster.
    contrast: float = 0.01
    #: How many of the strongest details are kept.
    strongest: int = 30_000
    #: The nearest descriptor is at most this share as far as the second, anywhere.
    distinct: float = 0.85
    #: The same on the line.
    distinct_on_line: float = 0.9
    #: On the line, descriptors agree at least so far (cosine).
    least_alike: float = 0.7
    #: A second candidate this near to the first is the same detail in another orientation. [px]
    same_place: float = 1.5
    #: The same detail differs in size (logarithm) from the usual by no more than this.
    size_slack: float = 0.55
    #: The same detail differs in turn from the usual by no more than this. [deg]
    turn_slack: float = 30.0
    #: Smaller photos hold no detail to speak of. [px]
    smallest_side: int = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchTuning:
    """Homologous points found along radial lines."""

    #: A patch's own sigma is too good by this factor: neighbouring samples are not independent.
    optimism: float = 1.7
    #: Patches that agree less than this are not the same detail.
    least_agreement: float = 0.8
    #: Fewer matched features than this are chance.
    fewest_matched: int = 20
    #: A feature whose patch disagrees is kept this near to its line. [px]
    feature_across: float = 0.7
    #: Such a feature is so precise. [px]
    sigma_feature: float = 0.35
    #: Neighbours asked for support.
    neighbours: int = 8
    #: How many neighbours must agree.
    #: Evidence: two castles: 13 and 35 % of what stood out by 0.8 m was covered before, 91 and 82 %
    #: with it.
    supporters: int = 2
    #: To what share of d1 neighbours must agree in relief.
    relief_alike: float = 0.005
    #: Relief looked for ends this near to the last interface; in air, to the near camera.
    highest_share: float = 0.999


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchTuning:
    """Least-squares matching of small patches."""

    #: Half the window: 15 x 15 samples of the coarser photo. [samples]
    half: int = 7
    #: Farther from the start than this a match is lost. [px]
    reach: float = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SnappingTuning:
    """From a pick to the centre of a target or a corner."""

    #: Radii of the patches in which symmetry is looked for: targets of 6 to 50 px. [px]
    radii: tuple[float, ...] = (4.0, 5.5, 7.5, 10.5, 14.5, 20.0, 27.0)
    #: Precision of a target's centre, as in `bifocal match`. [px]
    target_sigma: float = 0.02
    #: How far a pick may lie from what it is snapped to, at most. [px]
    farthest: float = 16.0
    #: What is less symmetric, in correlation, is no target.
    least_symmetry: float = 0.9
    #: What is of less contrast is no target. [grey levels]
    least_contrast: float = 20.0
    #: Nor is what is less precise than this. [px]
    worst_target: float = 0.06
    #: Noise assumed for the precision of a corner; of a photo at low ISO. [grey levels]
    noise: float = 3.0
    #: No edge is straighter than that. [px]
    best_corner: float = 0.03
    #: Half the window of a corner's measurement. [px]
    half: int = 5
    #: Best precision that is told. [px]
    best: float = 0.01
    #: Worst precision that is told. [px]
    worst: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SuggestionTuning:
    """The homologous point of one pick."""

    #: Relief searched in parts of the near distance begins here, as in `bifocal match`.
    nearest: float = 0.4
    #: And ends here.
    farthest: float = -0.5
    #: What stands nearer to the last interface than this share of its height is not looked for.
    before_media: float = 0.99
    #: Half the window of the search, in samples of the coarser photo: wider than that of the match.
    #: [samples]
    half: int = 10
    #: Samples along the line are so far apart; the match reaches 4 px. [px]
    step: float = 1.0
    #: Samples along the line, at most.
    most: int = 3000
    #: A second place this much worse in correlation leaves no doubt.
    clear: float = 0.1
    #: Suggestions of this quality are taken without asking back.
    kept: float = 0.5
    #: Where one half of the window fits this much better elsewhere nearby, it shows another
    #: surface. Matching back from the other photo finds none of them: both ways the window sees the
    #: surface beside the pick.
    #: Evidence: sample pair: of the kept ones (half of them picked at steps) 8.8 % more than 1 px
    #: wrong without it, 5.2 % with it; of the right ones 97 % stay.
    better_beside: float = 0.05
    #: Nearby begins beyond the match's own peak. [px]
    peak: float = 2.0
    #: Nearby ends here, within reach of a step. [px]
    beside: float = 30.0
    #: A part of the window that agrees less offers no place.
    least_offer: float = 0.6
    #: Places nearer to each other are one. [px]
    apart: float = 3.0
    #: A place far off the wall has to correlate better: by this much per near distance.
    off_wall: float = 0.2
    #: Best precision of a match; neighbouring samples are not independent. [px]
    best: float = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetTuning:
    """Survey targets in a photo."""

    #: Smallest diameter of discs looked for. [px]
    smallest: float = 5.0
    #: Largest diameter of discs looked for. [px]
    largest: float = 120.0
    #: Least contrast between a disc and its plate. [grey levels]
    least_contrast: float = 40.0
    #: How far the grey of a chequer's sectors may be from their medians, share of the contrast.
    uneven: float = 0.06


CORNERS = CornerTuning()
FEATURES = FeatureTuning()
MATCH = MatchTuning()
PATCHES = PatchTuning()
SNAPPING = SnappingTuning()
SUGGESTIONS = SuggestionTuning()
TARGETS = TargetTuning()
