"""The study of a sweep: settled motions over one parameter."""
