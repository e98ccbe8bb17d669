"""Particles over time: which are one, where they go, and how fast."""
