"""An analytic wall for tests: relief as a formula, visibility by stepping along rays."""

from __future__ import annotations

import numpy as np

from bifocal import Grid, Pair, Photo


def relief_at(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Pilasters, recessed windows, hoods, a half column, mouldings and a cornice. [m]"""
    r = np.zeros(np.broadcast(x, y).shape)
    for xc in (-1.6, -0.413, 0.81, 2.0):
        r = np.where(np.abs(x - xc) < 0.15, 0.25, r)
    for xc in (-1.0, 0.2, 1.4):
        window = (np.abs(x - xc) < 0.27) & (np.abs(y + 0.2) < 0.5)
        r = np.where(window, -0.35, r)
        r = np.where((np.abs(x - xc) < 0.33) & (np.abs(y - 0.38) < 0.06), 0.3, r)
    t = (x - 2.5) / 0.2
    r = np.where(np.abs(t) < 1, 0.1 + 0.3 * np.sqrt(np.clip(1 - t * t, 0, 1)), r)
    r = np.where(y > 0.9, np.clip((y - 0.9) / 0.3, 0, 1) * 0.5 + 0.05, r)
    return np.where(y > 1.25, 0.8, r)


def colour_at(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A smooth pattern, 0..255, that tells every place from its neighbours."""
    wave = np.sin(23 * x + 2 * np.sin(5 * y)) * np.cos(19 * y - 1.5 * np.sin(7 * x))
    return 127 + 100 * wave


def hidden_at(
    x: np.ndarray, y: np.ndarray, *, nadir: tuple[float, float], distance: float, step: float
) -> np.ndarray:
    """Step from every point towards the camera; hidden if the wall rises above the ray."""
    r = relief_at(x, y)
    dx, dy = nadir[0] - x, nadir[1] - y
    rho = np.hypot(dx, dy)
    reach = rho * (0.8 - r) / (distance - r)
    hidden = np.zeros(r.shape, bool)
    i = np.arange(r.size)
    flat = [a.ravel() for a in (x, y, dx, dy, r, rho, reach)]
    for t in np.arange(step, reach.max(), step):
        i = i[(t <= flat[6][i]) & ~hidden.ravel()[i]]
        px, py, ux, uy, pr, prho, _ = (a[i] for a in flat)
        share = t / prho
        height = pr + (distance - pr) * share
        hidden.ravel()[i] = relief_at(px + ux * share, py + uy * share) > height + 1e-9
    return hidden


def photo_of(photo: Photo, size: tuple[int, int], *, samples: int = 1) -> np.ndarray:
    """Photograph the wall by stepping along every pixel's ray, front to back. 8 bits, grey."""
    total = np.zeros((size[1], size[0]))
    for du in (np.arange(samples) + 0.5) / samples - 0.5:
        for dv in (np.arange(samples) + 0.5) / samples - 0.5:
            columns, rows = np.meshgrid(np.arange(size[0]) + du, np.arange(size[1]) + dv)
            q = photo.plane_from_pixels(np.stack([columns, rows], -1))
            q = q.reshape(-1, 2)

            def place(r: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
                share = 1 - r / photo.distance
                x, y = (photo.nadir[k] + (of[:, k] - photo.nadir[k]) * share for k in (0, 1))
                return x, y

            above, below = np.full(len(q), 0.81), np.full(len(q), -0.36)
            open_ = np.arange(len(q))
            for r in np.arange(0.80, -0.36, -0.01):
                hit = relief_at(*place(r, q[open_])) >= r
                below[open_[hit]] = r
                open_ = open_[~hit]
                above[open_] = r
            for _ in range(8):
                middle = (above + below) / 2
                hit = relief_at(*place(middle, q)) >= middle
                below, above = np.where(hit, middle, below), np.where(hit, above, middle)
            total += colour_at(*place(below, q)).reshape(total.shape)
    return np.rint(total / samples**2).astype(np.uint8)


def make_pair(gsd: float, size: tuple[int, int], centre: tuple[float, float]) -> Pair:
    """A pair square to the wall; both nadirs lie low on the left, away from the middle."""
    x0 = centre[0] - gsd * (size[0] - 1) / 2
    y0 = centre[1] + gsd * (size[1] - 1) / 2
    matrix = [[gsd, 0, x0], [0, -gsd, y0], [0, 0, 1]]
    return Pair(
        image1=Photo(plane_from_pixel=matrix, nadir=(-0.3, -0.9), distance=10.0, file="far.png"),
        image2=Photo(plane_from_pixel=matrix, nadir=(-0.3, -0.9), distance=6.0, file="near.png"),
    )


def wall_grid(
    gsd: float, bounds: tuple[float, float, float, float] = (-1.9, -0.9, 2.9, 1.5)
) -> Grid:
    """The part of the wall that tests look at."""
    return Grid.from_bounds(bounds, gsd=gsd)
