"""The drawing of a machine, made from its model: bodies, what connects them, loads, and how they move."""
