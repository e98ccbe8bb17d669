"""Survey workbooks made: their sheets, charts and sketch."""
