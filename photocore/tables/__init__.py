"""Tables people bring, read tolerantly: .xlsx, .xlsm, .ods and .csv."""

from photocore.tables.csvwrite import FLAVOURS, write_csv
from photocore.tables.model import Column, NamedValues, Table, parse_column_map
from photocore.tables.named_values import read_named_values
from photocore.tables.read import open_tables, read_table

__all__ = [
    "FLAVOURS",
    "Column",
    "NamedValues",
    "Table",
    "open_tables",
    "parse_column_map",
    "read_named_values",
    "read_table",
    "write_csv",
]
