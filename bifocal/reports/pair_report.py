"""From what is known of pairs to the blocks of a report, in the order a reader needs them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from bifocal.media import media_words
from bifocal.model import (
    MISFITS,
    TOLD,
    ControlResidual,
    Photo,
    Quality,
    ReliefMap,
    doubts_of,
    pinhole,
    untold,
)
from bifocal.remarks import in_language
from bifocal.reports import figures
from bifocal.reports.accuracy import accuracy_blocks, millimetres
from bifocal.reports.content import PairContent
from bifocal.reports.lens_section import lens_blocks
from bifocal.reports.project_section import camera_rows, processing_blocks, project_blocks
from bifocal.reports.refraction import refraction_blocks
from bifocal.reports.worked_point import method_blocks
from bifocal.survey import RULES, refraction_remarks
from photocore.camera import angles_from_rotation
from photocore.reports import (
    Block,
    Document,
    Heading,
    Paragraph,
    Picture,
    TextTable,
    Words,
    dated_document,
    provenance_blocks,
    words_of,
)

#: Relief less precise than this is drawn as the area of uncertainty where no scale was asked for;
#: else what a line of 0.18 mm covers at that scale. [m]
_UNCERTAIN = 0.01


def report_document(contents: Sequence[PairContent], language: str) -> Document:
    """Return the report of one or several pairs."""
    say = words_of("bifocal.reports", language)
    title = contents[0].title if len(contents) == 1 else say("report")
    return dated_document(title, language, say, _all_blocks(contents, say))


def _all_blocks(contents: Sequence[PairContent], say: Words) -> Iterator[Block]:
    for content in contents:
        if len(contents) > 1:
            yield Heading(text=content.title, level=1)
        yield from pair_blocks(content, say)


def pair_blocks(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield the part of one pair: accuracy first."""
    yield from project_blocks(content, say)
    yield Heading(text=say("accuracy"))
    yield from accuracy_blocks(content, say)
    if content.ortho is not None:
        yield Heading(text=say("overview"))
        draw = partial(figures.draw_ortho, content=content)
        ratio = figures.ratio_of(content.ortho[1])
        caption = say("overview_caption", gsd=millimetres(content.ortho_gsd))
        if content.ortho_basis:
            caption += " " + say("overview_basis", **content.ortho_basis)
        yield Picture(draw=draw, ratio=ratio, caption=caption)
    yield from _geometry(content, say)
    yield from lens_blocks(content, say)
    yield from _photos(content, say)
    yield from _ties(content, say)
    yield from _relief(content, say)
    yield from _residuals(content, say)
    yield from _foundations(content, say)
    yield from method_blocks(content, say)
    yield from processing_blocks(content, say)
    yield from _provenance(content, say)


def _geometry(content: PairContent, say: Words) -> Iterator[Block]:
    yield Heading(text=say("geometry"))
    photos, language = content.cameras, content.task.language
    deviations = content.deviations

    rows: list[list[str]] = []

    def add(key: str, *cells: str) -> None:
        rows.append([say(key), *cells, *[""] * (len(photos) - len(cells))])

    add("file", *(Path(photo.file).name or "-" for photo in photos))
    rows += camera_rows(content, say)
    spreads = [_spread(deviation.get("distance"), 3) for deviation in deviations]
    add("distance", *(f"{p.distance:.3f}{s} m" for p, s in zip(photos, spreads, strict=True)))
    spreads = [_spread(deviation.get("nadir"), 3) for deviation in deviations]
    places = zip(photos, spreads, strict=True)
    add("nadir", *(f"{photo.nadir[0]:.3f}, {photo.nadir[1]:.3f}{s} m" for photo, s in places))
    add("angles", *map(_angles, photos, [deviation.get("tilt_deg") for deviation in deviations]))
    if focal := content.setup.get("focal_px"):
        pitches = [photo.pixel_size for photo in photos]
        sigmas = [deviation.get("focal_px") for deviation in deviations]
        add("focal_found", *map(_focal, map(float, focal), pitches, sigmas))
        sources = content.setup.get("interior", ("-",) * len(photos))
        add("focal_given", *(in_language(str(source), language) for source in sources))
    if content.photos:
        add("gsd", *(millimetres(shown.photo.gsd(shown.size)) for shown in content.photos))
        add("tilt", *(f"{_tilt(shown.photo):.2f}°" for shown in content.photos))
    if layers := content.pair.layers:
        add("media", media_words(layers))
        add("z0", *(f"{photo.z0 or 0.0:.3f} m" for photo in photos))
    if content.of_set is None:
        add("base_media" if layers else "base", f"{content.pair.base_factor:.2f} m")
    yield TextTable(headings=[say("quantity"), *content.names(say)], rows=rows)
    yield from refraction_blocks(content, say)
    for sentence in content.setup.get("words", ()):
        yield Paragraph(text=in_language(str(sentence), language), small=True)
    draw = partial(figures.draw_plan, content=content, say=say)
    yield Picture(draw=draw, ratio=figures.plan_ratio(content), caption=say("plan_caption"))


def _spread(sigma: float | None, digits: int) -> str:
    return f" ± {sigma:.{digits}f}" if isinstance(sigma, int | float) else ""


def _angles(photo: Photo, sigma: float | None) -> str:
    """Return omega, phi, kappa of a camera, and the standard deviation of the first two."""
    turn = pinhole(photo).rotation.T @ np.diag([1.0, -1.0, -1.0])  # from a camera that looks back
    angles = np.rad2deg(angles_from_rotation(turn))
    return "{:.2f}°, {:.2f}°, {:.2f}°".format(*angles) + _spread(sigma, 2)


def _tilt(photo: Photo) -> float:
    """Return the angle between the wall's normal and the axis of a camera. [deg]"""
    return float(np.rad2deg(np.arccos(min(1.0, abs(pinhole(photo).rotation[2, 2])))))


def _focal(pixels: float, pitch: float | None, sigma: float | None) -> str:
    length = f" ({pixels * pitch:.2f} mm)" if pitch else ""
    return f"{pixels:.1f}{_spread(sigma, 1)} px{length}"


def _photos(content: PairContent, say: Words) -> Iterator[Block]:
    if content.photos:
        yield Heading(text=say("photos"))
    for number, photo in enumerate(content.photos, start=1):
        yield Picture(
            draw=partial(figures.draw_photo, content=content, seen=photo, number=number),
            ratio=min(1.2, photo.picture.shape[0] / photo.picture.shape[1]),
            caption=say(
                "photo_caption",
                photo=content.names(say)[number - 1],
                file=Path(photo.photo.file).name,
            ),
        )


def _ties(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield where the ties lie, how much of the photos they cover, and their residuals."""
    ties = content.setup.get("common_points", {})
    cells = ties.get("cells")
    if not cells or not content.photos:
        return
    yield Heading(text=say("ties"))
    shares = (
        len(one["rows"]) / float(np.prod(np.ceil(np.divide(photo.size, one["side"]))))
        for one, photo in zip(cells, content.photos, strict=True)
    )
    far, near = (f"{share:.0%}" for share in shares)
    lengths = {key: f"{ties[key]:.2f} px" for key in ("rms_px", "largest_px")}
    yield Paragraph(text=say("ties_said", n=ties["count"], far=far, near=near, **lengths))
    ratio = max(photo.size[1] / photo.size[0] for photo in content.photos)
    draw = partial(figures.draw_ties, content=content, say=say)
    yield Picture(draw=draw, ratio=min(0.47 * ratio + 0.06, 0.6), caption=say("ties_caption"))


def _relief(content: PairContent, say: Words) -> Iterator[Block]:
    if content.relief is None:
        return
    relief = content.relief
    unknown = float((relief.quality == Quality.UNKNOWN).mean())
    measured = float(np.isin(relief.quality, TOLD).mean()) / max(1.0 - unknown, 1e-9)
    parts = {"measured": measured, "guessed": 1.0 - measured, "unknown": unknown}
    shares = {name: f"{share:.0%}" for name, share in parts.items()}
    yield Heading(text=say("relief_map"))
    ratio = figures.ratio_of(relief.bounds)
    draw = partial(figures.draw_relief, content=content, say=say)
    yield Picture(draw=draw, ratio=ratio, caption=say("relief_caption", **shares))
    yield Paragraph(text=_density(relief, say))
    if content.task.view is not None:
        view = content.task.view
        yield Paragraph(text=say("view_link", file=view.name), link=view)
    scale = content.task.scale
    limit = (RULES[0].tolerance(round(scale)) if scale else None) or _UNCERTAIN
    draw = partial(figures.draw_sigma, content=content, say=say, limit=limit)
    caption = say("sigma_caption", limit=millimetres(limit))
    yield Picture(draw=draw, ratio=ratio, caption=caption)


def _density(relief: ReliefMap, say: Words) -> str:
    """Return in words how large the map is, and how densely it is measured."""
    pixel = float(np.sqrt(abs(np.linalg.det(relief.plane_from_pixel[:2, :2]))))
    covered = int((relief.quality != Quality.UNKNOWN).sum())
    measured = float((relief.quality == Quality.MEASURED).sum())
    return say(
        "density", pixel=millimetres(pixel), area=f"{covered * pixel**2:.1f}",
        all=f"{pixel**-2:.0f}", measured=f"{measured / max(covered, 1) * pixel**-2:.0f}",
    )  # fmt: skip


def _residuals(content: PairContent, say: Words) -> Iterator[Block]:
    control = content.setup.get("control", ())
    compared = content.solution is not None and np.isfinite(content.solution.check.errors).any()
    if control or compared:
        yield Heading(text=say("residuals"))
    if compared:
        axes = figures.compared_axes(content)
        key = "vector_caption" if {"X", "Y"} & {*axes} else "relief_errors_caption"
        draw = partial(figures.draw_errors, content=content, say=say)
        ratio = figures.ratio_of(figures.error_bounds(content))
        caption = say(key, zoom=f"{figures.error_zoom(content):g}")
        yield Picture(draw=draw, ratio=ratio, caption=caption)
        draw = partial(figures.draw_histogram, content=content, say=say)
        caption = say("histogram_caption", axes=", ".join(axes))
        yield Picture(draw=draw, ratio=0.3, caption=caption)
    if control:
        of_set = content.of_set is not None
        shown = ("ΔX", "ΔY", "Δr") if of_set else ("Δcol1", "Δrow1", "Δcol2", "Δrow2")
        headings = [say("point"), *shown, "test", say("used")]
        rows = [_control_row(row, say) for row in control]
        caption = say("control_off" if of_set else "control_table")
        yield TextTable(headings=headings, rows=rows, caption=caption)
    yield from _lengths(content, say)


def _control_row(row: ControlResidual, say: Words) -> list[str]:
    values = row.get("residual_px") or [v and 1000 * v for v in row["off"]]
    residuals = [f"{v:.2f}" if isinstance(v, int | float) else "-" for v in values]
    test = row.get("test")
    shown = f"{test:.1f}" if isinstance(test, int | float) else "-"
    return [str(row["id"]), *residuals, shown, say("holds" if row.get("used") else "fails")]


def _lengths(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield the lengths taped between control points beside what the points measured give."""
    taped = content.setup.get("lengths", ())
    if not taped or content.solution is None:
        return
    table = content.solution.table
    places = dict(zip(table.ids, table.xyz, strict=True))
    rows = []
    for one in taped:
        if not {one["from"], one["to"]} <= places.keys():
            continue
        solved = float(np.linalg.norm(places[one["from"]] - places[one["to"]]))
        off = 1000 * (solved - one["length"])
        rows.append(
            [f"{one['from']} - {one['to']}", f"{one['length']:.4f}", f"{solved:.4f}", f"{off:.1f}"]
        )
    headings = [say("length"), say("taped"), say("found"), say("error_mm")]
    yield TextTable(headings=headings, rows=rows, caption=say("length_table"))


def _foundations(content: PairContent, say: Words) -> Iterator[Block]:
    yield Heading(text=say("rests"))
    setup = content.setup
    if not setup:
        yield Paragraph(text=say("rest_unknown"))
    else:
        ties = setup.get("common_points", {})
        sigma = ties.get("sigma_px")
        shown = "-" if sigma is None else f"{sigma:.2f} px"
        counts = {"control": len(content.control_ids), "ties": ties.get("count", 0)}
        yield Paragraph(text=say("rest_measured", sigma=shown, **counts))
        deviations: Mapping[str, float] = (
            {} if content.of_set is not None else setup.get("standard_deviations", {})
        )

        def share(key: str) -> str:
            value = deviations.get(key)
            return "-" if value is None else f"{100 * value:.2g} %"

        d1, d2 = (millimetres(deviations.get(key)) for key in ("distance1", "distance2"))
        scale, relief = share("scale"), share("relief_scale")
        if deviations:
            yield Paragraph(text=say("rest_sigma", d1=d1, d2=d2, scale=scale, relief=relief))
        assumed = [str(text) for text in setup.get("assumed", ())]
        for text in assumed:
            what = in_language(text, content.task.language)
            yield Paragraph(text=say("rest_assumed", what=what))
        if not assumed:
            yield Paragraph(text=say("rest_nothing"))
    remarks = [*content.pair.remarks, *(content.solution.remarks if content.solution else ())]
    if content.solution is not None:  # told with the geometry, in the language of the report
        elsewhere = refraction_remarks(content.solution.pair, content.solution.points)
        remarks = [remark for remark in remarks if remark not in elsewhere]
    # What does not fit heads the report; a solution tells the doubts of its pair with their file.
    head = tuple(doubts_of(MISFITS, content.pair.remarks))
    remarks = [remark for remark in untold((), remarks) if not remark.endswith(head)]
    if remarks:
        yield Heading(text=say("remarks"), level=3)
        for remark in remarks:
            yield Paragraph(text=in_language(remark, content.task.language), small=True)


def _provenance(content: PairContent, say: Words) -> Iterator[Block]:
    task = content.task
    files = [content.source, *(photo.path for photo in content.cameras if photo.file)]
    files += [path for path in (task.control, task.check, task.relief, task.ortho) if path]
    return provenance_blocks(say, files)
