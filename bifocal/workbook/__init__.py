"""The survey workbook: read, solved, made anew, changed in place; points of any table alike."""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
