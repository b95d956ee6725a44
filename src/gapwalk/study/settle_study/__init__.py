"""The study of where a motion settles: the attractor with its evidence, rattle and spectrum."""
