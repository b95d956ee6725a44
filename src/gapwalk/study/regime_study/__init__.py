"""The study of a regime map: kinds of motion in the plane of two parameters."""
