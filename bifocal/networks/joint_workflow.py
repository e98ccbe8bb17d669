"""Pair files of one façade in, the same pairs adjusted in one frame out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TypedDict

import numpy as np

from bifocal.files import photo_info
from bifocal.matching import Features, find_features
from bifocal.model import (
    NAMES,
    Pair,
    PairMedia,
    Photo,
    as_dict,
    exchanged,
    pinhole,
    stated_by_photo,
)
from bifocal.networks.joint_adjustment import Blunder, JointAdjustment, adjust_jointly
from bifocal.networks.joint_control import NamedPositions, name_of, named_positions
from bifocal.networks.joint_media import refracted_again, straightened
from bifocal.networks.joint_observations import JointObservations, of_one_camera, with_rays
from bifocal.networks.joint_ties import (
    SharedPoints,
    common_features,
    into_one_frame,
    near_each_other,
)
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import Pinhole, plane_from_pixel
from photocore.cli import Progress, no_progress
from photocore.errors import InputError, located
from photocore.images import read_grey
from photocore.jsonfile import write_object
from photocore.output import atomic_folder, check_all_writable, check_not_input, relative_name
from photocore.tables import write_csv
from photocore.tables.csvwrite import Columns

#: Precision of a feature's coordinate. [px of the searched photo]
SIGMA_FEATURE = 0.5
#: Features per photo, and pixels in which they are looked for: pairs share a part of their photos.
FEATURES, PIXELS = 8000, 6e6
#: Footprints that share this part of the smaller one may show common points.
OVERLAP = 0.05
#: What a pair's set-up says of a bend, which no other pair mends.
BENT = ("wall_bend_px", "wall_bend_sigma_px", "focal_px", "principal_point_px")
#: Blunders that are named one by one.
NAMED = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTask:
    """How pairs are adjusted.

    Attributes
    ----------
    control, check : tuple of (Path or None)
        Table of each pair, in their order; empty: none. Points of one name are one point, also
        where only one table gives its coordinates. Check points take part without theirs.
    sigma_control : float
        Standard deviation of a coordinate where a table has none. [m]
    sigma_pick, sigma_tie : float
        Precision of control picks and of features. [px]
    unit : str
        Of the coordinates; empty: as the headings say, else metres.
    columns : str, optional
        Which column of the tables is which; by default as the headings say.
    """

    control: tuple[Path | None, ...] = ()
    check: tuple[Path | None, ...] = ()
    sigma_control: float = 0.003
    sigma_pick: float = 0.5
    sigma_tie: float = SIGMA_FEATURE
    unit: str = ""
    columns: str | None = None


class AdjustedPoint(TypedDict):
    """A named point as plain data: its place, its sigmas, and how far it lies from before. [m]"""

    id: str
    kind: str
    rays: int
    X: float
    Y: float
    r: float
    sigma_X: float
    sigma_Y: float
    sigma_r: float
    dX: float
    dY: float
    dr: float
    flag: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointResult:
    """Adjusted pairs.

    Attributes
    ----------
    pairs : tuple of Pair
        In the common frame.
    names : tuple of str
        Of the pairs.
    adjustment : JointAdjustment
    points : tuple of AdjustedPoint
        Named points: id, kind (control, check, tie), X, Y, r, their sigmas, rays, and how far they
        lie from what was known. [m]
    remarks : tuple of str
        What the reader of the tables left out or used with doubt.
    """

    pairs: tuple[Pair, ...]
    names: tuple[str, ...]
    adjustment: JointAdjustment
    points: tuple[AdjustedPoint, ...]
    remarks: tuple[str, ...] = ()

    def check_rms(self, kind: str) -> tuple[int, FloatArray]:
        """Return how many points of a kind were compared, and their RMS in X, Y, r. [m]

        NaN for a coordinate that none of them has.
        """
        rows = [(p["dX"], p["dY"], p["dr"]) for p in self.points if p["kind"] == kind]
        away = np.array([row for row in rows if np.isfinite(row).any()], float).reshape(-1, 3)
        with np.errstate(invalid="ignore"):
            rms = np.sqrt(np.nansum(away**2, axis=0) / np.isfinite(away).sum(axis=0))
        return len(away), rms

    def lines(self) -> list[str]:
        """Return what was found, for people."""
        a = self.adjustment
        rms = np.sqrt((a.residuals**2).mean(axis=0))
        rays = len(a.residuals)
        lines = [
            f"{len(self.pairs)} pairs, {len(np.unique(a.observations.point))} points, {rays} rays; "
            f"sigma0 {a.sigma0:.2f}, redundancy {a.redundancy}, {a.iterations} iterations",
            f"residuals RMS {rms[0]:.2f}, {rms[1]:.2f} px",
        ]
        for kind in ("control", "check"):
            count, off = self.check_rms(kind)
            if count:
                misses = ", ".join(f"{1000 * v:.1f}" if np.isfinite(v) else "-" for v in off)
                lines.append(f"{count} {kind} points: RMS in X, Y, r {misses} mm")
        named = [b for b in a.blunders if not b.point.startswith("tie ")]
        lines += [f"gross error: {_told(b)}" for b in named[:NAMED]]
        photos = Counter(b.where for b in a.blunders if b.where != "control").most_common(5)
        if photos:
            lines.append("rays taken out: " + ", ".join(f"{n} in {k}" for k, n in photos))
        lines += [f"gross error LEFT IN: {_told(b)}" for b in a.left_in[:NAMED]]
        return [*lines, *self.remarks]

    def to_dict(self) -> dict[str, object]:
        """Return it as plain data."""
        a = self.adjustment
        return {
            "pairs": list(self.names),
            "sigma0": a.sigma0,
            "redundancy": a.redundancy,
            "rays": len(a.residuals),
            "rms_px": np.sqrt((a.residuals**2).mean(axis=0)),
            "points": list(self.points),
            "blunders": [asdict(b) for b in a.blunders],
            "left_in": [asdict(b) for b in a.left_in],
            "remarks": list(self.remarks),
        }


def _told(blunder: Blunder) -> str:
    return f"{blunder.point} in {blunder.where}, {blunder.test:.1f} times its sigma"


def adjust_pairs(
    paths: Sequence[Path],
    out: Path,
    task: JointTask = JointTask(),
    *,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> JointResult:
    """Adjust all pairs of a façade in one frame and write their pair files and points.

    Parameters
    ----------
    paths : sequence of Path
        Pair files, with their photos.
    out : Path
        Folder; gets a pair file of the same name for each, and ``points.csv``.

    Raises
    ------
    InputError, GeometryError
        If a file is unusable, two pair files have one name, pairs do not overlap, or control is
        missing or contradictory.
    """
    names = [name_of(path) for path in paths]
    twice = sorted({name for name in names if names.count(name) > 1})
    if len(paths) < 2:
        raise InputError("an adjustment of several pairs needs two pair files or more.")
    if twice:
        raise InputError(f"{twice[0]}: two pair files have this name; rename one.")
    pairs = [Pair.read(path) for path in paths]
    for path, pair in zip(paths, pairs, strict=True):
        with located(path):
            PairMedia.of(pair)
    tables = named_positions(
        paths,
        pairs,
        control=task.control,
        check=task.check,
        sigma=task.sigma_control,
        unit=task.unit,
        columns=task.columns,
    )
    outputs = [out / "points.csv", *(out / path.name for path in paths)]
    for output in outputs:
        check_not_input(output, *paths, *task.control, *task.check)
    if out.is_dir():
        check_all_writable(*outputs, overwrite=overwrite)
    result = joint_adjustment(pairs, names, tables, task, progress=progress)
    table: Columns = {"id": []}
    if result.points:
        cells = zip(*(point.values() for point in result.points), strict=True)
        table = dict(zip(result.points[0], map(list, cells), strict=True))
    with atomic_folder(out, overwrite=overwrite) as folder:
        for path, name, pair in zip(paths, names, result.pairs, strict=True):
            _write_pair(pair, folder / path.name, name, out)
        write_csv(folder / "points.csv", table)
    return result


def joint_adjustment(
    pairs: Sequence[Pair],
    names: Sequence[str],
    named: NamedPositions,
    task: JointTask,
    *,
    progress: Progress = no_progress,
) -> JointResult:
    """Adjust pairs whose photos can be read; see `adjust_pairs`."""
    photos = [photo for pair in pairs for photo in (pair.image1, pair.image2)]
    camera_of = _cameras_of(pairs)
    once = [camera_of.index(camera) for camera in range(max(camera_of) + 1)]
    features, shapes = [], []
    for k in once:
        progress(k // 2, len(pairs), f"{names[k // 2]}: features")
        image = read_grey(photo_info(pairs[k // 2], k % 2 + 1).path)
        features.append(find_features(image, limit=FEATURES, budget=PIXELS))
        shapes.append(image.shape)
    progress(len(pairs), len(pairs), "matches")
    together = np.zeros((len(once), len(once)), dtype=bool)
    near = _together(photos, [shapes[camera] for camera in camera_of])
    np.logical_or.at(together, np.ix_(camera_of, camera_of), near)
    straight = [straightened(photos[k], f) for k, f in zip(once, features, strict=True)]
    ties = common_features(straight, shapes, together)
    ties = _as_taken([photos[k] for k in once], ties).of_photos(camera_of)
    features = [features[camera] for camera in camera_of]
    shared = SharedPoints(
        photo=np.r_[named.shared.photo, ties.photo],
        point=np.r_[named.shared.point, ties.point + named.shared.count],
        pixels=np.concatenate([named.shared.pixels, ties.pixels]),
        count=named.shared.count + ties.count,
    )
    cameras = [pinhole(photo) for photo in photos]
    media = tuple(PairMedia.of(pair) for pair in pairs)
    ideal = _ideal([photos[once[camera]] for camera in camera_of], shared)
    observed = _observations(pairs, names, named, shared, ideal, features, task)
    observed = replace(observed, media=tuple((one, side) for one in media for side in (0, 1)))
    start = into_one_frame(cameras, shared, ideal, observed.known, names, media)
    good = near_each_other(start.cameras, shared, ideal, media)
    good |= shared.point < named.shared.count
    observed = with_rays(observed, good & np.isfinite(ideal).all(axis=1))
    start = replace(start, cameras=tuple(start.cameras[k] for k in once))
    adjusted = adjust_jointly(of_one_camera(observed, camera_of), start)
    originals = [photos[once[camera]] for camera in camera_of]
    return JointResult(
        pairs=tuple(
            _adjusted_pair(pair, adjusted, k, originals[2 * k : 2 * k + 2])
            for k, pair in enumerate(pairs)
        ),
        names=tuple(names), adjustment=adjusted, points=_points(named, adjusted),
        remarks=named.remarks,
    )  # fmt: skip


def _cameras_of(pairs: Sequence[Pair]) -> list[int]:
    """Return the camera of the far and the near photo of every pair: one file is one camera."""
    number: dict[Path, int] = {}
    return [
        number.setdefault(pair.photo_file(k).resolve(), len(number))
        for pair in pairs for k in (1, 2)
    ]  # fmt: skip


def _together(photos: Sequence[Photo], shapes: Sequence[tuple[int, ...]]) -> BoolArray:
    """Return which photos may show the same part of the wall, judged by their footprints.

    Both photos of a pair do. Where pairs are not in one frame yet, footprints say nothing: then
    neighbours in the order given, and those that seem to overlap, are looked at.
    """
    boxes = np.array(
        [_footprint(photo, shape) for photo, shape in zip(photos, shapes, strict=True)]
    )
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    common = np.prod(np.maximum(high - low, 0.0), axis=2)
    area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    together = common > OVERLAP * np.minimum(area[:, None], area[None, :])
    index = np.arange(len(photos))
    step = np.abs(index[:, None] // 2 - index[None, :] // 2)
    same_side = index[:, None] % 2 == index[None, :] % 2
    # Far with far and near with near between pairs: their scales are alike.
    return np.asarray((step == 0) | ((together | (step == 1)) & same_side))


def _footprint(photo: Photo, shape: tuple[int, ...]) -> FloatArray:
    """Return the box of a photo's corners on the reference plane, shape (4,). [m]"""
    height, width = shape[:2]
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], float)
    plane = photo.plane_from_pixels(corners)
    if not np.isfinite(plane).all():
        return np.r_[photo.nadir - 1e3, photo.nadir + 1e3]
    return np.r_[plane.min(axis=0), plane.max(axis=0)]


def _as_taken(photos: Sequence[Photo], ties: SharedPoints) -> SharedPoints:
    """Return features that were straightened for matching where the photos show them."""
    pixels = ties.pixels.copy()
    for index, photo in enumerate(photos):
        rays = ties.photo == index
        pixels[rays] = refracted_again(photo, ties.pixels[rays])
    return replace(ties, pixels=pixels)


def _ideal(photos: Sequence[Photo], shared: SharedPoints) -> FloatArray:
    """Return the pixels free of the lenses' distortion."""
    ideal = shared.pixels.copy()
    for index, photo in enumerate(photos):
        rays = shared.photo == index
        if photo.lens is not None and rays.any():
            ideal[rays] = photo.lens.undistort(shared.pixels[rays])
    return ideal


def _observations(
    pairs: Sequence[Pair],
    names: Sequence[str],
    named: NamedPositions,
    shared: SharedPoints,
    ideal: FloatArray,
    features: Sequence[Features],
    task: JointTask,
) -> JointObservations:
    """Return everything observed."""
    reduction = np.array([part.reduction for part in features])
    is_tie = shared.point >= named.shared.count
    sigma = np.where(is_tie, task.sigma_tie * reduction[shared.photo], task.sigma_pick)
    ties = shared.count - named.shared.count
    coordinates = np.full((shared.count, 3), np.nan)
    coordinates[: named.shared.count] = np.where(named.is_check[:, None], np.nan, named.xyz)
    spread = np.ones((shared.count, 3))
    spread[: named.shared.count] = named.sigma
    focal = np.zeros(2 * len(pairs))
    for k, pair in enumerate(pairs):
        if pair.orientation is not None:
            for side in (0, 1):
                at = NAMES.index(f"focal length {side + 1}")
                focal[2 * k + side] = np.sqrt(max(pair.orientation[at, at], 0.0))
    return JointObservations(
        names=tuple(f"{name}, {side}" for name in names for side in ("far", "near")),
        camera=shared.photo, point=shared.point, pixels=ideal,
        sigma=sigma,
        ids=(*named.ids, *(f"tie {k + 1}" for k in range(ties))),
        known=coordinates, sigma_known=spread, sigma_focal=focal,
    )  # fmt: skip


def _adjusted_pair(
    pair: Pair,
    adjusted: JointAdjustment,
    index: int,
    taken: Sequence[Photo],
) -> Pair:
    """Return a pair with its adjusted cameras, lenses and media as they were first stated."""
    observations = adjusted.observations
    photos = [
        replace(
            _adjusted_photo(photo, adjusted.cameras[camera], *observations.media_of(camera)),
            file=original.file, image_size=original.image_size, extra=original.extra,
        )
        for camera, original, photo in zip(
            observations.pairs[index], (pair.image1, pair.image2), taken, strict=True
        )
    ]  # fmt: skip
    extra = {key: value for key, value in pair.extra.items() if key != "setup"}
    setup = {"way": "joint adjustment", "sigma0": adjusted.sigma0}
    if isinstance(before := pair.extra.get("setup"), dict):
        setup |= {key: before[key] for key in BENT if key in before}
    return replace(
        pair, image1=photos[0], image2=photos[1], orientation=adjusted.orientation(index),
        extra={**extra, "setup": setup}, remarks=(),
    )  # fmt: skip


def _adjusted_photo(photo: Photo, camera: Pinhole, media: PairMedia, side: int) -> Photo:
    stretch = float(camera.matrix[0, 0] / pinhole(photo).matrix[0, 0])
    c = photo.principal_distance
    distance = float(camera.centre[2])
    return replace(
        photo, plane_from_pixel=plane_from_pixel(camera), nadir=camera.centre[:2],
        distance=distance, **stated_by_photo(media, side, camera),
        principal_distance=None if c is None else stretch * c,
    )  # fmt: skip


def _points(named: NamedPositions, adjusted: JointAdjustment) -> tuple[AdjustedPoint, ...]:
    """Return the named points with their precision and what they are compared with."""
    rays = np.bincount(adjusted.observations.point, minlength=len(named.ids))
    out: list[AdjustedPoint] = []
    wrong = {b.point for b in adjusted.blunders if b.where == "control"}
    for k, name in enumerate(named.ids):
        is_control = np.isfinite(named.xyz[k]).any()
        kind = "check" if named.is_check[k] else "control" if is_control else "tie"
        sigma = np.sqrt(np.diagonal(adjusted.covariance[k]))
        away = adjusted.xyz[k] - named.xyz[k]
        x, y, r = adjusted.xyz[k].tolist()
        sigma_x, sigma_y, sigma_r = sigma.tolist()
        dx, dy, dr = away.tolist()
        out.append(
            AdjustedPoint(
                id=name, kind=kind, rays=int(rays[k]), X=x, Y=y, r=r, sigma_X=sigma_x,
                sigma_Y=sigma_y, sigma_r=sigma_r, dX=dx, dY=dy, dr=dr,
                flag="GROSS" if name in wrong else "OK",
            )
        )  # fmt: skip
    return tuple(out)


def _write_pair(pair: Pair, path: Path, name: str, folder: Path) -> None:
    """Write a pair file whose photos and lenses are found from the folder it will lie in."""
    photos = []
    for number, photo in enumerate((pair.image1, pair.image2), start=1):
        extra = dict(photo.extra)
        if photo.lens is not None:
            lens = f"{name}.lens{number}.json"
            photo.lens.write(path.with_name(lens))
            extra["lens"] = lens
        file = relative_name(pair.photo_file(number), folder) if photo.file else ""
        size = photo.image_size
        if photo.file and pair.photo_file(number).is_file():
            size = photo_info(pair, number).size
        photos.append(replace(photo, file=file, image_size=size, extra=extra))
    content = replace(pair, image1=photos[0], image2=photos[1]).to_dict()
    if pair.exchanged:
        # In the order given: that of its columns in the tables of points.
        content["image1"], content["image2"] = content["image2"], content["image1"]
        if pair.orientation is not None:
            content["orientation"] = as_dict(exchanged(pair.orientation), pair.layers)
    write_object(path, content)
