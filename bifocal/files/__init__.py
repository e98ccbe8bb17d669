"""Rasters, photos and point files that several rooms read and write; no mathematics."""
