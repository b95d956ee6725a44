"""Measured records, their alignment with computed motions, and parameters fitted to them."""
