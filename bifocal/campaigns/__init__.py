"""Campaigns: whole surveys of many pairs, step by step, resumable, on any number of machines."""
