"""Write radial_shift.json: radial shifts and their derivatives to 50 digits, with mpmath.

Independent of the package: bisection on the cosine of the angle in the thinnest
medium, in 80-digit arithmetic; derivatives by central differences of step 1e-25.
Run: python tests/golden/make_radial_shift.py
"""

from __future__ import annotations

import itertools
import json
import random
from pathlib import Path

import mpmath as mp

mp.mp.dps = 80

#: name, indices, heights (z0, thicknesses, zp)
SETUPS = [
    ("air glass water, mm", (1.0, 1.5, 1.34), (500.0, 10.0, 200.0)),
    ("air glass water, shallow", (1.0, 1.5, 1.34), (500.0, 10.0, 0.001)),
    ("air water, drone", (1.0, 1.337), (80.0, 3.5)),
    ("water glass air", (1.337, 1.5, 1.0), (200.0, 10.0, 500.0)),
    ("diver looking up", (1.333, 1.0), (4.0, 2.0)),
    ("flat port housing", (1.0, 1.49, 1.34), (20.0, 8.0, 3000.0)),
    ("thin air before the port", (1.0, 1.49, 1.34), (0.001, 8.0, 3000.0)),
    ("double glazing in water", (1.337, 1.52, 1.0, 1.52, 1.337), (0.3, 0.004, 1e-6, 0.004, 1.0)),
    ("five media", (1.0, 1.46, 1.2, 1.9, 1.34), (0.4, 0.01, 0.05, 0.02, 0.7)),
    ("equal media", (1.0, 1.0, 1.0), (0.4, 0.01, 0.7)),
    ("glass of no thickness", (1.0, 1.5, 1.337), (0.5, 0.0, 0.2)),
    ("deep sea", (1.0003, 1.337), (2.0, 8000.0)),
    ("camera on the glass", (1.0, 1.5, 1.337), (0.0, 0.01, 0.2)),
    ("camera on the glass, from water", (1.337, 1.5, 1.0), (0.0, 0.01, 0.2)),
    ("point on the interface, from water", (1.337, 1.5, 1.0), (0.2, 0.01, 0.0)),
    ("gas to gas", (1.0003, 1.00027), (3.0, 2.0)),
]

RATIOS = [0.0, 1e-12, 1e-3, 0.05, 0.3, 0.77, 1.0, 1.7, 5.0, 40.0, 1e4]


def shifted(radius, heights, indices):
    """Return R bar, or None where no ray exists."""
    if radius == 0:
        return mp.mpf(0)
    seen = [n for h, n in zip(heights, indices, strict=True) if h > 0]
    lowest = min([indices[0], *seen])

    def miss(cosine):
        # In terms of the cosine in the thinnest medium grazing rays keep their digits.
        sine = mp.sqrt(1 - cosine * cosine)
        total = -radius
        for h, n in zip(heights, indices, strict=True):
            if h > 0:
                total += h * lowest * sine / mp.sqrt(n * n - lowest**2 + (lowest * cosine) ** 2)
        return total

    low, high = mp.mpf(10) ** -35, mp.mpf(1)
    if miss(low) < 0:
        return None
    for _ in range(270):
        middle = mp.sqrt(low * high) if low < high / 4 else (low + high) / 2
        low, high = (middle, high) if miss(middle) > 0 else (low, middle)
    cosine = (low + high) / 2
    sine = mp.sqrt(1 - cosine * cosine)
    first = indices[0] ** 2 - lowest**2 + (lowest * cosine) ** 2
    return sum(heights) * lowest * sine / mp.sqrt(first)


def derivative(radius, heights, indices, which, place):
    """Return a central difference."""
    step = mp.mpf(10) ** -25
    values = []
    for sign in (1, -1):
        r, h, n = radius, list(heights), list(indices)
        if which == "radius":
            r += sign * step
        elif which == "height":
            h[place] += sign * step
        else:
            n[place] += sign * step
        values.append(shifted(r, h, n))
    return (values[0] - values[1]) / (2 * step)


def case(name, indices, heights, radius, *, with_derivatives):
    """Return one entry of the file; the inputs are exactly the float64 numbers printed."""
    r, h, n = mp.mpf(radius), [mp.mpf(v) for v in heights], [mp.mpf(v) for v in indices]
    bar = shifted(r, h, n)
    entry = {"name": name, "indices": indices, "heights": heights, "radius": radius}
    entry["radius_bar"] = None if bar is None else mp.nstr(bar, 50)
    if with_derivatives and bar:
        layers = range(len(n))
        entry["d_radius"] = mp.nstr(derivative(r, h, n, "radius", 0), 25)
        entry["d_heights"] = [mp.nstr(derivative(r, h, n, "height", i), 25) for i in layers]
        entry["d_indices"] = [mp.nstr(derivative(r, h, n, "index", i), 25) for i in layers]
    return entry


def main() -> None:
    """Write the file beside this script."""
    cases = []
    for (name, indices, heights), ratio in itertools.product(SETUPS, RATIOS):
        # Where the heights vanish or media are equal, one-sided or undefined: values only.
        smooth = min(heights) > 0 and len(set(indices)) == len(indices) and 1e-3 <= ratio <= 5
        radius = ratio * sum(heights)
        cases.append(case(name, indices, heights, radius, with_derivatives=smooth))
    rng = random.Random(20150724)
    for _ in range(150):
        layers = rng.randint(2, 5)
        indices = [round(rng.uniform(1.0, 1.9), 4) for _ in range(layers)]
        heights = [float(f"{10 ** rng.uniform(-4, 3):.6g}") for _ in range(layers)]
        radius = float(f"{sum(heights) * 10 ** rng.uniform(-4, 1.5):.9g}")
        cases.append(case("random", indices, heights, radius, with_derivatives=True))
    text = ",\n".join(json.dumps(entry) for entry in cases)
    Path(__file__).with_name("radial_shift.json").write_text(f"[\n{text}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
