"""The numbers that scenes decided of an orientation, each with what fixed it: one value.

Where no scene is named, the number is a judgement that no benchmark has contradicted.
`benchmarks/` measures what a change of one does; tests hold the pairs named here.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """Numbers of common points, the wall's planes and its bend; shares unless a unit is given."""

    # Common points of two photos.
    #: Fewer than this and any two photos may seem to match by chance.
    fewest_matches: int = 40
    #: A plane that holds a smaller share of the common points is not "the wall".
    fewest_on_plane: float = 0.12
    #: So many of the strongest features are compared with each other first; all, if too few agree.
    first_tried: int = 8000
    enough: int = 400
    #: More ties than this, spread evenly, tell nothing more: their errors are common to stretches.
    most_ties: int = 6000
    #: How far along its line a partner is looked for around the plane, of the width.
    along: float = 0.2
    #: Neighbours asked for support, and how many must move alike against the plane, within so many
    #: pixels at 3000 px of width. Six real pairs: of 22 to 54 wrong ties 0 to 22 stayed.
    neighbours: int = 8
    supporters: int = 2
    alike: float = 4.0
    #: Radial distortions tried where the lens is unknown, and the truncation of their cost. [px]
    scanned: tuple[float, float, int] = (-0.25, 0.2, 10)
    truncated: float = 0.7
    #: A scanned distortion is believed if it lowers the cost to this share of that of none.
    believed: float = 0.9
    #: Ties are never believed to be more precise than this. [px]
    best_tie: float = 0.03
    #: Fewer ties than this, counted by their chances, or in fewer tenths of the photo, are no wall.
    fewest_on_wall: int = 20
    fewest_cells: int = 6

    # Planes of the wall; bands are shares of the far distance.
    #: Half the thickness of a face.
    face_band: float = 0.0012
    #: Half the thickness of a plane before the faces are told apart: real façades are rough.
    rough_band: float = 0.005
    #: The present plane is a face of the same wall: others slope less than this against it. [m/m]
    face_slope: float = 0.02
    #: A face with this share of the points of the chosen, or the largest, may as well be the wall;
    #: at one scale it is preferred.
    comparable: float = 0.5
    #: A face whose chance by the measured distances is this share of the chosen one's is none.
    unlikely: float = 0.01
    #: With this share of the largest face's points a face may be chosen by the measured distances;
    #: it fits them within so many standard deviations, and the next does not.
    fair: float = 0.25
    face_fits: float = 2.0
    #: Nominal scales this close mean that the photos were planned for one scale.
    one_scale: float = 0.02
    #: Faces nearer than this many bands are one face, unevenly built.
    faces_apart: float = 3.0
    #: Shallow relief scatters by at least so many times the wall's own roughness.
    wider: float = 2.0
    #: A plane of another direction is taken for the wall if it holds so many times as much as the
    #: fullest one of nearly the present direction.
    fuller: float = 1.5
    #: One of nearly the present direction is given up for the measured distances' sake if it is off
    #: by so many standard deviations: those of the first, rough model are too small. On four
    #: rendered façades the wall was 1.0 to 2.3 of them off; on one a plane through plinth and
    #: cornices, with a quarter as many points, was only 0.8 off and 14.7 degrees wrong.
    plane_contradicted: float = 4.0
    #: Planes looked for, triples tried for each.
    most_planes: int = 5
    triples: int = 2000

    # The bend of a wall or of its rays.
    #: Beyond this it is refraction or a strong lens for certain. `MOST_BENT` is the limit of an
    #: honest pair: rendered façades reach 0.006 px, church_1 and church_2 0.10; rendered ones seen
    #: through half a metre of water in 17 m 0.22 and 0.43. Set after they were seen. [px]
    strongly_curved: float = 1.0
    #: A face is what lies within this share of the far distance from its plane; where it holds
    #: fewer ties, or a smaller part of what a bent surface through all ties would hold, the wall
    #: itself is bent. Of six rendered façades flat faces hold 1.03 to 1.4 times as many as the best
    #: bent surface, walls bent by 1.8 to 14 px 0.1 to 0.6.
    shape_band: float = 0.0025
    fewest_on_face: int = 100
    face_holds: float = 0.8
    #: Faces tried.
    most_faces: int = 3
    #: Residuals that count less and less, at 3000 px of width [px], and the prior of the bend. The
    #: last tell one bent wall from parallel faces, which a bent surface meets along lines only.
    shape_widths: tuple[float, ...] = (8.0, 5.0, 3.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.3)
    sigma_shape: float = 0.05
    #: A bend so small that what it does is proportional to it.
    small_shape: float = 1e-3
    #: Ties used; side of the cells whose ties err alike, over half the diagonal.
    shape_ties: int = 2500
    shape_cell: float = 0.17


TUNING = Tuning()
