"""What the photos of both dates say of a change: each date's must contradict the other's relief."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bifocal.comparison.cells import on_grid
from bifocal.comparison.tuning import EVIDENCE
from bifocal.files import PAIR_TAG, MadeFrom, check_maps
from bifocal.model import Pair, Photo, PhotoSet, RasterReader, ReliefMap, as_grey
from bifocal.relief_maps.photo_evidence import Witness, exposed_alike, misfit, shown_by
from photocore.arrays import FloatArray, IntArray
from photocore.errors import PhotogrammetryError

#: Where the photos of a date come from.
PhotosOfDate = Pair | PhotoSet


def contradicted(
    region: IntArray,
    difference: ReliefMap,
    maps: Sequence[ReliefMap],
    dates: Sequence[PhotosOfDate],
) -> list[int]:
    """Return the numbers of regions that the photos do not show to have changed.

    A change is shown where the photos of each date fit its own relief, and not that of the other
    date: by so much worse as it moves the photos, of less than `EVIDENCE.parallax` pixels worse at
    all.

    Parameters
    ----------
    region : ndarray of int64, shape (h, w)
        Numbers of the regions, from 1.
    difference : ReliefMap
    maps : sequence of ReliefMap
        Before and after.
    dates : sequence of Pair or PhotoSet
        With photos that exist.
    """
    grid, where = difference.grid, region > 0
    reliefs = [np.asarray(on_grid(one, grid).r, np.float32) for one in maps]
    if not where.any():
        return []
    misfits, parallax = [], np.zeros(grid.shape)
    for k, date in enumerate(dates):
        photos = _photos_of(date)
        witnesses = [Witness.of(one, as_grey(one.image, one.file), grid.gsd) for one in photos]
        witnesses, usual = exposed_alike(witnesses, reliefs[k], grid)
        # First a date's own relief, then the other date's.
        for relief in (reliefs[k], reliefs[1 - k]):
            values = misfit(witnesses, relief, grid, where, usual)
            visible = np.zeros(grid.shape, bool)
            shown = shown_by(witnesses, relief, grid, where)
            visible[where & np.isfinite(relief)] = np.isfinite(shown).sum(axis=0) >= 2
            misfits.append(np.where(visible, values, np.nan))
        parallax = np.fmax(parallax, _parallax(photos, reliefs, difference))
    numbers = []
    for number in range(1, int(region.max()) + 1):
        part = (region == number) & np.isfinite(difference.r)
        visible = part & np.isfinite(np.sum(misfits, axis=0))
        apart = float(np.median(parallax[part]))
        if not visible.any():
            numbers.append(number)
            continue
        fits = np.reshape([one[visible].mean() for one in misfits], (2, 2))
        better = 0.0
        if apart > EVIDENCE.parallax:
            better = min(EVIDENCE.better * apart, EVIDENCE.most)
        if fits[:, 0].max() > EVIDENCE.fits or (fits[:, 1] - fits[:, 0]).min() < better:
            numbers.append(number)
    return numbers


def parallax_of(
    difference: ReliefMap, maps: Sequence[ReliefMap], dates: Sequence[PhotosOfDate]
) -> FloatArray:
    """Return by how many pixels of the map a metre of relief moves photos apart, at both dates.

    That of the date that shows it less; the difference errs as much as this one.
    """
    apart = []
    for one, date in zip(maps, dates, strict=True):
        relief = np.asarray(on_grid(one, difference.grid).r, np.float64)
        moved = (relief, relief + EVIDENCE.step)
        apart.append(_parallax(_photos_of(date), moved, difference) / EVIDENCE.step)
    return np.asarray(np.minimum(*apart))


def _photos_of(date: PhotosOfDate) -> tuple[Photo, ...]:
    return date.photos if isinstance(date, PhotoSet) else (date.photo1, date.photo2)


def photos_at_hand(path: Path, relief: Path) -> PhotoSet | None:
    """Return the photos of a relief map, where they exist; its own file names theirs, or `path`.

    Raises
    ------
    InputError
        If ``path`` is the file of photos, and is unusable or the map was made from another state
        of them. What only lies beside a map is then not asked.
    """
    if path != relief:
        photos = PhotoSet.read(path)
        check_maps(MadeFrom.of(photos.photos), relief=relief)
    else:
        with RasterReader(relief) as reader:
            path = relief.parent / Path(reader.tags.get(PAIR_TAG, "")).name
            made_from = MadeFrom.of_tags(reader.tags)
        if not (holds_photos(path) and path.is_file()):
            return None
        try:
            photos = PhotoSet.read(path)
        except PhotogrammetryError:
            return None
        if {"pair", "photos"} & {*made_from.differences(MadeFrom.of(photos.photos))}:
            return None
    return photos if all(one.file and one.path.is_file() for one in photos.photos) else None


def holds_photos(path: Path) -> bool:
    """Whether a file holds a pair or a set, by its name."""
    return path.name.endswith((".pair.json", ".photos.json"))


def _parallax(
    photos: Sequence[Photo], reliefs: Sequence[FloatArray], difference: ReliefMap
) -> FloatArray:
    """Return by how many pixels of the map the change moves any two photos' pictures apart."""
    places = difference.plane_positions()
    shifts = []
    for photo in photos:
        away = places - photo.nadir
        before, after = (
            away * (r / (photo.distance - r))[..., None] for r in reliefs
        )  # e = r R / (d - r)
        shifts.append(after - before)
    apart = [np.linalg.norm(one - shifts[0], axis=-1) for one in shifts[1:]]
    return np.asarray(np.nan_to_num(np.max(apart, axis=0)) / difference.gsd)
