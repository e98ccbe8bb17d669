"""The figures of a report: drawn into whatever they are given, readable in black and white."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np

from bifocal.model import TOLD, Bounds, Photo, Quality, ReliefMap
from bifocal.reports.content import SIDE, PairContent, ReportedPhoto
from photocore.arrays import FloatArray
from photocore.reports import Words
from photocore.textfile import packaged

#: Place of the axes in a figure, with and without room for a colour bar; of the bar.
_WIDE, BESIDE, _BAR = (0.08, 0.1, 0.9, 0.87), (0.08, 0.1, 0.78, 0.87), (0.885, 0.16, 0.022, 0.72)
#: Grey of what is unknown.
_UNKNOWN = "0.8"

_styles = cache(partial(packaged, __package__, "styles"))


def ratio_of(bounds: Bounds) -> float:
    """Return the height over the width of a figure that shows bounds, within reason."""
    x_min, y_min, x_max, y_max = bounds
    return float(np.clip(0.87 * (y_max - y_min) / (x_max - x_min) + 0.1, 0.3, 1.15))


def draw_ortho(figure: Any, content: PairContent) -> None:
    """Draw the orthophoto with the compared points."""
    assert content.ortho is not None
    picture, bounds = content.ortho
    axes = plane_axes(figure, bounds, _WIDE)
    axes.imshow(picture, extent=extent_of(bounds), interpolation="antialiased")
    if content.solution is not None:
        x, y = _inside(content.solution.table.xyz[:, :2], bounds).T
        axes.plot(x, y, "+", color="black", ms=8, mew=2.2)
        axes.plot(x, y, "+", color="yellow", ms=7, mew=0.9)
    scale_bar(axes, bounds)


def draw_plan(figure: Any, content: PairContent, say: Words) -> None:
    """Draw wall and cameras from above, to scale."""
    axes = figure.add_axes(_WIDE)
    pair = content.pair
    ends = []
    for number, (photo, name) in enumerate(
        zip(content.cameras, content.names(say), strict=True), start=1
    ):
        style = "-" if number == 1 else (0, (5, 2))
        x, d = float(photo.nadir[0]), photo.distance
        left, right = _footprint(content, number)
        for end in (left, right):
            axes.plot(*_way_to(photo, end), color="black", lw=0.9, ls=style)
        _draw_media(axes, photo, (left, right))
        ends += [left, right, x]
        axes.plot([x], [d], marker="^", color="black", ms=9)
        label = _styles()["station"] | ({"va": "top", "xytext": [10, -14]} if number > 2 else {})
        axes.annotate(f"{name}\nd{number} = {d:.3f} m", (x, d), **label)
    first = (float(pair.image1.nadir[0]), pair.image1.distance)
    zoom = float(pair.zoom_centre[0])
    low, high = min(ends), max(ends)
    if low - (high - low) <= zoom <= high + (high - low):
        axes.plot([first[0], zoom], [first[1], 0], color="0.4", lw=0.8, ls=":")
    axes.plot([low, high], [0, 0], color="black", lw=4, solid_capstyle="butt")
    axes.annotate(say("wall"), (high, 0), (4, 4), textcoords="offset points", fontsize=8)
    margin = 0.08 * (high - low)
    axes.set(aspect="equal", xlim=(low - margin, high + 2 * margin))
    axes.set_ylim(-0.05 * first[1], 1.1 * first[1])
    axes.set_xlabel("X [m]", fontsize=8)
    axes.set_ylabel(say("distance_axis"), fontsize=8)
    axes.tick_params(labelsize=8)


def _way_to(photo: Photo, end: float) -> tuple[list[float], list[float]]:
    """Return X and distance along the ray of a photo to a place on the wall. [m]"""
    x, d = float(photo.nadir[0]), photo.distance
    media = photo.media
    if not media or photo.leans:
        return [x, end], [d, 0.0]
    offset = np.array([end - x, 0.0])
    tangent = float(media.apparent(offset, np.zeros(()))[0]) / d
    places, heights = [x], [d]
    for index, thickness in zip(
        media.layers.indices, (media.z0, *media.layers.thicknesses), strict=False
    ):
        first = media.layers.indices[0]
        bend = first / np.sqrt(index**2 + (index**2 - first**2) * tangent**2)
        places.append(places[-1] + thickness * tangent * float(bend))
        heights.append(heights[-1] - thickness)
    return [*places, end], [*heights, 0.0]


def _draw_media(axes: Any, photo: Photo, ends: tuple[float, float]) -> None:
    """Draw the first and the last interface before a photo, as wide as its rays are there."""
    if not photo.refracted or photo.leans:
        return
    ways = [_way_to(photo, end) for end in ends]
    for row in {1, len(ways[0][0]) - 2}:
        across = [xs[row] for xs, _ in ways]
        axes.plot(across, [ways[0][1][row]] * 2, color="0.5", lw=1.2)


def plan_ratio(content: PairContent) -> float:
    """Return the height over the width of the plan of the stations."""
    ends = [end for k in range(len(content.cameras)) for end in _footprint(content, k + 1)]
    width = 1.24 * (max(ends) - min(ends))
    return float(np.clip(0.9 * 1.15 * content.pair.image1.distance / width + 0.1, 0.35, 1.1))


def _footprint(content: PairContent, number: int) -> tuple[float, float]:
    """Return X at which the middle row of a photo begins and ends on the wall, kept finite. [m]"""
    photo = content.cameras[number - 1]
    reach = 3 * photo.distance
    if not content.photos:
        return float(photo.nadir[0]) - reach / 6, float(photo.nadir[0]) + reach / 6
    width, height = content.photos[number - 1].size
    row = np.column_stack([np.linspace(0, width - 1, 9), np.full(9, (height - 1) / 2)])
    x = photo.plane_from_pixels(row)[:, 0]
    ahead = photo.sees_ahead(photo.plane_from_pixels(row), (height, width))
    x = np.clip(x[np.isfinite(x) & ahead], photo.nadir[0] - reach, photo.nadir[0] + reach)
    return (float(x.min()), float(x.max())) if len(x) else (-1.0, 1.0)


def draw_photo(figure: Any, content: PairContent, seen: ReportedPhoto, number: int) -> None:
    """Draw a photo with its points: where they were picked."""
    axes = figure.add_axes((0.01, 0.01, 0.98, 0.98))
    shape = seen.picture.shape
    axes.imshow(seen.picture, cmap="gray" if seen.picture.ndim == 2 else None)
    axes.set_axis_off()
    solution = content.solution
    if solution is None:
        return
    pixels = solution.points.pixels[number - 1]
    missing = np.asarray(np.isnan(pixels).any(axis=1))
    if missing.any():
        pixels = np.where(missing[:, None], seen.photo.project(solution.table.xyz), pixels)
    places = (pixels + 0.5) / seen.reduction - 0.5
    control = content.control_ids
    for name, (x, y) in zip(solution.table.ids, places.tolist(), strict=True):
        if not (0 <= x < shape[1] and 0 <= y < shape[0]):
            continue
        marker = "o" if name in control else "^"
        for colour, width in (("black", 2.4), ("yellow", 1.1)):
            axes.plot([x], [y], marker, mfc="none", mec=colour, mew=width, ms=8)
        if len(solution.table) <= 60:
            _label(axes, name, (x, y), at_right=x > 0.93 * shape[1])


def _label(axes: Any, text: str, at: tuple[float, float], *, at_right: bool) -> None:
    """Write a name beside a point; to the left of one at the right edge."""
    from matplotlib.patheffects import withStroke

    side, away = ("right", -5) if at_right else ("left", 5)
    rim = [withStroke(linewidth=1.6, foreground="black")]
    axes.annotate(text, at, (away, 5), ha=side, path_effects=rim, **_styles()["point_name"])


def draw_ties(figure: Any, content: PairContent, say: Words) -> None:
    """Draw the ties of both photos by cells: how many, and the RMS of their misfits."""
    cells = content.setup["common_points"]["cells"]
    most = max(max((row[4] for row in one["rows"]), default=1.0) for one in cells)
    for k, (one, photo) in enumerate(zip(cells, content.photos, strict=True)):
        axes = figure.add_axes((0.01 + 0.45 * k, 0.02, 0.435, 0.9))
        shape = photo.picture.shape
        axes.imshow(photo.picture, cmap="gray" if photo.picture.ndim == 2 else None, alpha=0.45)
        axes.set(xlim=(0, shape[1]), ylim=(shape[0], 0))
        axes.set_axis_off()
        side = one["side"] / photo.reduction
        column, row, count, _, rms = np.array(one["rows"], dtype=float).reshape(-1, 5).T
        places = (column + 0.5) * side, (row + 0.5) * side
        # The area of a dot grows with the number of its ties, up to the usual one of a full cell.
        size = np.minimum(count / max(np.percentile(count, 90), 1.0), 1.0)
        dots = axes.scatter(*places, s=12 + 90 * size, c=rms, vmin=0, vmax=most, **_styles()["tie"])
        axes.set_title(say("far" if k == 0 else "near"), fontsize=8)
    colour_bar(figure, dots, say("tie_axis"))


def draw_relief(figure: Any, content: PairContent, say: Words) -> None:
    """Draw the relief in diverging colours about the wall, interpolated parts lightly hatched."""
    axes, part, bounds = _map_axes(figure, content)
    extent = extent_of(bounds)
    reach = max(float(np.nanpercentile(np.abs(part.r), 98)), 1e-3)
    image = axes.imshow(part.r, extent=extent, vmin=-reach, vmax=reach, **_styles()["relief"])
    guessed = ~np.isin(part.quality, TOLD) & np.isfinite(part.r)
    if guessed.any() and not guessed.all():
        axes.contourf(guessed.astype(float), extent=extent, **_styles()["guessed"])
    bar = colour_bar(figure, image, say("relief_axis"), extend="both")
    bar.axhline(0, color="black", lw=1)
    scale_bar(axes, bounds)


def draw_sigma(figure: Any, content: PairContent, say: Words, limit: float) -> None:
    """Draw the standard deviation of the relief and the border of the area of uncertainty."""
    from matplotlib.colors import LogNorm

    axes, part, bounds = _map_axes(figure, content)
    extent = extent_of(bounds)
    sigma = 1000.0 * np.where(part.quality == Quality.MEASURED, part.sigma, np.nan)
    good = np.isfinite(sigma) & (sigma > 0)
    if good.any():
        low, high = np.percentile(sigma[good], [2, 98])
        norm = LogNorm(max(low, 0.01), max(high, 1.5 * low, 0.02))
        image = axes.imshow(sigma, extent=extent, norm=norm, **_styles()["sigma"])
        colour_bar(figure, image, say("sigma_axis"), extend="both")
        if (sigma[good] > 1000 * limit).any() and (sigma[good] < 1000 * limit).any():
            finite = np.where(good, sigma, np.nan)
            axes.contour(finite, levels=[1000 * limit], extent=extent, **_styles()["limit"])
    x, y = content.pair.zoom_centre
    if len(_inside(np.array([[x, y]]), bounds)):
        axes.plot([x], [y], "x", color="red", ms=10, mew=2)
    scale_bar(axes, bounds)


def draw_errors(figure: Any, content: PairContent, say: Words) -> None:
    """Draw errors in X and Y as arrows, those of r as colour."""
    assert content.solution is not None
    check = content.solution.check
    compared = np.isfinite(check.errors).any(axis=1) & np.isfinite(check.solved[:, :2]).all(axis=1)
    places, errors = check.solved[compared], np.nan_to_num(check.errors[compared])
    bounds = error_bounds(content)
    axes = plane_axes(figure, bounds, BESIDE)
    if content.ortho is not None:
        picture, extent = content.ortho
        axes.imshow(picture, extent=extent_of(extent), alpha=0.35, interpolation="antialiased")
        axes.set(xlim=bounds[::2], ylim=bounds[1::2])
    zoom = error_zoom(content)
    reach = max(float(np.abs(errors[:, 2]).max(initial=0.0)), 1e-4) * 1000
    colours = {"c": errors[:, 2] * 1000, "vmin": -reach, "vmax": reach}
    dots = axes.scatter(*places[:, :2].T, **colours, **_styles()["error"])
    if {"X", "Y"} & {*compared_axes(content)}:
        axes.quiver(*places[:, :2].T, *zoom * errors[:, :2].T, **_styles()["error_arrow"])
    colour_bar(figure, dots, say("error_of"))
    scale_bar(axes, bounds)


def compared_axes(content: PairContent) -> list[str]:
    """Return which of X, Y, r were known of any compared point."""
    assert content.solution is not None
    errors = content.solution.check.errors
    return [name for k, name in enumerate("XYr") if np.isfinite(errors[:, k]).any()]


def error_zoom(content: PairContent) -> float:
    """Return by how much errors are enlarged: a round number that shows the usual ones."""
    assert content.solution is not None
    errors = content.solution.check.errors[:, :2]
    usual = float(np.nanpercentile(np.abs(errors), 90)) if np.isfinite(errors).any() else 0.001
    x_min, _, x_max, _ = error_bounds(content)
    return float(10 ** np.floor(np.log10(0.08 * (x_max - x_min) / max(usual, 1e-6))))


def error_bounds(content: PairContent) -> Bounds:
    """Return the part of the wall that holds the compared points and some margin. [m]"""
    if content.ortho is not None:
        return content.ortho[1]
    assert content.solution is not None
    places = content.solution.check.solved[:, :2]
    places = places[np.isfinite(places).all(axis=1)]
    low, high = places.min(axis=0), places.max(axis=0)
    margin = 0.12 * max(float((high - low).max()), 0.1)
    left, bottom, right, top = np.r_[low - margin, high + margin].tolist()
    return left, bottom, right, top


def draw_histogram(figure: Any, content: PairContent, say: Words) -> None:
    """Draw how the errors of each axis are spread."""
    assert content.solution is not None
    errors = 1000 * content.solution.check.errors
    reach = max(float(np.nanmax(np.abs(errors))), 0.1)
    edges = np.linspace(-reach, reach, 16)
    hatches = {"X": "///", "Y": "...", "r": ""}
    for index, name in enumerate(compared_axes(content)):
        axes = figure.add_axes((0.08 + 0.315 * index, 0.24, 0.27, 0.66))
        values, hatch = errors[:, "XYr".index(name)], hatches[name]
        axes.hist(values[np.isfinite(values)], edges, color="0.75", edgecolor="black", hatch=hatch)
        axes.axvline(0, color="black", lw=0.8)
        axes.set_xlabel(f"{name} [mm]", fontsize=8)
        axes.tick_params(labelsize=7)
        axes.yaxis.get_major_locator().set_params(integer=True)
        if index == 0:
            axes.set_ylabel(say("count_axis"), fontsize=8)


def _reduced(relief: ReliefMap) -> ReliefMap:
    """Return a map of at most `SIDE` pixels a side, every so many of its pixels."""
    step = max(1, -(-max(relief.shape) // SIDE))
    cut = np.s_[::step, ::step]
    matrix = relief.plane_from_pixel @ np.diag([step, step, 1.0])
    r, sigma, quality = relief.r[cut], relief.sigma[cut], relief.quality[cut]
    return ReliefMap(r=r, sigma=sigma, quality=quality, plane_from_pixel=matrix)


def _map_axes(figure: Any, content: PairContent) -> tuple[Any, ReliefMap, Bounds]:
    """Return axes for the relief map with room for a colour bar, the map reduced, its bounds."""
    relief = content.relief
    assert relief is not None
    axes = plane_axes(figure, relief.bounds, BESIDE)
    axes.set_facecolor(_UNKNOWN)
    return axes, _reduced(relief), relief.bounds


def plane_axes(figure: Any, bounds: Bounds, place: tuple[float, float, float, float]) -> Any:
    """Return axes of a part of the wall, to scale. [m]"""
    axes = figure.add_axes(place)
    axes.set(aspect="equal", xlim=bounds[::2], ylim=bounds[1::2])
    axes.set_xlabel("X [m]", fontsize=8)
    axes.set_ylabel("Y [m]", fontsize=8)
    axes.tick_params(labelsize=8)
    return axes


def colour_bar(figure: Any, image: Any, label: str, **more: Any) -> Any:
    """Draw the bar of what has colours; return its axes."""
    bar = figure.colorbar(image, cax=figure.add_axes(_BAR), **more)
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=7, which="both")
    return bar.ax


def extent_of(bounds: Bounds) -> tuple[float, float, float, float]:
    """Return bounds in the order that matplotlib takes. [m]"""
    x_min, y_min, x_max, y_max = bounds
    return x_min, x_max, y_min, y_max


def _inside(positions: FloatArray, bounds: Bounds) -> FloatArray:
    x_min, y_min, x_max, y_max = bounds
    x, y = positions.T
    return positions[(x >= x_min) & (x <= x_max) & (y >= y_min) & (y <= y_max)]


def scale_bar(axes: Any, bounds: Bounds) -> None:
    """Draw a bar of a round length in the lower left corner."""
    x_min, y_min, x_max, y_max = bounds
    length = 10 ** np.floor(np.log10(0.3 * (x_max - x_min)))
    x, y = x_min + 0.03 * (x_max - x_min), y_min + 0.035 * (y_max - y_min)
    for colour, width in (("white", 6.0), ("black", 3.0)):
        axes.plot([x, x + length], [y, y], color=colour, lw=width, solid_capstyle="butt", zorder=5)
    axes.annotate(f"{length:g} m", (x + length / 2, y), **_styles()["bar_length"])
