"""The tuned numbers of dense relief, a class a stage; one without evidence is a plain choice.

Scenes are rendered (façade, loggia, church and their seeds, tests/scenes) or real (church_1,
church_2, semireal church). "35/19" and the like are focal lengths in mm.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitsTuning:
    """What is refused, and what small frames can afford."""

    #: Working frames of fewer pixels can afford the finer search. [px]
    small: float = 3e6
    #: Relief maps of more pixels are refused: a unit has been mistaken. [px]
    largest_map: float = 400e6
    #: A GSD coarser than this, and coarser than twice the far photo's pixel, is a slip, too. [m]
    coarsest_gsd: float = 0.2
    #: So is a GSD coarser than the photo's that leaves fewer pixels a side. [px]
    fewest_pixels: int = 64
    #: Matching needs this many working pixels a side. [px]
    smallest_work: int = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTuning:
    """Both photos on one grid."""

    #: A plane grid that fits the pixels of a photo this well is not resampled. [px]
    same_lattice: float = 0.002
    #: Parts of an oblique photo this much coarser than its middle are left out.
    coarsest_share: float = 3.0
    #: Side of the raster on which the pixels' shapes are taken. [px]
    stretch_side: int = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class SeedTuning:
    """The first relief."""

    #: Width or height at which the sweep works; more brings little, costs squarely. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.07 / +0.34, plaster facade +0.70 / -1.86,
    #: church -0.33 / +0.14.
    coarse_side: int = 420
    #: The same in `fast`. [px]
    #: Evidence: façades 71 and 83, fast: the same beyond 3 cm from 300 and 420 px.
    fast_side: int = 300
    #: Deepest relief tried, as a share of d2: porches go deeper than cornices stand out.
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / -0.01, plaster facade +0.77 / +0.30,
    #: church -0.18 / -0.14.
    deepest: float = -0.36
    #: Highest relief tried, as a share of d2.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.06 / +0.02, plaster facade -1.31 / +0.53,
    #: church -0.20 / -0.15.
    highest: float = 0.22
    #: Steps per coarse pixel of parallax at the far corner. [1/px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.15 / +0.00, plaster facade +0.02 / -0.54,
    #: church -0.00 / +0.01.
    steps_per_pixel: float = 1.0
    #: The most hypotheses.
    most_steps: int = 128
    #: Grey values this weak are noise: they do not correlate. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.02 / +0.07, plaster facade -0.16 / -0.41,
    #: church -0.09 / +0.13.
    noise: float = 2.0
    #: Cost of a hypothesis that falls outside photo 2, between a good (0) and a bad match (1).
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.02 / +0.01, plaster facade +0.23 / -0.68,
    #: church -0.03 / -0.16.
    outside: float = 0.45
    #: Penalty of the smoothing for one step.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.02 / -0.01, plaster facade -0.02 / -0.22,
    #: church +0.09 / -0.04.
    one_step: float = 0.06
    #: Penalty of the smoothing for any jump.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.08 / +0.01, plaster facade +0.73 / -0.83,
    #: church -0.00 / -0.06.
    jump: float = 0.55


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureTuning:
    """Photos brought to one exposure."""

    #: Darker values are noise, and values as near to white are clipped: they do not take part.
    #: [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: church +0.00 / -0.05.
    darkest: float = 12.0
    #: Exposures that agree to this are left alone. [grey levels]
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    worthwhile: float = 1.0
    #: Pixels on a side of the comparison. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: church -0.13 / +0.11.
    samples: int = 160


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationTuning:
    """Whether the photos fit."""

    #: Pixels that come back to themselves within this are taken for matched. [px]
    matched: float = 1.0
    #: With a smaller share of matched pixels the photos do not show the same thing.
    least_matched: float = 0.12
    #: Systematic misfit that is worth a remark. [px]
    remark_px: float = 0.35
    #: Misfit beyond which no relief is made. [px]
    refuse_px: float = 3.0
    #: The nadir zone has no direction across the radius: share of the frame's half diagonal.
    nadir_zone: float = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowTuning:
    """Flow between the photos."""

    #: Weight of smoothness.
    #: Evidence: 30 is as good before noise is taken out, 20 keeps more detail for it.
    alpha: float = 20.0
    #: The same on plain walls, between blurred photos: the texture lies in the noise.
    #: Evidence: plaster, façade 62: 6.4 to 6.1 mm of median error, measured RMSE 14 to 11.6 mm;
    #: textured façades get worse by it.
    plain_alpha: float = 60.0
    #: A photo is plain if this share of it has less contrast within 15 px, blurred, than its noise
    #: is. [per cent]
    #: Evidence: 0.4 to 0.7 times on plaster (façades 12 and 62, loggia 302), whose median edges and
    #: bars can lift to 4; at half the resolution, where a smoother flow does harm, 1.2 and more;
    #: 2.9 to 10 on textured façades and churches.
    plain_share: int = 30
    #: Weight of constant grey value, against 10 for constant gradient.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.99 / -0.84, plaster facade +0.32 / -1.14,
    #: church +0.76 / -0.44.
    delta: float = 10.0
    #: Stride of the inverse search's patches. [px]
    stride: int = 3
    #: The same in small frames: a little better and half as slow again. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.03 / +0.43, plaster facade +1.01 / -0.42,
    #: church -0.24 / -0.16.
    fine_stride: int = 2
    #: The pyramid starts this many halvings down: the seed replaces what lies above.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.00 / -0.13,
    #: church +0.00 / +0.10.
    coarsest: int = 3
    #: Photos that miss the radius by more, in the median, are not refined: they fit no better than
    #: that. [px]
    #: Evidence: fast, church_2: 0.45 px, refined 2.5 instead of 2.0 % beyond 10 cm; semireal
    #: church: 0.04 px.
    fit: float = 0.3
    #: Window of the local error across the radius. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.30 / +0.38, plaster facade -1.48 / +1.94,
    #: church -0.50 / +0.44.
    window: int = 31
    #: Errors across the radius count no more than this. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.02 / +0.24, plaster facade -0.76 / +0.59,
    #: church -0.04 / +0.08.
    clip: float = 2.0
    #: The local error across the radius is no less than this. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.09 / +0.39, plaster facade -0.03 / +0.09,
    #: church -0.03 / +0.09.
    floor: float = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class RefinementTuning:
    """The last step of flow of `fast`."""

    #: Side of the window, in pixels of the flow. [px]
    #: Evidence: of 3, 5 and 9 the best on façades 71 and 83.
    window: int = 5
    #: Residual at which a pixel counts half: more is another surface. [grey levels]
    outlier: float = 10.0
    #: Texture weaker than this moves nothing: added to the mean squared derivative. [(grey
    #: levels/px)²]
    #: Evidence: façades 71 and 83, fast, median: 0.53 and 1.96 mm, with 10 0.55 and 2.25.
    softness: float = 0.5
    #: Farthest move: a linearised image reaches no farther. [px]
    farthest: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseTuning:
    """Half the resolution, where the whole one is not sure."""

    #: The coarse level is asked where less than this share of the frame is matched there and back.
    #: Evidence: plaster has 0.3 to 0.6, textured façades 0.95.
    unsure: float = 0.75
    #: Where neither level is sure, the coarse one is believed from this difference: noise throws
    #: the fine one farther. [m]
    #: Evidence: church_2, beyond 10 cm: 1.13 to 1.00 %; on plaster it pays nothing.
    gross: float = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class HypothesisTuning:
    """Thin things, found by a sweep."""

    #: Side of the tiles that are swept, or not. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 64 px
    #: 63.0 and 6.05, 96 px 63.9 and 5.74, 128 px 65.7 and 5.66; façade 1021, hypotheses times
    #: pixels: 1, 1.5 and 1.7.
    tile: int = 96
    #: A tile is swept with so much around it. [px]
    #: Evidence: chosen: bars need what is around them; never varied by itself.
    margin: int = 16
    #: Tiles are swept of which flow leaves more than this share unvalidated.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 0.03
    #: 62.8 and 6.01, 0.1 62.8 and 6.05, for half of the pixels of façade 1021.
    unsure: float = 0.1
    #: Tiles a side around a tile whose relief says what may be in it.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 3
    #: 42.2 and 7.76, 5 61.0 and 6.37, 7 61.5 and 6.38.
    around: int = 5
    #: Tiles with fewer believed pixels say nothing. [px]
    fewest: int = 100
    #: Percentiles of a tile's relief that count as its least and greatest. [%]
    outliers: tuple[int, int] = (1, 99)
    #: How far beyond what is known around it a tile is searched. [m]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 0.1 m
    #: 61.0 and 6.37, 0.3 m 61.8 and 6.34, for more to compare.
    beyond: float = 0.1
    #: Parallax from which on the sweep says another thing than flow. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 1 px
    #: 61.3 and 6.10, 1.5 px 61.0 and 6.37.
    differs: float = 1.0
    #: Two pixels at one place of photo 2 within this parallax are one surface. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 1 px
    #: 60.9 and 6.41, 1.5 px 61.0 and 6.37.
    alone: float = 1.5
    #: What is validated gives way to a sweep that fits better by this cost.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 12
    #: 61.2 and 6.37, 24 61.0 and 6.37, 48 59.8 and 6.51.
    better: int = 24
    #: What is not validated gives way to one that fits better by this cost.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 12
    #: 61.0 and 6.37, 24 60.0 and 6.45.
    better_invalid: int = 12
    #: Parts with fewer pixels are chance. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 30 px
    #: 61.5 and 6.29, 60 px 61.0 and 6.37; plaster balcony 1005, all beyond 3 cm, 60 px 17.5 and 200
    #: px 18.1. Hidden from photo 2 and called measured on loggia 201 [%]: 60 px 3.45, 120 px 3.34,
    #: 200 px 3.26; a quarter of 1011, rails and beyond 3 cm: 60 px 74.6 and 3.48, 120 px 74.4 and
    #: 3.53, 200 px 74.2 and 3.58.
    least_area: int = 200
    #: Precision of a sweep along the radius. [px]
    sigma: float = 0.3
    #: With fewer hypotheses there is nothing to choose from.
    fewest_tried: int = 5
    #: Pixels at half the resolution where the sweep knows better that a tile is swept in full for.
    #: [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 8 px
    #: 62.8 and 6.01, 24 px 63.1 and 6.01, for three quarters of the tiles of façade 1021.
    wanted: int = 24
    #: Walls that are not plain are left alone of which flow validates a smaller share.
    #: Evidence: church_2 and church_1 in `fast` have 0.45 and 0.33, and the sweep made 4.5 and 13.6
    #: % of 2.0 and 10.3 % beyond 10 cm; façades and balconies have 0.8 and more.
    least_valid: float = 0.6
    #: The same of a pair of a set, whose other photos tell what is right.
    #: Evidence: a crop of balcony 1203 has 0.505 in the far photo and one aside, and there the
    #: sweep finds 42.7 % of the rails instead of 2.7; with 0.4 four photos of the church had 12.3 %
    #: of the points beyond 3 cm, with 0.6 11.8.
    least_valid_of_set: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepTuning:
    """A plane sweep over a tile."""

    #: Parallax between two hypotheses of a sweep, where it is greatest. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 0.75
    #: px 64.0 and 6.18, 1 px 61.0 and 6.37 (a third less to compare), 1.5 px 53.8 and 7.00.
    step: float = 1.0
    #: Cost of a pixel of 24 around that is darker than the middle in one photo only.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 5
    #: 64.7 and 6.06, 10 61.0 and 6.37.
    census: int = 5
    #: Cost of a difference of grey values. [1/grey level]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]:
    #: beside a census of 10, 6 61.0 and 6.37, 12 64.1 and 6.05.
    grey: int = 6
    #: Differences of grey values count up to this one. [grey levels]
    most_grey: int = 30
    #: Cost of a hypothesis that lies outside photo 2.
    outside: int = 200
    #: Penalty for the next hypothesis at a neighbour.
    one_step: int = 20
    #: Penalty for any other hypothesis at a neighbour of the same grey value.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 200
    #: 59.0 and 6.49, 400 61.0 and 6.37, 800 59.5 and 6.51.
    jump: int = 400
    #: A step of grey values that halves the penalty. [grey levels]
    softness: int = 12
    #: Hypotheses tried on either side of one that values of relief vote for.
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 1
    #: 61.1 and 6.09, 2 62.8 and 6.01.
    near: int = 2
    #: Values of relief that make a hypothesis worth trying. [px]
    #: Evidence: balcony of façade 1011 (balconies), rail within 5 cm and all beyond 3 cm [%]: 8 px
    #: 62.8 and 6.01, 20 px 60.9 and 6.17.
    votes: int = 8
    #: Cost of the gap between hypotheses that are no neighbours: none goes through it.
    between: int = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceTuning:
    """What is believed of a measurement."""

    #: Limit of a validated pixel across the radius. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.08 / +0.01, plaster facade +0.72 / +0.13,
    #: church +0.29 / -0.08.
    across_limit: float = 0.5
    #: Limit of a validated pixel there and back. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.89 / -0.17, plaster facade +1.19 / -0.80,
    #: church +3.07 / -0.57.
    loop_limit: float = 0.8
    #: A measured relief is known better than this share of d2.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.68 / +0.00, plaster facade +1.52 / -0.32,
    #: church +0.31 / -0.03.
    sigma_share: float = 0.01
    #: Sides of the blocks, fine and coarse, that a pixel's validated surroundings consist of. [px]
    #: Evidence: plaster, façade 12: blocks of 4 px clip relief that is right, 10.5 instead of 9.6 %
    #: beyond 3 cm.
    blocks: tuple[int, int] = (16, 64)
    #: A block with fewer supported pixels says nothing. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / -0.00, plaster facade +0.02 / +0.02,
    #: church +0.00 / -0.00.
    fewest: int = 6
    #: Share of d2 by which a pixel may leave the range of its surroundings.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.05 / +0.00, plaster facade +0.00 / +0.08,
    #: church +0.11 / -0.14.
    slack: float = 0.002
    #: Slope outwards, as a share of that of camera 2's rays, times the square of the misfit of the
    #: photos from which a pixel counts as not measured; such pixels are placed all the same. To be
    #: multiplied by a power of 1 - d2 / d1, the parallax of a step whose strip is one pixel wide:
    #: the less of it, the less misfit tells the strip. [grey levels²]
    #: Evidence: of 14 features of façade 61 and loggia 301 these two tell best; façade 81, left out
    #: 1.57 instead of 1.33 % of the orthophoto beyond 1 px.
    falls_away: float = 20.0
    #: That power.
    #: Evidence: at 95 % measured 35/19 bears 6.3 and 4.2 % false (façade 81), 35/28 2.0 and 4.8 %
    #: (façade 83).
    falls_power: float = 1.4
    #: The same where matching is imprecise, without the power. [grey levels²]
    #: Evidence: church_2 and church_1: measured 72 and 65 % of the points, as good as the 69 and 62
    #: % that `falls_away` leaves.
    falls_away_imprecise: float = 25.0
    #: Farther away is lost, not imprecise. A pixel that does not come back to itself is measured
    #: all the same if it lands no farther away: flow back runs as a ramp over every step, on its
    #: seen side, too. [px]
    #: Evidence: façade 81: 3.3 % failed by it alone, nine in ten of them right to a centimetre.
    lost_loop: float = 5.0
    #: Such a pixel is measured if the photos fit at it better than this. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.12 / -0.05, church +0.15 / -0.14.
    pardon_misfit: float = 6.0
    #: Such a pixel is measured if they have this contrast at it: in weaker texture anything fits.
    #: [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.00 / +0.01, church +0.00 / +0.01.
    pardon_contrast: float = 3.0
    #: A pixel of a plain wall whose own relief is so far off its plane patch is not measured: one
    #: of the two is wrong. [sigma]
    #: Evidence: façade 62: wrongly measured 8.7 to 7.6 %, measured beyond 3 cm 4.8 to 3.8 %.
    off_patch: float = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class InformationTuning:
    """What both photos tell of relief."""

    #: Blur of the photos before their gradients. [px]
    blur: float = 0.8
    #: Side of the window in which information is summed. [px]
    #: Evidence: error/sigma 99 % of white and palazzo (5001, a quarter): 15 px 7.6 and 5.6, 7 px
    #: 5.9 and 4.1, without 7.9 and 7.0.
    window: int = 7
    #: Most that noise adds to sigma. [px]
    most: float = 3.0
    #: Side of the tiles in which the noise of the pair is estimated. [px]
    tile: int = 64
    #: A tile with fewer matched pixels takes the usual noise. [px]
    fewest: int = 60
    #: Least noise: that of whole grey levels. [grey levels]
    least_noise: float = 0.35
    #: Window over which the photos must fit better than a pixel farther on. [px]
    #: Evidence: measured, wrong by 3 cm, of all pixels [%], white, palazzo, arcade, street (5001, a
    #: quarter): none 6.7, 4.3, 6.8, 8.2; 7 px 2.9, 2.3, 6.0, 7.0, but arcade and street lose 8 and
    #: 5 points of what is measured; 11 px 3.7, 2.6, 6.6, 7.6 (3 and 3); 15 px 4.2, 2.9, 6.6, 7.8.
    fit: tuple[int, int] = (11, 11)
    #: Window over which a difference of exposure is none of relief. [px]
    exposure: tuple[int, int] = (31, 31)
    #: A difference counts for no more than this. [noise]
    outlier: float = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionBlockTuning:
    """Regions that camera 2 cannot see."""

    #: Side of the blocks that regions consist of, half of whose pixels are lost. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: church +0.00 / +0.00.
    block: int = 8
    #: A part that camera 2 cannot see counts from so many blocks a side on.
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    fewest_blocks: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeTuning:
    """Steps sharpened."""

    #: Half width of a ramp. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.17 / -0.67, plaster facade +2.11 / -1.24,
    #: church +0.44 / +0.08.
    reach: int = 9
    #: Steps of less parallax are left as measured. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.24 / +0.88, church -0.04 / +0.35.
    least_step: float = 0.5
    #: Nor are steps of less than this many times the precision of matching touched: they are its
    #: noise.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.35, plaster facade -1.17 / +2.80,
    #: church +0.00 / +0.21.
    noise_steps: float = 4.0
    #: Differences of grey value and of its gradient beyond these count alike. [grey levels]
    #: Evidence: façades 81 / 83, beyond 3 cm: 1.28 / 2.33 % with 20 and 14, 1.13 / 2.15 with 12 and
    #: 8, 1.08 / 2.07 with 9 and 6, 1.13 / 2.07 with 7 and 4.5, 1.78 / 2.24 with 5 and 3.
    limits: tuple[float, float] = (9.0, 6.0)
    #: The same where matching is imprecise: there the photos differ by more than relief. [grey
    #: levels]
    #: Evidence: church_1, beyond 10 cm: 9.1 %, with `limits` 10.1.
    imprecise_limits: tuple[float, float] = (12.0, 8.0)
    #: Share of the grey value in the cost; the rest is its gradient's.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.21 / -0.07, plaster facade +0.20 / -0.15,
    #: church +0.06 / +0.25.
    grey_share: float = 0.4
    #: Half window of the guided filter (He et al. 2013). [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.56, plaster facade +0.00 / +0.74,
    #: church +0.00 / +0.40.
    window: int = 3
    #: Regularisation of the guided filter. [grey levels²]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.03 / +0.05, plaster facade +0.00 / -0.03,
    #: church -0.02 / +0.00.
    softness: float = 50.0
    #: By how much the upper surface must fit better than the lower one. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.16 / +0.34, plaster facade +0.03 / +0.06,
    #: church -0.24 / +0.64.
    margin: float = 0.25
    #: By how much more where relief rises outwards: photo 1 sees the step's side face there and its
    #: pixels are nobody's. [grey levels]
    #: Evidence: façade 11: raised parts were too fat in two thirds of the errors at steps.
    margin_rising: float = 1.5
    #: Steps of less parallax fit nearly as well on both sides: their margin is less in proportion.
    #: [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.42 / -0.37, plaster facade +0.34 / -0.04,
    #: church +0.63 / -0.53.
    wide_step: float = 4.0
    #: Plain parts cannot tell: margin and ramps fade out below this contrast. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.05 / +0.10, plaster facade +0.06 / +0.01,
    #: church +0.04 / -0.01.
    contrast: float = 8.0
    #: Side of the window of that contrast. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.04 / -0.06, plaster facade +0.23 / -0.11,
    #: church +0.08 / +0.02.
    contrast_window: int = 15
    #: What the measured value is favoured by. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.07 / +0.08, plaster facade -0.06 / +0.28,
    #: church -0.03 / +0.06.
    favour: float = 0.05
    #: What a ramp is held back by: it fits by what flow bent and stands on no surface. [grey
    #: levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.20 / -0.12, church +0.10 / +0.14.
    ramp: float = 0.6
    #: A measured value that rises or falls by so much parallax a pixel is a ramp. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.06 / +0.13, church -0.01 / +0.03.
    ramp_slope: float = 0.3
    #: Matching is imprecise from this on, and precise up to half of it; where it is imprecise
    #: slopes are noise and no ramps. [px]
    #: Evidence: façade 84, poor texture, beyond 3 cm: 13.4 %, with ramps 14.4.
    imprecise: float = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothingTuning:
    """Noise taken out of relief."""

    #: Limits of the error across the radius that counts as noise rather than as an edge, else what
    #: is typical of the frame. [px]
    #: Evidence: façade 83, 35/28, beyond 3 cm: 2.44 to 2.15 %; a fixed 0.25 px took small steps for
    #: noise.
    noise_clip: tuple[float, float] = (0.05, 0.25)
    #: Share of the error across the radius that smoothing takes for noise where matching is
    #: precise: the rest stems from edges within its window, or is wider than the windows. Of
    #: imprecise matching it is all.
    #: Evidence: façade 83, 35/28, beyond 3 cm: 1.93 to 1.89 %, loggia 94 1.19 to 1.15, 35/19 as
    #: before; façade 84, poor texture: 13.3 %, with 0.7 13.5.
    noise_share: float = 0.85
    #: Half windows of relief that photos of twice the resolution refined: those of their pixels.
    #: [px]
    #: Evidence: façade 83, fast, beyond 3 cm: 4.1 to 3.8 %.
    refined_windows: tuple[int, int] = (4, 9)
    #: Height from which a step of the map is tidied. [m]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.01 / -0.04, plaster facade -0.02 / +0.04,
    #: church +0.01 / +0.01.
    least_step: float = 0.02
    #: What is narrower is a thin thing, of which a median of 5 x 5 px leaves little. [px]
    thin: int = 9
    #: It stands out by more than this. [m]
    stands_out: float = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchTuning:
    """Plane patches on plain walls."""

    #: The photos are compared blurred by so much at half the resolution: without, reading between
    #: pixels takes out noise and looks like a better fit. [px]
    #: Evidence: façade 84: median 5.1 instead of 4.2 mm.
    blur: float = 0.8
    #: Differences count by the noise and by this share of the gradient: no segment fits to less.
    #: [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.92 / +0.05.
    misplaced: float = 0.3
    #: Noise of the difference of both photos to that of one, at half the resolution, as variances.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.53 / +0.91.
    difference: float = 0.8
    #: A difference counts this much at most; half the square of a difference in noises.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.14 / -0.80.
    most: float = 1.0
    #: And this much where a nearer surface hides the place in photo 2.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.27 / +0.42.
    hidden: float = 0.3
    #: What a jump across a pixel of border costs without contrast.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.05 / +0.90.
    tie: float = 2.0
    #: What it costs with contrast.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.33 / +1.58.
    free: float = 0.1
    #: The contrast that lets relief jump. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.39 / +1.36.
    contrast: float = 2.5
    #: Jumps beyond this height count alike. [m]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.21 / -1.06.
    jump: float = 0.08
    #: What a slope costs against a jump.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.07 / -0.47.
    slope: float = 0.05
    #: The steepest slope tried in fits. [m/px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.07 / -0.10.
    steepest: float = 0.02
    #: Rounds.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.03 / -0.15.
    rounds: int = 4
    #: Planes of neighbours tried in each round.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.13 / -0.40.
    neighbours: int = 4
    #: Share of segments that may change at a time.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.74 / -0.71.
    at_a_time: float = 0.6
    #: Weight of no slope in fits to flow. [px²]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.32 / -0.21.
    ridge: float = 40.0
    #: A pixel is hidden in photo 2 by what is so much higher: parallax and relief. [px, m]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.47 / +0.28.
    covers: tuple[float, float] = (1.0, 0.02)


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentTuning:
    """Segments of photo 1."""

    #: Spacing of the segments. [px]
    #: Evidence: façade 84, off by more than 3 cm with one exact relief a segment: 1.0 %, 16 px 1.7
    #: %, 24 px 3.6 %.
    spacing: int = 12
    #: Edges are looked for in a photo smoothed between them: diameter of the bilateral filter. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.57 / -0.71.
    smoothing: int = 7
    #: Standard deviation of that filter in grey value. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.78 / +0.69.
    edge: float = 8.0
    #: Standard deviation of that filter in place. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +1.17 / +1.00.
    reach: float = 2.0
    #: How much less gradient a pixel must have to start a segment a pixel farther from its middle.
    #: [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.00 / -0.28.
    off_middle: float = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelTuning:
    """Levels of plain walls."""

    #: Side of the blocks levels are counted in. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.51 / +0.21.
    block: int = 64
    #: Side of the surroundings, in blocks.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.07 / +0.24.
    surroundings: int = 3
    #: Height of a class of the count. [m]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.05 / -0.15.
    class_height: float = 0.004
    #: Reach of the mean, as a share of sigma. [sigma]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.22 / -0.04.
    share: float = 0.8
    #: The reach is no more than this. [m]
    #: Evidence: plaster, façade 62: 6.4 to 4.9 mm of median error, 13.9 to 13.3 % beyond 3 cm;
    #: twice the reach takes the panel of a pilaster for the wall (16 %).
    farthest: float = 0.012
    #: Reaches the means are made for; relief more precise than half the first is left alone, and
    #: counts no more. [m]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.99 / +0.00.
    reaches: tuple[float, float] = (0.005, 0.01)
    #: Relief beyond these percentiles is left out. [per cent]
    #: Evidence: benchmarks/relief_tuning.py, beyond 3 cm with half of it: plaster balcony +1.33
    #: points of per cent.
    tails: tuple[float, float] = (0.2, 99.8)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectionTuning:
    """Pixels of photo 1 put on the map."""

    #: A relief agrees with the pixel it came from to this share of d1.
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / +0.08, plaster facade -0.05 / +0.04,
    #: church +0.01 / +0.02.
    agreement: float = 0.0004
    #: A ramp that stretches the wall by more than this is flow running over a hidden strip.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +1.22 / -0.04, plaster facade +3.92 / +0.06,
    #: church +2.75 / -0.17.
    stretch: float = 1.3
    #: A pixel that covers less of the wall than this sees the side face of a step.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.05 / +24.04, plaster facade -0.04 / +8.66,
    #: church +0.07 / +19.74.
    side_face: float = 0.5
    #: Steps outwards when a hidden strip is filled. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.09, plaster facade +0.00 / -0.10,
    #: church +0.00 / +0.08.
    leap: int = 3
    #: The most steps are 2 to the power of this.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster facade +0.00 / +0.00, church -0.00 / +0.00.
    leaps: int = 7
    #: How much higher relief to be believed must be than what it covers in photo 2: parallax and
    #: share of d2. [px, -]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.05 / +0.04, plaster facade -0.01 / +0.04,
    #: church +0.02 / +0.01.
    covers: tuple[float, float] = (0.7, 0.0005)
    #: The same for any relief, which covers only what is not valid. [px, -]
    #: Evidence: church_1, without it: 14.3 instead of 14.2 % beyond 3 cm, 178 instead of 126 scraps
    #: of picture.
    covers_invalid: tuple[float, float] = (1.5, 0.002)
    #: Hidden relief farther than this from measured one must be surrounded by it. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.01 / -0.00,
    #: church +0.00 / +0.00.
    fringe_hidden: float = 24.0
    #: The same for interpolated relief. [px]
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    fringe_interpolated: float = 100.0
    #: Relief leans on squares of this side. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.00 / +0.01.
    grain: int = 3
    #: The same on plain walls, where specks of interpolated pixels lie in strips that a cornice
    #: hides. [px]
    #: Evidence: plaster, façade 511, 6 MP; 7, 11, 15 px: 73, 26, 23 scraps of picture, RMSE off
    #: edges 37.4, 39.7, 49.9 mm.
    grain_plain: int = 11


@dataclass(frozen=True, slots=True, kw_only=True)
class MapTuning:
    """The map made whole."""

    #: Noise that is taken out of measured relief of the map, in parallax: what is smaller casts
    #: shadows that are not there. [px]
    #: Evidence: 94 % of the small holes of a church; semireal church: 3.27 mm, with 0.25 px 3.39
    #: mm.
    noise: float = 0.05
    #: The same of other relief. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.02 / -0.00, plaster facade -0.01 / -0.00,
    #: church +0.01 / -0.02.
    noise_unmeasured: float = 2.0
    #: Half windows on the map, where relief is final and casts shadows. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.34 / +0.39, plaster facade -0.13 / +0.62,
    #: church -0.13 / +0.07.
    map_windows: tuple[int, int] = (2, 4)
    #: Pixels this far inwards of what camera 2 cannot see are not called measured: raised parts
    #: come out too fat. [px]
    #: Evidence: façade 62, loggia 301: three pixels took 0.2 % of the measured ones and no more
    #: wrong ones than one does.
    guard: int = 1
    #: Share of a step within `step_window` added to sigma: which side a pixel is on is uncertain.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.00 / +0.00,
    #: church +0.00 / +0.00.
    sigma_of_step: float = 0.25
    #: Side of the square in which a step makes sigma doubtful: optical flow places one to half a
    #: patch. [px]
    #: Evidence: loggia 202 and 203 in plaster, 201 and 206 in stone, error/sigma of measured
    #: pixels: 5 px 1.51, 1.88, 0.80, 0.72; 7 px 1.02, 1.19, 0.62, 0.60; 9 px 0.92, 0.89, 0.55,
    #: 0.55; 11 px 0.89, 0.80, 0.53, 0.53.
    step_window: int = 9
    #: Side of the square in which a step that makes sigma too large makes a pixel not measured.
    #: [px]
    #: Evidence: The same scenes, measured [%] with 5 and 7 px: 56.7 and 56.3, 57.0 and 56.6, 93.9
    #: and 93.0, 93.7 and 92.9; called measured but hidden from photo 2: 4.1 and 4.0, 4.9 and 4.8,
    #: 3.3 and 3.1, 3.2 and 3.1.
    on_step: int = 5
    #: The outline of what is known is that of most pixels in a window of this side. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.00 / -0.00.
    outline: int = 7
    #: A piece of map with nothing around it goes if it has fewer pixels, and by `scrap_share`. [px]
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    scrap: int = 4000
    #: Such a piece goes if it is less than this share of the largest one.
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    scrap_share: float = 0.05
    #: A hole of so few pixels is closed. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster facade +0.00 / +0.00.
    hole: int = 25


@dataclass(frozen=True, slots=True, kw_only=True)
class RimTuning:
    """Rims drawn in to edges of photo 1."""

    #: How far inwards of the map's rim the true one is sought. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / -0.01, plaster facade -0.00 / +0.00,
    #: church -0.01 / -0.00.
    reach: int = 16
    #: Steps that hide less from camera 1 are left alone. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.02 / -0.01, plaster facade +0.00 / +0.00,
    #: church +0.00 / -0.01.
    least_shadow: float = 1.0
    #: Relief within this share of the step from that of the rim is the raised part's.
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.00 / +0.00, plaster facade +0.00 / +0.00,
    #: church -0.01 / +0.01.
    same: float = 0.35
    #: Directions that the edge may have, from that of the map's step. [deg]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.01 / +0.01, plaster facade -0.00 / -0.00,
    #: church -0.04 / +0.03.
    turns: tuple[float, float, float] = (-16.0, 0.0, 16.0)
    #: Weaker edges are texture. [grey levels]
    #: Evidence: façade 71, steps wrong beyond 3 cm, recall and precision of hidden pixels: without
    #: 1.225 %, 0.605 and 0.827; with 2, 1.267 %, 0.665 and 0.916; 6, 1.249 %, 0.664 and 0.911; 10,
    #: 1.240 %, 0.661 and 0.905; 15, 1.232 %, 0.654 and 0.894.
    least_edge: float = 10.0
    #: A rim cannot stand farther in than what camera 2 cannot see is wide, but for so much. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.00 / +0.01, plaster facade +0.00 / +0.00,
    #: church -0.02 / +0.02.
    doubt: float = 1.0
    #: A pixel is lowered from here on beyond the edge. [px]
    #: Evidence: façade 71: 0.25 px take 0.05 px out of the waves of the mask and put 0.007 % more
    #: of the map and the orthophoto on the wrong surface.
    beyond: float = 0.5
    #: Standard deviation of the blur in which the direction of a step is read. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.01 / -0.00, plaster facade +0.00 / -0.00,
    #: church +0.01 / +0.01.
    blur: float = 1.25
    #: Pixels of the map that are one there. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / -0.01, plaster facade -0.00 / -0.00,
    #: church +0.01 / +0.04.
    coarser: int = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class SnappingTuning:
    """Steps put on edges of photo 1."""

    #: How far a step is moved at most. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.12 / +0.13, plaster facade +0.03 / +0.12.
    reach: float = 2.0
    #: How finely it is moved. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / +0.11, plaster facade +0.00 / -0.02.
    fine: float = 0.5
    #: Across how much of it grey values are compared. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.00 / +0.19, plaster facade -0.02 / +0.06.
    across: float = 1.5
    #: Height from which a step of the map is tidied, and drawn to edges where it is steeper than 45
    #: degrees. [grey levels]
    #: Evidence: façades 81 / 83: of the pixels moved at fainter edges one half was right before.
    contrast: float = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SigmaTuning:
    """Sigma of orientation."""

    #: Cells of the map in either direction between which the covariance is interpolated: it is a
    #: polynomial of low degree.
    #: Evidence: a pair tilted by 20 degrees: exact to 0.1 %.
    nodes: int = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionTuning:
    """Relief of sets of photos."""

    #: A base that rises less than this from the wall, per length along it, is measured over a
    #: turned plane: the centre of the zoom must not lie too far away for single precision.
    #: Evidence: chosen: 9.5 m away the centre lies 475 m aside, 0.01 px of single precision.
    least_steepness: float = 0.02
    #: Rounds in which a place of the wall is found on the turned plane.
    #: Evidence: each round leaves a fiftieth of the error before.
    turning_rounds: int = 4
    #: By so much its place may still move in the last round; else nothing leads there. [px]
    settled: float = 0.25
    #: Two pairs differ from here on. [sigma]
    #: Evidence: chosen: 0.7 % of what two pairs of façade 41 measured differ by more.
    beyond: float = 3.0
    #: Side of the windows over which photos are compared. [px]
    #: Evidence: balcony 1203 and façade 311, quarter frames, beyond 3 cm [%]: 3 px 7.72 and 1.57, 5
    #: px 7.80 and 1.53, 7 px 8.00 and 1.54.
    window: int = 5
    #: Photos differ by so many times the usual at most, and where fewer than two see a place.
    #: Evidence: balcony 1203 and façade 311, quarter frames, beyond 3 cm [%]: 2 8.05 and 1.59, 3
    #: 7.80 and 1.53, 5 7.78 and 1.53; 30 grey levels, 30 times the usual, 9.18 and 1.91.
    worst: float = 3.0
    #: Measured is what the photos fit better than any other relief by so many times the usual.
    #: Evidence: façade 311, quarter frame, measured and of it beyond 3 cm [%]: 0.1 96.1 and 0.82,
    #: 0.2 95.9 and 0.75, 0.4 95.5 and 0.67.
    margin: float = 0.2
    #: A difference below this that the photos cannot decide counts to sigma; above, as unknown. [m]
    #: Evidence: chosen: what a drawing at 1:50 shows.
    visible: float = 0.03
    #: What a pair filled from behind must fit better by so many times the usual.
    #: Evidence: balcony 1203, quarter frame, beyond 3 cm [%]: 0 7.86, 0.2 7.90, 0.5 8.11, 1 8.34.
    behind: float = 0.2
    #: What no pair measured must fit better by so many times the usual than what one did.
    #: Evidence: balcony 1203 and façade 311, quarter frames, beyond 3 cm [%]: 0 7.87 and 1.55, 0.2
    #: 7.80 and 1.53, 0.5 8.08 and 1.52 before relief in front was preferred.
    unmeasured: float = 0.2
    #: Of two measured reliefs with less between their misfits neither is known.
    undecided: float = 0.01
    #: What stands in front may fit worse by so many times the usual.
    #: Evidence: balcony 1203, quarter frame, rail within 5 cm and all beyond 3 cm [%]: 0 57.6 and
    #: 7.90, 0.3 64.5 and 7.78, 0.4 66.2 and 7.80, 0.6 67.9 and 8.00.
    front: float = 0.4
    #: It stands in front if by more than this share of the nearest camera's distance.
    #: Evidence: balcony 1203 and façade 311, quarter frames, beyond 3 cm [%]: 0.01 7.86 and 1.64,
    #: 0.02 7.80 and 1.53, 0.04 7.71 and 1.51.
    in_front: float = 0.04
    #: Photos are taken to differ by so much at least. [grey levels]
    #: Evidence: chosen: rounding.
    quiet: float = 0.5
    #: A photo so many times finer than the map is reduced first.
    #: Evidence: as the working frame.
    coarser: float = 1.5
    #: Places a side at which exposures are compared.
    exposure_samples: int = 160
    #: With fewer places in common a photo keeps its exposure.
    #: Evidence: as for a pair.
    exposure_least: int = 200
    #: Side of the windows in which a set's map is made: memory goes by it, not by the wall. [px]
    tile: int = 4096
    #: Pairs that measure a place: the best by geometry.
    #: Evidence: chosen: three photos make three.
    pairs: int = 3
    #: Places a side of a window at which pairs are judged.
    places: int = 24
    #: A pair is measured if it is among the best at more than this share of the places.
    least_share: float = 0.03
    #: Rays that part by more per relief show too different sides of things to be matched.
    widest: float = 0.8
    #: Of two photos equally far from the wall one counts as farther by this share.
    #: Evidence: 0.01 mm at 10 m.
    farther: float = 1e-06
    #: Relief over a turned plane is so much less precise than its geometry promises.
    #: Evidence: façade 41 near the nadir: median 0.75 mm against 0.46 of a pair of the same
    #: geometry.
    turned: float = 1.6


LIMITS = LimitsTuning()
FRAME = FrameTuning()
SEED = SeedTuning()
EXPOSURE = ExposureTuning()
REGISTRATION = RegistrationTuning()
FLOW = FlowTuning()
REFINEMENT = RefinementTuning()
COARSE = CoarseTuning()
HYPOTHESIS = HypothesisTuning()
SWEEP = SweepTuning()
EVIDENCE = EvidenceTuning()
INFORMATION = InformationTuning()
REGIONS = RegionBlockTuning()
EDGES = EdgeTuning()
SMOOTHING = SmoothingTuning()
PATCHES = PatchTuning()
SEGMENTS = SegmentTuning()
LEVELS = LevelTuning()
PROJECTION = ProjectionTuning()
MAP = MapTuning()
RIMS = RimTuning()
SNAPPING = SnappingTuning()
SIGMA = SigmaTuning()
FUSION = FusionTuning()
