"""The image of a point through parallel layers in 40 digits, written from the papers alone.

It shares nothing with the code under test: Snell's law is solved by bisection for the angle in
air, and the distortion formulas are typed from their definitions.
"""

from __future__ import annotations

import mpmath as mp

mp.mp.dps = 40


def rotation(omega, phi, kappa):
    """Rx Ry Rz, multiplied out by mpmath."""
    rx = mp.matrix(
        [[1, 0, 0], [0, mp.cos(omega), -mp.sin(omega)], [0, mp.sin(omega), mp.cos(omega)]]
    )
    ry = mp.matrix([[mp.cos(phi), 0, mp.sin(phi)], [0, 1, 0], [-mp.sin(phi), 0, mp.cos(phi)]])
    rz = mp.matrix(
        [[mp.cos(kappa), -mp.sin(kappa), 0], [mp.sin(kappa), mp.cos(kappa), 0], [0, 0, 1]]
    )
    return rx * ry * rz


def apparent_radius(radius, heights, indices):
    """R_bar from R by bisection on the sine in the first medium (Maas 2015, Eqs. 1 to 3)."""
    if radius == 0:
        return mp.mpf(0)
    largest = min(1, min(indices) / indices[0])
    low, high = mp.mpf(0), mp.mpf(largest)

    def reached(sine):
        return sum(
            h * (indices[0] * sine / n) / mp.sqrt(1 - (indices[0] * sine / n) ** 2)
            for h, n in zip(heights, indices, strict=True)
        )

    for _ in range(140):
        middle = (low + high) / 2
        if reached(middle) < radius:
            low = middle
        else:
            high = middle
    return sum(heights) * low / mp.sqrt(1 - low**2)


def image(parameters, point):
    """Image coordinates for a dict of all parameters; see test_projection for its keys."""
    q = {
        k: mp.mpf(v) if not isinstance(v, (str, list, tuple)) else v for k, v in parameters.items()
    }
    r = rotation(q["omega"], q["phi"], q["kappa"])
    centre = mp.matrix([q["X0"], q["Y0"], q["Z0"]])
    d = mp.matrix([mp.mpf(v) for v in point]) - centre
    face = mp.matrix([mp.mpf(v) for v in q["face"]])
    normal = mp.matrix([mp.mpf(v) for v in q["normal"]])
    normal = normal / mp.norm(normal)
    if q["moves"] == "yes":
        face, normal = centre + r * face, r * normal
    indices = [mp.mpf(v) for v in q["indices"]]
    inner = [mp.mpf(v) for v in q["thicknesses"]]
    height = (normal.T * (centre - face))[0]
    along = (normal.T * d)[0]
    across = d - along * normal
    radius = mp.norm(across)
    heights = [height - sum(inner), *inner, -along - height]
    seen = d
    if radius > 0:
        seen = along * normal + across * (apparent_radius(radius, heights, indices) / radius)
    u = r.T * seen
    x, y = -q["c"] * u[0] / u[2], -q["c"] * u[1] / u[2]
    convention = q["convention"]
    if convention == "photogrammetric":

        def miss(a, b):
            m = brown(q, a, b)
            return [m[0] - x, m[1] - y]

        a, b = mp.findroot(miss, (x, y), tol=mp.mpf(10) ** -60)
        return a + q["xh"], b + q["yh"]
    if convention == "openptv":
        return brown(q, x + q["xh"], y + q["yh"])
    a, b = brown(q, x, y)
    return a + q["xh"], b + q["yh"]


def brown(q, x, y):
    """Radial, decentring, then the axes."""
    r2 = x**2 + y**2
    radial = q["k1"] * r2 + q["k2"] * r2**2 + q["k3"] * r2**3
    a = x + x * radial + q["p1"] * (r2 + 2 * x**2) + 2 * q["p2"] * x * y
    b = y + y * radial + q["p2"] * (r2 + 2 * y**2) + 2 * q["p1"] * x * y
    return q["scale"] * a - mp.sin(q["shear"]) * b, mp.cos(q["shear"]) * b


def derivative(function, step="1e-12"):
    """Central difference; 40 digits leave 16 good ones at this step."""
    h = mp.mpf(step)
    plus, minus = function(h), function(-h)
    return [float((p - m) / (2 * h)) for p, m in zip(plus, minus, strict=True)]
