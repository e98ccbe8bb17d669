"""The first thing a report says: how accurate the survey is, and which drawings it is good for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bifocal.model import MISFITS, LengthCheck, Pair, PhotosOfSet, agreement, checks_of, doubts_of
from bifocal.remarks import in_language
from bifocal.reports.content import PairContent
from bifocal.survey import SCALES, CheckResult, WallPrecision, judge
from bifocal.survey.wall_precision import wall_precision
from photocore.reports import Banner, Block, Paragraph, TextTable, Words, words_of

#: What is judged by itself: the plan of a drawing, and what stands out of it.
_PARTS = {"part_drawing": "XY", "part_relief": "Z"}
#: Points shown in a table; the workbook has them all.
MOST_POINTS = 60
#: Errors over their sigmas (RMS) that chance explains, however many the points: an error of the
#: orientation moves them all together, and is below two sigma in 95 of 100 surveys.
BY_CHANCE = 2.0
#: Smaller ones mean that less was trusted than could be; so small by chance in 24 of 100.
TOO_SMALL = 0.3
#: A point is named whose error is more of its sigmas. 20 points by three axes: 0.16 are expected.
FAR_OFF = 3.0


def accuracy_blocks(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield doubts in the model, the verdict, its table per drawing scale, and compared points."""
    doubts = doubts_of(MISFITS, content.pair.remarks)
    if doubts:
        details = tuple(in_language(text, content.task.language) for text in doubts)
        yield Banner(text=say("misfit"), details=details, good=False)
    yield from _length_blocks(content, say)
    solution = content.solution
    check = None if solution is None else solution.check
    if check is None or not np.isfinite(check.accuracy):
        if not _lengths_of(content):
            yield Banner(
                text=say("verdict_none"), details=_expected(content, content.task.language)
            )
        return
    yield _banner(content, check, say)
    yield _verdict_table(check, say)
    yield _totals(content, check, say)
    yield _point_table(content, check, say)
    hidden = int(np.isfinite(check.errors).any(axis=1).sum()) - MOST_POINTS
    if hidden > 0:
        yield Paragraph(text=say("more_points", n=hidden), small=True)


def _length_blocks(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield how lengths taped on site agree with the pair."""
    lengths = _lengths_of(content)
    if not lengths:
        return
    agreed = agreement(tuple(lengths.values()))
    yield Banner(text=say("lengths_checked", **agreed), good=agreed["agree"] == agreed["count"])
    yield TextTable(
        headings=[say(key) for key in ("length", "taped", "found", "error_mm", "sigma_mm")],
        rows=[
            [
                name, f"{one.taped:.3f}", f"{one.measured:.3f}", f"{1000 * one.difference:+.1f}",
                f"{1000 * one.sigma:.1f}",
            ]
            for name, one in lengths.items()
        ],
        caption=say("lengths_drawn"),
    )  # fmt: skip


def _lengths_of(content: PairContent) -> dict[str, LengthCheck]:
    return checks_of(content.setup) | dict(content.task.lengths)


def verdict_in_words(content: PairContent) -> list[str]:
    """Return what is proven of drawing and relief in a few lines of English, for the terminal."""
    say = words_of("bifocal.reports", "en")
    solution = content.solution
    if solution is None or not np.isfinite(solution.check.accuracy):
        return [say("verdict_none"), *_expected(content, "en")]
    banner = _banner(content, solution.check, say)
    misfit = bool(doubts_of(MISFITS, content.pair.remarks))
    parts, (_, *expected) = banner.details[: len(_PARTS)], banner.details[len(_PARTS) :]
    return [f"{banner.text}.", *parts, *expected[:1], *[say("misfit")] * misfit]


def precision_in_words(precision: WallPrecision, say: Words) -> str:
    """Return in a line how precisely the wall is known, and the finest drawing scale that holds."""
    lengths = {key: 1000 * getattr(precision, key) for key in ("middle", "rim", "place")}
    holds = "known_none" if precision.scale is None else "known_holds"
    return say("known_to", **lengths, verdict=say(holds, scale=precision.scale))


def wall_in_words(pair: Pair, *, language: str) -> tuple[str, ...]:
    """Return the same of a pair, as terminal, report and sheet say it; nothing of a set."""
    sizes = (pair.image1.image_size, pair.image2.image_size)
    if isinstance(pair, PhotosOfSet) or sizes[0] is None or sizes[1] is None:
        return ()
    precision = wall_precision(pair, (sizes[0], sizes[1]))
    if precision is None:
        return ()
    return (precision_in_words(precision, words_of("bifocal.reports", language)),)


def _expected(content: PairContent, language: str) -> tuple[str, ...]:
    """Return what the sigmas of the pair alone let expect; nothing of a set of photos."""
    return () if content.of_set is not None else wall_in_words(content.pair, language=language)


def _map_in_words(content: PairContent, say: Words) -> Iterator[str]:
    """Yield what the relief map is off at the compared points, which were picked, not mapped."""
    names, errors, sigma = content.map_errors()
    if not names:
        return
    rmse, median = float(np.sqrt(np.mean(errors**2))), float(np.median(np.abs(errors)))
    yield say("map_check", n=len(names), rmse=millimetres(rmse), median=millimetres(median))
    size = np.abs(errors)
    off = [k for k in np.argsort(-size).tolist() if size[k] > FAR_OFF * sigma[k]]
    if off:
        worst = (f"{names[k]} ({millimetres(float(errors[k]))})" for k in off[:5])
        more = f" (+{len(off) - 5})" if len(off) > 5 else ""
        yield say("map_far_off", names=", ".join(worst) + more)


def millimetres(length: float | None) -> str:
    """Return a length in millimetres with three digits.

    Examples
    --------
    >>> millimetres(0.00345), millimetres(0.0123), millimetres(None)
    ('3.45 mm', '12.3 mm', '-')
    """
    if length is None or not np.isfinite(length):
        return "-"
    value = 1000 * length
    digits = max(0, 2 - int(np.floor(np.log10(max(abs(value), 0.01)))))
    return f"{value:.{min(digits, 3)}f} mm"


def _banner(content: PairContent, check: CheckResult, say: Words) -> Banner:
    count = int(np.isfinite(check.errors).any(axis=1).sum())
    key = "verdict_check" if content.has_check else "verdict_control"
    rule, scale = check.verdicts[0].rule, content.task.scale
    details, good = [], set()
    for part, accuracy in _accuracies(check).items():
        held = [verdict.scale for verdict in judge(accuracy, (rule,)) if verdict.holds]
        clauses = [say("good_for", scale=min(held)) if held else say("good_for_none")]
        holds = bool(held)
        if scale:
            limit = rule.tolerance(round(scale))
            holds = limit is not None and accuracy <= limit
            clauses.append(say("wanted_yes" if holds else "wanted_no", scale=f"{scale:g}"))
        finite = bool(np.isfinite(accuracy))
        verdict = " ".join(clauses) if finite else say("part_none")
        details.append(say(part, accuracy=millimetres(accuracy), verdict=verdict))
        good |= {holds} if finite else set()
    details += [*_foundation(content, check, say), *_map_in_words(content, say)]
    text = say(key, accuracy=millimetres(check.accuracy), n=count)
    return Banner(text=text, details=tuple(details), good=good.pop() if len(good) == 1 else None)


def _accuracies(check: CheckResult) -> dict[str, float]:
    """Return the RMSE of the worst axis of drawing and relief; NaN where nothing was compared."""
    return {
        part: max((check.axes[a].rmse for a in axes if check.axes[a].n), default=float("nan"))
        for part, axes in _PARTS.items()
    }


def _foundation(content: PairContent, check: CheckResult, say: Words) -> Iterator[str]:
    """Yield what the verdict rests on: errors by axis, and whether they are what was expected."""
    rmse = [check.axes[axis].rmse for axis in "XYZ"]
    x, y, r = map(millimetres, rmse)
    yield say("by_axis", x=x, y=y, r=r)
    assert content.solution is not None
    table = content.solution.table
    place = {name: row for row, name in enumerate(table.ids)}
    rows = [place.get(name, -1) for name in check.ids]
    sigma = np.stack([table[key] for key in ("sigma_X", "sigma_Y", "sigma_r")], axis=-1)[rows]
    with np.errstate(invalid="ignore", divide="ignore"):
        in_sigmas = np.abs(check.errors) / sigma
    worst = int(np.nanargmax(rmse))
    finite = np.isfinite(in_sigmas[:, worst])
    # Points the orientation was fitted to come out better than their precision.
    if not (content.has_check and finite.any()):
        return
    expected = float(np.sqrt(np.mean(sigma[finite, worst] ** 2)))
    ratio = float(np.sqrt(np.mean(in_sigmas[finite, worst] ** 2)))
    key = "expected_exceeded" if ratio > BY_CHANCE else "expected_agrees"
    key = "expected_undercut" if ratio < TOO_SMALL else key
    yield say(key, expected=millimetres(expected), ratio=f"{ratio:.2g}")
    size = np.nan_to_num(in_sigmas, nan=0.0).max(axis=1)
    off = [k for k in np.argsort(-size).tolist() if size[k] > FAR_OFF]
    if off:
        yield say("far_off", names=", ".join(f"{check.ids[k]} ({size[k]:.1f} σ)" for k in off[:5]))


def _verdict_table(check: CheckResult, say: Words) -> TextTable:
    names = {verdict.rule.key: verdict.rule.name for verdict in check.verdicts}
    tolerances = {
        (verdict.scale, verdict.rule.key): verdict.tolerance for verdict in check.verdicts
    }
    accuracies = _accuracies(check).values()

    def cell(limit: float | None) -> str:
        if limit is None:
            return "-"
        words = (
            say("holds" if one <= limit else "fails") if np.isfinite(one) else "-"
            for one in accuracies
        )
        return f"{limit * 1000:.3g} mm: {' / '.join(words)}"

    rows = [
        [f"1:{scale}", *(cell(tolerances.get((scale, key))) for key in names)] for scale in SCALES
    ]
    headings = [say("scale"), *names.values()]
    return TextTable(headings=headings, rows=rows, caption=say("rule_table"))


def _totals(content: PairContent, check: CheckResult, say: Words) -> TextTable:
    """Return the RMSE of control and check points, along the axes and together."""
    control = np.array([name in content.control_ids for name in check.ids], dtype=bool)
    rows = []
    for kind, which in (("kind_control", control), ("kind_check", ~control)):
        errors = 1000 * check.errors[which & np.isfinite(check.errors).any(axis=1)]
        if not len(errors):
            continue
        with np.errstate(invalid="ignore"):
            count = np.isfinite(errors).sum(axis=0)
            mean = np.nansum(errors**2, axis=0) / np.where(count > 0, count, np.nan)
        x, y, r = mean.tolist()
        values = np.sqrt([x, y, x + y, r, x + y + r]).tolist()
        rows.append([say(kind), str(len(errors)), *(_number(v, 2) for v in values)])
    headings = [say("points"), say("n"), *(f"{axis} [mm]" for axis in ("X", "Y", "XY", "r", "XYr"))]
    return TextTable(headings=headings, rows=rows, caption=say("totals_table"))


def _point_table(content: PairContent, check: CheckResult, say: Words) -> TextTable:
    solution = content.solution
    assert solution is not None
    table, control = solution.table, content.control_ids
    place = {name: row for row, name in enumerate(table.ids)}
    columns = ("X [m]", "Y [m]", "r [m]", "dX [mm]", "dY [mm]", "dr [mm]", "σr [mm]")
    headings = [say("point"), say("kind"), *columns, say("flag")]
    rows = []
    compared = np.isfinite(check.errors).any(axis=1)
    for index in np.flatnonzero(compared)[:MOST_POINTS].tolist():
        name = check.ids[index]
        row = place[name]
        kind = say("kind_control" if name in control else "kind_check")
        place_m = (_number(v, 3) for v in check.solved[index])
        sizes = (*check.errors[index], table["sigma_r"][row])
        errors = (_number(1000 * v, 1) for v in sizes)
        rows.append([name, kind, *place_m, *errors, table.flags[row]])
    for key, name in (("rmse", "rmse"), ("mean", "mean"), ("max_abs", "max")):
        values = [1000 * getattr(check.axes[axis], key) for axis in "XYZ"]
        rows.append([say(name), "", "", "", "", *(_number(v, 1) for v in values), "", ""])
    return TextTable(headings=headings, rows=rows, caption=say("check_table"))


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"
