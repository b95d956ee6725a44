"""Studies of reduced systems: the table ``[reduction]`` of a model file, and what the full system says of a result."""
