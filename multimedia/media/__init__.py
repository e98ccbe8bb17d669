"""Cameras and what lies between camera and object: interfaces, ray tracing, projection."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
