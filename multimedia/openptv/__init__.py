"""OpenPTV experiments in and out."""
