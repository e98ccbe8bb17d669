"""Where a survey comes from: what was measured, and the geometry it was measured with."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from bifocal.matching import Matches
from bifocal.media import MediaOfPhoto
from bifocal.model import SET_FORMAT, Lens, Pair, Photo, PhotoSet
from bifocal.remarks import remark
from bifocal.survey import (
    PointObservations,
    SurveyInput,
    SurveySetup,
    refuse_far_stations,
    with_measured,
)
from bifocal.workbook.reading.known_lists import read_long
from bifocal.workbook.reading.pick_lists import joined, left_over, read_picks
from bifocal.workbook.reading.reader import ReadOptions, read_survey
from photocore.errors import GeometryError, InputError, WorkbookError
from photocore.jsonfile import read_object

Lists = tuple[Path | str, Path | str]
Source = Path | str | PointObservations | SurveyInput | Matches | Mapping[str, object] | Lists
#: Files that are workbooks, and so no pair files.
BOOKS = (".xlsx", ".xlsm", ".ods")


def measured(
    source: Source,
    options: ReadOptions,
    unit: str | None,
    photos: PhotoSet | Pair | Path | str | None,
) -> tuple[SurveyInput, Path]:
    """Return what was measured, and the file it stands in.

    A table with a row a photo is told by what these photos are called.
    """
    if isinstance(source, tuple):
        first, second = (read_picks(path, options.decimal) for path in source)
        survey = SurveyInput.of_points(joined(first, second, unit))
        where = f"{first.file.name}, {second.file.name}"
        survey = replace(
            survey,
            setup=replace(survey.setup, where=where),
            remarks=tuple(left_over(first, second)),
        )
        return survey, first.file
    if isinstance(source, Matches):
        source = source.columns
    if isinstance(source, Mapping):
        source = PointObservations.from_columns(source)
    if isinstance(source, PointObservations):
        source = SurveyInput.of_points(source)
    if isinstance(source, SurveyInput):
        return source, Path(source.table.file)
    if not isinstance(source, Path | str):
        raise InputError(remark("survey.no_source", kind=type(source).__name__))
    try:
        return read_survey(source, options), Path(source)
    except WorkbookError:
        raise
    except InputError:
        long = read_long(source, _called(photos), options.decimal)
        if long is None:
            raise
    setup = replace(long.setup, where=Path(source).name)
    return replace(long, setup=setup), Path(source)


def _called(photos: PhotoSet | Pair | Path | str | None) -> list[tuple[str, ...]]:
    """Return what each photo may be called in a list: its file, its name, its number."""
    files: tuple[str, ...] = ("", "")
    names: tuple[str, ...] = ("far", "near")
    if isinstance(photos, Path | str) and Path(photos).suffix.lower() in BOOKS:
        setup = read_survey(photos).setup
        files = (setup.photo1, setup.photo2)
    elif isinstance(photos, Path | str):
        photos = Pair.read(photos)
    if isinstance(photos, Pair):
        files = (photos.image1.file, photos.image2.file)
    if isinstance(photos, PhotoSet):
        files = tuple(photo.file for photo in photos.photos)
        names = tuple(photos.names)
    return [
        (name, file, str(number), f"photo {number}")
        for number, (name, file) in enumerate(zip(names, files, strict=True), start=1)
    ]


def set_or_pair(
    source: PhotoSet | Pair | Path | str | None,
) -> tuple[PhotoSet | None, Pair | Path | str | None]:
    """Return a set of more than two photos, or what is a pair's; a set of two is one."""
    photos = source if isinstance(source, PhotoSet) else None
    if isinstance(source, Path | str) and Path(source).suffix.lower() == ".json":
        is_set = read_object(source, what="pair file").get("format") == SET_FORMAT
        photos = PhotoSet.read(source) if is_set else None
    if photos is None or len(photos) > 2:
        return photos, None if photos else source  # type: ignore[return-value]
    return None, Pair.from_dict(photos.to_dict(), folder=photos.folder)


def set_up(
    survey: SurveyInput,
    pair: Pair | Path | str | None,
    settings: Mapping[str, object],
    options: ReadOptions,
) -> tuple[SurveyInput, Pair | Path | str | None]:
    """Return the points with the set-up that holds for them, and the pair where it is not that."""
    if isinstance(pair, Path | str) and Path(pair).suffix.lower() in BOOKS:
        survey, pair = _with_setup_of(Path(pair), survey, options.given), None
    setup = survey.setup.but(**{"unit": survey.unit or survey.setup.unit, **settings})
    if not len(survey.points):
        raise InputError(f"{survey.where}: there is no point. Fill in the measured points.")
    if pair is None:
        refuse_far_stations(setup.taking.d1, setup.taking.d2, setup.where, options=settings)
    return replace(survey, setup=setup), pair


def _with_setup_of(path: Path, survey: SurveyInput, settings: Collection[str]) -> SurveyInput:
    """Return measured points with the set-up, check and control points of a survey workbook."""
    book = read_survey(path, ReadOptions(given=settings))
    setup = book.setup
    if setup.pair_file:
        setup = replace(setup, pair_file=str((path.parent / setup.pair_file).resolve()))
    return replace(
        book,
        points=survey.points,
        setup=setup,
        unit=survey.unit,
        known=with_measured(book.known, survey.points),
        is_ours=False,
        table=survey.table,
        remarks=(*survey.remarks, *book.remarks),
    )


def given_pair(
    survey: SurveyInput, path: Path, pair: Pair | Path | str | None
) -> tuple[Pair | None, Path | None, list[str]]:
    """Return the pair asked for, or the one the workbook describes, its file, and remarks."""
    if isinstance(pair, Pair):
        return pair, None, list(pair.remarks)
    if pair is not None:
        stated = Pair.read(pair)
        return stated, Path(pair), [f"{pair}: {remark}" for remark in stated.remarks]
    setup = survey.setup
    named = path.parent / setup.pair_file if setup.pair_file else None
    file = named if named is not None and named.is_file() else None
    described = described_pair(setup, file, path.parent)
    if described is None:
        return None, None, []
    remarks = described.remarks
    if setup.media and not setup.refracted:
        remarks = tuple(remark for remark in remarks if not remark.startswith("layers:"))
    return described, file, [f"{setup.where}: {remark}" for remark in remarks]


def described_pair(setup: SurveySetup, file: Path | None, folder: Path) -> Pair | None:
    """Return the pair whose homographies `Setup` holds, with the lenses of its pair file.

    Where that file is not read a remark says that pixels count as free of lens distortion. Media
    are those of the workbook, where it has cells for them (`AIR` where these are blank), else
    those of the file.
    """
    taking = setup.taking
    if setup.matrices is None or taking.d1 is None or taking.d2 is None:
        return None
    lenses: list[Lens | None] = [None, None]
    sizes: list[tuple[int, int] | None] = [None, None]
    orientation, remarks, extra = None, list[str](), dict[str, object](setup=None)
    media: list[MediaOfPhoto] = [{}, {}]
    if setup.media:
        media = [setup.media.through(number) for number in (1, 2)]
    if setup.pair_file and file is None:
        remarks.append(remark("survey.no_lens", file=setup.pair_file))
    if file is not None:
        try:
            stated = Pair.read(file)
            extra = {"setup": stated.extra.get("setup")}
            lenses = [stated.image1.lens, stated.image2.lens]
            sizes = [stated.image1.image_size, stated.image2.image_size]
            if not setup.media or setup.media.layers == stated.layers:
                orientation = stated.orientation  # it may count the media too
            if not setup.media:
                media = [
                    MediaOfPhoto(layers=p.layers, z0=p.z0, interface_normal=p.interface_normal)
                    for p in (stated.image1, stated.image2)
                ]
        except (InputError, GeometryError) as error:
            remarks.append(remark("survey.lens_unusable", file=setup.pair_file, why=error))
    photos = [
        Photo(
            plane_from_pixel=matrix, nadir=nadir, distance=d, lens=lens, principal_distance=c,
            image_size=size, **through,
        )
        for matrix, nadir, d, lens, c, size, through in zip(
            setup.matrices, setup.nadirs, (taking.d1, taking.d2), lenses, (taking.c1, taking.c2),
            sizes, media, strict=True,
        )
    ]  # fmt: skip
    return Pair(
        image1=photos[0], image2=photos[1], folder=folder, orientation=orientation,
        remarks=tuple(remarks), extra=extra,
    )  # fmt: skip
