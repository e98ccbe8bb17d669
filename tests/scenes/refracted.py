"""Where a pair's photos show points behind plane-parallel media, to 50 digits, by shooting rays.

Independent of the package: vector Snell at every interface in turn, in the plane frame, and
Newton's method on the direction of the ray until it passes through the point.
"""

from __future__ import annotations

from functools import cache

import mpmath as mp
import numpy as np


def _shot(direction, camera, normal, z0, indices, thicknesses):
    """Return place and direction of a ray behind the last interface."""
    place, way = mp.matrix(camera), direction / mp.norm(direction)
    depths = [z0]
    for thickness in thicknesses:
        depths.append(depths[-1] + thickness)
    first = place.copy()
    for depth, before, after in zip(depths, indices, indices[1:], strict=False):
        # The plane (x - camera) . n = -depth, with n towards the camera.
        so_far = mp.fdot(place - first, normal)
        place = place + way * ((-depth - so_far) / mp.fdot(way, normal))
        cosine = -mp.fdot(way, normal)
        ratio = mp.mpf(before) / mp.mpf(after)
        bent = mp.sqrt(1 - ratio**2 * (1 - cosine**2))
        way = way * ratio + normal * (ratio * cosine - bent)
    return place, way


def seen_at(point, *, nadir, distance, z0, indices, thicknesses, normal=(0, 0, 1)):
    """Return the apparent position of a point on the reference plane, shape (2,). [m]"""
    lists = (point, (*nadir, distance), indices, thicknesses, normal)
    return np.array(_seen_at(float(z0), *(tuple(map(float, values)) for values in lists)))


@cache  # many tests ask for the same points
def _seen_at(z0, point, centre, indices, thicknesses, normal):
    with mp.workdps(60):
        camera = [mp.mpf(v) for v in centre]
        target = mp.matrix([mp.mpf(v) for v in point])
        axis = mp.matrix([mp.mpf(v) for v in normal])
        axis = axis / mp.norm(axis)
        media = (
            axis,
            mp.mpf(z0),
            [mp.mpf(n) for n in indices],
            [mp.mpf(t) for t in thicknesses],
        )

        def miss(x, y):
            place, way = _shot(mp.matrix([x, y, -1]), camera, *media)
            share = (target[2] - place[2]) / way[2]
            return [place[k] + share * way[k] - target[k] for k in (0, 1)]

        straight = [(target[k] - camera[k]) / (camera[2] - target[2]) for k in (0, 1)]
        way = mp.findroot(miss, straight, tol=1e-100, maxsteps=60)
        return [float(camera[k] + way[k] * camera[2]) for k in (0, 1)]


def pixels_of(photo, points, layers):
    """Return the pixels of points in a photo given as the pair file gives it, shape (n, 2)."""
    shown = [
        seen_at(
            point,
            nadir=photo["nadir"],
            distance=photo["distance"],
            z0=photo["z0"],
            indices=layers["indices"],
            thicknesses=layers["thicknesses"],
            normal=photo.get("interface_normal", (0, 0, 1)),
        )
        for point in points
    ]
    inverse = np.linalg.inv(np.array(photo["plane_from_pixel"]))
    pixels = np.column_stack([shown, np.ones(len(shown))]) @ inverse.T
    return pixels[:, :2] / pixels[:, 2:]
