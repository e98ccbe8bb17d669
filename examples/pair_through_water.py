"""A bifocal pair before a tank: points through glass and water, and what air would make of them.

    python examples/pair_through_water.py

Noise of a third of a pixel stands for careful picks; a pixel is 1.5 mm in the tank.
"""

import numpy as np

import bifocal

square = [[0.0015, 0, -1.2], [0, -0.0015, 0.9], [0, 0, 1]]
pair = bifocal.Pair.from_dict(
    {
        "format": "bifocal-pair/1",
        "layers": {"indices": [1.0, 1.49, 1.337], "thicknesses": [0.01]},
        "image1": {"plane_from_pixel": square, "nadir": [0, 0], "distance": 3.5, "z0": 2.6},
        "image2": {"plane_from_pixel": square, "nadir": [0, 0], "distance": 1.9, "z0": 1.0},
    }
)
rng = np.random.default_rng(7)
points = rng.uniform((0.3, 0.2, -0.2), (1.0, 0.7, 0.3), (400, 3))  # X, Y, relief [m]
picks = [seen + rng.normal(0.0, 0.33, seen.shape) for seen in pair.project(points)]  # [px]

found = pair.intersect(*picks, sigma_px=0.33)
rms = np.sqrt(((found.xyz - points) ** 2).mean(axis=0))
expected = np.sqrt((found.sigma**2).mean(axis=0))
in_air = pair.in_air().intersect(*picks)
print(f"RMS error X, Y, r {', '.join(f'{1000 * v:.2f}' for v in rms)} mm")
print(f"expected          {', '.join(f'{1000 * v:.2f}' for v in expected)} mm")
print(f"refraction ignored, r is wrong by {1000 * (in_air.xyz - points)[:, 2].mean():.0f} mm")
