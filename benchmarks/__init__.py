"""Benchmarks that compare gapwalk with SciPy in the same process: ``python -m benchmarks``."""
