"""The tuned numbers of comparison, a class a stage; one without evidence is a plain choice."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ChanceTuning:
    """What chance can do over a whole wall."""

    #: Share of a patch that must be known for its average to count.
    covered: float = 0.5
    #: Share of the wall's shorter side up to which errors are taken to hang together.
    reach: float = 0.25
    #: Walls without change that are drawn to learn what chance does.
    draws: int = 100
    #: Steps in which the spread of a wall's differences is told.
    steps: int = 2001
    #: Half width of that: beyond lie seven in a million. [standard deviations]
    widest: float = 4.5


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeTuning:
    """Differences of two relief maps, and where they are significant."""

    #: Differences over their standard deviation are cut off here for the test: blunders of a few
    #: pixels prove nothing.
    #: Evidence: demo façade rendered twice: 1 % of the pixels lie beyond 16 mm without any change.
    clip: float = 4.0
    #: Cells along the longer side of the wall, at most: what a test of a hundred drawn walls takes.
    #: Evidence: 3 s for a façade; 512 cells took 10 s and found the same.
    side: int = 300
    #: How often chance is learned anew without the regions that were found.
    #: Evidence: the second already stands still where one region is found.
    rounds: int = 3
    #: Within this distance a surface that the other date shows here is looked for. [m]
    #: Evidence: half of a balcony's column, castle entry seen by two pairs of one day.
    beside: float = 0.15
    #: Two surfaces lie this far apart at least. [usual standard deviations of the wall]
    apart: float = 10.0
    #: A surface counts as the same one within this share of the step between both.
    #: Evidence: columns 0.3 m thick 1.6 m before six rendered walls, each twice by two pairs.
    round: float = 0.15
    #: Share of the places about that must show the other date's surface.
    met: float = 0.03
    #: What an outline leaves out of the change that larger patches show is not proven: up to here.
    #: [standard deviations]
    held: float = 3.0
    #: Share of a region's largest change at which it is outlined.
    #: Evidence: a paraboloid keeps 94 % of its volume.
    outline: float = 0.25
    #: Share of a region's rim beside unmeasured ground from which on it may be larger, as is told.
    #: Evidence: façade 7002, a boss a quarter of which was not measured: 0.65, and 36 % too small.
    open: float = 0.25
    #: Shares of the wall of which is said what change they would show.
    shares: tuple[float, float] = (0.5, 0.9)
    #: Cells that must be known, and independent parts that must be stable, to compare at all.
    least: int = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoVerdictTuning:
    """What the photos of both dates say of a change."""

    #: No gain is asked of what moves no photo against another by so many pixels of the map.
    parallax: float = 0.75
    #: By so much relief the parallax of a metre is found. [m]
    step: float = 0.001
    #: A date's photos show its own relief better than the other date's by so much for every pixel
    #: that the change moves them. [times what they usually differ by]
    #: Evidence: rendered walls taken twice under other suns: true changes that move photos by 0.8
    #: and 1.4 px gain 0.09 and 0.20, false ones that move them by 2 to 30 px less than 0.17.
    better: float = 0.08
    #: That gain is asked for up to here. [times what they usually differ by]
    most: float = 0.3
    #: A date's photos differ by so much of what they usually do where its relief is right.
    #: Evidence: the same: true changes 0.6 to 1.2, grilles and railings taken for walls 1.2 to 2.2.
    fits: float = 1.25


CHANCE = ChanceTuning()
CHANGE = ChangeTuning()
EVIDENCE = PhotoVerdictTuning()
