"""Refraction: Snell's law, the radial shift and its derivatives, refractive indices."""
