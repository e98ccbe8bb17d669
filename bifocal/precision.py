"""Precision in closed form: error propagation through Midulla's equations."""
