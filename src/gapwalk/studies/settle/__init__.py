"""The study of settling onto a steady motion."""
