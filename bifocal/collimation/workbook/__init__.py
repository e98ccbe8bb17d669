"""The survey workbook kept in step with the page."""
