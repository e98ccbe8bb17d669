"""A workbook's own formulas, calculated.

Read `values` (what stands in cells) first, then `functions` (what signs and functions do), `syntax`
(the parts of a formula) and `calculation` (the tables, names and cells of a workbook).
"""
