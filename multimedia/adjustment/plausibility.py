"""What may be believed of an adjustment: impossible media, unknowns alike, residuals not white."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc, chdtri, ndtr

from multimedia.adjustment.bundle_columns import BundleColumns
from multimedia.adjustment.media_unknowns import media_unknowns
from multimedia.adjustment.unknowns import Adjustment, Unknowns, is_angle
from multimedia.media import ANY_INTERIOR, EXTERIOR
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.adjustment.priors import ALIKE, UNCARRIED, is_possible
from photocore.arrays import FloatArray, IntArray
from photocore.errors import GeometryError
from photocore.reports import words_of

#: So many typical deviations of what is known of a medium tell nothing of it.
UNDETERMINED = 1000.0
#: Risk of calling a parameter significant, or residuals not white, that are so by chance.
RISK_PARAMETER, RISK_WHITE = 0.01, 0.001
#: Points of one image that may share what the model lacks; the largest effect counts.
NEIGHBOURS = (4, 8, 16)
_FEWEST_CELLS = 6
#: Classes of depth before each camera, as many points in each.
_DEPTHS = 3
#: Image coordinates better than this are exact, as computed ones are: only rounding is left. [mm]
EXACT = 1e-7
_SHOWN = 6
#: Extent of a wand's places across their plane, as a share of that within it, below which they
#: carry little of the cameras.
_FLAT = 0.1
#: Interior parameters without which a camera is a pinhole: tested against zero (scale against 1).
_TESTED = {name: 1.0 if name == "scale" else 0.0 for name in ANY_INTERIOR[3:]}
#: Beginnings of the names of unknowns, and the text of `words.toml` on what tells them apart.
_REMEDIES = (
    (("thickness",), "remedy_thickness"),
    (("index",), "remedy_index"),
    (("radius", "centre", "shift"), "remedy_radius"),
    (("gradient",), "remedy_gradient"),
    (("offset", "tilt"), "remedy_offset"),
    (("p1", "p2"), "remedy_p1"),
    (("k1", "k2", "k3"), "remedy_k1"),
    (("xh", "yh"), "remedy_xh"),
    (("c", "scale", "shear"), "remedy_c"),
)


def refuse_impossible_media(
    project: Project, columns: BundleColumns, result: Adjustment, given: Mapping[str, float]
) -> None:
    """Refuse indices, thicknesses, radii and gradients that the media named cannot have.

    Parameters
    ----------
    project : Project
        With the start values.
    columns : BundleColumns
    result : Adjustment
    given : mapping of str to float
        Prior standard deviations by label; infinite: anything that physics allows.

    Raises
    ------
    GeometryError
        Naming the unknown, its value and what it cannot be told apart from.
    """
    for item in media_unknowns(project, columns.labels, columns.media):
        label, start = item.label, item.start
        value, sigma = result.value(label), result.sigma(label)
        if is_possible(
            value, start=start, sigma=given.get(label, item.typical), least=item.least,
            most=item.most,
        ) and not sigma > UNDETERMINED * item.typical:  # fmt: skip
            continue
        row = result.names.index(label)
        others = np.abs(result.correlations[row])
        others[row] = 0.0
        twin = int(np.argmax(others))
        alike = (
            f"; it goes with {result.names[twin]} (correlation {others[twin]:.2f})"
            if others[twin] > ALIKE / 2
            else ""
        )
        unit = f" {result.unit(label)}".rstrip()
        raise GeometryError(
            f"adjust: {label} comes out as {value:.4g} ± {sigma:.2g}{unit}, {start:g}{unit} was "
            f"given: the data cannot carry it{alike}. Give what is known as a standard deviation "
            f"(--prior {label}={item.typical:.3g}), measure points at more depths, or take "
            f"{item.name} out of --media. If it really is so, change its start value in the "
            "project."
        )


def with_model_error(
    result: Adjustment, order: tuple[IntArray, ...], plates: Sequence[str] = ()
) -> Adjustment:
    """Return the adjustment with sigmas that include what the model lacks.

    Residuals of neighbouring points are independent if the model is complete. Where their sums
    scatter more than that, every parameter rests on fewer independent observations than were
    counted: covariances are multiplied by the ratio (the design effect of cluster sampling).

    Parameters
    ----------
    result : Adjustment
    order : tuple of ndarray of int
        Rows of the image points of each camera.
    plates : sequence of str
        Groups of object points whose pose was an unknown.
    """
    if not result.sigma0 > EXACT:
        return result
    place = result.project.image_points.image
    effect, remarks = 1.0, list[str]()
    for size in NEIGHBOURS:
        cells = [rows[cell] for rows in order for cell in _cells(place[rows], size)]
        squares, free = _sums(result, cells)
        count = 2 * len(cells)
        if len(cells) < _FEWEST_CELLS or free.sum() <= 0:
            break
        ratio = float(squares.sum() / free.sum())
        if ratio > chdtri(count, RISK_WHITE / len(NEIGHBOURS)) / count:
            effect = max(effect, ratio)
    for groups in _groups(result, order):
        squares, free = _sums(result, [rows for _, _, rows in groups])
        ratios = np.divide(squares, free, out=np.zeros_like(free), where=free > 0.5)
        if ratios.max(initial=0.0) > chdtri(2, RISK_WHITE / max(len(groups), 1)) / 2:
            effect = max(effect, float(squares.sum() / free.sum()))
            remarks.append(_worst_group(result, groups, ratios, plates))
    if effect == 1.0:
        return result
    points = result.project.object_points
    factor = float(np.sqrt(effect))
    return replace(
        result,
        project=replace(result.project, object_points=replace(points, sigma=points.sigma * factor)),
        covariance=result.covariance * effect,
        point_covariance=result.point_covariance * effect,
        model_error=factor,
        remarks=(*result.remarks, *remarks, remark("bundle.neighbours_alike", factor=factor)),
    )


def _sums(result: Adjustment, cells: Sequence[IntArray]) -> tuple[FloatArray, FloatArray]:
    """Return the squared sum of the residuals of each cell in sigmas, and what chance makes it."""
    scaled = result.residuals / result.sigma_image
    squares = [float((scaled[rows].sum(axis=0) ** 2).sum()) for rows in cells]
    free = [float(result.redundancy_numbers[rows].sum()) for rows in cells]
    return np.array(squares), np.array(free)


def _groups(
    result: Adjustment, order: tuple[IntArray, ...]
) -> Iterator[list[tuple[str, str, IntArray]]]:
    """Yield what may be wrong as a whole: plates, depths; name, camera and rows of the residuals.

    Plates overlap in an image, so that no neighbours there are of one of them alone.
    """
    points = result.project.object_points
    at = np.array(points.rows(result.project.image_points.ids), dtype=np.int64)
    label = np.array(points.groups)[at]
    plates, depths = list[tuple[str, str, IntArray]](), list[tuple[str, str, IntArray]]()
    for camera, rows in zip(result.project.cameras, order, strict=True):
        plates_of_camera = [g for g in np.unique(label[rows]) if g not in ("", "new")]
        plates += [
            (str(g), camera.name, rows[label[rows] == g])
            for g in plates_of_camera
            if len(plates_of_camera) > 1
        ]
        depth = -camera.vectors_to(points.xyz[at[rows]])[:, 2]
        parts = np.array_split(np.argsort(depth, kind="stable"), _DEPTHS)
        depths += [
            (f"{depth[part[0]]:.4g} to {depth[part[-1]]:.4g}", camera.name, rows[part])
            for part in parts if len(part) >= NEIGHBOURS[0]
        ]  # fmt: skip
    yield plates
    yield depths


def _worst_group(
    result: Adjustment, groups: Sequence[tuple[str, str, IntArray]], ratios: FloatArray,
    plates: Sequence[str],
) -> str:  # fmt: skip
    """Return what to say of the group that is off most, and what would free it."""
    label, camera, rows = groups[int(np.argmax(ratios))]
    mean = np.hypot(*result.residuals[rows].mean(axis=0)) * 1000
    off = {"mean": mean, "camera": camera, "errors": np.sqrt(ratios.max())}
    if label not in result.project.object_points.groups:
        near, far = label.split(" to ")
        return remark("bundle.depth_off", near=near, far=far, unit=result.project.unit, **off)
    return remark(f"bundle.plate_{'bent' if label in plates else 'moved'}", plate=label, **off)


def _cells(place: FloatArray, size: int) -> Iterator[IntArray]:
    """Yield the rows of neighbouring places, at most ``size`` together, halving the wider side."""
    waiting = [np.arange(len(place))] if len(place) else []
    while waiting:
        rows = waiting.pop()
        if len(rows) <= size:
            yield rows
            continue
        wider = int(np.argmax(np.ptp(place[rows], axis=0)))
        rows = rows[np.argsort(place[rows, wider], kind="stable")]
        waiting += [rows[: len(rows) // 2], rows[len(rows) // 2 :]]


def remarks_on_unknowns(
    project: Project, columns: BundleColumns, result: Adjustment
) -> tuple[str, ...]:
    """Return what the user should know of the unknowns: alike, insignificant, or not carried."""
    return (
        *_carried(project, columns, result),
        *alike_remarks(result),
        *_insignificant(result),
    )


def wand_remarks(result: Adjustment, unknowns: Unknowns) -> tuple[str, ...]:
    """Return that a wand was waved in a plane, where nothing but its points gives the cameras."""
    xyz = result.project.object_points.xyz
    if unknowns.control != "free" or not any(b.first[:1] == "@" for b in unknowns.scale_bars):
        return ()
    extent = 2.0 * np.linalg.svd(xyz - xyz.mean(axis=0))[1] / np.sqrt(len(xyz))
    if extent[2] > _FLAT * extent[1]:
        return ()
    across, along = (f"{value:.2g} {result.project.unit}" for value in (extent[2], extent[1]))
    return (remark("bundle.wand_in_plane", across=across, along=along),)


def _carried(project: Project, columns: BundleColumns, result: Adjustment) -> Iterator[str]:
    """Yield which unknowns with priors the images carry, and those that rest on what was given."""
    starts = {i.label: i.start for i in media_unknowns(project, columns.labels, columns.media)}
    ranked = []
    for column, prior in columns.priors.items():
        label = columns.labels[column]
        sigma, degrees = result.sigma(label), float(np.degrees(1.0)) if is_angle(label) else 1.0
        unit = f" {result.unit(label)}".rstrip()
        if sigma > UNCARRIED * prior * result.model_error:
            start = f"{starts[label]:g} ± " if label in starts else "± "
            prior_words = f"{start}{prior * degrees:.2g}{unit}"
            yield remark("bundle.hardly_carried", label=label, given=prior_words)
        else:
            prior_words = f"given {prior * degrees:.2g}{unit}"
            ranked.append((sigma / prior, f"{label} ({sigma * degrees:.2g}{unit}, {prior_words})"))
    if ranked:
        yield remark("bundle.carried", names=", ".join(text for _, text in sorted(ranked)[:_SHOWN]))


def alike_remarks(result: Adjustment) -> Iterator[str]:
    """Yield the pairs that cannot be told apart, one sentence for each kind of pair."""
    say = words_of("multimedia.adjustment", "en")
    ranked = alike_pairs(result, ALIKE)
    for kind, pairs in ranked[:_SHOWN]:
        correlation, one, second = pairs[0]
        more = f" (and {len(pairs) - 1} more such pairs)" if len(pairs) > 1 else ""
        yield (
            f"{one} and {second} can hardly be told apart: correlation {abs(correlation):.3f}"
            f"{more}; {say(remedy_of(kind))}."
        )
    if len(ranked) > _SHOWN:
        yield f"{len(ranked) - _SHOWN} more kinds of pairs are alike; the report shows them."


def alike_pairs(
    result: Adjustment, limit: float
) -> list[tuple[tuple[str, str], list[tuple[float, str, str]]]]:
    """Return the pairs of unknowns correlated beyond a limit, by the kinds of their parameters.

    Parameters
    ----------
    result : Adjustment
    limit : float
        Of the absolute correlation.

    Returns
    -------
    list of (kind, pairs)
        Names of both parameters; correlation and labels of each such pair. Strongest first.
    """
    matrix = np.nan_to_num(result.correlations)
    first, second = np.nonzero(np.triu(np.abs(matrix) > limit, 1))
    kinds: dict[tuple[str, str], list[tuple[float, str, str]]] = {}
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        names = result.names[i], result.names[j]
        kind = names[0].rpartition(":")[2], names[1].rpartition(":")[2]
        # Centre and turns of one camera are alike in every narrow view; that harms no point.
        if not {*kind} <= {*EXTERIOR, "X", "Y", "Z"}:
            kinds.setdefault(kind, []).append((float(matrix[i, j]), *names))
    for pairs in kinds.values():
        pairs.sort(key=lambda pair: (-abs(pair[0]), pair[1:]))
    return sorted(kinds.items(), key=lambda item: -abs(item[1][0][0]))


def remedy_of(kind: tuple[str, str]) -> str:
    """Return the key of the text that says what would tell two unknowns apart."""
    for starts, remedy in _REMEDIES:
        if any(name.startswith(start) for name in kind for start in starts if len(start) > 1) or (
            "c" in kind and "c" in starts
        ):
            return remedy
    return "remedy_other"


def _insignificant(result: Adjustment) -> Iterator[str]:
    """Yield the lens parameters and gradients that the geometry does not carry."""
    for name, neutral in _TESTED.items():
        labels = [label for label in result.names if label.rpartition(":")[2] == name]
        if labels and significance(result, labels, neutral) > RISK_PARAMETER:
            whose = ", ".join(label.rpartition(":")[0] for label in labels[:_SHOWN])
            yield remark("bundle.insignificant", name=name, whose=whose)
    for label in result.names:
        if label.endswith("gradient") and significance(result, [label]) > RISK_PARAMETER:
            yield remark("bundle.no_gradient", name=label)


def significance(
    result: Adjustment, labels: Sequence[str], neutral: float | Sequence[float] = 0.0
) -> float:
    """Return the chance that parameters which are really neutral come out this far off.

    The test is that of the quadratic form of all of them with their covariance (chi-square).
    """
    rows = [result.names.index(label) for label in labels]
    off = result.values[rows] - np.asarray(neutral)
    covariance = result.covariance[np.ix_(rows, rows)]
    if len(rows) == 1:
        return float(2 * ndtr(-abs(off[0]) / np.sqrt(covariance[0, 0])))
    return float(chdtrc(len(rows), off @ np.linalg.solve(covariance, off)))
