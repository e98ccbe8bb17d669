"""Refraction correction of depths, the water level, point clouds and elevation models."""
