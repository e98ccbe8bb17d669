"""Photos of one wall in, the file of their set and the lens files it needs out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bifocal.model import PhotoSet, world_entry
from bifocal.networks.set_alignment import SetAlignment, set_alignment
from bifocal.networks.set_orientation import orient_set
from bifocal.orientation import PhotoInput
from bifocal.orientation.align_workflow import (
    AlignOptions,
    aligned_photos,
    check_metres,
    control_of,
    interior_of_photo,
    lengths_checked,
    way_of,
)
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.images import image_info, read_grey
from photocore.output import all_or_none, check_all_writable, check_not_input, relative_name

#: How the file of a set ends.
ENDING = ".photos.json"


def way_of_set(options: AlignOptions) -> tuple[str, AlignOptions]:
    """Return which way into the file of a set the options describe; refuse what is of a pair."""
    if options.media or options.as_set_up:
        option = "--as-set-up" if options.as_set_up else "--indices"
        raise InputError(f"{option}: is of two photos; align them in pairs and leave it out here.")
    return way_of(options)


@all_or_none()
def align_photo_set(
    paths: Sequence[Path],
    out: Path,
    options: AlignOptions,
    *,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> SetAlignment:
    """Set photos of one wall up together, write their file (and lens files), return the set.

    Raises
    ------
    InputError, GeometryError
        If files or options are at fault, or the photos do not make a set.
    """
    if not out.name.lower().endswith(ENDING):
        raise InputError(
            f"{out.name}: the file of a set of photos ends in {ENDING}; write --out "
            f"{out.name.partition('.')[0]}{ENDING}, or give two photos for a pair file."
        )
    twice = [path for k, path in enumerate(paths) if path.resolve() in
             {earlier.resolve() for earlier in paths[:k]}]  # fmt: skip
    if twice:
        raise InputError(f"{twice[0]}: was given twice; name each photo once.")
    check_metres(options)
    check_not_input(out, *paths, *(path for path in (options.control, options.lengths) if path))
    check_all_writable(out, overwrite=overwrite)
    if len(paths) == 2:
        pair = aligned_photos(paths[0], paths[1], out, options, overwrite=overwrite)
        alignment = SetAlignment.of_pair(pair)
        alignment.photos.write(out, overwrite=overwrite)
        return alignment
    way, options = way_of_set(options)
    names = [path.name for path in paths]
    if alike := len({path.stem for path in paths}) < len(paths):  # as cameras count in each folder
        names = [f"{path.resolve().parent.name}/{path.name}" for path in paths]
    infos = [image_info(path) for path in paths]
    lenses = [*options.lenses, *[options.other_lenses] * (len(paths) - 2)]
    # As the options of their lenses are called:
    numbers: list[int | str] = [1, 2, *[""] * (len(paths) - 2)]
    photos = [
        PhotoInput(grey=read_grey(path), interior=interior_of_photo(info, lens, k), name=name)
        for k, path, name, info, lens in zip(numbers, paths, names, infos, lenses, strict=True)
    ]
    sizes = [photo.interior.image_size for photo in photos]
    control = control_of(options, sizes, [str(path) for path in paths])
    oriented = orient_set(photos, control=control, site=options.site, progress=progress)
    alignment = set_alignment(replace(oriented, way=way), photos, options.direction)
    setup, wrong = lengths_checked(alignment.setup, alignment.photos, options)
    remarks = (*wrong, *control.remarks, *alignment.remarks)
    alignment = replace(alignment, setup=setup, remarks=remarks)
    stem = out.name[: -len(ENDING)]
    entries = []
    for k, (path, name, photo) in enumerate(
        zip(paths, names, alignment.photos.photos, strict=True)
    ):
        extra = dict(photo.extra)
        if photo.lens is not None:
            shared = oriented.first.lens[k]
            extra["lens"] = lens = f"{stem}.lens{shared + 1}.json"
            if shared == k:
                photo.lens.write(out.parent / lens, overwrite=overwrite)
        file = relative_name(path, out.parent)
        entries.append(replace(photo, file=file, name=name if alike else "", extra=extra))
    photo_set = PhotoSet(
        photos=tuple(entries),
        orientation=alignment.photos.orientation,
        extra={"setup": alignment.setup, **world_entry(control.frame)},
    )
    photo_set.write(out, overwrite=overwrite)
    return replace(alignment, photos=photo_set)


def set_as_dict(alignment: SetAlignment) -> dict[str, Any]:
    """Return the alignment of a set as plain data for ``--json``."""
    return {
        "way": alignment.way,
        "photos": [
            {"name": photo.name, "distance": photo.distance, "nadir": photo.nadir, **spread}
            for photo, spread in zip(alignment.photos.photos, alignment.deviations, strict=True)
        ],
        **{key: alignment.setup[key] for key in ("common_points", "sigma0", "assumed")},
        "control": alignment.setup.get("control", []),
        "lengths": alignment.setup.get("length_checks", []),
        "words": alignment.words,
        "remarks": alignment.remarks,
    }
