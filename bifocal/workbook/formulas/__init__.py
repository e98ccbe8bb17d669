"""The formulas of the survey workbook and the names of its cells."""
