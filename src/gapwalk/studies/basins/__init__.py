"""Basins of attraction as jobs: of a plane, or of random starts; chunk by chunk, checked, and stored."""
