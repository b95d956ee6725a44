"""The explorer: a page in the browser on which a diagram grows, and each of its points shows its motion."""
