"""The tuned numbers of faces, a class a stage; one without evidence is a plain choice."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class FacePlaneTuning:
    """The plane of a face, through points or through the relief measured within."""

    #: Standard deviation of a typed relief, and of points that state none: a tape on the site. [m]
    sigma: float = 0.01
    #: Places with known relief that tell the plane of a face, at least.
    fewest: int = 12
    #: Points that spread less to one side than this share of the other lie on a line.
    narrowest: float = 1e-3
    #: Places along the longer side of a face at which its relief is looked up.
    places: int = 160
    #: Relief this near to the edge of a face, in pixels of the map, may be of the other side. [px]
    #: Evidence: flow smears steps over two to four pixels.
    off_edge: int = 6
    #: Planes through three places that are tried.
    trials: int = 200
    #: Level planes that are tried.
    levels: int = 41
    #: Places at which planes are judged.
    judged: int = 2000
    #: The share of a face that lies on its plane at least.
    #: Evidence: windows of church_2: glass that mirrors leaves frames and bars.
    share: float = 0.4
    #: What lies within so many times the spread belongs to the plane.
    near: float = 3.0
    #: Adjustments of the plane to what lies near.
    rounds: int = 4
    #: Relief within this distance errs alike. [m]
    alike: float = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class FaceEdgeTuning:
    """Relief beside the edges of faces and occluders."""

    #: Beside an edge, relief this near to it may be of the other side, in pixels of the map. [px]
    #: Evidence: flow smears steps over two to four pixels.
    reach: int = 6
    #: It is of the other side where it has gone this share of the step.
    mixed: float = 0.1
    #: Quantile of the sigma within a face that is the common part of it.
    best: float = 0.2
    #: Places along the longer side of an occluder at which the wall around it is looked up.
    places: int = 24
    #: Side of the windows faces are drawn in. [px]
    tile: int = 2048


@dataclass(frozen=True, slots=True, kw_only=True)
class FaceSuggestionTuning:
    """Faces proposed where relief was not measured."""

    #: Strips of unmeasured relief narrower than this are no face. [px]
    thin: int = 7
    #: Share of the picture that a suggestion mends at least.
    least: float = 0.0006
    #: And so many pixels of it. [px]
    smallest: int = 300
    #: Rows and columns of a part that are filled to less than this share of its fullest are its
    #: ragged edge.
    ragged: float = 0.4
    #: Bins of relief in which levels are looked for; a slab is three of them. [m]
    slab: float = 0.025
    #: Narrower parts are no face. [px]
    narrowest: int = 12
    #: A part that takes more of the picture than this is no face, but what lies around some.
    largest: float = 0.1
    #: Share of its box that a part fills at least.
    filled: float = 0.4
    #: Edges are sought this near to a side, as a share of the shorter side.
    reach: float = 0.2
    #: Measured pixels within a box that tell a plane. [px]
    support: int = 60
    #: Reliefs are tried so far behind what lies around. [m]
    #: Evidence: reveals of façades are 0.1 to 0.5 m deep.
    behind: float = 0.6
    #: And so far before it. [m]
    before: float = 0.3
    #: In such steps. [m]
    step: float = 0.01
    #: Places along the width of a box at which the photos are compared.
    places: int = 128
    #: Share of a box that a photo must have in frame.
    framed: float = 0.9
    #: Levels this far apart are different ones. [m]
    apart: float = 0.06
    #: A level is better than another where the photos correlate by so much more on it.
    clearly: float = 0.03
    #: Share of what was measured within a box that lies on its level.
    #: Evidence: the sample: of a window at -0.25 m the photos agreed on +0.29 m, where nothing
    #: lies.
    supported: float = 0.25
    #: Correlation that convinces where nothing was measured within a box.
    alone: float = 0.8
    #: Correlation of the photos on a plane that convinces.
    agreement: float = 0.6
    #: Suggestions at most: more are not looked at.
    most: int = 24


PLANES = FacePlaneTuning()
EDGES = FaceEdgeTuning()
SUGGESTIONS = FaceSuggestionTuning()
