"""Workbooks of the user changed in place."""
