"""The whole diagram, as a function and as a study."""
