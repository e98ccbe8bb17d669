"""An adjustment as a report: precision first, media, unknowns, residuals, correlations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from multimedia.adjustment import report_figures as figures
from multimedia.adjustment.plausibility import alike_pairs, alike_remarks, remedy_of
from multimedia.adjustment.unknowns import Adjustment, decimals
from multimedia.media import (
    EXTERIOR,
    Cylinder,
    FlatInterface,
    Interfaces,
    Plane,
    RefractingSurface,
    Sphere,
)
from multimedia.remarks import in_language
from photocore.arrays import FloatArray
from photocore.reports import (
    Banner,
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
    write_document,
)

#: Correlations from here on are listed with what tells the unknowns apart.
STRONG = 0.9
#: More unknowns than this make a picture nobody reads; only the list is given then.
_LARGEST_PICTURE = 60
#: Cameras drawn, and rows of the longer tables.
_CAMERAS, _SUSPECTS, _POINTS = 12, 50, 200
_RAISED = str.maketrans("-12345678", "⁻¹²³⁴⁵⁶⁷⁸")


def write_adjustment_report(
    path: Path | str, result: Adjustment, *, title: str = "", language: str = "en",
    notes: tuple[str, ...] = (), overwrite: bool = False,
) -> None:  # fmt: skip
    """Write the report; no file beside it, no connection needed to read it.

    Parameters
    ----------
    path : Path or str
        ``.html`` or ``.pdf``.
    result : Adjustment
    title : str
        By default that of the project.
    language : str
        ``en``, ``it`` or ``de``.
    notes : tuple of str
        Remarks besides those of the adjustment.
    overwrite : bool

    Raises
    ------
    InputError
        If the file exists and ``overwrite`` is false, cannot be written or has another ending, or
        the language is unknown.
    """
    document = adjustment_document(result, title=title, language=language, notes=notes)
    write_document(Path(path), document, overwrite=overwrite)


def adjustment_document(
    result: Adjustment, *, title: str = "", language: str = "en", notes: tuple[str, ...] = ()
) -> Document:
    """Return the blocks of the report, in the order a reader needs them."""
    say = words_of("multimedia.adjustment", language)
    title = title or say("title", name=result.project.name or "-")
    blocks: list[Block] = []
    for part in (_precision, _media, _unknowns, _residuals, _suspects, _correlations, _points):
        blocks += part(result, say)
        if part is _precision:
            # What is alike has a section of its own.
            alike = set(alike_remarks(result))
            remarks = [text for text in (*notes, *result.remarks) if text not in alike]
            lines = [in_language(text, language) for text in remarks]
            blocks += _remarks((*lines, *([say("see_correlations")] if alike else [])), say)
    return dated_document(title, language, say, [*blocks, *provenance_blocks(say)])


def _precision(result: Adjustment, say: Words) -> Iterator[Block]:
    project, suspects = result.project, result.suspects()
    sigma = project.object_points.sigma
    free = sigma[np.linalg.norm(np.nan_to_num(sigma), axis=1) > 0]
    details = [say("no_suspects") if not suspects else say("some_suspects", count=len(suspects))]
    if len(free):
        x, y, z = (f"{v:.3g}" for v in np.sqrt(np.nanmean(free**2, axis=0)))
        details.insert(0, say("points_sigma", x=x, y=y, z=z, unit=project.unit))
    else:
        details.insert(0, say("points_fixed"))
    if result.model_error > 1:
        details.append(say("model_error", factor=f"{result.model_error:.2f}"))
    yield Paragraph(text=_model(result, say, len(free)))
    yield Heading(text=say("accuracy"))
    yield Banner(
        text=say("sigma0", sigma0=f"{result.sigma0 * 1000:.3f}"), details=tuple(details),
        good=None if not suspects else False,
    )  # fmt: skip
    yield Paragraph(
        text=say(
            "counts", images=int((result.weights[:, 0] > 0).sum()),
            cameras=len(project.cameras), unknowns=len(result.names), points=len(free),
            redundancy=result.redundancy, iterations=result.iterations,
        )
    )  # fmt: skip


def _model(result: Adjustment, say: Words, points: int) -> str:
    """Return in one sentence what was estimated and what was taken for granted."""
    poses = [name.removesuffix(":X0") for name in result.names if name.endswith(":X0")]
    plates = sum(name.startswith("plate ") for name in poses)
    terms = (name.rpartition(":")[2] for name in result.names if not name.startswith("point "))
    interior = dict.fromkeys(term for term in terms if term not in EXTERIOR)
    counted = (("orientations", len(poses) - plates), ("plate_poses", plates),
               ("free_points", points))  # fmt: skip
    estimated = [*(say(key, count=count) for key, count in counted if count), *interior]
    project = result.project
    held = (("orientations", len(project.cameras) - len(poses) + plates),
            ("free_points", len(project.object_points.ids) - points))  # fmt: skip
    assumed = dict.fromkeys(say(key, count=count) for key, count in held if count > 0)
    for camera in project.cameras:
        ideal = type(camera.distortion)()
        assumed |= dict.fromkeys(
            name for name in camera.interior_names
            if not hasattr(ideal, name) or camera.value(name) != getattr(ideal, name)
        )  # fmt: skip
    for media in project.media.values():
        names = media.parameter_names if media is not None else ()
        kept = [n for n in names if n.startswith(("index", "thickness", "radius", "gradient"))]
        assumed |= dict.fromkeys(name for name in kept if name != "index1")
    remaining = [name for name in assumed if name not in interior]
    nothing = say("nothing")
    return say(
        "estimated",
        estimated=", ".join(estimated) or nothing,
        assumed=", ".join(remaining) or nothing,
    )


def _remarks(remarks: tuple[str, ...], say: Words) -> Iterator[Block]:
    if remarks:
        yield Heading(text=say("remarks"), level=3)
    for remark in dict.fromkeys(remarks):
        yield Paragraph(text=remark)


def _media(result: Adjustment, say: Words) -> Iterator[Block]:
    project = result.project
    yield Heading(text=say("media"))
    if not project.media:
        yield Paragraph(text=say("media_none"))
        return
    rows = []
    for name, media in project.media.items():
        cameras = [
            camera.name
            for camera, of in zip(project.cameras, project.media_of, strict=True) if of == name
        ]  # fmt: skip
        many = f" ... ({len(cameras)})" if len(cameras) > 6 else ""
        thick = media.layers.thicknesses if isinstance(media, FlatInterface) else ()
        rows.append([
            name, ", ".join(cameras[:6]) + many, ", ".join(f"{n:.5f}" for n in media.indices),
            ", ".join(f"{t:.6g}" for t in thick) or "-", _place(media, say, project.unit),
        ])  # fmt: skip
    keys = ("media_name", "media_cameras", "media_indices", "media_thicknesses", "media_place")
    yield TextTable(headings=[say(key, unit=project.unit) for key in keys], rows=rows)


def _surface(surface: RefractingSurface, say: Words, vector: Callable[[FloatArray], str]) -> str:
    """Return in words where a surface lies."""
    if isinstance(surface, Plane):
        place, direction, radius = surface.point, surface.normal, 0.0
    elif isinstance(surface, Cylinder):
        place, direction, radius = surface.point, surface.axis, surface.radius
    elif isinstance(surface, Sphere):
        place, direction, radius = surface.centre, surface.centre, surface.radius
    else:
        return type(surface).__name__
    return say(
        f"surface_{type(surface).__name__}", place=vector(place), direction=vector(direction),
        radius=f"{radius:.7g}",
    )  # fmt: skip


def _place(media: FlatInterface | Interfaces, say: Words, unit: str) -> str:
    """Return in words where the faces of media lie."""

    def vector(values: FloatArray) -> str:
        # Adding nought makes no difference of -0.
        return "(" + ", ".join(f"{round(float(v), 5) + 0.0:g}" for v in values) + ")"

    if isinstance(media, Interfaces):
        kinds = "; ".join(_surface(surface, say, vector) for surface in media.surfaces)
        place_words = say("media_surfaces", count=len(media.surfaces), kinds=kinds)
        if not media.is_graded:
            return place_words
        return place_words + say(
            "media_gradient", gradient=f"{media.gradient:.3g}", level=f"{media.level:g}", unit=unit
        )
    key = "media_camera" if media.moves_with_camera else "media_world"
    return say(key, point=vector(media.point), normal=vector(media.normal))


def _unknowns(result: Adjustment, say: Words) -> Iterator[Block]:
    yield Heading(text=say("unknowns"))
    rows = []
    for name, value, sigma, unit in result.rows():
        digits = decimals(sigma)
        base, _, power = unit.partition("^")
        shown = base + power.translate(_RAISED)
        rows.append([name, f"{value:.{digits}f}", f"{sigma:.{digits}f}", shown])
    yield TextTable(headings=[say("unknown"), say("value"), "sigma", say("unit")], rows=rows)
    counted = ("offset", "tilt", "shift")
    if any(name.rpartition(":")[2].startswith(counted) for name in result.names):
        yield Paragraph(text=say("offsets_note"), small=True)


def _residuals(result: Adjustment, say: Words) -> Iterator[Block]:
    measured_cameras = [c for c in result.project.cameras if len(figures.measured_rows(result, c))]
    if not measured_cameras:
        return
    yield Heading(text=say("residuals"))
    rows = []
    for camera in measured_cameras:
        mine = figures.measured_rows(result, camera)
        rms = float(np.sqrt(np.mean(result.residuals[mine] ** 2)))
        hidden = result.smallest_detectable[mine]
        least = f"{np.nanmedian(hidden) * 1000:.1f}" if np.isfinite(hidden).any() else "-"
        row = (rms * 1000, result.sigma0_of[camera.name] * 1000)
        rows.append([camera.name, str(len(mine)), *(f"{v:.3f}" for v in row), least])
    heads = [say("camera"), say("points"), "RMS [µm]", "sigma0 [µm]", say("found_from")]
    yield TextTable(headings=heads, rows=rows)
    yield Paragraph(text=say("detectable"), small=True)
    drawn = sorted(measured_cameras, key=lambda camera: -result.sigma0_of[camera.name])[:_CAMERAS]
    if len(drawn) < len(measured_cameras):
        yield Paragraph(
            text=say("more_cameras", shown=len(drawn), all=len(measured_cameras)), small=True
        )
    drawn = [camera for camera in measured_cameras if camera in drawn]
    page = 2 * figures.COLUMNS
    for first in range(0, len(drawn), page):
        some = drawn[first : first + page]
        yield Picture(
            draw=partial(figures.draw_vectors, result=result, cameras=some, say=say),
            ratio=0.52 * -(-len(some) // figures.COLUMNS),
            caption=say("vectors_caption", zoom=f"{figures.vector_zoom(result):g}"),
        )
    depth, radial = figures.depth_and_radial(result)
    if (np.isfinite(depth) & np.isfinite(radial)).sum() > 3:
        yield Heading(text=say("depth"), level=3)
        yield Picture(
            draw=partial(figures.draw_depth, result=result, say=say), ratio=0.45,
            caption=say("depth_caption"),
        )  # fmt: skip


def _suspects(result: Adjustment, say: Words) -> Iterator[Block]:
    worst, images = result.gross_errors(), result.project.image_points
    if not worst:
        return
    yield Heading(text=say("suspects"))
    sizes = np.hypot(*result.residuals.T) * 1000
    rows = [
        [images.ids[k], images.cameras[k], f"{sizes[k]:.1f}", f"{test:.1f}"]
        for k, test in worst[:_SUSPECTS]
    ]
    heads = [say("point"), say("camera"), say("residual"), say("in_sigmas")]
    yield TextTable(headings=heads, rows=rows)
    if len(worst) > _SUSPECTS:
        yield Paragraph(text=say("more_rows", count=len(worst) - _SUSPECTS), small=True)


def _correlations(result: Adjustment, say: Words) -> Iterator[Block]:
    if len(result.names) < 2:
        return
    yield Heading(text=say("correlations"))
    yield Paragraph(text=say("correlations_meaning"))
    ranked = alike_pairs(result, STRONG)
    if ranked:
        rows = [
            [one, second, f"{value:+.3f}", str(len(pairs)), say(remedy_of(kind))]
            for kind, pairs in ranked for value, one, second in pairs[:1]
        ]  # fmt: skip
        heads = [say("unknown"), say("and_other"), say("correlation_axis"), say("how_many"),
                 say("told_apart")]  # fmt: skip
        yield TextTable(headings=heads, rows=rows, caption=say("strong_pairs", limit=STRONG))
    else:
        yield Paragraph(text=say("strong_none", limit=STRONG))
    if len(result.names) <= _LARGEST_PICTURE:
        yield Picture(
            draw=partial(figures.draw_correlations, result=result, say=say), ratio=0.9,
            caption=say("correlations_caption"),
        )  # fmt: skip


def _points(result: Adjustment, say: Words) -> Iterator[Block]:
    """Yield the adjusted points that were not fixed, the least precise first."""
    points = result.project.object_points
    size = np.linalg.norm(np.nan_to_num(points.sigma), axis=1)
    order = [int(j) for j in np.argsort(-size) if size[j] > 0]
    if not order:
        return
    yield Heading(text=say("object_points"))
    rows = [
        [
            points.ids[j],
            *(f"{v:.5f}" for v in points.xyz[j]),
            *(f"{v:.2g}" for v in points.sigma[j]),
        ]
        for j in order[:_POINTS]
    ]
    heads = [say("point"), "X", "Y", "Z", "sigma X", "sigma Y", "sigma Z"]
    caption = say("least_precise", count=len(order), unit=result.project.unit)
    yield TextTable(headings=heads, rows=rows, caption=caption)
    if len(order) > _POINTS:
        yield Paragraph(text=say("more_rows", count=len(order) - _POINTS), small=True)
