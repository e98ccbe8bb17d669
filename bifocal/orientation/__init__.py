"""Orientation of a pair: control, ties, cameras, reference plane, homologous points."""
