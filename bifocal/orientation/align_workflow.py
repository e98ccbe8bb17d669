"""Two photos in, a pair file, its lens files and a picture out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.files import NOMINAL, judged_focal, middle_aside, read_greys, sensors_apart
from bifocal.model import (
    FARTHEST_WALL,
    Diagnostics,
    Interior,
    Lens,
    PairMedia,
    PhotoSet,
    WorldFrame,
    check_in_set,
    disagreement,
    lens_of_photo,
    rests_on,
    world_entry,
)
from bifocal.orientation.absolute_orientation import orient_pair
from bifocal.orientation.alignment import Alignment, make_alignment, with_files
from bifocal.orientation.alignment_picture import write_alignment_picture
from bifocal.orientation.as_set_up import pair_as_set_up
from bifocal.orientation.control_points import Control, SiteMeasures, read_control, read_lengths
from bifocal.orientation.media_options import media_of
from bifocal.orientation.orientation_stages import PhotoInput
from bifocal.orientation.tuning import CONTROL
from bifocal.remarks import remark
from photocore.arrays import FloatArray, positive
from photocore.errors import InputError
from photocore.images import WRITTEN, ImageInfo, image_info
from photocore.output import (
    all_or_none,
    check_all_writable,
    check_ending,
    check_not_input,
    relative_name,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownLens:
    """What is known of one photo's lens; None where the EXIF data are to be used.

    Attributes
    ----------
    lens : Path or None
        Lens file.
    focal : float or None
        Focal length. [mm]
    pixel_size, sensor_width : float or None
        Either turns millimetres into pixels. [mm]
    """

    lens: Path | None = None
    focal: float | None = None
    pixel_size: float | None = None
    sensor_width: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignOptions:
    """What `align` is told besides the photos.

    Attributes
    ----------
    lenses : pair of KnownLens
    other_lenses : KnownLens
        Of the third photo of a set and those that follow.
    site : SiteMeasures
    auto : bool
    as_set_up : bool
        Whether the distances and focal lengths are taken exactly as they are.
    one_lens : bool
        Whether one lens took both photos, whose focal length the photos are to tell where nothing
        else does.
    columns : str or None
        Which column of the control table is which.
    control, lengths : Path or None
        Tables of control points and of taped lengths.
    length : tuple of (pixels (4,), metres)
        Lengths between two points of the far photo on the wall: the first helps to give the scale,
        where anything has to; the others check.
    line : (pixels (4,), is_vertical) or None
        A level or upright line of the wall in the far photo.
    unit : str
        Unit of the control coordinates; empty: as the headings say, else metres.
    media : PairMedia
        What lies between cameras and wall.
    world : WorldFrame or None
        Where X, Y, r of the control table lie.
    """

    lenses: tuple[KnownLens, KnownLens] = field(default_factory=lambda: (KnownLens(), KnownLens()))
    other_lenses: KnownLens = field(default_factory=KnownLens)
    site: SiteMeasures = field(default_factory=SiteMeasures)
    auto: bool = False
    as_set_up: bool = False
    one_lens: bool = False
    columns: str | None = None
    control: Path | None = None
    lengths: Path | None = None
    length: tuple[tuple[tuple[float, ...], float], ...] = ()
    line: tuple[tuple[float, ...], bool] | None = None
    unit: str = ""
    media: PairMedia = field(default_factory=PairMedia.none)
    world: WorldFrame | None = None

    @property
    def direction(self) -> tuple[FloatArray, bool] | None:
        """The line's ends in the far photo, shape (2, 2), and whether it is upright."""
        return self.line and (np.array(self.line[0], np.float64).reshape(2, 2), self.line[1])

    @property
    def checking(self) -> dict[str, tuple[FloatArray, float]]:
        """The lengths that check, by their numbers: ends, shape (2, 2) [px], and metres."""
        return {
            str(number): (np.array(pixels, np.float64).reshape(2, 2), metres)
            for number, (pixels, metres) in enumerate(self.length, start=1)
            if number > 1 or self.as_set_up
        }

    @classmethod
    def from_given(cls, given: Mapping[str, Any]) -> AlignOptions:
        """Return the options of a mapping with the names of the command's; absent ones unknown."""
        lenses = tuple(
            KnownLens(
                **{
                    name: given.get(f"{name}{number}") or given.get(name)
                    for name in ("lens", "focal", "pixel_size", "sensor_width")
                }
            )
            for number in (1, 2, "")
        )
        site = ("distance1", "distance2", "delta_d", "sigma_control", "sigma_pick", "wall")
        measures = {name: given[name] for name in site if given.get(name) is not None}
        if given.get("sigma_distance") is not None:
            measures["sigma"] = given["sigma_distance"]
        horizontal, vertical = given.get("horizontal"), given.get("vertical")
        line = horizontal or vertical
        return cls(
            lenses=(lenses[0], lenses[1]),
            other_lenses=lenses[2],
            site=SiteMeasures(**measures),
            auto=bool(given.get("auto")),
            as_set_up=bool(given.get("as_set_up")),
            one_lens=bool(given.get("one_lens")),
            columns=given.get("columns"),
            control=given.get("control"),
            lengths=given.get("lengths"),
            length=tuple((tuple(one[:4]), one[4]) for one in given.get("length") or ()),
            line=(tuple(line), horizontal is None) if line else None,
            unit=given.get("unit") or "",
            media=media_of(given),
        )


@all_or_none()
def align_photos(
    far: Path,
    near: Path,
    out: Path,
    options: AlignOptions,
    *,
    picture: Path | None = None,
    overwrite: bool = False,
) -> Alignment:
    """Set a pair up, write the pair file (and lens files it needs, and the picture), return it.

    Raises
    ------
    InputError, GeometryError
        If files or options are at fault, or the photos do not make a pair.
    """
    if out.suffix.lower() != ".json":
        raise InputError(remark("align.pair_ending", of=out.name, stem=out.stem))
    alignment = aligned_photos(far, near, out, options, picture=picture, overwrite=overwrite)
    alignment.pair.write(out, overwrite=overwrite)
    return alignment


def aligned_photos(
    far: Path,
    near: Path,
    out: Path,
    options: AlignOptions,
    *,
    picture: Path | None = None,
    overwrite: bool = False,
) -> Alignment:
    """Return the pair as `align_photos`, with all files written but its own, ``out``."""
    check_ending(picture, "a picture is written as .png, .jpg or .tif.", *WRITTEN)
    way, options = way_of(options)
    check_metres(options)
    check_not_input(picture, far, near)
    check_all_writable(out, picture, overwrite=overwrite)
    infos = image_info(far), image_info(near)
    greys = read_greys(far, near, in_water=bool(options.media))
    interiors = [
        interior_of_photo(info, lens, number)
        for number, (info, lens) in enumerate(zip(infos, options.lenses, strict=True), start=1)
    ]
    interiors = judged_together(infos, interiors)
    if options.one_lens and all(interior.is_assumed for interior in interiors):
        interiors = [Interior.sought(info.size) for info in infos]
    first, second = (
        PhotoInput(grey=grey, interior=interior, name=info.path.name)
        for info, interior, grey in zip(infos, interiors, greys, strict=True)
    )
    reading: tuple[str, ...] = ()
    if way == "as set up":
        oriented = pair_as_set_up((first, second), options.site, options.media)
    else:
        if way == "site" and not options.auto and not options.length:
            _check_focal((first, second))
        control = control_of(
            options, (first.interior.image_size, second.interior.image_size), (str(far), str(near))
        )
        reading = control.remarks
        oriented = orient_pair(
            (first, second), control=control, site=options.site, media=options.media
        )
    paths, ordered = (far, near), (first, second)
    if oriented.exchanged:
        paths, ordered = (near, far), (second, first)
    alignment = make_alignment(oriented, ordered, way=way, direction=options.direction)
    alignment = replace(alignment, remarks=(*reading, *alignment.remarks))
    extra = {
        **alignment.pair.extra,
        **world_entry(None if oriented.observations.free_datum else oriented.frame),
    }
    alignment = replace(alignment, pair=replace(alignment.pair, extra=extra))
    if picture is not None:
        images = [photo.grey for photo in ordered if photo.grey is not None]
        write_alignment_picture(picture, alignment, (images[0], images[1]), overwrite=overwrite)
    names = (relative_name(paths[0], out.parent), relative_name(paths[1], out.parent))
    lenses = _write_lenses(alignment, out, overwrite=overwrite)
    setup, wrong = lengths_checked(
        alignment.setup, PhotoSet.from_pair(alignment.pair), options,
        photo=2 if oriented.exchanged else 1,
    )  # fmt: skip
    alignment = replace(alignment, setup=setup, remarks=(*wrong, *alignment.remarks))
    return with_files(alignment, names, lenses)


def alignment_as_dict(alignment: Alignment) -> dict[str, object]:
    """Return an alignment as plain data for ``--json``."""
    pair = alignment.pair
    return {
        "way": alignment.way,
        "distance1": pair.image1.distance,
        "distance2": pair.image2.distance,
        "nadir1": pair.image1.nadir,
        "nadir2": pair.image2.nadir,
        "zoom_centre": pair.zoom_centre,
        **{
            key: alignment.setup[key]
            for key in ("standard_deviations", "focal_px", "common_points", "assumed", "sigma0")
        },
        "control": alignment.setup.get("control", []),
        "lengths": alignment.setup.get("length_checks", []),
        "rests_on": basis(alignment),
        "words": alignment.words,
        "remarks": alignment.remarks,
    }


#: What gives the scale of relief, by the way into the pair file.
_SCALES = {
    "control": "control points and tapes as precise as stated",
    "site": "distances as taped",
    "as set up": "distances, focal lengths and nadir points as typed",
    "auto": "one measure taped",
}


def basis(alignment: Alignment) -> str:
    """Return in one line what the precision of an alignment rests on."""
    ties = alignment.setup["common_points"]
    picks = "no common points"
    if ties["count"]:
        picks = f"{ties['count']} common points of {ties['sigma_px']:.2f} px, measured"
    assumed = "; ".join(alignment.setup["assumed"])
    return rests_on(
        alignment.pair, setup=_SCALES[alignment.way], picks=picks,
        more=f"assumed: {assumed}" if assumed else "",
    )  # fmt: skip


def check_way(options: AlignOptions) -> None:
    """Check that the options describe a way into the pair file, before any photo is read.

    Raises
    ------
    InputError
        Naming what is missing.
    """
    way_of(options)


def way_of(options: AlignOptions) -> tuple[str, AlignOptions]:
    """Return which way into the pair file the options describe."""
    site = options.site
    measured = [value for value in (site.distance1, site.distance2, site.delta_d) if value]
    if site.distance1 and site.distance2 and site.delta_d:
        raise InputError("give two of --distance1, --distance2 and --delta-d; the third follows.")
    if options.media and not (options.control or options.as_set_up or options.auto):
        raise InputError(remark("refused.through_media"))
    if options.as_set_up:
        if options.control is not None or options.auto:
            raise InputError("--as-set-up registers nothing: leave out --control and --auto.")
        return "as set up", options
    if options.control is not None:
        return "control", options
    if len(measured) >= 2:
        return "site", replace(options, site=replace(site, parallel=True))
    if options.auto:
        if not (measured or options.length or options.lengths):
            raise InputError(remark("align.auto_without_scale"))
        return "auto", options
    raise InputError(remark("align.no_way"))


def _check_focal(photos: tuple[PhotoInput, PhotoInput]) -> None:
    """Refuse a pair that only distances describe and whose lenses nobody knows."""
    if all(photo.interior.is_assumed for photo in photos):
        first, second = (photo.name for photo in photos)
        raise InputError(remark("refused.no_exif", first=first, second=second))


def check_metres(options: AlignOptions) -> None:
    """Refuse distances and lengths in millimetres; control points tell of distances themselves."""
    site = options.site
    lengths = [("--delta-d", site.delta_d), *(("--length", metres) for _, metres in options.length)]
    if options.control is None:
        lengths += [("--distance1", site.distance1), ("--distance2", site.distance2)]
    for _, metres in options.length:
        positive(metres, "--length", unit="m")
    for name, value in lengths:
        if value and value > FARTHEST_WALL:
            about = {"name": name, "value": value, "meant": value / 1000}
            raise InputError(remark("refused.length_in_mm", **about))


def interior_of_photo(info: ImageInfo, data: KnownLens, number: int | str = "") -> Interior:
    """Return the best that is known of a photo's interior orientation."""
    if data.lens is not None:
        lens = lens_of_photo(Lens.read(data.lens), info.size, orientation=info.orientation)
        return Interior.from_lens(lens, source=data.lens.name)
    pitch = data.pixel_size
    if pitch is None and data.sensor_width is not None:
        pitch = data.sensor_width / max(info.size)
    judged = judged_focal(info)
    exif = pitch or judged.pitch
    if data.focal is not None:
        pitch = exif
        if pitch is None and info.focal_length and info.focal_pixels:
            # True and equivalent focal length together tell the pixel size.
            pitch = info.focal_length / info.focal_pixels
        if pitch is None:
            about = {"number": number, "focal": data.focal, "name": info.path.name}
            raise InputError(remark("refused.no_sensor", **about))
        focal, sigma = data.focal / pitch, NOMINAL
        source = f"--focal{number} {data.focal:g} mm"
    elif info.focal_length and pitch:
        sigma, source = NOMINAL, f"EXIF, {info.focal_length:g} mm"
        focal = info.focal_length / pitch * (info.digital_zoom or 1.0)
    elif judged.focal:
        focal, sigma, pitch, source = judged.focal, judged.sigma, judged.pitch, judged.source
    else:
        return Interior.unknown(info.size)
    interior = Interior.from_focal(
        focal, image_size=info.size, sigma=sigma, source=source, pixel_size=pitch
    )
    typed, (aside, part) = data.focal is not None, middle_aside(info)
    doubts = [part, *([] if typed else [judged.doubt])]
    return replace(
        interior, is_typed=typed, doubt=" ".join(filter(None, doubts)),
        sigma_centre=max(interior.sigma_centre, aside), is_part=bool(part),
    )  # fmt: skip


def judged_together(
    infos: tuple[ImageInfo, ImageInfo], interiors: Sequence[Interior]
) -> list[Interior]:
    """Return interiors out of EXIF data, doubted where the photos contradict each other."""
    apart = sensors_apart(*infos)
    believed = [i.is_typed or i.is_calibrated or i.is_assumed for i in interiors]
    if not apart or all(believed):
        return list(interiors)
    sigma = min(apart, 0.5)  # as of a lens of which nothing is known
    doubt = remark("orientation.exif_sensors", model=infos[0].model, share=100 * sigma)
    return [
        i if sure else replace(i, sigma_focal=max(i.sigma_focal, sigma), doubt=i.doubt or doubt)
        for i, sure in zip(interiors, believed, strict=True)
    ]


def control_of(
    options: AlignOptions, sizes: Sequence[tuple[int, int]], files: Sequence[str]
) -> Control:
    """Return the control points and lengths the options name, picked in photos of these sizes."""
    control = Control()
    if options.control is not None:
        control = read_control(
            options.control,
            sigma=options.site.sigma_control,
            sigma_plane=CONTROL.sigma_on_wall,
            unit=options.unit,
            columns=options.columns,
            photos=len(sizes),
            names=files,
        )
        control = replace(control, frame=control.frame or options.world)
    if options.lengths is not None:
        if options.control is None:
            raise InputError("--lengths names points of the --control table; give that too.")
        control = read_lengths(options.lengths, control)
    if options.length:
        _check_ends(options.length[0][0], sizes[0])
        control = control.with_length(options.length[0], options.site.sigma_control)
    names = ("far", "near") if len(sizes) == 2 else [f"{k}." for k in range(1, len(sizes) + 1)]
    for pixels, size, photo in zip(control.picks, sizes, names, strict=False):
        check_inside(control.ids, pixels, size, photo)
    return control


def lengths_checked(
    setup: Diagnostics, photos: PhotoSet, options: AlignOptions, *, photo: int = 1
) -> tuple[Diagnostics, tuple[str, ...]]:
    """Return diagnostics with the lengths that check, of a photo by its number, and what is wrong.

    Their ends are in that photo, numbered from 1.
    """
    lengths, sigma = options.checking, options.site.sigma_control
    if not lengths:
        return setup, ()
    for ends, _ in lengths.values():
        _check_ends(ends, photos.photos[photo - 1].image_size)
    checks = {
        name: check_in_set(photos, photo - 1, ends, metres, sigma=sigma)
        for name, (ends, metres) in lengths.items()
    }
    entries: list[Any] = [
        {"name": name, "photo": photo, "ends": lengths[name][0], **asdict(check),
         "agrees": check.agrees}
        for name, check in checks.items()
    ]  # fmt: skip
    wrong = disagreement(checks)
    doubts = [*wrong, *setup.get("doubts", ())]
    return {**setup, "length_checks": entries, "doubts": doubts}, wrong


def _check_ends(ends: FloatArray | tuple[float, ...], size: tuple[int, int] | None) -> None:
    """Refuse a length whose ends are not both in its photo."""
    for column, row in np.reshape(np.asarray(ends, dtype=np.float64), (2, 2)).tolist():
        if size is not None and not (-0.5 <= column <= size[0] and -0.5 <= row <= size[1]):
            about = {"column": column, "row": row, "width": size[0], "height": size[1]}
            raise InputError(remark("refused.length_outside", **about))


def check_inside(ids: Sequence[str], pixels: FloatArray, size: tuple[int, int], photo: str) -> None:
    """Refuse picks outside the photo: they belong to another photo or another size."""
    width, height = size
    outside = (pixels < -0.5).any(axis=1) | (pixels > [width, height]).any(axis=1)
    if outside.any():
        name, others = ids[int(np.flatnonzero(outside)[0])], int(outside.sum()) - 1
        about = {"name": name, "photo": photo, "width": width, "height": height}
        key = f"refused.{'more_' if others else ''}outside_photo"
        raise InputError(remark(key, more=others, **about))


def _write_lenses(
    alignment: Alignment, out: Path, *, overwrite: bool
) -> tuple[str | None, str | None]:
    """Write the lens files the pair needs beside it and return their names."""
    stem = out.name.removesuffix(".json").removesuffix(".pair").removesuffix(".photos")
    names: list[str | None] = [None, None]
    for index, photo in enumerate((alignment.pair.image1, alignment.pair.image2)):
        if photo.lens is not None:
            names[index] = f"{stem}.lens{index + 1}.json"
            photo.lens.write(out.parent / f"{stem}.lens{index + 1}.json", overwrite=overwrite)
    return names[0], names[1]
