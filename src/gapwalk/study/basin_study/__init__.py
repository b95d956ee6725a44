"""The study of basins of attraction in a plane of initial states."""
