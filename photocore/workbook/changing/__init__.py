"""Workbooks changed in place: only the cells that change; everything else byte for byte."""
