"""New workbooks: cells, live formulas, charts, looks."""
