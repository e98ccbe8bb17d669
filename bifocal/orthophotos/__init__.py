"""Orthophotos: rectification, visibility, composition, mosaics, drawings and print sheets."""
