"""Pairs of one wall in one frame: ties between pairs, their control, one adjustment, its files."""
