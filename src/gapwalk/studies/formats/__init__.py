"""Formats in which the tables of results are written: one file a format."""
