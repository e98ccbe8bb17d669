"""Workbooks: cells read and changed in place, everything else byte for byte as it was."""
