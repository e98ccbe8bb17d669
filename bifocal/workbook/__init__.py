"""The survey workbook: read, solved, made anew, changed in place; points of any table alike."""
