"""Keeping results: one codec for all records, and one file format for all of them."""
