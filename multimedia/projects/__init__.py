"""A photogrammetric project and its files: cameras, media, object points, image points."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
