"""Frozen objects every room speaks of: pair, photo, lens, grid, relief map, surface, points."""
