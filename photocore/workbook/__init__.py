"""Spreadsheet files as packages: safe reading, in-place changes, fast writing, lint."""
