"""Completeness of detection: special points at default settings beside those of a walk with 20 times smaller steps."""
