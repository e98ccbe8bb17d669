"""Refraction: the index of water, and where a straight ray would see a point in a tank.

    python examples/radial_shift.py

A camera 0.5 m above 10 mm of glass sees a point 0.2 m under it, 0.1 m beside the nadir.
"""

import numpy as np

import multimedia

n = multimedia.water_refractive_index(
    wavelength_nm=520, temperature_c=22.2, salinity_percent=0, depth=0.15
)
layers = multimedia.Layers(indices=(1.0, 1.5, float(n)), thicknesses=(0.01,))
z0, zp, radius = 0.5, 0.2, 0.1  # [m]
shifted = float(multimedia.radial_shift(radius, z0=z0, zp=zp, layers=layers))

# Follow the ray: it leaves the camera towards the shifted point and obeys Snell's law.
sine = np.sin(np.arctan2(shifted, z0 + 0.01 + zp))
heights = np.array([z0, 0.01, zp])
arrives = (heights * np.tan(np.arcsin(sine / np.array(layers.indices)))).sum()
print(f"index of water {float(n):.5f}")
print(f"radius {radius:.6f} m is seen at {shifted:.6f} m; the ray arrives at {arrives:.6f} m")
