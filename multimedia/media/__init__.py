"""Frozen objects that describe the survey, checked when they are made."""
