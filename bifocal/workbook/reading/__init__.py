"""Surveys read: workbooks, tables, lists of picks."""
