"""Machines of other programs and of the literature, with orbits that were computed without gapwalk."""
