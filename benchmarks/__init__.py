"""How fast gapwalk is, each line beside SciPy in the same process: ``python -m benchmarks``."""
