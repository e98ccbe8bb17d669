"""Workbooks read: packages, sheets, cells, of .xlsx and .ods."""
