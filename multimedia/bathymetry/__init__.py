"""Refraction correction of depths, the water level, point clouds and elevation models."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
