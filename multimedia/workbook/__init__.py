"""Radial shift and refractive index as tables and live workbooks."""
