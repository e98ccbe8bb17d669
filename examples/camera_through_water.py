"""Points in a tank projected into three cameras through glass and water, and intersected again.

    python examples/camera_through_water.py

Noise of a third of a micrometre stands for a good measurement of targets.
"""

import numpy as np

import multimedia

layers = multimedia.Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))
cameras = [
    multimedia.Camera.looking_at(eye, (0, 0, -0.1), principal_distance=25.0)
    for eye in ((0.3, 0.0, 0.5), (-0.3, 0.1, 0.5), (0.0, -0.3, 0.5))
]
rng = np.random.default_rng(7)
points = rng.uniform((-0.07, -0.06, -0.18), (0.07, 0.06, -0.02), (200, 3))  # [m]

images = np.stack([multimedia.project(camera, points, layers) for camera in cameras])  # [mm]
images += rng.normal(0.0, 0.00033, images.shape)
found = multimedia.intersect(cameras, images, layers, sigma=0.00033)
rms = np.sqrt(((found.xyz - points) ** 2).mean(axis=0))
expected = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2).mean(axis=0))

in_air = multimedia.intersect(cameras, images, None, sigma=0.00033)
print(f"RMS error X, Y, Z {', '.join(f'{1e6 * v:.1f}' for v in rms)} um")
print(f"expected          {', '.join(f'{1e6 * v:.1f}' for v in expected)} um")
print(f"refraction ignored, Z is wrong by {1000 * (in_air.xyz - points)[:, 2].mean():.1f} mm")
