"""Which of several parallel faces is the wall: their shares, the user's word, one scale, a warning.

A plinth, pilasters and the wall between them are planes of almost the same extent. Taking another
one shifts every relief by the same offset, and nothing in the photos says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal.model import Cameras, Interior, Interiors
from bifocal.orientation.control_points import SiteMeasures
from bifocal.orientation.tuning import WALLS
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import rotation_from_vector
from photocore.errors import GeometryError


@dataclass(frozen=True, slots=True)
class WallFace:
    """A plane parallel to the reference plane on which points gather.

    Attributes
    ----------
    offset : float
        In front of the reference plane. [m]
    share : float
        Of all points.
    pixel : tuple of float
        A spot of the far photo in its midst. [px]
    chance : float
        How well its distances stand in the ratio of the measured ones; 1: perfectly, or not known.
    """

    offset: float
    share: float
    pixel: tuple[float, float]
    chance: float = 1.0


def faces(heights: FloatArray, pixels: FloatArray, *, band: float) -> list[WallFace]:
    """Return the faces on which points gather, the fullest first.

    Parameters
    ----------
    heights : ndarray, shape (n,)
        Above the reference plane. [m]
    pixels : ndarray, shape (n, 2)
        In the far photo. [px]
    band : float
        Half the thickness of a face. [m]
    """
    planes: list[WallFace] = []
    count, order = len(heights), np.argsort(heights)
    heights, pixels = heights[order], pixels[order]
    free = np.ones(count, dtype=bool)
    while len(planes) < 6 and free.any():
        filled = np.concatenate([[0], np.cumsum(free)])
        low = np.searchsorted(heights, heights - band)
        high = np.searchsorted(heights, heights + band, side="right")
        held = np.where(free, filled[high] - filled[low], 0)
        at = heights[int(held.argmax())]
        members = free & (np.abs(heights - at) <= band)
        offset = float(np.median(heights[members]))
        if members.sum() < 0.05 * count:
            break
        if all(abs(offset - face.offset) > WALLS.faces_apart * band for face in planes):
            planes.append(
                WallFace(
                    offset, float(members.sum() / count), _midst(pixels, np.flatnonzero(members))
                )
            )
        free &= np.abs(heights - at) > band
    return planes


def _midst(pixels: FloatArray, members: IntArray) -> tuple[float, float]:
    """Return the member with the most other members, and the fewest strangers, around it."""
    radius = 0.03 * float(np.linalg.norm(np.ptp(pixels, axis=0)))
    some = members[:: max(1, len(members) // 400)]
    close = np.linalg.norm(pixels[some, None] - pixels[None], axis=2) < radius
    inside = np.zeros(len(pixels))
    inside[members] = 1.0
    best = pixels[some[int((close @ (2 * inside - 1)).argmax())]]
    return float(round(best[0])), float(round(best[1]))


def choose_wall(
    xyz: FloatArray,
    pixels: FloatArray,
    cameras: Cameras,
    interiors: Interiors,
    site: SiteMeasures,
    *,
    sigma_ratio: float = np.inf,
) -> tuple[FloatArray, list[WallFace]]:
    """Return the wall's plane z = a + b X + c Y and all faces parallel to it, the wall first.

    The spot the user named decides; else the face whose distances stand in the ratio of those
    measured, where that is precise enough to tell; else, where the photos were planned for one
    scale, the face of comparable size on which the scales differ least; else the largest.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Points spread evenly over the area.
    pixels : ndarray, shape (n, 2)
        The same in the far photo. [px]
    cameras, interiors : pairs
    site : SiteMeasures
    sigma_ratio : float
        Standard deviation of ln(d1 / d2) of the cameras, found without both measured distances.

    Raises
    ------
    GeometryError
        If no point lies near the spot named.
    """
    band = WALLS.face_band * float(cameras[0].centre[2])
    plane = largest_plane(xyz, band=band)
    heights = _heights(xyz, plane)
    offset = 0.0
    if site.wall is not None:
        offset = _height_at(heights, pixels, site.wall, interiors[0])
    elif (
        by_ratio := _face_by_ratio(heights, pixels, cameras, plane, site, sigma_ratio)
    ) is not None:
        offset = by_ratio
    elif is_one_scale(interiors, site):
        planes = faces(heights, pixels, band=band)
        fair = [f for f in planes if f.share >= WALLS.comparable * planes[0].share]
        if fair:
            offset = min(fair, key=lambda f: abs(scale_difference(cameras, plane, f.offset))).offset
    if offset:
        plane = refitted(xyz, plane + np.array([offset, 0.0, 0.0]), band=band)
        heights = _heights(xyz, plane)
    planes = faces(heights, pixels, band=band)
    tests = _ratio_tests(planes, cameras, plane, site, sigma_ratio)
    chances = np.exp(-0.5 * np.minimum(tests, 30.0) ** 2).tolist()
    planes = [replace(face, chance=c) for face, c in zip(planes, chances, strict=True)]
    return plane, sorted(planes, key=lambda face: (abs(face.offset) > band, -face.share))


def _ratio_tests(
    planes: Sequence[WallFace],
    cameras: Cameras,
    plane: FloatArray,
    site: SiteMeasures,
    sigma: float,
) -> FloatArray:
    """Return how far each face's distances are from the measured ratio, in sigma; 0: unknown."""
    d1, d2 = site.distances
    if not (d1 and d2):
        return np.zeros(len(planes))
    far, near = (float(c.centre[2] - plane[0] - c.centre[:2] @ plane[1:]) for c in cameras)
    sigma = float(np.hypot(sigma, np.hypot(site.sigma / d1, site.sigma / d2)))
    ratios = [np.log((far - face.offset) / (near - face.offset)) for face in planes]
    return np.abs(np.array(ratios) - np.log(d1 / d2)) / sigma


def _face_by_ratio(
    heights: FloatArray,
    pixels: FloatArray,
    cameras: Cameras,
    plane: FloatArray,
    site: SiteMeasures,
    sigma: float,
) -> float | None:
    """Return the offset of the face whose distances have the measured ratio; None: cannot tell."""
    planes = faces(heights, pixels, band=WALLS.face_band * float(cameras[0].centre[2]))
    fair = [face for face in planes if face.share >= WALLS.fair * planes[0].share]
    tests = _ratio_tests(fair, cameras, plane, site, sigma)
    if len(fair) < 2 or not tests.any():
        return None
    order = np.argsort(tests)
    # The nearest must fit, and the next must not.
    if tests[order[0]] > WALLS.face_fits or tests[order[1]] < max(
        WALLS.face_fits, 2 * tests[order[0]]
    ):
        return None
    return fair[int(order[0])].offset


def largest_plane(xyz: FloatArray, *, band: float) -> FloatArray:
    """Return the plane z = a + b X + c Y, nearly parallel to Z = 0, that holds most points.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
    band : float
        Points this near count fully less their distance (a narrow face beats a vague heap).
    """
    generator = np.random.default_rng(7)
    sample = xyz[generator.choice(len(xyz), min(len(xyz), 6000), replace=False)]
    triples = generator.integers(0, len(sample), (3000, 3))
    corners = sample[triples]
    ones = np.ones((*corners.shape[:2], 1))
    design = np.concatenate([ones, corners[..., :2]], axis=2)
    area = np.linalg.det(design)
    extent = np.ptp(sample[:, :2], axis=0).prod()
    wide = np.abs(area) > 0.02 * extent
    planes = np.linalg.solve(design[wide], corners[wide][..., 2:])[..., 0]
    planes = planes[np.abs(planes[:, 1:]).max(axis=1) < WALLS.face_slope]
    planes = np.concatenate([np.zeros((1, 3)), planes])
    lifted = np.column_stack([np.ones(len(sample)), sample[:, :2]])
    scores = [
        np.maximum(1 - np.abs(sample[:, 2] - lifted @ plane) / band, 0).sum() for plane in planes
    ]
    return refitted(sample, planes[int(np.argmax(scores))], band=band)


def refitted(xyz: FloatArray, plane: FloatArray, *, band: float) -> FloatArray:
    """Return the plane fitted to the points within a band of an approximate one."""
    lifted = np.column_stack([np.ones(len(xyz)), xyz[:, :2]])
    for _ in range(3):
        near = np.abs(xyz[:, 2] - lifted @ plane) < band
        if near.sum() < 3:
            break
        plane = np.linalg.lstsq(lifted[near], xyz[near, 2], rcond=None)[0]
    return np.asarray(plane)


def onto_plane(cameras: Cameras, plane: FloatArray) -> Cameras:
    """Return cameras in the frame of the plane z = a + b X + c Y, X and Y all but kept."""
    turn, origin = frame_of(plane)
    return cameras[0].moved(turn, origin), cameras[1].moved(turn, origin)


def frame_of(plane: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return axes, as rows, and origin of the frame of z = a + b X + c Y, X and Y all but kept."""
    slope = float(np.hypot(plane[1], plane[2]))
    # The rotation that takes the normal to the new Z axis, about their common perpendicular.
    angle = np.arctan(slope) / slope if slope > 0 else 0.0
    turn = rotation_from_vector([-angle * plane[2], angle * plane[1], 0.0])
    return turn, np.array([0.0, 0.0, plane[0]])


@dataclass(frozen=True, slots=True, eq=False)
class NarrowFace:
    """A wall's own face, found among everything near it.

    Attributes
    ----------
    plane : ndarray, shape (3,)
        z = a + b X + c Y. [m, -, -]
    roughness : float
        Standard deviation of the face's own unevenness. [m]
    chance : ndarray, shape (n,)
        Each point's probability of being of the face.
    """

    plane: FloatArray
    roughness: float
    chance: FloatArray

    @property
    def members(self) -> BoolArray:
        """Points that are at least half as likely of the face as its likeliest one.

        On a plain wall no point is more likely of it than of the shallow relief around it.
        """
        return self.chance > 0.5 * self.chance.max(initial=0.0)


def narrow_face(xyz: FloatArray, sigma: FloatArray, *, band: float) -> NarrowFace:
    """Return the face nearest to Z = 0 on which most points gather, however narrow it is.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Points around the reference plane. [m]
    sigma : ndarray, shape (n,)
        Standard deviations of their heights. [m]
    band : float
        Points farther than this from Z = 0 are not asked. [m]

    Notes
    -----
    Planes through three points compete by their truncated cost at four of each point's own sigma;
    the best is refined by expectation-maximisation of a normal core of unknown roughness, of
    shallow relief around it (none, one or two wider normals, in front of it or behind, as many as
    the points call for by Schwarz's criterion) and of a uniform rest. A band of fixed width would
    average plinths and joints into the wall: 6.2 mm of relief on a rendered façade, against
    0.35 mm. A core without shallow relief swallows it: on a church whose ashlar is even to 4 mm,
    with joints 15 mm behind and mouldings 50 mm in front, it came out 18 mm thick, 5 mm in front
    and leaning by 0.2 degrees.
    """
    reach = np.maximum(band, 4 * sigma)
    near = np.abs(xyz[:, 2]) < reach
    lifted = np.column_stack([np.ones(len(xyz)), xyz[:, :2]])
    if near.sum() < 20:
        return NarrowFace(np.zeros(3), 0.0, np.zeros(len(xyz)))
    some, height, spread, reach = lifted[near], xyz[near, 2], sigma[near], reach[near]
    generator = np.random.default_rng(7)
    precise = np.argsort(spread)[: max(len(spread) // 2, 20)]
    triples = generator.choice(precise, (600, 3))
    design = some[triples]
    wide = np.abs(np.linalg.det(design)) > 0.02 * np.ptp(some[:, 1:], axis=0).prod()
    planes = np.linalg.solve(design[wide], height[triples][wide][..., None])[..., 0]
    planes = planes[np.abs(planes[:, 1:]).max(axis=1) < WALLS.face_slope]
    planes = np.concatenate([np.zeros((1, 3)), planes])
    tested = generator.choice(len(height), min(len(height), 2000), replace=False)
    away = height[tested] - planes @ some[tested].T
    cores = []
    for least in (0.01, 0.05):  # an even wall, a rough one: the likelier is it
        wide = 4 * np.maximum(spread[tested], least * band)
        start = planes[int(np.minimum((away / wide) ** 2, 1.0).sum(axis=1).argmin())]
        cores += [
            _core(some, height, spread, reach, start, least * band, shallow=shallow)
            for shallow in (0, 1, 2)
        ]
    # But not one that is confined to a corner, where another lies spread over the picture.
    spreads = [_extent(some[:, 1:], core[3]) for core in cores]
    wide = [core for core, spread in zip(cores, spreads, strict=True) if spread > WALLS.confined]
    _, plane, roughness, chance = max(wide or cores, key=lambda core: core[0])
    everywhere = np.zeros(len(xyz))
    everywhere[near] = chance
    return NarrowFace(plane, roughness, everywhere)


def _extent(places: FloatArray, chance: FloatArray) -> float:
    """Return the area over which a face lies spread, as a share of that of all points.

    Square root of the determinant of the covariance of the cells of the wall that have the face.
    How much of it each has is estimated anew (expectation-maximisation of its share): what
    crosses a narrow face by chance looks as likely of it as its own points.
    """
    cell = np.floor((places - places.min(axis=0)) / np.ptp(places, axis=0).max() * WALLS.cells)
    cells, which, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    which, whole = which.ravel(), float(np.clip(chance.mean(), 1e-6, 1 - 1e-6))
    # How much likelier a point is of the face than of all else, before any share of it.
    likelier = np.minimum(chance, 1 - 1e-9) / np.maximum(1 - chance, 1e-9) * (1 - whole) / whole
    share = np.full(len(cells), 0.5)
    for _ in range(30):
        belonging = share[which] * likelier / (share[which] * likelier + 1 - share[which])
        share = np.bincount(which, belonging, len(cells)) / count
    full = share > 0.5 * np.quantile(share, 0.9)
    if full.sum() < 3:
        return 0.0
    spread, widest = (float(np.linalg.det(np.cov(part.T))) for part in (cells[full], cells))
    return float(np.sqrt(max(spread, 0.0) / max(widest, 1e-12)))


def _core(
    lifted: FloatArray,
    height: FloatArray,
    spread: FloatArray,
    reach: FloatArray,
    plane: FloatArray,
    roughness: float,
    *,
    shallow: int,
) -> tuple[float, FloatArray, float, FloatArray]:
    """Return log-likelihood, plane, roughness and chances of a wall's own face.

    Parameters
    ----------
    lifted : ndarray, shape (n, 3)
        (1, X, Y). [-, m, m]
    height, spread, reach : ndarray, shape (n,)
        Heights, their standard deviations, and how far from Z = 0 a point was asked. [m]
    plane : ndarray, shape (3,)
        Start.
    roughness : float
        Start; a fifth of it is the least. [m]
    shallow : int
        How many wider normals of free offset stand for shallow relief. The three unknowns of each
        cost 1.5 ln(n) of the likelihood (Schwarz's criterion).
    """
    least = 0.2 * roughness
    shares = np.full(shallow + 2, 1 / (shallow + 2))
    widths, offsets = roughness * 4.0 ** np.arange(shallow + 1), np.zeros(shallow + 1)
    level = 1 / (2 * reach)[None]
    for _ in range(50):
        variance = widths[:, None] ** 2 + spread**2
        away = height - lifted @ plane - offsets[:, None]
        normal = np.exp(-0.5 * away**2 / variance) / np.sqrt(2 * np.pi * variance)
        parts = shares[:, None] * np.concatenate([normal, level])
        density = parts.sum(axis=0)
        chance = parts / density
        weight = chance[:-1] / variance
        core = lifted * weight[0][:, None]
        plane = np.linalg.solve(core.T @ lifted, core.T @ height)
        away = height - lifted @ plane
        offsets[1:] = (weight[1:] @ away) / np.maximum(weight[1:].sum(axis=1), 1e-300)
        shares = np.maximum(chance.mean(axis=1), [0.02, *[0.0] * shallow, 0.02])
        shares /= shares.sum()
        # A normal's variance beyond the points' own, each weighted by how much it tells of it.
        tell = weight / variance
        square = (away - offsets[:, None]) ** 2 - spread**2
        extra = (tell * square).sum(axis=1) / np.maximum(tell.sum(axis=1), 1e-300)
        widths[0] = np.sqrt(max(extra[0], least**2))
        widths[1:] = np.sqrt(np.maximum(extra[1:], (WALLS.wider * widths[0]) ** 2))
    likelihood = float(np.log(density).sum()) - 1.5 * shallow * float(np.log(len(height)))
    return likelihood, plane, float(widths[0]), chance[0]


def is_one_scale(interiors: Interiors, site: SiteMeasures) -> bool:
    """Return whether focal lengths and distances say that both photos were meant for one scale."""
    d1, d2 = site.distances
    if not (site.parallel and d1 and d2) or any(interior.is_assumed for interior in interiors):
        return False
    ratio = interiors[1].focal / d2 * d1 / interiors[0].focal
    return abs(float(np.log(ratio))) < WALLS.one_scale


def scale_difference(cameras: Cameras, plane: FloatArray, offset: float) -> float:
    """Return how far the near photo's scale is from the far one's on a plane moved by an offset."""
    far, near = (camera.matrix[0, 0] / (camera.centre[2] - plane[0] - offset) for camera in cameras)
    return float(np.log(near / far))


def rivals(planes: Sequence[WallFace]) -> list[WallFace]:
    """Return the faces that may as well be the wall."""
    likely = [face for face in planes[1:] if face.chance >= WALLS.unlikely * planes[0].chance]
    return [face for face in likely if face.share >= WALLS.comparable * planes[0].share]


def zero_sigma(planes: Sequence[WallFace]) -> float:
    """Return how far the wall's zero may be off, as another face may be the wall; 0: none. [m]

    Root mean square offset, each face as likely as its share of the points and its chance say.
    """
    likely = [*planes[:1], *rivals(planes)]
    weight = np.array([face.share * face.chance for face in likely])
    square = np.array([face.offset for face in likely]) ** 2
    return float(np.sqrt(weight @ square / weight.sum())) if len(likely) > 1 else 0.0


def rivals_in_words(planes: Sequence[WallFace], site: SiteMeasures) -> str:
    """Return the warning that other planes compete with the wall; empty if none does."""
    others = rivals(planes)
    if not others or site.wall is not None:
        return ""
    named = "; ".join(
        f"{1000 * face.offset:+.0f} mm, {100 * face.share:.0f} % (--wall {face.pixel[0]:.0f},"
        f"{face.pixel[1]:.0f})"
        for face in others
    )
    return remark("orientation.rivals", share=100 * planes[0].share, planes=named)


def _heights(xyz: FloatArray, plane: FloatArray) -> FloatArray:
    return xyz[:, 2] - plane[0] - xyz[:, :2] @ plane[1:]


def _height_at(
    heights: FloatArray, pixels: FloatArray, spot: tuple[float, float], interior: Interior
) -> float:
    """Return the height of the face around a spot of the far photo: its nearest points' median."""
    away = np.linalg.norm(pixels - np.array(spot), axis=1)
    near = np.argsort(away)[:9]
    if len(near) < 9 or away[near[4]] > 0.06 * max(interior.image_size):
        raise GeometryError(remark("refused.no_detail", column=spot[0], row=spot[1]))
    return float(np.median(heights[near]))
