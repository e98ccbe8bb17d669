"""Orientation of a pair: control, ties, cameras, reference plane, homologous points."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
