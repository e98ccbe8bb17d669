"""The survey workbook: its layout, reading it, writing it, updating it in place."""
