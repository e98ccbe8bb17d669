"""Which sets of a multi-plane calibration are of one camera, and which of their points are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multimedia.media import Camera, Media
from multimedia.openptv.plane_sets import PlaneCandidates, PlaneSet
from multimedia.orientation import Resection, resect
from multimedia.remarks import remark
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.errors import ConvergenceError, GeometryError, InputError

#: A set whose median misfit is beyond this share of the distance between neighbours in the image
#: is no match: numbers that are one point off are off by that whole distance.
NO_MATCH = 0.25
#: A point is no match beyond so many median misfits, and at least so many pixels.
WORST, LEAST = 8.0, 3.0
_ROUNDS = 6
#: So many points of a set tell whether it is a match; the points taken are all looked at.
_SAMPLE = 60
#: What a camera may differ in from its stored interior orientation.
_INTERIOR = ("c", "xh", "yh", "k1", "k2", "p1", "p2")
#: What it may differ in while sets are compared: a free principal point, millimetres off, would
#: make one oblique view of planes that are shifted against each other.
_LEAN = ("c", "k1")


@dataclass(frozen=True, slots=True, eq=False)
class PlaneMatch:
    """The points of one camera that a multi-plane calibration is made of.

    Attributes
    ----------
    labels : tuple of str
        Position of the body of each point.
    image, xyz : ndarray, shape (n, 2) and (n, 3)
        [mm]
    remarks : tuple of str
        What was taken, and what was not.
    """

    labels: tuple[str, ...]
    image: FloatArray
    xyz: FloatArray
    remarks: tuple[str, ...]


def choose_sets(camera: Camera, candidates: PlaneCandidates, media: Media) -> PlaneMatch:
    """Return the points of the sets that one camera can have seen.

    Parameters
    ----------
    camera : Camera
        With its sensor; only the interior orientation counts.
    candidates : PlaneCandidates
        Of each position the likeliest set first.
    media : FlatInterface, Interfaces or None
        What the camera looks through.

    Notes
    -----
    Every set is resected on its own first, then all together with the interior orientation free: a
    list of points shifted by a whole row fits alone, but not together with the others. What
    disagrees is left out and named, single points too.
    """
    remarks: list[str] = []
    chosen: list[PlaneSet] = []
    for sets in candidates.positions:
        for candidate in sets:
            if _fits_alone(camera, candidate, media):
                chosen.append(candidate)
                break
            remarks.append(f"{candidate.source} was refused: no camera sees its points like that.")
    whole = [one for one in candidates.together if _fits_alone(camera, one, media)]
    count = sum(len(one.xyz) for one in chosen)
    best = max(whole, key=lambda one: len(one.xyz), default=None)
    if best is not None and len(best.xyz) > count:
        chosen = [best]
    chosen = list(_agreeing(camera, chosen, media, remarks))
    if not chosen:
        return PlaneMatch((), np.empty((0, 2)), np.empty((0, 3)), tuple(remarks))
    return _matched(camera, chosen, media, remarks)


def _matched(
    camera: Camera, chosen: Sequence[PlaneSet], media: Media, remarks: list[str]
) -> PlaneMatch:
    """Return the points of the sets without those that are no match, and what was taken."""
    labels = np.concatenate([[one.label] * len(one.xyz) for one in chosen])
    image = np.concatenate([one.image for one in chosen])
    xyz = np.concatenate([one.xyz for one in chosen])
    good = _good_points(camera, xyz, image, media)
    if not good.all():
        remarks.append(f"{int((~good).sum())} points were refused: they lie far from their place.")
    words = ", ".join(f"{one.label or 'all planes'} ({one.source})" for one in chosen)
    resected = _resected(camera, xyz[good], image[good], media)
    misfit = (
        "" if resected is None else f", {_pixels(camera, resected):.2f} px from their place (RMS)"
    )
    remarks.insert(0, f"took {int(good.sum())} points of {words}{misfit}.")
    kept = _resected(camera, xyz[good], image[good], media, estimate=())
    if resected is not None and kept is not None and _rms(kept) > 2.0 * _rms(resected):
        remarks.append(remark("openptv.interior_misfit", rest=_pixels(camera, kept)))
    if _is_flat(xyz[good]):
        remarks.append(remark("openptv.one_plane"))
    return PlaneMatch(tuple(labels[good].tolist()), image[good], xyz[good], tuple(remarks))


def _agreeing(
    camera: Camera, chosen: Sequence[PlaneSet], media: Media, remarks: list[str]
) -> Iterator[PlaneSet]:
    """Yield the sets that agree with each other, leaving out the one that disturbs most."""
    sets: list[PlaneSet] = []
    for one in chosen:
        places = set(map(tuple, one.xyz.tolist()))
        again = [
            candidate for candidate in sets if places & set(map(tuple, candidate.xyz.tolist()))
        ]
        if again:
            remarks.append(f"{one.source} was left out: it has points of {again[0].source}.")
        else:
            sets.append(one)
    while len(sets) > 1 and not _fit_together(camera, sets, media):
        if len(sets) == 2:
            names = " and ".join(one.source for one in sets)
            remarks.append(remark("openptv.contradict", names=names))
            return
        without = [sets[:k] + sets[k + 1 :] for k in range(len(sets))]
        costs = [_cost(camera, rest, media) for rest in without]
        worst = int(np.argmin(costs))
        remarks.append(f"{sets[worst].source} was refused: it contradicts the other planes.")
        sets = without[worst]
    yield from sets


def _fits_alone(camera: Camera, one: PlaneSet, media: Media) -> bool:
    """Whether some pose of the camera shows these points where they were measured."""
    few = _sample(one)
    resected = _resected(camera, one.xyz[few], one.image[few], media, estimate=())
    return resected is not None and _is_match(camera, one, resected.residuals)


def _fit_together(camera: Camera, sets: Sequence[PlaneSet], media: Media) -> bool:
    """Whether some camera shows the points of every set where they were measured."""
    joint = _joint(camera, sets, media)
    if joint is None:
        return False
    ends = np.cumsum([len(_sample(one)) for one in sets])[:-1]
    parts = np.split(joint.residuals, ends)
    return all(_is_match(camera, one, part) for one, part in zip(sets, parts, strict=True))


def _cost(camera: Camera, sets: Sequence[PlaneSet], media: Media) -> float:
    joint = _joint(camera, sets, media)
    return np.inf if joint is None else _rms(joint)


def _joint(camera: Camera, sets: Sequence[PlaneSet], media: Media) -> Resection | None:
    xyz = np.concatenate([one.xyz[_sample(one)] for one in sets])
    image = np.concatenate([one.image[_sample(one)] for one in sets])
    return _resected(camera, xyz, image, media, estimate=_LEAN)


def _sample(one: PlaneSet) -> IntArray:
    """Return some rows of a set, spread evenly over it, the first and the last among them."""
    count = len(one.xyz)
    rows = np.linspace(0, count - 1, min(count, _SAMPLE))
    return np.asarray(np.rint(rows), dtype=np.int64)


def _is_match(camera: Camera, one: PlaneSet, residuals: FloatArray) -> bool:
    """Whether most points lie nearer to their place than to a neighbour's."""
    from scipy.spatial import cKDTree

    pitch = _pitch(camera)
    apart = np.median(cKDTree(one.image / pitch).query(one.image / pitch, k=2)[0][:, 1])
    miss = np.linalg.norm(residuals / pitch, axis=1)
    return bool(np.median(miss) < NO_MATCH * apart and np.mean(miss > apart) < 0.2)


def _good_points(camera: Camera, xyz: FloatArray, image: FloatArray, media: Media) -> BoolArray:
    """Return which points are no gross errors, refitting as they are left out."""
    good = np.ones(len(xyz), dtype=bool)
    for _ in range(_ROUNDS):
        resected = _resected(camera, xyz[good], image[good], media)
        if resected is None:
            break
        miss = np.linalg.norm(resected.residuals / _pitch(camera), axis=1)
        bad = miss > max(LEAST, WORST * float(np.median(miss)))
        if not bad.any():
            break
        good[np.flatnonzero(good)[bad]] = False
    return good


def _resected(
    camera: Camera,
    xyz: FloatArray,
    image: FloatArray,
    media: Media,
    *,
    estimate: tuple[str, ...] = _INTERIOR,
) -> Resection | None:
    """Return a resection with the interior free as far as points of some depth carry it."""
    free = () if _is_flat(xyz) or len(xyz) < 2 * len(_INTERIOR) else estimate
    for names in dict.fromkeys((free, ("c",) if free else (), ())):
        try:
            return resect(camera, xyz, image, media, estimate=names)
        except (GeometryError, ConvergenceError, InputError):
            continue
    return None


def _is_flat(xyz: FloatArray) -> bool:
    spread = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return bool(spread[2] < 1e-3 * spread[0])


def _rms(resection: Resection) -> float:
    return float(np.sqrt(np.mean(resection.residuals**2)))


def _pixels(camera: Camera, resection: Resection) -> float:
    """Return the RMS misfit of a coordinate. [px]"""
    return float(np.sqrt(np.mean((resection.residuals / _pitch(camera)) ** 2)))


def _pitch(camera: Camera) -> FloatArray:
    return camera.described_sensor("matching planes needs its sensor.").pixel_size
