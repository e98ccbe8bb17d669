"""Both photos of a survey: their pyramids, their tiles, and what is measured in them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.collimation.fields import FieldError
from bifocal.collimation.pyramids import Pyramid, RectifiedPhoto, wall_grid
from bifocal.collimation.records import Change, Picks, Pixel
from bifocal.collimation.tile_store import TileStore
from bifocal.files import colour_strips
from bifocal.matching import radial_line, snap, suggest
from bifocal.model import Grid, Pair, Photo, RasterReader
from bifocal.remarks import remark
from photocore.arrays import ByteArray, FloatArray
from photocore.errors import InputError
from photocore.images import ImageArray, ImageInfo, image_info, read_image
from photocore.jsonfile import plain

#: Grey of what an orthophoto does not show.
EMPTY = np.uint8(190)


class Pictures:
    """The pictures of a survey.

    Parameters
    ----------
    folder : Path
        Where tiles are kept.
    photos : sequence of Path
        Far and near photo, as far as they are given, then further ones.
    pair : Pair or None
        None before they are oriented.

    Raises
    ------
    InputError, GeometryError
        If a photo or the pair is unusable.
    """

    def __init__(self, folder: Path, photos: Sequence[Path], pair: Pair | None) -> None:
        self.tiles = TileStore(folder)
        self.infos: list[ImageInfo] = []
        self.others: list[ImageInfo] = []
        self.pyramids: list[Pyramid] = []
        self.pair: Pair | None = None
        self.grid: Grid | None = None
        self.show_photos(photos[:2])
        self.show_others(photos[2:])
        if pair is not None:
            self.show_pair(pair)

    def show_photos(self, photos: Sequence[Path]) -> None:
        """Show other photos, not oriented yet."""
        infos = [image_info(path) for path in photos]
        self.infos, self.pair, self.grid = infos, None, None
        self.pyramids = [Pyramid(info.size, _reader(info.path)) for info in infos]
        for number, (info, pyramid) in enumerate(zip(infos, self.pyramids, strict=True), start=1):
            self.tiles.register(f"photo-{number}", pyramid, *_facts(info.path))
            self.tiles.forget(f"wall-{number}")

    def show_others(self, photos: Sequence[Path]) -> None:
        """Show what further photos there are, beside far and near."""
        self.others = [image_info(path) for path in photos]
        for number, info in enumerate(self.others, start=3):
            self.tiles.register(
                f"photo-{number}", Pyramid(info.size, _reader(info.path)), *_facts(info.path)
            )

    def show_pair(self, pair: Pair) -> None:
        """Show the photos on the wall, as a pair orients them."""
        if len(self.infos) != 2:
            raise InputError("a pair needs two photos.")
        for number, info in enumerate(self.infos, start=1):
            pair.photo(number).check_size(info.size, info.path)
            pair.photo(number).check_file(info.path, (pair.image1, pair.image2))
        grid = wall_grid(pair, (self.infos[0].size, self.infos[1].size))
        for number, pyramid in enumerate(self.pyramids, start=1):
            photo = pair.photo(number)
            lens = photo.lens and (
                photo.lens.camera_matrix.tolist(), photo.lens.model,
                photo.lens.coefficients.tolist(),
            )  # fmt: skip
            self.tiles.register(
                f"wall-{number}",
                RectifiedPhoto.of(photo, number, pyramid, grid),
                *_facts(self.infos[number - 1].path), photo.plane_from_pixel.tolist(), lens, grid,
                *_media_facts(photo),
            )  # fmt: skip
        self.pair, self.grid = pair, grid

    def show_ortho(self, path: Path) -> None:
        """Show an orthophoto."""
        with RasterReader(path) as file:
            size = (file.width, file.height)
        self.tiles.register(
            "ortho-0", Pyramid(size, lambda: _ortho_pixels(path)), *_facts(path), int(EMPTY)
        )

    def warm_up(self) -> None:
        """Read both photos, so that the first suggestion does not wait for it."""
        for pyramid in self.pyramids:
            pyramid.halved(0)

    def photos(self) -> tuple[ByteArray, ByteArray]:
        """Return both photos, 8 bit; they are read once.

        Raises
        ------
        InputError
            If there are no two photos yet.
        """
        if len(self.pyramids) < 2:
            raise InputError(remark("page.give_photos"))
        return self.pyramids[0].halved(0), self.pyramids[1].halved(0)

    def check_picks(self, op: str, changes: Sequence[Change]) -> None:
        """Refuse picks outside their photos."""
        sizes = [info.size for info in self.infos]
        if len(sizes) < 2 and op.endswith(".pick"):
            raise InputError(remark("page.give_photos"))
        for change in changes:
            picks: Picks = getattr(change.after, "picks", (None, None))
            for image, (pick, size) in enumerate(zip(picks, sizes, strict=False), start=1):
                if pick and not all(-0.5 <= p <= n - 0.5 for p, n in zip(pick, size, strict=True)):
                    about = {"name": change.key, "width": size[0], "height": size[1]}
                    raise FieldError(remark("page.pick_outside", image=image, **about))

    def needed_pair(self) -> Pair:
        """Return the pair.

        Raises
        ------
        InputError
            If the photos are not oriented yet.
        """
        if self.pair is None:
            raise InputError(remark("page.align_first"))
        return self.pair

    def suggest(self, image: int, pixel: Pixel) -> dict[str, object]:
        """Return where the other photo shows a pick, with the line on which it must lie."""
        suggestion = suggest(self.needed_pair(), self.photos(), image, np.array(pixel))
        return plain(
            {
                "column": suggestion.pixel[0],
                "row": suggestion.pixel[1],
                "quality": suggestion.quality,
                "score": suggestion.score,
                "sigma_px": suggestion.sigma_px,
                "misfit_px": suggestion.misfit_px,
                "kept": suggestion.kept,
                "others": [{"column": place[0], "row": place[1]} for place in suggestion.others],
                "line": self.line(image, pixel),
            }
        )

    def line(self, image: int, pixel: Pixel) -> list[list[float]]:
        """Return the line in the other photo on which a pick must lie. [px]"""
        size = self.infos[2 - image].size
        return radial_line(self.needed_pair(), image, np.array(pixel), size).tolist()

    def snap(self, image: int, pixel: Pixel, radius: float) -> dict[str, object]:
        """Return the target's centre or the corner next to a pick."""
        if image > len(self.pyramids):
            raise InputError(remark("page.give_photos"))
        return snap(self.pyramids[image - 1].halved(0), pixel, radius)._asdict()

    def convert(self, image: int, pixels: FloatArray, source: str) -> FloatArray:
        """Return pixels of a photo as pixels of the wall or back, shape (n, 2); any lens model."""
        photo, grid = self.needed_pair().photo(image), self.grid
        assert grid is not None
        if source == "photo":
            return grid.pixel_of(photo.plane_from_pixels(pixels))
        plane = np.column_stack(
            [grid.x0 + grid.gsd * pixels[:, 0], grid.y0 - grid.gsd * pixels[:, 1]]
        )
        return photo.pixels_from_plane(plane)

    def photo_from_wall(self, number: int) -> FloatArray:
        """Return the homography from wall pixels to ideal pixels of a photo, shape (3, 3)."""
        pair, grid = self.needed_pair(), self.grid
        assert grid is not None
        matrix = np.linalg.inv(pair.photo(number).plane_from_pixel) @ grid.plane_from_pixel
        return np.asarray(matrix / matrix[2, 2])


def _media_facts(photo: Photo) -> tuple[object, ...]:
    """Return what a photo on the wall depends on besides, through media."""
    if not photo.layers:
        return ()
    lean = None if photo.interface_normal is None else photo.interface_normal.tolist()
    return photo.layers.as_dict(), photo.z0, lean, photo.nadir.tolist(), photo.distance


def _reader(path: Path) -> Any:
    return lambda: read_image(path)


def _ortho_pixels(path: Path) -> ImageArray:
    """Return the colours of an orthophoto; what is empty is no black photo."""
    with RasterReader(path) as file:
        strips = [
            np.where(valid[..., None] > 0, colours, EMPTY) for colours, valid in colour_strips(file)
        ]
    return np.concatenate(strips)


def _facts(path: Path) -> tuple[str, int, int]:
    """Return what tells whether a picture is still the same."""
    facts = path.stat()
    return path.name, facts.st_size, facts.st_mtime_ns
