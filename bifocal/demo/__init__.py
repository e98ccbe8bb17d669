"""The whole workflow on a rendered sample pair with exact truth."""
